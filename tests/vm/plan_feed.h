/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Programs beside a plan that runs in the kernel: one that feeds poses of 120 Hz, and one that
 * watches every millisecond, ahead of everybody else.
 */
#ifndef INCISE_VM_PLAN_FEED_H
#define INCISE_VM_PLAN_FEED_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "plan.h"

/* Shared with the programs, which are processes of their own. */
struct plan_feed {
	/* The feeder: how deep in the tissue the tip is; < 0: outside. */
	volatile int32_t depth_um;
	volatile uint32_t tool;
	volatile uint64_t poses;

	/* The watcher: what it has seen since plan_watch_reset(). */
	volatile uint32_t wanted, done;	   /* requests to start over */
	volatile uint32_t states, reasons; /* bits */
	volatile int64_t
		steepest; /* of the force, 2^-16 N per tick, along any direction */
	volatile int64_t force_max, force_min;
	volatile int64_t quiet_age_ns; /* the pose's age when there was no force first */
	volatile uint32_t state, motor_state[3], motor_faults[3];
};

/* Memory for it; NULL: none. */
struct plan_feed *plan_feed_new(void);

/* Each returns the process, or -1. They end by SIGKILL. */
pid_t plan_feeder(const struct bench *bench, struct plan_feed *feed);
pid_t plan_watcher(const struct bench *bench, struct plan_feed *feed, int n_motors);

/* Start over. Returns whether the watcher has done so. */
bool plan_watch_reset(struct plan_feed *feed);

/* Until the plan is in a state; false after @ns. */
bool plan_until(const struct bench *bench, uint32_t state, int64_t ns);

/* This process under SCHED_FIFO, in locked memory. */
void plan_fifo(int priority);

/* Ends a process, and waits for it. */
void plan_kill(pid_t *child);

#endif
