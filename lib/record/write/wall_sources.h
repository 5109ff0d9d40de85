/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Sources of wall time; see wall_sampler.h. Each call blocks for at most some 0.1 s, and none
 * needs more privileges than to open the socket of its program.
 */
#ifndef INCISE_WALL_SOURCES_H
#define INCISE_WALL_SOURCES_H

#include <stdint.h>
#include "../time/wall_follow.h"

/*
 * Read all clocks within a short time. Of some tries the shortest counts, as one can be
 * interrupted.
 */
void incise_wall_read_clocks(struct incise_wall_clocks *clocks);

/* What a source says of CLOCK_REALTIME; tai_ns of the reading is found with the clocks. */
struct incise_wall_statement {
	struct incise_wall_reading reading;
	double offset_ns; /* CLOCK_REALTIME less UTC */
};

/* --- wall_kernel.c: the kernel's own state, which programs such as ntpd and chronyd set ----- */

struct incise_wall_kernel {
	int64_t updated;
	double last_ns; /* maximum error */
};

/*
 * Two statements: "kernel", which is good if the clock is synchronised, and "plain", whose error
 * is unknown. Sets TAI less UTC in the clocks.
 */
void incise_wall_kernel_read(struct incise_wall_kernel *kernel,
			     struct incise_wall_clocks *clocks,
			     struct incise_wall_statement *statements);

/* Part of it: from a list of leap seconds in the form of IERS, with its end. For tests. */
struct incise_leap_list {
	int64_t expires_s; /* UTC since 1970 */
	int n;
	struct {
		int64_t from_s;
		int offset_s;
	} leaps[100];
};

/* Returns false for a text that is no such list. */
bool incise_leap_list_read(struct incise_leap_list *list, char *text);

#endif
