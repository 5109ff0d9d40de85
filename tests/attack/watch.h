/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Shared by the library loaded into a recording program (watch.c) and the attacker: a
 * page that both map, which outlives a kill -9.
 */
#ifndef TEST_ATTACK_WATCH_H
#define TEST_ATTACK_WATCH_H

#include <stdatomic.h>
#include <stdint.h>

enum { WATCH_FORCE, WATCH_TRACKER, WATCH_FRAMES, WATCH_TABLES };

#define WATCH_GREATEST(stream) \
	"SELECT max(last_seq) FROM blocks WHERE count > 0 AND stream = '" stream "'"
/* Of each: its greatest number. */
static const char *const watch_greatest[WATCH_TABLES] = {
	[WATCH_FORCE] = WATCH_GREATEST("force"),
	[WATCH_TRACKER] = WATCH_GREATEST("tracker"),
	[WATCH_FRAMES] = WATCH_GREATEST("camera"),
};

struct watch_page {
	_Atomic int64_t commits;
	_Atomic int64_t began_ns; /* a COMMIT that is under way; 0: none is */
	_Atomic int64_t took_ns;  /* the last one */
	/* Greatest seq that SQLite has said is committed; -1: none. */
	_Atomic int64_t seq[WATCH_TABLES];
	_Atomic int64_t calls;	/* on files of the recording */
	_Atomic int64_t faults; /* errors given, and writes cut short */
};

#endif
