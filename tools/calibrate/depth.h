/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise calibrate depth: its data, result and report. The data are lengths in pixels, with depths
 * for a line, or corners of a board; from CSV, a recording, image files or the rig's camera.
 */
#ifndef INCISE_CALIBRATE_DEPTH_TOOL_H
#define INCISE_CALIBRATE_DEPTH_TOOL_H

#include <incise/calibrate_depth.h>
#include <incise/vision.h>
#include "calibrate.h"

#define DEPTH_FILES_MAX 1000

enum depth_method { DEPTH_TWO_POINT, DEPTH_LINE, DEPTH_BOARD };

struct depth_lengths {
	double *px, *mm; /* n; mm of a line only */
	char **name;	 /* of the frame, or "row 7" */
	int n;
	double vision_px; /* systematic uncertainty of lengths by vision */
};

struct depth_corners {
	int columns, rows;
	double *px; /* x, y of each corner, view by view */
	char **name;
	int n;
	int width, height;
};

struct depth {
	struct calibrate common;
	enum depth_method method;
	double nominal_mm_px, tolerance;
	double length_mm, u_length_mm, u_px, u_gauge, u_zero_mm;
	double square_mm, u_square, u_plane_mm;
	const char *pixels, *axis, *region;
	/* Frames, of files or of the rig's camera. */
	char **path; /* all files of --from */
	int n_paths;
	int pictures;	  /* to take with the camera; 0: the default, on a terminal */
	double every_s;	  /* between two, of a board */
	const char *pick; /* "X,Y", or NULL */
	bool guided;	  /* ask on the terminal */
	bool found_setup; /* setup describes the handle */
	struct incise_vision_setup setup;
	struct incise_vision *vision;
	/* Data and results of two-point and line, or of a board. */
	struct depth_lengths lengths;
	struct incise_depth_fit fit;
	bool *inlier; /* of lengths */
	struct depth_corners corners;
	struct incise_board_views views;
	struct incise_board_fit board;
};

/* Whether --from is one CSV file, one recording. */
bool depth_is_csv(const char *path);
bool depth_is_recording(const char *path);

/* As struct calibrate_kind has them. */
void depth_read(void *run, const char *path);
void depth_measure(void *run);
void depth_write(const void *run, FILE *out);

#endif
