// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From a reader's points and triangles to a mesh:
 *
 *   weld equal points ─▶ check areas ─▶ find neighbours ─▶ weld seams ─▶ tree of boxes,
 *   whose order the triangles take ─▶ number the fans around points: they are the vertices
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "mesh.h"

struct mesh_builder {
	const struct mesh_draft *draft;
	uint32_t n;
	uint32_t (*corner)[3];	  /* welded points, in the draft's order */
	uint32_t (*neighbour)[3]; /* in the draft's order */
	struct mesh *mesh;
	struct incise_error *err;
};

static int no_mesh_build_memory(const struct mesh_builder *b)
{
	return incise_error_set(b->err, ENOMEM, "%s: no memory for its %u triangles",
				b->draft->path, b->n);
}

static int line_of(const struct mesh_builder *b, uint32_t face)
{
	return b->draft->line ? b->draft->line[face] : 0;
}

/* So many points before one are compared with it; far fewer have a key as near. */
#define WINDOW 256

struct keyed {
	double key; /* mm along a direction that few meshes have a face across */
	uint32_t point;
};

static int compare_keys(const void *a, const void *b)
{
	const struct keyed *p = a, *q = b;

	if (p->key != q->key)
		return p->key < q->key ? -1 : 1;
	return p->point < q->point ? -1 : p->point > q->point;
}

/* The welded points: all points, or the points of borders; the others are MESH_NONE. */
static size_t sort_points(const struct mesh_builder *b, bool borders,
			  struct keyed *sorted, uint32_t *to)
{
	static const double direction[3] = {0.61273451928, 0.52330182737, 0.59219273645};
	size_t n = 0;

	for (size_t k = 0; k < b->draft->n_points; k++)
		to[k] = borders ? MESH_NONE : (uint32_t)k;
	for (uint32_t face = 0; borders && face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			uint32_t p = b->corner[face][i], q = b->corner[face][(i + 1) % 3];

			if (b->neighbour[face][i] != MESH_NONE)
				continue;
			to[p] = p;
			to[q] = q;
		}
	}
	for (size_t k = 0; k < b->draft->n_points; k++)
		if (to[k] != MESH_NONE)
			sorted[n++] = (struct keyed){
				v3_dot(b->draft->point[k], direction), (uint32_t)k};
	qsort(sorted, n, sizeof(*sorted), compare_keys);
	return n;
}

/* Points within a tolerance of each other become the first one of them. */
static int weld(const struct mesh_builder *b, bool borders, double tolerance,
		uint32_t (*corner)[3])
{
	const double(*point)[3] = (const double(*)[3])b->draft->point;
	size_t n_points = b->draft->n_points, n;
	struct keyed *sorted = malloc(n_points * sizeof(*sorted));
	uint32_t *to = malloc(n_points * sizeof(*to));

	if (!sorted || !to) {
		free(sorted);
		free(to);
		return no_mesh_build_memory(b);
	}
	n = sort_points(b, borders, sorted, to);
	for (size_t k = 0; k < n; k++) {
		const double least = sorted[k].key - 2 * tolerance;
		const uint32_t p = sorted[k].point;

		for (size_t j = k; j-- && k - j < WINDOW && sorted[j].key >= least;) {
			const uint32_t q = to[sorted[j].point];

			if (v3_distance2(point[p], point[q]) > tolerance * tolerance)
				continue;
			to[p] = q;
			break;
		}
	}
	for (uint32_t face = 0; face < b->n; face++) {
		const uint32_t *from = b->corner[face];
		uint32_t c[3];

		for (int i = 0; i < 3; i++)
			c[i] = to[from[i]] == MESH_NONE ? from[i] : to[from[i]];
		/* A triangle as small as that stays, with its borders. */
		if (borders && (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]))
			memcpy(c, from, sizeof(c));
		memcpy(corner[face], c, sizeof(c));
	}
	free(sorted);
	free(to);
	return 0;
}

static int check_areas(const struct mesh_builder *b)
{
	uint32_t first = 0, n_bad = 0;

	for (uint32_t face = 0; face < b->n; face++) {
		const double *corner[3];
		double n[3], longest = 0;

		for (int i = 0; i < 3; i++)
			corner[i] = b->draft->point[b->corner[face][i]];
		triangle_area_normal(n, corner[0], corner[1], corner[2]);
		for (int i = 0; i < 3; i++)
			longest = fmax(longest,
				       v3_distance2(corner[i], corner[(i + 1) % 3]));
		if (v3_length(n) > MESH_HEIGHT_MIN_MM * sqrt(longest))
			continue;
		first = n_bad++ ? first : face;
	}
	if (!n_bad)
		return 0;
	return incise_error_set(
		b->err, EINVAL,
		"%s:%d: a triangle without area (its corners coincide or lie on one "
		"line), the first of %u; remove them",
		b->draft->path, line_of(b, first), n_bad);
}

/* A side of a triangle, kept with the smaller of its two points. */
struct side {
	uint32_t other; /* point */
	uint32_t face;
	uint32_t edge : 2, down : 1; /* it runs from the larger to the smaller point */
};

static int compare_sides(const void *a, const void *b)
{
	const struct side *s = a, *t = b;

	if (s->other != t->other)
		return s->other < t->other ? -1 : 1;
	return s->face < t->face ? -1 : s->face > t->face;
}

/* Sides of one point, sorted: two with the same other point are an edge. */
static int pair_sides(struct mesh_builder *b, const struct side *side, uint32_t n)
{
	for (uint32_t k = 0; k + 1 < n; k++) {
		const struct side *s = side + k, *t = s + 1;

		if (s->other != t->other)
			continue;
		if (k + 2 < n && side[k + 2].other == s->other)
			return incise_error_set(
				b->err, EINVAL,
				"%s:%d: an edge of this face has more than two "
				"triangles, one of them in line %d; separate them",
				b->draft->path, line_of(b, side[k + 2].face),
				line_of(b, s->face));
		if (s->down == t->down)
			return incise_error_set(
				b->err, EINVAL,
				"%s:%d: this face is oriented opposite to its "
				"neighbour in line %d; orient all counter-clockwise "
				"seen from outside",
				b->draft->path, line_of(b, t->face), line_of(b, s->face));
		b->neighbour[s->face][s->edge] = t->face;
		b->neighbour[t->face][t->edge] = s->face;
		k++;
	}
	return 0;
}

static int find_neighbours(struct mesh_builder *b)
{
	size_t n_points = b->draft->n_points;
	uint32_t *end = calloc(n_points + 1, sizeof(*end));
	struct side *side = malloc(3 * (size_t)b->n * sizeof(*side));
	int rc = 0;

	if (!end || !side) {
		free(end);
		free(side);
		return no_mesh_build_memory(b);
	}
	memset(b->neighbour, 0xff, b->n * sizeof(*b->neighbour)); /* MESH_NONE */
	/* Number of sides of each point, where they begin, and at last where they end. */
	for (uint32_t face = 0; face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			uint32_t p = b->corner[face][i], q = b->corner[face][(i + 1) % 3];

			end[(p < q ? p : q) + 1]++;
		}
	}
	for (size_t k = 0; k < n_points; k++)
		end[k + 1] += end[k];
	for (uint32_t face = 0; face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			uint32_t p = b->corner[face][i], q = b->corner[face][(i + 1) % 3];
			bool down = p > q;

			side[end[down ? q : p]++] = (struct side){.other = down ? p : q,
								  .face = face,
								  .edge = i,
								  .down = down};
		}
	}
	for (size_t k = 0; k < n_points && !rc; k++) {
		struct side *begin = side + (k ? end[k - 1] : 0);
		uint32_t n = end[k] - (k ? end[k - 1] : 0);

		qsort(begin, n, sizeof(*begin), compare_sides);
		rc = pair_sides(b, begin, n);
	}
	free(end);
	free(side);
	return rc;
}

/*
 * Copies of a corner that differ in the last digits leave a seam: two borders side by side.
 * Points of borders nearer than this part of the farthest coordinate, and of the edges' mean
 * length, become one.
 */
#define SEAM_SIZE 2e-6
#define SEAM_EDGE 0.05

static double seam_mm(const struct mesh_builder *b)
{
	double farthest = 0, edges = 0;

	for (uint32_t face = 0; face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			const double *p = b->draft->point[b->corner[face][i]];
			const double *q = b->draft->point[b->corner[face][(i + 1) % 3]];

			edges += sqrt(v3_distance2(p, q));
			for (int k = 0; k < 3; k++)
				farthest = fmax(farthest, fabs(p[k]));
		}
	}
	return fmin(SEAM_SIZE * farthest, SEAM_EDGE * edges / (3.0 * b->n));
}

/* A mesh that this would break, by a third triangle at an edge, stays as it is. */
static int weld_seams(struct mesh_builder *b)
{
	struct mesh_builder welded = *b;
	struct incise_error unused;
	int rc;

	welded.err = &unused;
	welded.corner = malloc(b->n * sizeof(*welded.corner));
	rc = welded.corner ? weld(b, true, seam_mm(b), welded.corner)
			   : no_mesh_build_memory(b);
	if (!rc && memcmp(b->corner, welded.corner, b->n * sizeof(*b->corner)) &&
	    !check_areas(&welded)) {
		rc = find_neighbours(&welded);
		if (rc)
			rc = find_neighbours(b);
		else
			memcpy(b->corner, welded.corner, b->n * sizeof(*b->corner));
	}
	free(welded.corner);
	return rc;
}

/*
 * A closed piece of the mesh holds its tissue within: the sum of the tetrahedra from a point to
 * its faces is a positive volume. @stack has room for all faces.
 */
static int check_piece(const struct mesh_builder *b, uint32_t first, bool *seen,
		       uint32_t *stack)
{
	const double(*point)[3] = (const double(*)[3])b->draft->point;
	const double *origin = point[b->corner[first][0]];
	double volume = 0, rounding = 0;
	bool closed = true;
	uint32_t depth = 0;

	stack[depth++] = first;
	seen[first] = true;
	while (depth) {
		const uint32_t face = stack[--depth], *c = b->corner[face];
		double n[3], out[3], part;

		triangle_area_normal(n, point[c[0]], point[c[1]], point[c[2]]);
		v3_sub(out, point[c[0]], origin);
		part = v3_dot(out, n) / 6;
		volume += part;
		rounding += 1e-9 * fabs(part);
		for (int i = 0; i < 3; i++) {
			uint32_t other = b->neighbour[face][i];

			closed &= other != MESH_NONE;
			if (other == MESH_NONE || seen[other])
				continue;
			seen[other] = true;
			stack[depth++] = other;
		}
	}
	if (!closed || volume >= -rounding)
		return 0;
	return incise_error_set(
		b->err, EINVAL,
		"%s:%d: the closed piece of this face is turned inside out (%.3g mm3); "
		"reverse its faces, or give cavity = true if the tissue is around it",
		b->draft->path, line_of(b, first), volume);
}

static int check_volumes(const struct mesh_builder *b)
{
	bool *seen = calloc(b->n, sizeof(*seen));
	uint32_t *stack = malloc(b->n * sizeof(*stack));
	int rc = seen && stack ? 0 : no_mesh_build_memory(b);

	for (uint32_t face = 0; !rc && face < b->n; face++)
		if (!seen[face])
			rc = check_piece(b, face, seen, stack);
	free(seen);
	free(stack);
	return rc;
}

/* Build the tree, and take over the triangles in its order. */
static int order_triangles(struct mesh_builder *b)
{
	struct mesh *mesh = b->mesh;
	float(*box)[2][3] = malloc(b->n * sizeof(*box));
	uint32_t *place = malloc(b->n * sizeof(*place));

	if (!box || !place)
		goto no_memory;
	for (uint32_t face = 0; face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			double lo = INFINITY, hi = -INFINITY;

			for (int k = 0; k < 3; k++) {
				double x = b->draft->point[b->corner[face][k]][i];

				lo = fmin(lo, x);
				hi = fmax(hi, x);
			}
			box[face][0][i] = bvh_outwards(lo, 0);
			box[face][1][i] = bvh_outwards(hi, 1);
		}
	}
	if (bvh_build(&mesh->bvh, (const float(*)[2][3])box, b->n, mesh->number))
		goto no_memory;
	for (uint32_t k = 0; k < b->n; k++)
		place[mesh->number[k]] = k;
	for (uint32_t k = 0; k < b->n; k++) {
		uint32_t face = mesh->number[k];

		memcpy(mesh->corner[k], b->corner[face], sizeof(*mesh->corner));
		for (int i = 0; i < 3; i++) {
			uint32_t other = b->neighbour[face][i];

			mesh->neighbour[k][i] = other == MESH_NONE ? other : place[other];
			mesh->open |= other == MESH_NONE;
		}
		if (mesh->uv)
			memcpy(mesh->uv[k], b->draft->uv[face], sizeof(*mesh->uv));
	}
	free(box);
	free(place);
	return 0;
no_memory:
	free(box);
	free(place);
	return no_mesh_build_memory(b);
}

/* The angle of a triangle at its corner a, and the normal of its face. */
static double angle_at(const double *a, const double *b, const double *c, double n[3])
{
	double ab[3], ac[3], area[3];

	v3_sub(ab, b, a);
	v3_sub(ac, c, a);
	v3_cross(area, ab, ac);
	v3_unit(n, area, 0);
	return atan2(v3_length(area), v3_dot(ab, ac));
}

/* Give the fan around a corner of a face its vertex. */
static void new_vertex(struct mesh_builder *b, uint32_t face, int i, uint32_t *vertex_of)
{
	struct mesh *mesh = b->mesh;
	uint32_t point = mesh->corner[face][i], vertex = mesh->n_vertices++;
	struct mesh_fan fan = mesh_fan(face, point);
	double sum[3] = {0}, n[3];
	uint32_t other;

	v3_copy(mesh->vertex[vertex], b->draft->point[point]);
	while (mesh_fan_face(mesh, &fan, &other)) {
		int k = mesh_corner_of(mesh, other, point);
		const uint32_t *c = mesh->corner[other];
		double angle =
			angle_at(b->draft->point[point], b->draft->point[c[(k + 1) % 3]],
				 b->draft->point[c[(k + 2) % 3]], n);

		v3_add(sum, sum, angle, n);
		vertex_of[3 * (size_t)other + k] = vertex;
	}
	/* Faces that cancel have no middle: the last one's, then. */
	v3_unit(n, sum, 1e-12);
	v3_copy(mesh->normal[vertex], n);
}

static int number_vertices(struct mesh_builder *b)
{
	struct mesh *mesh = b->mesh;
	size_t n_corners = 3 * (size_t)b->n;
	uint32_t *vertex_of = malloc(n_corners * sizeof(*vertex_of));
	void *vertex, *normal;

	mesh->vertex = malloc(n_corners * sizeof(*mesh->vertex));
	mesh->normal = malloc(n_corners * sizeof(*mesh->normal));
	if (!vertex_of || !mesh->vertex || !mesh->normal) {
		free(vertex_of);
		return no_mesh_build_memory(b);
	}
	memset(vertex_of, 0xff, n_corners * sizeof(*vertex_of));
	for (size_t k = 0; k < n_corners; k++)
		if (vertex_of[k] == MESH_NONE)
			new_vertex(b, (uint32_t)(k / 3), k % 3, vertex_of);
	memcpy(mesh->corner, vertex_of, n_corners * sizeof(*vertex_of));
	free(vertex_of);
	/* Most meshes have half as many vertices as triangles. */
	vertex = realloc(mesh->vertex, mesh->n_vertices * sizeof(*mesh->vertex));
	if (vertex)
		mesh->vertex = vertex;
	normal = realloc(mesh->normal, mesh->n_vertices * sizeof(*mesh->normal));
	if (normal)
		mesh->normal = normal;
	return 0;
}

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

struct mesh *mesh_new(const struct mesh_draft *draft, struct incise_error *err)
{
	struct mesh_builder b = {.draft = draft, .err = err};
	struct mesh *mesh;
	size_t n = draft->n_triangles;
	int rc = 0;

	if (!n)
		return INCISE_ERROR_NULL(err, EINVAL,
					 "%s: no triangle: expected at least one",
					 draft->path);
	if (n > INCISE_SURFACE_TRIANGLES_MAX)
		return INCISE_ERROR_NULL(err, E2BIG,
					 "%s: %zu triangles: expected at most %d",
					 draft->path, n, INCISE_SURFACE_TRIANGLES_MAX);
	b.n = (uint32_t)n;
	mesh = b.mesh = calloc(1, sizeof(*mesh));
	b.corner = malloc(n * sizeof(*b.corner));
	b.neighbour = malloc(n * sizeof(*b.neighbour));
	if (mesh) {
		mesh->n_triangles = b.n;
		mesh->corner = malloc(n * sizeof(*mesh->corner));
		mesh->neighbour = malloc(n * sizeof(*mesh->neighbour));
		mesh->number = malloc(n * sizeof(*mesh->number));
		if (draft->uv)
			mesh->uv = malloc(n * sizeof(*mesh->uv));
	}
	if (!mesh || !b.corner || !b.neighbour || !mesh->corner || !mesh->neighbour ||
	    !mesh->number || (draft->uv && !mesh->uv))
		rc = no_mesh_build_memory(&b);
	else
		memcpy(b.corner, draft->corner, n * sizeof(*b.corner));
	if (!rc)
		rc = weld(&b, false, 0, b.corner);
	if (!rc)
		rc = check_areas(&b);
	if (!rc)
		rc = find_neighbours(&b);
	if (!rc)
		rc = weld_seams(&b);
	if (!rc && !draft->cavity)
		rc = check_volumes(&b);
	if (!rc)
		rc = order_triangles(&b);
	if (!rc)
		rc = number_vertices(&b);
	free(b.corner);
	free(b.neighbour);
	if (rc) {
		mesh_free(mesh);
		errno = -rc;
		return NULL;
	}
	return mesh;
}

/*
 * Building the tree of boxes: halve the triangles at the median of their middles along
 * the widest axis, down to leaves of two to four. Halving bounds the depth whatever the
 * mesh looks like, and with it the stack of a query.
 */

#define LEAF_MAX 4

struct item {
	float middle[3];
	uint32_t box;
};

struct builder {
	const float (*box)[2][3];
	struct item *item;
	struct bvh *bvh;
	uint32_t random; /* for pivots: no order of a file makes the partition slow */
};

float bvh_outwards(double x, int up)
{
	/* A float is good to 2^-24 of it; the millionth of a mm is for numbers near 0. */
	double away = fabs(x) * 0x1p-22 + 1e-6;

	return (float)(up ? x + away : x - away);
}

static void widen_mesh_build(float box[2][3], const float by[2][3])
{
	for (int i = 0; i < 3; i++) {
		box[0][i] = fminf(box[0][i], by[0][i]);
		box[1][i] = fmaxf(box[1][i], by[1][i]);
	}
}

static void nothing(float box[2][3])
{
	for (int i = 0; i < 3; i++) {
		box[0][i] = INFINITY;
		box[1][i] = -INFINITY;
	}
}

static int widest(const struct item *item, uint32_t n)
{
	float box[2][3];
	int axis = 0;

	nothing(box);
	for (uint32_t k = 0; k < n; k++) {
		float point[2][3];

		memcpy(point[0], item[k].middle, sizeof(point[0]));
		memcpy(point[1], item[k].middle, sizeof(point[1]));
		widen_mesh_build(box, (const float(*)[3])point);
	}
	for (int i = 1; i < 3; i++)
		if (box[1][i] - box[0][i] > box[1][axis] - box[0][axis])
			axis = i;
	return axis;
}

/* Hoare's selection: the k-th along an axis comes to its place, smaller ones before. */
static void halve(struct builder *b, struct item *item, int64_t n, int64_t k, int axis)
{
	int64_t lo = 0, hi = n - 1;

	while (lo < hi) {
		int64_t i = lo, j = hi;
		float pivot;

		b->random = b->random * 1664525u + 1013904223u;
		pivot = item[lo + (int64_t)(b->random % (uint64_t)(hi - lo + 1))]
				.middle[axis];
		while (i <= j) {
			while (item[i].middle[axis] < pivot)
				i++;
			while (item[j].middle[axis] > pivot)
				j--;
			if (i <= j) {
				struct item swap = item[i];

				item[i++] = item[j];
				item[j--] = swap;
			}
		}
		if (k <= j)
			hi = j;
		else if (k >= i)
			lo = i;
		else
			return;
	}
}

static uint32_t build(struct builder *b, uint32_t first, uint32_t n, float box[2][3])
{
	struct item *item = b->item + first;
	uint32_t index, half = n / 2;
	uint32_t begin[2] = {first, first + half}, count[2] = {half, n - half};

	nothing(box);
	if (n <= LEAF_MAX) {
		for (uint32_t k = 0; k < n; k++)
			widen_mesh_build(box, b->box[item[k].box]);
		return BVH_LEAF | n << 28 | first;
	}
	halve(b, item, n, half, widest(item, n));
	index = b->bvh->n_nodes++;
	for (int side = 0; side < 2; side++) {
		struct bvh_node *node = b->bvh->node + index;
		float half_box[2][3];

		node->child[side] = build(b, begin[side], count[side], half_box);
		memcpy(node->lo[side], half_box[0], sizeof(half_box[0]));
		memcpy(node->hi[side], half_box[1], sizeof(half_box[1]));
		widen_mesh_build(box, (const float(*)[3])half_box);
	}
	return index;
}

int bvh_build(struct bvh *bvh, const float (*box)[2][3], uint32_t n, uint32_t *order)
{
	struct builder b = {.box = box, .bvh = bvh, .random = 1};
	/* A leaf has two triangles or more, but for a single one. */
	size_t capacity = (size_t)n / 2 + 1;
	float all[2][3];
	uint32_t root;

	bvh->n_nodes = 0;
	bvh->node = aligned_alloc(sizeof(*bvh->node), capacity * sizeof(*bvh->node));
	b.item = malloc(n * sizeof(*b.item));
	if (!bvh->node || !b.item) {
		free(b.item);
		bvh_free(bvh);
		return -ENOMEM;
	}
	memset(bvh->node, 0, capacity * sizeof(*bvh->node));
	for (uint32_t k = 0; k < n; k++) {
		for (int i = 0; i < 3; i++)
			b.item[k].middle[i] = box[k][0][i] / 2 + box[k][1][i] / 2;
		b.item[k].box = k;
	}
	root = build(&b, 0, n, all);
	if (root & BVH_LEAF) {
		/* A query starts with a node: one with this leaf and an empty one. */
		struct bvh_node *node = bvh->node;

		bvh->n_nodes = 1;
		nothing(all);
		memcpy(node->lo[1], all[0], sizeof(all[0]));
		memcpy(node->hi[1], all[1], sizeof(all[1]));
		build(&b, 0, n, all);
		memcpy(node->lo[0], all[0], sizeof(all[0]));
		memcpy(node->hi[0], all[1], sizeof(all[1]));
		node->child[0] = root;
		node->child[1] = BVH_LEAF;
	}
	for (uint32_t k = 0; k < n; k++)
		order[k] = b.item[k].box;
	free(b.item);
	return 0;
}

void bvh_free(struct bvh *bvh)
{
	free(bvh->node);
	bvh->node = NULL;
}
