// SPDX-License-Identifier: GPL-2.0-only
/*
 * The status page: a slot per motor, which programs map read-only. The kernel is its
 * only writer, under motor->lock.
 *
 *   seq+1 ── fields ── seq+2        a reader takes its copy between two equal,
 *                                   even seq
 */
#include <asm/barrier.h>
#include <linux/compiler.h>

#include "stepper.h"

void stepper_status_state(struct stepper_motor *motor, u32 state, s64 now)
{
	struct incise_stepper_event event = {
		.t_ns = now,
		.position = motor->position,
		.type = INCISE_STEPPER_EVENT_STATE,
		.motor = motor->index,
		.value = state,
	};

	if (motor->state == state)
		return;
	motor->state = state;
	stepper_event_put(motor->stepper, &event);
}

void stepper_status_publish(struct stepper_motor *motor, s64 now)
{
	struct incise_stepper_motor_status *status =
		&motor->stepper->status[motor->index];
	u32 seq = status->seq;

	WRITE_ONCE(status->seq, seq + 1);
	smp_wmb(); /* seq before the fields */
	WRITE_ONCE(status->state, motor->state);
	WRITE_ONCE(status->faults, motor->faults);
	WRITE_ONCE(status->inputs, motor->inputs);
	WRITE_ONCE(status->t_ns, now);
	WRITE_ONCE(status->position, motor->position);
	WRITE_ONCE(status->velocity, incise_profile_velocity(&motor->profile));
	WRITE_ONCE(status->target, motor->target);
	WRITE_ONCE(status->setpoint_t_ns, motor->setpoint.t_ns);
	WRITE_ONCE(status->setpoint_seq, motor->setpoint.seq);
	WRITE_ONCE(status->flags, motor->flags);
	WRITE_ONCE(status->home_position, motor->home_position);
	WRITE_ONCE(status->steps_up, motor->steps_up);
	WRITE_ONCE(status->steps_down, motor->steps_down);
	WRITE_ONCE(status->late, motor->late);
	WRITE_ONCE(status->shifted_ns, motor->shifted_ns);
	WRITE_ONCE(status->lost_steps, motor->edge.lost);
	smp_wmb(); /* the fields before seq */
	WRITE_ONCE(status->seq, seq + 2);
}
