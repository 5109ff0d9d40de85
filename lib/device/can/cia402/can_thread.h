/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The thread that owns a drive's bus: a cycle of the axis at each period while the drive has
 * power, less often without. Callers have a mailbox, and borrow the bus for SDOs.
 *
 *   caller   ── lend ─▶ (SDOs) ── give back ─▶
 *   thread   ══cycles══╡        ╞══cycles══════
 *
 * One caller at a time.
 */
#ifndef INCISE_CAN_THREAD_H
#define INCISE_CAN_THREAD_H

#include <pthread.h>
#include <stdatomic.h>
#include "can_session.h"

enum can_thread_command {
	CAN_THREAD_NONE,
	CAN_THREAD_DISABLE, /* can_axis_disable() */
	CAN_THREAD_LEND,
	CAN_THREAD_RETURN,
	CAN_THREAD_END,
};

struct can_thread {
	/* Written by the caller while it is NONE, else by the thread. */
	atomic_int command;
	struct can_session
		*session; /* the thread's, or that of the caller who borrowed it */
	bool watches;	  /* it does not drive the drive */
	/* Of a simulated clock; NULL: there is a thread. See can_bus.h. */
	void (*sleep_until)(struct can_bus *bus, int64_t t_ns);

	/* private */
	int64_t due_ns, idle_ns; /* the next cycle; the next without power */
	bool lent, ended, runs;
	pthread_t thread;
};

/* Set session, watches and sleep_until before. Returns 0 or -errno. @real_time: see thread.h. */
int can_thread_start(struct can_thread *t, bool *real_time);

/* Returns when it has ended; also if it never started. */
void can_thread_end(struct can_thread *t);

/* Let time pass for a caller. */
void can_thread_nap(struct can_thread *t, int64_t ns);

/* Wait until the thread has done it. Returns 0, -EIO (it does not answer). */
int can_thread_ask(struct can_thread *t, enum can_thread_command command);

/* Borrow the bus, the session and its axis. Returns 0, -EIO. */
int can_thread_borrow(struct can_thread *t, struct incise_error *err);
void can_thread_give_back(struct can_thread *t);

#endif
