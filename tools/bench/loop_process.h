/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The process of a haptic loop, looked at from outside while it runs: incise haptic on the
 * virtual rig for a moment of real time, and what /proc says of it.
 */
#ifndef INCISE_LOOP_PROCESS_H
#define INCISE_LOOP_PROCESS_H

#include <jansson.h>
#include <sys/types.h>
#include "../cli/file.h"

struct loop_process {
	pid_t pid; /* 0: it has ended */
	struct memory_file report;
	json_t *libraries; /* names of shared objects that it mapped; NULL: not seen */
	json_t *files;	   /* what it opened itself */
	json_t *devices;   /* of the rig, that its stages use */
	long peak_KiB;	   /* the most that it had in memory */
	long own_KiB;	   /* of that, what it shares with no other process, at the end */
	char failed[200];
};

/* Start the loop of a scene's file. */
void loop_process_begin(struct loop_process *process, const char *scene);

/* Look at all of them until each has ended. */
void loop_process_watch(struct loop_process *const *processes, int n);

void loop_process_free(struct loop_process *process);

#endif
