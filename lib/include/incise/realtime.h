/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Real time for a program: the requests of a process and its loop's thread to the kernel, and
 * the command that grants a denied one.
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

/** Policies of the scheduler that a loop may ask for. */
enum incise_realtime_policy {
	INCISE_REALTIME_FIFO, /**< SCHED_FIFO: needs RLIMIT_RTPRIO */
	/**
	 * SCHED_DEADLINE: at most half of each period, so that a loop that hangs does not block
	 * a CPU. Needs CAP_SYS_NICE, periods of 0.1 ms to 4 s, and all CPUs to run on.
	 */
	INCISE_REALTIME_DEADLINE,
};

/** Threads of devices are at 85: the loop must not delay them. */
#define INCISE_REALTIME_PRIORITY 80
/** Highest priority: below those of devices. */
#define INCISE_REALTIME_PRIORITY_MAX 84
/** The loop may run on any CPU. */
#define INCISE_REALTIME_ANY_CPU (-1)

/** A loop's requests to the kernel. */
struct incise_realtime_setup {
	enum incise_realtime_policy policy;
	int priority;	   /**< 1 … INCISE_REALTIME_PRIORITY_MAX; of SCHED_FIFO */
	int cpu;	   /**< for the loop alone, or INCISE_REALTIME_ANY_CPU */
	int64_t period_ns; /**< of the loop; 50000 … 10⁹ (20 kHz … 1 Hz) */
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
	/** When not ok: the command to run in a shell, or empty. */
	char fix[240];
	/** The command that makes the fix permanent, or empty: it is, or there is none. */
	char keep[240];
};

/** Maximum number of checks. */
#define INCISE_REALTIME_CHECKS 9

/**
 * Set small stacks, one heap that never shrinks, and no huge pages: the memory that is locked
 * later is then small and constant. Call it first in main(), before there is another thread.
 * Changes the whole process, needs no right and cannot fail.
 */
INCISE_API void incise_realtime_prepare(void);

/**
 * Check everything that a loop of this set-up needs, and causes of lateness. The policy and the
 * CPU are tried on a thread that ends at once, the memory on an empty range. The only lasting
 * change: soft limits RLIMIT_RTPRIO and RLIMIT_MEMLOCK are raised to the hard ones.
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
 * Lock the present and future memory of this process, and keep the CPUs out of deep idle states
 * where that is allowed. In a normal thread, before devices are opened. Required rights are
 * checked first; @err then has the commands that grant all of them.
 *
 * @return to be freed with incise_realtime_free(); NULL with errno EPERM (denied), EINVAL
 *         (set-up out of its range, or the CPU is not available), EBUSY (SCHED_DEADLINE: others
 *         have reserved the CPUs), ENOTSUP (SCHED_DEADLINE with a CPU), EAGAIN, ENOMEM
 */
INCISE_API struct incise_realtime *incise_realtime_new(
	const struct incise_realtime_setup *setup, struct incise_error *err);

/**
 * In the loop's thread, before its first tick: touch its stack, move to the CPU, take the policy.
 * The thread must end when this fails. Threads that it starts inherit its CPU: start those of
 * devices elsewhere.
 *
 * @return 0, or -EPERM, -EINVAL, -EBUSY: as above, for rights that were lost since
 */
INCISE_API int incise_realtime_enter(const struct incise_realtime *realtime,
				     struct incise_error *err);

/** Release it after the loop's thread has ended. Unlocks memory. */
INCISE_API void incise_realtime_free(struct incise_realtime *realtime);

/** Counts of a thread since its start: faults should not increase while a loop runs. */
struct incise_realtime_counts {
	uint64_t minor_faults, major_faults; /**< pages mapped, pages read from a disk */
	/** Waits, one for each tick; and preemptions. */
	uint64_t voluntary, involuntary;
};

/**
 * Read them, from /proc/self/task/TID, in another thread.
 *
 * @param tid gettid(2) of a thread of this process
 * @return 0, -ESRCH (no such thread), -EIO (format not as in proc(5))
 */
INCISE_API int incise_realtime_count(int tid, struct incise_realtime_counts *counts);

INCISE_END_DECLS
#endif
