// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The map between a scene's surface and its texture; see uv_map.h: the maps from above and
 * unrolled, and the grid of triangles for both. uv_map_atlas.c has a mesh's own coordinates.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "../surface/surface.h"
#include "uv_map.h"

static bool on_texture(const struct uv_map *map, const double px[2])
{
	return px[0] >= 0 && px[0] <= map->size && px[1] >= 0 && px[1] <= map->size;
}

/*
 * Seen straight from above, around the surface's top: a point's texel is its projection onto the
 * plane through the top; a texel's point is where a ray from above first meets the surface.
 *
 *                 up ▲    texels
 *        ────┬───┬───●───┬───┬────   plane at the top (origin)
 *            ╎  _╎--‾╎‾--╎_  ╎
 *            ╎/  ╎   ╎   ╎  \╎       places under an overhang are not seen
 */
#define SIDE_MAX_MM 120.0

/* Share of a ball's radius: at the corners of the texture its slope is then 58°. */
#define BALL_SHARE 0.6

/* Slopes steeper than 87° count as 87°. */
#define FACING_MIN 0.05

/* Points belong to the surface up to this distance, in parts of the side. */
#define NEAR_SHARE (1 / 12.0)

/* The extent of a mesh along one direction, mm from the origin. */
static void mesh_reach(const struct uv_map *map, const double way[3], double reach[2])
{
	const struct mesh *mesh = map->surface->mesh;

	reach[0] = reach[1] = 0;
	for (uint32_t i = 0; i < mesh->n_vertices; i++) {
		double out[3], at;

		v3_sub(out, mesh->vertex[i], map->origin);
		at = v3_dot(out, way);
		reach[0] = fmin(reach[0], at);
		reach[1] = fmax(reach[1], at);
	}
}

/*
 * A texture as large as the mesh, up to the limit, moved onto the mesh as far as possible with the
 * top on it. Returns half of its side.
 */
static double fit_mesh(struct uv_map *map)
{
	double reach[2][2], high[2], half;

	mesh_reach(map, map->right, reach[0]);
	mesh_reach(map, map->down, reach[1]);
	mesh_reach(map, map->up, high);
	map->above_mm = high[1];
	map->below_mm = -high[0];
	half = fmin(fmax(reach[0][1] - reach[0][0], reach[1][1] - reach[1][0]),
		    SIDE_MAX_MM) /
	       2;
	for (int i = 0; i < 2; i++) {
		double middle = (reach[i][0] + reach[i][1]) / 2;
		double least = fmin(reach[i][0] + half, middle);
		double most = fmax(reach[i][1] - half, middle);
		double move = fmin(fmax(0, least), most);

		v3_add(map->origin, map->origin, move, i ? map->down : map->right);
		map->top_mm[i] = -move;
	}
	return half;
}

static void above_init(struct uv_map *map)
{
	const struct incise_surface *surface = map->surface;
	const double x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, z[3] = {0, 0, 1};
	struct incise_touch top;
	double half = SIDE_MAX_MM / 2, side[3];

	map->kind = UV_MAP_FROM_ABOVE;
	incise_surface_top(surface, &top);
	v3_copy(map->origin, top.point_mm);
	/* The top is seen from above, whatever direction its triangle faces. */
	if (surface->kind == INCISE_SURFACE_PLANE ||
	    (surface->mesh && top.normal[2] < 0.3))
		v3_copy(map->up, top.normal);
	else
		v3_copy(map->up, z);
	v3_add(side, x, -v3_dot(x, map->up), map->up);
	if (!v3_unit(map->right, side, 0.1)) {
		v3_add(side, y, -v3_dot(y, map->up), map->up);
		v3_unit(map->right, side, 0);
	}
	v3_cross(map->down, map->right, map->up);
	if (surface->mesh)
		half = fit_mesh(map);
	else if (surface->kind != INCISE_SURFACE_PLANE) {
		half = fmin(half, BALL_SHARE * surface->capsule.radius);
		map->below_mm = surface->capsule.radius;
	}
	/* A mesh on its edge has no extent. */
	half = fmax(half, 1e-9);
	map->above_mm += half;
	map->below_mm += half;
	map->wide_mm = map->high_mm = 2 * half;
}

/* A place above the plane. */
static void over(const struct uv_map *map, const double px[2], double height_mm,
		 double to[3])
{
	double mm = map->wide_mm / map->size;

	v3_add(to, map->origin, (px[0] - 0.5 * map->size) * mm, map->right);
	v3_add(to, to, (px[1] - 0.5 * map->size) * mm, map->down);
	v3_add(to, to, height_mm, map->up);
}

static bool above_point(const struct uv_map *map, const double px[2], double point_mm[3],
			double normal[3])
{
	struct incise_touch touch;
	double from[3], to[3];

	over(map, px, map->above_mm, from);
	over(map, px, -map->below_mm, to);
	if (!incise_surface_enters(map->surface, from, to, &touch))
		return false;
	v3_copy(point_mm, touch.point_mm);
	v3_copy(normal, touch.normal);
	return true;
}

static bool above_px(const struct uv_map *map, const double point_mm[3], double px[2])
{
	double out[3], there[3], normal[3], at[2];

	v3_sub(out, point_mm, map->origin);
	at[0] = map->size * (0.5 + v3_dot(out, map->right) / map->wide_mm);
	at[1] = map->size * (0.5 + v3_dot(out, map->down) / map->high_mm);
	if (!on_texture(map, at))
		return false;
	/* At the border of a mesh the ray may just miss it: then the point counts. */
	if (above_point(map, at, there, normal)) {
		v3_sub(out, point_mm, there);
		if (!(fabs(v3_dot(out, map->up)) <= NEAR_SHARE * map->wide_mm))
			return false;
	}
	px[0] = at[0];
	px[1] = at[1];
	return true;
}

static bool above_metric(const struct uv_map *map, const double px[2], double right_mm[3],
			 double down_mm[3])
{
	double point[3], normal[3], facing, mm = map->wide_mm / map->size;

	if (!above_point(map, px, point, normal))
		return false;
	facing = fmax(v3_dot(normal, map->up), FACING_MIN);
	/* A step to the side stays on the surface, and descends with it. */
	for (int i = 0; i < 3; i++) {
		right_mm[i] = mm * (map->right[i] -
				    v3_dot(map->right, normal) / facing * map->up[i]);
		down_mm[i] = mm * (map->down[i] -
				   v3_dot(map->down, normal) / facing * map->up[i]);
	}
	return true;
}

/*
 * A capsule's upper side unrolled. Lengths along (s) and around are arcs, so that texels on the
 * cylinder are rectangles, and on a neck nearly squares.
 *
 *        ╭──╮─────────────────────────╭──╮
 *       s < 0  0        s      axis_mm    s > axis_mm: meridians of the round end
 *        ╰──╯─────────────────────────╰──╯
 *
 *          up ▲  turn          point = a + t axis + R (cos e/R (cos turn up + sin turn down)
 *             │╱                            + sin e/R axis), t = s within 0 … axis_mm, e = s - t
 *          ───┼───► down
 */
#define WIDE_MAX_MM 160.0
#define TURN_MAX (80 * M_PI / 180)

/* Maximum ratio of length to width: a finger is not stretched to a neck. */
#define STRETCH_MAX 1.5

/* Reach onto the round ends, in radii: 69°, where texels have 0.36 of their height. */
#define END_MAX 1.2

/* A capsule steeper than this sine is seen from above. */
#define STANDS 0.7

static bool unrolled_init(struct uv_map *map)
{
	const struct capsule *capsule = &map->surface->capsule;
	double axis[3], up[3], out[3], end, least, most, leans, at;
	struct incise_touch top;

	v3_sub(axis, capsule->b, capsule->a);
	incise_surface_top(map->surface, &top);
	if (!v3_unit(map->right, axis, 1e-6 * capsule->radius))
		return false;
	leans = v3_dot(top.normal, map->right);
	v3_add(up, top.normal, -leans, map->right);
	if (fabs(leans) > STANDS || !v3_unit(map->up, up, 0))
		return false;
	map->kind = UV_MAP_UNROLLED;
	v3_cross(map->down, map->right, map->up);
	v3_copy(map->origin, capsule->a);
	map->radius_mm = capsule->radius;
	map->axis_mm = v3_length(axis);
	end = END_MAX * map->radius_mm;
	map->high_mm = fmin(2 * TURN_MAX * map->radius_mm, WIDE_MAX_MM);
	map->wide_mm = fmin(fmin(WIDE_MAX_MM, STRETCH_MAX * map->high_mm),
			    map->axis_mm + 2 * end);
	v3_sub(out, top.point_mm, map->origin);
	v3_add(out, out, -map->radius_mm, top.normal);
	least = map->wide_mm / 2 - end;
	most = map->axis_mm + end - map->wide_mm / 2;
	at = v3_dot(out, map->right) + map->radius_mm * asin(leans);
	map->middle_mm = fmax(fmin(at, most), least);
	map->top_mm[0] = at - map->middle_mm;
	return true;
}

static bool unrolled_px(const struct uv_map *map, const double point_mm[3], double px[2])
{
	double out[3], t, end, up, down, turn, at[2];

	v3_sub(out, point_mm, map->origin);
	end = v3_dot(out, map->right);
	t = fmin(fmax(end, 0), map->axis_mm);
	end -= t;
	up = v3_dot(out, map->up);
	down = v3_dot(out, map->down);
	turn = atan2(down, up);
	t += map->radius_mm * atan2(end, hypot(up, down));
	at[0] = map->size * (0.5 + (t - map->middle_mm) / map->wide_mm);
	at[1] = map->size * (0.5 + turn * map->radius_mm / map->high_mm);
	if (!on_texture(map, at))
		return false;
	px[0] = at[0];
	px[1] = at[1];
	return true;
}

/* A texel's place on the axis, and its angles towards the end and around the axis. */
static double turns(const struct uv_map *map, const double px[2], double *end,
		    double *turn)
{
	double s = map->middle_mm + (px[0] / map->size - 0.5) * map->wide_mm;
	double t = fmin(fmax(s, 0), map->axis_mm);

	*end = (s - t) / map->radius_mm;
	*turn = (px[1] / map->size - 0.5) * map->high_mm / map->radius_mm;
	return t;
}

static void unrolled_point(const struct uv_map *map, const double px[2],
			   double point_mm[3], double normal[3])
{
	double end, turn, t = turns(map, px, &end, &turn);

	for (int i = 0; i < 3; i++)
		normal[i] =
			cos(end) * (cos(turn) * map->up[i] + sin(turn) * map->down[i]) +
			sin(end) * map->right[i];
	v3_add(point_mm, map->origin, t, map->right);
	v3_add(point_mm, point_mm, map->radius_mm, normal);
}

static void unrolled_metric(const struct uv_map *map, const double px[2],
			    double right_mm[3], double down_mm[3])
{
	double end, turn, wide = map->wide_mm / map->size;
	double high = map->high_mm / map->size;

	turns(map, px, &end, &turn);
	for (int i = 0; i < 3; i++) {
		double out = cos(turn) * map->up[i] + sin(turn) * map->down[i];

		right_mm[i] = wide * (cos(end) * map->right[i] - sin(end) * out);
		down_mm[i] = high * cos(end) *
			     (cos(turn) * map->down[i] - sin(turn) * map->up[i]);
	}
}

/*
 * The triangles: a grid over the texture, 100 × 100 cells of two.
 *
 *      ●──●──●──●     ● a place of the surface
 *      │ ╱│ ╱│ ╱│
 *      ●──●──●──◌     ◌ outside: moved towards a neighbour onto the surface's border
 *      │ ╱│ ╱
 *      ●──◌
 */
#define CELLS 100
#define SIDE (CELLS + 1)

/* Halvings of a cell on the way to the border: less than a thousandth of a texel. */
#define HALVINGS 24

struct node {
	bool there;
	double px[2], drawn[3], normal[3];
	uint32_t number; /* of the vertex, or NO_VERTEX */
};

#define NO_VERTEX UINT32_MAX

struct uv_map_grid {
	const struct uv_map *map;
	struct node *node; /* SIDE² */
};

static bool place_uv_node(struct uv_map_grid *grid, struct node *node, const double px[2])
{
	double point[3];

	if (!uv_map_point(grid->map, px, point, node->normal))
		return false;
	v3_add(node->drawn, point, uv_map_relief_mm(grid->map, px), node->normal);
	node->px[0] = px[0];
	node->px[1] = px[1];
	return true;
}

static void node_px(const struct uv_map_grid *grid, int i, double px[2])
{
	px[0] = (double)grid->map->size * (i % SIDE) / CELLS;
	px[1] = (double)grid->map->size * (i / SIDE) / CELLS;
}

/* The number of a neighbour, or -1. */
static int neighbour(int i, int dx, int dy)
{
	int x = i % SIDE + dx, y = i / SIDE + dy;

	return x < 0 || x >= SIDE || y < 0 || y >= SIDE ? -1 : y * SIDE + x;
}

/* The last place on the surface between one on it and one outside. */
static void to_border(struct uv_map_grid *grid, struct node *node, const double on[2],
		      const double off[2])
{
	double in = 0, out = 1, px[2];

	for (int k = 0; k < HALVINGS; k++) {
		double mid = (in + out) / 2;

		px[0] = on[0] + mid * (off[0] - on[0]);
		px[1] = on[1] + mid * (off[1] - on[1]);
		if (place_uv_node(grid, node, px))
			in = mid;
		else
			out = mid;
	}
	if (in == 0)
		place_uv_node(grid, node, on);
}

static void place_all(struct uv_map_grid *grid)
{
	static const int around[8][2] = {{1, 0}, {0, 1},  {-1, 0},  {0, -1},
					 {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
	double px[2], on[2];

	for (int i = 0; i < SIDE * SIDE; i++) {
		node_px(grid, i, px);
		grid->node[i].there = place_uv_node(grid, &grid->node[i], px);
	}
	/* `there` does not change here: vertices move towards true neighbours only. */
	for (int i = 0; i < SIDE * SIDE; i++) {
		struct node *node = &grid->node[i];

		node->number = node->there ? 0 : NO_VERTEX;
		for (int k = 0; k < 8 && node->number; k++) {
			int other = neighbour(i, around[k][0], around[k][1]);

			if (other < 0 || !grid->node[other].there)
				continue;
			node_px(grid, i, px);
			node_px(grid, other, on);
			to_border(grid, node, on, px);
			node->number = 0;
		}
	}
}

/* The place of a neighbour, or without one of the vertex itself. */
static const double *beside(const struct uv_map_grid *grid, int i, int dx, int dy)
{
	int other = neighbour(i, dx, dy);

	return grid->node[other < 0 || grid->node[other].number == NO_VERTEX ? i : other]
		.drawn;
}

/* The normal as drawn: facets of a mesh smoothed, with the relief. */
static void drawn_normal(const struct uv_map_grid *grid, int i, double normal[3])
{
	double right[3], down[3], out[3];

	v3_sub(right, beside(grid, i, 1, 0), beside(grid, i, -1, 0));
	v3_sub(down, beside(grid, i, 0, 1), beside(grid, i, 0, -1));
	v3_cross(out, down, right);
	if (!v3_unit(normal, out, 0))
		v3_copy(normal, grid->node[i].normal);
}

/* Whether the relief reaches its neighbours. */
static bool raised(const struct uv_map *map, const double px[2])
{
	double cell = (double)map->size / CELLS;

	for (int k = -1; k <= 1; k++)
		if (uv_map_relief_mm(map, (double[2]){px[0] + k * cell, px[1]}) > 1e-6 ||
		    uv_map_relief_mm(map, (double[2]){px[0], px[1] + k * cell}) > 1e-6)
			return true;
	return false;
}

static void write_vertex(const struct uv_map_grid *grid, int i, struct uv_map_vertex *to)
{
	bool faceted = incise_surface_triangles(grid->map->surface) > 0;
	const struct node *node = &grid->node[i];
	double normal[3], right[3], down[3], side[3], tangent[3];

	if (faceted || raised(grid->map, node->px))
		drawn_normal(grid, i, normal);
	else
		v3_copy(normal, node->normal);
	uv_map_metric(grid->map, node->px, right, down);
	v3_add(side, right, -v3_dot(right, normal), normal);
	if (!v3_unit(tangent, side, 0))
		v3_copy(tangent, grid->map->right);
	for (int k = 0; k < 3; k++) {
		to->position_mm[k] = (float)node->drawn[k];
		to->normal[k] = (float)normal[k];
		to->tangent[k] = (float)tangent[k];
	}
	/* normal × right points up. */
	to->tangent[3] = -1;
	to->px[0] = (float)node->px[0];
	to->px[1] = (float)node->px[1];
}

static void write_triangle(const struct uv_map_grid *grid, struct uv_map *map,
			   const int corner[3])
{
	bool there = false;

	for (int k = 0; k < 3; k++) {
		if (grid->node[corner[k]].number == NO_VERTEX)
			return;
		there = there || grid->node[corner[k]].there;
	}
	/* With no corner at its own place, the triangle is a sliver. */
	for (int k = 0; k < 3 && there; k++)
		map->indices[map->n_indices++] = grid->node[corner[k]].number;
}

static int make_grid(struct uv_map *map)
{
	const size_t n = SIDE * SIDE;
	struct uv_map_grid grid = {map, calloc(n, sizeof(*grid.node))};

	map->vertices = calloc(n, sizeof(*map->vertices));
	map->indices = calloc(6 * CELLS * CELLS, sizeof(*map->indices));
	if (!grid.node || !map->vertices || !map->indices) {
		free(grid.node);
		return -ENOMEM;
	}
	place_all(&grid);
	for (int i = 0; i < SIDE * SIDE; i++)
		if (grid.node[i].number != NO_VERTEX)
			write_vertex(&grid, i, map->vertices + map->n_vertices++);
	for (int i = 0, number = 0; i < SIDE * SIDE; i++)
		if (grid.node[i].number != NO_VERTEX)
			grid.node[i].number = (uint32_t)number++;
	for (int i = 0; i < SIDE * (SIDE - 1); i++)
		if (i % SIDE < CELLS) {
			write_triangle(&grid, map, (int[]){i, i + SIDE, i + 1});
			write_triangle(&grid, map,
				       (int[]){i + 1, i + SIDE, i + SIDE + 1});
		}
	free(grid.node);
	return 0;
}

/* Choose the kind for the surface; set its values and its triangles. */
static int init(struct uv_map *map)
{
	const struct incise_surface *surface = map->surface;

	if (surface->kind == INCISE_SURFACE_MESH && surface->mesh->uv) {
		int rc = uv_atlas_init(map);

		/* Texture coordinates without area do not count. */
		if (rc)
			return rc;
		if (map->kind == UV_MAP_ATLAS)
			return uv_atlas_mesh(map);
	}
	if (surface->kind != INCISE_SURFACE_CAPSULE || !unrolled_init(map))
		above_init(map);
	return make_grid(map);
}

struct uv_map *uv_map_new(const struct incise_surface *surface,
			  const struct incise_scene_picture *picture,
			  struct incise_error *err)
{
	int size = picture->texture_px, rc;
	struct uv_map *map;

	if (size < 16 || size > 16384 || (size & (size - 1)))
		return INCISE_ERROR_NULL(
			err, EINVAL, "a texture of %d texels: expected 256, 512 … 4096",
			size);
	map = calloc(1, sizeof(*map));
	if (map) {
		map->surface = surface;
		map->size = size;
		map->larynx = picture->larynx;
		rc = init(map);
		if (!rc)
			return map;
		uv_map_free(map);
	}
	return INCISE_ERROR_NULL(err, ENOMEM, "no memory for the image's surface");
}

void uv_map_free(struct uv_map *map)
{
	if (!map)
		return;
	uv_atlas_free(map->atlas);
	free(map->vertices);
	free(map->indices);
	free(map);
}

bool uv_map_px(const struct uv_map *map, const double point_mm[3], double px[2])
{
	/* No surface is farther away, and squares would overflow. */
	for (int i = 0; i < 3; i++)
		if (!(fabs(point_mm[i]) <= 1e9))
			return false;
	switch (map->kind) {
	case UV_MAP_ATLAS:
		return uv_atlas_px(map, point_mm, px);
	case UV_MAP_UNROLLED:
		return unrolled_px(map, point_mm, px);
	default:
		return above_px(map, point_mm, px);
	}
}

bool uv_map_point(const struct uv_map *map, const double px[2], double point_mm[3],
		  double normal[3])
{
	if (!on_texture(map, px))
		return false;
	switch (map->kind) {
	case UV_MAP_ATLAS:
		return uv_atlas_point(map, px, point_mm, normal);
	case UV_MAP_UNROLLED:
		unrolled_point(map, px, point_mm, normal);
		return true;
	default:
		return above_point(map, px, point_mm, normal);
	}
}

void uv_map_metric(const struct uv_map *map, const double px[2], double right_mm[3],
		   double down_mm[3])
{
	double at[2];

	/* fmax() turns NaN into 0. */
	for (int i = 0; i < 2; i++)
		at[i] = fmin(fmax(px[i], 0), map->size);
	if (map->kind == UV_MAP_UNROLLED) {
		unrolled_metric(map, at, right_mm, down_mm);
		return;
	}
	if (map->kind == UV_MAP_ATLAS ? uv_atlas_metric(map, at, right_mm, down_mm)
				      : above_metric(map, at, right_mm, down_mm))
		return;
	for (int i = 0; i < 3; i++) {
		right_mm[i] = map->wide_mm / map->size * map->right[i];
		down_mm[i] = map->high_mm / map->size * map->down[i];
	}
}

/*
 * The larynx in relief, as smooth hills. Sizes fit an adult: the membrane of
 * about 10 mm between thyroid and cricoid cartilage is where a cricothyroidotomy cuts.
 *
 *   head      thyroid cartilage      membrane  cricoid  trachea    chest
 *             notch  prominence         ╎       ring
 *               ╲  ▂▆█▇▆▅▄▃▂▁           ╎       ▂▃▂  ▁▁▁▁▁▁▁▁▁
 *   -40       -30      -20      -10     0        8      20     caudal_mm
 */

/* The least side of a texture that it fits on. */
#define LARYNX_SIDE_MM 60.0

static double bell(double x, double width)
{
	return exp(-(x / width) * (x / width));
}

/* From 0 to 1 where x goes from -width to width. */
static double step_uv_map(double x, double width)
{
	double t = fmin(fmax(0.5 + 0.5 * x / width, 0), 1);

	return t * t * t * (t * (6 * t - 15) + 10);
}

/*
 * Two plates that meet in the midline, highest at the prominence, lower towards the
 * membrane; above the prominence a notch parts them.
 */
static double thyroid(double caudal_mm, double side_mm)
{
	double ridge = 0.55 * bell(side_mm, 7) + 0.45 * bell(side_mm, 17);
	double along = step_uv_map(caudal_mm + 31, 6) * step_uv_map(-caudal_mm - 7, 5.5);
	double rise = 0.45 + 0.55 * bell(caudal_mm + 20, 9);
	double notch = 1 - 0.75 * bell(caudal_mm + 30, 6) * bell(side_mm, 4.5);

	return 4.6 * ridge * along * rise * notch;
}

double larynx_height_mm(double caudal_mm, double side_mm)
{
	double cricoid = 2.0 * bell(caudal_mm - 9.5, 5) * bell(side_mm, 14);
	double trachea = 0.7 * step_uv_map(caudal_mm - 14, 8) *
			 step_uv_map(58 - caudal_mm, 16) * bell(side_mm, 12);
	double height = thyroid(caudal_mm, side_mm) + cricoid + trachea;

	return isfinite(height) ? fmin(height, 5) : 0;
}

double uv_map_relief_mm(const struct uv_map *map, const double px[2])
{
	if (!map->larynx || map->kind == UV_MAP_ATLAS || !on_texture(map, px) ||
	    !(map->wide_mm >= LARYNX_SIDE_MM && map->high_mm >= LARYNX_SIDE_MM))
		return 0;
	return larynx_height_mm((px[0] / map->size - 0.5) * map->wide_mm - map->top_mm[0],
				(px[1] / map->size - 0.5) * map->high_mm -
					map->top_mm[1]);
}

double uv_map_relief_at_mm(const struct uv_map *map, const double point_mm[3],
			   double normal[3])
{
	struct incise_touch touch;
	double px[2];

	if (!map->larynx)
		return 0;
	incise_surface_nearest(map->surface, point_mm, &touch);
	v3_copy(normal, touch.normal);
	return uv_map_px(map, touch.point_mm, px) ? uv_map_relief_mm(map, px) : 0;
}

bool uv_map_meet(const struct uv_map *map, const double from_mm[3], const double way[3],
		 double far_mm, double point_mm[3], double normal[3])
{
	struct incise_touch touch;
	double up_mm = 0, up[3] = {0};

	if (!v3_finite(way))
		return false;
	/* The relief is only known where the ray meets it: iterate, each time with the last. */
	for (int i = 0; i < 4; i++) {
		double from[3], to[3];

		v3_add(from, from_mm, -up_mm, up);
		v3_add(to, from, far_mm, way);
		if (!incise_surface_enters(map->surface, from, to, &touch))
			return false;
		v3_copy(point_mm, touch.point_mm);
		v3_copy(normal, touch.normal);
		up_mm = uv_map_relief_at_mm(map, point_mm, up);
		if (up_mm == 0)
			break;
	}
	return true;
}
