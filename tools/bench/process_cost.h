/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The cost of programs that no clock measures: what a haptic loop's process maps, opens and
 * holds in memory, from /proc, and how many instructions ticks take in user space, which no other
 * program and no host of a virtual machine changes.
 */
#ifndef INCISE_PROCESS_COST_H
#define INCISE_PROCESS_COST_H

#include <jansson.h>
#include <stdint.h>
#include <sys/types.h>
#include "../cli/file.h"

/* incise haptic on the virtual rig for a moment of real time. */
struct loop_process {
	pid_t pid; /* 0: it has ended */
	struct memory_file report;
	json_t *libraries; /* names of shared objects that it mapped; NULL: not seen */
	json_t *files;	   /* those that it opened itself */
	json_t *devices;   /* of the rig, that its stages use */
	long peak_KiB;	   /* the most that it had in memory */
	long own_KiB;	   /* at the end, without what it shares with another process */
	char failed[200];
};

/* Start the loop of a scene's file. */
void loop_process_start(struct loop_process *process, const char *scene);

/* Watch all of them until each has ended. */
void loop_processes_watch(struct loop_process *const *processes, int n);

/* Open the processor's counter of this thread (perf_event_open(2)); -1 where the kernel has none
 * for us. Close it with close(2). */
int instructions_open(void);

/* Its value now. */
uint64_t instructions_now(int counter);

/* By valgrind's callgrind, in another process. */
struct callgrind {
	pid_t pid;
	struct memory_file report;
};

/* Start a program without output, and count the instructions of all calls of a function, from
 * callgrind_here() on. */
void callgrind_start(struct callgrind *callgrind, const char *function,
		     char *const argv[]);

/* Wait for its end. @return how many; NaN when that failed */
double callgrind_end(struct callgrind *callgrind);

/* In that program: it runs faster up to here. */
void callgrind_here(void);

#endif
