/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a calibration of depth is made from: lengths in pixels, with depths for a line, or
 * corners of a board. From CSV, a recording, pictures, or the rig's camera.
 */
#ifndef INCISE_DEPTH_DATA_H
#define INCISE_DEPTH_DATA_H

#include <stdbool.h>
#include <incise/rig.h>
#include <incise/vision.h>

struct depth_lengths {
	double *px, *mm; /* n; mm of a line only */
	char **name;	 /* of the picture, or "row 7" */
	int n, room;
	double vision_px; /* systematic part that is stated for lengths by vision */
};

struct depth_corners {
	int columns, rows;
	double *px; /* x, y of each corner, view by view */
	char **name;
	int n;
	int width, height;
};

/* How pictures come. */
struct depth_source {
	char **path; /* files; n_paths 0: the rig's camera */
	int n_paths;
	const char *rig;  /* as given, or NULL */
	int pictures;	  /* to take of a camera; 0: on a terminal, the default */
	double every_s;	  /* between two, of a board */
	const char *pick; /* "X,Y", or NULL */
	bool guided;	  /* ask on the terminal */
	bool each;	  /* for each picture, as a board is moved in between */
	char device[64];  /* out: where they came from */
	bool found_setup; /* out: setup says what the handle looks like */
	struct incise_vision_setup setup;
};

bool depth_is_recording(const char *path);
bool depth_is_csv(const char *path);

void depth_lengths_add(struct depth_lengths *lengths, double px, double mm,
		       const char *name);

/* Read a CSV with the column length_px and, for a line, depth_mm. */
void depth_lengths_read(struct depth_lengths *lengths, const char *path, bool line);

/* Of a recording: for a line those in the tissue, else those in the air. */
void depth_lengths_recording(struct depth_lengths *lengths, const char *path, bool line);

/* Measure by vision; those in which no scalpel is found are named on stderr. */
void depth_lengths_measure(struct depth_lengths *lengths, struct depth_source *source);

void depth_lengths_write(const struct depth_lengths *lengths, const char *path,
			 bool line);

/* Read a CSV with the columns view, column, row, x_px, y_px, width_px, height_px. */
void depth_corners_read(struct depth_corners *corners, const char *path);

/* Find the board in pictures; those without it are named on stderr. */
void depth_corners_find(struct depth_corners *corners, struct depth_source *source);

void depth_corners_write(const struct depth_corners *corners, const char *path);

/*
 * Pictures one after the other, as long as @take returns true; a picture's name is "3" or
 * its file's.
 */
typedef bool depth_take(void *context, const struct incise_camera_frame *frame,
			const char *name);
void depth_pictures(struct depth_source *source, int pictures, const char *prompt,
		    depth_take *take, void *context);

#endif
