/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The state of a loop as lines, as one line and as JSON: what `incise status` prints.
 */
#ifndef INCISE_STATE_REPORT_H
#define INCISE_STATE_REPORT_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/state.h>

/* Two looks at a page, the newer one and what went on between them. */
struct state_look {
	const char *name, *path;
	const struct incise_state_now *now;
	double measured_hz; /* between the looks; NAN: not known */
	double still_s;	    /* without a tick, over all looks */
	bool stalled;	    /* it should tick, and did not for too long */
};

/* What went on since @before, @gap_s ago. A look that goes on from the last one keeps it. */
void state_look_since(struct state_look *look, const struct incise_state_now *before,
		      double gap_s);

/* So long a loop may not tick: 0.2 s, and more than a period of a slow one; 3 s at most. */
double state_patience_s(const struct incise_state_now *now);

/* "running"; "dead" where the loop ended without a word. */
const char *state_word(const struct incise_state_now *now);

/* Whether all is as it was asked to be: it runs, or was stopped. */
bool state_is_well(const struct state_look *look);

/* Times of UNIX, s. */
double state_unix_s(const struct incise_state_now *now, int64_t t_ns);

/* A block of lines; --follow's line; an object. */
void state_report_text(FILE *out, const struct state_look *look);
void state_report_line(FILE *out, const struct state_look *look);
json_t *state_report_json(const struct state_look *look);

#endif
