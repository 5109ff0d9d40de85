/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Strokes of an actuator against the force sensor, for incise calibrate stepper. Failure, a
 * signal and too much force bring the motor to rest and end the program.
 */
#ifndef INCISE_CALIBRATE_STEPPER_TOOL_H
#define INCISE_CALIBRATE_STEPPER_TOOL_H

#include <stdbool.h>
#include <incise/calibrate_stepper.h>
#include <incise/calibration.h>
#include "../stepper/drive.h"

struct stepper_series {
	struct incise_calibrate_stepper_point *points;
	enum incise_calibrate_stepper_state *states;
	double *t_s; /* NAN: not known */
	int n, capacity;
	double step_mm; /* NAN: not known */
};

void stepper_series_add(struct stepper_series *series, double t_s, double position_mm,
			double force_N);

/* The largest rate. */
struct stepper_rate {
	bool tried;
	const char *why;  /* reason if it was not, else NULL */
	double kept_1_s;  /* the largest that lost nothing; 0: none */
	double lost_1_s;  /* the smallest that did; NAN: none up to the limit */
	double lost_mm;	  /* there */
	double limit_1_s; /* how fast this range and rig.conf let it go */
	double seen_mm;	  /* smallest loss above the noise */
	int strokes;
	double off_mm; /* of the count in the end: lost and not homed */
};

struct stepper_live {
	struct stepper_drive drive;
	struct incise_force *force;
	struct incise_force_info channel;
	struct incise_calibration calibration;
	double zero_mV, low_N, high_N, code_N; /* of the channel */
	double low_mm, high_mm, max_N;	       /* of the strokes */
	double creep_mm_s;
	double off_mm;	 /* count less position of the nut */
	double sum_N;	 /* of samples since the last reading, */
	int samples;	 /* and their number */
	bool retreating; /* from too much force */
	int64_t begin_ns;
	int strokes;
};

void stepper_live_open(struct stepper_live *live, const char *rig);

/* Check low_mm, high_mm and max_N; NAN becomes the value that fits the channel. */
void stepper_live_plan(struct stepper_live *live);

/* Ask on a terminal, power it, find its home, go to low_mm. */
void stepper_live_start(struct stepper_live *live);
void stepper_live_strokes(struct stepper_live *live, struct stepper_series *series);

/* Move slowly to a position. */
void stepper_live_creep(struct stepper_live *live, double to_mm);

/* Search the largest step rate that loses no step. */
void stepper_live_rate(struct stepper_live *live,
		       const struct incise_calibrate_stepper *fit,
		       struct stepper_rate *rate);

#endif
