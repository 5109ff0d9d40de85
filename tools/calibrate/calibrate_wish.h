/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What is asked of every incise calibrate: the options that all of them have, and what is in
 * force before.
 */
#ifndef INCISE_CALIBRATE_WISH_H
#define INCISE_CALIBRATE_WISH_H

#include <stdbool.h>
#include <incise/calibration.h>
#include "../cli/cli.h"

struct calibrate_wish {
	const char *rig, *calibration, *from, *keep, *report;
	bool dry_run, json;
	struct incise_calibration found; /* what is in force */
};

/* Beside 'r' and 'c', --rig and --calibration. */
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

/* Read what is in force; a file that is not there yet is nominal. Fails the program. */
void calibrate_find(struct calibrate_wish *wish);

/* Check what excludes each other, read what is in force, make the folder of the report. */
void calibrate_begin(struct calibrate_wish *wish);

#endif
