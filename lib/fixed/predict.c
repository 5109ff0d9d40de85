// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Where the tip is now, in integers; see predict.h. With |x| ≤ 10^4 mm (2^13.3) and |v| ≤ 10^4
 * mm/s, |a| ≤ 10^5 mm/s² (2^16.7), dt ≤ 1/4 s (2^28 in Q30), a miss ≤ 20 mm (2^4.4) all steps stay
 * within 63 bits:
 *
 *   a dt         2^32.7 · 2^28 = 2^60.7        Q46, to Q20
 *   v + a dt/2   2^33.3 + 2^33.7 < 2^34.6      Q20
 *   that × dt    2^34.6 · 2^28 = 2^62.6        Q50, to Q32
 *   α miss       2^30 · 2^28.4 = 2^58.4        Q54, to Q32
 *   β/T miss     2^31 · 2^28.4 = 2^59.4        Q40, to Q20
 *   γ/T² miss    2^31 · 2^28.4 = 2^59.4        Q36, to Q16
 *   |miss|²      3 · 2^57                      Q48; each component is held to 20 mm before
 *   x_shown      held to 4096 mm, 2^36 · 2^26 = 2^62   Q50, to Q32
 *   v_shown      2 · 10^4, 2^34.3 · 2^26 = 2^60.3
 *   a_shown      2 · 10^5, 2^33.6 · 2^26 = 2^59.6
 *   x            2^13.3 and what is added: below 2^15 mm, 2^47 in Q32
 */
#include "predict.h"
#include "vector.h"

#define MM ((int64_t)1 << 32)	/* of x */
#define MM_S ((int64_t)1 << 20) /* of v */
#define MM_S2 ((int64_t)1 << 16)
#define FAST (10000 * MM_S)
#define HARD (100000 * MM_S2)
#define JUMP ((int64_t)20 << 24) /* of a miss, Q24 */
#define SHOWN_MAX ((int64_t)4096 << 24)

#define SHARE_BITS 26
#define SHARE_ONE ((int64_t)1 << SHARE_BITS)

bool incise_fixed_filter_good(const struct incise_fixed_filter *filter)
{
	return filter->alpha >= 0 && filter->alpha <= INCISE_FIXED_UNIT &&
	       filter->beta >= 0 && filter->gamma >= 0 &&
	       filter->period_ns >= INCISE_FIXED_PERIOD_MIN_NS &&
	       filter->period_ns <= INCISE_FIXED_PERIOD_MAX_NS &&
	       filter->latency_ns >= 0 && filter->latency_ns <= 1000000000 &&
	       filter->gap_ns >= 0 && filter->gap_ns <= INCISE_FIXED_AHEAD_MAX_NS &&
	       filter->ahead_ns >= 0 && filter->ahead_ns <= INCISE_FIXED_AHEAD_MAX_NS &&
	       !filter->reserved;
}

void incise_fixed_predict_init(struct incise_fixed_predict *p)
{
	*p = (struct incise_fixed_predict){.q = {INCISE_FIXED_UNIT},
					   .q_shown = {INCISE_FIXED_UNIT}};
}

/* Never negative, and no overflow for any two times. */
static int64_t since(int64_t t_ns, int64_t from_ns)
{
	uint64_t gone = (uint64_t)t_ns - (uint64_t)from_ns;

	if (t_ns <= from_ns)
		return 0;
	return gone < INT64_MAX ? (int64_t)gone : INT64_MAX;
}

/* ns to s in Q30, to 2^28: 2^30 / 10^9 is 1.073741824, in Q32 below. */
static int64_t seconds(int64_t ns)
{
	return (ns * 4611686018) >> 32;
}

/* The filter's state at @t_ns. Extrapolation ends early: an old pose must not run away. */
static void extrapolate(const struct incise_fixed_predict *p,
			const struct incise_fixed_filter *filter, int64_t t_ns,
			int64_t x[3], int64_t v[3])
{
	int64_t ahead_ns = since(t_ns, p->t_ns), dt;

	dt = seconds(ahead_ns < filter->ahead_ns ? ahead_ns : filter->ahead_ns);
	for (int i = 0; i < 3; i++) {
		int64_t change = incise_fx_rounded(p->a[i] * dt, 26);
		int64_t mean = p->v[i] + change / 2;

		x[i] = p->x[i] + incise_fx_rounded(mean * dt, 18);
		v[i] = incise_fx_hold(p->v[i] + change, FAST);
	}
}

/* Share left of the difference that was shown when the last pose arrived: 1 … 0. */
static int64_t left(const struct incise_fixed_predict *p,
		    const struct incise_fixed_filter *filter, int64_t t_ns)
{
	int64_t gone_ns = since(t_ns, p->arrival_ns);

	if (gone_ns >= filter->period_ns)
		return 0;
	return (int64_t)div_u64((uint64_t)(filter->period_ns - gone_ns) << SHARE_BITS,
				(uint32_t)filter->period_ns);
}

/* As shown: the filter's, and what is left to blend out. */
static void show(const struct incise_fixed_predict *p,
		 const struct incise_fixed_filter *filter, int64_t t_ns, int64_t x[3],
		 int64_t v[3])
{
	int64_t share = left(p, filter, t_ns);

	extrapolate(p, filter, t_ns, x, v);
	for (int i = 0; i < 3 && share; i++) {
		x[i] += incise_fx_rounded(share * p->x_shown[i], SHARE_BITS - 8);
		v[i] += incise_fx_rounded(share * p->v_shown[i], SHARE_BITS);
		v[i] = incise_fx_hold(v[i], FAST);
	}
}

void incise_fixed_predict_at(const struct incise_fixed_predict *p,
			     const struct incise_fixed_filter *filter, int64_t t_ns,
			     int32_t position[3], int32_t velocity[3])
{
	int64_t x[3], v[3];

	show(p, filter, t_ns, x, v);
	for (int i = 0; i < 3; i++) {
		position[i] = incise_fx_hold32(incise_fx_rounded(x[i], 16));
		velocity[i] = (int32_t)incise_fx_rounded(v[i], 4);
	}
}

void incise_fixed_predict_acceleration(const struct incise_fixed_predict *p,
				       const struct incise_fixed_filter *filter,
				       int64_t t_ns, int64_t acceleration[3])
{
	int64_t share = left(p, filter, t_ns);

	for (int i = 0; i < 3; i++)
		acceleration[i] = incise_fx_hold(
			p->a[i] + incise_fx_rounded(share * p->a_shown[i], SHARE_BITS),
			HARD);
}

void incise_fixed_predict_attitude(const struct incise_fixed_predict *p,
				   const struct incise_fixed_filter *filter, int64_t t_ns,
				   int32_t attitude[4])
{
	int64_t share = left(p, filter, t_ns), q[4];

	for (int i = 0; i < 4; i++)
		q[i] = incise_fx_rounded(share * p->q_shown[i] +
						 (SHARE_ONE - share) * p->q[i],
					 SHARE_BITS);
	/* Never near 0: take_attitude() takes the sign for which q_shown · q ≥ 0. */
	if (!incise_fx_unit(attitude, q, 4, 0))
		for (int i = 0; i < 4; i++)
			attitude[i] = p->q[i];
}

bool incise_fixed_attitude(int32_t to[4], const int32_t quaternion[4])
{
	/* 0.9 and 1.1, squared, in Q60. */
	const int64_t least = ((int64_t)1 << 60) / 100 * 81,
		      most = ((int64_t)1 << 60) / 100 * 121;
	const int32_t largest = INCISE_FIXED_UNIT / 10 * 11;
	int64_t length2 = 0, q[4];

	for (int i = 0; i < 4; i++) {
		/* 4 · (1.1 · 2^30)² < 2^62.3 */
		if (quaternion[i] > largest || quaternion[i] < -largest)
			return false;
		length2 += (int64_t)quaternion[i] * quaternion[i];
		q[i] = quaternion[i];
	}
	return length2 > least && length2 < most && incise_fx_unit(to, q, 4, 0);
}

/* Of the two quaternions of an attitude, the one on the shorter way from q_shown. */
static void take_attitude(struct incise_fixed_predict *p, const int32_t given[4])
{
	int32_t q[4];
	int64_t same = 0;

	if (!incise_fixed_attitude(q, given))
		return;
	for (int i = 0; i < 4; i++)
		same += (int64_t)q[i] * p->q_shown[i];
	for (int i = 0; i < 4; i++)
		p->q[i] = same < 0 ? -q[i] : q[i];
}

/* Whether a difference is not longer than a hand can have made it; Q24, else held. */
static bool is_near(int64_t miss[3])
{
	int64_t length2 = 0;

	for (int i = 0; i < 3; i++) {
		if (miss[i] > JUMP || miss[i] < -JUMP)
			return false;
		length2 += miss[i] * miss[i];
	}
	return length2 <= JUMP * JUMP;
}

/* Bring the state to @t_ns and correct it. Returns false when the pose is too far off. */
static bool correct(struct incise_fixed_predict *p,
		    const struct incise_fixed_filter *filter, int64_t t_ns,
		    const int32_t position[3])
{
	int64_t x[3], v[3], miss[3];

	extrapolate(p, filter, t_ns, x, v);
	for (int i = 0; i < 3; i++)
		miss[i] = incise_fx_rounded(position[i] * (MM >> 16) - x[i], 8);
	if (!is_near(miss))
		return false;
	for (int i = 0; i < 3; i++) {
		p->x[i] = x[i] + incise_fx_rounded(filter->alpha * miss[i], 22);
		p->v[i] = incise_fx_hold(
			v[i] + incise_fx_rounded(filter->beta * miss[i], 20), FAST);
		p->a[i] = incise_fx_hold(
			p->a[i] + incise_fx_rounded(filter->gamma * miss[i], 20), HARD);
	}
	return true;
}

/* The way from what was shown to the pose that the filter restarts with is no jump. */
static bool blends(const int64_t shown[3], const int64_t x[3])
{
	int64_t step[3];

	for (int i = 0; i < 3; i++)
		step[i] = incise_fx_rounded(shown[i] - x[i], 8);
	return is_near(step);
}

bool incise_fixed_predict_add(struct incise_fixed_predict *p,
			      const struct incise_fixed_filter *filter,
			      const int32_t position[3], const int32_t quaternion[4],
			      int64_t t_ns)
{
	const int32_t far = INCISE_FIXED_FAR_MM * (1 << 16);
	int64_t shown[3], speed[3], hard[3], x[3], v[3], acquired_ns;
	int32_t attitude[4];
	bool blend = p->started;

	for (int i = 0; i < 3; i++)
		if (position[i] >= far || position[i] <= -far)
			return false;
	if (t_ns < 0)
		return false;
	acquired_ns = t_ns - filter->latency_ns;
	if (p->started && acquired_ns <= p->t_ns)
		return false;
	show(p, filter, t_ns, shown, speed);
	incise_fixed_predict_acceleration(p, filter, t_ns, hard);
	incise_fixed_predict_attitude(p, filter, t_ns, attitude);
	if (!p->started || since(acquired_ns, p->t_ns) > filter->gap_ns ||
	    !correct(p, filter, acquired_ns, position)) {
		for (int i = 0; i < 3; i++) {
			p->x[i] = position[i] * (MM >> 16);
			p->v[i] = p->a[i] = 0;
		}
		blend = p->started && blends(shown, p->x);
		p->discontinuities += p->started && !blend;
	}
	p->started = true;
	p->t_ns = acquired_ns;
	p->arrival_ns = t_ns;
	for (int i = 0; i < 4; i++)
		p->q_shown[i] = attitude[i];
	take_attitude(p, quaternion);
	extrapolate(p, filter, t_ns, x, v);
	for (int i = 0; i < 3; i++) {
		int64_t step = incise_fx_rounded(shown[i] - x[i], 8);

		p->x_shown[i] = blend ? incise_fx_hold(step, SHOWN_MAX) : 0;
		p->v_shown[i] = blend ? speed[i] - v[i] : 0;
		p->a_shown[i] = blend ? hard[i] - p->a[i] : 0;
	}
	for (int i = 0; i < 4 && !blend; i++)
		p->q_shown[i] = p->q[i];
	return true;
}

int64_t incise_fixed_predict_age(const struct incise_fixed_predict *p, int64_t t_ns)
{
	return p->started ? since(t_ns, p->t_ns) : INT64_MAX;
}
