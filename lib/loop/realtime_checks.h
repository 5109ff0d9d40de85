/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What checks are made of: what is needed in realtime_checks.c, what is only advice in
 * realtime_advice.c.
 */
#ifndef INCISE_LOOP_REALTIME_CHECKS_H
#define INCISE_LOOP_REALTIME_CHECKS_H

#include "realtime.h"

#define CPUS "/sys/devices/system/cpu/"

struct judgement {
	const struct incise_realtime_setup *setup;
	const struct realtime_answers *answers;
	const char *root;
};

/* Words of a check; what is too long is cut. */
void realtime_found(struct incise_realtime_check *check, const char *fmt, ...)
	INCISE_PRINTF(2, 3);
void realtime_fix(struct incise_realtime_check *check, const char *fmt, ...)
	INCISE_PRINTF(2, 3);
void realtime_keep(struct incise_realtime_check *check, const char *command);

/* The first line of a file below the root; false and "" when there is none. */
bool realtime_line(const struct judgement *j, const char *path, char *text, size_t size);

void realtime_check_kernel(const struct judgement *j,
			   struct incise_realtime_check *check);
void realtime_check_throttling(const struct judgement *j,
			       struct incise_realtime_check *check);
void realtime_check_governor(const struct judgement *j,
			     struct incise_realtime_check *check);
void realtime_check_idle(const struct judgement *j, struct incise_realtime_check *check);
void realtime_check_clock(const struct judgement *j, struct incise_realtime_check *check);
void realtime_check_isolated(const struct judgement *j,
			     struct incise_realtime_check *check);

#endif
