// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a scene file; see incise/scene.h for its form.
 */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include "../base/crc32c.h"
#include "../base/vector.h"
#include "../control/pose_loop.h"
#include "../model/texture.h"
#include "../tissue/incision.h"
#include "scene.h"

#define PARALLEL_COS 0.985     /* cos 10 degrees */
#define FILE_MOST (1ULL << 30) /* more than a mesh of 4 million triangles has */

/* --- the keys; incise-scene(5) gives the reasons of the defaults --------------------------- */

#define SETTINGS_OF struct incise_scene

static const char *const arithmetics[] = {"double", "fixed", NULL};
static const char *const withdrawals[] = {"paper", "dissipative", NULL};
static const char *const orientations[] = {"eased", "paper", NULL};
static const char *const skins[] = {"plain", "neck", "liver", NULL};

/* The forces of the tissue bring theirs; see incise_scene_tissue_settings(). */
static const struct incise_setting tissue[] = {
	SETTING_NUMBER(gain, tissue.gain, "", 0, 10, "1",
		       "factor of all tissue forces, including the model's"),
	SETTING_WORD(withdrawal, tissue.dissipates, withdrawals, "dissipative",
		     "dissipative or paper: force of a model when the blade withdraws"),
	SETTING_WORD(orientation, tissue.printed_orientation, orientations, "eased",
		     "eased or paper: effect of the handle's rotation"),
	/* With a tracker of ±0.05 mm of noise the shown poses have ±0.16 mm. */
	SETTING_NUMBER(leave_mm, tissue.leave_mm, "mm", 0, 5, "0.2",
		       "a contact begins at the surface and ends this far outside"),
	/* More than that: a blade that rests on the skin cuts nothing. */
	SETTING_NUMBER(cut_from_mm, tissue.cut_from_mm, "mm", 0, 50, "0.5",
		       "a blade deeper than this leaves a cut"),
	SETTING_NUMBER(stretch_mm, tissue.stretch_mm, "mm", 0, 50, "2",
		       "elastic width of a cut"),
	SETTING_WHOLE(cuts_most, tissue.cuts_most, "", 1, 1024, "64",
		      "largest number of straight cuts in an incision, 1.2 KiB each"),
	SETTING_NUMBER(variation, tissue.variation, "", 0, 1, "0",
		       "share of the texture's variation of the force from cut to cut"),
	SETTING_WHOLE(seed, tissue.seed, "", 0, INT32_MAX, "1",
		      "seed of texture and variation: the same cuts for the same seed"),
	{0},
};

static const struct incise_setting effects[] = {
	SETTING_WHOLE(average_ticks, effects.average_ticks, "", 1, 64, "1",
		      "number of ticks over which the normal is averaged"),
	{0},
};

static const struct incise_setting tool[] = {
	SETTING_DIRECTION(axis, tool.axis, "[0, 0, 1]",
			  "from the tip of the blade to the end of the handle"),
	SETTING_DIRECTION(side, tool.side, "[0, 1, 0]",
			  "normal of the flat side of blade and handle; at least 10 "
			  "degrees from the line of axis"),
	SETTING_NUMBER(handle_mm, tool.handle_mm, "mm", 1, 1000, "120",
		       "distance of the handle's end from the tip"),
	SETTING_NUMBER(handle_width_mm, tool.handle_width_mm, "mm", 1, 100, "10",
		       "width of the handle's flat end"),
	SETTING_NUMBER(handle_thickness_mm, tool.handle_thickness_mm, "mm", 0.1, 100, "3",
		       "thickness of the handle's flat end"),
	SETTING_NUMBER(tube_mm, tool.tube_mm, "mm", 0.5, 100, "7",
		       "diameter of the tube"),
	{0},
};

static const struct incise_setting membrane[] = {
	SETTING_VECTOR(point_mm, membrane.point_mm, "mm", SETTING_REQUIRED,
		       "its centre, below the surface"),
	SETTING_DIRECTION(normal, membrane.normal, "[0, 0, 1]", "out of the tissue"),
	SETTING_NUMBER(radius_mm, membrane.radius_mm, "mm", 0.1, 1000, SETTING_REQUIRED,
		       "its radius"),
	SETTING_NUMBER(puncture_N, membrane.puncture_N, "N", 0, 100, SETTING_REQUIRED,
		       "force at which it opens"),
	SETTING_NUMBER(thickness_mm, membrane.thickness_mm, "mm", 0.1, 100,
		       SETTING_REQUIRED,
		       "depression at which it opens; the force rises linearly up to "
		       "there"),
	SETTING_NUMBER(back_wall_mm, membrane.back_wall_mm, "mm", 0.1, 1000,
		       SETTING_REQUIRED,
		       "distance of the opposite wall of the airway; more than "
		       "thickness_mm"),
	{0},
};

static const struct incise_setting device[] = {
	SETTING_NUMBER(mass_kg, device.mass_kg, "kg", 0.001, 10, "0.05",
		       "mass that moves with the hand"),
	SETTING_NUMBER(damping_N_s_mm, device.damping_N_s_mm, "N s/mm", 0, 1, "0.01",
		       "viscous damping"),
	SETTING_NUMBER(coulomb_N, device.coulomb_N, "N", 0, 10, "0.01", "dry friction"),
	SETTING_NUMBER(encoder_mm, device.encoder_mm, "mm", 0, 1, "0",
		       "resolution of the position; 0: continuous"),
	SETTING_WHOLE(delay_ticks, device.delay_ticks, "", 0, 64, "(see below)",
		      "delay from a position to its force"),
	SETTING_WHOLE(late_ticks, device.late_ticks, "", 0, INCISE_POSE_LOOP_LATE_MAX,
		      "0", "delay of the actuator, in addition to the tracker's"),
	{0},
};

static const struct incise_setting limits[] = {
	SETTING_NUMBER(force_N, limits.force_N, "N", 0.01, 100, "4",
		       "largest commanded force"),
	SETTING_NUMBER(slew_N_s, limits.slew_N_s, "N/s", 1, 1e5, "400",
		       "largest rate of change of the force"),
	SETTING_NUMBER(pose_age_ms, limits.pose_age_ms, "ms", 1, 1000, "50",
		       "the force ramps to zero when the last pose is older"),
	SETTING_NUMBER(fade_ms, limits.fade_ms, "ms", 1, 1000, "20",
		       "duration of that ramp"),
	SETTING_NUMBER(start_N, limits.start_N, "N", 0, 100, "0.1",
		       "at the start there is no force until the tissue force is at most "
		       "this"),
	SETTING_NUMBER(ramp_ms, limits.ramp_ms, "ms", 1, 10000, "200",
		       "duration of the ramp from there to the full force"),
	{0},
};

static bool is_range(const double *ends, int n, const char *text)
{
	(void)n;
	(void)text;
	return ends[0] <= ends[1];
}

/* [least, largest] */
#define RANGE(row, key, most, help)                                \
	[row] = {#key,                                             \
		 SETTING_IS_NUMBER,                                \
		 "mm",                                             \
		 0,                                                \
		 most,                                             \
		 "(none)",                                         \
		 help,                                             \
		 offsetof(struct incise_scene, criteria[row].min), \
		 2 * sizeof(double),                               \
		 SETTING_STORES_DOUBLE,                            \
		 .fits = is_range,                                 \
		 .expected = "two numbers [least, largest] from 0 to " #most}
#define MOST(row, key, unit, most, help) \
	[row] = SETTING_NUMBER(key, criteria[row].max, unit, 0, most, "(none)", help)
#define SWITCH(row, key, help) \
	[row] = SETTING_TRUTH(key, criteria[row].max, "(none)", help)

static const struct incise_setting criteria[INCISE_CRITERIA + 1] = {
	RANGE(INCISE_CRITERION_CUT_LENGTH, cut_length_mm, 1000,
	      "[least, largest] length of the incision"),
	RANGE(INCISE_CRITERION_CUT_DEPTH, cut_depth_mm, 1000,
	      "[least, largest] of the incision's largest depth"),
	MOST(INCISE_CRITERION_OFF_TARGET, off_target_mm, "mm", 1000,
	     "largest distance of the incision from the axis of the membrane"),
	MOST(INCISE_CRITERION_INCISIONS, incisions_most, "", 1024,
	     "largest number of incisions"),
	SWITCH(INCISE_CRITERION_MEMBRANE, membrane,
	       "whether a tool must pass the membrane"),
	RANGE(INCISE_CRITERION_INSERTION, insertion_depth_mm, 1000,
	      "[least, largest] depth of the tube's end below the skin at the end"),
	SWITCH(INCISE_CRITERION_BACK_WALL, back_wall,
	       "whether the wall behind the airway must be touched; false: must not be "
	       "touched"),
	MOST(INCISE_CRITERION_FORCE, force_most_N, "N", 1000, "largest commanded force"),
	MOST(INCISE_CRITERION_TIME, time_most_s, "s", 86400,
	     "longest time from the first contact until the tube's end last advanced by "
	     "more than 0.5 mm, or without a tube until the last contact"),
	{0},
};

static bool is_side(const double *texture_px, int n, const char *text)
{
	int side = (int)*texture_px;

	(void)n;
	(void)text;
	return side >= 256 && side <= 4096 && !(side & (side - 1));
}

static const struct incise_setting picture[] = {
	SETTING_TRUTH(wound, picture.wound, "false", "cuts are drawn"),
	SETTING_TRUTH(bleeding, picture.bleeding, "false", "cuts bleed"),
	SETTING_WORD(skin, picture.skin, skins, "plain", "plain, neck or liver"),
	SETTING_TRUTH(larynx, picture.larynx, "false",
		      "a larynx shows below the skin, up to 5 mm high at the centre of "
		      "the texture"),
	SETTING_WHOLE(texture_px, picture.texture_px, "px", 256, 4096, "2048",
		      "side of the texture", .fits = is_side,
		      .expected = "256, 512, 1024, 2048 or 4096"),
	SETTING_DIRECTION(gravity, picture.gravity, "[0, 0, -1]",
			  "direction in which blood flows"),
	SETTING_NUMBER(blood_ul_s_mm2, picture.blood_ul_s_mm2, "µl/(s mm²)", 0, 100,
		       "0.05",
		       "flow of blood from a fresh cut, per mm of its length and mm of "
		       "its depth"),
	SETTING_NUMBER(viscosity_mPa_s, picture.viscosity_mPa_s, "mPa s", 0.5, 1000, "4",
		       "viscosity of blood"),
	SETTING_WHOLE(seed, picture.seed, "", 0, INT32_MAX, "1",
		      "seed of the random details of skin and blood"),
	{0},
};

static int read_tissue(void *to, const config_setting_t *group, const char *path,
		       struct incise_error *err);
static int read_surface(void *to, const config_setting_t *group, const char *path,
			struct incise_error *err);

const struct incise_setting incise_scene_settings[] = {
	SETTING_NUMBER(rate_hz, rate_hz, "Hz", 100, 20000, "1000", "ticks per second"),
	SETTING_OWN(model, "", "(none)",
		    "model of the reaction force, .fis or .fx; or a group of models, see "
		    "below"),
	SETTING_WORD(
		arithmetic, fixed, arithmetics, "fixed",
		"fixed or double: evaluate reaction and plane constraint in integers "
		"or in floating point"),
	SETTING_OWN(surface, "group", "(none)", "the tissue surface",
		    .read = read_surface),
	SETTING_OWN(tissue, "group", "(none)", "forces of the tissue",
		    .read = read_tissue),
	SETTING_GROUP(effects, effects, "what smooths the forces"),
	SETTING_GROUP(tool, tool, "the scalpel"),
	SETTING_GROUP(membrane, membrane, "a membrane that a tool passes"),
	SETTING_GROUP(device, device, "what a hand holds"),
	SETTING_GROUP(limits, limits, "limits of the force"),
	SETTING_GROUP(criteria, criteria, "what a session is assessed by"),
	SETTING_GROUP(picture, picture, "the image"),
	{0},
};

void incise_scene_tissue_settings(struct incise_setting rows[SETTING_ROWS_MAX + 1])
{
	int n = 0;

	memset(rows, 0, (SETTING_ROWS_MAX + 1) * sizeof(*rows));
	for (; tissue[n].key; n++)
		rows[n] = tissue[n];
	for (int i = 0; i < incise_n_tissue_forces; i++)
		for (int k = 0; k < INCISE_FORCE_NUMBERS; k++) {
			const struct incise_force_number *from =
				&incise_tissue_forces[i].number[k];

			if (from->key)
				rows[n++] = (struct incise_setting){
					from->key,
					SETTING_IS_NUMBER,
					from->unit,
					0,
					from->max,
					from->initial,
					from->help,
					offsetof(struct incise_scene, tissue.force) +
						sizeof(double) *
							(i * INCISE_FORCE_NUMBERS + k),
					sizeof(double)};
		}
}
_Static_assert(sizeof(tissue) / sizeof(*tissue) + INCISE_FORCES * INCISE_FORCE_NUMBERS <=
		       SETTING_ROWS_MAX,
	       "raise SETTING_ROWS_MAX");

static int read_tissue(void *to, const config_setting_t *group, const char *path,
		       struct incise_error *err)
{
	struct incise_setting rows[SETTING_ROWS_MAX + 1];

	incise_scene_tissue_settings(rows);
	return incise_settings_read(rows, group, path, to, err);
}

/* --- the surface --------------------------------------------------------------------------- */

/* A name in a scene is relative to the scene's folder. To be freed; NULL: no memory. */
static char *beside(const struct incise_scene *scene, const char *name)
{
	const char *slash = strrchr(scene->path, '/');
	char *path = NULL;

	if (*name == '/' || !slash)
		return strdup(name);
	if (asprintf(&path, "%.*s%s", (int)(slash - scene->path) + 1, scene->path, name) <
	    0)
		return NULL;
	return path;
}

static struct incise_surface *plane(const struct incise_scene_surface *n,
				    struct incise_error *err)
{
	return incise_surface_new_plane(n->point_mm, n->normal, err);
}

static struct incise_surface *sphere(const struct incise_scene_surface *n,
				     struct incise_error *err)
{
	return incise_surface_new_sphere(n->point_mm, n->radius_mm, err);
}

static struct incise_surface *capsule(const struct incise_scene_surface *n,
				      struct incise_error *err)
{
	return incise_surface_new_capsule(n->point_mm, n->to_mm, n->radius_mm, err);
}

static struct incise_surface *heights(const struct incise_scene_surface *n,
				      struct incise_error *err)
{
	return incise_surface_load_heights(n->file, n->point_mm, err);
}

static struct incise_surface *mesh(const struct incise_scene_surface *n,
				   struct incise_error *err)
{
	return incise_surface_load_mesh(n->file, n->point_mm, n->cavity, err);
}

#undef SETTINGS_OF
#define SETTINGS_OF struct incise_scene_surface
#define KIND SETTING_OWN(kind, "", "plane", "plane, sphere, capsule, heights or mesh")
#define AT SETTING_VECTOR(at_mm, point_mm, "mm", "[0, 0, 0]", "position of its origin")
#define RADIUS(help) \
	SETTING_NUMBER(radius_mm, radius_mm, "mm", 0.1, 1e5, SETTING_REQUIRED, help)

static const struct incise_setting plane_settings[] = {
	KIND,
	SETTING_VECTOR(point_mm, point_mm, "mm", "[0, 0, 0]", "a point of the plane"),
	SETTING_DIRECTION(normal, normal, "[0, 0, 1]", "out of the tissue"),
	{0},
};

static const struct incise_setting sphere_settings[] = {
	KIND,
	SETTING_VECTOR(centre_mm, point_mm, "mm", SETTING_REQUIRED, "its centre"),
	RADIUS("its radius"),
	{0},
};

static const struct incise_setting capsule_settings[] = {
	KIND,
	SETTING_VECTOR(from_mm, point_mm, "mm", SETTING_REQUIRED, "one end of the axis"),
	SETTING_VECTOR(to_mm, to_mm, "mm", SETTING_REQUIRED, "the other end"),
	RADIUS("distance of the surface from the axis"),
	{0},
};

static const struct incise_setting heights_settings[] = {
	KIND,
	SETTING_TEXT(file, file, SETTING_REQUIRED, "ESRI ASCII grid of heights along z"),
	AT,
	{0},
};

static const struct incise_setting mesh_settings[] = {
	KIND,
	SETTING_TEXT(file, file, SETTING_REQUIRED,
		     "Wavefront OBJ, or STL (text or binary), with faces "
		     "counter-clockwise seen from outside, at most 4 million triangles"),
	AT,
	SETTING_TRUTH(cavity, cavity, "false",
		      "the tissue may lie around closed parts of it; else one that is "
		      "turned inside out is rejected"),
	{0},
};

static const struct kind {
	const char *name;
	const struct incise_setting *settings;
	struct incise_surface *(*make)(const struct incise_scene_surface *named,
				       struct incise_error *err);
} kinds[] = {
	{"plane", plane_settings, plane},	{"sphere", sphere_settings, sphere},
	{"capsule", capsule_settings, capsule}, {"heights", heights_settings, heights},
	{"mesh", mesh_settings, mesh},
};

#define KINDS (sizeof(kinds) / sizeof(*kinds))

static const struct kind *kind_of(const char *name)
{
	for (size_t i = 0; i < KINDS; i++)
		if (!strcmp(kinds[i].name, name))
			return &kinds[i];
	return NULL;
}

const struct incise_setting *incise_scene_surface_settings(const char *kind)
{
	return kind_of(kind)->settings;
}

static int read_surface(void *to, const config_setting_t *group, const char *path,
			struct incise_error *err)
{
	struct incise_scene *scene = to;
	struct incise_scene_surface *named = &scene->named;
	const char *name = "plane";
	struct incise_error why = {0};
	const struct kind *kind;
	int rc;

	if (config_setting_get_member(group, "kind") &&
	    !config_setting_lookup_string(group, "kind", &name))
		name = "";
	kind = kind_of(name);
	if (!kind)
		return incise_conf_error(group, "kind", path, err,
					 "\"plane\", \"sphere\", \"capsule\", "
					 "\"heights\" or \"mesh\"");
	incise_settings_init(kind->settings, named);
	rc = incise_settings_read(kind->settings, group, path, named, err);
	if (rc)
		return rc;
	if (named->file) {
		scene->surface_path = beside(scene, named->file);
		if (!scene->surface_path)
			return incise_error_set(err, ENOMEM, "%s: no memory", path);
		named->file = scene->surface_path;
	}
	scene->surface = kind->make(named, &why);
	scene->surface_kind = kind->name;
	if (!scene->surface)
		return incise_error_set(err, why.code, "%s:%d: its surface: %s", path,
					incise_conf_line(group), why.text);
	return 0;
}

/* --- the model ----------------------------------------------------------------------------- */

static bool ends_with(const char *text, const char *end)
{
	size_t n = strlen(text), m = strlen(end);

	return n >= m && !strcmp(text + n - m, end);
}

static const char *input_name(const struct incise_scene_model *cut, int i)
{
	return cut->model ? incise_model_info(cut->model)->input[i].name
			  : cut->compiled->input[i].name;
}

static int refuse_input(const struct incise_scene *scene, const char *name,
			struct incise_error *err)
{
	const char *names[INCISE_MODEL_INPUT_KINDS + 1] = {NULL}, *nearest;
	char all[INCISE_MODEL_INPUT_KINDS * 24] = "";

	for (int k = 0; k < INCISE_MODEL_INPUT_KINDS; k++) {
		names[k] = incise_model_input_kinds[k].name;
		strcat(strcat(all, k ? ", " : ""), names[k]);
	}
	nearest = incise_nearest_name(name, names);
	return incise_error_set(
		err, EINVAL,
		"%.200s: its model has the input '%.64s', which a loop does not have%s%s: "
		"expected some of %s; train with --inputs of these",
		scene->path, name, nearest ? "; did you mean " : "",
		nearest ? nearest : "", all);
}

/* The origin of each input, by its name. */
static int find_inputs(const struct incise_scene *scene, struct incise_scene_model *cut,
		       struct incise_error *err)
{
	int n = cut->model ? incise_model_info(cut->model)->n_inputs
			   : cut->compiled->n_inputs;
	unsigned int found = 0;

	for (int i = 0; i < n && i < INCISE_LOOP_INPUTS_MAX; i++) {
		int kind = incise_model_input_find(input_name(cut, i));

		if (kind < 0)
			return refuse_input(scene, input_name(cut, i), err);
		if (found >> kind & 1)
			return incise_error_set(
				err, EINVAL,
				"%.200s: its model has the input %s twice; train it "
				"again",
				scene->path, incise_model_input_kinds[kind].name);
		found |= 1U << kind;
		cut->input[i] = (enum incise_model_input)kind;
	}
	if (n > INCISE_LOOP_INPUTS_MAX)
		return incise_error_set(err, EINVAL,
					"%.200s: its model has %d inputs, but a loop has "
					"at most %d; train with fewer --inputs",
					scene->path, n, INCISE_LOOP_INPUTS_MAX);
	if (!(found >> INCISE_INPUT_DEPTH & 1))
		return incise_error_set(
			err, EINVAL,
			"%.200s: its model has no input depth_mm, from "
			"which its stiffness is known; add it to --inputs "
			"of incise train",
			scene->path);
	cut->n_inputs = n;
	return 0;
}

static int load_model(const struct incise_scene *scene, struct incise_scene_model *cut,
		      char *path, struct incise_error *err)
{
	struct incise_error why = {0};

	cut->path = path;
	if (!path)
		return incise_error_set(err, ENOMEM, "%s: no memory", scene->path);
	if (ends_with(path, ".fx"))
		cut->compiled = incise_fixed_load(path, &why);
	else
		cut->model = incise_model_load(path, &why);
	if (!cut->model && !cut->compiled)
		return incise_error_set(
			err, why.code, "%s: its model %s%s", scene->path, why.text,
			why.code == ENOENT
				? "; a scene's files are looked for in the folder "
				  "of the scene"
				: "");
	return find_inputs(scene, cut, err);
}

static const struct incise_setting model_settings[] = {
	SETTING_OWN(cut, "", "(required)", "model of a blade that cuts"),
	SETTING_OWN(puncture, "", "(none)", "of one that opens the skin"),
	SETTING_OWN(withdraw, "", "(none)", "of one that is drawn out"),
	SETTING_OWN(texture, "", "(none)", "texture of the cut, .tex"),
	{0},
};

/* In the order of enum incise_cutting_phase, and the texture. */
static const char *const cutting_phases[] = {"cut", "puncture", "withdraw", "texture",
					     NULL};

/* Keep the tables that ticks read along the way of a front. */
static int read_texture(struct incise_scene *scene, const config_setting_t *group,
			struct incise_error *err)
{
	struct incise_texture *texture;
	struct incise_error why = {0};
	const char *name = NULL;
	int rc = 0;

	if (!config_setting_get_member(group, "texture"))
		return 0;
	if (!config_setting_lookup_string(group, "texture", &name) || !*name)
		return incise_conf_error(group, "texture", scene->path, err,
					 "a .tex file in quotes");
	if (!scene->tissue.dissipates)
		return incise_conf_error(
			group, "texture", scene->path, err,
			"no texture with tissue.withdrawal \"paper\", by which a blade "
			"that comes out would get back the work of a fall");
	scene->texture_path = beside(scene, name);
	scene->texture = calloc(1, sizeof(*scene->texture));
	if (!scene->texture_path || !scene->texture)
		return incise_error_set(err, ENOMEM, "%s: no memory", scene->path);
	texture = incise_texture_load(scene->texture_path, scene->cut[INCISE_CUT].model,
				      &why);
	if (!texture)
		return incise_error_set(err, why.code, "%s: its texture %s", scene->path,
					why.text);
	scene->learned = *incise_texture_info(texture);
	incise_texture_fill(texture, scene->tissue.variation,
			    (uint64_t)scene->tissue.seed, scene->texture);
	if (strcmp(scene->learned.unit, "mm"))
		rc = incise_error_set(err, EINVAL,
				      "%s: its texture %s is over a way in %.20s; name "
				      "one over mm",
				      scene->path, scene->texture_path,
				      scene->learned.unit);
	incise_texture_free(texture);
	return rc;
}

static int read_phases(struct incise_scene *scene, const config_setting_t *group,
		       struct incise_error *err)
{
	int rc = incise_conf_known(group, scene->path, cutting_phases, err);

	for (int i = 0; i < INCISE_CUTTING_PHASES && !rc; i++) {
		const char *name = NULL;

		if (config_setting_lookup_string(group, cutting_phases[i], &name))
			rc = load_model(scene, &scene->cut[i], beside(scene, name), err);
		else if (config_setting_get_member(group, cutting_phases[i]))
			rc = incise_conf_error(group, cutting_phases[i], scene->path, err,
					       "text in quotes");
		else if (i == INCISE_CUT)
			rc = incise_conf_missing(group, scene->path, "cut", err);
	}
	if (!rc && scene->cut[INCISE_WITHDRAW].path && !scene->tissue.dissipates)
		rc = incise_conf_error(
			group, "withdraw", scene->path, err,
			"no model with tissue.withdrawal \"paper\", by which "
			"a blade comes out with the force of its cut");
	return rc ? rc : read_texture(scene, group, err);
}

static int read_model(struct incise_scene *scene, const config_setting_t *root,
		      const char *override, struct incise_error *err)
{
	const config_setting_t *setting = config_setting_get_member(root, "model");
	const char *name = NULL;

	int rc = 0;

	if (override && setting && config_setting_is_group(setting) &&
	    config_setting_get_member(setting, "texture"))
		scene->texture_left_out = "its texture is of the scene's own model";
	if (override)
		return load_model(scene, &scene->cut[INCISE_CUT], strdup(override), err);
	if (setting && config_setting_is_group(setting))
		rc = read_phases(scene, setting, err);
	else if (setting && !(name = config_setting_get_string(setting)))
		rc = incise_conf_error(setting, NULL, scene->path, err,
				       "text in quotes, or a group { cut = …; }");
	else if (setting)
		rc = load_model(scene, &scene->cut[INCISE_CUT], beside(scene, name), err);
	if (!rc && scene->tissue.variation > 0 && !(scene->learned.variation > 0))
		rc = incise_conf_error(config_setting_get_member(root, "tissue"),
				       "variation", scene->path, err,
				       "0 without a model.texture that has one; incise "
				       "train --texture learns it from several cuts");
	return rc;
}

/* --- relations between keys --------------------------------------------------------- */

static int check_membrane(const struct incise_scene *scene, const config_setting_t *root,
			  struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, "membrane");

	if (!group || scene->membrane.back_wall_mm > scene->membrane.thickness_mm)
		return 0;
	return incise_conf_error(group, "back_wall_mm", scene->path, err,
				 "more than thickness_mm, %g, so that the back wall is "
				 "behind the membrane",
				 scene->membrane.thickness_mm);
}

const char *incise_criterion_name(int criterion)
{
	return criterion >= 0 && criterion < INCISE_CRITERIA ? criteria[criterion].key
							     : NULL;
}

static void finish_criteria(struct incise_scene *scene, const config_setting_t *root)
{
	const config_setting_t *group = config_setting_get_member(root, "criteria");

	for (int i = 0; i < INCISE_CRITERIA; i++) {
		struct incise_scene_criterion *to = &scene->criteria[i];

		to->asked = group && config_setting_get_member(group, criteria[i].key);
		if (criteria[i].kind == SETTING_IS_TRUTH)
			to->min = to->max;
	}
}

/* One reaction, and any force at all. */
static int check_forces(const struct incise_scene *scene, struct incise_error *err)
{
	bool model = scene->cut[INCISE_CUT].path, any = model;

	for (int i = 0; i < incise_n_tissue_forces; i++) {
		/* A share of the other forces is no force alone. */
		bool there =
			scene->tissue.force[i][0] > 0 && !incise_tissue_forces[i].acts;

		any |= there;
		if (there && model && i == INCISE_FORCE_REACTION)
			return incise_error_set(
				err, EINVAL,
				"%s: a model and tissue.%s: a scene has only one "
				"reaction; remove one of them",
				scene->path, incise_tissue_forces[i].number[0].key);
	}
	if (any)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%s: no force: expected model = \"FILE.fis\" or tissue = { "
		"reaction_N_mm = K; }, or give --model",
		scene->path);
}

/* The blade lies along the axis: the normal of its side is across. */
static int check_tool(const struct incise_scene *scene, const config_setting_t *root,
		      struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, "tool");

	if (fabs(v3_dot(scene->tool.axis, scene->tool.side)) < PARALLEL_COS)
		return 0;
	return incise_conf_error(
		group, config_setting_get_member(group, "axis") ? "axis" : "side",
		scene->path, err,
		"axis and side more than 10 degrees from one line, as side is the normal "
		"of the blade, across axis");
}

static int read_scene(struct incise_scene *scene, const config_setting_t *root,
		      const char *model, struct incise_error *err)
{
	int rc = incise_settings_read(incise_scene_settings, root, scene->path, scene,
				      err);

	if (!rc)
		rc = check_membrane(scene, root, err);
	if (!rc)
		rc = check_tool(scene, root, err);
	if (rc)
		return rc;
	finish_criteria(scene, root);
	rc = read_model(scene, root, model, err);
	scene->named.file = scene->surface_path;
	return rc ? rc : check_forces(scene, err);
}

struct incise_scene *incise_scene_load(const char *path, const char *model,
				       struct incise_error *err)
{
	struct incise_scene *scene = calloc(1, sizeof(*scene));
	struct incise_setting rows[SETTING_ROWS_MAX + 1];
	config_t config;
	int rc = -ENOMEM;

	if (scene)
		scene->path = strdup(path);
	if (!scene || !scene->path) {
		incise_error_set(err, ENOMEM, "%s: no memory to read it", path);
		goto out;
	}
	incise_scene_tissue_settings(rows);
	incise_settings_init(rows, scene);
	incise_settings_init(incise_scene_settings, scene);
	scene->device.delay_ticks = -1;
	rc = incise_conf_read(&config, path, err);
	if (rc)
		goto out;
	rc = read_scene(scene, config_root_setting(&config), model, err);
	config_destroy(&config);
out:
	if (rc) {
		incise_scene_free(scene);
		errno = -rc;
		return NULL;
	}
	return scene;
}

int incise_scene_set_arithmetic(struct incise_scene *scene, const char *name,
				struct incise_error *err)
{
	return incise_settings_set(incise_scene_settings, scene->path, "arithmetic", name,
				   scene, err);
}

void incise_scene_set_full(struct incise_scene *scene, bool full)
{
	scene->full = full;
}

void incise_scene_leave_texture_out(struct incise_scene *scene)
{
	if (scene->texture)
		scene->texture_left_out = "its texture is left out";
	free(scene->texture);
	free(scene->texture_path);
	scene->texture = NULL;
	scene->texture_path = NULL;
}

const char *incise_scene_texture_left_out(const struct incise_scene *scene)
{
	return scene->texture_left_out;
}

void incise_scene_free(struct incise_scene *scene)
{
	if (!scene)
		return;
	for (int i = 0; i < INCISE_CUTTING_PHASES; i++) {
		incise_model_free(scene->cut[i].model);
		incise_fixed_free(scene->cut[i].compiled);
		free(scene->cut[i].path);
	}
	incise_scene_leave_texture_out(scene);
	incise_surface_free(scene->surface);
	free(scene->path);
	free(scene->surface_path);
	free(scene);
}

const char *incise_scene_file(const struct incise_scene *scene, int i)
{
	const char *files[] = {scene->path,
			       scene->cut[INCISE_CUT].path,
			       scene->cut[INCISE_PUNCTURE].path,
			       scene->cut[INCISE_WITHDRAW].path,
			       scene->texture_path,
			       scene->surface_path};
	const int n = sizeof(files) / sizeof(*files);

	for (int k = 0; k < n; k++)
		if (files[k] && !i--)
			return files[k];
	return NULL;
}

double incise_scene_handle_mm(const struct incise_scene *scene)
{
	return scene->tool.handle_mm;
}

void incise_scene_limits(const struct incise_scene *scene,
			 struct incise_scene_limits *limits)
{
	*limits = scene->limits;
}

void incise_scene_scalpel(const struct incise_scene *scene,
			  struct incise_scene_scalpel *scalpel)
{
	v3_copy(scalpel->axis, scene->tool.axis);
	v3_copy(scalpel->side, scene->tool.side);
	scalpel->handle_mm = scene->tool.handle_mm;
	scalpel->handle_width_mm = scene->tool.handle_width_mm;
	scalpel->handle_thickness_mm = scene->tool.handle_thickness_mm;
	scalpel->tube_mm = scene->tool.tube_mm;
}

bool incise_scene_membrane(const struct incise_scene *scene,
			   struct incise_scene_membrane *membrane)
{
	*membrane = scene->membrane;
	return membrane->thickness_mm > 0;
}

void incise_scene_criteria(const struct incise_scene *scene,
			   struct incise_scene_criterion to[INCISE_CRITERIA])
{
	memcpy(to, scene->criteria, sizeof(scene->criteria));
}

int incise_scene_checksum(const struct incise_scene *scene, uint32_t *crc32c,
			  struct incise_error *err)
{
	static const struct incise_infile_kind kind = {.name = "a file of a scene",
						       .size_max = FILE_MOST};
	uint32_t crc = 0;
	const char *path;

	for (int i = 0; (path = incise_scene_file(scene, i)); i++) {
		size_t n;
		char *bytes = incise_infile_read(path, &kind, &n, err);

		if (!bytes)
			return -errno;
		crc = incise_crc32c(crc, bytes, n);
		free(bytes);
	}
	*crc32c = crc;
	return 0;
}

struct incise_double_incision_setup incise_scene_cuts(const struct incise_scene *scene)
{
	return (struct incise_double_incision_setup){
		.cuts_most = scene->tissue.cuts_most,
		.cut_from = scene->tissue.cut_from_mm,
		.stretch = scene->tissue.stretch_mm,
		.handle_width = scene->tool.handle_width_mm,
		.handle_thickness = scene->tool.handle_thickness_mm,
		.tube = scene->tool.tube_mm,
	};
}

struct incise_incision *incise_incision_new(const struct incise_scene *scene,
					    struct incise_error *err)
{
	const struct incise_double_incision_setup setup = incise_scene_cuts(scene);

	return incise_incision_make(&setup, scene->tool.side, err);
}

double incise_scene_rate_hz(const struct incise_scene *scene)
{
	return scene->rate_hz;
}

void incise_scene_picture(const struct incise_scene *scene,
			  struct incise_scene_picture *picture)
{
	*picture = scene->picture;
}

int incise_scene_set_texture(struct incise_scene *scene, int texture_px)
{
	if (!is_side(&(double){texture_px}, 1, NULL))
		return -EINVAL;
	scene->picture.texture_px = texture_px;
	return 0;
}

bool incise_scene_has_key(const char *key)
{
	return incise_setting_of(incise_scene_settings, key);
}

/* A group; membrane and criteria are not there by default. */
static void list_group(struct incise_settings_list *list,
		       const struct incise_scene *scene, const struct incise_setting *row,
		       const config_setting_t *group)
{
	struct incise_setting tissue_rows[SETTING_ROWS_MAX + 1];
	const struct incise_setting *rows = row->rows;
	struct incise_scene shown = *scene;
	const void *of = &shown;

	incise_scene_tissue_settings(tissue_rows);
	for (int i = 0; i < INCISE_CRITERIA; i++)
		if (!scene->criteria[i].asked)
			shown.criteria[i].min = shown.criteria[i].max = NAN;
	if (!strcmp(row->key, "tissue"))
		rows = tissue_rows;
	if (!strcmp(row->key, "model"))
		rows = model_settings;
	if (!strcmp(row->key, "surface") && scene->surface_kind) {
		rows = incise_scene_surface_settings(scene->surface_kind);
		of = &scene->named;
	}
	if (rows && (group || (rows != membrane && rows != criteria)))
		incise_settings_list(list, rows, of, group, row->key);
}

int incise_scene_keys(const char *path, incise_key_found *found, void *context,
		      struct incise_error *err)
{
	struct incise_settings_list list = {.found = found, .context = context};
	struct incise_scene *scene = incise_scene_load(path, NULL, err);
	const config_setting_t *root, *setting;
	config_t config;
	int rc;

	if (!scene)
		return -errno;
	rc = incise_conf_read(&config, path, err);
	if (rc) {
		incise_scene_free(scene);
		return rc;
	}
	root = config_root_setting(&config);
	for (const struct incise_setting *row = incise_scene_settings; row->key; row++) {
		setting = config_setting_get_member(root, row->key);
		if (row->kind == SETTING_IS_GROUP || row->read ||
		    (setting && config_setting_is_group(setting)))
			list_group(&list, scene, row, setting);
		else
			incise_settings_list(&list, (struct incise_setting[]){*row, {0}},
					     scene, root, "");
	}
	config_destroy(&config);
	incise_scene_free(scene);
	return list.rc;
}
