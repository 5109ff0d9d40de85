// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What a scene says of its picture: the group `picture` of a .scene file.
 */
#include <errno.h>
#include <string.h>
#include "../base/conf.h"
#include "scene.h"

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

static int read_switches(struct incise_scene *scene, const config_setting_t *group,
			 struct incise_error *err)
{
	struct incise_scene_picture *to = &scene->picture;
	int rc = incise_conf_bool(group, scene->path, "wound", &to->wound, err);

	if (!rc)
		rc = incise_conf_bool(group, scene->path, "bleeding", &to->bleeding, err);
	if (!rc)
		rc = incise_conf_bool(group, scene->path, "larynx", &to->larynx, err);
	return rc ? rc : read_skin(scene, group, err);
}

static int read_numbers(struct incise_scene *scene, const config_setting_t *group,
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

void incise_scene_picture_defaults(struct incise_scene_picture *picture)
{
	*picture = (struct incise_scene_picture){
		.texture_px = 2048,
		.gravity = {0, 0, -1},
		.blood_ul_s_mm2 = 0.05,
		.viscosity_mPa_s = 4,
		.seed = 1,
	};
}

int incise_scene_read_picture(struct incise_scene *scene, const config_setting_t *root,
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
		rc = read_switches(scene, group, err);
	return rc ? rc : read_numbers(scene, group, err);
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
