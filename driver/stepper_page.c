// SPDX-License-Identifier: GPL-2.0-only
/*
 * Taking a set-point. The owner may write the page at any moment, on another
 * processor, and may write anything: every field is read once, into a copy, and only the
 * copy is looked at.
 *
 *   owner    seq+1 ── fields ── seq+2
 *   kernel   seq ───── copy of 64 bytes ───── seq       even, new, and the same: taken
 */
#include "stepper_page.h"

#ifdef __KERNEL__
#include <asm/barrier.h>
#include <linux/compiler.h>
#include <linux/kernel.h>
#include <linux/errno.h>
#include <linux/math64.h>
#else
#include <errno.h>
/* The same names in a program; a test has a READ_ONCE() of its own. */
#define ARRAY_SIZE(array) (sizeof(array) / sizeof((array)[0]))
#ifndef READ_ONCE
#define READ_ONCE(x) __atomic_load_n(&(x), __ATOMIC_RELAXED)
#endif
#define smp_rmb() __atomic_thread_fence(__ATOMIC_ACQUIRE) /* loads before loads */
#endif

#include <incise/tool.h>
#include "../lib/fixed/profile.h"

#define SLOT_WORDS (sizeof(struct incise_stepper_setpoint) / sizeof(__u64))

/* A slot as words and as the struct. A word that is torn, on 32 bits, has another seq behind it. */
union slot_copy {
	__u64 word[SLOT_WORDS];
	struct incise_stepper_setpoint setpoint;
};

/* Everything but a target, or everything but a pose and its time: zero. */
static bool stepper_page_good(const struct incise_stepper_setpoint *copy)
{
	const __u32 known = INCISE_STEPPER_POSE_TOOL | INCISE_STEPPER_POSE_FADE;
	unsigned int i;

	if (copy->mode == INCISE_STEPPER_MODE_POSE)
		return !copy->reserved0 && !copy->target && !copy->pose.reserved &&
		       !(copy->pose.tool & ~known) &&
		       (copy->pose.tool & INCISE_STEPPER_POSE_TOOL) <= INCISE_TOOL_TUBE;
	for (i = 0; i < ARRAY_SIZE(copy->reserved); i++)
		if (copy->reserved[i])
			return false;
	return copy->mode <= INCISE_STEPPER_MODE_VELOCITY && !copy->reserved0;
}

/**
 * stepper_page_take() - look for a new set-point
 * @slot:	in the page, aligned to 8 bytes
 * @setpoint:	the last one taken; a new one has another seq
 *
 * A slot whose seq is odd for ever gives nothing for ever, and the deadman acts.
 * Garbage is reported once per seq.
 */
enum stepper_page_answer stepper_page_take(const struct incise_stepper_setpoint *slot,
					   struct stepper_setpoint *setpoint)
{
	const union slot_copy *from = (const union slot_copy *)slot;
	union slot_copy copy;
	__u32 seq = READ_ONCE(slot->seq);
	unsigned int i;

	if (seq & 1 || seq == setpoint->seq)
		return STEPPER_PAGE_NOTHING;
	smp_rmb(); /* with the owner's barrier between the fields and seq+2 */
	for (i = 0; i < SLOT_WORDS; i++)
		copy.word[i] = READ_ONCE(from->word[i]);
	smp_rmb(); /* with the owner's barrier between seq+1 and the fields */
	if (READ_ONCE(slot->seq) != seq)
		return STEPPER_PAGE_NOTHING;

	setpoint->seq = seq;
	if (!stepper_page_good(&copy.setpoint))
		return STEPPER_PAGE_GARBAGE;
	setpoint->mode = copy.setpoint.mode;
	setpoint->target = copy.setpoint.target;
	setpoint->t_ns = copy.setpoint.t_ns;
	setpoint->pose = copy.setpoint.pose;
	return STEPPER_PAGE_TAKEN;
}

/**
 * stepper_page_clamp() - the target within a motor's limits
 * @setpoint:	the request
 * @config:	a config that stepper_page_config() let pass
 */
__s64 stepper_page_clamp(const struct stepper_setpoint *setpoint,
			 const struct incise_stepper_config *config)
{
	__s64 min = config->position_min, max = config->position_max;

	if (setpoint->mode == INCISE_STEPPER_MODE_VELOCITY) {
		max = config->velocity;
		min = -max;
	}
	if (setpoint->target < min)
		return min;
	return setpoint->target > max ? max : setpoint->target;
}

static bool stepper_page_within(__u64 value, __u64 min, __u64 max)
{
	return value >= min && value <= max;
}

static bool stepper_page_waits(const struct incise_stepper_config *config)
{
	return config->high_ns <= INCISE_STEPPER_WAIT_MAX_NS &&
	       !(config->flags & INCISE_STEPPER_CONFIG_NO_WAIT);
}

/* The time that a step takes of the processor. */
__u32 stepper_page_busy_ns(const struct incise_stepper_config *config,
			   const struct incise_stepper_controller *info)
{
	return stepper_page_waits(config) ? config->high_ns + info->wait_step_ns
					  : info->step_ns;
}

/* The largest velocity with the pulses of a config: steps/s. */
__u32 stepper_page_velocity(const struct incise_stepper_config *config,
			    const struct incise_stepper_controller *info)
{
	__u64 step = (__u64)config->high_ns + config->low_ns +
		     (stepper_page_waits(config) ? info->wait_step_ns : info->step_ns);

	return div64_u64(1000000000ULL, step ? step : 1);
}

/**
 * stepper_page_config() - whether a config can be held on this machine
 * @config:	from a user
 * @info:	what the self-test found
 *
 * A pulse that is shorter than a timer mostly is late would make every edge late;
 * SET_CONFIG refuses it rather than hold it by luck.
 *
 * Return: 0; -EINVAL, -ERANGE as INCISE_STEPPER_SET_CONFIG says.
 */
int stepper_page_config(const struct incise_stepper_config *config,
			const struct incise_stepper_controller *info)
{
	const __u32 flags = INCISE_STEPPER_CONFIG_INVERT | INCISE_STEPPER_CONFIG_RETRACT |
			    INCISE_STEPPER_CONFIG_VOLATILE_HOME |
			    INCISE_STEPPER_CONFIG_NO_WAIT |
			    INCISE_STEPPER_CONFIG_DEBOUNCE_ESTOP;
	const __s64 most = INCISE_PROFILE_POSITION_MAX;
	unsigned int i;

	for (i = 0; i < ARRAY_SIZE(config->reserved); i++)
		if (config->reserved[i])
			return -EINVAL;
	if (config->motor >= info->n_motors || config->flags & ~flags ||
	    config->debounce_ns > 100000000 ||
	    !stepper_page_within(config->tick_ns, INCISE_PROFILE_TICK_MIN_NS,
				 INCISE_PROFILE_TICK_MAX_NS) ||
	    !config->velocity || !config->acceleration ||
	    !stepper_page_within(config->late_max, 1, 1000) ||
	    !stepper_page_within(config->deadman_ns, 1000000, 10000000000ULL) ||
	    !stepper_page_within(config->high_ns, 500, 1000000) ||
	    !stepper_page_within(config->low_ns, 500, 1000000) ||
	    config->setup_ns > 1000000 || config->hold_ns > 1000000 ||
	    config->enable_ns > 1000000000)
		return -EINVAL;
	if (config->lost_steps_max > most || config->position_min < -most ||
	    config->position_max > most || config->position_min > config->position_max ||
	    config->safe_position < config->position_min ||
	    config->safe_position > config->position_max)
		return -EINVAL;
	if (config->velocity > info->rate_max ||
	    config->velocity > INCISE_PROFILE_VELOCITY_MAX ||
	    config->tick_ns < info->tick_min_ns)
		return -ERANGE;
	if (config->high_ns < info->pulse_ns || config->low_ns < info->pulse_ns ||
	    config->velocity > stepper_page_velocity(config, info))
		return -ERANGE;
	return 0;
}
