/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The scene that a command is given, with the options that change it.
 */
#ifndef INCISE_SCENE_ARGUMENT_H
#define INCISE_SCENE_ARGUMENT_H

#include <glob.h>
#include <stdbool.h>
#include <incise/scene.h>
#include <incise/surface.h>
#include "cli.h"

struct scene_argument {
	const char *path;
	const char *model; /* --model, or NULL */
	const char *arith; /* --arith, or NULL */
	bool no_texture;
};

/* A row of its own for programs without the others. */
#define SCENE_ARGUMENT_NO_TEXTURE(type, member)                                     \
	{                                                                           \
		0, "no-texture", NULL, "leave out the texture of the scene's cuts", \
			CLI_FLAG(type, member.no_texture)                           \
	}

/* Rows of the table of options that change the scene, without the outer braces. */
#define SCENE_ARGUMENT_OPTIONS(type, member)                                   \
	{0, "model", "FILE", "use this model instead of the scene's",          \
	 CLI_INPUT(type, member.model)},                                       \
		SCENE_ARGUMENT_NO_TEXTURE(type, member),                       \
	{                                                                      \
		0, "arith", "KIND", "fixed or double, instead of the scene's", \
			CLI_PARSED(type, member.arith, scene_argument_arith)   \
	}

/* Parse --arith into a const char *; anything but double and fixed is bad usage. */
void scene_argument_arith(void *arith, char *text);

/*
 * Take the only operand from @first on; another number of them is bad usage. A name without
 * a file, for example "liver", is ./liver.scene, else that in /etc/incise/scenes, else the
 * installed one.
 */
void scene_argument_operand(struct scene_argument *argument, int argc, char **argv,
			    int first);

/* The same for one of several operands. Returns false if there is no scene of that name. */
bool scene_argument_find(struct scene_argument *argument, const char *operand);

/* Fail the program: there is no scene of this name; with the name that is near. */
_Noreturn void scene_argument_missing(const char *name);

/* "neck" of "scenes/neck.scene": free(3). */
char *scene_argument_name(const char *path);

/* The folder of the installed scenes; lives as long as the program. */
const char *scene_argument_shipped(void);

/* The paths of all installed scenes, by name: globfree(3). Fails the program if there are none. */
void scene_argument_list_shipped(glob_t *found);

/* "installed scenes: liver, neck, wall": free(3). */
char *scene_argument_installed(void);

/* Read it; NULL with errno and @err on failure. incise_scene_free(). */
struct incise_scene *scene_argument_read(const struct scene_argument *argument,
					 struct incise_error *err);

/* Read it, or fail the program. incise_scene_free(). */
struct incise_scene *scene_argument_load(const struct scene_argument *argument);

/*
 * The size of a mesh or height field in words, "" of another surface: free(3). Warns if its unit
 * looks like metres.
 */
char *scene_argument_size(const char *path, const struct incise_surface *surface);

#endif
