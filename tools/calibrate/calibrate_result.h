/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a calibration has found: told, reported, appended to calibration.conf.
 */
#ifndef INCISE_CALIBRATE_RESULT_H
#define INCISE_CALIBRATE_RESULT_H

#include <jansson.h>
#include "calibrate_wish.h"

/* One more coefficient. */
void calibrate_value(struct incise_calibration_record *record, const char *key,
		     const char *unit, double found, double left, double u);

/*
 * End with a result: it is appended unless it is a dry run, report.json is written, and it is
 * printed as text or JSON; @details become part of that.
 */
void calibrate_end(const struct calibrate_wish *wish,
		   const struct incise_calibration_record *record, json_t *details);

#endif
