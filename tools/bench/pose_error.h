/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How far off poses are that a method shows, tick by tick, from those that are true.
 */
#ifndef INCISE_POSE_ERROR_H
#define INCISE_POSE_ERROR_H

#include <stdbool.h>
#include <incise/tracker.h>
#include "motions.h"
#include "pose_methods.h"

/* What a tracker adds to the truth: sd per axis, of the attitude about each axis, of what a
 * pose is later than it should be, and the share that is lost. Its clock is a bit fast, so
 * that all phases of its period against the ticks are met. */
#define POSE_NOISE_MM 0.02
#define POSE_NOISE_DEG 0.025
#define POSE_JITTER_MS 0.2
#define POSE_LOST 0.01
#define POSE_DRIFT_PPM 50

/* Ticks are 1 ms apart; those of the first half second do not count. */
#define POSE_TICK_NS 1000000
#define POSE_BEGIN_TICKS 500

struct pose_condition {
	const struct motion *motion;
	double tracker_hz, delay_ms;
	/* Nothing comes for so long again and again, and nothing else is lost; 0: it does. */
	double gap_ms;
	int ticks;
};

/* What a tracker saw of a motion, and what was true at each tick. */
struct pose_run {
	struct pose_condition condition;
	struct incise_tracker_info info;
	struct incise_tracker_sample *samples; /* as they arrive */
	int n;
	int64_t *t_ns;		    /* of the ticks */
	struct motion_state *truth; /* at the ticks */
	struct motion_state *late;  /* the delay before them */
	double *age_s;		    /* of the last pose that had come */
	bool *counts;
};

/* Memory lives until pose_run_end(). */
void pose_run_begin(struct pose_run *run, const struct pose_condition *condition);
void pose_run_end(struct pose_run *run);

struct pose_norms {
	double rms, p99, max;
};

struct pose_error {
	struct pose_norms place_mm, velocity_mm_s, turn_deg;
	double jump_mm;	  /* from tick to tick, beside the true motion: the largest */
	double theory_mm; /* rms of velocity · age and of noise: what a held pose is off */
	double spread_mm; /* rms of the motion about its mean */
	char failed[160]; /* why it is of no use, or empty */
};

/* NULL: the exact pose of the delay before. */
void pose_error(const struct pose_run *run, const struct pose_method *method,
		struct pose_error *error);

/* Show all ticks of a run; shown has room for one, or for all. */
void pose_show(const struct pose_run *run, const struct pose_method *method,
	       struct motion_state *shown, bool all);

#endif
