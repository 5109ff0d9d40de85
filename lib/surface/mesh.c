// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What a place on a mesh is: its normal, its texture coordinates, its border.
 *
 * The normal on an edge is the middle of its faces', and at a corner that of the faces
 * around it weighted by their angles: with it the sign of (p - nearest) · normal tells
 * inside from outside exactly (Bærentzen & Aanæs 2005), which a face's does not.
 */
#include <stdlib.h>
#include "mesh.h"

void mesh_free(struct mesh *mesh)
{
	if (!mesh)
		return;
	free(mesh->vertex);
	free(mesh->normal);
	free(mesh->corner);
	free(mesh->neighbour);
	free(mesh->number);
	free(mesh->uv);
	bvh_free(&mesh->bvh);
	free(mesh);
}

size_t mesh_memory(const struct mesh *mesh)
{
	size_t triangle = sizeof(*mesh->corner) + sizeof(*mesh->neighbour) +
			  sizeof(*mesh->number) + (mesh->uv ? sizeof(*mesh->uv) : 0);

	return sizeof(*mesh) + mesh->n_triangles * triangle +
	       mesh->n_vertices * (sizeof(*mesh->vertex) + sizeof(*mesh->normal)) +
	       mesh->bvh.n_nodes * sizeof(*mesh->bvh.node);
}

static void corners(const struct mesh *mesh, uint32_t face, const double *corner[3])
{
	for (int i = 0; i < 3; i++)
		corner[i] = mesh->vertex[mesh->corner[face][i]];
}

static void face_normal(const struct mesh *mesh, uint32_t face, double normal[3])
{
	const double *corner[3];
	double n[3], length;

	corners(mesh, face, corner);
	triangle_area_normal(n, corner[0], corner[1], corner[2]);
	length = v3_length(n);
	for (int i = 0; i < 3; i++)
		normal[i] = n[i] / length;
}

static void spot_normal(const struct mesh *mesh, const struct mesh_spot *spot,
			double normal[3])
{
	double other[3], sum[3];
	uint32_t behind;

	if (spot->part >= TRIANGLE_CORNER) {
		v3_copy(normal, mesh->normal[mesh->corner[spot->face]
							 [spot->part - TRIANGLE_CORNER]]);
		return;
	}
	face_normal(mesh, spot->face, normal);
	if (spot->part == TRIANGLE_FACE)
		return;
	behind = mesh->neighbour[spot->face][spot->part - TRIANGLE_EDGE];
	if (behind == MESH_NONE)
		return;
	face_normal(mesh, behind, other);
	v3_add(sum, normal, 1, other);
	/* Two faces back to back have no middle; either one's will do. */
	v3_unit(normal, sum, 1e-12);
}

/* The parts of the face's corners in a spot of it; their sum is 1. */
static void weights(const struct mesh *mesh, const struct mesh_spot *spot,
		    double weight[3])
{
	const double *corner[3];
	double n[3], sum = 0;

	weight[0] = weight[1] = weight[2] = 0;
	corners(mesh, spot->face, corner);
	if (spot->part >= TRIANGLE_CORNER) {
		weight[spot->part - TRIANGLE_CORNER] = 1;
		return;
	}
	if (spot->part >= TRIANGLE_EDGE) {
		int a = spot->part - TRIANGLE_EDGE, b = (a + 1) % 3;

		weight[b] = sqrt(v3_distance2(spot->point, corner[a]) /
				 v3_distance2(corner[b], corner[a]));
		weight[a] = 1 - weight[b];
		return;
	}
	triangle_area_normal(n, corner[0], corner[1], corner[2]);
	for (int i = 0; i < 3; i++) {
		weight[i] = fmax(triangle_side(n, corner[(i + 1) % 3],
					       corner[(i + 2) % 3], spot->point),
				 0);
		sum += weight[i];
	}
	for (int i = 0; i < 3; i++)
		weight[i] = sum > 0 ? weight[i] / sum : 1 / 3.0;
}

void mesh_touch(const struct mesh *mesh, const struct mesh_spot *spot, const double p[3],
		struct incise_touch *touch)
{
	double out[3], distance;

	v3_copy(touch->point_mm, spot->point);
	spot_normal(mesh, spot, touch->normal);
	v3_sub(out, p, spot->point);
	distance = v3_length(out);
	touch->depth_mm = v3_dot(out, touch->normal) > 0 ? -distance : distance;
	touch->face = (int)mesh->number[spot->face];
	touch->uv[0] = touch->uv[1] = 0;
	if (mesh->uv) {
		double weight[3];

		weights(mesh, spot, weight);
		for (int k = 0; k < 2; k++)
			for (int i = 0; i < 3; i++)
				touch->uv[k] += weight[i] * mesh->uv[spot->face][i][k];
	}
}

/* p lies over the border at an edge of a face: within its plane, outside of the edge. */
static bool over_edge(const struct mesh *mesh, uint32_t face, int edge, const double p[3])
{
	const double *corner[3];
	double n[3];

	if (mesh->neighbour[face][edge] != MESH_NONE)
		return false;
	corners(mesh, face, corner);
	triangle_area_normal(n, corner[0], corner[1], corner[2]);
	return triangle_side(n, corner[edge], corner[(edge + 1) % 3], p) < 0;
}

bool mesh_beyond_border(const struct mesh *mesh, const struct mesh_spot *spot,
			const double p[3])
{
	struct mesh_fan fan;
	uint32_t face, vertex;

	if (spot->part == TRIANGLE_FACE)
		return false;
	if (spot->part < TRIANGLE_CORNER)
		return over_edge(mesh, spot->face, spot->part - TRIANGLE_EDGE, p);
	vertex = mesh->corner[spot->face][spot->part - TRIANGLE_CORNER];
	fan = mesh_fan(spot->face, vertex);
	while (mesh_fan_face(mesh, &fan, &face)) {
		int i = mesh_corner_of(mesh, face, vertex);

		if (over_edge(mesh, face, i, p) || over_edge(mesh, face, (i + 2) % 3, p))
			return true;
	}
	return false;
}

/* The place nearest to @middle among those of a face that are @top high; false if none. */
static bool top_of_face(const struct mesh *mesh, uint32_t face, double top,
			const double middle[3], struct mesh_spot *spot)
{
	const double *corner[3];
	bool high[3];
	int n = 0;

	corners(mesh, face, corner);
	for (int i = 0; i < 3; i++) {
		high[i] = corner[i][2] >= top;
		n += high[i];
	}
	spot->face = face;
	if (n == 3) {
		spot->part = mesh_on_face(mesh, face, middle, spot->point);
	} else {
		for (int i = 0; i < 3; i++) {
			int next = (i + 1) % 3, end;

			if (n == 1 && high[i]) {
				v3_copy(spot->point, corner[i]);
				spot->part = TRIANGLE_CORNER + i;
			} else if (n == 2 && high[i] && high[next]) {
				triangle_edge_nearest(corner[i], corner[next], middle,
						      spot->point, &end);
				spot->part = end < 0	? TRIANGLE_EDGE + i
					     : end == 0 ? TRIANGLE_CORNER + i
							: TRIANGLE_CORNER + next;
			}
		}
	}
	return n > 0;
}

void mesh_top(const struct mesh *mesh, struct incise_touch *touch)
{
	double lo[3], hi[3], middle[3], best = INFINITY;
	struct mesh_spot top = {0}, spot;

	v3_copy(lo, mesh->vertex[0]);
	v3_copy(hi, mesh->vertex[0]);
	for (uint32_t v = 1; v < mesh->n_vertices; v++) {
		for (int i = 0; i < 3; i++) {
			lo[i] = fmin(lo[i], mesh->vertex[v][i]);
			hi[i] = fmax(hi[i], mesh->vertex[v][i]);
		}
	}
	for (int i = 0; i < 2; i++)
		middle[i] = lo[i] / 2 + hi[i] / 2;
	middle[2] = hi[2];
	for (uint32_t face = 0; face < mesh->n_triangles; face++) {
		if (!top_of_face(mesh, face, hi[2], middle, &spot) ||
		    v3_distance2(spot.point, middle) >= best)
			continue;
		best = v3_distance2(spot.point, middle);
		top = spot;
	}
	mesh_touch(mesh, &top, top.point, touch);
}
