// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The scene that a command is given; see scene_argument.h.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "file_kind.h"
#include "scene_argument.h"

void scene_argument_arith(void *arith, char *text)
{
	static const char *const names[] = {"double", "fixed", NULL};

	*(const char **)arith = names[cli_choice("arith", text, names)];
}

#define OF_MACHINE "/etc/incise/scenes"
#define PLACES 3

const char *scene_argument_shipped(void)
{
	static char folder[PATH_MAX + 30];

	snprintf(folder, sizeof(folder), "%s/../share/incise/scenes", cli_folder());
	return folder;
}

void scene_argument_list_shipped(glob_t *found)
{
	char *pattern = cli_text("%s/*.scene", scene_argument_shipped());

	if (glob(pattern, 0, NULL, found))
		cli_fail("%s: the installed scenes are missing; install incise again",
			 scene_argument_shipped());
	free(pattern);
}

char *scene_argument_installed(void)
{
	char *all = cli_text("installed scenes:");
	glob_t found;

	scene_argument_list_shipped(&found);
	for (size_t i = 0; i < found.gl_pathc; i++) {
		char *name = scene_argument_name(found.gl_pathv[i]), *before = all;

		all = cli_text("%s%s %s", before, i ? "," : "", name);
		free(name), free(before);
	}
	globfree(&found);
	return all;
}

bool scene_argument_find(struct scene_argument *argument, const char *operand)
{
	const char *places[PLACES] = {".", OF_MACHINE, scene_argument_shipped()};
	char path[PATH_MAX];

	argument->path = operand;
	if (strchr(operand, '/') || !access(operand, F_OK) || strstr(operand, ".scene"))
		return true;
	/* A name is a scene of this folder, of this machine, or a shipped one. */
	for (int i = 0; i < PLACES; i++) {
		if (snprintf(path, sizeof(path), "%s/%s.scene", places[i], operand) >=
			    (int)sizeof(path) ||
		    access(path, F_OK))
			continue;
		/* Lives as long as the program. */
		argument->path = cli_text("%s", !i ? path + 2 : path);
		cli_input(argument->path);
		return true;
	}
	return false;
}

void scene_argument_missing(const char *name)
{
	const char *places[PLACES] = {".", OF_MACHINE, scene_argument_shipped()};
	char *all = cli_text("%s", "");
	const char *nearest, **names;
	size_t n = 0;
	glob_t found = {0};

	for (int i = 0; i < PLACES; i++) {
		char *pattern = cli_text("%s/*.scene", places[i]);

		glob(pattern, i ? GLOB_APPEND : 0, NULL, &found);
		free(pattern);
	}
	names = cli_alloc(found.gl_pathc + 1, sizeof(*names));
	for (size_t i = 0; i < found.gl_pathc; i++) {
		const char *one = scene_argument_name(found.gl_pathv[i]);
		size_t known = 0;

		/* A scene of this folder hides that of the same name elsewhere. */
		while (known < n && strcmp(names[known], one))
			known++;
		if (known < n)
			continue;
		names[n++] = one;
		all = cli_text("%s%s%s", all, n > 1 ? ", " : "", one);
	}
	/* Compare "liver" only, for "liver.scen". */
	nearest = incise_nearest_name(cli_text("%.*s", (int)strcspn(name, "."), name),
				      names);
	if (nearest)
		cli_fail("%s: no such scene; did you mean %s?", name, nearest);
	cli_fail("%s: no such scene; give the path of a file, or one of: %s", name, all);
}

char *scene_argument_name(const char *path)
{
	const char *slash = strrchr(path, '/'), *file = slash ? slash + 1 : path;
	size_t n = strlen(file), end = strlen(".scene");

	return cli_text("%.*s",
			(int)(n > end && cli_ends_with(file, ".scene") ? n - end : n),
			file);
}

void scene_argument_operand(struct scene_argument *argument, int argc, char **argv,
			    int first)
{
	if (first >= argc)
		cli_usage(
			"missing SCENE (file, or name of an installed scene, for example "
			"liver)");
	if (first + 1 < argc)
		cli_usage("unexpected argument '%s'; give one SCENE at a time",
			  argv[first + 1]);
	if (!scene_argument_find(argument, argv[first]))
		scene_argument_missing(argv[first]);
	file_expect(argument->path, FILE_SCENE);
}

struct incise_scene *scene_argument_read(const struct scene_argument *argument,
					 struct incise_error *err)
{
	struct incise_scene *scene =
		incise_scene_load(argument->path, argument->model, err);

	if (scene && argument->no_texture)
		incise_scene_leave_texture_out(scene);
	if (!scene || !argument->arith)
		return scene;
	if (!incise_scene_set_arithmetic(scene, argument->arith, err))
		return scene;
	incise_scene_free(scene);
	errno = EINVAL;
	return NULL;
}

struct incise_scene *scene_argument_load(const struct scene_argument *argument)
{
	struct incise_error err = {0};
	struct incise_scene *scene =
		cli_require(scene_argument_read(argument, &err), &err);

	for (int i = 0; incise_scene_file(scene, i); i++)
		cli_input(incise_scene_file(scene, i));
	return scene;
}

char *scene_argument_size(const char *path, const struct incise_surface *surface)
{
	struct incise_surface_size s;
	double mm[3];
	char *text;

	if (!incise_surface_size(surface, &s))
		return cli_text("%s", "");
	for (int i = 0; i < 3; i++)
		mm[i] = s.hi_mm[i] - s.lo_mm[i];
	if (fmax(fmax(mm[0], mm[1]), mm[2]) < 1)
		cli_warn("%s: its surface is %.2g mm wide; is it in metres? write its "
			 "coordinates in mm",
			 path, fmax(fmax(mm[0], mm[1]), mm[2]));
	text = cli_text("%.4g x %.4g x %.4g mm, %s", mm[0], mm[1], mm[2],
			cli_count(incise_surface_triangles(surface), "triangle"));
	if (s.open_edges) {
		char *before = text;

		text = cli_text("%s, %s from (%.4g, %.4g, %.4g) to (%.4g, "
				"%.4g, %.4g)",
				before, cli_count(s.open_edges, "open edge"),
				s.open_lo_mm[0], s.open_lo_mm[1], s.open_lo_mm[2],
				s.open_hi_mm[0], s.open_hi_mm[1], s.open_hi_mm[2]);
		free(before);
	}
	return text;
}
