// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Searches through the whole mesh by its tree of boxes: the nearest place, and where a
 * straight way enters first. Lengths in mm; no allocation.
 */
#include "mesh.h"

static double box_distance2(const float lo[3], const float hi[3], const double p[3])
{
	double sum = 0;

	for (int i = 0; i < 3; i++) {
		double below = lo[i] - p[i], above = p[i] - hi[i];
		double out = below > above ? below : above;

		if (out > 0)
			sum += out * out;
	}
	return sum;
}

static void nearer_face(const struct mesh *mesh, uint32_t face, const double p[3],
			struct mesh_spot *spot, double *best)
{
	double x[3], d;
	int part = mesh_on_face(mesh, face, p, x);

	d = v3_distance2(x, p);
	if (!(d < *best))
		return;
	*best = d;
	spot->face = face;
	spot->part = part;
	v3_copy(spot->point, x);
}

double mesh_nearest(const struct mesh *mesh, const double p[3], uint32_t hint,
		    double share, struct mesh_spot *spot)
{
	struct {
		uint32_t child;
		double distance2;
	} stack[BVH_DEPTH_MAX];
	double best = INFINITY, least = INFINITY, share2 = share * share, distance2 = 0;
	uint32_t child = 0;
	int depth = 0;

	nearer_face(mesh, hint < mesh->n_triangles ? hint : 0, p, spot, &best);
	for (;;) {
		if (distance2 > share2 * best) {
			least = distance2 < least ? distance2 : least;
		} else if (child & BVH_LEAF) {
			for (uint32_t k = 0; k < BVH_COUNT(child); k++)
				nearer_face(mesh, BVH_FIRST(child) + k, p, spot, &best);
		} else {
			const struct bvh_node *node = mesh->bvh.node + child;
			double d0 = box_distance2(node->lo[0], node->hi[0], p);
			double d1 = box_distance2(node->lo[1], node->hi[1], p);
			int far = d0 < d1;

			stack[depth].child = node->child[far];
			stack[depth++].distance2 = far ? d1 : d0;
			child = node->child[!far];
			distance2 = far ? d0 : d1;
			continue;
		}
		if (!depth)
			break;
		child = stack[--depth].child;
		distance2 = stack[depth].distance2;
	}
	/* The squares' rounding is far below this. */
	return sqrt(fmin(best, least)) * (1 - 1e-9);
}

/*
 * A straight way, and what a watertight test with triangles needs of it (Woop, Benthin,
 * Wald 2013): axes with the longest one last, and a shear that lays the way along it. A
 * vertex then has the same two coordinates in each of its triangles, and an edge's sign
 * for the one face is exactly the opposite for the other.
 */
struct way {
	const double *from;
	double along[3], inverse[3], shear[3];
	int axis[3];
	double least; /* part of the way */
};

static bool way_new(struct way *way, const double from[3], const double to[3],
		    double least)
{
	double *d = way->along, largest;
	int z = 0;

	way->from = from;
	v3_sub(d, to, from);
	for (int i = 1; i < 3; i++)
		if (fabs(d[i]) > fabs(d[z]))
			z = i;
	largest = fabs(d[z]);
	if (!(largest > 1e-100)) /* no way at all */
		return false;
	way->axis[0] = (z + (d[z] < 0 ? 2 : 1)) % 3;
	way->axis[1] = (z + (d[z] < 0 ? 1 : 2)) % 3;
	way->axis[2] = z;
	way->shear[0] = d[way->axis[0]] / d[z];
	way->shear[1] = d[way->axis[1]] / d[z];
	way->shear[2] = 1 / d[z];
	/* 0 times a large number is 0; 0 times the inverse of 0 would not be. */
	for (int i = 0; i < 3; i++)
		way->inverse[i] = fabs(d[i]) > 1e-200 ? 1 / d[i] : 1e200;
	way->least = least / v3_length(d);
	return true;
}

/* Where the way comes into a box, as a part of it; > 1 where it does not. */
static double way_box(const struct way *way, const float lo[3], const float hi[3])
{
	double in = 0, out = 1;

	/* No NaN comes here, so no fmin(): it would be a call. */
	for (int i = 0; i < 3; i++) {
		double a = (lo[i] - way->from[i]) * way->inverse[i];
		double b = (hi[i] - way->from[i]) * way->inverse[i];
		double near = a < b ? a : b, far = a < b ? b : a;

		in = near > in ? near : in;
		out = far < out ? far : out;
	}
	return in <= out ? in : 2;
}

static void way_face(const struct way *way, const struct mesh *mesh, uint32_t face,
		     uint32_t *found, double *first)
{
	const int *axis = way->axis;
	double x[3], y[3], z[3], u, v, w, sum, t;

	for (int i = 0; i < 3; i++) {
		const double *p = mesh->vertex[mesh->corner[face][i]];
		double deep = p[axis[2]] - way->from[axis[2]];

		x[i] = p[axis[0]] - way->from[axis[0]] - way->shear[0] * deep;
		y[i] = p[axis[1]] - way->from[axis[1]] - way->shear[1] * deep;
		z[i] = way->shear[2] * deep;
	}
	u = x[2] * y[1] - y[2] * x[1];
	v = x[0] * y[2] - y[0] * x[2];
	w = x[1] * y[0] - y[1] * x[0];
	sum = u + v + w;
	/* From the back, past it, or along it. */
	if (u < 0 || v < 0 || w < 0 || !(sum > 0))
		return;
	t = (u * z[0] + v * z[1] + w * z[2]) / sum;
	if (t < way->least || t > 1 || t >= *first)
		return;
	*first = t;
	*found = face;
}

bool mesh_enters(const struct mesh *mesh, const double from[3], const double to[3],
		 double least, struct mesh_spot *spot)
{
	struct {
		uint32_t child;
		double in;
	} stack[BVH_DEPTH_MAX];
	uint32_t child = 0, found = MESH_NONE;
	double first = 2, in = 0, point[3];
	struct way way;
	int depth = 0;

	if (!way_new(&way, from, to, least))
		return false;
	for (;;) {
		if (in > 1 || in > first) {
			;
		} else if (child & BVH_LEAF) {
			for (uint32_t k = 0; k < BVH_COUNT(child); k++)
				way_face(&way, mesh, BVH_FIRST(child) + k, &found,
					 &first);
		} else {
			const struct bvh_node *node = mesh->bvh.node + child;
			double in0 = way_box(&way, node->lo[0], node->hi[0]);
			double in1 = way_box(&way, node->lo[1], node->hi[1]);
			int later = in0 < in1;

			stack[depth].child = node->child[later];
			stack[depth++].in = later ? in1 : in0;
			child = node->child[!later];
			in = later ? in0 : in1;
			continue;
		}
		if (!depth)
			break;
		child = stack[--depth].child;
		in = stack[depth].in;
	}
	if (found == MESH_NONE)
		return false;
	v3_add(point, from, first, way.along);
	spot->face = found;
	spot->part = mesh_on_face(mesh, found, point, spot->point);
	return true;
}
