/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What is asked of incise capture: its options, checked.
 */
#ifndef INCISE_CAPTURE_WISH_H
#define INCISE_CAPTURE_WISH_H

#include <stdbool.h>

enum capture_camera { CAMERA_AUTO, CAMERA_OFF, CAMERA_PICTURES, CAMERA_DEPTH };

struct capture_wish {
	const char *rig, *calibration;
	char *output;
	enum capture_camera camera;
	double trigger_force_N;
	bool trigger_button;
	double duration_s; /* 0: not given */
	bool cuts, force, json;
};

/* Bad usage ends the program. */
void capture_wish_take(struct capture_wish *wish, int argc, char **argv);

#endif
