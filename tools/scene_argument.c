// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The scene that a verb is given; see scene_argument.h.
 */
#include <string.h>
#include "cli.h"
#include "scene_argument.h"

void scene_argument_arith(struct scene_argument *argument, const char *text)
{
	if (strcmp(text, "double") && strcmp(text, "fixed"))
		cli_usage("--arith: '%s' is neither double nor fixed", text);
	argument->arith = text;
}

void scene_argument_operand(struct scene_argument *argument, int argc, char **argv,
			    int first)
{
	if (first + 1 != argc)
		cli_usage("expected one scene, got %d", argc - first);
	argument->path = argv[first];
}

struct incise_scene *scene_argument_load(const struct scene_argument *argument)
{
	struct incise_error err = {0};
	struct incise_scene *scene =
		incise_scene_load(argument->path, argument->model, &err);

	if (!scene || (argument->arith &&
		       incise_scene_set_arithmetic(scene, argument->arith, &err)))
		cli_fail_with(&err);
	return scene;
}
