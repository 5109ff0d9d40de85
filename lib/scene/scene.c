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
#include "../base/conf.h"
#include "../base/crc32c.h"
#include "../base/vector.h"
#include "../control/pose_loop.h"
#include "../tissue/incision.h"
#include "scene.h"

#define PARALLEL_COS 0.985     /* cos 10 degrees */
#define FILE_MOST (1ULL << 30) /* more than a mesh of 4 million triangles has */
/* Of the largest group, tissue: seven keys and the numbers of all forces. */
#define KEYS_MAX (7 + INCISE_FORCES_MAX * INCISE_FORCE_NUMBERS)

/* A number of a group. */
struct number {
	const char *key;
	double min, max;
	size_t offset; /* into struct incise_scene */
};

/* The keys of a group: both lists end with an empty item. */
#define FITS_KEYS(numbers, more)                                             \
	_Static_assert(sizeof(numbers) / sizeof(*(numbers)) +                \
				       sizeof(more) / sizeof(*(more)) - 2 <= \
			       KEYS_MAX,                                     \
		       "raise KEYS_MAX")

#define NUMBER(group, name, min, max)                                      \
	{                                                                  \
#name, min, max, offsetof(struct incise_scene, group.name) \
	}

static const struct number tool[] = {
	NUMBER(tool, handle_mm, 1, 1000),
	NUMBER(tool, handle_width_mm, 1, 100),
	NUMBER(tool, handle_thickness_mm, 0.1, 100),
	NUMBER(tool, tube_mm, 0.5, 100),
	{0},
};

static const struct number device[] = {
	NUMBER(device, mass_kg, 0.001, 10),
	NUMBER(device, damping_N_s_mm, 0, 1),
	NUMBER(device, coulomb_N, 0, 10),
	NUMBER(device, encoder_mm, 0, 1),
	{0},
};

static const struct number membrane[] = {
	NUMBER(membrane, radius_mm, 0.1, 1000),
	NUMBER(membrane, thickness_mm, 0.1, 100),
	NUMBER(membrane, puncture_N, 0, 100),
	NUMBER(membrane, back_wall_mm, 0.1, 1000),
	{0},
};

static const struct number limits[] = {
	NUMBER(limits, force_N, 0.01, 100),
	NUMBER(limits, slew_N_s, 1, 1e5),
	NUMBER(limits, pose_age_ms, 1, 1000),
	NUMBER(limits, fade_ms, 1, 1000),
	NUMBER(limits, ramp_ms, 1, 10000),
	NUMBER(limits, start_N, 0, 100),
	{0},
};
_Static_assert(sizeof(limits) / sizeof(*limits) - 1 <= KEYS_MAX, "raise KEYS_MAX");

/*
 * Read the numbers of a group, if it is there. Its keys are these and the ones of @more, a
 * list that ends with NULL. Returns the group by *found.
 */
static int read_group(struct incise_scene *scene, const config_setting_t *root,
		      const char *name, const struct number *numbers,
		      const char *const *more, const config_setting_t **found,
		      struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, name);
	const char *keys[KEYS_MAX + 1];
	int n = 0, rc;

	*found = group;
	if (!group)
		return 0;
	for (const struct number *number = numbers; number && number->key; number++)
		keys[n++] = number->key;
	for (; more && *more; more++)
		keys[n++] = *more;
	keys[n] = NULL;
	rc = incise_conf_known(group, scene->path, keys, err);
	for (const struct number *number = numbers; number && number->key && !rc;
	     number++)
		rc = incise_conf_number(group, scene->path, number->key, number->min,
					number->max,
					(double *)((char *)scene + number->offset), err);
	return rc;
}

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

/* A surface as the file has it. */
struct named {
	double point_mm[3], to_mm[3], normal[3], radius_mm;
	const char *file;
	bool cavity;
};

static struct incise_surface *plane(const struct named *n, struct incise_error *err)
{
	return incise_surface_new_plane(n->point_mm, n->normal, err);
}

static struct incise_surface *sphere(const struct named *n, struct incise_error *err)
{
	return incise_surface_new_sphere(n->point_mm, n->radius_mm, err);
}

static struct incise_surface *capsule(const struct named *n, struct incise_error *err)
{
	return incise_surface_new_capsule(n->point_mm, n->to_mm, n->radius_mm, err);
}

static struct incise_surface *heights(const struct named *n, struct incise_error *err)
{
	return incise_surface_load_heights(n->file, n->point_mm, err);
}

static struct incise_surface *mesh(const struct named *n, struct incise_error *err)
{
	return incise_surface_load_mesh(n->file, n->point_mm, n->cavity, err);
}

/* The keys of each kind; those without an @optional mark must be there. */
static const struct kind {
	const char *name;
	const char *point; /* the key of its point */
	bool optional;	   /* the point is */
	const char *keys[5];
	struct incise_surface *(*make)(const struct named *named,
				       struct incise_error *err);
} kinds[] = {
	{"plane", "point_mm", true, {"kind", "point_mm", "normal"}, plane},
	{"sphere", "centre_mm", false, {"kind", "centre_mm", "radius_mm"}, sphere},
	{"capsule", "from_mm", false, {"kind", "from_mm", "to_mm", "radius_mm"}, capsule},
	{"heights", "at_mm", true, {"kind", "file", "at_mm"}, heights},
	{"mesh", "at_mm", true, {"kind", "file", "at_mm", "cavity"}, mesh},
};
#define KINDS (sizeof(kinds) / sizeof(*kinds))

static const struct kind *kind_of(const char *name)
{
	for (size_t i = 0; i < KINDS; i++)
		if (!strcmp(kinds[i].name, name))
			return &kinds[i];
	return NULL;
}

static bool has(const struct kind *kind, const char *key)
{
	for (int i = 0; kind->keys[i]; i++)
		if (!strcmp(kind->keys[i], key))
			return true;
	return false;
}

static int read_named(struct named *named, const struct kind *kind,
		      const config_setting_t *group, const char *path,
		      struct incise_error *err)
{
	int rc = incise_conf_known(group, path, kind->keys, err);

	if (!rc && !kind->optional)
		rc = incise_conf_need(group, path, kind->point, err);
	if (!rc)
		rc = incise_conf_vector(group, path, kind->point, named->point_mm, err);
	if (!rc && has(kind, "normal"))
		rc = incise_conf_direction(group, path, "normal", named->normal, err);
	if (!rc && has(kind, "to_mm"))
		rc = incise_conf_need(group, path, "to_mm", err);
	if (!rc && has(kind, "to_mm"))
		rc = incise_conf_vector(group, path, "to_mm", named->to_mm, err);
	if (!rc && has(kind, "radius_mm"))
		rc = incise_conf_need(group, path, "radius_mm", err);
	if (!rc && has(kind, "radius_mm"))
		rc = incise_conf_number(group, path, "radius_mm", 0.1, 1e5,
					&named->radius_mm, err);
	if (!rc && has(kind, "file"))
		rc = incise_conf_need(group, path, "file", err);
	if (!rc && has(kind, "file"))
		rc = incise_conf_string(group, path, "file", &named->file, err);
	if (!rc && has(kind, "cavity"))
		rc = incise_conf_bool(group, path, "cavity", &named->cavity, err);
	return rc;
}

static int read_surface(struct incise_scene *scene, const config_setting_t *root,
			struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, "surface");
	struct named named = {.normal = {0, 0, 1}};
	struct incise_error why = {0};
	const char *name = "plane";
	const struct kind *kind;
	int rc;

	if (!group)
		return 0;
	if (!config_setting_is_group(group))
		return incise_error_set(err, EINVAL,
					"%s:%d: surface: expected a group "
					"{ kind = \"plane\"; … }; correct it",
					scene->path, config_setting_source_line(group));
	rc = incise_conf_string(group, scene->path, "kind", &name, err);
	if (rc)
		return rc;
	kind = kind_of(name);
	if (!kind)
		return incise_error_set(err, EINVAL,
					"%s:%d: surface.kind: expected \"plane\", "
					"\"sphere\", \"capsule\", \"heights\" or "
					"\"mesh\", found \"%.40s\"; correct it",
					scene->path,
					config_setting_source_line(
						config_setting_get_member(group, "kind")),
					name);
	rc = read_named(&named, kind, group, scene->path, err);
	if (rc)
		return rc;
	if (named.file) {
		scene->surface_path = beside(scene, named.file);
		if (!scene->surface_path)
			return incise_error_set(err, ENOMEM, "%s: no memory",
						scene->path);
		named.file = scene->surface_path;
	}
	scene->surface = kind->make(&named, &why);
	scene->surface_kind = kind->name;
	if (!scene->surface)
		return incise_error_set(err, why.code, "%s:%d: its surface: %s",
					scene->path, config_setting_source_line(group),
					why.text);
	return 0;
}

static int refuse(const struct incise_scene *scene, const config_setting_t *group,
		  const char *key, const char *expected, struct incise_error *err)
{
	const config_setting_t *at = config_setting_get_member(group, key);

	return incise_error_set(err, EINVAL, "%s:%u: picture.%s: expected %s",
				scene->path, config_setting_source_line(at), key,
				expected);
}

static int read_skin(struct incise_scene *scene, const config_setting_t *group,
		     struct incise_error *err)
{
	static const char *const names[] = {"plain", "neck", "liver"};
	const char *name = NULL;
	int rc = incise_conf_string(group, scene->path, "skin", &name, err);

	if (rc || !name)
		return rc;
	for (int i = 0; i < 3; i++)
		if (!strcmp(name, names[i])) {
			scene->picture.skin = (enum incise_skin)i;
			return 0;
		}
	return refuse(scene, group, "skin", "\"plain\", \"neck\" or \"liver\"", err);
}

static bool is_side(int texture_px)
{
	return texture_px >= 256 && texture_px <= 4096 &&
	       !(texture_px & (texture_px - 1));
}

static int read_picture_switches(struct incise_scene *scene,
				 const config_setting_t *group, struct incise_error *err)
{
	struct incise_scene_picture *to = &scene->picture;
	int rc = incise_conf_bool(group, scene->path, "wound", &to->wound, err);

	if (!rc)
		rc = incise_conf_bool(group, scene->path, "bleeding", &to->bleeding, err);
	if (!rc)
		rc = incise_conf_bool(group, scene->path, "larynx", &to->larynx, err);
	return rc ? rc : read_skin(scene, group, err);
}

static int read_picture_numbers(struct incise_scene *scene, const config_setting_t *group,
				struct incise_error *err)
{
	struct incise_scene_picture *to = &scene->picture;
	const char *path = scene->path;
	int rc = incise_conf_number(group, path, "blood_ul_s_mm2", 0, 100,
				    &to->blood_ul_s_mm2, err);

	if (!rc)
		rc = incise_conf_number(group, path, "viscosity_mPa_s", 0.5, 1000,
					&to->viscosity_mPa_s, err);
	if (!rc)
		rc = incise_conf_direction(group, path, "gravity", to->gravity, err);
	if (!rc)
		rc = incise_conf_integer(group, path, "seed", 0, INT32_MAX, &to->seed,
					 err);
	if (!rc)
		rc = incise_conf_integer(group, path, "texture_px", 256, 4096,
					 &to->texture_px, err);
	if (!rc && !is_side(to->texture_px))
		rc = refuse(scene, group, "texture_px", "256, 512, 1024, 2048 or 4096",
			    err);
	return rc;
}

static void set_picture_defaults(struct incise_scene_picture *picture)
{
	*picture = (struct incise_scene_picture){
		.texture_px = 2048,
		.gravity = {0, 0, -1},
		.blood_ul_s_mm2 = 0.05,
		.viscosity_mPa_s = 4,
		.seed = 1,
	};
}

static int read_picture(struct incise_scene *scene, const config_setting_t *root,
			struct incise_error *err)
{
	static const char *const keys[] = {"wound",   "bleeding",	"larynx",
					   "skin",    "blood_ul_s_mm2", "viscosity_mPa_s",
					   "gravity", "seed",		"texture_px",
					   NULL};
	const config_setting_t *group = config_setting_get_member(root, "picture");
	int rc;

	if (!group)
		return 0;
	rc = incise_conf_known(group, scene->path, keys, err);
	if (!rc)
		rc = read_picture_switches(scene, group, err);
	return rc ? rc : read_picture_numbers(scene, group, err);
}

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

	for (int k = 0; k < INCISE_MODEL_INPUT_KINDS; k++)
		names[k] = incise_model_input_kinds[k].name;
	nearest = incise_nearest_name(name, names);
	return incise_error_set(
		err, EINVAL,
		"%.200s: its model has the input '%.64s', which a loop does not have%s%s: "
		"expected %s, %s, %s, %s or %s; train with --inputs of these",
		scene->path, name, nearest ? "; did you mean " : "",
		nearest ? nearest : "", names[INCISE_INPUT_DEPTH],
		names[INCISE_INPUT_SPEED], names[INCISE_INPUT_ACCELERATION],
		names[INCISE_INPUT_TILT], names[INCISE_INPUT_TIME]);
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
		return incise_error_set(err, why.code, "%s: its model %s", scene->path,
					why.text);
	return find_inputs(scene, cut, err);
}

/* In the order of enum incise_cutting_phase. */
static const char *const cutting_phases[] = {"cut", "puncture", "withdraw", NULL};

static int read_phases(struct incise_scene *scene, const config_setting_t *group,
		       struct incise_error *err)
{
	int rc = incise_conf_known(group, scene->path, cutting_phases, err);

	if (!rc)
		rc = incise_conf_need(group, scene->path, "cut", err);
	for (int i = 0; i < INCISE_CUTTING_PHASES && !rc; i++) {
		const char *name = NULL;

		rc = incise_conf_string(group, scene->path, cutting_phases[i], &name,
					err);
		if (!rc && name)
			rc = load_model(scene, &scene->cut[i], beside(scene, name), err);
	}
	if (!rc && scene->cut[INCISE_WITHDRAW].path && !scene->tissue.dissipates)
		rc = incise_error_set(
			err, EINVAL,
			"%s:%u: model.withdraw: with tissue.withdrawal \"paper\" a blade "
			"comes out with the force of its cut; remove one of them",
			scene->path, config_setting_source_line(group));
	return rc;
}

static int read_model(struct incise_scene *scene, const config_setting_t *root,
		      const char *override, struct incise_error *err)
{
	const config_setting_t *setting = config_setting_get_member(root, "model");
	const char *name = NULL;
	int rc = 0;

	if (override)
		return load_model(scene, &scene->cut[INCISE_CUT], strdup(override), err);
	if (setting && config_setting_is_group(setting))
		return read_phases(scene, setting, err);
	rc = incise_conf_string(root, scene->path, "model", &name, err);
	if (rc || !name)
		return rc;
	return load_model(scene, &scene->cut[INCISE_CUT], beside(scene, name), err);
}

/* A key of tissue that is "paper", for the paper's own way, or @other. */
static int read_way(const struct incise_scene *scene, const config_setting_t *group,
		    const char *key, const char *other, bool *paper,
		    struct incise_error *err)
{
	const char *name = NULL;
	int rc = incise_conf_string(group, scene->path, key, &name, err);

	if (rc || !name)
		return rc;
	*paper = !strcmp(name, "paper");
	if (*paper || !strcmp(name, other))
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%s:%u: tissue.%s: expected \"%s\" or \"paper\", found "
		"\"%.40s\"; correct it",
		scene->path,
		config_setting_source_line(config_setting_get_member(group, key)), key,
		other, name);
}

static int read_tissue_rest(struct incise_scene *scene, const config_setting_t *group,
			    struct incise_error *err)
{
	bool paper = !scene->tissue.dissipates;
	int rc = read_way(scene, group, "withdrawal", "dissipative", &paper, err);

	scene->tissue.dissipates = !paper;
	if (!rc)
		rc = read_way(scene, group, "orientation", "eased",
			      &scene->tissue.printed_orientation, err);
	if (!rc)
		rc = incise_conf_integer(group, scene->path, "cuts_most", 1, 1024,
					 &scene->tissue.cuts_most, err);
	return rc;
}

static int read_membrane(struct incise_scene *scene, const config_setting_t *root,
			 struct incise_error *err)
{
	static const char *const more[] = {"point_mm", "normal", NULL};
	const config_setting_t *group;
	int rc = read_group(scene, root, "membrane", membrane, more, &group, err);

	if (rc || !group)
		return rc;
	scene->membrane.normal[2] = 1;
	for (const struct number *number = membrane; number->key && !rc; number++)
		rc = incise_conf_need(group, scene->path, number->key, err);
	if (!rc)
		rc = incise_conf_need(group, scene->path, "point_mm", err);
	if (!rc)
		rc = incise_conf_vector(group, scene->path, "point_mm",
					scene->membrane.point_mm, err);
	if (!rc)
		rc = incise_conf_direction(group, scene->path, "normal",
					   scene->membrane.normal, err);
	if (rc || scene->membrane.back_wall_mm > scene->membrane.thickness_mm)
		return rc;
	return incise_error_set(
		err, EINVAL,
		"%s:%u: membrane.back_wall_mm: expected more than thickness_mm, %g, so "
		"that the back wall is behind the membrane",
		scene->path, config_setting_source_line(group),
		scene->membrane.thickness_mm);
}

/* The keys of `criteria`: two numbers, a largest one, or true and false. */
static const struct {
	const char *key;
	enum { RANGE, MOST, SWITCH } form;
	double max;
} criteria[INCISE_CRITERIA] = {
	[INCISE_CRITERION_CUT_LENGTH] = {"cut_length_mm", RANGE, 1000},
	[INCISE_CRITERION_CUT_DEPTH] = {"cut_depth_mm", RANGE, 1000},
	[INCISE_CRITERION_OFF_TARGET] = {"off_target_mm", MOST, 1000},
	[INCISE_CRITERION_INCISIONS] = {"incisions_most", MOST, 1024},
	[INCISE_CRITERION_MEMBRANE] = {"membrane", SWITCH, 1},
	[INCISE_CRITERION_INSERTION] = {"insertion_depth_mm", RANGE, 1000},
	[INCISE_CRITERION_BACK_WALL] = {"back_wall", SWITCH, 1},
	[INCISE_CRITERION_FORCE] = {"force_most_N", MOST, 1000},
	[INCISE_CRITERION_TIME] = {"time_most_s", MOST, 86400},
};

const char *incise_criterion_name(int criterion)
{
	return criterion >= 0 && criterion < INCISE_CRITERIA ? criteria[criterion].key
							     : NULL;
}

static int read_range(const struct incise_scene *scene, const config_setting_t *group,
		      int i, struct incise_scene_criterion *to, struct incise_error *err)
{
	double ends[2];
	int n, rc = incise_conf_numbers(group, scene->path, criteria[i].key, ends, 2, &n,
					err);

	if (rc)
		return rc;
	if (n != 2 || !(ends[0] >= 0 && ends[0] <= ends[1] && ends[1] <= criteria[i].max))
		return incise_error_set(
			err, EINVAL,
			"%s:%u: criteria.%s: expected two numbers [least, largest] from "
			"0 to %g; correct it",
			scene->path,
			config_setting_source_line(
				config_setting_get_member(group, criteria[i].key)),
			criteria[i].key, criteria[i].max);
	to->min = ends[0];
	to->max = ends[1];
	return 0;
}

static int read_criterion(struct incise_scene *scene, const config_setting_t *group,
			  int i, struct incise_error *err)
{
	struct incise_scene_criterion *to = &scene->criteria[i];
	const char *key = criteria[i].key;
	bool on = false;
	int rc;

	to->asked = config_setting_get_member(group, key);
	if (!to->asked)
		return 0;
	if (criteria[i].form == RANGE)
		return read_range(scene, group, i, to, err);
	if (criteria[i].form == MOST)
		return incise_conf_number(group, scene->path, key, 0, criteria[i].max,
					  &to->max, err);
	rc = incise_conf_bool(group, scene->path, key, &on, err);
	to->min = to->max = on;
	return rc;
}

static int read_criteria(struct incise_scene *scene, const config_setting_t *root,
			 struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, "criteria");
	const char *keys[INCISE_CRITERIA + 1] = {NULL};
	int rc;

	if (!group)
		return 0;
	for (int i = 0; i < INCISE_CRITERIA; i++)
		keys[i] = criteria[i].key;
	rc = incise_conf_known(group, scene->path, keys, err);
	for (int i = 0; i < INCISE_CRITERIA && !rc; i++)
		rc = read_criterion(scene, group, i, err);
	return rc;
}

static int read_tissue(struct incise_scene *scene, const config_setting_t *root,
		       struct incise_error *err)
{
	static const char *const tissue_keys[] = {"withdrawal", "orientation",
						  "cuts_most", NULL};
	struct number numbers[KEYS_MAX + 1] = {NUMBER(tissue, gain, 0, 10)};
	const config_setting_t *group;
	int n = 1, rc;

	for (int i = 0; i < incise_n_tissue_forces; i++)
		for (int k = 0; k < INCISE_FORCE_NUMBERS; k++) {
			const struct incise_force_number *from =
				&incise_tissue_forces[i].number[k];
			double *to = &scene->tissue.force[i][k];

			if (from->key)
				numbers[n++] = (struct number){
					from->key, 0, from->max,
					(size_t)((char *)to - (char *)scene)};
		}
	numbers[n++] = (struct number)NUMBER(tissue, leave_mm, 0, 5);
	numbers[n++] = (struct number)NUMBER(tissue, cut_from_mm, 0, 50);
	numbers[n] = (struct number)NUMBER(tissue, stretch_mm, 0, 50);
	rc = read_group(scene, root, "tissue", numbers, tissue_keys, &group, err);
	return rc || !group ? rc : read_tissue_rest(scene, group, err);
}

/* One reaction, and any force at all. */
static int check_forces(const struct incise_scene *scene, struct incise_error *err)
{
	bool model = scene->cut[INCISE_CUT].path, any = model;

	for (int i = 0; i < incise_n_tissue_forces; i++) {
		bool there = scene->tissue.force[i][0] > 0;

		any |= there;
		if (there && model && incise_tissue_forces[i].model)
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
static int check_tool(const struct incise_scene *scene, const config_setting_t *tool,
		      struct incise_error *err)
{
	const char *key = config_setting_get_member(tool, "axis") ? "axis" : "side";
	const config_setting_t *setting = config_setting_get_member(tool, key);

	if (!setting || fabs(v3_dot(scene->tool.axis, scene->tool.side)) < PARALLEL_COS)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: tool.%s: axis and side are within 10 degrees of one line, "
		"but side is the normal of the blade, across axis; correct it",
		scene->path, config_setting_source_line(setting), key);
}

/* A stage that older scenes have. */
static int refuse_guard(const char *path, const config_setting_t *root,
			struct incise_error *err)
{
	const config_setting_t *effects = config_setting_get_member(root, "effects");
	const config_setting_t *guard =
		effects ? config_setting_get_member(effects, "guard") : NULL;

	if (!guard)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: effects.guard was removed: scenes come to rest without it, "
		"see incise bench stability; remove the key",
		path, config_setting_source_line(guard));
}

static int read_switches(struct incise_scene *scene, const config_setting_t *root,
			 struct incise_error *err)
{
	static const char *const effects_keys[] = {"average_ticks", NULL};
	static const char *const tool_keys[] = {"side", "axis", NULL};
	static const char *const device_keys[] = {"delay_ticks", "late_ticks", NULL};
	FITS_KEYS(tool, tool_keys);
	FITS_KEYS(device, device_keys);
	const char *path = scene->path;
	const config_setting_t *group;
	int rc = refuse_guard(path, root, err);

	if (!rc)
		rc = read_group(scene, root, "effects", NULL, effects_keys, &group, err);

	if (!rc && group)
		rc = incise_conf_integer(group, path, "average_ticks", 1, 64,
					 &scene->effects.average_ticks, err);
	if (!rc)
		rc = read_group(scene, root, "tool", tool, tool_keys, &group, err);
	if (!rc && group)
		rc = incise_conf_direction(group, path, "side", scene->tool.side, err);
	if (!rc && group)
		rc = incise_conf_direction(group, path, "axis", scene->tool.axis, err);
	if (!rc && group)
		rc = check_tool(scene, group, err);
	if (!rc)
		rc = read_group(scene, root, "device", device, device_keys, &group, err);
	if (!rc && group)
		rc = incise_conf_integer(group, path, "delay_ticks", 0, 64,
					 &scene->device.delay_ticks, err);
	if (!rc && group)
		rc = incise_conf_integer(group, path, "late_ticks", 0,
					 INCISE_POSE_LOOP_LATE_MAX,
					 &scene->device.late_ticks, err);
	return rc ? rc : read_picture(scene, root, err);
}

static int read_scene(struct incise_scene *scene, const config_setting_t *root,
		      const char *model, struct incise_error *err)
{
	static const char *const keys[] = {"rate_hz", "model",	 "arithmetic", "surface",
					   "tissue",  "effects", "tool",       "device",
					   "limits",  "picture", "membrane",   "criteria",
					   NULL};
	const config_setting_t *group;
	const char *arithmetic = NULL;
	int rc = incise_conf_known(root, scene->path, keys, err);

	if (!rc)
		rc = incise_conf_number(root, scene->path, "rate_hz", 100, 20000,
					&scene->rate_hz, err);
	if (!rc)
		rc = incise_conf_string(root, scene->path, "arithmetic", &arithmetic,
					err);
	if (!rc && arithmetic)
		rc = incise_scene_set_arithmetic(scene, arithmetic, err);
	if (!rc)
		rc = read_tissue(scene, root, err);
	if (!rc)
		rc = read_group(scene, root, "limits", limits, NULL, &group, err);
	if (!rc)
		rc = read_membrane(scene, root, err);
	if (!rc)
		rc = read_criteria(scene, root, err);
	if (!rc)
		rc = read_switches(scene, root, err);
	if (!rc)
		rc = read_surface(scene, root, err);
	if (!rc)
		rc = read_model(scene, root, model, err);
	return rc ? rc : check_forces(scene, err);
}

/* Defaults; incise-scene(5) gives the reasons. */
static void set_defaults(struct incise_scene *scene)
{
	scene->rate_hz = 1000;
	scene->fixed = true;
	scene->tissue.gain = 1;
	scene->tissue.dissipates = true;
	for (int i = 0; i < incise_n_tissue_forces; i++)
		for (int k = 0; k < INCISE_FORCE_NUMBERS; k++)
			scene->tissue.force[i][k] =
				incise_tissue_forces[i].number[k].initial;
	/* Of a tracker with ±0.05 mm of noise the poses shown have ±0.16 mm. */
	scene->tissue.leave_mm = 0.2;
	/* More than that: a blade that rests on the skin cuts nothing. */
	scene->tissue.cut_from_mm = 0.5;
	scene->tissue.stretch_mm = 2;
	scene->tissue.cuts_most = 64;
	scene->effects.average_ticks = 1;
	scene->tool.side[1] = 1;
	scene->tool.axis[2] = 1;
	scene->tool.handle_mm = 120;
	scene->tool.handle_width_mm = 10;
	scene->tool.handle_thickness_mm = 3;
	scene->tool.tube_mm = 7;
	scene->device.mass_kg = 0.05;
	scene->device.damping_N_s_mm = 0.01;
	scene->device.coulomb_N = 0.01;
	scene->device.delay_ticks = -1;
	scene->limits.force_N = 4;
	scene->limits.slew_N_s = 400;
	scene->limits.pose_age_ms = 50;
	scene->limits.fade_ms = 20;
	scene->limits.ramp_ms = 200;
	scene->limits.start_N = 0.1;
	set_picture_defaults(&scene->picture);
}

struct incise_scene *incise_scene_load(const char *path, const char *model,
				       struct incise_error *err)
{
	struct incise_scene *scene = calloc(1, sizeof(*scene));
	config_t config;
	int rc = -ENOMEM;

	if (scene)
		scene->path = strdup(path);
	if (!scene || !scene->path) {
		incise_error_set(err, ENOMEM, "%s: no memory to read it", path);
		goto out;
	}
	set_defaults(scene);
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
	if (strcmp(name, "fixed") && strcmp(name, "double"))
		return incise_error_set(
			err, EINVAL,
			"%s: arithmetic '%s': expected \"fixed\" or \"double\"",
			scene->path, name);
	scene->fixed = !strcmp(name, "fixed");
	return 0;
}

void incise_scene_set_full(struct incise_scene *scene, bool full)
{
	scene->full = full;
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
	incise_surface_free(scene->surface);
	free(scene->path);
	free(scene->surface_path);
	free(scene);
}

const char *incise_scene_file(const struct incise_scene *scene, int i)
{
	const char *files[] = {scene->path, scene->cut[INCISE_CUT].path,
			       scene->cut[INCISE_PUNCTURE].path,
			       scene->cut[INCISE_WITHDRAW].path, scene->surface_path};
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

struct incise_incision *incise_incision_new(const struct incise_scene *scene,
					    struct incise_error *err)
{
	struct incise_incision_setup setup = {
		.cut_from_mm = scene->tissue.cut_from_mm,
		.stretch_mm = scene->tissue.stretch_mm,
		.cuts_most = scene->tissue.cuts_most,
		.handle_width_mm = scene->tool.handle_width_mm,
		.handle_thickness_mm = scene->tool.handle_thickness_mm,
		.tube_mm = scene->tool.tube_mm,
	};

	v3_copy(setup.side, scene->tool.side);
	return incise_incision_make(&setup, err);
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
	if (!is_side(texture_px))
		return -EINVAL;
	scene->picture.texture_px = texture_px;
	return 0;
}
