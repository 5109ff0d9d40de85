/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Random scenes and a random hand: each seed draws a tracker, a surface, forces, a tool, limits, a membrane
 * and a model, as the text of a scene in double and of the same one in integers; and a hand that moves
 * scalpel and tube above, through and below its skin. Neither is checked to be stable.
 */
#ifndef INCISE_TEST_DRAWN_H
#define INCISE_TEST_DRAWN_H

#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"
#include "fed.h"

#define TEXT_MOST 4096

/* --- draws -------------------------------------------------------------------------------- */

static inline double between(uint64_t *seed, double low, double high)
{
	return low + (high - low) * (incise_random_symmetric(seed) + 1) / 2;
}

/* As many of each size. */
static inline double sized(uint64_t *seed, double low, double high)
{
	return exp(between(seed, log(low), log(high)));
}

static inline int below(uint64_t *seed, int n)
{
	return (int)(incise_random_next(seed) % (uint64_t)n);
}

static inline bool chance(uint64_t *seed, double p)
{
	return between(seed, 0, 1) < p;
}

static inline void any_vector(uint64_t *seed, double size, double v[3])
{
	for (int i = 0; i < 3; i++)
		v[i] = between(seed, -size, size);
}

/* --- models ------------------------------------------------------------------------------- */

static const struct {
	int n;
	enum incise_model_input inputs[INCISE_LOOP_INPUTS_MAX];
} kinds[] = {
	{1, {INCISE_INPUT_DEPTH}},
	{2, {INCISE_INPUT_DEPTH, INCISE_INPUT_SPEED}},
	{3, {INCISE_INPUT_SPEED, INCISE_INPUT_DEPTH, INCISE_INPUT_ACCELERATION}},
	{4,
	 {INCISE_INPUT_TIME, INCISE_INPUT_ACCELERATION, INCISE_INPUT_DEPTH,
	  INCISE_INPUT_SPEED}},
	{4,
	 {INCISE_INPUT_MEAN_SPEED, INCISE_INPUT_DEPTH, INCISE_INPUT_DEEPEST,
	  INCISE_INPUT_SPEED}},
	/* These have no bound in integers on a mesh. */
	{3, {INCISE_INPUT_TILT, INCISE_INPUT_DEPTH, INCISE_INPUT_TIME}},
	{4,
	 {INCISE_INPUT_DEPTH, INCISE_INPUT_SPEED, INCISE_INPUT_TILT, INCISE_INPUT_TIME}},
};
#define KINDS ((int)(sizeof(kinds) / sizeof(*kinds)))
#define KINDS_LEVEL 5 /* without the tilt */

static inline void model_path(char path[80], int kind, const char *end)
{
	snprintf(path, 80, "%s/k%d.%s", folder.dir, kind, end);
}

/* About 0.1 N/mm; its support is left by deep, fast and long cuts. Some of its forces pull. */
static inline void write_model(int kind)
{
	static const struct incise_variable all[INCISE_MODEL_INPUT_KINDS] = {
		[INCISE_INPUT_DEPTH] = {"depth_mm", 0, 6},
		[INCISE_INPUT_SPEED] = {"velocity_mm_s", 0, 80},
		[INCISE_INPUT_ACCELERATION] = {"acceleration_mm_s2", -900, 900},
		[INCISE_INPUT_TILT] = {"tilt_deg", 0, 40},
		[INCISE_INPUT_TIME] = {"time_in_tissue_s", 0, 0.2},
		[INCISE_INPUT_MEAN_SPEED] = {"mean_speed_mm_s", 0, 60},
		[INCISE_INPUT_DEEPEST] = {"deepest_mm", 0, 6},
	};
	static const struct incise_variable out = {"force_N", 0, 4};
	static const int mfs[] = {3, 2, 2, 2};
	const double slope[INCISE_MODEL_INPUT_KINDS] = {0.1, 0.005, 1e-4, 0.001,
							0.5, 0.002, 0.02};
	struct incise_variable in[INCISE_LOOP_INPUTS_MAX];
	struct incise_model *model;
	struct incise_fixed_options direct;
	struct incise_fixed *fixed;
	char path[80];

	for (int i = 0; i < kinds[kind].n; i++)
		in[i] = all[kinds[kind].inputs[i]];
	model = incise_model_new_grid(kinds[kind].n, in, mfs, INCISE_MF_GAUSS, &out,
				      NULL);
	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		double p[INCISE_LOOP_INPUTS_MAX + 1] = {0.03 * (r % 5) - 0.04};

		for (int i = 0; i < kinds[kind].n; i++)
			p[i + 1] = slope[kinds[kind].inputs[i]] * (1 - 0.4 * (r % 3));
		incise_model_set_consequent(model, r, p);
	}
	model_path(path, kind, "fis");
	succeeds(!incise_model_save(model, path, &err));
	/* The one that three inputs and more have, with any error: it takes no search. */
	incise_fixed_options_init(&direct);
	direct.budget = 0;
	direct.arithmetic = INCISE_FIXED_DIRECT;
	fixed = incise_fixed_compile(model, &direct, &err);
	succeeds(fixed);
	model_path(path, kind, "fx");
	succeeds(!incise_fixed_save(fixed, path, &err));
	incise_fixed_free(fixed);
	incise_model_free(model);
}

/* --- scenes ------------------------------------------------------------------------------- */

struct text {
	char all[TEXT_MOST];
	size_t n;
};

static inline __attribute__((format(printf, 2, 3))) void add(struct text *to,
							     const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	to->n += (size_t)vsnprintf(to->all + to->n, TEXT_MOST - to->n, format, arguments);
	va_end(arguments);
	assert_true(to->n < TEXT_MOST);
}

static inline void add_number(struct text *to, const char *key, double value)
{
	add(to, " %s = %#.9g;", key, value);
}

static inline void add_vector(struct text *to, const char *key, const double v[3])
{
	add(to, " %s = [%#.9g, %#.9g, %#.9g];", key, v[0], v[1], v[2]);
}

/* A scene, and what the hand has to know of it. */
struct drawn {
	struct text text[2]; /* in double, in integers */
	double top_mm[3], up[3];
	bool is_mesh;
	struct incise_tracker_info tracker;
};

/* A skin whose top is at a place; or none, which is the plane z = 0. */
static inline void add_surface(struct drawn *d, uint64_t *seed, struct text *to)
{
	double radius_mm = sized(seed, 15, 200), end_mm[3], *top = d->top_mm;
	int kind = below(seed, 6);

	v3_copy(d->up, (const double[3]){0, 0, 1});
	v3_copy(top, (const double[3]){0, 0, 0});
	if (!kind)
		return;
	if (chance(seed, 0.5))
		any_vector(seed, 50, top);
	v3_copy(end_mm, top);
	end_mm[2] -= radius_mm;
	add(to, "surface = {");
	switch (kind) {
	case 1:
		any_vector(seed, 0.8, d->up);
		d->up[2] += 1;
		v3_unit(d->up, d->up, 0);
		add(to, " kind = \"plane\";");
		add_vector(to, "point_mm", top);
		add_vector(to, "normal", d->up);
		break;
	case 2:
		add(to, " kind = \"sphere\";");
		add_vector(to, "centre_mm", end_mm);
		add_number(to, "radius_mm", radius_mm);
		break;
	case 3:
		add(to, " kind = \"capsule\";");
		end_mm[0] -= 60;
		add_vector(to, "from_mm", end_mm);
		end_mm[0] += 120;
		add_vector(to, "to_mm", end_mm);
		add_number(to, "radius_mm", radius_mm);
		break;
	default:
		d->is_mesh = true;
		add(to, kind == 4 ? " kind = \"mesh\"; file = \"hill.obj\";"
				  : " kind = \"heights\"; file = \"hill.asc\";");
		add_vector(to, "at_mm", top);
	}
	add(to, " };\n");
}

/* A membrane in the tissue, more or less along the skin. */
static inline void add_membrane(const struct drawn *d, uint64_t *seed, struct text *to)
{
	double at_mm[3], normal[3], thickness_mm = sized(seed, 0.1, 3);

	any_vector(seed, 2, at_mm);
	v3_add(at_mm, at_mm, -v3_dot(at_mm, d->up) - between(seed, 1, 6), d->up);
	v3_add(at_mm, at_mm, 1, d->top_mm);
	any_vector(seed, 0.3, normal);
	v3_add(normal, normal, 1, d->up);
	v3_unit(normal, normal, 0);
	add(to, "membrane = {");
	add_vector(to, "point_mm", at_mm);
	add_vector(to, "normal", normal);
	add_number(to, "radius_mm", sized(seed, 0.3, 30));
	add_number(to, "puncture_N", chance(seed, 0.2) ? 0 : sized(seed, 0.05, 5));
	add_number(to, "thickness_mm", thickness_mm);
	add_number(to, "back_wall_mm", thickness_mm + sized(seed, 0.05, 5));
	add(to, " };\n");
}

/* All but the first. */
static inline void add_other_numbers(const struct incise_tissue_force *force,
				     uint64_t *seed, struct text *to)
{
	for (int k = 1; k < INCISE_FORCE_NUMBERS; k++) {
		const struct incise_force_number *number = &force->number[k];

		if (number->key)
			add_number(to, number->key,
				   chance(seed, 0.3)
					   ? 0
					   : between(seed, 0,
						     fmin(number->max,
							  fmax(3, 3 * number->skin))));
	}
}

/* Each force or none; at least one, or a model in place of the reaction. */
static inline void add_tissue(uint64_t *seed, bool model, bool dissipates,
			      struct text *to)
{
	int sure =
		below(seed, INCISE_FORCE_FRACTURE); /* none that acts by others alone */

	add(to, "tissue = { withdrawal = \"%s\"; orientation = \"%s\";",
	    dissipates ? "dissipative" : "paper", chance(seed, 0.5) ? "eased" : "paper");
	add_number(to, "gain", chance(seed, 0.1) ? 0 : sized(seed, 0.05, 10));
	add_number(to, "leave_mm", chance(seed, 0.2) ? 0 : between(seed, 0, 2));
	add_number(to, "cut_from_mm", chance(seed, 0.2) ? 0 : between(seed, 0, 3));
	add_number(to, "stretch_mm", chance(seed, 0.2) ? 0 : between(seed, 0, 12));
	add(to, " cuts_most = %d;",
	    chance(seed, 0.5) ? 1 + below(seed, 4) : 1 + below(seed, 64));
	for (int i = 0; i < incise_n_tissue_forces; i++) {
		const struct incise_tissue_force *force = &incise_tissue_forces[i];
		/* One that came later leaves the scenes else as they were. */
		uint64_t own = ~*seed, *from = i == INCISE_FORCE_FRACTURE ? &own : seed;
		bool is = i == sure || chance(from, 0.5);

		add_number(to, force->number[0].key,
			   is && !(model && i == INCISE_FORCE_REACTION)
				   ? fmax(force->number[0].skin, 1e-4) *
					     sized(from, 0.1, 50)
				   : 0);
		add_other_numbers(force, from, to);
	}
	add(to, " };\n");
}

static inline void add_tool(uint64_t *seed, struct text *to)
{
	double axis[3] = {0, 0, 1}, side[3];

	if (chance(seed, 0.3))
		any_vector(seed, 1, axis);
	if (!v3_unit(axis, axis, 0.1))
		v3_copy(axis, (const double[3]){1, 0, 0});
	v3_any_across(side, axis);
	add(to, "tool = {");
	add_vector(to, "axis", axis);
	add_vector(to, "side", side);
	add_number(to, "handle_mm", sized(seed, 1, 300));
	add_number(to, "handle_width_mm", sized(seed, 1, 30));
	add_number(to, "handle_thickness_mm", sized(seed, 0.1, 10));
	add_number(to, "tube_mm", sized(seed, 0.5, 30));
	add(to, " };\n");
}

static inline void add_limits(struct drawn *d, uint64_t *seed, struct text *to)
{
	double least_ms = (double)d->tracker.latency_ns * 1e-6 +
			  1e3 * d->tracker.stations / d->tracker.rate_hz;

	add(to, "limits = {");
	add_number(to, "force_N", sized(seed, 0.02, 100));
	add_number(to, "slew_N_s", sized(seed, 1, 1e5));
	add_number(to, "pose_age_ms", 1 + least_ms * between(seed, 1, 3));
	add_number(to, "fade_ms", sized(seed, 1, 200));
	add_number(to, "start_N", chance(seed, 0.1) ? 0 : sized(seed, 0.01, 100));
	add_number(to, "ramp_ms", sized(seed, 1, 300));
	add(to, " };\n");
}

/* Models of other phases of cutting are in double only. */
static inline void add_model(uint64_t *seed, const struct drawn *d, bool dissipates,
			     struct text to[2])
{
	int n = d->is_mesh ? KINDS_LEVEL : KINDS, cut = below(seed, n);

	add(&to[1], "model = \"k%d.fx\";\n", cut);
	if (chance(seed, 0.5)) {
		add(&to[0], "model = \"k%d.fis\";\n", cut);
		return;
	}
	add(&to[0], "model = { cut = \"k%d.fis\";", cut);
	if (chance(seed, 0.6))
		add(&to[0], " puncture = \"k%d.fis\";", below(seed, n));
	if (dissipates && chance(seed, 0.6))
		add(&to[0], " withdraw = \"k%d.fis\";", below(seed, n));
	add(&to[0], " };\n");
}

static inline void draw_tracker(uint64_t *seed, struct incise_tracker_info *tracker)
{
	bool stations = chance(seed, 0.4);
	double rate_hz = sized(seed, stations ? 80 : 40, 500);
	int64_t latency_ns = (int64_t)between(seed, 0, 15e6);

	*tracker = (struct incise_tracker_info){
		.name = "fed",
		.rate_hz = rate_hz,
		.latency_ns = latency_ns,
		.stations = stations ? 2 : 1,
		.scalpel_station = stations ? 1 : 0,
		.tube_station = stations ? 2 : 0,
	};
}

static inline void draw(uint64_t seed, struct drawn *d)
{
	static const double rates_hz[] = {250, 1000, 1000, 1000, 4000};
	struct text rest = {.n = 0};
	bool model, dissipates;

	memset(d, 0, sizeof(*d));
	draw_tracker(&seed, &d->tracker);
	model = chance(&seed, 0.5);
	dissipates = chance(&seed, 0.6);
	add_surface(d, &seed, &rest);
	add_tissue(&seed, model, dissipates, &rest);
	add_tool(&seed, &rest);
	add_limits(d, &seed, &rest);
	if (chance(&seed, 0.5))
		add_membrane(d, &seed, &rest);
	if (chance(&seed, 0.6))
		add(&rest, "effects = { average_ticks = %d; };\n", 1 + below(&seed, 64));
	add(&rest, "rate_hz = %.1f;\n", rates_hz[below(&seed, 5)]);
	if (model)
		add_model(&seed, d, dissipates, d->text);
	for (int k = 0; k < 2; k++)
		add(&d->text[k], "arithmetic = \"%s\";\n%s", k ? "fixed" : "double",
		    rest.all);
}

/* --- textures ------------------------------------------------------------------------------ */

/*
 * Give a scene whose model dissipates a texture of its own: teeth that rise from knot to knot, and leap in one
 * to anywhere, and factors of its cuts. Returns whether it does.
 */
static inline bool add_texture(uint64_t seed, struct incise_scene *scene)
{
	int most = (int)between(&seed, 500, INCISE_TEXTURE_MOST), at = 0;
	double falls = sized(&seed, 1e-3, 0.3), rise = sized(&seed, 0.005, 2) * most;
	double varies = chance(&seed, 0.5) ? 0 : between(&seed, 0, 0.4);
	struct incise_fixed_texture *to;

	if (!scene->cut[INCISE_CUT].path || !scene->tissue.dissipates)
		return false;
	to = calloc(1, sizeof(*to));
	assert_non_null(to);
	to->step_shift = 8 + below(&seed, 9);
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++) {
		at = chance(&seed, falls)
			     ? (int)between(&seed, -most, most)
			     : (int)fmin(most, at + between(&seed, 0, rise * falls));
		to->knot[i] = (int16_t)at;
		to->most = abs(at) > to->most ? abs(at) : to->most;
	}
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++) {
		to->start[i] = (uint16_t)below(&seed, INCISE_TEXTURE_KNOTS);
		to->factor[i] = (int32_t)(INCISE_FIXED_ONE *
					  exp(between(&seed, -varies, varies)));
		to->factor_most =
			to->factor[i] > to->factor_most ? to->factor[i] : to->factor_most;
	}
	incise_scene_leave_texture_out(scene);
	scene->texture = to;
	return true;
}

/* --- scenes to lean on -------------------------------------------------------------------- */

/* Half the side of a relief; a lean begins within the second. */
#define RELIEF_MM 40
#define MIDDLE_MM 18

enum relief { HILL, BOWL, GROOVE, RIDGE, EGGS, SADDLE, RELIEFS };
static const char *const reliefs[] = {"hill",  "bowl", "groove",
				      "ridge", "eggs", "saddle"};

static inline double relief_mm(enum relief kind, double size, double u, double v)
{
	switch (kind) {
	case HILL:
		return size / 10 * (cos(u / 13) + cos(v / 13));
	case BOWL:
		return (u * u + v * v) / (4 * size);
	case GROOVE:
		return fabs(v) * tan(size * M_PI / 180);
	case RIDGE:
		return -fabs(v) * tan(size * M_PI / 180);
	case EGGS:
		return size / 10 * cos(u / 8) * cos(v / 8);
	default:
		return (u * u - v * v) / (8 * size);
	}
}

/* A scene that is in reach of its device's limit, and where a hand can lean on it. */
struct leaned {
	struct text text;
	struct incise_tracker_info tracker;
	double core_mm[3],
		wide_mm[3]; /* a way to within so much of here meets the skin … */
	bool closed;	    /* … from all around; else along up */
	bool faceted, model;
	double deep_mm; /* half of its radius: a tool that is deeper is no lean on a skin */
	double up[3], top_mm[3], membrane_mm[3];
	bool membrane;
	double mass_kg, damping_N_s_mm, force_N, near_N_mm;
	int late_ticks;
	char what[300];
	size_t n_what;
};

static inline __attribute__((format(printf, 2, 3))) void say(struct leaned *l,
							     const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	l->n_what += (size_t)vsnprintf(l->what + l->n_what, sizeof(l->what) - l->n_what,
				       format, arguments);
	va_end(arguments);
	assert_true(l->n_what < sizeof(l->what));
}

static inline void shape_path(char path[80], const char *end)
{
	snprintf(path, 80, "%s/shape.%s", folder.dir, end);
}

/* As a mesh or as heights. */
static inline void add_relief(struct leaned *l, uint64_t *seed, bool mesh)
{
	enum relief kind = (enum relief)below(seed, RELIEFS);
	double size = between(seed, 10, 40);
	double turn = chance(seed, 0.5) ? 0 : between(seed, 0, M_PI);
	int n = 16 + 8 * below(seed, 4);
	double cell_mm = 2.0 * RELIEF_MM / n;
	char path[80];
	FILE *out;

	shape_path(path, mesh ? "obj" : "asc");
	out = fopen(path, "w");
	if (!mesh)
		fprintf(out,
			"ncols %d\nnrows %d\nxllcenter %d\nyllcenter %d\ncellsize %.9f\n",
			n + 1, n + 1, -RELIEF_MM, -RELIEF_MM, cell_mm);
	for (int j = 0; j <= n; j++)
		for (int i = 0; i <= n; i++) {
			double x = i * cell_mm - RELIEF_MM;
			double y = (mesh ? j : n - j) * cell_mm - RELIEF_MM;
			double z = relief_mm(kind, size, x * cos(turn) + y * sin(turn),
					     y * cos(turn) - x * sin(turn));

			if (mesh)
				fprintf(out, "v %.9f %.9f %.9f\n", x, y, z);
			else
				fprintf(out, "%.9f%c", z, i == n ? '\n' : ' ');
		}
	for (int j = 0; mesh && j < n; j++)
		for (int i = 1; i <= n; i++)
			fprintf(out, "f %d %d %d %d\n", (n + 1) * j + i,
				(n + 1) * j + i + 1, (n + 1) * (j + 1) + i + 1,
				(n + 1) * (j + 1) + i);
	fclose(out);
	add(&l->text, " kind = \"%s\"; file = \"shape.%s\";", mesh ? "mesh" : "heights",
	    mesh ? "obj" : "asc");
	l->top_mm[2] += relief_mm(kind, size, 0, 0);
	v3_copy(l->wide_mm, (const double[3]){MIDDLE_MM, MIDDLE_MM, 0});
	l->core_mm[2] -= 150;
	say(l, "%s-%s %.0f", mesh ? "mesh" : "heights", reliefs[kind], size);
}

static inline void add_box(struct leaned *l, uint64_t *seed)
{
	static const char faces[] =
		"f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\n"
		"f 2 4 8 6\n";
	double half_mm[3];
	char path[80];
	FILE *out;

	for (int i = 0; i < 3; i++)
		half_mm[i] = between(seed, 15, 50);
	shape_path(path, "obj");
	out = fopen(path, "w");
	for (int i = 0; i < 8; i++)
		fprintf(out, "v %.9f %.9f %.9f\n", i & 1 ? half_mm[0] : -half_mm[0],
			i & 2 ? half_mm[1] : -half_mm[1],
			i & 4 ? half_mm[2] : -half_mm[2]);
	fputs(faces, out);
	fclose(out);
	add(&l->text, " kind = \"mesh\"; file = \"shape.obj\";");
	l->top_mm[2] += half_mm[2];
	l->closed = true;
	l->deep_mm = fmin(half_mm[0], fmin(half_mm[1], half_mm[2])) / 2;
	v3_add(l->wide_mm, (const double[3]){0}, 0.5, half_mm);
	say(l, "mesh-box %.0f", half_mm[2]);
}

static inline void add_skin(struct leaned *l, uint64_t *seed)
{
	static const enum {
		PLANE,
		SPHERE,
		CAPSULE,
		MESH,
		HEIGHTS,
		BOX
	} kinds[] = {PLANE, SPHERE, SPHERE,  CAPSULE, MESH,
		     MESH,  MESH,   HEIGHTS, HEIGHTS, BOX};
	double radius_mm = sized(seed, 8, 150), at_mm[3] = {0}, ends_mm[2][3];
	int kind = (int)kinds[below(seed, 10)];

	v3_copy(l->up, (const double[3]){0, 0, 1});
	if (chance(seed, 0.5))
		any_vector(seed, 50, at_mm);
	l->deep_mm = 60;
	v3_copy(l->core_mm, at_mm);
	v3_copy(l->top_mm, at_mm);
	add(&l->text, "surface = {");
	switch (kind) {
	case PLANE:
		if (chance(seed, 0.5))
			any_vector(seed, 0.8, l->up);
		l->up[2] += 1;
		v3_unit(l->up, l->up, 0);
		add(&l->text, " kind = \"plane\";");
		add_vector(&l->text, "normal", l->up);
		add_vector(&l->text, "point_mm", at_mm);
		v3_add(l->core_mm, at_mm, -10, l->up);
		say(l, "plane");
		break;
	case SPHERE:
		add(&l->text, " kind = \"sphere\";");
		add_vector(&l->text, "centre_mm", at_mm);
		break;
	case CAPSULE:
		add(&l->text, " kind = \"capsule\";");
		v3_copy(ends_mm[0], at_mm);
		v3_copy(ends_mm[1], at_mm);
		ends_mm[0][0] -= 60;
		ends_mm[1][0] += 60;
		add_vector(&l->text, "from_mm", ends_mm[0]);
		add_vector(&l->text, "to_mm", ends_mm[1]);
		l->wide_mm[0] = 60;
		break;
	case BOX:
		add_box(l, seed);
		break;
	default:
		add_relief(l, seed, kind == MESH);
	}
	if (kind == SPHERE || kind == CAPSULE) {
		add_number(&l->text, "radius_mm", radius_mm);
		l->closed = true;
		l->deep_mm = radius_mm / 2;
		l->top_mm[2] += radius_mm;
		say(l, "%s R %.0f", kind == SPHERE ? "sphere" : "capsule", radius_mm);
	} else if (kind != PLANE) {
		l->faceted = true;
		add_vector(&l->text, "at_mm", at_mm);
	}
	add(&l->text, " };\n");
}

/* A tracker and a device, with a guess at the stiffness that they bear. */
static inline void add_device(struct leaned *l, uint64_t *seed)
{
	double late_s, rate_hz = sized(seed, 60, 1000),
		       latency_s = between(seed, 0, 0.02);
	static const double ticks_hz[] = {250, 1000, 1000, 1000, 1000, 4000};
	double hz = ticks_hz[below(seed, 6)];

	if (chance(seed, 0.3)) {
		rate_hz = 120;
		latency_s = 4.2e-3;
	}
	l->tracker = (struct incise_tracker_info){.name = "fed",
						  .rate_hz = rate_hz,
						  .latency_ns = llround(latency_s * 1e9),
						  .stations = 1};
	add(&l->text, "# a tracker of %.9g Hz, %.9g ms late\n", rate_hz, latency_s * 1e3);
	l->mass_kg = sized(seed, 0.02, 0.3);
	l->damping_N_s_mm = sized(seed, 0.002, 0.1);
	l->late_ticks = chance(seed, 0.6) ? 0 : 1 + below(seed, 5);
	late_s = latency_s + 1 / rate_hz + (1 + l->late_ticks) / hz;
	l->near_N_mm = 0.5 * l->damping_N_s_mm / late_s;
	add(&l->text, "rate_hz = %.1f;\ndevice = { coulomb_N = 0.0; late_ticks = %d;", hz,
	    l->late_ticks);
	add_number(&l->text, "mass_kg", l->mass_kg);
	add_number(&l->text, "damping_N_s_mm", l->damping_N_s_mm);
	add(&l->text, " };\nlimits = {");
	l->force_N = fmin(fmax(l->near_N_mm * sized(seed, 1, 12), 0.1), 30);
	add_number(&l->text, "force_N", l->force_N);
	add_number(&l->text, "slew_N_s", chance(seed, 0.6) ? 400 : sized(seed, 100, 1e5));
	add_number(&l->text, "pose_age_ms", 30 + 3e3 * (latency_s + 1 / rate_hz));
	add_number(&l->text, "ramp_ms", chance(seed, 0.5) ? 200 : sized(seed, 1, 300));
	add(&l->text, " };\n");
	say(l, ", %.2g kg %.2g N s/mm, %.0f Hz %.1f ms, tick %.0f Hz late %d", l->mass_kg,
	    l->damping_N_s_mm, rate_hz, latency_s * 1e3, hz, l->late_ticks);
}

/* One of the models, or the shipped one; they have about 0.1 N/mm. */
static inline void add_any_model(struct leaned *l, uint64_t *seed, bool fixed,
				 bool dissipates)
{
	int n = l->faceted && fixed ? KINDS_LEVEL : KINDS, cut = below(seed, n);

	if (chance(seed, 0.25)) {
		add(&l->text, "model = \"liver.fis\";\n");
		say(l, ", model liver");
	} else if (fixed || chance(seed, 0.6)) {
		add(&l->text, "model = \"k%d.%s\";\n", cut, fixed ? "fx" : "fis");
		say(l, ", model k%d of %d", cut, kinds[cut].n);
	} else {
		add(&l->text, "model = { cut = \"k%d.fis\"; puncture = \"k%d.fis\";", cut,
		    below(seed, n));
		if (dissipates && chance(seed, 0.6))
			add(&l->text, " withdraw = \"k%d.fis\";", below(seed, n));
		add(&l->text, " };\n");
		say(l, ", model k%d of phases", cut);
	}
}

/* A spring of about what the device bears, or none. */
static inline double any_spring(struct leaned *l, uint64_t *seed, double p, double gain,
				const char *name, const char *key)
{
	double K = chance(seed, p) ? l->near_N_mm * sized(seed, 0.1, 1.1) : 0;

	add_number(&l->text, key, fmin(K / gain, 999));
	if (K > 0)
		say(l, ", %s %.2g", name, K);
	return K;
}

static inline void add_forces(struct leaned *l, uint64_t *seed)
{
	bool model = chance(seed, 0.2), fixed = chance(seed, 0.25);
	bool dissipates = chance(seed, 0.75), inserts = !model || chance(seed, 0.3);
	double gain = model ? fmin(l->near_N_mm * sized(seed, 0.5, 8), 10)
			    : sized(seed, 0.3, 3);
	int average = chance(seed, 0.35) ? 1 : (int)sized(seed, 2, 64.99);
	struct text *to = &l->text;
	double normal[3], K;
	uint64_t own;

	add(to, "arithmetic = \"%s\";\neffects = { average_ticks = %d; };\n",
	    fixed ? "fixed" : "double", average);
	say(l, ", %s, average %d", fixed ? "fixed" : "double", average);
	l->model = model;
	if (model)
		add_any_model(l, seed, fixed, dissipates);
	add(to, "tissue = { withdrawal = \"%s\"; orientation = \"%s\";",
	    dissipates ? "dissipative" : "paper", chance(seed, 0.8) ? "eased" : "paper");
	add_number(to, "gain", gain);
	add_number(to, "leave_mm", chance(seed, 0.7) ? 0.2 : between(seed, 0, 2));
	if (model)
		say(l, " gain %.2g%s", gain, dissipates ? "" : " paper");
	else
		any_spring(l, seed, 0.8, gain, "reaction", "reaction_N_mm");
	any_spring(l, seed, 0.4, gain, "plane", "plane_N_mm");
	any_spring(l, seed, inserts ? 1 : 0, gain, "insertion", "insertion_N_mm");
	any_spring(l, seed, inserts ? 0.6 : 0, gain, "spread", "spread_N_mm");
	K = any_spring(l, seed, 0.3, gain, "skin", "skin_N_mm");
	if (K > 0)
		add_number(to, "skin_friction", sized(seed, 0.02, 1));
	/* It came later, and leaves the scenes else as they were. */
	own = ~*seed;
	K = any_spring(l, &own, 0.3, gain, "fracture", "fracture_N_mm");
	if (K > 0)
		add_number(to, "fracture_J_m2", 1e3 * K / gain * sized(&own, 0.02, 2));
	if (chance(seed, 0.4)) {
		K = l->damping_N_s_mm * sized(seed, 0.01, 0.5);
		add_number(to, "damping_N_s_mm", fmin(K / gain, 1));
		say(l, ", damper %.2g", K);
	}
	add(to, " };\n");
	l->membrane = chance(seed, 0.3);
	if (!l->membrane)
		return;
	add(to, "membrane = {");
	v3_add(l->membrane_mm, l->top_mm, -between(seed, 0.5, 6), l->up);
	any_vector(seed, 0.5, normal);
	v3_add(normal, normal, 1, l->up);
	v3_unit(normal, normal, 0);
	K = between(seed, 1, 6);
	add_vector(to, "point_mm", l->membrane_mm);
	add_vector(to, "normal", normal);
	add_number(to, "radius_mm", sized(seed, 3, 30));
	add_number(to, "thickness_mm", K);
	add_number(to, "back_wall_mm", K + between(seed, 1, 15));
	add_number(to, "puncture_N",
		   fmin(K * l->near_N_mm * sized(seed, 0.1, 1.1) / gain, 99));
	add(to, " };\n");
	say(l, ", membrane");
}

static inline void draw_leaned(uint64_t seed, struct leaned *l)
{
	memset(l, 0, sizeof(*l));
	add_skin(l, &seed);
	add_device(l, &seed);
	add_forces(l, &seed);
	add_tool(&seed, &l->text);
}

/* --- a hand ------------------------------------------------------------------------------- */

/* A tool that is moved: it goes towards a place above or below the skin, and turns. */
struct mover {
	double at_mm[3], to_mm[3], share;
	double tilt, turn, to_tilt, to_turn;
	int left; /* ticks until it goes elsewhere */
	int silent, unusable;
	double speed_mm_s[3], spin, turning;
};

struct hand {
	uint64_t seed;
	const struct drawn *d;
	struct incise_plan *const *plan; /* two */
	struct mover scalpel, tube;
	double tip_mm[3], axis[3], handle_mm;
	int64_t t_ns, next_ns, period_ns, pose_ns;
	bool fading;
	bool calm;  /* no jumps, no noise, no pose that is missing */
	bool quiet; /* it asks for nothing */
};

static inline void go_elsewhere(struct hand *h, struct mover *m, double deep)
{
	uint64_t *seed = &h->seed;
	const double *up = h->d->up;
	double height_mm =
		chance(seed, deep) ? between(seed, -8, 0.5) : between(seed, 0, 10);
	double turn = chance(seed, 0.6) ? 0 : chance(seed, 0.7) ? M_PI : M_PI / 2;

	any_vector(seed, 10, m->to_mm);
	v3_add(m->to_mm, m->to_mm, height_mm - v3_dot(m->to_mm, up), up);
	v3_add(m->to_mm, m->to_mm, 1, h->d->top_mm);
	m->share = 1 / sized(seed, 3, 60);
	m->left = 5 + below(seed, 80);
	if (h->calm)
		m->left = (int)(sized(seed, 0.05, 1) * 1e9 / (double)h->period_ns);
	if (!chance(seed, 0.3))
		return;
	m->to_tilt = turn + between(seed, -0.6, 0.6);
	m->to_turn += between(seed, -1.5, 1.5);
}

/* As a mass on a damped spring goes: at no more than 2 m/s² from 40 mm away. */
static inline void approach(double *at, double *speed, double to, double per_s,
			    double time_s)
{
	*speed += (per_s * per_s * (to - *at) - 2 * per_s * *speed) * time_s;
	*at += *speed * time_s;
}

static inline void move_calmly(const struct hand *h, struct mover *m)
{
	double time_s = (double)h->period_ns * 1e-9, per_s = 4 + 9 * m->share;

	for (int i = 0; i < 3; i++)
		approach(&m->at_mm[i], &m->speed_mm_s[i], m->to_mm[i], per_s, time_s);
	approach(&m->tilt, &m->spin, m->to_tilt, per_s, time_s);
	approach(&m->turn, &m->turning, m->to_turn, per_s, time_s);
}

static inline void move(struct hand *h, struct mover *m, double deep)
{
	if (m->left-- <= 0)
		go_elsewhere(h, m, deep);
	if (h->calm) {
		move_calmly(h, m);
		return;
	}
	for (int i = 0; i < 3; i++)
		m->at_mm[i] += m->share * (m->to_mm[i] - m->at_mm[i]);
	m->tilt += m->share * (m->to_tilt - m->tilt);
	m->turn += m->share * (m->to_turn - m->turn);
	m->silent -= m->silent > 0;
	m->unusable -= m->unusable > 0;
	if (chance(&h->seed, 0.004))
		m->silent = below(&h->seed, 120);
	if (chance(&h->seed, 0.004))
		m->unusable = below(&h->seed, 120);
}

/* The scalpel's tip, where its other end is at the skin if that is the lower one. */
static inline void place_tip(const struct hand *h, struct incise_tracker_sample *pose)
{
	double axis[3], arm_mm[3], down;

	v3_rotate(axis, pose->quaternion, h->axis);
	down = fmax(0, fmin(0.5 - 2 * v3_dot(axis, h->d->up), 1));
	v3_add(pose->position_mm, pose->position_mm, -down * h->handle_mm, axis);
	v3_rotate(arm_mm, pose->quaternion, h->tip_mm);
	v3_add(pose->position_mm, pose->position_mm, -1, arm_mm);
}

/* A pose that no tracker should send. */
static inline void spoil(uint64_t *seed, struct incise_tracker_sample *pose)
{
	static const double none[] = {NAN, INFINITY, -INFINITY, 1e300, -9999, 0};
	double *number = chance(seed, 0.5) ? &pose->position_mm[below(seed, 3)]
					   : &pose->quaternion[below(seed, 4)];

	switch (below(seed, 5)) {
	case 0:
		*number = none[below(seed, 6)];
		break;
	case 1:
		pose->t_ns += (int64_t)between(seed, -1e8, 1e8);
		break;
	case 2:
		pose->t_ns = chance(seed, 0.5) ? INT64_MAX : INT64_MIN;
		break;
	case 3:
		pose->station = (uint8_t)below(seed, 256);
		break;
	default:
		any_vector(seed, 40, pose->position_mm);
	}
}

static inline void feed(struct hand *h, const struct mover *m, uint8_t station)
{
	static const char flags[] = "xA~ymu";
	struct incise_tracker_sample pose = {.t_ns = h->t_ns, .station = station};

	if (m->silent)
		return;
	v3_copy(pose.position_mm, m->at_mm);
	for (int i = 0; i < 3 && !h->calm; i++)
		pose.position_mm[i] += between(&h->seed, -0.03, 0.03);
	fed_attitude(pose.quaternion, m->tilt, m->turn);
	if (m == &h->scalpel)
		place_tip(h, &pose);
	if (!h->calm && (m->unusable || chance(&h->seed, 0.01)))
		pose.status = flags[below(&h->seed, 6)];
	if (!h->calm && chance(&h->seed, 0.02))
		spoil(&h->seed, &pose);
	for (int k = 0; k < 2; k++)
		assert_int_equal(incise_plan_feed(h->plan[k], &pose, 1), 1);
}

/* What a program asks of both plans. */
static inline void ask(struct hand *h)
{
	int tool = below(&h->seed, INCISE_TOOL_TUBE + 1);
	bool tools = chance(&h->seed, 0.008), tips = !h->calm && chance(&h->seed, 0.002);
	bool fades = chance(&h->seed, h->fading ? 0.03 : 0.004);

	h->fading ^= fades;
	if (tips)
		any_vector(&h->seed, 15, h->tip_mm);
	for (int k = 0; k < 2; k++) {
		if (tools)
			incise_plan_set_tool(h->plan[k], (enum incise_tool)tool);
		if (fades)
			incise_plan_fade(h->plan[k], h->fading);
		if (tips)
			incise_plan_set_tip(h->plan[k], h->tip_mm);
	}
}

/* One tick's time, poses and wishes. */
static inline void step(struct hand *h)
{
	uint64_t *seed = &h->seed;

	move(h, &h->scalpel, 0.6);
	move(h, &h->tube, 0.3);
	h->t_ns += h->calm		 ? h->period_ns
		   : chance(seed, 0.01)	 ? 0
		   : chance(seed, 0.005) ? (int64_t)sized(seed, 1e6, 1e9)
					 : h->period_ns;
	for (int i = 0; h->next_ns <= h->t_ns && i < INCISE_PLAN_POSES / 2; i++) {
		feed(h, &h->scalpel, h->d->tracker.scalpel_station);
		if (h->d->tracker.tube_station)
			feed(h, &h->tube, h->d->tracker.tube_station);
		h->next_ns += h->pose_ns;
		if (h->next_ns < h->t_ns - h->pose_ns)
			h->next_ns = h->t_ns;
	}
	if (!h->quiet)
		ask(h);
}

static inline struct hand hand_of(uint64_t seed, const struct drawn *d,
				  const struct incise_scene *scene,
				  struct incise_plan *const plan[2])
{
	struct incise_scene_scalpel scalpel;
	struct hand h = {
		.seed = ~seed,
		.d = d,
		.plan = plan,
		.t_ns = 1000000000,
		.next_ns = 1000000000,
		.period_ns = (int64_t)(1e9 / incise_scene_rate_hz(scene)),
		.pose_ns = (int64_t)(1e9 * d->tracker.stations / d->tracker.rate_hz),
	};

	incise_scene_scalpel(scene, &scalpel);
	v3_copy(h.axis, scalpel.axis);
	h.handle_mm = scalpel.handle_mm;
	v3_add(h.scalpel.at_mm, d->top_mm, 5, d->up);
	v3_add(h.tube.at_mm, d->top_mm, 40, d->up);
	return h;
}

/* --- the folder --------------------------------------------------------------------------- */

/* As fed_folder_make(), but for its model, whose tables take long to compile. */
static inline int drawn_set_up(void **state)
{
	char path[80], liver[4096];

	strcpy(folder.dir, "/tmp/incise-drawn-XXXXXX");
	if (!mkdtemp(folder.dir))
		abort();
	snprintf(folder.scene, sizeof(folder.scene), "%s/a.scene", folder.dir);
	snprintf(folder.mesh, sizeof(folder.mesh), "%s/hill.obj", folder.dir);
	snprintf(folder.heights, sizeof(folder.heights), "%s/hill.asc", folder.dir);
	fed_write_mesh(folder.mesh);
	fed_write_heights(folder.heights);
	for (int i = 0; i < KINDS; i++)
		write_model(i);
	snprintf(path, sizeof(path), "%s/liver.fis", folder.dir);
	assert_non_null(realpath("scenes/liver.fis", liver));
	assert_int_equal(symlink(liver, path), 0);
	return 0;
}

static inline int drawn_tear_down(void **state)
{
	char path[80];

	for (int i = 0; i < KINDS; i++) {
		model_path(path, i, "fis");
		unlink(path);
		model_path(path, i, "fx");
		unlink(path);
	}
	shape_path(path, "obj");
	unlink(path);
	shape_path(path, "asc");
	unlink(path);
	snprintf(path, sizeof(path), "%s/liver.fis", folder.dir);
	unlink(path);
	fed_folder_remove(&folder);
	return 0;
}

#endif
