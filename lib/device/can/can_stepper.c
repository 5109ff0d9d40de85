// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A drive on a CAN bus as a stepper; see can_stepper.h.
 *
 *   incise_stepper_…() ─▶ motor ─▶ pages ─▶ thread: axis ─▶ bus ─▶ drive
 *                           ╰──▶ mailbox ──▶ │
 *   enable, clear, home:  lend ─▶ SDOs over the same bus ─▶ give back
 */
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <linux/can/netlink.h>
#include "../motor.h"
#include "../thread.h"
#include "can_link.h"
#include "can_stepper.h"
#include "can_watch.h"

#define MS 1000000LL
#define IDLE_LOOK_NS (2 * MS) /* between looks at the mailbox without power */
#define ANSWER_NS INCISE_NS_PER_S
#define START_MOST_NS (3 * INCISE_NS_PER_S) /* longer than any phase of a start */
#define HOME_MOST_NS (60 * INCISE_NS_PER_S)
#define POLL_NS MS

enum command { NONE, DISABLE, LEND, RETURN, END };

struct can_stepper {
	struct incise_motor motor;
	struct incise_stepper_ops ops; /* the motor's, and a drive's own */
	const struct incise_stepper_ops *motor_ops;
	/* The two pages. */
	_Alignas(64) struct incise_stepper_setpoint setpoint;
	_Alignas(64) struct incise_abi_status status;
	/* Mailbox: written by the caller while it is NONE, else by the thread. */
	_Alignas(64) atomic_int command;
	/* The thread's, or the caller's who borrowed it. */
	_Alignas(64) struct can_link link;
	struct can_watch watch;
	int64_t due_ns, idle_ns; /* the next cycle; the next without power */
	bool lent, ended;
	/* Fixed once it runs. */
	void (*sleep_until)(struct can_bus *bus, int64_t t_ns); /* of a test's clock */
	pthread_t thread;
	bool runs, watches;
};

static struct can_stepper *of(struct incise_motor *motor)
{
	return (struct can_stepper *)motor;
}

static int64_t now_of(struct can_bus *bus)
{
	return bus->ops->now(bus);
}

/* The thread. */

static void obey(struct can_stepper *c)
{
	switch (atomic_load_explicit(&c->command, memory_order_acquire)) {
	case NONE:
		return;
	case DISABLE:
		if (!c->watches)
			can_axis_disable(&c->link.axis);
		break;
	case LEND:
		c->lent = true;
		break;
	case RETURN:
		c->lent = false;
		c->due_ns = now_of(c->link.bus);
		break;
	case END:
		c->ended = true;
		break;
	}
	atomic_store_explicit(&c->command, NONE, memory_order_release);
}

/* Without power, and while it is borrowed: the mailbox, and now and then a cycle. */
static int64_t idle(struct can_stepper *c)
{
	int64_t now = now_of(c->link.bus);

	if (!c->lent && now >= c->idle_ns) {
		if (c->watches)
			can_watch_cycle(&c->watch, &c->link);
		else
			can_axis_cycle(&c->link.axis, now, 0, 0);
		c->idle_ns = now + CAN_AXIS_IDLE_NS;
	}
	c->due_ns = now_of(c->link.bus);
	return c->due_ns + IDLE_LOOK_NS;
}

/*
 * Do what is due; returns when it is to be called again. Times are start + n cycles; what is
 * late by a cycle or more is left out.
 */
static int64_t step(struct can_stepper *c)
{
	struct can_axis *axis = &c->link.axis;
	int64_t cycle = axis->setup.config.tick_ns, now;
	uint32_t left_out = 0;

	obey(c);
	if (c->lent || !axis->motion.powered)
		return idle(c);
	now = now_of(c->link.bus);
	if (now < c->due_ns)
		return c->due_ns;
	left_out = (uint32_t)((now - c->due_ns) / cycle);
	c->due_ns += left_out * cycle;
	can_axis_cycle(axis, now, now - c->due_ns, left_out);
	c->due_ns += cycle;
	return c->due_ns;
}

static void sleep_until(int64_t t_ns)
{
	struct timespec until = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

static void *thread_run(void *argument)
{
	struct can_stepper *c = argument;

	while (!c->ended)
		sleep_until(step(c));
	return NULL;
}

/* Let time pass for a caller; in a test's time the thread's work is done meanwhile. */
static void nap(struct can_stepper *c, int64_t ns)
{
	int64_t end = now_of(c->link.bus) + ns, due;

	if (!c->sleep_until) {
		sleep_until(end);
		return;
	}
	do {
		due = step(c);
		c->sleep_until(c->link.bus, due < end ? due : end);
	} while (now_of(c->link.bus) < end);
}

/* The callers' side of the mailbox. */

static int ask(struct can_stepper *c, enum command command)
{
	int64_t end = now_of(c->link.bus) + ANSWER_NS;

	atomic_store_explicit(&c->command, command, memory_order_release);
	while (atomic_load_explicit(&c->command, memory_order_acquire) != NONE) {
		if (now_of(c->link.bus) > end)
			return -EIO;
		nap(c, POLL_NS / 4);
	}
	return 0;
}

static int borrow(struct can_stepper *c, struct incise_error *err)
{
	int rc = ask(c, LEND);

	return rc ? incise_error_set(err, -rc,
				     "%s: its thread does not answer; end this "
				     "program",
				     c->motor.name)
		  : 0;
}

static void give_back(struct can_stepper *c)
{
	ask(c, RETURN);
}

/* Until power, or homing, has come to an end. */
static int await_result(struct can_stepper *c, int64_t most_ns, const volatile int *stop)
{
	int64_t end = now_of(c->link.bus) + most_ns;
	bool stopped = false;

	while (c->link.axis.result == 1) {
		if (now_of(c->link.bus) > end)
			return -ETIMEDOUT;
		if (stop && *stop && !stopped) {
			stopped = true;
			ask(c, DISABLE);
		}
		nap(c, POLL_NS);
	}
	return c->link.axis.result;
}

/* Why it has no power, in a line. */
static int say_why(struct can_stepper *c, int rc, const char *what,
		   struct incise_error *err)
{
	char why[300];

	if (!can_axis_why(&c->link.axis, why, sizeof(why)))
		return rc;
	return incise_error_set(err, -rc, "%s: %s: %s", c->motor.name, what, why);
}

/* Give power, in its mode or to home. Returns when it has it, or has homed. */
static int power(struct can_stepper *c, int64_t homing_ns, const volatile int *stop,
		 const char *what, struct incise_error *err)
{
	struct can_axis *axis = &c->link.axis;
	int rc = borrow(c, err);

	if (rc)
		return rc;
	/* It looks at a statusword of now, not at one that is up to 20 ms old. */
	rc = can_link_ready(&c->link, homing_ns > 0, err);
	if (!rc)
		rc = can_axis_power(axis, now_of(c->link.bus), homing_ns);
	give_back(c);
	if (rc == -ERANGE)
		return incise_error_set(
			err, ERANGE,
			"%s: stands at %.3f mm, outside of its travel: home "
			"it, or move it there by hand",
			c->motor.name,
			(double)axis->motion.status.position * axis->setup.step_mm);
	if (rc <= 0)
		return rc;
	rc = await_result(c, homing_ns + START_MOST_NS, stop);
	return rc ? say_why(c, rc, what, err) : 0;
}

static int state_now(struct can_stepper *c)
{
	struct incise_stepper_status status;

	c->motor.stepper.ops->status(&c->motor.stepper, &status);
	return status.state;
}

static int can_enable(struct incise_motor *motor, struct incise_error *err)
{
	struct can_stepper *c = of(motor);

	switch (state_now(c)) {
	case INCISE_STEPPER_READY:
	case INCISE_STEPPER_MOVING:
		return 0;
	case INCISE_STEPPER_STOPPING:
		return -EBUSY;
	case INCISE_STEPPER_FAULT:
		say_why(c, -EPERM, "cannot be enabled", err);
		return -EPERM;
	default:
		return power(c, 0, NULL, "cannot be enabled", err);
	}
}

static int can_disable(struct incise_motor *motor)
{
	return ask(of(motor), DISABLE);
}

static int can_clear(struct incise_motor *motor, struct incise_error *err)
{
	struct can_stepper *c = of(motor);
	int rc;

	if (state_now(c) != INCISE_STEPPER_FAULT)
		return state_now(c) == INCISE_STEPPER_STOPPING ? -EBUSY : 0;
	rc = borrow(c, err);
	if (rc)
		return rc;
	rc = can_link_clear(&c->link, err);
	if (!rc)
		rc = incise_motion_clear(&c->link.axis.motion);
	incise_motion_publish(&c->link.axis.motion, now_of(c->link.bus));
	give_back(c);
	return rc;
}

static int64_t can_now(struct incise_motor *motor)
{
	return now_of(of(motor)->link.bus);
}

static void can_close(struct incise_motor *motor)
{
	struct can_stepper *c = of(motor);

	if (c->runs) {
		if (!c->watches)
			motor->stepper.ops->disable(&motor->stepper, NULL);
		atomic_store_explicit(&c->command, END, memory_order_release);
		if (!c->sleep_until)
			pthread_join(c->thread, NULL);
	}
	can_link_close(&c->link);
	free(c);
}

/* What a drive can do beside a motor. */

static int stepper_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	struct can_stepper *c = (struct can_stepper *)stepper;
	struct incise_stepper_status status;
	char why[300];

	stepper->ops->status(stepper, &status);
	if (!(status.faults & ~INCISE_STEPPER_TRAVEL) ||
	    !can_axis_why(&c->link.axis, why, sizeof(why)))
		return 0;
	return snprintf(text, size, "%s: %s", c->motor.name, why);
}

static int stepper_counter(struct incise_stepper *stepper, int i,
			   struct incise_stepper_counter *counter)
{
	const struct can_stepper *c = (const struct can_stepper *)stepper;
	const struct can_bus_counts *bus = &c->link.bus->counts;
	const struct can_axis_counts *axis = &c->link.axis.counts;
	const struct incise_stepper_counter counters[] = {
		{"setpoints_sent", "set-points sent", axis->setpoints, false},
		{"sync_late", "SYNCs late by half a cycle", axis->sync_late, true},
		{"tpdo_missing", "SYNCs without an answer", axis->tpdo_missing, true},
		{"bus_errors", "error frames", bus->errors, true},
		{"bus_offs", "times bus-off", c->link.master.bus_offs, true},
		{"frames_lost", "frames lost before they were read", bus->overflow, true},
		{"sends_refused", "frames that the queue had no room for", bus->full,
		 true},
		{"lines_broken", "what came and was no frame", bus->broken, true},
		{"emergencies", "emergency messages", c->link.master.emcy.count, true},
	};

	if (i >= (int)(sizeof(counters) / sizeof(*counters)))
		return -ENOENT;
	*counter = counters[i];
	return 0;
}

/*
 * To where the travel begins, from the edge that homing ended at. Once the profile rests
 * there, the drive may be behind it for following_ms.
 */
static int go_to_begin(struct can_stepper *c, double home_mm, const volatile int *stop,
		       struct incise_error *err)
{
	struct incise_stepper *stepper = &c->motor.stepper;
	int64_t now = now_of(c->link.bus), begin = now, end = begin + HOME_MOST_NS;
	int64_t rested = INT64_MAX, settle = c->link.axis.setup.following_ns;
	double to_mm = fmax(home_mm, 0);
	struct incise_stepper_status status;
	int rc;

	while (rested == INT64_MAX || now - rested < settle) {
		rc = stepper->ops->set(stepper, to_mm);
		if (rc)
			return say_why(c, rc, "homing", err);
		nap(c, POLL_NS);
		stepper->ops->status(stepper, &status);
		now = now_of(c->link.bus);
		if (stop && *stop)
			return incise_error_set(err, EINTR, "homing %s: stopped",
						c->motor.name);
		if (now > end)
			return incise_error_set(
				err, ETIMEDOUT,
				"homing %s: it does not come to %g mm; see "
				"that it moves",
				c->motor.name, to_mm);
		if (rested == INT64_MAX && c->motor.last.setpoint_t_ns >= begin &&
		    status.state == INCISE_STEPPER_READY)
			rested = now;
	}
	return 0;
}

static int stepper_home(struct incise_stepper *stepper, const volatile int *stop,
			struct incise_stepper_edge_found *edge, struct incise_error *err)
{
	struct can_stepper *c = (struct can_stepper *)stepper;
	const struct incise_actuator *actuator = &c->motor.actuator;
	int64_t most_ns = HOME_MOST_NS + (int64_t)(actuator->travel_mm /
						   actuator->home_mm_s * INCISE_NS_PER_S);
	int rc;

	if (!actuator->can.homing_method)
		return incise_error_set(err, EOPNOTSUPP,
					"homing %s: no homing_method in actuator.can of "
					"rig.conf; give the drive's, such as 17",
					c->motor.name);
	if (c->watches)
		return incise_error_set(err, EPERM, "homing %s: it was opened to watch",
					c->motor.name);
	if (state_now(c) != INCISE_STEPPER_READY && state_now(c) != INCISE_STEPPER_MOVING)
		return say_why(c,
			       incise_error_set(err, EIO,
						"homing %s: it is not powered; enable "
						"it first",
						c->motor.name),
			       "homing", err);
	/* The mode changes where nothing moves. */
	rc = stepper->ops->disable(stepper, err);
	if (!rc)
		rc = power(c, most_ns, stop, "homing", err);
	if (rc == -EINTR)
		return incise_error_set(err, EINTR,
					"homing %s: stopped; its position is not that of "
					"the machine: home again",
					c->motor.name);
	if (!rc && (rc = stepper->ops->disable(stepper, err)) == 0)
		rc = borrow(c, err);
	if (rc)
		return rc;
	rc = can_link_homed(&c->link, err);
	give_back(c);
	if (!rc)
		rc = power(c, 0, NULL, "homing", err);
	if (!rc)
		rc = go_to_begin(c, actuator->home_mm, stop, err);
	if (!rc && edge)
		*edge = (struct incise_stepper_edge_found){NAN, actuator->home_mm};
	return rc;
}

static void stepper_info(const struct incise_stepper *stepper,
			 struct incise_stepper_info *info)
{
	const struct can_stepper *c = (const struct can_stepper *)stepper;

	c->motor_ops->info(stepper, info);
	info->can_home = c->motor.actuator.can.homing_method != 0;
}

static int can_wait(struct incise_motor *motor, int64_t ns)
{
	nap(of(motor), ns);
	return 0;
}

static int start_thread(struct can_stepper *c)
{
	size_t length = strlen(c->motor.name);
	bool real_time = true;
	int rc = 0;

	c->due_ns = c->idle_ns = now_of(c->link.bus);
	if (!c->sleep_until && c->watches)
		rc = -pthread_create(&c->thread, NULL, thread_run, c);
	else if (!c->sleep_until)
		rc = incise_thread_start(&c->thread, thread_run, c, &real_time);
	if (rc)
		return rc;
	c->runs = true;
	if (!real_time)
		snprintf(c->motor.name + length, sizeof(c->motor.name) - length,
			 ", not real-time");
	return 0;
}

/* The motor's functions, and those that only a drive has. */
static void set_ops(struct can_stepper *c)
{
	c->motor_ops = c->motor.stepper.ops;
	c->ops = *c->motor_ops;
	c->ops.info = stepper_info;
	c->ops.cause = stepper_cause;
	c->ops.counter = stepper_counter;
	c->ops.home = stepper_home;
	/* It homes by itself: what a computer would need for that is not offered. */
	c->ops.homing = NULL;
	c->ops.edge = NULL;
	c->ops.origin = NULL;
	c->motor.stepper.ops = &c->ops;
}

static int set_up(struct can_stepper *c, const struct can_transport *transport,
		  const struct incise_backend_request *asked, struct incise_error *err)
{
	struct can_link *link = &c->link;
	int rc;

	link->axis.motion.setpoint = &c->setpoint;
	link->axis.motion.slot = &c->status;
	rc = asked->watch ? can_link_look(link, transport, asked, err)
			  : can_link_open(link, transport, asked, err);
	if (rc)
		return rc;
	c->motor.actuator = link->actuator;
	c->motor.lines = link->axis.setup.wired;
	snprintf(c->motor.name, sizeof(c->motor.name), "%s", link->where);
	incise_motion_publish(&link->axis.motion, now_of(link->bus));
	/* So that no first use of a page comes in a cycle. It may be refused. */
	mlock(c, sizeof(*c));
	rc = start_thread(c);
	return rc ? incise_error_set(err, -rc, "%s: cannot begin: %s", c->motor.name,
				     strerror(-rc))
		  : 0;
}

void *can_stepper_open(const struct can_transport *transport,
		       const struct incise_backend_request *asked,
		       struct incise_error *err)
{
	static const struct incise_motor_door door = {
		.enable = can_enable,
		.disable = can_disable,
		.clear = can_clear,
		.close = can_close,
		.now = can_now,
		.wait = can_wait,
	};
	struct can_stepper *c = aligned_alloc(64, sizeof(*c));
	int rc;

	if (!c) {
		incise_error_set(err, ENOMEM, "%s: %s", asked->where, strerror(ENOMEM));
		return NULL;
	}
	memset(c, 0, sizeof(*c));
	c->watches = asked->watch;
	c->sleep_until = transport->sleep_until;
	c->motor.door = &door;
	c->motor.watches = asked->watch;
	c->motor.setpoint = &c->setpoint;
	c->motor.slot = &c->status;
	incise_motor_init(&c->motor);
	set_ops(c);
	rc = set_up(c, transport, asked, err);
	if (!rc)
		return &c->motor.stepper;
	can_close(&c->motor);
	errno = -rc;
	return NULL;
}
