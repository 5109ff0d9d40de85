// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Where the tip is now; see incise/predict.h. Gains after Kalata's tracking index
 * Λ = σa T²/σx, where σa is the change of acceleration in one period T and σx the noise
 * of the tracker: Kalata, The tracking index, IEEE Trans. AES-20(2), 1984; the closed
 * form is Gray and Murray's, IEEE Trans. AES-29(3), 1993.
 */
#include <math.h>
#include <incise/clock.h>
#include "predict.h"

/*
 * Density of the hand's white jerk, mm²/s⁵, about its mean square times the time for
 * which it lasts, 1/2π of a period. A hand that goes ±1.7 mm at 3 Hz (32 mm/s) has
 * 8000 mm/s³ rms for 53 ms: 3.4e6. Tremor of 30 µm at 10 Hz has 5300 mm/s³ for 16 ms:
 * 0.4e6. The error is flat about it: half or twice as much changes it by less than a
 * tenth.
 */
#define HAND_MM2_S5 4e6

/* Noise of a magnetic tracker near its source. */
#define NOISE_MM 0.02

#define GAP_PERIODS 5

/* More noise counts as this. */
#define FAR_MM 1e4

static double keep_within_predict(double x, double least, double most)
{
	return x >= least ? fmin(x, most) : least;
}

/*
 * s = √(1 - α) is where (1 - s)³ = Λ/2 s (1 + s); one side falls and the other rises, so
 * that halving finds it for any Λ > 0.
 */
static void set_gains(struct incise_predict *p, double index)
{
	double low = 0, high = 1, s;

	for (int i = 0; i < 64; i++) {
		s = (low + high) / 2;
		if (pow(1 - s, 3) > index / 2 * s * (1 + s))
			low = s;
		else
			high = s;
	}
	p->alpha = 1 - s * s;
	p->beta = 2 * (1 - s) * (1 - s);
	p->gamma = 2 * pow(1 - s, 3) / (1 + s);
}

void incise_predict_init(struct incise_predict *p,
			 const struct incise_tracker_info *tracker, double noise_mm)
{
	double period_s = 1 / keep_within_predict(tracker->rate_hz, 1, 1e4);
	double change = sqrt(HAND_MM2_S5 * period_s);

	*p = (struct incise_predict){
		.period_s = period_s,
		.gap_ns = (int64_t)(GAP_PERIODS * period_s * INCISE_NS_PER_S),
		.latency_ns = (int64_t)keep_within_predict((double)tracker->latency_ns, 0,
							   INCISE_NS_PER_S),
	};
	incise_double_predict_init(&p->now);
	set_gains(p, change * period_s * period_s /
			     keep_within_predict(noise_mm > 0 ? noise_mm : NOISE_MM, 1e-9,
						 FAR_MM));
}

void incise_predict_filter(const struct incise_predict *p,
			   struct incise_double_filter *filter)
{
	double per_s = 1 / p->period_s;

	*filter = (struct incise_double_filter){
		.alpha = p->alpha,
		.beta = p->beta * per_s,
		.gamma = p->gamma * per_s * per_s,
		.period_ns = p->period_s * INCISE_NS_PER_S,
		.latency_ns = (double)p->latency_ns,
		.gap_ns = (double)p->gap_ns,
		.ahead_ns = fmax((double)p->gap_ns, INCISE_PREDICT_AHEAD_NS),
	};
}

void incise_predict_add(struct incise_predict *p,
			const struct incise_tracker_sample *sample)
{
	struct incise_double_filter filter;

	incise_predict_filter(p, &filter);
	incise_double_predict_add(&p->now, &filter, sample->position_mm,
				  sample->quaternion, sample->t_ns);
}

void incise_predict_at(const struct incise_predict *p, int64_t t_ns,
		       double position_mm[3], double velocity_mm_s[3], double attitude[4])
{
	struct incise_double_filter filter;

	incise_predict_filter(p, &filter);
	incise_double_predict_at(&p->now, &filter, t_ns, position_mm, velocity_mm_s);
	incise_double_predict_attitude(&p->now, &filter, t_ns, attitude);
}

void incise_predict_acceleration(const struct incise_predict *p, int64_t t_ns,
				 double acceleration_mm_s2[3])
{
	struct incise_double_filter filter;

	incise_predict_filter(p, &filter);
	incise_double_predict_acceleration(&p->now, &filter, t_ns, acceleration_mm_s2);
}
