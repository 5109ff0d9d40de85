/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What is asked of incise calibrate depth: its options, checked, with what they are where they
 * are not given.
 */
#ifndef INCISE_DEPTH_WISH_H
#define INCISE_DEPTH_WISH_H

#include "calibrate_wish.h"
#include "depth_data.h"

#define DEPTH_FILES_MAX 1000

struct depth_wish {
	struct calibrate_wish common;
	const char *way; /* two-point, line, board */
	double length_mm, u_length_mm, u_px, u_gauge, u_zero_mm;
	char *pixels, *axis, *region;
	int columns, rows;
	double square_mm, u_square, u_plane_mm;
	struct depth_source source;
};

/* Bad usage ends the program. */
void depth_wish_take(struct depth_wish *wish, int argc, char **argv);

#endif
