// SPDX-License-Identifier: GPL-2.0-only
/*
 * Set-up by ioctl: enable, disable, clear, config, origin. The caller holds
 * stepper.mutex, so that only the motor's timer and its interrupts come between.
 *
 *   DISABLED ──(enable)──▶ READY ◀──▶ MOVING
 *       ▲                     └──(disable)──▶ STOPPING ──▶ DISABLED
 *       └──(clear)── FAULT
 */
#include <linux/atomic.h>
#include <linux/cpumask.h>
#include <linux/ktime.h>
#include <linux/math64.h>
#include <linux/minmax.h>
#include <linux/percpu.h>
#include <linux/smp.h>

#include "compat.h"
#include "stepper.h"
#include "trace.h"

static struct incise_profile_limits stepper_setup_limits(
	const struct incise_stepper_config *config)
{
	return (struct incise_profile_limits){
		.tick_ns = config->tick_ns,
		.velocity = config->velocity,
		.acceleration = config->acceleration,
		.position_min = config->position_min,
		.position_max = config->position_max,
		.jerk = config->jerk,
	};
}

/* Without power there are no ticks: an input without interrupts is read on request. */
static void stepper_setup_look(struct stepper_motor *motor)
{
	s64 now = ktime_get_ns();

	stepper_inputs_sample(motor, now);
	stepper_status_publish(motor, now);
}

/* motor->lock held. */
static int stepper_setup_allowed(const struct stepper_motor *motor)
{
	const u32 forbid = INCISE_STEPPER_LINE_ESTOP | INCISE_STEPPER_LINE_ALARM;

	if (motor->faults)
		return -ENOTRECOVERABLE;
	if (motor->disabling || motor->inputs & forbid)
		return -EBUSY;
	if (motor->position < motor->config.position_min ||
	    motor->position > motor->config.position_max)
		return -ERANGE;
	return 0;
}

/**
 * stepper_setup_ready() - whether a motor may be enabled
 * @motor:	the motor
 *
 * Return: 0; -ENOTRECOVERABLE a fault is latched; -EBUSY it is coming to rest, or an input
 * forbids it; -ERANGE it stands outside of its position limits.
 */
int stepper_setup_ready(struct stepper_motor *motor)
{
	unsigned long flags;
	int ret;

	raw_spin_lock_irqsave(&motor->lock, flags);
	stepper_setup_look(motor);
	ret = stepper_setup_allowed(motor);
	raw_spin_unlock_irqrestore(&motor->lock, flags);
	return ret;
}

/* Loads of the motors that have power, by processor; 2^20 is about all of its time. */
static DEFINE_PER_CPU(atomic_t, stepper_loads);
/* As motors of one controller may take: half for steps, and an eighth for ticks. */
#define LOAD_MAX (5 << 17)

/* The time that steps at the largest velocity, and ticks, take of a processor: 2^10 ns a second. */
static u32 stepper_setup_load(const struct stepper_motor *motor)
{
	const struct stepper *stepper = motor->stepper;
	const struct incise_stepper_config *config = &motor->config;
	u64 steps = (u64)stepper_page_busy_ns(config, &stepper->info) * config->velocity;
	u64 ticks = (u64)(stepper->tick_cost_ns / stepper->n_motors) *
		    (NSEC_PER_SEC / config->tick_ns);

	return (steps + ticks) >> 10;
}

/* On the processor of its timer. A controller alone is not refused: SET_CONFIG has bounded it. */
static int stepper_setup_take(struct stepper_motor *motor)
{
	const struct stepper *stepper = motor->stepper;
	int cpu = smp_processor_id();
	u32 load = stepper_setup_load(motor), own = load, all;
	unsigned int i;

	all = atomic_add_return(load, this_cpu_ptr(&stepper_loads));
	for (i = 0; i < stepper->n_motors; i++)
		if (READ_ONCE(stepper->motor[i].cpu) == cpu)
			own += READ_ONCE(stepper->motor[i].load);
	if (all > LOAD_MAX && all > own) {
		atomic_sub(load, this_cpu_ptr(&stepper_loads));
		return -ENOSPC;
	}
	motor->cpu = cpu;
	motor->load = load;
	return 0;
}

void stepper_setup_unload(struct stepper_motor *motor)
{
	atomic_sub(motor->load, per_cpu_ptr(&stepper_loads, motor->cpu));
	motor->load = 0;
}

struct stepper_enabling {
	struct stepper_motor *motor;
	int ret;
};

/*
 * Power, and the deadman from now on: 1. A motor that has power already goes on as it is:
 * 0. Else a negative errno. On the processor of its timer, with interrupts off.
 */
static void stepper_setup_power(void *data)
{
	struct stepper_enabling *enabling = data;
	struct stepper_motor *motor = enabling->motor;
	struct incise_profile_limits limits;
	unsigned long flags;
	int ret = 0;
	s64 now;

	raw_spin_lock_irqsave(&motor->lock, flags);
	if (motor->powered)
		goto unlock;
	/* Asked before, but an interrupt may have come since. */
	stepper_inputs_sample(motor, ktime_get_ns());
	ret = stepper_setup_allowed(motor);
	if (ret)
		goto unlock;
	limits = stepper_setup_limits(&motor->config);
	ret = incise_profile_init(&motor->profile, &limits, motor->position);
	if (!ret)
		ret = stepper_setup_take(motor);
	if (ret)
		goto unlock;
	ret = compat_gpiod_set_value(motor->lines.enable, 1);
	now = ktime_get_ns();
	if (ret < 0) {
		stepper_setup_unload(motor);
		goto unlock;
	}
	trace_incise_stepper_edge(motor->stepper->id, motor->index, STEPPER_ENABLE, 1,
				  now, now);

	motor->powered = true;
	motor->disabling = false;
	motor->powered_ns = now + motor->config.enable_ns;
	motor->base_ns = now;
	motor->slot = (struct incise_profile_slot){.tick_ns = motor->config.tick_ns};
	motor->given = 0;
	motor->late_row = 0;
	memset(motor->since_ns, 0, sizeof(motor->since_ns));
	motor->direction = 0; /* written before the first step, whatever it is */
	motor->target = motor->position;
	motor->asked = false;
	/* The page still has the values of the previous owner. */
	motor->setpoint = (struct stepper_setpoint){
		.seq = READ_ONCE(motor->stepper->setpoints[motor->index].seq),
	};
	motor->seen_ns = now;
	motor->flags &= ~(INCISE_STEPPER_FLAG_HELD | INCISE_STEPPER_FLAG_HOME_SEEN);
	stepper_status_state(motor, INCISE_STEPPER_STATE_READY, now);
	stepper_status_publish(motor, now);
	stepper_motor_start(motor);
	ret = 1;
unlock:
	raw_spin_unlock_irqrestore(&motor->lock, flags);
	enabling->ret = ret;
}

/* stepper_setup_power() where the motor's timer is to fire. Sleeps not, and has interrupts on. */
int stepper_setup_enable(struct stepper_motor *motor)
{
	struct stepper_enabling enabling = {.motor = motor};
	int cpu = motor->config.cpu ? motor->config.cpu - 1 : raw_smp_processor_id();
	int ret = smp_call_function_single(cpu, stepper_setup_power, &enabling, true);

	return ret ? ret : enabling.ret;
}

void stepper_setup_disable(struct stepper_motor *motor)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&motor->lock, flags);
	stepper_stop_disable(motor, ktime_get_ns());
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}

/* 0; -EBUSY: it has power, or the cause of the fault is still there. */
int stepper_setup_clearable(struct stepper_motor *motor)
{
	const u32 causes = INCISE_STEPPER_LINE_ESTOP | INCISE_STEPPER_LINE_ALARM;
	unsigned long flags;
	int ret = 0;

	raw_spin_lock_irqsave(&motor->lock, flags);
	stepper_setup_look(motor);
	if (motor->faults && (motor->powered || motor->inputs & causes))
		ret = -EBUSY;
	raw_spin_unlock_irqrestore(&motor->lock, flags);
	return ret;
}

void stepper_setup_clear(struct stepper_motor *motor)
{
	unsigned long flags;
	s64 now;

	raw_spin_lock_irqsave(&motor->lock, flags);
	if (motor->faults && !motor->powered) {
		now = ktime_get_ns();
		motor->faults = 0;
		stepper_status_state(motor, INCISE_STEPPER_STATE_DISABLED, now);
		stepper_status_publish(motor, now);
	}
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}

/**
 * stepper_setup_config() - new limits and times
 * @motor:	the motor
 * @config:	one that stepper_page_config() let pass
 *
 * Return: 0; -EBUSY the motor has power, or a plan; -ERANGE a jerk that the profile cannot
 * hold.
 */
int stepper_setup_config(struct stepper_motor *motor,
			 const struct incise_stepper_config *config)
{
	struct incise_profile_limits limits = stepper_setup_limits(config);
	unsigned long flags;
	int ret;

	if (config->cpu > nr_cpu_ids)
		return -EINVAL;
	raw_spin_lock_irqsave(&motor->lock, flags);
	if (motor->powered || motor->plan) {
		ret = -EBUSY;
	} else {
		/* Refused before anything is changed. */
		ret = incise_profile_init(&motor->profile, &limits, config->position_min);
	}
	if (!ret) {
		motor->config = *config;
		motor->interval_ns =
			div_u64(NSEC_PER_SEC + config->velocity - 1, config->velocity);
		/*
		 * An edge is late by what its firing costs: only more catches up. An eighth
		 * of a step is not felt.
		 */
		motor->catch_ns = (motor->interval_ns >> 3) + motor->stepper->firing_ns;
		motor->lag_ns =
			max(motor->catch_ns, (s64)motor->stepper->info.lateness_ns) +
			motor->stepper->tick_cost_ns;
		incise_profile_halt(&motor->profile, motor->position);
		stepper_status_publish(motor, ktime_get_ns());
	}
	raw_spin_unlock_irqrestore(&motor->lock, flags);
	return ret;
}

void stepper_setup_get_config(struct stepper_motor *motor,
			      struct incise_stepper_config *config)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&motor->lock, flags);
	*config = motor->config;
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}

/* Name the place where it stands. home_position is renamed with it. */
int stepper_setup_position(struct stepper_motor *motor,
			   const struct incise_stepper_origin *origin)
{
	unsigned long flags;
	int ret = 0;
	s64 now;

	raw_spin_lock_irqsave(&motor->lock, flags);
	now = ktime_get_ns();
	if (origin->position < motor->config.position_min ||
	    origin->position > motor->config.position_max) {
		ret = -EINVAL;
	} else if (motor->powered && (motor->disabling || motor->following ||
				      motor->given < motor->slot.n ||
				      !incise_profile_resting(&motor->profile))) {
		ret = -EBUSY;
	} else {
		motor->home_position += origin->position - motor->position;
		incise_home_edge_rename(&motor->edge, origin->position - motor->position,
					origin->homed);
		motor->position = origin->position;
		motor->target = origin->position;
		motor->asked = false;
		motor->setpoint.mode = INCISE_STEPPER_MODE_POSITION;
		motor->flags &= ~INCISE_STEPPER_FLAG_HOMED;
		if (origin->homed)
			motor->flags |= INCISE_STEPPER_FLAG_HOMED;
		incise_profile_halt(&motor->profile, motor->position);
		stepper_status_publish(motor, now);
	}
	raw_spin_unlock_irqrestore(&motor->lock, flags);
	return ret;
}

void stepper_setup_fault(struct stepper_motor *motor, u32 fault)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&motor->lock, flags);
	stepper_stop_fault(motor, fault, ktime_get_ns());
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}

bool stepper_setup_any_powered(struct stepper *stepper)
{
	bool powered = false;
	unsigned long flags;
	unsigned int i;

	for (i = 0; i < stepper->n_motors && !powered; i++) {
		raw_spin_lock_irqsave(&stepper->motor[i].lock, flags);
		powered = stepper->motor[i].powered;
		raw_spin_unlock_irqrestore(&stepper->motor[i].lock, flags);
	}
	return powered;
}

/* At once, whatever it does: when there is no time to brake. */
void stepper_setup_halt(struct stepper_motor *motor)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&motor->lock, flags);
	if (motor->powered)
		stepper_stop_halt(motor, ktime_get_ns());
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}
