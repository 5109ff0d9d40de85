/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The parts of incise calibrate depth: its data (lengths in pixels, with depths for a line, or
 * corners of a board) from CSV, a recording, image files or the rig's camera; and its report.
 * Every failure ends the program.
 */
#ifndef INCISE_CALIBRATE_DEPTH_TOOL_H
#define INCISE_CALIBRATE_DEPTH_TOOL_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/calibrate_depth.h>
#include <incise/calibration.h>
#include <incise/rig.h>
#include <incise/vision.h>
#include "calibrate.h"

struct depth_lengths {
	double *px, *mm; /* n; mm of a line only */
	char **name;	 /* of the picture, or "row 7" */
	int n, capacity;
	double vision_px; /* systematic uncertainty of lengths by vision */
};

struct depth_corners {
	int columns, rows;
	double *px; /* x, y of each corner, view by view */
	char **name;
	int n;
	int width, height;
};

/* The source of pictures. */
struct depth_source {
	char **path; /* files; n_paths 0: the rig's camera */
	int n_paths;
	const char *rig;  /* as given, or NULL */
	int pictures;	  /* to take with the camera; 0: the default, on a terminal */
	double every_s;	  /* between two, of a board */
	const char *pick; /* "X,Y", or NULL */
	bool guided;	  /* ask on the terminal */
	bool each;	  /* before each picture, as the board moves in between */
	char device[64];  /* out: name of the source */
	bool found_setup; /* out: setup describes the handle */
	struct incise_vision_setup setup;
};

bool depth_is_recording(const char *path);
bool depth_is_csv(const char *path);

void depth_lengths_add(struct depth_lengths *lengths, double px, double mm,
		       const char *name);

/* Read a CSV with the column length_px and, for a line, depth_mm. */
void depth_lengths_read(struct depth_lengths *lengths, const char *path, bool line);

/* Lengths of a recording: for a line those in the tissue, else those in the air. */
void depth_lengths_recording(struct depth_lengths *lengths, const char *path, bool line);

/* Measure by vision; warns of pictures without a scalpel. */
void depth_lengths_measure(struct depth_lengths *lengths, struct depth_source *source);

void depth_lengths_write(const struct depth_lengths *lengths, const char *path,
			 bool line);

/* Read a CSV with the columns view, column, row, x_px, y_px, width_px, height_px. */
void depth_corners_read(struct depth_corners *corners, const char *path);

/* Find the board in pictures; warns of pictures without it. */
void depth_corners_find(struct depth_corners *corners, struct depth_source *source);

void depth_corners_write(const struct depth_corners *corners, const char *path);

struct depth_result {
	const char *way; /* two-point, line, board */
	const struct calibrate_options *common;
	const struct incise_calibration_record *record;
	const struct depth_lengths *lengths; /* of two-point and line */
	const struct depth_corners *corners; /* of a board */
	const struct incise_depth_fit *fit;
	const struct incise_board_fit *board;
	const struct incise_board_views *views;
	const bool *inlier;
	const struct depth_source *source;
	bool in_force;
};

/* Without the block of calibrate_result_text(). */
void depth_report_text(const struct depth_result *result, FILE *out);
json_t *depth_report_json(const struct depth_result *result);

/* DIR with report.txt, report.json, fit.png and residuals.png, each as .svg too. */
void depth_report_folder(const struct depth_result *result, const char *folder);

#endif
