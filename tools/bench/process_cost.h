/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The cost of a haptic loop that no clock measures: what its process maps, opens and holds in memory,
 * from /proc.
 */
#ifndef INCISE_PROCESS_COST_H
#define INCISE_PROCESS_COST_H

#include <jansson.h>
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

#endif
