// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ways of telling where the tip is now; see pose_methods.h.
 */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <incise/clock.h>
#include "../../lib/control/predict.h"
#include "../cli/cli.h"
#include "pose_methods.h"

/* ---- from the last few ---- */

#define LAST 6

/*
 * Position over time since the last pose, of each axis: x + v t + a t². The time between
 * poses is that of their numbers: arrivals of two are a jitter apart.
 */
struct last {
	double rate_hz;
	int64_t latency_ns, t_ns; /* acquisition of the last */
	uint64_t seq[LAST];	  /* the newest first */
	double position_mm[LAST][3];
	double quaternion[4];
	int n;
	double x[3], v[3], a[3];
};

static void *last_begin(const struct pose_method *method,
			const struct incise_tracker_info *info)
{
	struct last *last = calloc(1, sizeof(*last));

	(void)method;
	if (!last)
		cli_fail("no memory");
	last->rate_hz = info->rate_hz;
	last->latency_ns = info->latency_ns;
	last->quaternion[0] = 1;
	return last;
}

static void last_take(struct last *last, const struct incise_tracker_sample *sample,
		      int keep)
{
	memmove(last->seq + 1, last->seq, (keep - 1) * sizeof(*last->seq));
	memmove(last->position_mm + 1, last->position_mm,
		(keep - 1) * sizeof(*last->position_mm));
	last->seq[0] = sample->seq;
	memcpy(last->position_mm[0], sample->position_mm, sizeof(last->position_mm[0]));
	memcpy(last->x, sample->position_mm, sizeof(last->x));
	memcpy(last->quaternion, sample->quaternion, sizeof(last->quaternion));
	last->t_ns = sample->t_ns - last->latency_ns;
	last->n += last->n < keep;
}

static void held_add(void *state, const struct incise_tracker_sample *sample)
{
	last_take(state, sample, 1);
}

static void held_at(const void *state, int64_t t_ns, struct motion_state *shown)
{
	const struct last *last = state;

	(void)t_ns;
	memcpy(shown->position_mm, last->x, sizeof(last->x));
	memset(shown->velocity_mm_s, 0, sizeof(shown->velocity_mm_s));
	memcpy(shown->quaternion, last->quaternion, sizeof(last->quaternion));
}

static void line_add(void *state, const struct incise_tracker_sample *sample)
{
	struct last *last = state;
	double per_s;

	last_take(last, sample, 2);
	if (last->n < 2)
		return;
	per_s = last->rate_hz / (double)(last->seq[0] - last->seq[1]);
	for (int i = 0; i < 3; i++)
		last->v[i] = (last->x[i] - last->position_mm[1][i]) * per_s;
}

/* Least squares in time and its square, through the normal equations: six points in about
 * their own period are harmless. */
static void fit_add(void *state, const struct incise_tracker_sample *sample)
{
	struct last *last = state;
	double s[5] = {0}, m[3][6] = {{0}};

	last_take(last, sample, LAST);
	if (last->n < LAST)
		return;
	for (int k = 0; k < LAST; k++) {
		double u = -(double)(last->seq[0] - last->seq[k]), power = 1;

		for (int i = 0; i < 5; i++, power *= u) {
			s[i] += power;
			for (int axis = 0; i < 3 && axis < 3; axis++)
				m[i][3 + axis] += power * last->position_mm[k][axis];
		}
	}
	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++)
			m[i][j] = s[i + j];
	/* The matrix is positive definite: no pivots are needed. */
	for (int i = 0; i < 3; i++)
		for (int row = 0; row < 3; row++) {
			double share = m[row][i] / m[i][i];

			for (int j = 0; row != i && j < 6; j++)
				m[row][j] -= share * m[i][j];
		}
	for (int axis = 0; axis < 3; axis++) {
		last->x[axis] = m[0][3 + axis] / m[0][0];
		last->v[axis] = m[1][3 + axis] / m[1][1] * last->rate_hz;
		last->a[axis] = m[2][3 + axis] / m[2][2] * last->rate_hz * last->rate_hz;
	}
}

static void last_at(const void *state, int64_t t_ns, struct motion_state *shown)
{
	const struct last *last = state;
	double t_s = (double)(t_ns - last->t_ns) * (1.0 / INCISE_NS_PER_S);

	for (int i = 0; i < 3; i++) {
		shown->position_mm[i] =
			last->x[i] + (last->v[i] + last->a[i] * t_s) * t_s;
		shown->velocity_mm_s[i] = last->v[i] + 2 * last->a[i] * t_s;
	}
	memcpy(shown->quaternion, last->quaternion, sizeof(last->quaternion));
}

/* ---- the library ---- */

static void *library_begin(const struct pose_method *method,
			   const struct incise_tracker_info *info)
{
	struct incise_tracker_info told = *info;
	struct incise_predict *predict = malloc(sizeof(*predict));

	if (method->punctual)
		told.latency_ns = 0;
	if (!predict)
		cli_fail("no memory");
	incise_predict_init(predict, &told, method->noise_mm);
	return predict;
}

static void library_add(void *state, const struct incise_tracker_sample *sample)
{
	incise_predict_add(state, sample);
}

static void library_at(const void *state, int64_t t_ns, struct motion_state *shown)
{
	incise_predict_at(state, t_ns, shown->position_mm, shown->velocity_mm_s,
			  shown->quaternion);
}

#define LIBRARY library_begin, library_add, library_at, free

const struct pose_method pose_methods[POSE_METHODS] = {
	{"held", last_begin, held_add, held_at, free, 0, false},
	{"line", last_begin, line_add, last_at, free, 0, false},
	{"parabola", last_begin, fit_add, last_at, free, 0, false},
	{"library", LIBRARY, 0, false},
	{"library_5um", LIBRARY, 0.005, false},
	{"library_100um", LIBRARY, 0.1, false},
	{"library_punctual", LIBRARY, 0, true},
};
