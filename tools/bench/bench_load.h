/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What keeps the machine busy while wake-ups are measured: nothing, stress-ng on processors,
 * memory or disk, or the picture of `incise view`, which is drawn 60 times a second.
 */
#ifndef INCISE_BENCH_LOAD_H
#define INCISE_BENCH_LOAD_H

#include <limits.h>
#include <stdbool.h>
#include <sys/types.h>
#include "../cli/file.h"

enum load { LOAD_IDLE, LOAD_CPU, LOAD_MEMORY, LOAD_DISK, LOAD_VIEW, LOADS };

/* "idle", "cpu", "memory", "disk", "view" */
const char *load_name(enum load load);

struct load_run {
	pid_t pid;	       /* 0: nothing runs */
	char folder[PATH_MAX]; /* where a disk is kept busy, or empty */
	struct memory_file said;
};

/*
 * Begin, for @seconds at most, and wait until it is under way. @scene: a file for the view.
 * Returns NULL, or why there is no such load here.
 */
const char *load_begin(enum load load, const char *scene, double seconds,
		       struct load_run *run);

/* Returns how many pictures were drawn in a second; NaN of other loads. */
double load_end(struct load_run *run);

#endif
