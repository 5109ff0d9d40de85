/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * One recording under attack: `incise capture` with watch.so in it, and what is left of it.
 * After each attack, that must open and verify, and what SQLite said is committed must be in
 * it. In the current folder; INCISE_BUILD is where the programs are. A recording that fails
 * ends the program with 1, and stays there.
 */
#ifndef TEST_ATTACK_ROUND_H
#define TEST_ATTACK_ROUND_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>
#include "../clock.h"
#include "watch.h"

#define MS 1000000LL

struct round {
	int number;
	char what[120]; /* for a report */
	bool camera;
	struct watch_page *page;
};

/* PROGRAM [KIND] COUNT SEED [camera]; @first: which argument COUNT is. Returns COUNT. */
int round_begin(struct round *round, int argc, char **argv, int first);

/* From the seed, below a number. */
uint64_t draw(uint64_t below);
void nap(int64_t ns);

void fail(const struct round *round, const char *fmt, ...)
	__attribute__((format(printf, 2, 3), noreturn));

/* Remove what the last round left. */
void clear(struct round *round);

/* Record a.rec of a rig; @duration may be NULL. Its messages go to the files out and err. */
pid_t start(const struct round *round, const char *rig, const char *duration);

/* Up to 16 kB of a file, until the next call; nothing where there is none. */
char *text_of(const char *path);

/* Where the database is. */
const char *recording(void);

/* One number of it by SQL; -1: it has none. */
int64_t ask(const struct round *round, const char *sql);

/*
 * It verifies, and holds what was committed. One that was closed may still be called .part,
 * when something was in the way of its name. @whole: nothing was lost at all.
 */
void check_recording(struct round *round, bool whole);

/* Before the first commit there is nothing to lose, and that is said. */
void check_unbegun(const struct round *round);

#endif
