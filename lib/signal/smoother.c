// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Velocity of the tip and progress of a cut; see smoother.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/recording.h>
#include <incise/tracker.h>
#include <incise/uncertainty.h>
#include "../base/vector.h"
#include "../tissue/tick.h"
#include "smoother.h"

/* --- velocity of the tip ------------------------------------------------------------- */

/*
 * Velocity of the tip from the tracker's records before and after: the loop's filter
 * (lib/tissue/predict.proto.c, a steady-state Kalman filter of constant acceleration) run forward,
 * and its smoother backward.
 *
 *     forward   ─────────────────────────────►   x, v, a and the residual y - x of each record
 *     backward        ◄─────────────── λ = 0     v less P λ, where λ sums later residuals
 *               taken │ finished │ lag │ last record
 *
 * The backward run is that of Bryson and Frazier in Bierman's form (Fixed interval
 * smoothing with discrete measurements, Int. J. Control 18(1), 1973) with the gains of the
 * loop. So its phase is 0: at ω, for records T apart with tracking index Λ,
 *
 *     v / x = j 2/T tan(ωT/2) / (1 + (2 sin(ωT/2))⁶ / (Λ cos(ωT/2))²)
 *
 * which is half of jω at 16.8 Hz for records at 120 Hz and at 18.5 Hz for 240 Hz. It restarts
 * where the loop does: after a gap of five periods, and at a discontinuity of 20 mm. There the
 * first velocity is the slope of the next records, not 0 as in the loop, which has none yet.
 *
 * The effect of a record on those before it fades from record to record. The lag is the
 * distance at which it has faded to 1e-7, 39 records at 120 Hz and 72 at 240 Hz; later records
 * do not matter. Memory is that of two lags.
 *
 * The noise of positions and depths is from second differences of evenly spaced records, which
 * have √6 of it; over 16 to each side. mm, s; not for several threads.
 */

#define AHEAD 4	  /* records of a first slope, besides its own */
#define AROUND 16 /* records to each side for the noise */
#define FADED 1e-7
#define LAG_MAX 4096 /* at 10 kHz, the fastest that the filter is made for, it is 2198 */

/* λ of a record becomes that of the one before: Fᵀ (I - K H)ᵀ λ, less its residual. */
static void step_back(const struct incise_predict *p, double residual, double periods,
		      double lambda[3])
{
	double x = lambda[0] - p->alpha * lambda[0] - p->beta * lambda[1] -
		   p->gamma * lambda[2] - residual;

	lambda[2] += (lambda[1] + x * periods / 2) * periods;
	lambda[1] += x * periods;
	lambda[0] = x;
}

static size_t fading(const struct incise_predict *p)
{
	double lambda[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
	size_t lag = 1;

	for (size_t i = 1; i < LAG_MAX; i++) {
		double most = 0;

		for (int k = 0; k < 3; k++) {
			step_back(p, 0, 1, lambda[k]);
			for (int j = 0; j < 3; j++)
				most = fmax(most, fabs(lambda[k][j]));
		}
		if (most > FADED)
			lag = i + 1;
	}
	return lag;
}

/*
 * Noise of the velocity for white noise of 1 of positions, per period: the mean square of v/x,
 * less that of the slope of a line through so many records to each side, 0 for none.
 */
static double noise_per_period(const struct incise_predict *p, int line)
{
	const int steps = 1000;
	double s = sqrt(1 - p->alpha), index = 2 * pow(1 - s, 3) / (s * (1 + s)), sum = 0;
	double squares = line * (line + 1) * (2 * line + 1) / 3.;

	for (int i = 0; i < steps; i++) {
		double half = M_PI / 2 * (i + 0.5) / steps;
		double gain = 2 * tan(half) /
			      (1 + pow(2 * sin(half), 6) / pow(index * cos(half), 2));

		for (int k = 1; k <= line; k++)
			gain -= 2 * k / squares * sin(2 * k * half);
		sum += gain * gain;
	}
	return sqrt(sum / steps);
}

double incise_smooth_line_noise(const struct incise_smooth *smooth, int half)
{
	return noise_per_period(&smooth->fresh, half) / smooth->period_s;
}

int incise_smooth_init(struct incise_smooth *smooth, double rate_hz)
{
	struct incise_predict *p = &smooth->fresh;
	double a, b, g;

	*smooth = (struct incise_smooth){0};
	incise_predict_init(p, &(struct incise_tracker_info){.rate_hz = rate_hz}, 0);
	smooth->period_s = p->period_s;
	/*
	 * The filter's covariance of velocity with x, v and a, for a noise of 1 and times
	 * in periods: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to
	 * Tracking and Navigation, 2001, §6.5.4, where γ is twice ours.
	 */
	a = p->alpha;
	b = p->beta;
	g = 2 * p->gamma;
	smooth->pull[0] = b;
	smooth->pull[1] = (8 * a * b + g * (b - 2 * a - 4)) / (8 * (1 - a));
	smooth->pull[2] = b * (2 * b - g) / (4 * (1 - a));
	smooth->noise_1_s = noise_per_period(p, 0) / p->period_s;
	smooth->lag = fading(p);
	smooth->capacity = 2 * smooth->lag + AHEAD + 2 * AROUND;
	smooth->records = calloc(smooth->capacity, sizeof(*smooth->records));
	return smooth->records ? 0 : -ENOMEM;
}

void incise_smooth_free(struct incise_smooth *smooth)
{
	free(smooth->records);
	smooth->records = NULL;
}

static double measure_distance(const struct incise_smooth_record *a,
			       const struct incise_smooth_record *b)
{
	double sum = 0;

	for (int i = 0; i < 3; i++)
		sum += (b->position_mm[i] - a->position_mm[i]) *
		       (b->position_mm[i] - a->position_mm[i]);
	return sqrt(sum);
}

/* Whether a record continues the one before: no gap, no discontinuity. */
static bool continues(const struct incise_smooth *smooth, size_t i)
{
	const struct incise_smooth_record *r = &smooth->records[i];

	return r->t_ns - r[-1].t_ns <= smooth->fresh.gap_ns &&
	       measure_distance(&r[-1], r) <= INCISE_PREDICT_JUMP_MM;
}

/* Slope of the straight line through a record and those that follow, mm/s. */
static void first_slope(const struct incise_smooth *smooth, size_t first, double slope[3])
{
	const struct incise_smooth_record *r = &smooth->records[first];
	double t[AHEAD + 1], mean = 0, tt = 0;
	size_t n = 1;

	while (n <= AHEAD && first + n < smooth->n && continues(smooth, first + n))
		n++;
	for (size_t i = 0; i < n; i++) {
		t[i] = (r[i].t_ns - r->t_ns) * 1e-9;
		mean += t[i] / n;
	}
	slope[0] = slope[1] = slope[2] = 0;
	for (size_t i = 0; i < n; i++) {
		tt += (t[i] - mean) * (t[i] - mean);
		for (int k = 0; k < 3; k++)
			slope[k] +=
				(t[i] - mean) * (r[i].position_mm[k] - r->position_mm[k]);
	}
	for (int k = 0; k < 3 && n > 1; k++)
		slope[k] /= tt;
}

/* Whether the filter, predicted to this record, is too far off to continue. */
static bool is_lost_pose(const struct incise_predict *p,
			 const struct incise_smooth_record *r, double dt)
{
	double sum = 0;

	for (int i = 0; i < 3; i++) {
		double residual = r->position_mm[i] - p->now.x[i] -
				  (p->now.v[i] + p->now.a[i] * dt / 2) * dt;

		sum += residual * residual;
	}
	return !(sqrt(sum) <= INCISE_PREDICT_JUMP_MM);
}

static void step_forward(struct incise_smooth *smooth, size_t i)
{
	struct incise_smooth_record *r = &smooth->records[i];
	struct incise_predict *p = &smooth->predict, next;
	/* The filter needs positive times; rows' are within ±2^61. */
	struct incise_tracker_sample sample = {.t_ns = r->t_ns + (1LL << 62),
					       .quaternion = {1}};
	double dt = (sample.t_ns - p->now.t_ns) * 1e-9;

	memcpy(sample.position_mm, r->position_mm, sizeof(sample.position_mm));
	r->starts = !p->now.started || sample.t_ns - p->now.t_ns > p->gap_ns ||
		    is_lost_pose(p, r, dt);
	r->periods = dt / smooth->period_s;
	next = r->starts ? smooth->fresh : *p;
	incise_predict_add(&next, &sample);
	r->skipped = next.now.t_ns != sample.t_ns;
	if (!r->skipped)
		*p = next;
	if (!r->skipped && r->starts)
		first_slope(smooth, i, p->now.v);
	for (int k = 0; k < 3; k++) {
		r->velocity_mm_s[k] = r->skipped ? NAN : p->now.v[k];
		r->residual_mm[k] = r->position_mm[k] - p->now.x[k];
	}
}

/* The squared distance of a record from the line between its neighbours. */
static void bend(struct incise_smooth *smooth, size_t i)
{
	struct incise_smooth_record *r = &smooth->records[i], *a, *b;
	double before, after;

	r->even = false;
	if (!i || i + 1 >= smooth->n)
		return;
	a = r - 1;
	b = r + 1;
	before = r->t_ns - a->t_ns;
	after = b->t_ns - r->t_ns;
	if (before > smooth->fresh.gap_ns || fabs(after - before) > 0.2 * before)
		return;
	r->even = true;
	r->depth_bend2_mm2 = pow(b->depth_mm - 2 * r->depth_mm + a->depth_mm, 2);
	r->bend2_mm2 = 0;
	for (int k = 0; k < 3; k++)
		r->bend2_mm2 += pow(
			b->position_mm[k] - 2 * r->position_mm[k] + a->position_mm[k], 2);
}

static void measure_noise(struct incise_smooth *smooth, size_t i)
{
	struct incise_smooth_record *r = &smooth->records[i];
	size_t from = i > AROUND ? i - AROUND : 0, n = 0;
	double sum = 0, depth = 0;

	for (size_t k = from; k < smooth->forward && k <= i + AROUND; k++) {
		const struct incise_smooth_record *near = &smooth->records[k];

		if (!near->even)
			continue;
		sum += near->bend2_mm2;
		depth += near->depth_bend2_mm2;
		n++;
	}
	r->noise_mm = n ? sqrt(sum / n / 18) : NAN;
	r->depth_noise_mm = n ? sqrt(depth / n / 6) : NAN;
}

/* Filter forward to the last record, and smooth back to the unfinished ones. */
static void run_interpolators(struct incise_smooth *smooth)
{
	size_t end = smooth->ended ? smooth->n : smooth->n - AHEAD;
	size_t sure = smooth->ended ? end : end - smooth->lag;
	double lambda[3][3] = {0};

	for (; smooth->forward < end; smooth->forward++) {
		step_forward(smooth, smooth->forward);
		bend(smooth, smooth->forward);
	}
	for (size_t i = end; i-- > smooth->finished;) {
		struct incise_smooth_record *r = &smooth->records[i];

		if (i < sure)
			measure_noise(smooth, i);
		if (r->skipped)
			continue;
		for (int k = 0; k < 3; k++) {
			double *l = lambda[k];

			if (i < sure)
				r->velocity_mm_s[k] -=
					(smooth->pull[0] * l[0] + smooth->pull[1] * l[1] +
					 smooth->pull[2] * l[2]) /
					smooth->period_s;
			step_back(&smooth->fresh, r->residual_mm[k], r->periods, l);
		}
		if (r->starts)
			memset(lambda, 0, sizeof(lambda));
	}
	smooth->finished = sure;
}

void incise_smooth_push(struct incise_smooth *smooth,
			const struct incise_smooth_record *record)
{
	if (smooth->n == smooth->capacity) {
		/* All finished records were taken; the noise uses some of them. */
		size_t old = smooth->finished - AROUND;

		smooth->n -= old;
		memmove(smooth->records, smooth->records + old,
			smooth->n * sizeof(*smooth->records));
		smooth->forward -= old;
		smooth->finished -= old;
		smooth->taken -= old;
	}
	smooth->records[smooth->n++] = *record;
	if (smooth->n == smooth->capacity)
		run_interpolators(smooth);
}

void incise_smooth_end(struct incise_smooth *smooth)
{
	if (smooth->ended)
		return;
	smooth->ended = true;
	run_interpolators(smooth);
}

const struct incise_smooth_record *incise_smooth_take(struct incise_smooth *smooth)
{
	return smooth->taken < smooth->finished ? &smooth->records[smooth->taken++]
						: NULL;
}

/* --- progress of a cut --------------------------------------------------------------- */

static void start_line(struct incise_cut_progress *p, const double at_mm[3])
{
	v3_copy(p->at_mm, at_mm);
	p->has_line = false;
	p->from_mm = p->to_mm = 0;
}

/*
 * Bring the line to the blade: how far that is into new tissue, and the speed of it, where the
 * blade is at an end of the line within @noise_mm.
 */
static double lengthen(struct incise_cut_progress *p, const double at_mm[3],
		       const double velocity_mm_s[3], double noise_mm, double *speed_mm_s)
{
	double off[3], across[3], radius, s, before = p->to_mm - p->from_mm;

	*speed_mm_s = 0;
	v3_sub(off, at_mm, p->at_mm);
	radius = v3_length(off);
	s = v3_dot(off, p->along);
	v3_add(across, off, -s, p->along);
	/* The farther the blade gets, the better its direction is known. */
	if (radius > fmax(p->to_mm, -p->from_mm) &&
	    (!p->has_line || v3_length(across) <= INCISE_FRONT_BESIDE_MM)) {
		double sign = p->has_line && s < 0 ? -1 : 1;

		v3_add(p->along, (double[3]){0}, sign / radius, off);
		p->has_line = radius > INCISE_FRONT_BESIDE_MM;
		s = sign * radius;
		v3_add(across, off, -s, p->along);
	}
	if (v3_length(across) > INCISE_FRONT_BESIDE_MM) {
		start_line(p, at_mm);
		*speed_mm_s = v3_length(velocity_mm_s);
		return INCISE_FRONT_BESIDE_MM;
	}
	if (s >= p->to_mm - noise_mm)
		*speed_mm_s = fmax(v3_dot(velocity_mm_s, p->along), 0);
	if (p->has_line && s <= p->from_mm + noise_mm)
		*speed_mm_s = fmax(*speed_mm_s, -v3_dot(velocity_mm_s, p->along));
	p->from_mm = fmin(p->from_mm, s);
	p->to_mm = fmax(p->to_mm, s);
	return p->to_mm - p->from_mm - before;
}

bool incise_cut_progress_add(struct incise_cut_progress *p,
			     const struct incise_smooth_record *record, double noise_1_s)
{
	const double two = INCISE_INTERVAL95 * M_SQRT2; /* of a difference */
	double depth_noise_mm =
		isnan(record->depth_noise_mm) ? 0 : record->depth_noise_mm;
	double noise_mm = isnan(record->noise_mm) ? 0 : record->noise_mm;
	double at_mm[3], skin_mm_s[3], in_mm_s, along_mm_s, reached_mm;

	v3_add(at_mm, record->position_mm, record->depth_mm, p->normal);
	in_mm_s = -v3_dot(record->velocity_mm_s, p->normal);
	v3_add(skin_mm_s, record->velocity_mm_s, in_mm_s, p->normal);
	if (!p->inside || record->depth_mm < INCISE_CUT_END_MM) {
		start_line(p, at_mm);
		p->way_mm = 0;
		p->highest_mm = p->deepest_mm = record->depth_mm;
		p->inside = true;
	}
	p->way_mm += lengthen(p, at_mm, skin_mm_s, two * noise_mm, &along_mm_s);
	reached_mm = record->depth_mm + p->way_mm;
	p->highest_mm = fmax(p->highest_mm, reached_mm);
	p->deepest_mm = fmax(p->deepest_mm, record->depth_mm);
	if (!(along_mm_s > 0))
		noise_mm = 0;
	return reached_mm >= p->highest_mm - two * depth_noise_mm &&
	       record->depth_mm >= cbrt(INCISE_FRONT_KEPT) * p->deepest_mm &&
	       in_mm_s + along_mm_s >
		       INCISE_INTERVAL95 * noise_1_s * hypot(depth_noise_mm, noise_mm);
}
