/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Real time inside: what is tried on the kernel, apart from what is made of its answers, so
 * that tests can give answers of their own.
 *
 *   try ──▶ answers (errno, limits) ─┐
 *                                    ├──▶ judge ──▶ checks
 *   files below root (/proc, /sys) ──┘
 */
#ifndef INCISE_LOOP_REALTIME_H
#define INCISE_LOOP_REALTIME_H

#include <stddef.h>
#include <stdint.h>
#include <sys/resource.h>
#include <incise/realtime.h>

/* What the kernel said; errors are 0 or a positive errno. */
struct realtime_answers {
	int policy_error;
	int cpu_error;	/* of going to the set-up's CPU */
	int lock_error; /* of lock_bytes of memory */
	int idle_error; /* of opening /dev/cpu_dma_latency to write */
	rlim_t rtprio, memlock;
	uint64_t lock_bytes; /* what the process and its devices may come to */
	int64_t clock_resolution_ns;
};

/* 0, -EINVAL with a line, -ENOTSUP for what does not go together. */
int realtime_check_setup(const struct incise_realtime_setup *setup,
			 struct incise_error *err);

/* Take the policy and the CPU, for the calling thread. 0 or a positive errno. */
int realtime_take_policy(const struct incise_realtime_setup *setup);
int realtime_take_cpu(const struct incise_realtime_setup *setup);

/* 0, or -EAGAIN, -ENOMEM: there was no thread to try it on. */
int realtime_try(const struct incise_realtime_setup *setup,
		 struct realtime_answers *answers);

/* @root: "" or a folder that has proc/ and sys/. Returns as incise_realtime_checks(). */
int realtime_judge(const struct incise_realtime_setup *setup,
		   const struct realtime_answers *answers, const char *root,
		   struct incise_realtime_check *checks, int n);

/* One line of all that is needed and denied; the errno that goes with the first. */
int realtime_denied(const struct realtime_answers *answers,
		    const struct incise_realtime_check *checks, int n,
		    struct incise_error *err);

/* incise_realtime_count() below a folder that has TID/stat and TID/status. */
int realtime_count_below(const char *folder, int tid,
			 struct incise_realtime_counts *counts);

#endif
