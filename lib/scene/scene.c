// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a scene file; see incise/scene.h for its form.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/conf.h"
#include "scene.h"

static const char *const keys[] = {"rate_hz", "model",	"arithmetic",
				   "surface", "limits", NULL};
static const char *const limit_keys[] = {"force_N", "slew_N_s", "pose_age_ms", NULL};

/* A name in a scene is relative to the scene's folder. */
static char *beside(const char *scene, const char *name)
{
	const char *slash = strrchr(scene, '/');
	char *path = NULL;

	if (*name == '/' || !slash)
		return strdup(name);
	if (asprintf(&path, "%.*s%s", (int)(slash - scene) + 1, scene, name) < 0)
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

	if (rc)
		return rc;
	if (!name && !override)
		return incise_error_set(
			err, EINVAL,
			"%s: no model: expected model = \"FILE.fis\", or give "
			"--model",
			scene->path);
	path = override ? strdup(override) : beside(scene->path, name);
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

static int read_scene(struct incise_scene *scene, const config_setting_t *root,
		      const char *model, struct incise_error *err)
{
	const config_setting_t *limits;
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
		rc = incise_conf_surface(root, scene->path, scene->point_mm,
					 scene->normal, err);
	scene->own_surface = config_setting_lookup((config_setting_t *)root, "surface");
	limits = config_setting_lookup((config_setting_t *)root, "limits");
	if (!rc && limits) {
		rc = incise_conf_known(limits, scene->path, limit_keys, err);
		if (!rc)
			rc = incise_conf_number(limits, scene->path, "force_N", 0.01, 100,
						&scene->force_N, err);
		if (!rc)
			rc = incise_conf_number(limits, scene->path, "slew_N_s", 1, 1e5,
						&scene->slew_N_s, err);
		if (!rc)
			rc = incise_conf_number(limits, scene->path, "pose_age_ms", 1,
						1000, &scene->pose_age_ms, err);
	}
	return rc ? rc : read_model(scene, root, model, err);
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
	scene->rate_hz = 1000;
	scene->fixed = true;
	scene->normal[2] = 1;
	scene->force_N = 4;
	scene->slew_N_s = 400;
	scene->pose_age_ms = 50;
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

void incise_scene_free(struct incise_scene *scene)
{
	if (!scene)
		return;
	incise_model_free(scene->model);
	incise_fixed_free(scene->compiled);
	free(scene->path);
	free(scene);
}

double incise_scene_rate_hz(const struct incise_scene *scene)
{
	return scene->rate_hz;
}
