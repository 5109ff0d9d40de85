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
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include "../../../base/monotonic.h"
#include "../../../rig/backends.h"
#include "../../../rig/motor.h"
#include "../../../rig/thread.h"
#include "can_session.h"
#include "can_stepper.h"

#define MS 1000000LL
#define START_MOST_NS \
	(3 * INCISE_NS_PER_S) /* with start_ms and the deadman: longer than any start */
#define HOME_MOST_NS (60 * INCISE_NS_PER_S)
#define POLL_NS MS
#define IDLE_LOOK_NS (2 * MS) /* period of looking at the mailbox without power */
#define ANSWER_NS INCISE_NS_PER_S
#define POST_POLL_NS 250000

enum command {
	NONE,
	DISABLE,
	LEND,
	RETURN,
	END,
};

/*
 * The thread owns the bus: it runs a cycle of the axis at each period while the drive has
 * power, less often without. One caller at a time has the mailbox, and borrows the bus for SDOs.
 *
 *   caller   ── lend ─▶ (SDOs) ── give back ─▶
 *   thread   ══cycles══╡        ╞══cycles══════
 */
struct can_stepper {
	struct incise_motor motor;
	struct incise_stepper_ops ops; /* the motor's, some replaced by a drive's */
	const struct incise_stepper_ops *motor_ops;
	/* The two pages. */
	_Alignas(64) struct incise_stepper_setpoint setpoint;
	_Alignas(64) struct incise_stepper_motor_status status;
	/* Mailbox: written by the caller while it is NONE, else by the thread. */
	_Alignas(64) atomic_int command;
	/* With a simulated clock; NULL: there is a thread. See can_bus.h. */
	void (*sleep_until)(struct can_bus *bus, int64_t t_ns);
	int64_t due_ns, idle_ns; /* the next cycle; the next without power */
	bool lent, ended, runs;
	pthread_t thread;
	/* The thread's, or lent to a caller. */
	_Alignas(64) struct can_session session;
};

static struct can_stepper *can_stepper_of(struct incise_motor *motor)
{
	return (struct can_stepper *)motor;
}

static int64_t now_of(const struct can_stepper *c)
{
	return c->session.bus->ops->now(c->session.bus);
}

/* --- the thread --- */

static void obey(struct can_stepper *c)
{
	switch (atomic_load_explicit(&c->command, memory_order_acquire)) {
	case NONE:
		return;
	case DISABLE:
		can_axis_disable(&c->session.axis);
		break;
	case LEND:
		c->lent = true;
		break;
	case RETURN:
		c->lent = false;
		c->due_ns = now_of(c);
		break;
	case END:
		c->ended = true;
		break;
	}
	atomic_store_explicit(&c->command, NONE, memory_order_release);
}

/* Without power, and while the bus is borrowed: the mailbox, and sometimes a cycle. */
static int64_t idle(struct can_stepper *c)
{
	int64_t now = now_of(c), heartbeat_ns = c->session.master.heartbeat_ns;

	if (!c->lent && now >= c->idle_ns) {
		if (c->motor.watches)
			can_session_watch_cycle(&c->session);
		else
			can_axis_cycle(&c->session.axis, now, 0, 0);
		/* The drive's deadman expires after four heartbeats. */
		c->idle_ns = now + (heartbeat_ns > 0 && heartbeat_ns < CAN_AXIS_IDLE_NS
					    ? heartbeat_ns
					    : CAN_AXIS_IDLE_NS);
	}
	c->due_ns = now_of(c);
	return c->due_ns + IDLE_LOOK_NS;
}

/*
 * Run the cycle that is due; returns the time of the next call. Cycles are due at start + n
 * periods; those that are late by a period or more are left out.
 */
static int64_t step_can_stepper(struct can_stepper *c)
{
	struct can_axis *axis = &c->session.axis;
	int64_t cycle = axis->setup.config.tick_ns, now;
	uint32_t left_out = 0;

	obey(c);
	if (c->lent || !axis->motion.powered)
		return idle(c);
	now = now_of(c);
	if (now < c->due_ns)
		return c->due_ns;
	left_out = (uint32_t)((now - c->due_ns) / cycle);
	c->due_ns += left_out * cycle;
	can_axis_cycle(axis, now, now - c->due_ns, left_out);
	c->due_ns += cycle;
	return c->due_ns;
}

static void *thread_run(void *argument)
{
	struct can_stepper *c = argument;

	while (!c->ended)
		incise_monotonic_sleep_until(step_can_stepper(c));
	return NULL;
}

/* With a simulated clock the thread's work is done here. */
static void nap(struct can_stepper *c, int64_t ns)
{
	int64_t end = now_of(c) + ns, due;

	if (!c->sleep_until) {
		incise_monotonic_sleep_until(end);
		return;
	}
	do {
		due = step_can_stepper(c);
		c->sleep_until(c->session.bus, due < end ? due : end);
	} while (now_of(c) < end);
}

/* --- the callers' side of the mailbox --- */

static int post(struct can_stepper *c, enum command command)
{
	/* A look at a drive that is watched takes up to three SDOs. */
	int64_t end = now_of(c) + ANSWER_NS + 3 * c->session.master.answer_ns;

	atomic_store_explicit(&c->command, command, memory_order_release);
	while (atomic_load_explicit(&c->command, memory_order_acquire) != NONE) {
		if (now_of(c) > end)
			return -EIO;
		nap(c, POST_POLL_NS);
	}
	return 0;
}

static int borrow(struct can_stepper *c, struct incise_error *err)
{
	int rc = post(c, LEND);

	return rc ? incise_error_set(err, -rc,
				     "%s: its thread does not answer; end this program",
				     c->session.name)
		  : 0;
}

static void give_back(struct can_stepper *c)
{
	post(c, RETURN);
}

static int start_can_stepper_thread(struct can_stepper *c, bool *real_time)
{
	int rc = 0;

	*real_time = true;
	c->due_ns = c->idle_ns = now_of(c);
	if (!c->sleep_until && c->motor.watches)
		rc = -pthread_create(&c->thread, NULL, thread_run, c);
	else if (!c->sleep_until)
		rc = incise_thread_start(&c->thread, thread_run, c, real_time);
	c->runs = !rc;
	return rc;
}

static void end_thread(struct can_stepper *c)
{
	if (!c->runs)
		return;
	atomic_store_explicit(&c->command, END, memory_order_release);
	if (!c->sleep_until)
		pthread_join(c->thread, NULL);
	c->runs = false;
}

/* --- functions of the motor --- */

/* Wait until powering or homing has ended. */
static int await_result(struct can_stepper *c, int64_t most_ns, const volatile int *stop)
{
	int64_t end = now_of(c) + most_ns;
	bool stopped = false;

	while (c->session.axis.result == 1) {
		if (now_of(c) > end)
			return -ETIMEDOUT;
		if (stop && *stop && !stopped) {
			stopped = true;
			post(c, DISABLE);
		}
		nap(c, POLL_NS);
	}
	return c->session.axis.result;
}

/* Make the message from the cause of the last stop, else from its faults; returns @rc without either. */
static int refuse_by_cause(struct can_stepper *c, int rc, const char *what,
			   struct incise_error *err)
{
	char why[300];

	unsigned int faults = c->motor.last.faults;

	if (!can_axis_cause_text(&c->session.axis, why, sizeof(why))) {
		if (!faults)
			return rc;
		snprintf(why, sizeof(why), "%s",
			 incise_stepper_fault_text(
				 (enum incise_stepper_fault)(faults & -faults)));
	}
	return incise_error_set(err, -rc, "%s: %s: %s", c->motor.name, what, why);
}

/* Power the drive in its mode, or home for at most so long; wait for the end of that. */
static int power(struct can_stepper *c, int64_t homing_ns, const volatile int *stop,
		 const char *what, struct incise_error *err)
{
	int64_t deadman_ns = (int64_t)(c->motor.actuator.deadman_s * INCISE_NS_PER_S);
	struct can_axis *axis = &c->session.axis;
	int rc = borrow(c, err);

	if (rc)
		return rc;
	/* This reads a current statusword: the last one may be 20 ms old. */
	rc = can_session_ready(&c->session, homing_ns > 0, err);
	if (!rc)
		rc = can_axis_power(axis, now_of(c), homing_ns);
	give_back(c);
	if (rc == -ERANGE)
		return incise_error_set(err, ERANGE,
					"%s: is at %.3f mm, outside its travel: home "
					"it, or move it back by hand",
					c->motor.name,
					(double)axis->motion.status.position *
						axis->setup.step_mm);
	if (rc <= 0)
		return rc;
	rc = await_result(
		c, homing_ns + START_MOST_NS + axis->setup.start_ns + deadman_ns, stop);
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
	struct can_stepper *c = can_stepper_of(motor);

	switch (state_of(c)) {
	case INCISE_STEPPER_STATE_READY:
	case INCISE_STEPPER_STATE_MOVING:
		return 0;
	case INCISE_STEPPER_STATE_STOPPING:
		return -EBUSY;
	case INCISE_STEPPER_STATE_FAULT:
		refuse_by_cause(c, -EPERM, "cannot be enabled", err);
		return -EPERM;
	default:
		return power(c, 0, NULL, "cannot be enabled", err);
	}
}

static int can_disable(struct incise_motor *motor)
{
	return motor->watches ? -EPERM : post(can_stepper_of(motor), DISABLE);
}

static int can_clear(struct incise_motor *motor, struct incise_error *err)
{
	struct can_stepper *c = can_stepper_of(motor);
	int rc;

	if (state_of(c) != INCISE_STEPPER_STATE_FAULT)
		return state_of(c) == INCISE_STEPPER_STATE_STOPPING ? -EBUSY : 0;
	rc = borrow(c, err);
	if (rc)
		return rc;
	rc = can_session_clear(&c->session, err);
	if (!rc)
		rc = incise_motion_clear(&c->session.axis.motion);
	incise_motion_publish(&c->session.axis.motion, now_of(c));
	give_back(c);
	return rc;
}

static INCISE_REALTIME int64_t can_now(struct incise_motor *motor)
{
	return now_of(can_stepper_of(motor));
}

static void can_close(struct incise_motor *motor)
{
	struct can_stepper *c = can_stepper_of(motor);

	if (c->runs && !motor->watches)
		motor->stepper.ops->disable(&motor->stepper, NULL);
	end_thread(c);
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
	if (!(status.faults & ~INCISE_STEPPER_FAULT_TRAVEL))
		return 0;
	/* After a standstill the caller may run before the drive's thread does. */
	if (!can_axis_cause_text(&c->session.axis, why, sizeof(why)) &&
	    !(c->motor.still_ns &&
	      can_axis_still_text(c->motor.still_ns, why, sizeof(why))))
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
		{"setpoints_sent", "setpoints sent", axis->setpoints, false},
		{"sync_late", "SYNCs late by half a cycle", axis->sync_late, true},
		{"tpdo_missing", "SYNCs without an answer", axis->tpdo_missing, true},
		{"bus_errors", "error frames", bus->errors, true},
		{"bus_offs", "times bus-off", c->session.master.bus_offs, true},
		{"frames_lost", "frames lost before they were read", bus->overflow, true},
		{"sends_refused", "frames lost in a full queue", bus->full, true},
		{"lines_broken", "invalid data received", bus->broken, true},
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
	int64_t now = now_of(c), begin = now, end = begin + HOME_MOST_NS;
	int64_t rested = INT64_MAX, settle = c->session.axis.setup.following_ns;
	double to_mm = fmax(home_mm, 0);
	struct incise_stepper_status status;
	int rc;

	while (rested == INT64_MAX || now - rested < settle) {
		rc = stepper->ops->set(stepper, to_mm);
		if (rc)
			return refuse_by_cause(c, rc, "homing", err);
		nap(c, POLL_NS);
		stepper->ops->status(stepper, &status);
		now = now_of(c);
		if (stop && *stop)
			return incise_error_set(err, EINTR, "homing %s: stopped",
						c->motor.name);
		if (now > end)
			return incise_error_set(err, ETIMEDOUT,
						"homing %s: it does not reach %g mm; "
						"check that it moves",
						c->motor.name, to_mm);
		if (rested == INT64_MAX && c->motor.last.setpoint_t_ns >= begin &&
		    status.state == INCISE_STEPPER_STATE_READY)
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
					"homing %s: no homing_method in actuator.can "
					"of rig.conf; give the drive's, for example 17",
					c->motor.name);
	if (c->motor.watches)
		return incise_error_set(err, EPERM,
					"homing %s: it was opened only to "
					"watch",
					c->motor.name);
	if (state_of(c) != INCISE_STEPPER_STATE_READY &&
	    state_of(c) != INCISE_STEPPER_STATE_MOVING)
		return refuse_by_cause(
			c,
			incise_error_set(err, EIO,
					 "homing %s: it is off; enable it first",
					 c->motor.name),
			"homing", err);
	/* Change the mode only at rest. */
	rc = stepper->ops->disable(stepper, err);
	if (!rc)
		rc = power(c, most_ns, stop, "homing", err);
	if (rc == -EINTR)
		return incise_error_set(err, EINTR,
					"homing %s: stopped; its position is unknown: "
					"home again",
					c->motor.name);
	if (!rc && (rc = stepper->ops->disable(stepper, err)) == 0)
		rc = borrow(c, err);
	if (rc)
		return rc;
	rc = can_session_homed(&c->session, err);
	give_back(c);
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
	nap(can_stepper_of(motor), ns);
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
	c->ops.attach = NULL;
	c->motor.stepper.ops = &c->ops;
}

static int set_up_can_stepper(struct can_stepper *c,
			      const struct can_transport *transport,
			      const struct incise_backend_request *request,
			      struct incise_error *err)
{
	struct can_session *session = &c->session;
	bool real_time;
	int rc;

	session->axis.motion.setpoint = &c->setpoint;
	session->axis.motion.slot = &c->status;
	rc = request->watch ? can_session_watch(session, transport, request, err)
			    : can_session_open(session, transport, request, err);
	if (rc)
		return rc;
	c->motor.actuator = session->actuator;
	c->motor.lines = session->axis.setup.wired;
	snprintf(c->motor.name, sizeof(c->motor.name), "%s", session->name);
	/* The first status is valid from the start. */
	if (request->watch)
		can_session_watch_cycle(session);
	else
		incise_motion_publish(&session->axis.motion, now_of(c));
	/* No page fault in a cycle; mlock() may be refused. */
	mlock(c, sizeof(*c));
	rc = start_can_stepper_thread(c, &real_time);
	if (!real_time)
		snprintf(c->motor.name, sizeof(c->motor.name), "%.45s, not real-time",
			 session->name);
	return rc ? incise_error_set(err, -rc, "%s: cannot begin: %s", c->motor.name,
				     strerror(-rc))
		  : 0;
}

void *can_stepper_open(const struct can_transport *transport,
		       const struct incise_backend_request *request,
		       struct incise_error *err)
{
	static const struct incise_motor_ops ops = {
		.enable = can_enable,
		.disable = can_disable,
		.clear = can_clear,
		.close = can_close,
		.now = can_now,
		.wait = can_wait,
	};
	struct can_stepper *c = incise_backend_alloc(sizeof(*c), request->where, err);
	int rc;

	if (!c)
		return NULL;
	c->sleep_until = transport->sleep_until;
	c->motor.ops = &ops;
	c->motor.in_process = true;
	c->motor.watches = request->watch;
	c->motor.setpoint = &c->setpoint;
	c->motor.slot = &c->status;
	incise_motor_init(&c->motor);
	set_ops(c);
	rc = set_up_can_stepper(c, transport, request, err);
	if (!rc)
		return &c->motor.stepper;
	can_close(&c->motor);
	errno = -rc;
	return NULL;
}
