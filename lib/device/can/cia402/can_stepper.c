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
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include "can_stepper.h"

#define MS 1000000LL
#define START_MOST_NS (3 * INCISE_NS_PER_S) /* with the deadman: longer than any start */
#define POLL_NS MS

static struct can_stepper *of(struct incise_motor *motor)
{
	return (struct can_stepper *)motor;
}

static int64_t now_of(struct can_bus *bus)
{
	return bus->ops->now(bus);
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
			can_thread_ask(&c->thread, CAN_THREAD_DISABLE);
		}
		can_thread_nap(&c->thread, POLL_NS);
	}
	return c->link.axis.result;
}

/* Why it has no power, in a line. */
int can_stepper_say_why(struct can_stepper *c, int rc, const char *what,
			struct incise_error *err)
{
	char why[300];

	if (!can_axis_why(&c->link.axis, why, sizeof(why)))
		return rc;
	return incise_error_set(err, -rc, "%s: %s: %s", c->motor.name, what, why);
}

/* Give power, in its mode or to home. Returns when it has it, or has homed. */
int can_stepper_power(struct can_stepper *c, int64_t homing_ns, const volatile int *stop,
		      const char *what, struct incise_error *err)
{
	int64_t deadman_ns = (int64_t)(c->motor.actuator.deadman_s * INCISE_NS_PER_S);
	struct can_axis *axis = &c->link.axis;
	int rc = can_thread_borrow(&c->thread, err);

	if (rc)
		return rc;
	/* It looks at a statusword of now, not at one that is up to 20 ms old. */
	rc = can_link_ready(&c->link, homing_ns > 0, err);
	if (!rc)
		rc = can_axis_power(axis, now_of(c->link.bus), homing_ns);
	can_thread_give_back(&c->thread);
	if (rc == -ERANGE)
		return incise_error_set(
			err, ERANGE,
			"%s: stands at %.3f mm, outside of its travel: home "
			"it, or move it there by hand",
			c->motor.name,
			(double)axis->motion.status.position * axis->setup.step_mm);
	if (rc <= 0)
		return rc;
	rc = await_result(c, homing_ns + START_MOST_NS + deadman_ns, stop);
	return rc ? can_stepper_say_why(c, rc, what, err) : 0;
}

enum incise_stepper_state can_stepper_state(struct can_stepper *c)
{
	struct incise_stepper_status status;

	c->motor.stepper.ops->status(&c->motor.stepper, &status);
	return status.state;
}

static int can_enable(struct incise_motor *motor, struct incise_error *err)
{
	struct can_stepper *c = of(motor);

	switch (can_stepper_state(c)) {
	case INCISE_STEPPER_READY:
	case INCISE_STEPPER_MOVING:
		return 0;
	case INCISE_STEPPER_STOPPING:
		return -EBUSY;
	case INCISE_STEPPER_FAULT:
		can_stepper_say_why(c, -EPERM, "cannot be enabled", err);
		return -EPERM;
	default:
		return can_stepper_power(c, 0, NULL, "cannot be enabled", err);
	}
}

static int can_disable(struct incise_motor *motor)
{
	return can_thread_ask(&of(motor)->thread, CAN_THREAD_DISABLE);
}

static int can_clear(struct incise_motor *motor, struct incise_error *err)
{
	struct can_stepper *c = of(motor);
	int rc;

	if (can_stepper_state(c) != INCISE_STEPPER_FAULT)
		return can_stepper_state(c) == INCISE_STEPPER_STOPPING ? -EBUSY : 0;
	rc = can_thread_borrow(&c->thread, err);
	if (rc)
		return rc;
	rc = can_link_clear(&c->link, err);
	if (!rc)
		rc = incise_motion_clear(&c->link.axis.motion);
	incise_motion_publish(&c->link.axis.motion, now_of(c->link.bus));
	can_thread_give_back(&c->thread);
	return rc;
}

static INCISE_REALTIME int64_t can_now(struct incise_motor *motor)
{
	return now_of(of(motor)->link.bus);
}

static void can_close(struct incise_motor *motor)
{
	struct can_stepper *c = of(motor);

	if (c->thread.runs && !motor->watches)
		motor->stepper.ops->disable(&motor->stepper, NULL);
	can_thread_end(&c->thread);
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

static void stepper_info(const struct incise_stepper *stepper,
			 struct incise_stepper_info *info)
{
	const struct can_stepper *c = (const struct can_stepper *)stepper;

	c->motor_ops->info(stepper, info);
	/* What it measures is not what it was told: it follows. */
	info->within_mm = c->motor.actuator.can.following_mm;
	info->settle_s = c->motor.actuator.can.following_s;
	info->can_home = c->motor.actuator.can.homing_method != 0;
}

static int can_wait(struct incise_motor *motor, int64_t ns)
{
	can_thread_nap(&of(motor)->thread, ns);
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
	c->ops.home = can_stepper_home;
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
	bool real_time;
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
	/* So that a look at it, first of all, is not at nothing. */
	if (asked->watch)
		can_watch_cycle(&c->thread.watch, link);
	else
		incise_motion_publish(&link->axis.motion, now_of(link->bus));
	/* So that no first use of a page comes in a cycle. It may be refused. */
	mlock(c, sizeof(*c));
	rc = can_thread_start(&c->thread, &real_time);
	if (!real_time)
		snprintf(c->motor.name, sizeof(c->motor.name), "%.45s, not real-time",
			 link->where);
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
	c->thread.link = &c->link;
	c->thread.watches = asked->watch;
	c->thread.sleep_until = transport->sleep_until;
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
