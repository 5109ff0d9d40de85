/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What samples of a haptic device's handle say, with the marks of the one-hour protocol in
 * doc/devices.md.
 */
#ifndef INCISE_DOCTOR_PROTOCOL_H
#define INCISE_DOCTOR_PROTOCOL_H

#include <jansson.h>
#include "../cli/handle.h"

enum protocol_step {
	SD,
	LINE,
	AGE,
	AGE_MOST,
	JITTER,
	LOST,
	WEIGHT,
	SWING,
	PROTOCOL_STEPS
};

struct protocol {
	struct incise_haptic_info info;
	double rate_hz, age_median_ms;
	double value[PROTOCOL_STEPS]; /* NAN: not done */
	double mark[PROTOCOL_STEPS];  /* largest value that passes */
};

/* Evaluate recorded samples. @rests: nothing moved the handle meanwhile. */
void protocol_measure(struct protocol *protocol, const struct handle *handle, bool rests);

/* Name a value above its mark; NULL: none. */
const char *protocol_failed(const struct protocol *protocol);

json_t *protocol_json(const struct protocol *protocol);

#endif
