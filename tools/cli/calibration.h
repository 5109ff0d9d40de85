/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The calibration that a command uses.
 */
#ifndef INCISE_TOOLS_CALIBRATION_H
#define INCISE_TOOLS_CALIBRATION_H

#include <jansson.h>
#include <incise/calibration.h>
#include "cli.h"

/* Row of the table of options for -c. */
#define CALIBRATION_OPTION(type, member)                                                \
	{                                                                               \
		'c', "calibration", "FILE",                                             \
			"calibration of the rig, or none for nominal values (default: " \
			"./calibration.conf, else /etc/incise/calibration.conf)",       \
			CLI_INPUT(type, member)                                         \
	}

/* In the devices of a rig, with INCISE_RIG_TRACKER …: all of them are simulated. */
#define CALIBRATION_SIMULATED (1U << 31)

/* The devices that a rig names; 0 with a message: it cannot be read. */
unsigned int calibration_devices(const char *rig, struct incise_error *err);

/* Whether a rig with these devices needs a calibration of this kind, "force", "depth" … */
bool calibration_needed(const char *kind, unsigned int devices);

struct calibration_used {
	struct incise_calibration values;
	const char *path; /* NULL: nominal values */
	char date[32];	  /* of its last calibration, UTC; "": of none */
};

/* ./calibration.conf, else /etc/incise/calibration.conf, else NULL. */
const char *calibration_default(void);

/*
 * Read @given, else the default one, else take nominal values; "none" takes them. With @rig, the
 * configuration of a rig, a warning says that they are in use: of the simulated rig, "sim:…", they are
 * right. Every failure ends the program.
 */
void calibration_use(struct calibration_used *used, const char *given, const char *rig);

/* "calibration.conf of 2026-11-21", "nominal values"; in a static buffer. */
const char *calibration_text(const struct calibration_used *used);

/* Path and date; null: nominal values. */
json_t *calibration_json(const struct calibration_used *used);

#endif
