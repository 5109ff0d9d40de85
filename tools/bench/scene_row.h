/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A row of incise bench scenes: a scene, what it saves, and the process of its loop.
 */
#ifndef INCISE_SCENE_ROW_H
#define INCISE_SCENE_ROW_H

#include <stdbool.h>
#include "loop_process.h"
#include "made_scenes.h"
#include "scene_saving.h"

struct scene_row {
	char *name;
	const char *path; /* NULL: there is none of that name */
	bool own_process; /* it was started: the plan can be, and is the scene's own */
	struct made_scene made;
	struct scene_saving saving;
	struct loop_process process;
	char failed[520]; /* or "" */
};

#endif
