// SPDX-License-Identifier: GPL-2.0-only
/*
 * The limits of this machine, measured at bind without moving anything: a hard timer
 * fires SHOTS times, and each time does what a tick and a leading edge do to the lines: it
 * reads all inputs of a motor, and writes its step line with the value that it has. SET_CONFIG
 * refuses a config that asks for more.
 *
 *   due ─────── lateness ──────▶│◀─ inputs ─▶│◀─ write ─▶│
 *                              fires                     line has changed
 *
 * Then it fires SHOTS times more, each PULSE_NS behind the write of the one before, as edges
 * of pulses do, and computes when the next one is due: with C the median of what a firing
 * costs then, from when it is due to its write, and a 16th more, and W the least lateness, the
 * way into the interrupt and about that out of it, a step takes
 *
 *   high + low + 2(C + 2W)     with two firings
 *   high + low + C + W + E     with one that waits for the end of the pulse
 *
 * With L the lateness that 99 % of shots keep, M its median and E the median cost of a
 * shot, the shortest pulse is p = E + M: below that most edges would be late by more than
 * their own length. The largest rate is
 *
 *                     10⁹
 *   rate = ───────────────────────────       D = 2(C + 2W)
 *          max(2p + S, 7/4 (S + p))          one motor
 *          max(2p + S, 2nD)                  n motors
 *
 * with S the shorter of the two costs of a step. First: high and low last p each. Second: the steps
 * of one motor, with a pulse that is waited for, shall take four sevenths of the processor at most.
 * The steps of n motors, with two firings, take half of it: beyond that, ticks that coincide
 * with steps put motions off.
 *
 * Motors that stand cost ticks. With T the median cost of a shot and of what a tick
 * computes, the ticks of n motors shall take a quarter of the processor at most:
 *
 *   tick = 4n(T + 2W)
 *
 * A machine that was not quiet in one round gets another: its load just then, for example the
 * loading of modules, is not its load later.
 */
#include <linux/device.h>
#include <linux/gpio/consumer.h>
#include <linux/hrtimer.h>
#include <linux/kernel.h>
#include <linux/ktime.h>
#include <linux/math64.h>
#include <linux/slab.h>
#include <linux/sort.h>
#include <linux/delay.h>

#include "compat.h"
#include "stepper.h"

#define SHOTS 512
#define SHOT_NS 100000
#define ROUNDS 3
#define QUIET_NS 20000
#define PULSE_NS 1000

struct stepper_trial {
	struct hrtimer timer;
	struct stepper *stepper;
	int n; /* shots so far */
	u32 late_ns[SHOTS];
	u32 edge_ns[SHOTS];
	u32 tick_ns[SHOTS];
	u32 close_ns[SHOTS]; /* of firings one pulse behind another */
	u32 seen;	     /* inputs: their reading is not left out */
	struct incise_profile_slot slot;
	struct stepper_setpoint setpoint;
};

static void stepper_ability_shot(struct stepper_trial *trial,
				 const struct stepper_lines *lines)
{
	enum stepper_input input;

	for (input = 0; input < STEPPER_INPUTS; input++)
		if (lines->input[input])
			trial->seen += gpiod_get_value(lines->input[input]);
	compat_gpiod_set_value(lines->step, 0);
}

/* The work of a tick for a moving motor. No step of it is given out. */
static void stepper_ability_tick(struct stepper_trial *trial, struct stepper_motor *motor)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&motor->lock, flags);
	trial->setpoint.seq = U32_MAX; /* every slot is new */
	stepper_page_take(&motor->stepper->setpoints[motor->index], &trial->setpoint);
	incise_profile_tick(&motor->profile, &trial->slot);
	stepper_status_publish(motor, ktime_get_ns());
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}

static enum hrtimer_restart stepper_ability_fire(struct hrtimer *timer)
{
	struct stepper_trial *trial = container_of(timer, struct stepper_trial, timer);
	struct stepper *stepper = trial->stepper;
	s64 due = ktime_to_ns(hrtimer_get_expires(timer));
	struct stepper_motor *motor = &stepper->motor[trial->n % stepper->n_motors];
	s64 fired = ktime_get_ns(), written, ticked;
	int close = trial->n - SHOTS;

	if (close >= 0) {
		stepper_ability_shot(trial, &motor->lines);
		written = ktime_get_ns();
		trial->close_ns[close] = min(written - due, (s64)U32_MAX);
		stepper_motor_compute(motor);
		/* The side that waits for the last reads them. */
		smp_store_release(&trial->n, trial->n + 1);
		if (close == SHOTS - 1)
			return HRTIMER_NORESTART;
		hrtimer_set_expires(timer, ns_to_ktime(written + PULSE_NS));
		return HRTIMER_RESTART;
	}
	stepper_ability_shot(trial, &motor->lines);
	written = ktime_get_ns();
	stepper_ability_tick(trial, motor);
	ticked = ktime_get_ns();
	trial->late_ns[trial->n] = min(fired - due, (s64)U32_MAX);
	trial->edge_ns[trial->n] = min(written - fired, (s64)U32_MAX);
	trial->tick_ns[trial->n] = min(ticked - fired, (s64)U32_MAX);
	trial->n++;
	/* From now: a shot that was very late must not make the next ones late too. */
	hrtimer_forward(timer, ns_to_ktime(ticked), ns_to_ktime(SHOT_NS));
	return HRTIMER_RESTART;
}

static int stepper_ability_compare(const void *a, const void *b)
{
	u32 x = *(const u32 *)a, y = *(const u32 *)b;

	return x < y ? -1 : x > y;
}

/* SHOTS shots, sorted. Sleeps. */
static void stepper_ability_round(struct stepper_trial *trial)
{
	trial->n = 0;
	hrtimer_start(&trial->timer, ktime_add_ns(ktime_get(), SHOT_NS),
		      HRTIMER_MODE_ABS_PINNED_HARD);
	/* Pairs with the release in the timer. */
	while (smp_load_acquire(&trial->n) < 2 * SHOTS)
		usleep_range(2000, 5000);
	hrtimer_cancel(&trial->timer);
	sort(trial->late_ns, SHOTS, sizeof(u32), stepper_ability_compare, NULL);
	sort(trial->edge_ns, SHOTS, sizeof(u32), stepper_ability_compare, NULL);
	sort(trial->tick_ns, SHOTS, sizeof(u32), stepper_ability_compare, NULL);
	sort(trial->close_ns, SHOTS, sizeof(u32), stepper_ability_compare, NULL);
}

/* Fill in the results of the self-test in info. Sleeps. */
int stepper_ability_measure(struct stepper *stepper)
{
	const struct incise_profile_limits limits = {
		.tick_ns = INCISE_PROFILE_TICK_MAX_NS,
		.velocity = 1,
		.acceleration = 1,
		.position_max = INCISE_PROFILE_POSITION_MAX,
		.jerk = 0,
	};
	struct incise_stepper_controller *info = &stepper->info;
	u64 pulse = U32_MAX, tick = U32_MAX, late = U32_MAX, close = U32_MAX, way = 0;
	u64 period, share;
	struct stepper_trial *trial;
	int round, ret = 0;
	unsigned int i;

	trial = kzalloc(sizeof(*trial), GFP_KERNEL);
	if (!trial)
		return -ENOMEM;
	trial->stepper = stepper;
	for (i = 0; i < stepper->n_motors && !ret; i++) {
		ret = incise_profile_init(&stepper->motor[i].profile, &limits, 0);
		/* Too far to arrive while it is measured. */
		incise_profile_target(&stepper->motor[i].profile, INCISE_PROFILE_POSITION,
				      INCISE_PROFILE_POSITION_MAX);
	}
	if (ret) {
		kfree(trial);
		return ret;
	}
	stepper_latency_hold(stepper);
	hrtimer_setup(&trial->timer, stepper_ability_fire, CLOCK_MONOTONIC,
		      HRTIMER_MODE_ABS_PINNED_HARD);
	for (round = 0; round < ROUNDS && late > QUIET_NS; round++) {
		stepper_ability_round(trial);
		/* The latest of all counts, whatever the round. */
		info->lateness_max_ns =
			max(info->lateness_max_ns, trial->late_ns[SHOTS - 1]);
		if (trial->late_ns[SHOTS * 99 / 100] >= late)
			continue;
		late = trial->late_ns[SHOTS * 99 / 100];
		info->edge_ns = trial->edge_ns[SHOTS / 2];
		pulse = (u64)info->edge_ns + trial->late_ns[SHOTS / 2];
		way = trial->late_ns[0];
		tick = (u64)trial->tick_ns[SHOTS / 2] + 2 * way;
		close = (u64)trial->close_ns[SHOTS / 2] * 17 / 16;
	}
	stepper_latency_release(stepper);
	kfree(trial);

	stepper->firing_ns = min_t(u64, close, U32_MAX);
	info->step_ns = min_t(u64, 2 * (close + 2 * way), U32_MAX);
	info->wait_step_ns = min_t(u64, close + way + info->edge_ns, U32_MAX);
	period = min(info->step_ns, info->wait_step_ns);
	share = stepper->n_motors > 1 ? 2ULL * stepper->n_motors * info->step_ns
				      : (period + pulse) * 7 / 4;
	period = max(2 * pulse + period, share);
	info->rate_max = clamp(div64_u64(NSEC_PER_SEC, max(period, 1ULL)), 1ULL,
			       (u64)INCISE_PROFILE_VELOCITY_MAX);
	info->resolution_ns = hrtimer_resolution;
	info->lateness_ns = late;
	stepper->tick_cost_ns = min_t(u64, stepper->n_motors * tick, U32_MAX);
	/* The limits of a config. */
	info->pulse_ns = clamp(pulse, 500ULL, 1000000ULL);
	info->tick_min_ns =
		clamp(4 * stepper->n_motors * tick, (u64)INCISE_PROFILE_TICK_MIN_NS,
		      (u64)INCISE_PROFILE_TICK_MAX_NS);
	return 0;
}
