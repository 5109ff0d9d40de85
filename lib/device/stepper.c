// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An actuator, whatever stands behind it; see incise/stepper.h.
 */
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <incise/backend.h>
#include "home.h"

/* What a backend has no function for. */
static int cannot(const struct incise_stepper *stepper, const char *what,
		  struct incise_error *err)
{
	struct incise_stepper_info info = {0};

	stepper->ops->info(stepper, &info);
	return incise_error_set(err, EOPNOTSUPP,
				"%s cannot be %s; name another backend in rig.conf",
				info.name, what);
}

int incise_stepper_set(struct incise_stepper *stepper, double position_mm)
{
	return stepper->ops->set(stepper, position_mm);
}

int incise_stepper_jog(struct incise_stepper *stepper, double velocity_mm_s)
{
	return stepper->ops->jog ? stepper->ops->jog(stepper, velocity_mm_s)
				 : -EOPNOTSUPP;
}

int incise_stepper_status(struct incise_stepper *stepper,
			  struct incise_stepper_status *status)
{
	return stepper->ops->status(stepper, status);
}

int incise_stepper_enable(struct incise_stepper *stepper, struct incise_error *err)
{
	return stepper->ops->enable ? stepper->ops->enable(stepper, err)
				    : cannot(stepper, "enabled", err);
}

int incise_stepper_disable(struct incise_stepper *stepper, struct incise_error *err)
{
	return stepper->ops->disable ? stepper->ops->disable(stepper, err)
				     : cannot(stepper, "disabled", err);
}

int incise_stepper_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	return stepper->ops->clear ? stepper->ops->clear(stepper, err)
				   : cannot(stepper, "cleared", err);
}

int incise_stepper_home(struct incise_stepper *stepper, const volatile int *stop,
			struct incise_error *err)
{
	return incise_stepper_home_edge(stepper, stop, NULL, err);
}

int incise_stepper_home_edge(struct incise_stepper *stepper, const volatile int *stop,
			     struct incise_stepper_edge_found *edge,
			     struct incise_error *err)
{
	const struct incise_stepper_ops *ops = stepper->ops;

	if (ops->home)
		return ops->home(stepper, stop, edge, err);
	if (!ops->jog || !ops->homing || !ops->edge || !ops->origin)
		return cannot(stepper, "homed: its position is the machine's", err);
	return incise_home(stepper, stop, edge, err);
}

void incise_stepper_info(const struct incise_stepper *stepper,
			 struct incise_stepper_info *info)
{
	stepper->ops->info(stepper, info);
}

int incise_stepper_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	struct incise_stepper_status status = {0};
	unsigned int faults;
	int length = 0;

	if (stepper->ops->cause)
		length = stepper->ops->cause(stepper, text, size);
	if (length > 0)
		return length;
	stepper->ops->status(stepper, &status);
	/* A target that was held stops nothing. */
	faults = status.faults & ~INCISE_STEPPER_TRAVEL
			 ? status.faults & ~INCISE_STEPPER_TRAVEL
			 : status.faults;
	return snprintf(text, size, "%s",
			faults ? incise_stepper_fault_text(
					 (enum incise_stepper_fault)(faults & -faults))
			       : "");
}

int incise_stepper_counter(struct incise_stepper *stepper, int i,
			   struct incise_stepper_counter *counter)
{
	return stepper->ops->counter && i >= 0
		       ? stepper->ops->counter(stepper, i, counter)
		       : -ENOENT;
}

const char *incise_stepper_state_name(enum incise_stepper_state state)
{
	switch (state) {
	case INCISE_STEPPER_DISABLED:
		return "disabled";
	case INCISE_STEPPER_READY:
		return "ready";
	case INCISE_STEPPER_MOVING:
		return "moving";
	case INCISE_STEPPER_STOPPING:
		return "stopping";
	case INCISE_STEPPER_FAULT:
		return "fault";
	}
	return "unknown";
}

const char *incise_stepper_fault_text(enum incise_stepper_fault fault)
{
	switch (fault) {
	case INCISE_STEPPER_DEADMAN:
		return "deadman: targets stopped coming; clear, and look at what drives "
		       "it";
	case INCISE_STEPPER_TRAVEL:
		return "travel: a target lay outside and was held";
	case INCISE_STEPPER_LIMIT_MIN:
		return "limit switch at 0: clear, enable and home";
	case INCISE_STEPPER_LIMIT_MAX:
		return "limit switch at the end of the travel: clear, enable and home";
	case INCISE_STEPPER_ESTOP:
		return "e-stop: release it, then clear";
	case INCISE_STEPPER_ALARM:
		return "alarm of the power stage: see what it says, switch it off and "
		       "on, then clear";
	case INCISE_STEPPER_LATE:
		return "late: this machine could not hold the step times; give a "
		       "smaller velocity_mm_s or a real-time kernel, then clear";
	case INCISE_STEPPER_SETPOINT:
		return "set-point that cannot be read: two programs drive it, or one "
		       "is broken; end it, then clear";
	case INCISE_STEPPER_OWNER:
		return "the program that drove it ended while it was powered: clear";
	case INCISE_STEPPER_SUSPEND:
		return "the machine went to sleep: clear, enable and home";
	case INCISE_STEPPER_GONE:
		return "the device went away: plug it in, or load its module again";
	case INCISE_STEPPER_LINE:
		return "a GPIO line cannot be written or read: see its wiring and the "
		       "kernel's log, then clear";
	case INCISE_STEPPER_BUS:
		return "the bus to the drive fails: see its cable, its ends and "
		       "`ip -details link show`, then clear";
	case INCISE_STEPPER_LOST:
		return "the drive is not heard any more, or began anew: see its power and "
		       "cable, then clear, enable and home";
	case INCISE_STEPPER_FOLLOWING:
		return "it does not follow its targets: see what blocks it, or give a "
		       "smaller acceleration_mm_s2, then clear";
	}
	return "unknown fault: see incise/stepper.h of the version in use";
}
