/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What incise calibrate tip and delay share: their common options, and what is done with a
 * result: told, reported, appended to calibration.conf.
 */
#ifndef INCISE_CALIBRATE_RESULT_H
#define INCISE_CALIBRATE_RESULT_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/calibration.h>
#include "cli.h"

struct calibrate_wish {
	const char *rig, *calibration, *from, *keep, *report;
	bool dry_run, json;
	struct incise_calibration found; /* what is in force */
};

enum {
	CALIBRATE_FROM = CLI_LONG,
	CALIBRATE_KEEP,
	CALIBRATE_REPORT,
	CALIBRATE_DRY_RUN,
	CALIBRATE_JSON,
	CALIBRATE_OWN, /* first id of a tool's own */
};

/* Take an option; false: it is none of these. */
bool calibrate_option(struct calibrate_wish *wish, int id);

/* Read what is in force; make the folder of the report. Fails the program. */
void calibrate_begin(struct calibrate_wish *wish);

/* DIR/NAME of the report, to be closed with calibrate_report_end(); NULL without --report. */
FILE *calibrate_report_file(const struct calibrate_wish *wish, const char *name);
void calibrate_report_end(const struct calibrate_wish *wish, FILE *file);

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
