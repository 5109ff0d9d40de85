/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * StallGuard's values of a driver chip while the actuator moves at given speeds, and the threshold that
 * follows from them.
 */
#ifndef INCISE_STEPPER_TUNE_TOOL_H
#define INCISE_STEPPER_TUNE_TOOL_H

#include <jansson.h>
#include "drive.h"

#define TUNE_SPEEDS_MAX 8

/*
 * Move a powered actuator over its travel at each speed, mm/s. Prints the table, or adds it to @report.
 * Failure ends the program.
 */
void stepper_tune(struct stepper_drive *drive, const double *speeds, int n,
		  json_t *report);

#endif
