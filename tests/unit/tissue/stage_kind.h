/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Stages of a tick for one kind of numbers, by doubles; stage_kinds.h includes it once for each kind,
 * between ../../../lib/number/NAME_kind.h and no_kind.h.
 */
static struct {
	struct T(plan) plan;
	struct T(state) state;
	struct T(tick) tick;
} T(tried);

/* --- predict --- */

static bool T(set_filter)(const struct incise_double_filter *from)
{
	struct T(filter) *filter = &T(tried).plan.numbers.filter;

	SET(filter->alpha, from->alpha, 30);
	SET(filter->beta, from->beta, 16);
	SET(filter->gamma, from->gamma, 12);
	SET(filter->period_ns, from->period_ns, 0);
	SET(filter->latency_ns, from->latency_ns, 0);
	SET(filter->gap_ns, from->gap_ns, 0);
	SET(filter->ahead_ns, from->ahead_ns, 0);
	T(predict_init)(&T(tried).state.scalpel);
	return FILTER_GOOD(filter);
}

static bool T(add_pose)(const struct incise_tracker_sample *sample)
{
	num position[3];
	dir quaternion[4];

	SET_ALL(position, sample->position_mm, 16);
	SET_ALL(quaternion, sample->quaternion, 30);
	return T(predict_add)(&T(tried).state.scalpel, &T(tried).plan.numbers.filter,
			      position, quaternion, sample->t_ns);
}

static struct shown T(show)(int64_t t_ns)
{
	const struct T(predict) *p = &T(tried).state.scalpel;
	const struct T(filter) *filter = &T(tried).plan.numbers.filter;
	struct shown shown;
	num x[3], v[3];
	wide a[3];
	dir q[4];

	T(predict_at)(p, filter, t_ns, x, v);
	T(predict_acceleration)(p, filter, t_ns, a);
	T(predict_attitude)(p, filter, t_ns, q);
	GET_ALL(shown.x, x, 16);
	GET_ALL(shown.v, v, 16);
	GET_ALL(shown.a, a, 16);
	GET_ALL(shown.q, q, 30);
	shown.age_ns = T(predict_age)(p, t_ns);
	return shown;
}

static struct filtered T(filtered)(void)
{
	const struct T(predict) *p = &T(tried).state.scalpel;
	struct filtered now = {.t_ns = p->t_ns, .discontinuities = p->discontinuities};

	GET_ALL(now.x, p->x, 32);
	GET_ALL(now.v, p->v, 20);
	GET_ALL(now.a, p->a, 16);
	return now;
}

static void T(turn_about)(double mm_s, double mm_s2, double shown_mm_s)
{
	struct T(predict) *p = &T(tried).state.scalpel;

	SET(p->v[0], mm_s, 20);
	SET(p->a[0], mm_s2, 16);
	SET(p->v_shown[0], shown_mm_s, 20);
	p->arrival_ns = p->t_ns + (int64_t)T(tried).plan.numbers.filter.period_ns;
}

/* --- normal --- */

/* Average over so many ticks, on the plane z = 0. */
static void T(set_average)(int ticks)
{
	memset(&T(tried), 0, sizeof(T(tried)));
	T(tried).plan.numbers.average_ticks = ticks;
	SET_PLANE(&T(tried));
}

static void T(average)(const double normal[3], double averaged[3])
{
	struct T(tick) *tick = &T(tried).tick;

	SET_ALL(T(tried).state.sn, normal, 30);
	SET_ALL(tick->normal, normal, 30);
	tick->phase = INCISE_PHASE_CUTTING;
	T(stage_normal)(&T(tried).plan, &T(tried).state, tick);
	GET_ALL(averaged, tick->normal, 30);
}

/* A tick with the tool at a height; the normal after it. */
static void T(touch)(double height_mm, double averaged[3])
{
	struct T(tick) *tick = &T(tried).tick;

	*tick = (struct T(tick)){0};
	SET(tick->tool[2], height_mm, 16);
	T(stage_contact)(&T(tried).plan, &T(tried).state, tick);
	T(stage_normal)(&T(tried).plan, &T(tried).state, tick);
	GET_ALL(averaged, tick->normal, 30);
}

/* --- start and limit --- */

/* It begins at half the force, or before a small one. */
static void T(set_start)(int64_t ramp_ns, int64_t fade_ns, bool half, int64_t last_ns)
{
	memset(&T(tried), 0, sizeof(T(tried)));
	SET(T(tried).plan.numbers.small, 0.1, 16);
	T(tried).plan.numbers.ramp_ns = (period)ramp_ns;
	T(tried).plan.numbers.fade_ns = (period)fade_ns;
	SET(T(tried).state.gain, half ? 0.5 : 0, 30);
	T(tried).state.released = half;
	T(tried).state.last_ns = last_ns;
}

/* The gain; the force that is asked for is along y. */
static double T(start)(double wanted_N, enum poses poses, int64_t t_ns, bool *released,
		       double *command_N)
{
	struct T(tick) *tick = &T(tried).tick;

	*tick = (struct T(tick)){.t_ns = t_ns};
	tick->flags = poses == STALE ? INCISE_TICK_STALE : 0;
	T(tried).state.fading = poses == FADING;
	T(tried).state.changing = poses == CHANGING;
	SET(T(tried).state.force[1], wanted_N, 16);
	T(stage_start)(&T(tried).plan, &T(tried).state, tick);
	assert_int_equal(!!(tick->flags & INCISE_TICK_STARTING),
			 GET(T(tried).state.gain, 30) < 1);
	*released = T(tried).state.released;
	*command_N = GET(tick->command[1], 16);
	return GET(T(tried).state.gain, 30);
}

static void T(set_limit)(double force_N, double slew_N, const double last_N[3])
{
	memset(&T(tried), 0, sizeof(T(tried)));
	SET(T(tried).plan.numbers.force, force_N, 16);
	SET(T(tried).plan.numbers.slew, slew_N, 16);
	for (int i = 0; i < 3; i++)
		SET(T(tried).state.last[i], last_N[i], 16);
}

/* The force in place of the one asked for; returns flags. */
static uint32_t T(limit)(double force_N[3])
{
	struct T(tick) *tick = &T(tried).tick;

	*tick = (struct T(tick)){0};
	SET_ALL(tick->command, force_N, 16);
	T(stage_limit)(&T(tried).plan, &T(tried).state, tick);
	GET_ALL(force_N, tick->command, 16);
	for (int i = 0; i < 3; i++)
		assert_true(GET(T(tried).state.last[i], 16) == force_N[i]);
	return tick->flags;
}

static double T(number)(double value)
{
	num n;

	SET(n, value, 16);
	return GET(n, 16);
}
