// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Homing of a drive, which finds its own 0: power away, homing mode, the drive's search, and
 * then in its own mode to where the travel begins. See incise_stepper_home().
 */
#include <errno.h>
#include <math.h>
#include "can_stepper.h"

#define HOME_MOST_NS (60 * INCISE_NS_PER_S)
#define POLL_NS 1000000

static int64_t now_of(const struct can_stepper *c)
{
	return c->link.bus->ops->now(c->link.bus);
}

/*
 * To where the travel begins, from the edge that homing ended at. Once the profile rests
 * there, the drive may be behind it for following_ms.
 */
static int go_to_begin(struct can_stepper *c, double home_mm, const volatile int *stop,
		       struct incise_error *err)
{
	struct incise_stepper *stepper = &c->motor.stepper;
	int64_t now = now_of(c), begin = now, end = begin + HOME_MOST_NS;
	int64_t rested = INT64_MAX, settle = c->link.axis.setup.following_ns;
	double to_mm = fmax(home_mm, 0);
	struct incise_stepper_status status;
	int rc;

	while (rested == INT64_MAX || now - rested < settle) {
		rc = stepper->ops->set(stepper, to_mm);
		if (rc)
			return can_stepper_say_why(c, rc, "homing", err);
		can_thread_nap(&c->thread, POLL_NS);
		stepper->ops->status(stepper, &status);
		now = now_of(c);
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

int can_stepper_home(struct incise_stepper *stepper, const volatile int *stop,
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
	if (can_stepper_state(c) != INCISE_STEPPER_READY &&
	    can_stepper_state(c) != INCISE_STEPPER_MOVING)
		return can_stepper_say_why(
			c,
			incise_error_set(err, EIO,
					 "homing %s: it is not powered; enable "
					 "it first",
					 c->motor.name),
			"homing", err);
	/* The mode changes where nothing moves. */
	rc = stepper->ops->disable(stepper, err);
	if (!rc)
		rc = can_stepper_power(c, most_ns, stop, "homing", err);
	if (rc == -EINTR)
		return incise_error_set(err, EINTR,
					"homing %s: stopped; its position is not that of "
					"the machine: home again",
					c->motor.name);
	if (!rc && (rc = stepper->ops->disable(stepper, err)) == 0)
		rc = can_thread_borrow(&c->thread, err);
	if (rc)
		return rc;
	rc = can_link_homed(&c->link, err);
	can_thread_give_back(&c->thread);
	if (!rc)
		rc = can_stepper_power(c, 0, NULL, "homing", err);
	if (!rc)
		rc = go_to_begin(c, actuator->home_mm, stop, err);
	if (!rc && edge)
		*edge = (struct incise_stepper_edge_found){NAN, actuator->home_mm};
	return rc;
}
