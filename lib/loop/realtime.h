/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The two halves of incise/realtime.h: trials on the kernel (realtime.c), and the judgement of
 * its answers (realtime_checks.c), to which tests give answers of their own.
 *
 *   try ──▶ answers (errno, limits) ─┐
 *                                    ├──▶ judge ──▶ checks
 *   files below root (/proc, /sys) ──┘
 */
#ifndef INCISE_LOOP_REALTIME_H
#define INCISE_LOOP_REALTIME_H

#include <stdint.h>
#include <sys/resource.h>
#include <incise/realtime.h>

/* The kernel's answers; errors are 0 or a positive errno. */
struct realtime_answers {
	int policy_error;
	int cpu_error;	/* of going to the set-up's CPU */
	int lock_error; /* of lock_bytes of memory */
	int idle_error; /* of opening /dev/cpu_dma_latency to write */
	rlim_t rtprio, memlock;
	uint64_t lock_bytes; /* that the process and its devices may need */
	int64_t clock_resolution_ns;
};

/* 0; -EAGAIN, -ENOMEM: no thread for the trial. */
int realtime_try(const struct incise_realtime_setup *setup,
		 struct realtime_answers *answers);

/* @root: "" or a folder that has proc/ and sys/. Returns as incise_realtime_checks(). */
int realtime_judge(const struct incise_realtime_setup *setup,
		   const struct realtime_answers *answers, const char *root,
		   struct incise_realtime_check *checks, int n);

/* One line with all denied needs; the errno of the first. */
int realtime_denied(const struct realtime_answers *answers,
		    const struct incise_realtime_check *checks, int n,
		    struct incise_error *err);

/* incise_realtime_count() below a folder that has TID/stat and TID/status. */
int realtime_count_below(const char *folder, int tid,
			 struct incise_realtime_counts *counts);

#endif
