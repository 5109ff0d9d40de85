/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A triangle mesh as a proxy needs it: corners, neighbours, normals that give the sign of
 * a distance, and a tree of boxes. Lengths in mm.
 *
 * Triangles lie in the order of the tree and vertices in the order of the triangles, so that neighbours in space
 * are near in memory. Each vertex has one fan of triangles around it: where two fans meet in a point only, that
 * point is two vertices, and a proxy does not pass from the one fan to the other.
 */
#ifndef INCISE_MESH_H
#define INCISE_MESH_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/surface.h>
#include "../base/vector.h"

/*
 * The point of a triangle that is nearest to a point, and the part of the triangle that
 * it lies on.
 *
 *              c               FACE          within
 *            ╱   ╲             EDGE + i      between corner i and the next
 *    EDGE+2 ╱     ╲ EDGE+1     CORNER + i    at corner i
 *          ╱       ╲
 *         a ─────── b          seen from outside: a, b, c turn counter-clockwise
 *           EDGE+0
 *
 * Signs decide which part it is, not a distance to a border, and the point on an
 * edge is computed from the edge's two ends only, in an order of their own. So the two
 * faces of an edge, and all faces around a corner, find the same point to the bit, and a
 * walk from face to face needs no epsilon.
 */
enum triangle_part { TRIANGLE_FACE = 0, TRIANGLE_EDGE = 1, TRIANGLE_CORNER = 4 };

static inline double v3_distance2(const double a[3], const double b[3])
{
	double d[3];

	v3_sub(d, a, b);
	return v3_dot(d, d);
}

/* Outward, as long as twice the area. */
static inline void triangle_area_normal(double n[3], const double *a, const double *b,
					const double *c)
{
	double ab[3], ac[3];

	v3_sub(ab, b, a);
	v3_sub(ac, c, a);
	v3_cross(n, ab, ac);
}

/* Towards the inside of the triangle at its edge from a to b: > 0 inside of it. */
static inline double triangle_side(const double n[3], const double *a, const double *b,
				   const double p[3])
{
	double ab[3], in[3], ap[3];

	v3_sub(ab, b, a);
	v3_sub(ap, p, a);
	v3_cross(in, n, ab);
	return v3_dot(in, ap);
}

/*
 * The nearest point of an edge; @end is 0 at a, 1 at b, -1 between them. Its ends are
 * taken in the order of their addresses, which both faces of the edge agree on.
 */
static inline void triangle_edge_nearest(const double *a, const double *b,
					 const double p[3], double x[3], int *end)
{
	const double *lo = a < b ? a : b, *hi = a < b ? b : a;
	double e[3], w[3], along, whole;

	v3_sub(e, hi, lo);
	v3_sub(w, p, lo);
	along = v3_dot(w, e);
	whole = v3_dot(e, e);
	*end = -1;
	if (along <= 0) {
		v3_copy(x, lo);
		*end = lo == b;
	} else if (along >= whole) {
		v3_copy(x, hi);
		*end = hi == b;
	} else {
		v3_add(x, lo, along / whole, e);
	}
}

/* The nearest point of the triangle to p, and its part. Slivers are as good as others. */
static inline int triangle_nearest(const double *const corner[3], const double p[3],
				   double x[3])
{
	double n[3], best = INFINITY;
	bool outside = false;
	int part = TRIANGLE_FACE;

	triangle_area_normal(n, corner[0], corner[1], corner[2]);
	for (int i = 0; i < 3; i++) {
		const double *a = corner[i], *b = corner[i == 2 ? 0 : i + 1];
		double y[3], d;
		int end;

		if (triangle_side(n, a, b, p) >= 0)
			continue;
		outside = true;
		triangle_edge_nearest(a, b, p, y, &end);
		d = v3_distance2(y, p);
		if (!(d < best))
			continue;
		best = d;
		v3_copy(x, y);
		part = end < 0	  ? TRIANGLE_EDGE + i
		       : end == 0 ? TRIANGLE_CORNER + i
				  : TRIANGLE_CORNER + (i == 2 ? 0 : i + 1);
	}
	if (!outside) {
		double ap[3];

		v3_sub(ap, p, corner[0]);
		v3_add(x, p, -v3_dot(ap, n) / v3_dot(n, n), n);
	}
	return part;
}

/*
 * A tree of boxes around triangles, in mm. Each node holds the boxes of its two children,
 * so that one cache line decides where to go on. Boxes are in float, rounded outwards
 * and then a little wider, so that no rounding in a query can miss what lies on a side.
 */
/* A child is a node's index, or a leaf: a run of up to 7 triangles. */
#define BVH_LEAF 0x80000000u
#define BVH_FIRST(child) ((child)&0x0fffffffu)
#define BVH_COUNT(child) (((child) >> 28) & 7u)

/* Halving 2^28 triangles down to leaves of two is 27 levels deep. */
#define BVH_DEPTH_MAX 32

struct bvh_node {
	float lo[2][3], hi[2][3];
	uint32_t child[2];
	uint32_t unused[2]; /* to 64 bytes */
};

struct bvh {
	struct bvh_node *node;
	uint32_t n_nodes;
};

/* From a double to a float that is surely below it (or above it, for @up). */
float bvh_outwards(double x, int up);

/*
 * Build a tree over n ≥ 1 boxes; order[i] is the box that became the i-th of the leaves.
 * Takes n log n steps. Returns 0 or -ENOMEM.
 */
int bvh_build(struct bvh *bvh, const float (*box)[2][3], uint32_t n, uint32_t *order);
void bvh_free(struct bvh *bvh);

/* Triangles of a mesh at most. */
#define INCISE_SURFACE_TRIANGLES_MAX 4000000

#define MESH_NONE UINT32_MAX

/* Coordinates larger than this are not a tissue's; a double then holds 2e-11 mm. */
#define MESH_COORDINATE_MAX_MM 1e5

/* A triangle less high than this, which is 50 times that, has no normal to speak of. */
#define MESH_HEIGHT_MIN_MM 1e-9

struct mesh {
	uint32_t n_vertices, n_triangles;
	bool open; /* it has a border */
	double (*vertex)[3];
	double (*normal)[3];	  /* of vertices: unit, weighted by angle */
	uint32_t (*corner)[3];	  /* vertices of a triangle */
	uint32_t (*neighbour)[3]; /* over the edge from corner i to the next */
	uint32_t *number;	  /* of a triangle in the file, from 0 */
	float (*uv)[3][2];	  /* of a triangle's corners; or NULL */
	struct bvh bvh;
};

/* The content of a file, as a reader returns it. */
struct mesh_draft {
	const char *path;
	size_t n_points, n_triangles;
	double (*point)[3];
	uint32_t (*corner)[3];
	float (*uv)[3][2]; /* or NULL */
	int *line;	   /* of each triangle, for messages; or NULL */
	bool cavity;	   /* closed pieces may have the tissue around them */
};

/* A place on a mesh. */
struct mesh_spot {
	uint32_t face;
	int part; /* of the face: enum triangle_part */
	double point[3];
};

/* NULL with errno EINVAL, E2BIG, ENOMEM. The draft stays the caller's. */
struct mesh *mesh_new(const struct mesh_draft *draft, struct incise_error *err);
void mesh_free(struct mesh *mesh);
size_t mesh_memory(const struct mesh *mesh);

/* Readers of files. NULL with errno as in incise_surface_load_mesh(). */
struct mesh *obj_load(const char *path, const double at_mm[3], bool cavity,
		      struct incise_error *err);
struct mesh *height_grid_load(const char *path, const double at_mm[3],
			      struct incise_error *err);

/* The touch of a point whose nearest place, or proxy, is a spot. */
void mesh_touch(const struct mesh *mesh, const struct mesh_spot *spot, const double p[3],
		struct incise_touch *touch) INCISE_REALTIME;

/* A border this near to another part of the mesh, such as at a seam, does not count. */
#define MESH_SEAM_MM 0.1

/*
 * The nearest spot is at the border of an open mesh, p lies over that border, and no other part
 * goes on there. Where one does, @next is a place on it that is nearer to p, or the spot itself.
 */
bool mesh_beyond_border(const struct mesh *mesh, const struct mesh_spot *spot,
			const double p[3], struct mesh_spot *next) INCISE_REALTIME;

/* The highest place; among several the one nearest to the middle. */
void mesh_top(const struct mesh *mesh, struct incise_touch *touch);

void mesh_size(const struct mesh *mesh, struct incise_surface_size *size);

/*
 * The nearest spot to p. Boxes beyond @share of the best distance so far are left out:
 * with 1 the spot is the nearest one; with less the search is shorter. @hint is a face to
 * begin with. Returns a distance that no part of the mesh is nearer than.
 */
double mesh_nearest(const struct mesh *mesh, const double p[3], uint32_t hint,
		    double share, struct mesh_spot *spot) INCISE_REALTIME;

/*
 * The first front face that the straight way meets at @least mm from its start or later.
 * It goes through no edge and no corner: a point on them counts as met. With @slack, the gap
 * of a seam counts as well, if it is no wider on each side.
 */
bool mesh_enters(const struct mesh *mesh, const double from[3], const double to[3],
		 double least, double slack, struct mesh_spot *spot) INCISE_REALTIME;

/*
 * Glide over the surface from a spot towards where p is nearest, at most @reach mm from
 * where it was. Returns whether it has got to the nearest place around; @tired: it ended because it is work enough
 * for a move.
 */
bool mesh_glide(const struct mesh *mesh, const double p[3], double reach,
		struct mesh_spot *spot, bool *tired) INCISE_REALTIME;

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
		/* A border: the rest lies on the other side of the first face. */
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
