/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The state of a loop as incise status prints it: lines, one line, JSON, Prometheus.
 */
#ifndef INCISE_STATUS_REPORT_H
#define INCISE_STATUS_REPORT_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/state.h>
#include "../cli/model_force.h"

/* A reading of a loop's page, with changes since the one before. */
struct state_look {
	const char *name, *path;
	const char *user; /* whose loop it is */
	const struct incise_state_now *now;
	double measured_hz; /* between the readings; NAN: not known */
	double still_s;	    /* without a tick, over all readings */
	bool stalled;	    /* it should tick, and did not for too long */
	const struct model_force
		*model; /* of its scene at the last tick; NULL: not known */
};

/* Set the changes since @before, @gap_s ago; @look->still_s goes on from its value. */
void state_look_since(struct state_look *look, const struct incise_state_now *before,
		      double gap_s);

/* The longest time without a tick of a loop that still runs: 0.2 s, more for a slow loop, 3 s at most. */
double state_patience_s(const struct incise_state_now *now);

/* "running"; "dead" if its process ended and left another state. */
const char *state_word(const struct incise_state_now *now);

/* Whether it runs, or was stopped as asked. */
bool state_is_well(const struct state_look *look);

/* Lines; one line for --follow; an object. */
void state_report_text(FILE *out, const struct state_look *look);
void state_report_line(FILE *out, const struct state_look *look);
json_t *state_report_json(const struct state_look *look);

/* Time of the loop's clock as UNIX time, s. */
double state_unix_s(const struct incise_state_now *now, int64_t t_ns);

/* Prometheus' text format 0.0.4 of @n loops, in base units (s, N, J). */
void state_prometheus(FILE *out, const struct state_look *loops, int n);

#endif
