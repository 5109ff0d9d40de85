/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Real time for a program: what a process and its loop's thread ask of the kernel, and,
 * where the kernel says no, the command that grants it.
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
	INCISE_REALTIME_FIFO, /**< SCHED_FIFO: what it is for is RLIMIT_RTPRIO */
	/**
	 * SCHED_DEADLINE: half of each period at most, so that a loop that hangs cannot take
	 * a CPU. Needs CAP_SYS_NICE, periods of 0.1 ms to 4 s, and all CPUs to run on.
	 */
	INCISE_REALTIME_DEADLINE,
};

/** Threads of devices are at 85: what makes the loop move must not be held up by it. */
#define INCISE_REALTIME_PRIORITY 80
/** Highest that may be asked for: below those of devices. */
#define INCISE_REALTIME_PRIORITY_MAX 84
/** The loop may run anywhere. */
#define INCISE_REALTIME_ANY_CPU (-1)

/** What a loop asks of the kernel. */
struct incise_realtime_setup {
	enum incise_realtime_policy policy;
	int priority;	   /**< 1 … INCISE_REALTIME_PRIORITY_MAX; of SCHED_FIFO */
	int cpu;	   /**< the loop's alone, or INCISE_REALTIME_ANY_CPU */
	int64_t period_ns; /**< of the loop; 50000 … 10⁹ (20 kHz … 1 Hz) */
};

/** Something that was looked at. */
struct incise_realtime_check {
	/**
	 * scheduling, memory, cpu (needed); kernel, throttling, governor, idle, clock,
	 * isolated (advice).
	 */
	const char *name;
	bool needed; /**< without it incise_realtime_new() fails */
	bool ok;
	char found[160]; /**< one line */
	/** When not ok: the command to run in a shell, as it is; empty: there is none. */
	char fix[240];
	/** The command that makes it last, or empty: the fix lasts, or there is none. */
	char keep[240];
};

/** How many checks there may be. */
#define INCISE_REALTIME_CHECKS 9

/**
 * Small stacks, one heap that is never given back, no huge pages: what is locked later is
 * then small, and no page of it comes or goes. The first thing in main(), before there is
 * another thread. Changes the whole process, needs no right and cannot fail.
 */
INCISE_API void incise_realtime_prepare(void);

/**
 * Look at all that a loop of this set-up needs and at what makes it late. The policy and the
 * CPU are tried on a thread that ends at once, the memory on an empty range; nothing
 * stays, but that soft limits RLIMIT_RTPRIO and RLIMIT_MEMLOCK are raised to the hard ones.
 *
 * @param checks room for @n; what is needed comes first
 * @return how many there are, which may be more than @n; -EINVAL (set-up out of its range),
 *         -ENOMEM or -EAGAIN (no thread to try it on)
 */
INCISE_API int incise_realtime_checks(const struct incise_realtime_setup *setup,
				      struct incise_realtime_check *checks, int n);

/** What a process holds. */
struct incise_realtime;

/**
 * Lock the memory of this process, now and from now on, and hold the CPUs off deep idle
 * states where that may be. In a normal thread, before devices are opened. What is needed
 * is checked first; @err then has the commands that grant all of it.
 *
 * @return to be freed with incise_realtime_free(); NULL with errno EPERM (denied), EINVAL
 *         (set-up out of its range, or a CPU that cannot be had), EBUSY (SCHED_DEADLINE: the
 *         CPUs are promised to others), ENOTSUP (SCHED_DEADLINE with a CPU), EAGAIN, ENOMEM
 */
INCISE_API struct incise_realtime *incise_realtime_new(
	const struct incise_realtime_setup *setup, struct incise_error *err);

/**
 * In the loop's thread, before its first tick: touch its stack, go to the CPU, take the
 * policy. The thread must end when this fails. With a CPU, threads that it starts run there
 * too: start those of devices elsewhere.
 *
 * @return 0, or -EPERM, -EINVAL, -EBUSY: as above, of rights that went since
 */
INCISE_API int incise_realtime_enter(const struct incise_realtime *realtime,
				     struct incise_error *err);

/** Let go of it, when the loop's thread is gone. Memory is unlocked. */
INCISE_API void incise_realtime_free(struct incise_realtime *realtime);

/** What a thread has had since it began: of a loop that runs, the differences are to be 0. */
struct incise_realtime_counts {
	uint64_t minor_faults, major_faults; /**< pages mapped, pages read from a disk */
	/** Waits, one for each tick; and the times that another took the CPU from it. */
	uint64_t voluntary, involuntary;
};

/**
 * Read them, from /proc/self/task/TID, in another thread.
 *
 * @param tid gettid(2) of a thread of this process
 * @return 0, -ESRCH (no such thread), -EIO (not what proc(5) says)
 */
INCISE_API int incise_realtime_count(int tid, struct incise_realtime_counts *counts);

INCISE_END_DECLS
#endif
