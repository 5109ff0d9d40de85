// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * How far off shown poses are; see pose_error.h.
 *
 *   true      ────────────────────────────────────────
 *   poses       |       |       x       |                x: lost
 *   arrivals     ·─4ms─▶|       |               |
 *   ticks     | | | | | | | | | | | | | | | | | | |
 *                       '─ age of the last pose: 4 ms … a period more
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/clock.h>
#include "../cli/cli.h"
#include "noise.h"
#include "pose_error.h"
#include "../cli/stopwatch.h"

#define BEGIN_NS (100 * POSE_TICK_NS) /* all times before are above 0 */
#define SEED 20

/* Gaps begin so many ms after each other; error counts until a while after each. */
#define GAP_EVERY_MS 770
#define GAP_AFTER_MS 100

static void *room(size_t n, size_t size)
{
	void *memory = calloc(n + 1, size);

	if (!memory)
		cli_fail("no memory");
	return memory;
}

static void times_quaternion(double q[4], const double by[4])
{
	const double a[4] = {q[0], q[1], q[2], q[3]};

	q[0] = a[0] * by[0] - a[1] * by[1] - a[2] * by[2] - a[3] * by[3];
	q[1] = a[0] * by[1] + a[1] * by[0] + a[2] * by[3] - a[3] * by[2];
	q[2] = a[0] * by[2] - a[1] * by[3] + a[2] * by[0] + a[3] * by[1];
	q[3] = a[0] * by[3] + a[1] * by[2] - a[2] * by[1] + a[3] * by[0];
}

static void disturb(const struct motion_state *state, struct noise *noise,
		    struct incise_tracker_sample *sample)
{
	double shake[4] = {1}, length = 1;

	for (int i = 0; i < 3; i++)
		sample->position_mm[i] =
			state->position_mm[i] + POSE_NOISE_MM * noise_normal(noise);
	for (int i = 1; i < 4; i++) {
		shake[i] = POSE_NOISE_DEG * M_PI / 360 * noise_normal(noise);
		length += shake[i] * shake[i];
	}
	for (int i = 0; i < 4; i++)
		shake[i] /= sqrt(length);
	memcpy(sample->quaternion, state->quaternion, sizeof(sample->quaternion));
	times_quaternion(sample->quaternion, shake);
}

/* Whether it is so long after the last of the gaps began; they begin in the second second. */
static bool within_gap(const struct pose_run *run, int64_t t_ns, double ms)
{
	double gone_ms = (double)(t_ns - BEGIN_NS) * 1e-6 - 1000;

	return run->condition.gap_ms > 0 && gone_ms >= 0 &&
	       fmod(gone_ms, GAP_EVERY_MS) < ms;
}

/* Poses as they arrive, none before the one before it; when each was true in taken_ns. */
static void track(struct pose_run *run, int64_t *taken_ns)
{
	const struct pose_condition *c = &run->condition;
	double period_ns =
		INCISE_NS_PER_S / (c->tracker_hz * (1 + POSE_DRIFT_PPM * 1e-6));
	int all = (int)((double)c->ticks * POSE_TICK_NS / period_ns);
	struct motion_state *states = room(all, sizeof(*states));
	struct noise noise = {SEED};
	int64_t before_ns = 0;

	run->samples = room(all, sizeof(*run->samples));
	for (int k = 0; k < all; k++)
		taken_ns[k] = BEGIN_NS + llround(k * period_ns);
	motion_states(c->motion, taken_ns, all, states);
	for (int k = 0; k < all; k++) {
		struct incise_tracker_sample *sample = &run->samples[run->n];
		double late_ms =
			c->delay_ms + POSE_JITTER_MS * fabs(noise_normal(&noise));
		bool lost = noise_uniform(&noise) < POSE_LOST;

		*sample = (struct incise_tracker_sample){
			.t_ns = taken_ns[k] + llround(late_ms * 1e6),
			.seq = (uint64_t)k,
			.status = ' ',
			.station = 1,
		};
		if (sample->t_ns <= before_ns)
			sample->t_ns = before_ns + 1;
		before_ns = sample->t_ns;
		disturb(&states[k], &noise, sample);
		if (c->gap_ms > 0 ? within_gap(run, sample->t_ns, c->gap_ms) : lost)
			continue;
		taken_ns[run->n++] = taken_ns[k];
	}
	free(states);
}

static void set_ticks(struct pose_run *run, const int64_t *taken_ns)
{
	const struct pose_condition *c = &run->condition;
	int64_t delay_ns = llround(c->delay_ms * 1e6),
		*before_ns = room(c->ticks, sizeof(*before_ns));

	run->t_ns = room(c->ticks, sizeof(*run->t_ns));
	run->truth = room(c->ticks, sizeof(*run->truth));
	run->late = room(c->ticks, sizeof(*run->late));
	run->age_s = room(c->ticks, sizeof(*run->age_s));
	run->counts = room(c->ticks, sizeof(*run->counts));
	for (int k = 0, come = 0; k < c->ticks; k++) {
		int64_t t_ns = BEGIN_NS + (int64_t)k * POSE_TICK_NS;

		while (come < run->n && run->samples[come].t_ns <= t_ns)
			come++;
		run->t_ns[k] = t_ns;
		before_ns[k] = t_ns - delay_ns;
		if (come)
			run->age_s[k] = (double)(t_ns - taken_ns[come - 1]) * 1e-9;
		run->counts[k] = c->gap_ms > 0
					 ? within_gap(run, t_ns, c->gap_ms + GAP_AFTER_MS)
					 : k >= POSE_BEGIN_TICKS;
	}
	motion_states(c->motion, run->t_ns, c->ticks, run->truth);
	motion_states(c->motion, before_ns, c->ticks, run->late);
	free(before_ns);
}

void pose_run_begin(struct pose_run *run, const struct pose_condition *condition)
{
	int64_t *taken_ns = room((size_t)condition->ticks * 2, sizeof(*taken_ns));

	*run = (struct pose_run){
		.condition = *condition,
		.info = {.name = "bench",
			 .rate_hz = condition->tracker_hz,
			 .latency_ns = llround(condition->delay_ms * 1e6),
			 .stations = 1},
	};
	track(run, taken_ns);
	set_ticks(run, taken_ns);
	free(taken_ns);
}

void pose_run_end(struct pose_run *run)
{
	free(run->samples);
	free(run->t_ns);
	free(run->truth);
	free(run->late);
	free(run->age_s);
	free(run->counts);
}

void pose_show(const struct pose_run *run, const struct pose_method *method,
	       struct motion_state *shown, bool all)
{
	void *state = method->begin(method, &run->info);
	int come = 0;

	for (int k = 0; k < run->condition.ticks; k++) {
		while (come < run->n && run->samples[come].t_ns <= run->t_ns[k])
			method->add(state, &run->samples[come++]);
		method->at(state, run->t_ns[k], &shown[all ? k : 0]);
	}
	method->end(state);
}

/* ---- norms ---- */

static double length3(const double a[3], const double b[3])
{
	return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
		    (a[2] - b[2]) * (a[2] - b[2]));
}

/* The angle between two attitudes; by a difference, as a cosine near 1 has no digits. */
static double angle_deg(const double p[4], const double q[4])
{
	double sign = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0 ? -1 : 1;
	double sum = 0;

	for (int i = 0; i < 4; i++)
		sum += (p[i] - sign * q[i]) * (p[i] - sign * q[i]);
	return 4 * asin(fmin(sqrt(sum) / 2, 1)) * 180 / M_PI;
}

/* Of n errors, which are sorted. */
static struct pose_norms norms(double *errors, int n)
{
	double sum2 = 0;

	for (int i = 0; i < n; i++)
		sum2 += errors[i] * errors[i];
	stopwatch_sort(errors, n);
	return (struct pose_norms){sqrt(sum2 / n), stopwatch_quantile(errors, n, 0.99),
				   errors[n - 1]};
}

/* What is true of the ticks that count, whatever is shown. */
static void of_truth(const struct pose_run *run, struct pose_error *error)
{
	double mean[3] = {0}, theory2 = 0, spread2 = 0;
	int n = 0;

	for (int k = 0; k < run->condition.ticks; k++) {
		for (int i = 0; i < 3 && run->counts[k]; i++)
			mean[i] += run->truth[k].position_mm[i];
		n += run->counts[k];
	}
	for (int i = 0; i < 3; i++)
		mean[i] /= n;
	for (int k = 0; k < run->condition.ticks; k++) {
		static const double rest[3];
		double gone = length3(run->truth[k].velocity_mm_s, rest) * run->age_s[k];

		if (!run->counts[k])
			continue;
		theory2 += gone * gone / n;
		spread2 += pow(length3(run->truth[k].position_mm, mean), 2) / n;
	}
	error->theory_mm = sqrt(theory2 + 3 * POSE_NOISE_MM * POSE_NOISE_MM);
	error->spread_mm = sqrt(spread2);
}

static double jump_mm(const struct pose_run *run, const struct motion_state *shown)
{
	double most = 0;

	for (int k = 1; k < run->condition.ticks; k++) {
		double stepped[3], gone[3];

		for (int i = 0; i < 3; i++) {
			stepped[i] =
				shown[k].position_mm[i] - shown[k - 1].position_mm[i];
			gone[i] = run->truth[k].position_mm[i] -
				  run->truth[k - 1].position_mm[i];
		}
		if (run->counts[k] && run->counts[k - 1])
			most = fmax(most, length3(stepped, gone));
	}
	return most;
}

void pose_error(const struct pose_run *run, const struct pose_method *method,
		struct pose_error *error)
{
	int ticks = run->condition.ticks, n = 0;
	struct motion_state *shown = run->late;
	double *place = room(ticks, sizeof(*place)), *speed = room(ticks, sizeof(*speed)),
	       *turn = room(ticks, sizeof(*turn));

	if (method) {
		shown = room(ticks, sizeof(*shown));
		pose_show(run, method, shown, true);
	}
	*error = (struct pose_error){0};
	for (int k = 0; k < ticks; k++) {
		const struct motion_state *is = &run->truth[k];

		if (!run->counts[k])
			continue;
		place[n] = length3(shown[k].position_mm, is->position_mm);
		speed[n] = length3(shown[k].velocity_mm_s, is->velocity_mm_s);
		turn[n] = angle_deg(shown[k].quaternion, is->quaternion);
		n++;
	}
	of_truth(run, error);
	error->place_mm = norms(place, n);
	error->velocity_mm_s = norms(speed, n);
	error->turn_deg = norms(turn, n);
	error->jump_mm = jump_mm(run, shown);
	if (!isfinite(error->place_mm.rms + error->velocity_mm_s.rms +
		      error->turn_deg.rms))
		snprintf(error->failed, sizeof(error->failed), "a pose is not a number");
	else if (error->place_mm.rms > error->spread_mm)
		snprintf(
			error->failed, sizeof(error->failed),
			"worse than no tracker: off by %.3g mm, where the middle of the motion "
			"is by %.3g mm",
			error->place_mm.rms, error->spread_mm);
	free(place);
	free(speed);
	free(turn);
	if (method)
		free(shown);
}
