/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Scenes that incise bench scenes makes for itself, from the plainest to one with all that
 * there is, as files in memory.
 */
#ifndef INCISE_MADE_SCENES_H
#define INCISE_MADE_SCENES_H

#include <stdbool.h>
#include "../cli/file.h"

#define MADE_SCENES 7

struct made_scene {
	const char *name;
	bool kept; /* every stage, though the scene needs few: the full pipeline itself */
	struct memory_file scene, sheet; /* sheet.file: NULL without a mesh */
};

/* Make that of a number from 0 on. */
void made_scene_begin(struct made_scene *made, int number);

void made_scene_end(struct made_scene *made);

#endif
