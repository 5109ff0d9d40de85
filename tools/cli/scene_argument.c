// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The scene that a command is given; see scene_argument.h.
 */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "scene_argument.h"

void scene_argument_arith(void *arith, char *text)
{
	if (strcmp(text, "double") && strcmp(text, "fixed"))
		cli_usage("--arith: '%s' is neither double nor fixed", text);
	*(const char **)arith = text;
}

#define OF_MACHINE "/etc/incise/scenes"

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
		cli_fail("%s: no scenes are there, though they come with the program",
			 scene_argument_shipped());
	free(pattern);
}

bool scene_argument_find(struct scene_argument *argument, const char *operand)
{
	const char *places[] = {".", OF_MACHINE, scene_argument_shipped()};
	char path[PATH_MAX];

	argument->path = operand;
	if (strchr(operand, '/') || !access(operand, F_OK) || strstr(operand, ".scene"))
		return true;
	/* A name is a scene of this folder, of this machine, or a shipped one. */
	for (size_t i = 0; i < sizeof(places) / sizeof(*places); i++) {
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
	if (first + 1 != argc)
		cli_usage("expected one scene, got %d", argc - first);
	if (!scene_argument_find(argument, argv[first]))
		cli_fail(
			"there is no file %s, and no %s.scene in this folder, in %s or in %s",
			argv[first], argv[first], OF_MACHINE, scene_argument_shipped());
}

struct incise_scene *scene_argument_read(const struct scene_argument *argument,
					 struct incise_error *err)
{
	struct incise_scene *scene =
		incise_scene_load(argument->path, argument->model, err);

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
