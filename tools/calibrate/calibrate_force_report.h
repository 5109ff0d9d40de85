/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a calibration of the force channel found: for people, as JSON and as pictures.
 */
#ifndef INCISE_CALIBRATE_FORCE_REPORT_H
#define INCISE_CALIBRATE_FORCE_REPORT_H

#include <stdio.h>
#include <jansson.h>
#include <incise/calibration.h>
#include "calibrate_pairs.h"

struct calibrate_force_report {
	const struct calibrate_pairs *pairs;
	const struct incise_calibrate_force_setup *setup;
	const struct incise_calibrate_force *result;
	const enum incise_calibrate_force_state *states;
	const struct incise_calibration_record *record;
	const char *refused; /* why there is no result; NULL: there is one */
	double found_mV_N;   /* what was in force before */
	const char *gravity; /* where it comes from */
};

/* As text: @all with budget and pairs, else the figures alone. */
void calibrate_force_print(const struct calibrate_force_report *report, bool all,
			   FILE *out);

json_t *calibrate_force_json(const struct calibrate_force_report *report);

/* DIR/report.txt, report.json, fit.png and residuals.png; fails the program. */
void calibrate_force_write(const struct calibrate_force_report *report,
			   const char *folder);

#endif
