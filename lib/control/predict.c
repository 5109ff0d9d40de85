// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Where the tip is now; see incise/predict.h. Gains after Kalata's tracking index
 * Λ = σa T²/σx, where σa is what acceleration changes in one period T and σx what the
 * tracker sees: Kalata, The tracking index, IEEE Trans. AES-20(2), 1984; the closed form
 * is Gray and Murray's, IEEE Trans. AES-29(3), 1993.
 */
#include <math.h>
#include <incise/clock.h>
#include "../base/vector.h"
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

/* Beyond these nothing is believed: no hand is that far, that fast, or pushed by 10 g. */
#define FAR_MM 1e4
#define FAST_MM_S 1e4
#define HARD_MM_S2 1e5

#define GAP_PERIODS 5
static double within(double x, double least, double most)
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
	double period_s = 1 / within(tracker->rate_hz, 1, 1e4);
	double change = sqrt(HAND_MM2_S5 * period_s);

	*p = (struct incise_predict){
		.period_s = period_s,
		.gap_ns = (int64_t)(GAP_PERIODS * period_s * INCISE_NS_PER_S),
		.latency_ns =
			(int64_t)within((double)tracker->latency_ns, 0, INCISE_NS_PER_S),
		.q = {1},
		.q_shown = {1},
	};
	set_gains(p, change * period_s * period_s /
			     within(noise_mm > 0 ? noise_mm : NOISE_MM, 1e-9, FAR_MM));
}

/* Never negative, and no overflow for any two times. */
static int64_t since(int64_t t_ns, int64_t from_ns)
{
	uint64_t gone = (uint64_t)t_ns - (uint64_t)from_ns;

	if (t_ns <= from_ns)
		return 0;
	return gone < INT64_MAX ? (int64_t)gone : INT64_MAX;
}

/* The filter's state at @t_ns. Extrapolation ends early: an old pose must not run away. */
static void extrapolate(const struct incise_predict *p, int64_t t_ns, double x[3],
			double v[3])
{
	int64_t ahead_ns = since(t_ns, p->t_ns),
		most_ns = p->gap_ns > INCISE_PREDICT_AHEAD_NS ? p->gap_ns
							      : INCISE_PREDICT_AHEAD_NS;
	double dt = (double)(ahead_ns < most_ns ? ahead_ns : most_ns) / INCISE_NS_PER_S;

	for (int i = 0; i < 3; i++) {
		x[i] = p->x[i] + (p->v[i] + p->a[i] * dt / 2) * dt;
		v[i] = within(p->v[i] + p->a[i] * dt, -FAST_MM_S, FAST_MM_S);
	}
}

static double dot4(const double a[4], const double b[4])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

static void turn_between(double q[4], const double from[4], const double to[4],
			 double share)
{
	double length;

	for (int i = 0; i < 4; i++)
		q[i] = share * from[i] + (1 - share) * to[i];
	/* Never near 0: add() takes the sign for which from · to ≥ 0. */
	length = sqrt(dot4(q, q));
	for (int i = 0; i < 4; i++)
		q[i] /= length;
}

/* Share left of the difference that was shown when the last pose arrived: 1 … 0. */
static double left(const struct incise_predict *p, int64_t t_ns)
{
	double gone_s = (double)since(t_ns, p->arrival_ns) / INCISE_NS_PER_S;

	return fmax(1 - gone_s / p->period_s, 0);
}

void incise_predict_at(const struct incise_predict *p, int64_t t_ns,
		       double position_mm[3], double velocity_mm_s[3], double attitude[4])
{
	double share = left(p, t_ns);

	extrapolate(p, t_ns, position_mm, velocity_mm_s);
	v3_add(position_mm, position_mm, share, p->x_shown);
	v3_add(velocity_mm_s, velocity_mm_s, share, p->v_shown);
	for (int i = 0; i < 3; i++)
		velocity_mm_s[i] = within(velocity_mm_s[i], -FAST_MM_S, FAST_MM_S);
	turn_between(attitude, p->q_shown, p->q, share);
}

void incise_predict_acceleration(const struct incise_predict *p, int64_t t_ns,
				 double acceleration_mm_s2[3])
{
	v3_add(acceleration_mm_s2, p->a, left(p, t_ns), p->a_shown);
	for (int i = 0; i < 3; i++)
		acceleration_mm_s2[i] =
			within(acceleration_mm_s2[i], -HARD_MM_S2, HARD_MM_S2);
}

static bool believable(const double x[3])
{
	return fabs(x[0]) < FAR_MM && fabs(x[1]) < FAR_MM && fabs(x[2]) < FAR_MM;
}

/* Of the two quaternions of an attitude, the one on the shorter way from q_shown. */
static void take_attitude(struct incise_predict *p, const double q[4])
{
	double length = sqrt(dot4(q, q));
	double sign = dot4(q, p->q_shown) < 0 ? -1 : 1;

	/* Devices round their numbers, but not by a tenth. */
	if (!(length > 0.9 && length < 1.1))
		return;
	for (int i = 0; i < 4; i++)
		p->q[i] = sign * q[i] / length;
}

/* Bring the state to @t_ns and correct it. Returns false when the pose is too far off. */
static bool correct(struct incise_predict *p, int64_t t_ns, const double position_mm[3])
{
	double x[3], v[3], miss[3];
	/*
	 * Gains are those of the nominal period: a filter that divided by the time that
	 * went by would make any speed of two poses a nanosecond apart.
	 */
	double per_s = 1 / p->period_s;

	extrapolate(p, t_ns, x, v);
	v3_sub(miss, position_mm, x);
	if (!(v3_length(miss) <= INCISE_PREDICT_JUMP_MM))
		return false;
	v3_add(p->x, x, p->alpha, miss);
	v3_add(p->v, v, p->beta * per_s, miss);
	v3_add(p->a, p->a, p->gamma * per_s * per_s, miss);
	for (int i = 0; i < 3; i++) {
		p->v[i] = within(p->v[i], -FAST_MM_S, FAST_MM_S);
		p->a[i] = within(p->a[i], -HARD_MM_S2, HARD_MM_S2);
	}
	return true;
}

void incise_predict_add(struct incise_predict *p,
			const struct incise_tracker_sample *sample)
{
	double shown[3], speed[3], hard[3], attitude[4], x[3], v[3], step[3];
	bool blend = p->started;
	int64_t t_ns;

	if (!believable(sample->position_mm) || sample->t_ns < 0)
		return;
	t_ns = sample->t_ns - p->latency_ns;
	if (p->started && t_ns <= p->t_ns)
		return;
	incise_predict_at(p, sample->t_ns, shown, speed, attitude);
	incise_predict_acceleration(p, sample->t_ns, hard);
	if (!p->started || since(t_ns, p->t_ns) > p->gap_ns ||
	    !correct(p, t_ns, sample->position_mm)) {
		v3_copy(p->x, sample->position_mm);
		for (int i = 0; i < 3; i++)
			p->v[i] = p->a[i] = 0;
		v3_sub(step, shown, p->x);
		blend = p->started && v3_length(step) <= INCISE_PREDICT_JUMP_MM;
		p->discontinuities += p->started && !blend;
	}
	p->started = true;
	p->t_ns = t_ns;
	p->arrival_ns = sample->t_ns;
	for (int i = 0; i < 4; i++)
		p->q_shown[i] = attitude[i];
	take_attitude(p, sample->quaternion);
	extrapolate(p, sample->t_ns, x, v);
	for (int i = 0; i < 3; i++) {
		p->x_shown[i] = blend ? shown[i] - x[i] : 0;
		p->v_shown[i] = blend ? speed[i] - v[i] : 0;
		p->a_shown[i] = blend ? hard[i] - p->a[i] : 0;
	}
	if (!blend)
		for (int i = 0; i < 4; i++)
			p->q_shown[i] = p->q[i];
}

int64_t incise_predict_age(const struct incise_predict *p, int64_t t_ns)
{
	return p->started ? since(t_ns, p->t_ns) : INT64_MAX;
}
