// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The surface that a scene names: plane, sphere, capsule, height field or mesh.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../base/conf.h"
#include "scene.h"

/* A surface as the file has it. */
struct named {
	double point_mm[3], to_mm[3], normal[3], radius_mm;
	const char *file;
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
	return incise_surface_load_mesh(n->file, n->point_mm, err);
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
	{"mesh", "at_mm", true, {"kind", "file", "at_mm"}, mesh},
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
	return rc;
}

int incise_scene_read_surface(struct incise_scene *scene, const config_setting_t *root,
			      struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, "surface");
	struct named named = {.normal = {0, 0, 1}};
	struct incise_error why = {0};
	const char *name = "plane";
	const struct kind *kind;
	char *file = NULL;
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
		file = incise_scene_beside(scene, named.file);
		if (!file)
			return incise_error_set(err, ENOMEM, "%s: no memory",
						scene->path);
		named.file = file;
	}
	scene->surface = kind->make(&named, &why);
	free(file);
	if (!scene->surface)
		return incise_error_set(err, why.code, "%s:%d: its surface: %s",
					scene->path, config_setting_source_line(group),
					why.text);
	return 0;
}
