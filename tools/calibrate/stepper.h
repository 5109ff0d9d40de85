/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Strokes of an actuator against the force sensor, for incise calibrate stepper. Failure, a
 * signal and too much force bring the motor to rest and end the program.
 */
#ifndef INCISE_CALIBRATE_STEPPER_TOOL_H
#define INCISE_CALIBRATE_STEPPER_TOOL_H

#include <incise/calibrate_stepper.h>
#include "../stepper/drive.h"
#include "calibrate.h"

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

/* The motor against the force channel. */
struct stepper_live {
	struct stepper_drive drive;
	struct incise_force *force;
	struct incise_force_info channel;
	struct incise_calibration calibration;
	double zero_mV, low_N, high_N, code_N; /* of the channel */
	double low_mm, high_mm, max_N; /* of the strokes; NAN: that fit the channel */
	int strokes;		       /* 0: not given */
	double creep_mm_s;
	double off_mm;	 /* count less position of the nut */
	double sum_N;	 /* of samples since the last reading, */
	int samples;	 /* and their number */
	bool retreating; /* from too much force */
	int64_t begin_ns;
};

/* Open it, check the strokes, ask on a terminal, power it, find its home, go to low_mm. */
void stepper_begin(struct stepper_live *live, const struct calibrate *calibrate);

/* A point of a stroke. */
typedef void stepper_take(void *context, double t_s, double position_mm, double force_N);

void stepper_strokes(struct stepper_live *live, stepper_take *take, void *context);

/* Search the largest step rate that loses no step. */
void stepper_find_rate(struct stepper_live *live,
		       const struct incise_calibrate_stepper *fit,
		       struct stepper_rate *rate);

/* Move slowly to a position. */
void stepper_creep(struct stepper_live *live, double to_mm);

#endif
