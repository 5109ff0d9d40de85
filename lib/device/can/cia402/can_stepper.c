// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A drive on a CAN bus as a stepper; see can_stepper.h. A drive homes by itself: power off,
 * homing mode, the drive's search, then in its own mode to the start of the travel.
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
#define HOME_MOST_NS (60 * INCISE_NS_PER_S)
#define POLL_NS MS

static struct can_stepper *of(struct incise_motor *motor)
{
	return (struct can_stepper *)motor;
}

static int64_t now_of(struct can_bus *bus)
{
	return bus->ops->now(bus);
}

/* Wait until powering or homing has ended. */
static int await_result(struct can_stepper *c, int64_t most_ns, const volatile int *stop)
{
	int64_t end = now_of(c->session.bus) + most_ns;
	bool stopped = false;

	while (c->session.axis.result == 1) {
		if (now_of(c->session.bus) > end)
			return -ETIMEDOUT;
		if (stop && *stop && !stopped) {
			stopped = true;
			can_thread_ask(&c->thread, CAN_THREAD_DISABLE);
		}
		can_thread_nap(&c->thread, POLL_NS);
	}
	return c->session.axis.result;
}

/* Make the message from the cause of the last stop; returns @rc if there is none. */
static int refuse_by_cause(struct can_stepper *c, int rc, const char *what,
			   struct incise_error *err)
{
	char why[300];

	if (!can_axis_cause_text(&c->session.axis, why, sizeof(why)))
		return rc;
	return incise_error_set(err, -rc, "%s: %s: %s", c->motor.name, what, why);
}

/* Power the drive in its mode, or home for at most so long; wait for the end of that. */
static int power(struct can_stepper *c, int64_t homing_ns, const volatile int *stop,
		 const char *what, struct incise_error *err)
{
	int64_t deadman_ns = (int64_t)(c->motor.actuator.deadman_s * INCISE_NS_PER_S);
	struct can_axis *axis = &c->session.axis;
	int rc = can_thread_borrow(&c->thread, err);

	if (rc)
		return rc;
	/* This reads a current statusword: the last one may be 20 ms old. */
	rc = can_session_ready(&c->session, homing_ns > 0, err);
	if (!rc)
		rc = can_axis_power(axis, now_of(c->session.bus), homing_ns);
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
	return rc ? refuse_by_cause(c, rc, what, err) : 0;
}

static enum incise_stepper_state state_of(struct can_stepper *c)
{
	struct incise_stepper_status status;

	c->motor.stepper.ops->status(&c->motor.stepper, &status);
	return status.state;
}

static int can_enable(struct incise_motor *motor, struct incise_error *err)
{
	struct can_stepper *c = of(motor);

	switch (state_of(c)) {
	case INCISE_STEPPER_READY:
	case INCISE_STEPPER_MOVING:
		return 0;
	case INCISE_STEPPER_STOPPING:
		return -EBUSY;
	case INCISE_STEPPER_FAULT:
		refuse_by_cause(c, -EPERM, "cannot be enabled", err);
		return -EPERM;
	default:
		return power(c, 0, NULL, "cannot be enabled", err);
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

	if (state_of(c) != INCISE_STEPPER_FAULT)
		return state_of(c) == INCISE_STEPPER_STOPPING ? -EBUSY : 0;
	rc = can_thread_borrow(&c->thread, err);
	if (rc)
		return rc;
	rc = can_session_clear(&c->session, err);
	if (!rc)
		rc = incise_motion_clear(&c->session.axis.motion);
	incise_motion_publish(&c->session.axis.motion, now_of(c->session.bus));
	can_thread_give_back(&c->thread);
	return rc;
}

static INCISE_REALTIME int64_t can_now(struct incise_motor *motor)
{
	return now_of(of(motor)->session.bus);
}

static void can_close(struct incise_motor *motor)
{
	struct can_stepper *c = of(motor);

	if (c->thread.runs && !motor->watches)
		motor->stepper.ops->disable(&motor->stepper, NULL);
	can_thread_end(&c->thread);
	can_session_close(&c->session);
	free(c);
}

/* --- functions of a drive that a plain motor does not have --- */

static int stepper_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	struct can_stepper *c = (struct can_stepper *)stepper;
	struct incise_stepper_status status;
	char why[300];

	stepper->ops->status(stepper, &status);
	if (!(status.faults & ~INCISE_STEPPER_TRAVEL) ||
	    !can_axis_cause_text(&c->session.axis, why, sizeof(why)))
		return 0;
	return snprintf(text, size, "%s: %s", c->motor.name, why);
}

static int stepper_counter(struct incise_stepper *stepper, int i,
			   struct incise_stepper_counter *counter)
{
	const struct can_stepper *c = (const struct can_stepper *)stepper;
	const struct can_bus_counts *bus = &c->session.bus->counts;
	const struct can_axis_counts *axis = &c->session.axis.counts;
	const struct incise_stepper_counter counters[] = {
		{"setpoints_sent", "set-points sent", axis->setpoints, false},
		{"sync_late", "SYNCs late by half a cycle", axis->sync_late, true},
		{"tpdo_missing", "SYNCs without an answer", axis->tpdo_missing, true},
		{"bus_errors", "error frames", bus->errors, true},
		{"bus_offs", "times bus-off", c->session.master.bus_offs, true},
		{"frames_lost", "frames lost before they were read", bus->overflow, true},
		{"sends_refused", "frames that the queue had no room for", bus->full,
		 true},
		{"lines_broken", "what came and was no frame", bus->broken, true},
		{"emergencies", "emergency messages", c->session.master.emcy.count, true},
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
	/* The drive follows its targets with a lag. */
	info->within_mm = c->motor.actuator.can.following_mm;
	info->settle_s = c->motor.actuator.can.following_s;
	info->can_home = c->motor.actuator.can.homing_method != 0;
}

/*
 * Move from the edge where homing ended to the start of the travel. Once the profile rests
 * there, the drive may lag for following_ms.
 */
static int go_to_start(struct can_stepper *c, double home_mm, const volatile int *stop,
		       struct incise_error *err)
{
	struct incise_stepper *stepper = &c->motor.stepper;
	int64_t now = now_of(c->session.bus), begin = now, end = begin + HOME_MOST_NS;
	int64_t rested = INT64_MAX, settle = c->session.axis.setup.following_ns;
	double to_mm = fmax(home_mm, 0);
	struct incise_stepper_status status;
	int rc;

	while (rested == INT64_MAX || now - rested < settle) {
		rc = stepper->ops->set(stepper, to_mm);
		if (rc)
			return refuse_by_cause(c, rc, "homing", err);
		can_thread_nap(&c->thread, POLL_NS);
		stepper->ops->status(stepper, &status);
		now = now_of(c->session.bus);
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
	if (c->motor.watches)
		return incise_error_set(err, EPERM, "homing %s: it was opened to watch",
					c->motor.name);
	if (state_of(c) != INCISE_STEPPER_READY && state_of(c) != INCISE_STEPPER_MOVING)
		return refuse_by_cause(
			c,
			incise_error_set(err, EIO,
					 "homing %s: it is not powered; enable "
					 "it first",
					 c->motor.name),
			"homing", err);
	/* Change the mode only at rest. */
	rc = stepper->ops->disable(stepper, err);
	if (!rc)
		rc = power(c, most_ns, stop, "homing", err);
	if (rc == -EINTR)
		return incise_error_set(err, EINTR,
					"homing %s: stopped; its position is not that of "
					"the machine: home again",
					c->motor.name);
	if (!rc && (rc = stepper->ops->disable(stepper, err)) == 0)
		rc = can_thread_borrow(&c->thread, err);
	if (rc)
		return rc;
	rc = can_session_homed(&c->session, err);
	can_thread_give_back(&c->thread);
	if (!rc)
		rc = power(c, 0, NULL, "homing", err);
	if (!rc)
		rc = go_to_start(c, actuator->home_mm, stop, err);
	if (!rc && edge)
		*edge = (struct incise_stepper_edge_found){NAN, actuator->home_mm};
	return rc;
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
	c->ops.home = stepper_home;
	/* It homes by itself: homing by the computer is not offered. */
	c->ops.homing = NULL;
	c->ops.edge = NULL;
	c->ops.origin = NULL;
	c->motor.stepper.ops = &c->ops;
}

static int set_up(struct can_stepper *c, const struct can_transport *transport,
		  const struct incise_backend_request *asked, struct incise_error *err)
{
	struct can_session *session = &c->session;
	bool real_time;
	int rc;

	session->axis.motion.setpoint = &c->setpoint;
	session->axis.motion.slot = &c->status;
	rc = asked->watch ? can_session_watch(session, transport, asked, err)
			  : can_session_open(session, transport, asked, err);
	if (rc)
		return rc;
	c->motor.actuator = session->actuator;
	c->motor.lines = session->axis.setup.wired;
	snprintf(c->motor.name, sizeof(c->motor.name), "%s", session->name);
	/* The first status is valid from the start. */
	if (asked->watch)
		can_session_watch_cycle(session);
	else
		incise_motion_publish(&session->axis.motion, now_of(session->bus));
	/* No page fault in a cycle; mlock() may be refused. */
	mlock(c, sizeof(*c));
	rc = can_thread_start(&c->thread, &real_time);
	if (!real_time)
		snprintf(c->motor.name, sizeof(c->motor.name), "%.45s, not real-time",
			 session->name);
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
	c->thread.session = &c->session;
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
