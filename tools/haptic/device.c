// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A haptic device before the loop and after it; see haptic.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../cli/cli.h"
#include "haptic.h"

#define AGE_MOST_MS 1000
#define AGES_S 0.5 /* for which ages are measured at the start */

/* The mean age of the newest pose at the loop's ticks, ms, without a force. NAN: no pose came. */
static double measure_age(struct haptic *haptic, const struct incise_tracker_info *info)
{
	struct incise_tracker *tracker = incise_rig_tracker(haptic->rig);
	struct incise_clock *clock = incise_rig_clock(haptic->rig);
	int64_t period_ns = llrint(INCISE_NS_PER_S / haptic->loop.rate_hz);
	int64_t now_ns = incise_clock_now(clock), newest_ns = 0;
	struct incise_tracker_sample samples[32];
	int ticks = (int)(AGES_S * haptic->loop.rate_hz), n;
	struct incise_haptic_ages ages = {0};
	char cause[300];

	for (int i = 0; i < ticks && !cli_stop; i++) {
		incise_clock_wait_until(clock, now_ns + period_ns);
		now_ns = incise_clock_now(clock);
		n = incise_tracker_read(tracker, samples, 32);
		if (n < 0) {
			incise_tracker_cause(tracker, cause, sizeof(cause));
			cli_fail("%s: %s", info->name, *cause ? cause : strerror(-n));
		}
		if (n)
			newest_ns = samples[n - 1].t_ns - info->latency_ns;
		if (newest_ns)
			incise_haptic_ages_add(&ages, newest_ns, now_ns);
	}
	return ages.ticks ? ages.mean_ms : NAN;
}

/* A plan must not assume younger poses than there are: the check is made with their real age. */
static void check_ages(struct haptic *haptic)
{
	struct incise_tracker_info info;
	struct incise_error err = {0};
	double assumed_ms, mean_ms, half_ms;
	char cause[300];

	incise_tracker_info(incise_rig_tracker(haptic->rig), &info);
	half_ms = 0.5e3 / info.rate_hz;
	assumed_ms = (double)info.latency_ns * 1e-6 + 2 * half_ms;
	mean_ms = measure_age(haptic, &info);
	if (isnan(mean_ms)) {
		incise_tracker_cause(incise_rig_tracker(haptic->rig), cause,
				     sizeof(cause));
		cli_fail("%s: no pose came within %g s%s%s", info.name, AGES_S,
			 *cause ? ": " : "", cause);
	}
	if (mean_ms > AGE_MOST_MS)
		cli_fail("%s: its poses have times of %.3g ms ago: they are not of "
			 "CLOCK_MONOTONIC; correct its owner",
			 info.name, mean_ms);
	cli_note("%s: poses are %.2f ms old in the mean; the plan assumes %.2f",
		 info.name, mean_ms, assumed_ms);
	if (mean_ms <= assumed_ms)
		return;
	incise_rig_haptic_assume(haptic->rig, llrint((mean_ms - half_ms) * 1e6));
	incise_plan_free(haptic->plan);
	haptic->plan = haptic_plan(haptic, haptic->scene, &err);
	if (!haptic->plan)
		cli_fail("measured %.2f ms, the plan assumed %.2f: %s", mean_ms,
			 assumed_ms, err.text);
	cli_warn("%s: poses are %.2f ms old, not %.2f: the plan assumes that now",
		 info.name, mean_ms, assumed_ms);
}

/* Say all that the user has to know before a force comes. */
void haptic_begin_device(struct haptic *haptic)
{
	struct incise_scene_limits limits;
	struct incise_haptic_info info;

	if (!incise_rig_haptic(haptic->rig))
		return;
	incise_rig_haptic_place(haptic->rig, &haptic->calibration.values);
	incise_haptic_info(incise_rig_haptic(haptic->rig), &info);
	incise_scene_limits(haptic->scene, &limits);
	if (!(info.deadman_s > 0))
		cli_warn(
			"%s keeps its last force if its owner is killed: keep its switch "
			"at hand",
			info.name);
	if (!(info.high_mm[0] > info.low_mm[0]))
		cli_warn(
			"%s: its workspace is not known, so a force may begin anywhere; set "
			"haptic_setup.low_mm and high_mm",
			info.name);
	if (info.continuous_N > 0 && limits.force_N > info.continuous_N)
		cli_note("%s stands %g N for ever; limits.force_N is %g N", info.name,
			 info.continuous_N, limits.force_N);
	if (*info.filters)
		cli_note("%s: its own settings: %s", info.name, info.filters);
	if (*info.note)
		cli_note("%s: %s", info.name, info.note);
	check_ages(haptic);
}

json_t *haptic_device_json(const struct haptic *haptic)
{
	struct incise_haptic_ages ages;
	struct incise_haptic_info info;

	if (!incise_rig_haptic(haptic->rig))
		return json_null();
	incise_haptic_info(incise_rig_haptic(haptic->rig), &info);
	incise_rig_haptic_ages(haptic->rig, &ages);
	return json_pack("{so so sI sI so sf sf sf sf}", "name", json_text(info.name),
			 "filters", json_text(info.filters), "lost",
			 (json_int_t)ages.lost, "cuts", (json_int_t)ages.cuts, "last_cut",
			 json_text_or_null(ages.last_cut), "age_assumed_ms",
			 ages.assumed_ms, "age_mean_ms", ages.mean_ms, "age_most_ms",
			 ages.most_ms, "age_jitter_ms", ages.jitter_ms);
}

void haptic_device_line(const struct haptic *haptic)
{
	struct incise_haptic_ages ages;
	struct incise_haptic_info info;

	if (!incise_rig_haptic(haptic->rig))
		return;
	incise_haptic_info(incise_rig_haptic(haptic->rig), &info);
	incise_rig_haptic_ages(haptic->rig, &ages);
	printf("device     %s: poses %.2f ms old in the mean, jitter %.2f, at most %.2f "
	       "(assumed %.2f); %llu lost; %llu gaps of the loop",
	       info.name, ages.mean_ms, ages.jitter_ms, ages.most_ms, ages.assumed_ms,
	       (unsigned long long)ages.lost,
	       (unsigned long long)haptic->stats->overruns);
	if (ages.cuts)
		printf("; force cut %s by its owner, last: %s",
		       cli_count(ages.cuts, "time"), ages.last_cut);
	putchar('\n');
}
