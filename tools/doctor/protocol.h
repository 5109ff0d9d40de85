/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The steps of the one-hour protocol of a haptic device, in doc/devices.md: noise and latency from samples of its
 * handle, walls and a weight from runs of the loop, each value with its mark.
 */
#ifndef INCISE_DOCTOR_PROTOCOL_H
#define INCISE_DOCTOR_PROTOCOL_H

#include <jansson.h>
#include "../cli/handle.h"

#define PROTOCOL_WALLS 4

enum protocol_step {
	SD,
	LINE,
	AGE,
	AGE_MOST,
	JITTER,
	LOST,
	WEIGHT,
	SWINGS, /* of each wall */
	PROTOCOL_STEPS = SWINGS + PROTOCOL_WALLS
};

struct protocol {
	const char *rig, *calibration; /* for runs of the loop */
	bool simulated;		       /* the device: nobody is asked for anything */
	bool has_hand; /* the rig is sim:haptic, whose hand does as the step needs */
	struct incise_haptic_info info;
	double limit_N_mm; /* largest stiffness; 0: not known */
	double rate_hz, age_median_ms;
	double value[PROTOCOL_STEPS]; /* NAN: not done */
	double mark[PROTOCOL_STEPS];  /* largest value that passes */
};

/* Evaluate recorded samples. @rests: nothing moved the handle meanwhile. */
void protocol_measure(struct protocol *protocol, const struct handle *handle, bool rests);

/* Find the largest stiffness of a wall that the plan accepts; 0: none, *err says why. @rig: with its haptic device. */
double protocol_limit(struct incise_rig *rig, double peak_N, struct incise_error *err);

/*
 * Measure walls and weight, by runs of incise haptic: the device is free. Asks for each on a terminal, but for a
 * simulated device. 0; -ECHILD: a run failed; -EDOM: nothing leant on the wall; -ECANCELED: the input
 * ended.
 */
int protocol_force(struct protocol *protocol, struct incise_error *err);

/* Name a value above its mark, of the steps from @from on; NULL: none. */
const char *protocol_failed(const struct protocol *protocol, enum protocol_step from);

json_t *protocol_json(const struct protocol *protocol);

#endif
