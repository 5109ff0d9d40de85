/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What the parts of incise calibrate stepper hand to each other.
 *
 *   live ─▶ series ─▶ fit ─▶ rate (live) ─▶ report, calibration.conf
 *   file ─▶
 */
#ifndef INCISE_CALIBRATE_STEPPER_TOOL_H
#define INCISE_CALIBRATE_STEPPER_TOOL_H

#include <stdbool.h>
#include <jansson.h>
#include <incise/calibrate_stepper.h>
#include <incise/calibration.h>
#include "../stepper/drive.h"

struct stepper_series {
	struct incise_calibrate_stepper_point *points;
	enum incise_calibrate_stepper_state *states;
	double *t_s; /* NAN: not known */
	int n, room;
	double step_mm; /* NAN: not known */
};

/* Fail the program when there is no memory. */
void stepper_series_add(struct stepper_series *series, double t_s, double position_mm,
			double force_N);
void stepper_series_free(struct stepper_series *series);

/* A CSV file with the columns position_mm or steps, and force_N; fails the program. */
void stepper_series_read(struct stepper_series *series, const char *path, double step_mm);
void stepper_series_write(const struct stepper_series *series, const char *path);

/* The largest rate. */
struct stepper_rate {
	bool tried;
	const char *why;  /* it was not, else NULL */
	double kept_1_s;  /* the largest that lost nothing; 0: none */
	double lost_1_s;  /* the smallest that did; NAN: none up to the limit */
	double lost_mm;	  /* there */
	double limit_1_s; /* how fast this range and rig.conf let it go */
	double seen_mm;	  /* least loss that can be told from noise */
	int strokes;
	double off_mm; /* of the count in the end: what was lost and not homed */
};

struct stepper_live {
	struct stepper_drive drive;
	struct incise_force *force;
	struct incise_force_info channel;
	struct incise_calibration calibration;
	double zero_mV, low_N, high_N, code_N; /* of the channel */
	double low_mm, high_mm, max_N;	       /* of the strokes */
	double creep_mm_s;
	double off_mm;	 /* the count is more by that than where the nut is */
	double sum_N;	 /* of samples since the last look, */
	int samples;	 /* and how many */
	bool retreating; /* it is on its way from too much force */
	int64_t begin_ns;
	int strokes;
};

/*
 * All of these bring the motor to rest and end the program with 1 and a line when they fail,
 * at a signal, and at too much force.
 */
void stepper_live_open(struct stepper_live *live, const char *rig);

/* After low_mm, high_mm and max_N are set: NAN for what fits the channel. */
void stepper_live_plan(struct stepper_live *live);
void stepper_live_start(struct stepper_live *live);
void stepper_live_strokes(struct stepper_live *live, struct stepper_series *series);

/* Slowly to a position; the mean force there. Passes a period and looks at the force. */
void stepper_live_creep(struct stepper_live *live, double to_mm);
double stepper_live_force(struct stepper_live *live, double seconds);
void stepper_live_watch(struct stepper_live *live);

void stepper_live_rate(struct stepper_live *live,
		       const struct incise_calibrate_stepper *fit,
		       struct stepper_rate *rate);

/* What is to be said in the end. */
struct stepper_report {
	const struct stepper_series *series;
	const struct incise_calibrate_stepper *fit;
	const struct incise_calibrate_stepper_setup *setup;
	const struct stepper_rate *rate;
	const struct incise_calibration_record *record;
	const char *source; /* device, or file */
};

void stepper_report_text(const struct stepper_report *report, FILE *out);
json_t *stepper_report_json(const struct stepper_report *report);

/* FOLDER/fit.png, residuals.png, report.txt, report.json; fails the program. */
void stepper_report_folder(const struct stepper_report *report, const char *folder);

#endif
