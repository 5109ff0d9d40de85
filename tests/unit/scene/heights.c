// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/scene/heights.c: grids of spheres, capsules, planes and meshes compared with the surfaces
 * themselves at random places: no place is beyond the certified bound, and one is at least a tenth of
 * the bound away. Then the refusals.
 */
#include "../unit.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/heights.h"
#include "../../../lib/surface/surface.h"
#include "../cases.h"
#include "../message.h"

#define ONE 65536.0
#define UNIT 1073741824.0

/* With seven surfaces more than 10⁶; accesses are the same at fewer. */
#define PLACES cases_of(300000, 20000)

static const double up[3] = {0, 0, 1};

/* A sheet of n × m cells of two triangles each, of a height that is a function of the place. */
struct sheet {
	double width, length; /* mm along x and y */
	int n, m;
	double (*height)(double x, double y);
};

static double neck(double x, double y)
{
	return sqrt(55 * 55 - y * y) - 55 + 1.5 * sin(x / 25) * cos(y / 30);
}

static double cap(double x, double y)
{
	return sqrt(150 * 150 - x * x - y * y) - 150;
}

/* Triangles at random heights: no surface that is smooth. */
static double rough(double x, double y)
{
	return 0.02 * rand() / RAND_MAX + 3 * sin(x / 20) * sin(y / 15);
}

static double roof(double x, double y)
{
	return -0.1 * fabs(x);
}

static struct incise_surface *sheet_surface(const struct sheet *s)
{
	struct incise_surface *surface = calloc(1, sizeof(*surface));
	size_t wide = (size_t)s->n + 1, points = wide * ((size_t)s->m + 1);
	size_t cells = (size_t)s->n * (size_t)s->m;
	struct mesh_draft draft = {.path = "sheet", .n_points = points};

	draft.n_triangles = 2 * cells;
	draft.point = malloc(points * sizeof(*draft.point));
	draft.corner = malloc(2 * cells * sizeof(*draft.corner));
	if (!surface || !draft.point || !draft.corner)
		abort();
	for (size_t k = 0; k < points; k++) {
		double *p = draft.point[k];

		p[0] = s->width * ((double)(k % wide) / s->n - 0.5);
		p[1] = s->length * ((double)(k / wide) / s->m - 0.5);
		p[2] = s->height(p[0], p[1]);
	}
	for (size_t k = 0; k < cells; k++) {
		uint32_t a = (uint32_t)(k / (size_t)s->n * wide + k % (size_t)s->n);
		uint32_t c = a + (uint32_t)wide;
		/* Cut along either diagonal, in turn. */
		uint32_t corner[2][2][3] = {{{a, a + 1, c + 1}, {a, c + 1, c}},
					    {{a, a + 1, c}, {a + 1, c + 1, c}}};

		memcpy(draft.corner[2 * k], corner[(k + k / (size_t)s->n) % 2],
		       sizeof(corner[0]));
	}
	surface->kind = INCISE_SURFACE_MESH;
	surface->mesh = mesh_new(&draft, NULL);
	free(draft.point);
	free(draft.corner);
	if (!surface->mesh)
		abort();
	return surface;
}

static double any(double least, double most)
{
	return least + (most - least) * rand() / RAND_MAX;
}

struct seen {
	double depth_mm, point_mm, normal_rad;
	int places;
};

static void see(double *most, double value)
{
	*most = fmax(*most, value);
}

/* In the grid's own frame. */
static void local(const struct incise_fixed_grid_frame *frame, const double p[3],
		  double to[3])
{
	for (int k = 0; k < 3; k++) {
		to[k] = 0;
		for (int i = 0; i < 3; i++)
			to[k] += (p[i] - frame->origin[i] / ONE) * frame->axis[k][i] /
				 UNIT;
	}
}

static bool is_inside(const struct incise_fixed_grid_frame *frame, const double p[3],
		      double margin)
{
	double cell = ldexp(1 / ONE, frame->cell_shift), at[3];

	local(frame, p, at);
	margin = 1.25 * margin + 2 * cell;
	return at[0] > margin && at[1] > margin &&
	       at[0] < (frame->columns - 1) * cell - margin &&
	       at[1] < (frame->rows - 1) * cell - margin;
}

/* A place so deep below a random one of the surface. */
static bool any_place(const struct incise_surface *surface,
		      const struct incise_fixed_grid_frame *frame, double depth,
		      int32_t p[3])
{
	double cell = ldexp(1 / ONE, frame->cell_shift), from[3], to[3];
	double u = any(0, (frame->columns - 1) * cell),
	       v = any(0, (frame->rows - 1) * cell);
	struct incise_touch touch;

	for (int i = 0; i < 3; i++) {
		from[i] = frame->origin[i] / ONE +
			  (u * frame->axis[0][i] + v * frame->axis[1][i] +
			   900 * (double)frame->axis[2][i]) /
				  UNIT;
		to[i] = from[i] - 1800.0 * frame->axis[2][i] / UNIT;
	}
	if (!incise_surface_enters(surface, from, to, &touch))
		return false;
	for (int i = 0; i < 3; i++)
		p[i] = (int32_t)lrint((touch.point_mm[i] - depth * touch.normal[i]) *
				      ONE);
	return true;
}

static void compare(const struct incise_surface *surface,
		    const struct incise_fixed_grid *grid, double leave,
		    double depth_bound_mm, struct seen *seen)
{
	double reach = grid->frame.reach / ONE, p_mm[3], way[3], unit[3], off[3];
	struct incise_touch touch;
	struct incise_fixed_spot spot;
	int32_t p[3];

	if (!any_place(surface, &grid->frame, any(-leave, reach), p))
		return;
	for (int i = 0; i < 3; i++)
		p_mm[i] = p[i] / ONE;
	incise_surface_nearest(surface, p_mm, &touch);
	if (!is_inside(&grid->frame, p_mm, reach) ||
	    touch.depth_mm > reach - depth_bound_mm)
		return;
	if (!incise_fixed_grid_nearest(grid, p, &spot))
		fail_msg("no point at (%g, %g, %g), %g deep", p_mm[0], p_mm[1], p_mm[2],
			 touch.depth_mm);
	seen->places++;
	see(&seen->depth_mm, fabs(spot.depth / ONE - touch.depth_mm));
	for (int i = 0; i < 3; i++)
		off[i] = spot.point[i] / ONE - touch.point_mm[i];
	see(&seen->point_mm, v3_length(off));
	/* The direction from the tool, as a tick takes it. */
	v3_copy(unit, touch.normal);
	v3_sub(way, touch.point_mm, p_mm);
	if (touch.depth_mm > 1e-3)
		v3_unit(unit, way, 0);
	for (int i = 0; i < 3; i++)
		off[i] = spot.normal[i] / UNIT - unit[i];
	see(&seen->normal_rad, 2 * asin(v3_length(off) / 2));
}

static void check(const char *name, struct incise_surface *surface, double reach,
		  double wanted, double most_ratio)
{
	struct incise_heights heights;
	struct incise_fixed_grid grid;
	struct seen seen = {0};
	int rc = incise_heights_make(surface, up, 1, reach, wanted, &heights, &err);

	if (rc)
		fail_msg("%s: %s", name, err.text);
	assert_int_equal(
		incise_fixed_grid_open(
			&grid, &heights.frame, heights.height,
			(uint32_t)(heights.frame.columns * heights.frame.rows) * 4),
		0);
	for (int k = 0; k < PLACES; k++)
		compare(surface, &grid, fmin(1, heights.frame.reach / ONE),
			heights.depth_bound_mm, &seen);
	print_message(
		"%s: %d x %d knots %.3g mm apart; reach %.2f of %.0f mm; %d places; depth "
		"%.2g of %.2g mm (1:%.1f), point %.2g of %.2g mm (1:%.1f), normal %.2g of %.2g rad (1:%.1f)\n",
		name, heights.frame.columns, heights.frame.rows,
		ldexp(1 / ONE, heights.frame.cell_shift), heights.frame.reach / ONE,
		reach, seen.places, seen.depth_mm, heights.depth_bound_mm,
		heights.depth_bound_mm / seen.depth_mm, seen.point_mm,
		heights.point_bound_mm, heights.point_bound_mm / seen.point_mm,
		seen.normal_rad, heights.normal_bound_rad,
		heights.normal_bound_rad / seen.normal_rad);
	assert_true(seen.places > PLACES / 100);
	assert_true(seen.depth_mm <= heights.depth_bound_mm);
	assert_true(seen.point_mm <= heights.point_bound_mm);
	assert_true(seen.normal_rad <= heights.normal_bound_rad);
	assert_true(heights.depth_bound_mm <= wanted);
	/* A bound that is much too large would be of no use. */
	assert_true(heights.depth_bound_mm <= most_ratio * seen.depth_mm);
	incise_heights_free(&heights);
	incise_surface_free(surface);
}

TEST(test_bounds_hold)
{
	static const struct {
		const char *name;
		struct sheet sheet;
		double reach, wanted;
	} meshes[] = {
		{"neck, 0.5 mm", {200, 80, 400, 160, neck}, 10, 0.02},
		{"neck, 2 mm", {200, 80, 97, 39, neck}, 10, 0.05},
		{"cap, 1 mm", {100, 100, 100, 100, cap}, 15, 0.02},
		{"rough, 3 mm", {120, 120, 40, 40, rough}, 10, 0.1},
		{"roof", {100, 100, 2, 2, roof}, 10, 0.1},
	};
	const double a[3] = {-60, 0, -55}, b[3] = {160, 0, -55}, centre[3] = {3, 4, 5};

	srand(1);
	for (size_t k = 0; k < sizeof(meshes) / sizeof(*meshes); k++)
		check(meshes[k].name, sheet_surface(&meshes[k].sheet), meshes[k].reach,
		      meshes[k].wanted, 10);
	check("sphere", incise_surface_new_sphere(centre, 100, NULL), 10, 0.02, 10);
	check("capsule of neck.scene", incise_surface_new_capsule(a, b, 55, NULL), 10,
	      0.02, 10);
}

static void refuse(struct incise_surface *surface, const double along[3],
		   const char *text)
{
	struct incise_heights heights;

	assert_error(incise_heights_make(surface, along, 1, 10, 0.02, &heights, &err),
		     ERANGE, &err, text, "remove --in-kernel");
	assert_null(heights.height);
	incise_surface_free(surface);
}

static double cliff(double x, double y)
{
	return x > 10 ? 30 : 0;
}

static double wide(double x, double y)
{
	return x / 100;
}

/* A second sheet over the middle of the first. */
static struct incise_surface *layers(void)
{
	struct mesh_draft draft = {.path = "layers", .n_points = 6, .n_triangles = 2};
	double point[6][3] = {{0, 0, 0},   {60, 0, 0},	{0, 60, 0},
			      {10, 10, 5}, {30, 10, 5}, {10, 30, 5}};
	uint32_t corner[2][3] = {{0, 1, 2}, {3, 4, 5}};
	struct incise_surface *surface = calloc(1, sizeof(*surface));

	if (!surface)
		abort();
	draft.point = point;
	draft.corner = corner;
	surface->kind = INCISE_SURFACE_MESH;
	surface->mesh = mesh_new(&draft, NULL);
	return surface;
}

TEST(test_refusals)
{
	static const struct sheet steep = {60, 60, 60, 60, cliff},
				  flat = {60, 60, 4, 4, wide},
				  large = {9000, 60, 40, 4, wide};
	const double aside[3] = {1, 0, 0}, point[3] = {0, 0, 5000}, down[3] = {0, 0, -1};

	/* The cliff lies between 10 and 11 mm. */
	refuse(sheet_surface(&steep), up, "at (10.");
	refuse(sheet_surface(&flat), aside, "overhang");
	refuse(sheet_surface(&flat), down, "overhang");
	refuse(layers(), up, "overhang");
	refuse(sheet_surface(&large), up, "heights are limited to 4000 mm");
	refuse(incise_surface_new_plane(point, up, NULL), up,
	       "heights are limited to 4000 mm");
	refuse(incise_surface_new_plane(down, up, NULL), aside, "overhang");
}

/* Where the mesh has a hole there is no height, and beyond its border neither. */
TEST(test_holes_have_no_height)
{
	static const struct sheet flat = {60, 60, 60, 60, wide};
	struct incise_surface *surface = sheet_surface(&flat);
	struct incise_heights heights;
	struct incise_fixed_grid grid;
	struct incise_fixed_spot spot;
	int32_t in[3] = {0, 0, -65536}, out[3] = {29 << 16, 0, -65536}, none = 0;
	struct mesh_draft draft = {.path = "hole",
				   .point = surface->mesh->vertex,
				   .corner = surface->mesh->corner,
				   .n_points = surface->mesh->n_vertices};
	struct incise_surface hole = {.kind = INCISE_SURFACE_MESH};

	/* Triangles of the right third are left out. */
	for (uint32_t k = 0; k < surface->mesh->n_triangles; k++)
		if (surface->mesh->vertex[surface->mesh->corner[k][0]][0] < 10)
			memmove(draft.corner[draft.n_triangles++],
				surface->mesh->corner[k], sizeof(draft.corner[0]));
	/* One far away keeps the region as wide. */
	memmove(draft.corner[draft.n_triangles++],
		surface->mesh->corner[surface->mesh->n_triangles - 1],
		sizeof(draft.corner[0]));
	hole.mesh = mesh_new(&draft, NULL);
	assert_non_null(hole.mesh);
	assert_int_equal(incise_heights_make(&hole, up, 1, 5, 0.02, &heights, NULL), 0);
	assert_int_equal(
		incise_fixed_grid_open(
			&grid, &heights.frame, heights.height,
			(uint32_t)(heights.frame.columns * heights.frame.rows) * 4),
		0);
	for (int k = 0; k < heights.frame.columns * heights.frame.rows; k++)
		none += heights.height[k] == INCISE_FIXED_GRID_NONE;
	assert_true(none > 0);
	assert_true(incise_fixed_grid_nearest(&grid, in, &spot));
	/* 1 mm below a plane that is almost level; 0.1 m up in 1 m aside, and its rounding. */
	assert_true(abs(spot.depth - 65536) < 65536 / 1000);
	assert_false(incise_fixed_grid_nearest(&grid, out, &spot));
	incise_heights_free(&heights);
	mesh_free(hole.mesh);
	incise_surface_free(surface);
}
