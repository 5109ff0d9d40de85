// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Looking at a drive; see can_watch.h.
 */
#include <errno.h>
#include <math.h>
#include <incise/clock.h>
#include "can_watch.h"

#define FRAMES 256
#define LISTEN_NS 200000000 /* without TPDOs for so long, nobody drives it */
#define STILL_STEPS_S 1	    /* slower is at rest */

static void listen(struct can_watch *watch, struct can_link *link, int64_t now)
{
	struct can_axis *axis = &link->axis;
	struct can_frame frame;
	uint32_t inputs;
	int64_t t_ns;

	for (int i = 0;
	     i < FRAMES && link->bus->ops->receive(link->bus, &frame, &t_ns) > 0; i++) {
		uint32_t function = canopen_handle(&link->master, &frame, t_ns);

		if (function == CANOPEN_TPDO1 &&
		    cia402_get(&frame, &axis->statusword, &axis->position))
			watch->heard_ns = now;
		else if (function == CANOPEN_TPDO2 && cia402_get_inputs(&frame, &inputs))
			can_axis_inputs(axis, inputs);
	}
}

static int ask(struct can_link *link)
{
	struct can_axis *axis = &link->axis;
	uint32_t word, counts, inputs;
	int rc = canopen_read(&link->master, 0x6041, 0, 2, &word);

	if (!rc)
		rc = canopen_read(&link->master, 0x6064, 0, 4, &counts);
	if (!rc && axis->setup.inputs)
		rc = canopen_read(&link->master, 0x60fd, 0, 4, &inputs);
	if (rc)
		return rc;
	if (axis->setup.inputs)
		can_axis_inputs(axis, inputs);
	axis->statusword = (uint16_t)word;
	axis->position = (int32_t)counts;
	return 0;
}

static unsigned int state_of(enum cia402_state state, bool moves)
{
	switch (state) {
	case CIA402_ENABLED:
		return moves ? INCISE_STEPPER_STATE_MOVING : INCISE_STEPPER_STATE_READY;
	case CIA402_QUICK_STOP:
	case CIA402_FAULT_REACTION:
		return INCISE_STEPPER_STATE_STOPPING;
	case CIA402_FAULT:
		return INCISE_STEPPER_STATE_FAULT;
	default:
		return INCISE_STEPPER_STATE_DISABLED;
	}
}

/* As far as the drive tells: what its owner latched, only that one knows. */
static void publish(struct can_watch *watch, struct can_link *link, int rc, int64_t now)
{
	struct can_axis *axis = &link->axis;
	struct incise_motion *m = &axis->motion;
	enum cia402_state state = cia402_state(axis->statusword);
	double at = (double)can_axis_steps(axis, axis->position);
	double dt = (double)(now - watch->looked_ns) / INCISE_NS_PER_S;
	bool moves = watch->looked_ns && dt > 0 &&
		     fabs(at - watch->position) > STILL_STEPS_S * dt;

	watch->looked_ns = now;
	watch->position = at;
	m->status.position = (int64_t)at;
	m->status.state = state_of(state, moves);
	m->status.faults = 0;
	if (rc)
		m->status.faults = INCISE_ABI_FAULT_LOST;
	else if (state == CIA402_FAULT)
		m->status.faults = INCISE_STEPPER_FAULT_DRIVER;
	if (m->status.faults)
		m->status.state = INCISE_STEPPER_STATE_FAULT;
	incise_motion_publish(m, now);
}

void can_watch_cycle(struct can_watch *watch, struct can_link *link)
{
	int64_t now = link->bus->ops->now(link->bus);
	int rc = 0;

	listen(watch, link, now);
	if (!watch->heard_ns || now - watch->heard_ns > LISTEN_NS)
		rc = ask(link);
	if (!rc && cia402_state(link->axis.statusword) == CIA402_FAULT)
		can_link_ask_why(link);
	else
		link->axis.why = CAN_AXIS_NO_REASON;
	publish(watch, link, rc, link->bus->ops->now(link->bus));
}
