// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a scene file; see incise/scene.h for its form.
 */
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/conf.h"
#include "../base/vector.h"
#include "scene.h"

#define KEYS_MAX 12

/* A number of a group. */
struct number {
	const char *key;
	double min, max;
	size_t offset; /* into struct incise_scene */
};

#define NUMBER(group, name, min, max)                                      \
	{                                                                  \
#name, min, max, offsetof(struct incise_scene, group.name) \
	}

static const struct number tissue[] = {
	NUMBER(tissue, gain, 0, 10),
	NUMBER(tissue, reaction_N_mm, 0, 1000),
	NUMBER(tissue, plane_N_mm, 0, 1000),
	NUMBER(tissue, damping_N_s_mm, 0, 1),
	NUMBER(tissue, insertion_N_mm, 0, 1000),
	NUMBER(tissue, aligned, 0, 1),
	NUMBER(tissue, spread_N_mm, 0, 1000),
	NUMBER(tissue, leave_mm, 0, 5),
	{0},
};

static const struct number tool[] = {
	NUMBER(tool, handle_mm, 1, 1000),
	{0},
};

static const struct number device[] = {
	NUMBER(device, mass_kg, 0.001, 10),
	NUMBER(device, damping_N_s_mm, 0, 1),
	NUMBER(device, coulomb_N, 0, 10),
	NUMBER(device, encoder_mm, 0, 1),
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

char *incise_scene_beside(const struct incise_scene *scene, const char *name)
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

static bool ends_with(const char *text, const char *end)
{
	size_t n = strlen(text), m = strlen(end);

	return n >= m && !strcmp(text + n - m, end);
}

static int read_model(struct incise_scene *scene, const config_setting_t *root,
		      const char *override, struct incise_error *err)
{
	struct incise_error why = {0};
	const char *name = NULL;
	int n_inputs;
	char *path;
	int rc = incise_conf_string(root, scene->path, "model", &name, err);

	if (rc || (!name && !override))
		return rc;
	path = override ? strdup(override) : incise_scene_beside(scene, name);
	if (!path)
		return incise_error_set(err, ENOMEM, "%s: no memory", scene->path);
	if (ends_with(path, ".fx"))
		scene->compiled = incise_fixed_load(path, &why);
	else
		scene->model = incise_model_load(path, &why);
	free(path);
	if (!scene->model && !scene->compiled)
		return incise_error_set(err, why.code, "%s: its model %s", scene->path,
					why.text);
	n_inputs = scene->model ? incise_model_n_inputs(scene->model)
				: scene->compiled->n_inputs;
	if (n_inputs != 2)
		return incise_error_set(
			err, EINVAL,
			"%s: its model has %d inputs, a cutting model has 2: "
			"depth_mm and velocity_mm_s",
			scene->path, n_inputs);
	return 0;
}

/* One reaction, and any force at all. */
static int check_forces(const struct incise_scene *scene, struct incise_error *err)
{
	bool model = scene->model || scene->compiled;

	if (model && scene->tissue.reaction_N_mm > 0)
		return incise_error_set(
			err, EINVAL,
			"%s: both a model and tissue.reaction_N_mm: a scene has one "
			"reaction; remove one of them",
			scene->path);
	if (!model && !(scene->tissue.reaction_N_mm > 0) &&
	    !(scene->tissue.plane_N_mm > 0) && !(scene->tissue.damping_N_s_mm > 0) &&
	    !(scene->tissue.insertion_N_mm > 0) && !(scene->tissue.spread_N_mm > 0))
		return incise_error_set(
			err, EINVAL,
			"%s: no model and no other force: expected model = "
			"\"FILE.fis\", or tissue = { reaction_N_mm = K; }, or give "
			"--model",
			scene->path);
	return 0;
}

static int read_switches(struct incise_scene *scene, const config_setting_t *root,
			 struct incise_error *err)
{
	static const char *const effects_keys[] = {"average_ticks", "guard", NULL};
	static const char *const tool_keys[] = {"side", "axis", NULL};
	static const char *const device_keys[] = {"delay_ticks", NULL};
	const char *path = scene->path;
	const config_setting_t *group;
	int rc = read_group(scene, root, "effects", NULL, effects_keys, &group, err);

	if (!rc && group)
		rc = incise_conf_integer(group, path, "average_ticks", 1, 64,
					 &scene->effects.average_ticks, err);
	if (!rc && group)
		rc = incise_conf_bool(group, path, "guard", &scene->effects.guard, err);
	if (!rc)
		rc = read_group(scene, root, "tool", tool, tool_keys, &group, err);
	if (!rc && group)
		rc = incise_conf_direction(group, path, "side", scene->tool.side, err);
	if (!rc && group)
		rc = incise_conf_direction(group, path, "axis", scene->tool.axis, err);
	if (!rc)
		rc = read_group(scene, root, "device", device, device_keys, &group, err);
	if (!rc && group)
		rc = incise_conf_integer(group, path, "delay_ticks", 0, 64,
					 &scene->device.delay_ticks, err);
	return rc ? rc : incise_scene_read_picture(scene, root, err);
}

static int read_scene(struct incise_scene *scene, const config_setting_t *root,
		      const char *model, struct incise_error *err)
{
	static const char *const keys[] = {"rate_hz", "model",	 "arithmetic", "surface",
					   "tissue",  "effects", "tool",       "device",
					   "limits",  "picture", NULL};
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
		rc = read_group(scene, root, "tissue", tissue, NULL, &group, err);
	if (!rc)
		rc = read_group(scene, root, "limits", limits, NULL, &group, err);
	if (!rc)
		rc = read_switches(scene, root, err);
	if (!rc)
		rc = incise_scene_read_surface(scene, root, err);
	if (!rc)
		rc = read_model(scene, root, model, err);
	return rc ? rc : check_forces(scene, err);
}

/* What a scene has that its file says nothing of; incise-scene(5) gives the reasons. */
static void set_defaults(struct incise_scene *scene)
{
	scene->rate_hz = 1000;
	scene->fixed = true;
	scene->tissue.gain = 1;
	scene->tissue.aligned = 0.2;
	/* Of a tracker with ±0.05 mm of noise the poses shown have ±0.16 mm. */
	scene->tissue.leave_mm = 0.2;
	scene->effects.average_ticks = 1;
	scene->tool.side[1] = 1;
	scene->tool.axis[2] = 1;
	scene->tool.handle_mm = 120;
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
	incise_scene_picture_defaults(&scene->picture);
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
	incise_model_free(scene->model);
	incise_fixed_free(scene->compiled);
	incise_surface_free(scene->surface);
	free(scene->path);
	free(scene);
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
}

double incise_scene_rate_hz(const struct incise_scene *scene)
{
	return scene->rate_hz;
}
