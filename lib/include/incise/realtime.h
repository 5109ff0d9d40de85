/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Real time for a program: the requests of a process and its loop's thread to the kernel, and
 * the commands that grant denied ones.
 *
 *   main()  ── prepare ── checks? ── new ── open devices ───────────────────── free
 *                                            │
 *   loop's thread                            └── enter ── tick tick tick … ──┘
 *
 * Sources: sched(7), mlockall(2), Documentation/scheduler/sched-deadline.rst and
 * Documentation/power/pm_qos_interface.rst of the kernel.
 */
#ifndef INCISE_REALTIME_H
#define INCISE_REALTIME_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Scheduling policies of a loop. */
enum incise_realtime_policy {
	INCISE_REALTIME_FIFO, /**< SCHED_FIFO: needs RLIMIT_RTPRIO */
	/**
	 * SCHED_DEADLINE: at most half of each period, so that a hanging loop does not block a
	 * CPU. Needs CAP_SYS_NICE, periods of 0.1 ms to 4 s, and all CPUs to run on.
	 */
	INCISE_REALTIME_DEADLINE,
};

/** Default priority. Threads of devices have 85: the loop must not delay them. */
#define INCISE_REALTIME_PRIORITY 80
/** Highest priority: below the devices'. */
#define INCISE_REALTIME_PRIORITY_MAX 84
/** The loop may run on any CPU. */
#define INCISE_REALTIME_ANY_CPU (-1)

/** A loop's requests to the kernel. */
struct incise_realtime_setup {
	enum incise_realtime_policy policy;
	int priority;	   /**< 1 … INCISE_REALTIME_PRIORITY_MAX; for SCHED_FIFO */
	int cpu;	   /**< CPU of the loop, or INCISE_REALTIME_ANY_CPU */
	int64_t period_ns; /**< period of the loop; 50000 … 10⁹ (20 kHz … 1 Hz) */
};

/** One check and its result. */
struct incise_realtime_check {
	/**
	 * scheduling, memory, cpu (needed); kernel, throttling, governor, idle, clock,
	 * isolated (advice).
	 */
	const char *name;
	bool needed; /**< without it incise_realtime_new() fails */
	bool ok;
	char found[160]; /**< one line */
	/** If not ok: the shell command that fixes it, or empty. */
	char fix[240];
	/** The command that makes the fix permanent, or empty. */
	char keep[240];
};

/** Maximum number of checks. */
#define INCISE_REALTIME_CHECKS 9

/**
 * Set small stacks, one heap that never shrinks, and no huge pages, so that the locked memory
 * is small and constant. Call it first in main(), before other threads start. It changes the
 * whole process, needs no privilege and cannot fail.
 */
INCISE_API void incise_realtime_prepare(void);

/**
 * Check the requirements of a loop with this set-up, and causes of latency. A thread that ends
 * at once tries the policy and the CPU; an empty range is used to try locking memory. The only
 * lasting change: soft limits RLIMIT_RTPRIO and RLIMIT_MEMLOCK are raised to the hard ones.
 *
 * @param checks capacity @n; required ones come first
 * @return their number, which may be more than @n; -EINVAL (set-up out of its range), -ENOMEM
 *         or -EAGAIN (no thread for the trial)
 */
INCISE_API int incise_realtime_checks(const struct incise_realtime_setup *setup,
				      struct incise_realtime_check *checks, int n);

/** Real time of a process. */
struct incise_realtime;

/**
 * Lock the present and future memory of this process, and keep the CPUs out of deep idle
 * states if permitted. Call it in a normal thread, before devices are opened. It checks the
 * required privileges first; if one is missing, @err has the commands that grant them.
 *
 * @return object, to be freed with incise_realtime_free(); NULL with errno EPERM (denied),
 *         EINVAL (set-up out of its range, or the CPU is not available), EBUSY
 *         (SCHED_DEADLINE: the CPUs are reserved by others), ENOTSUP (SCHED_DEADLINE with a
 *         CPU), EAGAIN, ENOMEM
 */
INCISE_API struct incise_realtime *incise_realtime_new(
	const struct incise_realtime_setup *setup, struct incise_error *err);

/**
 * Touch the stack, move to the CPU and set the policy. Call it in the loop's thread before its
 * first tick. The thread must end if this fails. Threads that it starts inherit its CPU: start
 * threads of devices in another thread.
 *
 * @return 0, or -EPERM, -EINVAL, -EBUSY: as above, if privileges were lost since
 */
INCISE_API int incise_realtime_enter(const struct incise_realtime *realtime,
				     struct incise_error *err);

/** Release it after the loop's thread has ended. Unlocks memory. */
INCISE_API void incise_realtime_free(struct incise_realtime *realtime);

/** Counts of a thread since its start. Faults should not increase while a loop runs. */
struct incise_realtime_counts {
	uint64_t minor_faults, major_faults; /**< pages mapped, pages read from a disk */
	/** Waits, one per tick, and preemptions. */
	uint64_t voluntary, involuntary;
};

/**
 * Read the counts of a thread from /proc/self/task/TID, in another thread.
 *
 * @param tid gettid(2) of a thread of this process
 * @return 0, -ESRCH (no such thread), -EIO (format not as in proc(5))
 */
INCISE_API int incise_realtime_count(int tid, struct incise_realtime_counts *counts);

INCISE_END_DECLS
#endif
