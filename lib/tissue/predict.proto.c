// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Where a point is now, by a tracker's poses; see ../control/predict.h for the filter and its source.
 *
 * In integers all steps stay within 63 bits. With |x| ≤ 10^4 mm (2^13.3), |v| ≤ 10^4 mm/s, |a| ≤ 10^5
 * mm/s² (2^16.7), dt ≤ 1/4 s (2^28 in Q30) and a miss ≤ 20 mm (2^4.4):
 *
 *   a dt         2^32.7 · 2^28 = 2^60.7        Q46, to Q20
 *   v + a dt/2   2^33.3 + 2^33.7 < 2^34.6      Q20
 *   that × dt    2^34.6 · 2^28 = 2^62.6        Q50, to Q32
 *   α miss       2^30 · 2^28.4 = 2^58.4        Q54, to Q32
 *   β miss       2^31 · 2^28.4 = 2^59.4        Q40, to Q20
 *   γ miss       2^31 · 2^28.4 = 2^59.4        Q36, to Q16
 *   |miss|²      3 · 2^57                      Q48; each component is held to 20 mm before
 *   x_shown      held to 4096 mm, 2^36 · 2^26 = 2^62   Q50, to Q32
 *   v_shown      2 · 10^4, 2^34.3 · 2^26 = 2^60.3
 *   a_shown      2 · 10^5, 2^33.6 · 2^26 = 2^59.6
 *   x            2^13.3 and what is added: below 2^15 mm, 2^47 in Q32
 */

/* Nothing is believed beyond: no hand is that far, that fast, or pushed by 10 g. */
#define FAR N(10000)
#define FAST (10000 * W_MM_S)
#define HARD (100000 * W_MM_S2)
#define JUMP (20 * W_MISS_MM)
#define SHOWN_MOST (4096 * W_MISS_MM)

void T(predict_init)(struct T(predict) *p)
{
	*p = (struct T(predict)){.q = {D_ONE}, .q_shown = {D_ONE}};
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
static void extrapolate(const struct T(predict) *p, const struct T(filter) *filter,
			int64_t t_ns, wide x[3], wide v[3])
{
	int64_t ahead_ns = since(t_ns, p->t_ns), most_ns = (int64_t)filter->ahead_ns;
	wide dt = w_seconds(ahead_ns < most_ns ? ahead_ns : most_ns);

	for (int i = 0; i < 3; i++) {
		wide change = w_times(p->a[i], dt, 26);

		x[i] = p->x[i] + w_times(p->v[i] + w_half(change), dt, 18);
		v[i] = w_within(p->v[i] + change, -FAST, FAST);
	}
}

/* Share left of the difference that was shown when the last pose arrived: 1 … 0. */
static wide left(const struct T(predict) *p, const struct T(filter) *filter, int64_t t_ns)
{
	return w_left(since(t_ns, p->arrival_ns), filter->period_ns);
}

/* As shown: the filter's, and the rest to blend out. */
static void show(const struct T(predict) *p, const struct T(filter) *filter, int64_t t_ns,
		 wide x[3], wide v[3])
{
	wide share = left(p, filter, t_ns);

	extrapolate(p, filter, t_ns, x, v);
	for (int i = 0; i < 3 && share > 0; i++) {
		x[i] += w_times(share, p->x_shown[i], 18);
		v[i] = w_within(v[i] + w_times(share, p->v_shown[i], 26), -FAST, FAST);
	}
}

void T(predict_at)(const struct T(predict) *p, const struct T(filter) *filter,
		   int64_t t_ns, num position[3], num velocity[3])
{
	wide x[3], v[3];

	show(p, filter, t_ns, x, v);
	for (int i = 0; i < 3; i++) {
		position[i] = n_place(x[i]);
		velocity[i] = n_speed(v[i]);
	}
}

void T(predict_acceleration)(const struct T(predict) *p, const struct T(filter) *filter,
			     int64_t t_ns, wide acceleration[3])
{
	wide share = left(p, filter, t_ns);

	for (int i = 0; i < 3; i++)
		acceleration[i] = w_within(p->a[i] + w_times(share, p->a_shown[i], 26),
					   -HARD, HARD);
}

void T(predict_attitude)(const struct T(predict) *p, const struct T(filter) *filter,
			 int64_t t_ns, dir attitude[4])
{
	wide share = left(p, filter, t_ns), q[4];

	for (int i = 0; i < 4; i++)
		q[i] = w_shifted(share * p->q_shown[i] + (W_SHARE - share) * p->q[i], 26);
	/* Never near 0: turn_to() takes the sign for which q_shown · q ≥ 0. */
	if (!d_unit4(attitude, q))
		for (int i = 0; i < 4; i++)
			attitude[i] = p->q[i];
}

/* The quaternion of an attitude that is on the shorter way from q_shown. */
static void turn_to(struct T(predict) *p, const dir quaternion[4])
{
	dir q[4];
	wide same = 0;

	if (!d_attitude(q, quaternion))
		return;
	for (int i = 0; i < 4; i++)
		same += (wide)q[i] * p->q_shown[i];
	for (int i = 0; i < 4; i++)
		p->q[i] = same < 0 ? -q[i] : q[i];
}

/* Bring the state to @t_ns and correct it. Returns false when the pose is too far off. */
static bool correct(struct T(predict) *p, const struct T(filter) *filter, int64_t t_ns,
		    const num position[3])
{
	wide x[3], v[3], miss[3];

	extrapolate(p, filter, t_ns, x, v);
	for (int i = 0; i < 3; i++)
		miss[i] = w_shifted(w_place(position[i]) - x[i], 8);
	if (!w_is_near(miss, JUMP))
		return false;
	/*
	 * Gains are for the nominal period: a filter that divided by the time that went by would make
	 * any speed of two poses a nanosecond apart.
	 */
	for (int i = 0; i < 3; i++) {
		p->x[i] = x[i] + w_times(filter->alpha, miss[i], 22);
		p->v[i] =
			w_within(v[i] + w_times(filter->beta, miss[i], 20), -FAST, FAST);
		p->a[i] = w_within(p->a[i] + w_times(filter->gamma, miss[i], 20), -HARD,
				   HARD);
	}
	return true;
}

/* Start again at a place. Returns whether the way there from the shown pose is no jump. */
static bool restart(struct T(predict) *p, const num position[3], const wide shown[3])
{
	wide step[3];

	for (int i = 0; i < 3; i++) {
		p->x[i] = w_place(position[i]);
		p->v[i] = p->a[i] = 0;
		step[i] = w_shifted(shown[i] - p->x[i], 8);
	}
	return w_is_near(step, JUMP);
}

static bool is_far(const num position[3])
{
	for (int i = 0; i < 3; i++)
		if (!n_below(position[i], FAR) || !n_below(-FAR, position[i]))
			return true;
	return false;
}

bool T(predict_add)(struct T(predict) *p, const struct T(filter) *filter,
		    const num position[3], const dir quaternion[4], int64_t t_ns)
{
	wide shown[3], speed[3], hard[3], x[3], v[3];
	int64_t acquired_ns;
	dir attitude[4];
	bool blend = p->started;

	if (is_far(position) || t_ns < 0)
		return false;
	acquired_ns = t_ns - (int64_t)filter->latency_ns;
	if (p->started && acquired_ns <= p->t_ns)
		return false;
	show(p, filter, t_ns, shown, speed);
	T(predict_acceleration)(p, filter, t_ns, hard);
	T(predict_attitude)(p, filter, t_ns, attitude);
	if (!p->started || since(acquired_ns, p->t_ns) > (int64_t)filter->gap_ns ||
	    !correct(p, filter, acquired_ns, position)) {
		blend = restart(p, position, shown) && p->started;
		p->discontinuities += p->started && !blend;
	}
	p->started = true;
	p->t_ns = acquired_ns;
	p->arrival_ns = t_ns;
	for (int i = 0; i < 4; i++)
		p->q_shown[i] = attitude[i];
	turn_to(p, quaternion);
	extrapolate(p, filter, t_ns, x, v);
	for (int i = 0; i < 3; i++) {
		wide step = w_shifted(shown[i] - x[i], 8);

		p->x_shown[i] = blend ? w_within(step, -SHOWN_MOST, SHOWN_MOST) : 0;
		p->v_shown[i] = blend ? speed[i] - v[i] : 0;
		p->a_shown[i] = blend ? hard[i] - p->a[i] : 0;
	}
	for (int i = 0; i < 4 && !blend; i++)
		p->q_shown[i] = p->q[i];
	return true;
}

int64_t T(predict_age)(const struct T(predict) *p, int64_t t_ns)
{
	return p->started ? since(t_ns, p->t_ns) : INT64_MAX;
}
