// SPDX-License-Identifier: GPL-2.0-only
/*
 * What this machine can do, measured at bind, without moving anything: a hard timer
 * fires SHOTS times, and each time the step lines are written with the value that they
 * have. A config that asks for more is refused.
 *
 *   due ─────── lateness ──────▶│◀─ edge ─▶│
 *                              fires       line has changed
 *
 * With L the lateness that 99 % of shots keep and E the median cost of an edge, the
 * shortest pulse is p = L + E: below that edges would be late by more than their own
 * length. The largest rate is
 *
 *                  10⁹
 *   rate = ─────────────────────       M median lateness, n motors
 *          max(2p + L, 4n(E + M))
 *
 * First: high and low last p each, and their first edge may be late by L. Second: a step
 * is two firings, each of which costs the processor an edge and the way into the
 * interrupt; n motors share one processor, and shall leave half of it to others.
 */
#include <linux/device.h>
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

struct stepper_trial {
	struct hrtimer timer;
	struct stepper *stepper;
	int n; /* shots so far */
	u32 late_ns[SHOTS];
	u32 edge_ns[SHOTS];
};

static enum hrtimer_restart stepper_ability_fire(struct hrtimer *timer)
{
	struct stepper_trial *trial = container_of(timer, struct stepper_trial, timer);
	struct stepper *stepper = trial->stepper;
	struct gpio_desc *line =
		stepper->motor[trial->n % stepper->n_motors].lines.step;
	s64 due = ktime_to_ns(hrtimer_get_expires(timer));
	s64 fired = ktime_get_ns(), written;

	compat_gpiod_set_value(line, 0);
	written = ktime_get_ns();
	trial->late_ns[trial->n] = min(fired - due, (s64)U32_MAX);
	trial->edge_ns[trial->n] = min(written - fired, (s64)U32_MAX);
	/* Read by the one who waits for the last. */
	smp_store_release(&trial->n, trial->n + 1);
	if (trial->n == SHOTS)
		return HRTIMER_NORESTART;
	/* From now: a shot that was very late must not make the next ones late too. */
	hrtimer_forward(timer, ns_to_ktime(written), ns_to_ktime(SHOT_NS));
	return HRTIMER_RESTART;
}

static int stepper_ability_compare(const void *a, const void *b)
{
	u32 x = *(const u32 *)a, y = *(const u32 *)b;

	return x < y ? -1 : x > y;
}

/* Fill in info.rate_max, edge_ns, lateness_ns, lateness_max_ns, resolution_ns. Sleeps. */
int stepper_ability_measure(struct stepper *stepper)
{
	struct incise_stepper_info *info = &stepper->info;
	struct stepper_trial *trial;
	u64 pulses, share;
	u32 median;

	trial = kzalloc(sizeof(*trial), GFP_KERNEL);
	if (!trial)
		return -ENOMEM;
	trial->stepper = stepper;
	hrtimer_setup(&trial->timer, stepper_ability_fire, CLOCK_MONOTONIC,
		      HRTIMER_MODE_ABS_PINNED_HARD);
	hrtimer_start(&trial->timer, ktime_add_ns(ktime_get(), SHOT_NS),
		      HRTIMER_MODE_ABS_PINNED_HARD);
	while (smp_load_acquire(&trial->n) < SHOTS)
		usleep_range(2000, 5000);
	hrtimer_cancel(&trial->timer);

	sort(trial->late_ns, SHOTS, sizeof(u32), stepper_ability_compare, NULL);
	sort(trial->edge_ns, SHOTS, sizeof(u32), stepper_ability_compare, NULL);
	median = trial->late_ns[SHOTS / 2];
	info->resolution_ns = hrtimer_resolution;
	info->edge_ns = max(trial->edge_ns[SHOTS / 2], 1U);
	info->lateness_ns = trial->late_ns[SHOTS * 99 / 100];
	info->lateness_max_ns = trial->late_ns[SHOTS - 1];
	kfree(trial);

	pulses = 2ULL * info->edge_ns + 3ULL * info->lateness_ns;
	share = 4ULL * stepper->n_motors * ((u64)info->edge_ns + median);
	info->rate_max = clamp(div64_u64(NSEC_PER_SEC, max(pulses, share)), 1ULL,
			       (u64)INCISE_PROFILE_VELOCITY_MAX);
	return 0;
}
