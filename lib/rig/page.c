// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Slots in shared memory; see page.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stddef.h>
#include <incise/haptic_page.h>
#include <incise/tick_flags.h>
#include <incise/tool.h>
#include "../fixed/profile.h"
#include "page.h"

/* A write takes some 20 ns: after so many tries the writer was interrupted. */
#define TRIES 100

#define KNOWN_FAULTS ((1U << INCISE_STEPPER_FAULTS) - 1 - INCISE_STEPPER_FAULT_TRAVEL)
#define KNOWN_INPUTS ((1U << INCISE_STEPPER_INPUTS) - 1)

void incise_page_put_setpoint(struct incise_stepper_setpoint *slot, unsigned int mode,
			      int64_t target, int64_t t_ns)
{
	struct incise_stepper_setpoint setpoint = {
		.mode = (__u16)mode, .target = target, .t_ns = t_ns};

	incise_haptic_page_put(slot, &setpoint, sizeof(setpoint));
}

void incise_page_put_pose(struct incise_stepper_setpoint *slot,
			  const struct incise_stepper_pose *pose, int64_t t_ns)
{
	struct incise_stepper_setpoint setpoint = {
		.mode = INCISE_STEPPER_MODE_POSE, .t_ns = t_ns, .pose = *pose};

	incise_haptic_page_put(slot, &setpoint, sizeof(setpoint));
}

int incise_page_get_setpoint(const struct incise_stepper_setpoint *slot, uint32_t *seq,
			     struct incise_stepper_setpoint *copy)
{
	if (__atomic_load_n(&slot->seq, __ATOMIC_RELAXED) == *seq ||
	    !incise_haptic_page_get(slot, copy, sizeof(*copy)) || copy->seq == *seq)
		return 0;
	*seq = copy->seq;
	if (copy->mode > INCISE_STEPPER_MODE_VELOCITY || copy->reserved0)
		return -EINVAL;
	for (size_t i = 0; i < sizeof(copy->reserved) / sizeof(*copy->reserved); i++)
		if (copy->reserved[i])
			return -EINVAL;
	return 1;
}

void incise_page_put_status(struct incise_stepper_motor_status *slot,
			    const struct incise_stepper_motor_status *status)
{
	incise_haptic_page_put(slot, status, sizeof(*status));
}

/* False: it was being written at each try. */
static INCISE_REALTIME bool get_whole(const void *slot, void *copy, uint32_t bytes)
{
	for (int i = 0; i < TRIES; i++)
		if (incise_haptic_page_get(slot, copy, bytes))
			return true;
	return false;
}

static bool sensible(const struct incise_stepper_motor_status *status)
{
	const int64_t most = 2LL * INCISE_PROFILE_POSITION_MAX;
	const int64_t fastest = (INCISE_PROFILE_VELOCITY_MAX + 1LL) << 16;

	return status->state <= INCISE_STEPPER_STATE_FAULT &&
	       !(status->faults & ~KNOWN_FAULTS) && !(status->inputs & ~KNOWN_INPUTS) &&
	       status->position >= -most && status->position <= most &&
	       status->home_position >= -most && status->home_position <= most &&
	       status->velocity >= -fastest && status->velocity <= fastest;
}

int incise_page_get_status(const struct incise_stepper_motor_status *slot,
			   struct incise_stepper_motor_status *copy)
{
	struct incise_stepper_motor_status status;

	if (!get_whole(slot, &status, sizeof(status)))
		return -EAGAIN;
	if (!sensible(&status))
		return -EIO;
	*copy = status;
	return 0;
}

static bool plan_sensible(const struct incise_stepper_plan_status *status)
{
	return status->state < INCISE_STEPPER_PLAN_STATES &&
	       !(status->reasons >> INCISE_STEPPER_PLAN_REASONS) &&
	       !(status->motors >> INCISE_STEPPER_MOTORS_MAX) &&
	       !(status->flags >> INCISE_TICK_FLAGS) &&
	       status->phase <= INCISE_PHASE_INSERTION &&
	       status->held <= INCISE_TOOL_TUBE;
}

int incise_page_get_plan(const struct incise_stepper_plan_status *slot,
			 struct incise_stepper_plan_status *copy)
{
	struct incise_stepper_plan_status status;

	if (!get_whole(slot, &status, sizeof(status)))
		return -EAGAIN;
	if (!plan_sensible(&status))
		return -EIO;
	*copy = status;
	return 0;
}
