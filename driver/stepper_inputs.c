// SPDX-License-Identifier: GPL-2.0-only
/*
 * Limits, home, e-stop and the power stage's fault: their effects on a motor. Each is
 * looked at by its interrupt, if it has one, and at each tick; the limit ahead and the
 * e-stop just before each step as well, so that a lost interrupt costs one step at most.
 *
 *   e-stop, driver   a motor with power halts
 *   limit            it halts if it has a way to go towards it; away from there it may move,
 *                    and the step that arrives at it may be the last
 *   home             the position at its leading edge is kept, and with power compared with that
 *                    at homing. Without a home input, the lower limit is the home
 *
 * With debounce_ns, and power, a level counts when the looks have found it for so long; a pulse
 * that is shorter is none.
 *
 * All under motor->lock. A line that cannot be read counts as active, except home, which
 * keeps its state.
 */
#include <linux/gpio/consumer.h>

#include "stepper.h"

static bool stepper_inputs_towards(const struct stepper_motor *motor,
				   enum stepper_input limit)
{
	int direction = limit == STEPPER_LIMIT_MAX ? 1 : -1;

	/* Whether a way is left: the last step of a motion may end on the switch. */
	return motor->powered && motor->slot.dir == direction &&
	       (motor->given < motor->slot.n ||
		incise_profile_ahead(&motor->profile, direction));
}

static void stepper_inputs_act(struct stepper_motor *motor, enum stepper_input input,
			       s64 now)
{
	switch (input) {
	case STEPPER_LIMIT_MIN:
	case STEPPER_LIMIT_MAX:
		if (stepper_inputs_towards(motor, input))
			stepper_stop_fault(motor,
					   input == STEPPER_LIMIT_MIN
						   ? INCISE_STEPPER_FAULT_LIMIT_MIN
						   : INCISE_STEPPER_FAULT_LIMIT_MAX,
					   now);
		break;
	case STEPPER_ESTOP:
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_ESTOP, now);
		break;
	case STEPPER_DRIVER:
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_ALARM, now);
		break;
	case STEPPER_HOME:
	case STEPPER_INPUTS:
		break;
	}
}

/* The input whose edge is home. */
static enum stepper_input stepper_inputs_home(const struct stepper_motor *motor)
{
	return motor->lines.input[STEPPER_HOME] ? STEPPER_HOME : STEPPER_LIMIT_MIN;
}

/* The place of the home edge, as it is passed or where it is due. */
static void stepper_inputs_compare(struct stepper_motor *motor, bool passed, s64 position,
				   s64 now)
{
	if (motor->powered &&
	    incise_home_edge_look(&motor->edge, motor->flags & INCISE_STEPPER_FLAG_HOMED,
				  passed && motor->direction, position, motor->direction,
				  motor->config.lost_steps_max))
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_STEPS, now);
}

static void stepper_inputs_changed(struct stepper_motor *motor, enum stepper_input input,
				   bool active, s64 now)
{
	struct incise_stepper_event event = {
		.t_ns = now,
		.position = motor->position,
		.type = INCISE_STEPPER_EVENT_INPUT,
		.motor = motor->index,
	};
	s64 position = motor->since_ns[input] ? motor->since_position : motor->position;

	motor->inputs ^= 1U << input;
	event.value = motor->inputs;
	stepper_event_put(motor->stepper, &event);
	if (input == STEPPER_HOME && active) {
		motor->home_position = position;
		motor->flags |= INCISE_STEPPER_FLAG_HOME_SEEN;
	}
	if (input == stepper_inputs_home(motor) && active)
		stepper_inputs_compare(motor, true, position, now);
	motor->since_ns[input] = 0;
}

/* Whether what is seen is not to count yet. Without power nobody would look again. */
static bool stepper_inputs_bounces(struct stepper_motor *motor, enum stepper_input input,
				   bool differs, s64 now, bool edge)
{
	const struct incise_stepper_config *config = &motor->config;
	s64 *since = &motor->since_ns[input];

	if (!config->debounce_ns || !motor->powered ||
	    (input == STEPPER_ESTOP &&
	     !(config->flags & INCISE_STEPPER_CONFIG_DEBOUNCE_ESTOP)))
		return false;
	if (!differs) {
		*since = 0;
		return edge;
	}
	if (!*since || edge) {
		*since = now;
		if (input == stepper_inputs_home(motor))
			motor->since_position = motor->position;
	}
	return now - *since < config->debounce_ns;
}

/**
 * stepper_inputs_one() - look at one input
 * @motor:	its motor
 * @input: which; an input that the motor does not have is never active
 * @now:	ktime
 * @edge:	an interrupt says that it changed
 *
 * An interrupt that finds the line inactive as before came too late for a pulse, or after a
 * tick: the two look the same. For a stop a pulse is assumed, as it is long enough to be
 * meant. A limit and home would be reported where they are not.
 */
void stepper_inputs_one(struct stepper_motor *motor, enum stepper_input input, s64 now,
			bool edge)
{
	struct gpio_desc *line = motor->lines.input[input];
	bool was = motor->inputs & 1U << input;
	int value;

	if (!line)
		return;
	value = gpiod_get_value(line);
	if (value < 0) {
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_LINE, now);
		value = input == STEPPER_HOME ? was : 1;
	}
	if (stepper_inputs_bounces(motor, input, !!value != was, now, edge))
		return;
	if (edge && !value && !was &&
	    (input == STEPPER_ESTOP || input == STEPPER_DRIVER)) {
		stepper_inputs_changed(motor, input, true, now);
		stepper_inputs_act(motor, input, now);
		stepper_inputs_changed(motor, input, false, now);
	} else {
		if (!!value != was)
			stepper_inputs_changed(motor, input, value, now);
		if (value)
			stepper_inputs_act(motor, input, now);
	}
}

void stepper_inputs_sample(struct stepper_motor *motor, s64 now)
{
	enum stepper_input input;

	for (input = 0; input < STEPPER_INPUTS; input++)
		stepper_inputs_one(motor, input, now, false);
	/* An edge that may bounce may be there. */
	if (!motor->since_ns[stepper_inputs_home(motor)])
		stepper_inputs_compare(motor, false, motor->position, now);
}
