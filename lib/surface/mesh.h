/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A triangle mesh as a proxy needs it: corners, neighbours, normals that give the sign of
 * a distance, and a tree of boxes. Lengths in mm.
 *
 * Triangles lie in the order of the tree and vertices in the order of the triangles, so
 * that what is near in space is near in memory. Each vertex has one fan of triangles
 * around it: where two fans meet in a point only, that point is two vertices, and a
 * proxy does not pass from the one fan to the other.
 */
#ifndef INCISE_MESH_H
#define INCISE_MESH_H

#include <stddef.h>
#include <stdint.h>
#include <incise/surface.h>
#include "bvh.h"
#include "triangle.h"

#define MESH_NONE UINT32_MAX

/* Coordinates larger than this are not a tissue's; a double then holds 2e-11 mm. */
#define MESH_COORDINATE_MAX_MM 1e5

/* A triangle less high than this, which is 50 times that, has no normal to speak of. */
#define MESH_HEIGHT_MIN_MM 1e-9

struct mesh {
	uint32_t n_vertices, n_triangles;
	double (*vertex)[3];
	double (*normal)[3];	  /* of vertices: unit, weighted by angle */
	uint32_t (*corner)[3];	  /* vertices of a triangle */
	uint32_t (*neighbour)[3]; /* over the edge from corner i to the next */
	uint32_t *number;	  /* of a triangle in the file, from 0 */
	float (*uv)[3][2];	  /* of a triangle's corners; or NULL */
	struct bvh bvh;
};

/* What a reader makes of a file. */
struct mesh_draft {
	const char *path;
	size_t n_points, n_triangles;
	double (*point)[3];
	uint32_t (*corner)[3];
	float (*uv)[3][2]; /* or NULL */
	int *line;	   /* of each triangle, for messages; or NULL */
};

/* A place on a mesh. */
struct mesh_spot {
	uint32_t face;
	int part; /* of the face: see triangle.h */
	double point[3];
};

/* NULL with errno EINVAL, E2BIG, ENOMEM. The draft stays the caller's. */
struct mesh *mesh_new(const struct mesh_draft *draft, struct incise_error *err);
void mesh_free(struct mesh *mesh);
size_t mesh_memory(const struct mesh *mesh);

/* The touch of a point whose nearest place, or proxy, is a spot. */
void mesh_touch(const struct mesh *mesh, const struct mesh_spot *spot, const double p[3],
		struct incise_touch *touch) INCISE_REALTIME;

/* The nearest spot is at the border of an open mesh, and p lies over that border. */
bool mesh_beyond_border(const struct mesh *mesh, const struct mesh_spot *spot,
			const double p[3]) INCISE_REALTIME;

/* The highest place; of many the one nearest to the middle. */
void mesh_top(const struct mesh *mesh, struct incise_touch *touch);

/*
 * The nearest spot to p. Boxes beyond @share of the best distance so far are left out:
 * with 1 the spot is the nearest one; with less the search is shorter. @hint is a face to
 * begin with. Returns a distance that no part of the mesh is nearer than.
 */
double mesh_nearest(const struct mesh *mesh, const double p[3], uint32_t hint,
		    double share, struct mesh_spot *spot) INCISE_REALTIME;

/*
 * The first front face that the straight way meets at @least mm from its start or later.
 * It goes through no edge and no corner: what lies on them counts as met.
 */
bool mesh_enters(const struct mesh *mesh, const double from[3], const double to[3],
		 double least, struct mesh_spot *spot) INCISE_REALTIME;

/*
 * Glide over the surface from a spot towards where p is nearest, at most @reach mm from
 * where it was. Returns whether it has got to the nearest place around.
 */
bool mesh_glide(const struct mesh *mesh, const double p[3], double reach,
		struct mesh_spot *spot) INCISE_REALTIME;

static inline int mesh_on_face(const struct mesh *mesh, uint32_t face, const double p[3],
			       double x[3])
{
	const uint32_t *c = mesh->corner[face];
	const double *const corner[3] = {mesh->vertex[c[0]], mesh->vertex[c[1]],
					 mesh->vertex[c[2]]};

	return triangle_nearest(corner, p, x);
}

static inline int mesh_corner_of(const struct mesh *mesh, uint32_t face, uint32_t vertex)
{
	const uint32_t *c = mesh->corner[face];

	return c[0] == vertex ? 0 : c[1] == vertex ? 1 : 2;
}

/* The next face around a vertex, counter-clockwise seen from outside or back. */
static inline uint32_t mesh_turn(const struct mesh *mesh, uint32_t face, uint32_t vertex,
				 bool ccw)
{
	int i = mesh_corner_of(mesh, face, vertex);

	return mesh->neighbour[face][ccw ? (i + 2) % 3 : i];
}

/*
 * The faces around a vertex, each once: for (it = mesh_fan(…); mesh_fan_face(…, &face);).
 */
struct mesh_fan {
	uint32_t vertex, first, next;
	bool ccw;
};

static inline struct mesh_fan mesh_fan(uint32_t face, uint32_t vertex)
{
	return (struct mesh_fan){vertex, face, face, true};
}

static inline bool mesh_fan_face(const struct mesh *mesh, struct mesh_fan *fan,
				 uint32_t *face)
{
	if (fan->next == MESH_NONE && fan->ccw) {
		/* A border: what is left lies on the other side of the first face. */
		fan->ccw = false;
		fan->next = mesh_turn(mesh, fan->first, fan->vertex, false);
	}
	if (fan->next == MESH_NONE)
		return false;
	*face = fan->next;
	fan->next = mesh_turn(mesh, *face, fan->vertex, fan->ccw);
	if (fan->ccw && fan->next == fan->first) {
		/* Once around. */
		fan->ccw = false;
		fan->next = MESH_NONE;
	}
	return true;
}

#endif
