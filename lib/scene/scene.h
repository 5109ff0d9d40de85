/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a scene, for the files of this room.
 */
#ifndef INCISE_SCENE_INTERNAL_H
#define INCISE_SCENE_INTERNAL_H

#include <stdbool.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/scene.h>

struct incise_scene {
	char *path;
	double rate_hz;
	bool fixed;
	struct incise_model *model; /* one of these */
	struct incise_fixed *compiled;
	bool own_surface; /* else the rig's */
	double point_mm[3], normal[3];
	double force_N, slew_N_s, pose_age_ms;
};

#endif
