// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Where the tip is now; see predict.h. Gains after Kalata's tracking index
 * Λ = σa T²/σx, the ratio of what a hand can do in one period to what the tracker sees.
 */
#include <math.h>
#include <incise/clock.h>
#include "predict.h"

/* A surgeon's hand accelerates by some hundred mm/s² while cutting. */
#define HAND_MM_S2 300.0

/* Noise of a magnetic tracker near its source. */
#define NOISE_MM 0.02

/* Beyond these nothing is believed: no hand is that far or that fast. */
#define FAR_MM 1e4
#define FAST_MM_S 1e4

void incise_predict_init(struct incise_predict *predict,
			 const struct incise_tracker_info *tracker)
{
	double period = 1 / tracker->rate_hz;
	double index = HAND_MM_S2 * period * period / NOISE_MM;
	double r = (4 + index - sqrt(8 * index + index * index)) / 4;

	*predict = (struct incise_predict){
		.alpha = 1 - r * r,
		.beta = 2 * (1 - r) * (1 - r),
		.latency_ns = tracker->latency_ns,
		.gap_ns = (int64_t)(5 * period * INCISE_NS_PER_S),
	};
}

static bool believable(const double x[3])
{
	return fabs(x[0]) < FAR_MM && fabs(x[1]) < FAR_MM && fabs(x[2]) < FAR_MM;
}

void incise_predict_add(struct incise_predict *p,
			const struct incise_tracker_sample *sample)
{
	int64_t t_ns;
	double dt;

	if (!believable(sample->position_mm) || sample->t_ns < 0)
		return;
	t_ns = sample->t_ns - p->latency_ns;
	if (p->started && t_ns <= p->t_ns)
		return;
	dt = (double)(t_ns - p->t_ns) / INCISE_NS_PER_S;
	if (!p->started || t_ns - p->t_ns > p->gap_ns) {
		for (int i = 0; i < 3; i++) {
			p->x[i] = sample->position_mm[i];
			p->v[i] = 0;
		}
	} else {
		for (int i = 0; i < 3; i++) {
			double ahead = p->x[i] + p->v[i] * dt;
			double miss = sample->position_mm[i] - ahead;
			double v = p->v[i] + p->beta * miss / dt;

			p->x[i] = ahead + p->alpha * miss;
			p->v[i] = fmax(-FAST_MM_S, fmin(FAST_MM_S, v));
		}
	}
	p->started = true;
	p->t_ns = t_ns;
}

void incise_predict_at(const struct incise_predict *p, int64_t t_ns, double position[3])
{
	/* Never further ahead than a gap: an old pose is not thrown across the room. */
	int64_t ahead_ns = t_ns - p->t_ns;
	double ahead =
		(double)(ahead_ns < p->gap_ns ? ahead_ns : p->gap_ns) / INCISE_NS_PER_S;

	for (int i = 0; i < 3; i++)
		position[i] = p->x[i] + p->v[i] * fmax(ahead, 0);
}

double incise_predict_speed(const struct incise_predict *p)
{
	return sqrt(p->v[0] * p->v[0] + p->v[1] * p->v[1] + p->v[2] * p->v[2]);
}

int64_t incise_predict_age(const struct incise_predict *p, int64_t t_ns)
{
	return p->started ? t_ns - p->t_ns : INT64_MAX;
}
