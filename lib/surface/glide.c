// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Gliding: the proxy goes downhill over the surface, where the height is its distance to
 * the tool.
 *
 *        ╲        ╱       On a face the way goes straight to the face's nearest point.
 *         ╲  f   ╱        When that lies on an edge, the face behind the edge may have
 *      ────●────●──▶ x    a nearer one; when it lies on a corner, any face around the
 *         ╱  g   ╲        corner may. Where none has, the place is the nearest one around.
 *
 * A face's nearest point is never farther than any other of its points, so the distance
 * falls all along the way, and the way never leaves the surface: there is no jump, and
 * nothing to lock. What is nearest is decided by the parts that the points lie on
 * (triangle.h), not by comparing distances, of which small differences drown in rounding
 * when the tool is deep.
 */
#include <string.h>
#include "mesh.h"

/*
 * Work is finite: no new step after this many faces (a fan is always looked through). On
 * a mesh of 0.2 mm triangles it is a way of some 100 mm in one tick. The proxy then stays
 * on the surface where it got to, and goes on with the next move.
 */
#define FACES_MAX 1024

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
static void cut(const double start[3], double reach, double a[3], const double b[3])
{
	double sa[3], ab[3], half, whole, rest, root, t;

	v3_sub(sa, a, start);
	v3_sub(ab, b, a);
	whole = v3_dot(ab, ab);
	half = v3_dot(sa, ab);
	rest = fmax(reach * reach - v3_dot(sa, sa), 0);
	root = sqrt(half * half + whole * rest);
	/* Of the two forms of the root the one that does not cancel. */
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
static bool go(const double start[3], double reach, struct mesh_spot *spot,
	       const struct mesh_spot *to)
{
	if (v3_distance2(to->point, start) <= reach * reach) {
		*spot = *to;
		return true;
	}
	spot->face = to->face;
	spot->part = TRIANGLE_FACE;
	cut(start, reach, spot->point, to->point);
	return false;
}

bool mesh_glide(const struct mesh *mesh, const double p[3], double reach,
		struct mesh_spot *spot)
{
	struct mesh_spot next = {.face = spot->face}, edge, after;
	double start[3], least = INFINITY;
	int faces = 1, idle = 0;

	v3_copy(start, spot->point);
	next.part = mesh_on_face(mesh, next.face, p, next.point);
	for (;;) {
		double d;
		bool on;

		if (next.part != TRIANGLE_FACE &&
		    straight_on(mesh, p, spot, next.face, &edge, &after)) {
			if (!go(start, reach, spot, &edge))
				return false;
			next = after;
			if (++faces >= FACES_MAX)
				return false;
			continue;
		}
		if (!go(start, reach, spot, &next))
			return false;
		if (spot->part == TRIANGLE_FACE)
			return true;
		d = v3_distance2(spot->point, p);
		idle = d < least ? 0 : idle + 1;
		least = fmin(least, d);
		if (idle > IDLE_MAX || faces >= FACES_MAX)
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
