// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The thread that owns the bus; see can_thread.h.
 */
#include <errno.h>
#include <time.h>
#include "../../thread.h"
#include "can_thread.h"

#define IDLE_LOOK_NS 2000000 /* period of looking at the mailbox without power */
#define ANSWER_NS 1000000000
#define POLL_NS 250000

static int64_t now_of(const struct can_thread *t)
{
	return t->session->bus->ops->now(t->session->bus);
}

static void obey(struct can_thread *t)
{
	switch (atomic_load_explicit(&t->command, memory_order_acquire)) {
	case CAN_THREAD_NONE:
		return;
	case CAN_THREAD_DISABLE:
		if (!t->watches)
			can_axis_disable(&t->session->axis);
		break;
	case CAN_THREAD_LEND:
		t->lent = true;
		break;
	case CAN_THREAD_RETURN:
		t->lent = false;
		t->due_ns = now_of(t);
		break;
	case CAN_THREAD_END:
		t->ended = true;
		break;
	}
	atomic_store_explicit(&t->command, CAN_THREAD_NONE, memory_order_release);
}

/* Without power, and while the bus is borrowed: the mailbox, and sometimes a cycle. */
static int64_t idle(struct can_thread *t)
{
	int64_t now = now_of(t), heartbeat_ns = t->session->master.heartbeat_ns;

	if (!t->lent && now >= t->idle_ns) {
		if (t->watches)
			can_session_watch_cycle(t->session);
		else
			can_axis_cycle(&t->session->axis, now, 0, 0);
		/* The drive's deadman expires after four heartbeats. */
		t->idle_ns = now + (heartbeat_ns > 0 && heartbeat_ns < CAN_AXIS_IDLE_NS
					    ? heartbeat_ns
					    : CAN_AXIS_IDLE_NS);
	}
	t->due_ns = now_of(t);
	return t->due_ns + IDLE_LOOK_NS;
}

/*
 * Run the cycle that is due; returns the time of the next call. Cycles are due at start + n
 * periods; those that are late by a period or more are left out.
 */
static int64_t step(struct can_thread *t)
{
	struct can_axis *axis = &t->session->axis;
	int64_t cycle = axis->setup.config.tick_ns, now;
	uint32_t left_out = 0;

	obey(t);
	if (t->lent || !axis->motion.powered)
		return idle(t);
	now = now_of(t);
	if (now < t->due_ns)
		return t->due_ns;
	left_out = (uint32_t)((now - t->due_ns) / cycle);
	t->due_ns += left_out * cycle;
	can_axis_cycle(axis, now, now - t->due_ns, left_out);
	t->due_ns += cycle;
	return t->due_ns;
}

static void sleep_until(int64_t t_ns)
{
	struct timespec until = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

static void *thread_run(void *argument)
{
	struct can_thread *t = argument;

	while (!t->ended)
		sleep_until(step(t));
	return NULL;
}

/* With a simulated clock the thread's work is done here. */
void can_thread_nap(struct can_thread *t, int64_t ns)
{
	int64_t end = now_of(t) + ns, due;

	if (!t->sleep_until) {
		sleep_until(end);
		return;
	}
	do {
		due = step(t);
		t->sleep_until(t->session->bus, due < end ? due : end);
	} while (now_of(t) < end);
}

/* --- the callers' side of the mailbox --- */

int can_thread_ask(struct can_thread *t, enum can_thread_command command)
{
	int64_t end = now_of(t) + ANSWER_NS;

	atomic_store_explicit(&t->command, command, memory_order_release);
	while (atomic_load_explicit(&t->command, memory_order_acquire) !=
	       CAN_THREAD_NONE) {
		if (now_of(t) > end)
			return -EIO;
		can_thread_nap(t, POLL_NS);
	}
	return 0;
}

int can_thread_borrow(struct can_thread *t, struct incise_error *err)
{
	int rc = can_thread_ask(t, CAN_THREAD_LEND);

	return rc ? incise_error_set(err, -rc,
				     "%s: its thread does not answer; end this "
				     "program",
				     t->session->name)
		  : 0;
}

void can_thread_give_back(struct can_thread *t)
{
	can_thread_ask(t, CAN_THREAD_RETURN);
}

int can_thread_start(struct can_thread *t, bool *real_time)
{
	int rc = 0;

	*real_time = true;
	t->due_ns = t->idle_ns = now_of(t);
	if (!t->sleep_until && t->watches)
		rc = -pthread_create(&t->thread, NULL, thread_run, t);
	else if (!t->sleep_until)
		rc = incise_thread_start(&t->thread, thread_run, t, real_time);
	t->runs = !rc;
	return rc;
}

void can_thread_end(struct can_thread *t)
{
	if (!t->runs)
		return;
	atomic_store_explicit(&t->command, CAN_THREAD_END, memory_order_release);
	if (!t->sleep_until)
		pthread_join(t->thread, NULL);
	t->runs = false;
}
