/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise calibrate delay: its data, result and report.
 *
 *     force   F = f(depth(t + a))    a: the tracker is later than the force
 *     camera  depth(t + b)           b: the tracker is later than the camera
 */
#ifndef INCISE_CALIBRATE_DELAY_TOOL_H
#define INCISE_CALIBRATE_DELAY_TOOL_H

#include <incise/calibrate_delay.h>
#include <incise/recording.h>
#include "calibrate.h"

/* A drift that is this many times its uncertainty is real. */
#define DRIFT_SIGMAS 4
#define DRIFT_MAX_MS 0.3

enum { FORCE, TRACKER, CAMERA, STREAMS };

struct delay_stream {
	struct incise_delay_point *points; /* force N, others depth mm */
	int n;				   /* 0: there is none */
	struct incise_stream about;
	/* Against the tracker's depth. */
	bool is_fitted;
	struct incise_delay_fit fit;
	/* The delay after the reference, and its budget. */
	bool has_result;
	double late_ms, fits_u_ms, lines_u_ms;
};

struct delay {
	struct calibrate common;
	double time_s, max_delay_ms; /* time_s 0: not given */
	double u_reference_ms;	     /* NAN: not given */
	int reference;
	bool camera;
	struct delay_stream streams[STREAMS];
};

extern const char *const delay_names[STREAMS + 1]; /* ended by NULL */

/* As struct calibrate_kind has them. */
void delay_text(const void *run, FILE *out);
json_t *delay_json(const void *run);
void delay_draw(const void *run, const char *folder);

#endif
