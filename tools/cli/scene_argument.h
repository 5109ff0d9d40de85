/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The scene that a verb is given, with the options that change it.
 */
#ifndef INCISE_SCENE_ARGUMENT_H
#define INCISE_SCENE_ARGUMENT_H

#include <stdbool.h>
#include <incise/scene.h>

struct scene_argument {
	const char *path;
	const char *model; /* --model, or NULL */
	const char *arith; /* --arith, or NULL */
};

/* Take --arith; what is none is bad usage. */
void scene_argument_arith(struct scene_argument *argument, const char *text);

/*
 * Take the one operand; another number of them is bad usage. A name such as "liver", which is
 * no file, is ./liver.scene, else that of /etc/incise/scenes, else that which is installed.
 */
void scene_argument_operand(struct scene_argument *argument, int argc, char **argv,
			    int first);

/* The same of one of several operands. @return false: there is none of that name. */
bool scene_argument_find(struct scene_argument *argument, const char *operand);

/* The folder of the scenes that came with the program; lives as long as it. */
const char *scene_argument_shipped(void);

/* Read it; NULL with errno and @err when that fails. To be freed. */
struct incise_scene *scene_argument_read(const struct scene_argument *argument,
					 struct incise_error *err);

/* Read it, or fail the program. To be freed. */
struct incise_scene *scene_argument_load(const struct scene_argument *argument);

#endif
