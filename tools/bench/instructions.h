/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How many instructions a program takes in user space: a cost that no clock, no other
 * program and no host of a virtual machine changes. By the processor's counter where the
 * kernel gives it (perf_event_open(2)); else by valgrind's callgrind, in another process.
 */
#ifndef INCISE_INSTRUCTIONS_H
#define INCISE_INSTRUCTIONS_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>
#include "../cli/file.h"

struct instruction_counter {
	int fd; /* below 0: there is none */
	uint64_t empty, begun, sum;
};

/* The counter of this thread; false where the kernel has none for us, with errno. */
bool instructions_open(struct instruction_counter *counter);

/* Around what is counted. */
void instructions_begin(struct instruction_counter *counter);
void instructions_end(struct instruction_counter *counter);

/* How many so far, those of begin and end taken off. Closes it. */
double instructions_close(struct instruction_counter *counter);

struct callgrind {
	pid_t pid;
	struct memory_file report;
};

/*
 * Start a program, of which it counts what runs in calls of a function, from
 * callgrind_here() on. It has no output.
 */
void callgrind_begin(struct callgrind *callgrind, const char *function,
		     char *const argv[]);

/* Wait for its end. @return how many; NaN when that failed */
double callgrind_end(struct callgrind *callgrind);

/* In that program: what came before is run faster, and is not looked at. */
void callgrind_here(void);

#endif
