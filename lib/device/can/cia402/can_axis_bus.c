// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What an axis hears on the bus and what it sends there; see axis_cycle.h.
 *
 * A part of one noun: tests/unit/can/can_axis.c tests it through its door.
 */
#include <errno.h>
#include "can_axis_cycle.h"

#define FRAMES 64   /* taken in a cycle: more than a bus carries in 2 ms */
#define FULL_MOST 5 /* set-points in a row that may not get out */
#define SMOOTH 0.25 /* of a new speed, in its average */

/* What the drive's inputs are to us. */
static unsigned int line_bits(const struct can_axis *axis, uint32_t inputs)
{
	/* Turned round, the drive's lower end is our upper one. */
	bool turned = axis->setup.counts_per_step < 0;
	unsigned int bits = 0;

	if (inputs & CIA402_AT_MIN)
		bits |= turned ? INCISE_STEPPER_LINE_LIMIT_MAX
			       : INCISE_STEPPER_LINE_LIMIT_MIN;
	if (inputs & CIA402_AT_MAX)
		bits |= turned ? INCISE_STEPPER_LINE_LIMIT_MIN
			       : INCISE_STEPPER_LINE_LIMIT_MAX;
	if (inputs & CIA402_AT_HOME)
		bits |= INCISE_STEPPER_LINE_HOME;
	if (inputs & CIA402_INTERLOCK)
		bits |= INCISE_STEPPER_LINE_ESTOP;
	return bits & axis->setup.wired;
}

void can_axis_inputs(struct can_axis *axis, uint32_t inputs)
{
	struct incise_abi_status *status = &axis->motion.status;
	unsigned int came;

	came = line_bits(axis, inputs) & ~status->inputs;
	status->inputs = line_bits(axis, inputs);
	if (came & INCISE_STEPPER_LINE_HOME) {
		status->home_position = status->position;
		status->flags |= INCISE_STEPPER_FLAG_HOME_SEEN;
	}
}

static void take_status(struct can_axis *axis, const struct can_frame *frame, int64_t now)
{
	int32_t before = axis->position;

	if (!cia402_get(frame, &axis->statusword, &axis->position))
		return;
	if (axis->heard)
		axis->speed += SMOOTH * ((double)axis->position - before - axis->speed);
	axis->heard = axis->answered = axis->came = true;
	axis->tpdo_ns = now;
	axis->motion.status.position = can_axis_steps(axis, axis->position);
}

void can_axis_hear(struct can_axis *axis, int64_t now)
{
	struct can_bus *bus = axis->master->bus;
	struct can_frame frame;
	uint32_t inputs;
	int64_t t_ns;
	int rc = 0;

	for (int i = 0; i < FRAMES; i++) {
		rc = bus->ops->receive(bus, &frame, &t_ns);
		if (rc <= 0)
			break;
		switch (canopen_handle(axis->master, &frame, t_ns)) {
		case CANOPEN_TPDO1:
			take_status(axis, &frame, now);
			break;
		case CANOPEN_TPDO2:
			if (cia402_get_inputs(&frame, &inputs)) {
				can_axis_inputs(axis, inputs);
				axis->inputs_ns = 0;
			}
			break;
		}
	}
	if (rc < 0)
		can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_BUS_FAILED, -rc, 0,
			       now);
}

void can_axis_put(struct can_axis *axis, uint16_t controlword, int32_t target,
		  int64_t now)
{
	struct can_bus *bus = axis->master->bus;
	struct can_frame frame;
	int rc;

	cia402_put(&frame, axis->master->node, axis->setup.mode, controlword, target);
	rc = bus->ops->send(bus, &frame);
	axis->put = !rc;
	if (!rc) {
		axis->full = 0;
		axis->counts.setpoints++;
	} else if (rc == -ENOBUFS) {
		if (++axis->full > FULL_MOST)
			can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_QUEUE_FULL,
				       axis->full, 0, now);
	} else {
		can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_BUS_FAILED, -rc, 0,
			       now);
	}
}

void can_axis_sync(struct can_axis *axis, int64_t now)
{
	const struct can_frame frame = {.can_id = CANOPEN_SYNC};
	struct can_bus *bus = axis->master->bus;

	/* A set-point that no SYNC follows is none: the drive goes on as it did. */
	axis->answered = bus->ops->send(bus, &frame) != 0;
	axis->put = axis->put && !axis->answered;
	axis->unsynced = axis->answered ? axis->unsynced + 1 : 0;
	if (axis->unsynced > FULL_MOST)
		can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_QUEUE_FULL,
			       axis->unsynced, 0, now);
}
