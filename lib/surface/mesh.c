// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Places on a mesh: normal, texture coordinates, border; searches; gliding.
 *
 * The normal on an edge is the mean normal of its faces, and at a corner the mean of the faces
 * around it, weighted by their angles: with it the sign of (p - nearest) · normal shows inside from
 * outside exactly (Bærentzen & Aanæs 2005), which a face's does not.
 */
#include "mesh.h"

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

/*
 * p lies over the border at an edge of a face: within its plane, outside of the edge. The unit
 * vector over it is added to @out.
 */
static bool over_edge(const struct mesh *mesh, uint32_t face, int edge, const double p[3],
		      double out[3])
{
	const double *corner[3];
	double n[3], along[3], over[3];

	if (mesh->neighbour[face][edge] != MESH_NONE)
		return false;
	corners(mesh, face, corner);
	triangle_area_normal(n, corner[0], corner[1], corner[2]);
	if (!(triangle_side(n, corner[edge], corner[(edge + 1) % 3], p) < 0))
		return false;
	v3_sub(along, corner[(edge + 1) % 3], corner[edge]);
	v3_cross(over, along, n);
	v3_add(out, out, 1 / v3_length(over), over);
	return true;
}

/* The same at a spot; @out points over the border. */
static bool over_border(const struct mesh *mesh, const struct mesh_spot *spot,
			const double p[3], double out[3])
{
	struct mesh_fan fan;
	uint32_t face, vertex;
	bool over = false;

	if (spot->part == TRIANGLE_FACE)
		return false;
	if (spot->part < TRIANGLE_CORNER)
		return over_edge(mesh, spot->face, spot->part - TRIANGLE_EDGE, p, out);
	vertex = mesh->corner[spot->face][spot->part - TRIANGLE_CORNER];
	fan = mesh_fan(spot->face, vertex);
	while (mesh_fan_face(mesh, &fan, &face)) {
		int i = mesh_corner_of(mesh, face, vertex);

		over |= over_edge(mesh, face, i, p, out);
		over |= over_edge(mesh, face, (i + 2) % 3, p, out);
	}
	return over;
}

/* The place nearest to @middle among the places of a face that are @top high; false without one. */
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

/* Widen a box by a point. */
static void widen_mesh(double lo[3], double hi[3], const double p[3])
{
	for (int i = 0; i < 3; i++) {
		lo[i] = fmin(lo[i], p[i]);
		hi[i] = fmax(hi[i], p[i]);
	}
}

/* The middle of the face nearest to a place; of a face at a border only if all faces are. */
static void inner_spot(const struct mesh *mesh, const double place[3],
		       struct mesh_spot *spot)
{
	double best = INFINITY;

	for (uint32_t face = 0; face < mesh->n_triangles; face++) {
		const uint32_t *behind = mesh->neighbour[face];
		const double *corner[3];
		double middle[3], d;

		corners(mesh, face, corner);
		for (int i = 0; i < 3; i++)
			middle[i] = (corner[0][i] + corner[1][i] + corner[2][i]) / 3;
		d = v3_distance2(middle, place);
		/* Farther than any place of a mesh. */
		if (behind[0] == MESH_NONE || behind[1] == MESH_NONE ||
		    behind[2] == MESH_NONE)
			d += 1e12;
		if (d >= best)
			continue;
		best = d;
		*spot = (struct mesh_spot){.face = face, .part = TRIANGLE_FACE};
		v3_copy(spot->point, middle);
	}
}

void mesh_size(const struct mesh *mesh, struct incise_surface_size *size)
{
	struct mesh_spot spot;
	double middle[3];

	*size = (struct incise_surface_size){
		.lo_mm = {INFINITY, INFINITY, INFINITY},
		.hi_mm = {-INFINITY, -INFINITY, -INFINITY},
		.open_lo_mm = {INFINITY, INFINITY, INFINITY},
		.open_hi_mm = {-INFINITY, -INFINITY, -INFINITY},
	};
	for (uint32_t face = 0; face < mesh->n_triangles; face++) {
		const double *corner[3];

		corners(mesh, face, corner);
		for (int i = 0; i < 3; i++) {
			widen_mesh(size->lo_mm, size->hi_mm, corner[i]);
			if (mesh->neighbour[face][i] != MESH_NONE)
				continue;
			size->open_edges++;
			widen_mesh(size->open_lo_mm, size->open_hi_mm, corner[i]);
			widen_mesh(size->open_lo_mm, size->open_hi_mm,
				   corner[(i + 1) % 3]);
		}
	}
	for (int i = 0; i < 3; i++)
		middle[i] = size->lo_mm[i] / 2 + size->hi_mm[i] / 2;
	inner_spot(mesh, middle, &spot);
	mesh_touch(mesh, &spot, spot.point, &size->inner);
}

/*
 * Searches through the whole mesh by its tree of boxes: the nearest place, and where a
 * straight way enters first. Lengths in mm; no allocation.
 */

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

/* Where another part that begins at a border goes on: straight or upwards, or down a ridge. */
#define AHEAD 0.01

/*
 * A face on the other side of the border at a spot: a face nearer to p, which is then @next, or a
 * face that goes on from there. False: no face, the surface ends.
 */
static bool goes_on(const struct mesh *mesh, const struct mesh_spot *spot,
		    const double p[3], const double out[3], uint32_t face,
		    double *nearest, struct mesh_spot *next)
{
	const double *corner[3];
	double at[3], x[3], middle[3], ahead, d;
	int part = mesh_on_face(mesh, face, spot->point, at);

	if (face == spot->face ||
	    v3_distance2(at, spot->point) > MESH_SEAM_MM * MESH_SEAM_MM)
		return false;
	corners(mesh, face, corner);
	for (int i = 0; i < 3; i++) {
		middle[i] =
			(corner[0][i] + corner[1][i] + corner[2][i]) / 3 - spot->point[i];
		if (spot->part >= TRIANGLE_CORNER &&
		    mesh->corner[face][i] ==
			    mesh->corner[spot->face][spot->part - TRIANGLE_CORNER])
			return false;
	}
	ahead = v3_dot(middle, out) / (v3_length(middle) * v3_length(out));
	mesh_on_face(mesh, face, p, x);
	d = v3_distance2(x, p);
	if (ahead > -AHEAD && d < *nearest) {
		*nearest = d;
		*next = (struct mesh_spot){.face = face, .part = part};
		v3_copy(next->point, at);
	}
	return ahead > AHEAD;
}

bool mesh_beyond_border(const struct mesh *mesh, const struct mesh_spot *spot,
			const double p[3], struct mesh_spot *next)
{
	uint32_t stack[2 * BVH_DEPTH_MAX], child = 0;
	double out[3] = {0}, nearest = v3_distance2(spot->point, p) * (1 - 1e-9);
	bool on = false;
	int depth = 0;

	*next = *spot;
	if (!over_border(mesh, spot, p, out))
		return false;
	for (;;) {
		for (uint32_t k = 0; child & BVH_LEAF && k < BVH_COUNT(child); k++)
			on |= goes_on(mesh, spot, p, out, BVH_FIRST(child) + k, &nearest,
				      next);
		for (int side = 0; !(child & BVH_LEAF) && side < 2; side++) {
			const struct bvh_node *node = mesh->bvh.node + child;

			if (box_distance2(node->lo[side], node->hi[side], spot->point) <=
			    MESH_SEAM_MM * MESH_SEAM_MM)
				stack[depth++] = node->child[side];
		}
		if (!depth)
			break;
		child = stack[--depth];
	}
	return !on && next->face == spot->face;
}

/*
 * A straight way, prepared for a watertight test with triangles (Woop, Benthin,
 * Wald 2013): axes with the longest one last, and a shear that lays the way along it. A
 * vertex then has the same two coordinates in each of its triangles, and an edge's sign
 * for the one face is exactly the opposite for the other.
 */
struct way {
	const double *from;
	double along[3], inverse[3], shear[3];
	int axis[3];
	double least; /* part of the way */
	double slack; /* mm beyond a border that count as met */
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
		double a = (lo[i] - way->slack - way->from[i]) * way->inverse[i];
		double b = (hi[i] + way->slack - way->from[i]) * way->inverse[i];
		double near = a < b ? a : b, far = a < b ? b : a;

		in = near > in ? near : in;
		out = far < out ? far : out;
	}
	return in <= out ? in : 2;
}

/* Past the face at borders only, and no farther than the slack; areas by edges. */
static bool along_border(const struct way *way, const struct mesh *mesh, uint32_t face,
			 const double x[3], const double y[3], const double area[3])
{
	for (int i = 0; i < 3; i++) {
		int next = (i + 1) % 3;

		if (area[i] < 0 &&
		    (mesh->neighbour[face][i] != MESH_NONE ||
		     -area[i] > way->slack * hypot(x[next] - x[i], y[next] - y[i])))
			return false;
	}
	return way->slack > 0;
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
	if (!(sum > 0) || ((u < 0 || v < 0 || w < 0) &&
			   !along_border(way, mesh, face, x, y, (double[3]){w, u, v})))
		return;
	t = (u * z[0] + v * z[1] + w * z[2]) / sum;
	if (t < way->least || t > 1 || t >= *first)
		return;
	*first = t;
	*found = face;
}

bool mesh_enters(const struct mesh *mesh, const double from[3], const double to[3],
		 double least, double slack, struct mesh_spot *spot)
{
	struct mesh_spot next;
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
	way.slack = slack;
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
	return !slack || !mesh_beyond_border(mesh, spot, point, &next);
}

/*
 * Gliding: the proxy goes downhill over the surface, where the height is its distance to
 * the tool.
 *
 *        ╲        ╱       On a face the way goes straight to the face's nearest point.
 *         ╲  f   ╱        When that lies on an edge, the face behind the edge may have
 *      ────●────●──▶ x    a nearer one; when it lies on a corner, any face around the
 *         ╱  g   ╲        corner may. Where no face has, the place is the nearest one around.
 *
 * A face's nearest point is never farther than any other of its points, so the distance
 * falls all along the way, and the way never leaves the surface: there is no jump, and
 * nothing to lock. The parts that the points lie on (enum triangle_part) decide which is nearest,
 * not distances, whose small differences drown in rounding when the tool is deep.
 */

/*
 * Work is finite: no new step after this many faces (a fan is always looked through), some 60 µs. On
 * a mesh of 0.2 mm triangles it is a way of some 10 mm in one tick. The proxy then stays
 * on the surface where it got to, and goes on with the next move.
 */
#define FACES_MAX 96

/* So many steps in a row without getting nearer can be nothing but rounding: a tie. */
#define IDLE_MAX 8

static bool same_point(const double a[3], const double b[3])
{
	return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* The nearest spot of the face behind the edge; false when it is the same point. */
static bool behind_edge(const struct mesh *mesh, const double p[3],
			const struct mesh_spot *spot, struct mesh_spot *next)
{
	next->face = mesh->neighbour[spot->face][spot->part - TRIANGLE_EDGE];
	if (next->face == MESH_NONE)
		return false;
	next->part = mesh_on_face(mesh, next->face, p, next->point);
	return !same_point(next->point, spot->point);
}

/* The spot farthest from the corner among the nearest ones of the faces around it. */
static bool around_corner(const struct mesh *mesh, const double p[3],
			  const struct mesh_spot *spot, struct mesh_spot *next,
			  int *faces)
{
	uint32_t vertex = mesh->corner[spot->face][spot->part - TRIANGLE_CORNER];
	struct mesh_fan fan = mesh_fan(spot->face, vertex);
	double farthest = 0;
	uint32_t face;

	while (mesh_fan_face(mesh, &fan, &face)) {
		double x[3], d;
		int part;

		if (face == spot->face)
			continue;
		++*faces;
		part = mesh_on_face(mesh, face, p, x);
		d = v3_distance2(x, spot->point);
		if (!(d > farthest))
			continue;
		farthest = d;
		next->face = face;
		next->part = part;
		v3_copy(next->point, x);
	}
	return farthest > 0;
}

/* The point on the way from a to b at which the distance to @start becomes @reach. */
static void cut_mesh_way(const double start[3], double reach, double a[3],
			 const double b[3])
{
	double sa[3], ab[3], half, whole, rest, root, t;

	v3_sub(sa, a, start);
	v3_sub(ab, b, a);
	whole = v3_dot(ab, ab);
	half = v3_dot(sa, ab);
	rest = fmax(reach * reach - v3_dot(sa, sa), 0);
	root = sqrt(half * half + whole * rest);
	/* This form of the root does not cancel. */
	t = half > 0 ? rest / (half + root) : (root - half) / whole;
	v3_add(a, a, fmin(fmax(t, 0), 1), ab);
}

/*
 * Where the straight way over a face, towards the point of its plane that is nearest to
 * p, comes to an edge; returns the edge.
 */
static int way_out(const struct mesh *mesh, uint32_t face, const double from[3],
		   const double p[3], double out[3])
{
	const double *corner[3];
	double n[3], ap[3], way[3], first = 2;
	int edge = 0;

	for (int i = 0; i < 3; i++)
		corner[i] = mesh->vertex[mesh->corner[face][i]];
	triangle_area_normal(n, corner[0], corner[1], corner[2]);
	for (int i = 0; i < 3; i++) {
		const double *a = corner[i], *b = corner[i == 2 ? 0 : i + 1];
		double begin = fmax(triangle_side(n, a, b, from), 0);
		double end = triangle_side(n, a, b, p);

		if (end < 0 && begin / (begin - end) < first) {
			first = begin / (begin - end);
			edge = i;
		}
	}
	v3_sub(ap, p, from);
	v3_add(way, ap, -v3_dot(ap, n) / v3_dot(n, n), n);
	v3_add(out, from, fmin(first, 1), way);
	return edge;
}

static bool lies_on_edge(const struct mesh *mesh, const struct mesh_spot *spot,
			 uint32_t behind)
{
	const uint32_t *neighbour = mesh->neighbour[spot->face];
	int i;

	if (spot->part == TRIANGLE_FACE)
		return false;
	if (spot->part < TRIANGLE_CORNER)
		return neighbour[spot->part - TRIANGLE_EDGE] == behind;
	i = spot->part - TRIANGLE_CORNER;
	return neighbour[i] == behind || neighbour[(i + 2) % 3] == behind;
}

/*
 * A face whose nearest point lies on its rim need not be crossed up to there: where the
 * steepest way comes to an edge and the face behind it has a nearer point, off that edge,
 * the way goes on in that face. It is shorter, and less of the reach is lost on it.
 */
static bool straight_on(const struct mesh *mesh, const double p[3],
			const struct mesh_spot *spot, uint32_t face,
			struct mesh_spot *edge, struct mesh_spot *next)
{
	int over = way_out(mesh, face, spot->point, p, edge->point);

	edge->face = face;
	edge->part = TRIANGLE_EDGE + over;
	next->face = mesh->neighbour[face][over];
	if (next->face == MESH_NONE)
		return false;
	next->part = mesh_on_face(mesh, next->face, p, next->point);
	return !lies_on_edge(mesh, next, face);
}

/* Go straight to @to; false where the reach ends before. */
static bool go_mesh(const double start[3], double reach, struct mesh_spot *spot,
		    const struct mesh_spot *to)
{
	if (v3_distance2(to->point, start) <= reach * reach) {
		*spot = *to;
		return true;
	}
	spot->face = to->face;
	spot->part = TRIANGLE_FACE;
	cut_mesh_way(start, reach, spot->point, to->point);
	return false;
}

bool mesh_glide(const struct mesh *mesh, const double p[3], double reach,
		struct mesh_spot *spot, bool *tired)
{
	struct mesh_spot next = {.face = spot->face}, edge, after;
	double start[3], least = INFINITY;
	int faces = 1, idle = 0;

	*tired = false;
	v3_copy(start, spot->point);
	next.part = mesh_on_face(mesh, next.face, p, next.point);
	for (;;) {
		double d;
		bool on;

		if (next.part != TRIANGLE_FACE &&
		    straight_on(mesh, p, spot, next.face, &edge, &after)) {
			if (!go_mesh(start, reach, spot, &edge))
				return false;
			next = after;
			*tired = ++faces >= FACES_MAX;
			if (*tired)
				return false;
			continue;
		}
		if (!go_mesh(start, reach, spot, &next))
			return false;
		if (spot->part == TRIANGLE_FACE)
			return true;
		d = v3_distance2(spot->point, p);
		idle = d < least ? 0 : idle + 1;
		least = fmin(least, d);
		*tired = faces >= FACES_MAX;
		if (idle > IDLE_MAX || *tired)
			return false;
		if (spot->part < TRIANGLE_CORNER) {
			faces++;
			on = behind_edge(mesh, p, spot, &next);
		} else {
			on = around_corner(mesh, p, spot, &next, &faces);
		}
		if (!on)
			return true;
	}
}
