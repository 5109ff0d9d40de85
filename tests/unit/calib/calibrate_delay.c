// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Delays of streams of one motion: truth within the stated intervals, with stiffness and
 * viscosity that are not known; each motion that is not sufficient is refused with its reason. An
 * argument is the number of data sets, 200 or what is given.
 */
#include "../unit.h"
#include <lapacke.h>
#include <incise/calibrate_delay.h>
#include "../../../lib/calib/calibrate_delay.c"
#include "../cases.h"
#include "draws.h"

#define MOTION_MAX 20000
#define OTHER_MAX 200000

static struct incise_delay_point motion[MOTION_MAX], other[OTHER_MAX];
static int n_motion, n_other;
static int force_runs, camera_runs;

/* A tool that is moved up and down, by hand; mm and mm/s, into the tissue is positive. */
struct hand {
	double hz, swing_hz, half_mm, middle_mm, phase;
};

static double depth_at(const struct hand *h, double t, double *v)
{
	double w = 2 * M_PI * 0.13;
	double angle = 2 * M_PI * (h->hz * t - h->swing_hz / w * cos(w * t)) + h->phase;

	*v = -h->half_mm * 2 * M_PI * (h->hz + h->swing_hz * sin(w * t)) * sin(angle);
	return h->middle_mm + h->half_mm * cos(angle);
}

static const struct hand usual = {2, 1.1, 5.5, 2.5, 0.7};

/* The relation between motion and the other stream. */
struct link {
	double delay_ms, drift_ms; /* of the motion's timestamps */
	double contact_mm;
	double stiff[2]; /* N/mm, N/mm² */
	double viscous;	 /* of the stiffness, s/mm: the force leads */
	double even;	 /* of the stiffness, as the virtual tissue's */
	double noise_mm, noise, hz, other_hz, span_s;
	double clip; /* a larger force is none */
};

static const struct link force_link = {
	.contact_mm = 0.4,
	.stiff = {0.045, 0.0028},
	.viscous = 0.002,
	.even = 0.35,
	.noise_mm = 0.02,
	.noise = 0.0024,
	.hz = 120,
	.other_hz = 2500,
	.span_s = 15,
	.clip = 100,
};

static void make_motion(const struct hand *h, const struct link *l)
{
	n_motion = (int)(l->span_s * l->hz);
	for (int i = 0; i < n_motion; i++) {
		double t = i / l->hz, v;
		double delay = l->delay_ms + l->drift_ms * (t / l->span_s - 0.5);

		motion[i].t_ns = 1000000000 + (int64_t)(t * 1e9);
		motion[i].value =
			depth_at(h, t - delay * 1e-3, &v) + l->noise_mm * normal();
	}
}

static void make_force(const struct hand *h, const struct link *l)
{
	make_motion(h, l);
	n_other = (int)(l->span_s * l->other_hz);
	for (int i = 0; i < n_other; i++) {
		double t = i / l->other_hz, v, x = depth_at(h, t, &v) - l->contact_mm;
		double f = 0;

		if (x > 0)
			f = (l->stiff[0] * x + l->stiff[1] * x * x) *
			    (1 + l->viscous * v + l->even * fabs(v) / (fabs(v) + 15));
		f += l->noise * normal();
		other[i].t_ns = 1000000000 + (int64_t)(t * 1e9);
		other[i].value = f > l->clip ? NAN : f;
	}
}

/* A camera that sees depth below the surface only, at 50 Hz. */
static void make_camera(const struct hand *h, const struct link *l)
{
	make_motion(h, l);
	n_other = (int)(l->span_s * l->other_hz);
	for (int i = 0; i < n_other; i++) {
		double t = i / l->other_hz + 0.0037, v, x = depth_at(h, t, &v);

		other[i].t_ns = 1000000000 + (int64_t)(t * 1e9);
		other[i].value = 1.01 * fmax(l->contact_mm, x) + l->noise * normal();
	}
}

static int fit(enum incise_delay_relation relation, double range_ms,
	       struct incise_delay_fit *f, struct incise_error *err)
{
	memset(err, 0, sizeof(*err));
	return incise_calibrate_delay(motion, n_motion, other, n_other, relation,
				      range_ms, f, err);
}

static void check_share(const char *what, int in, int by_u, int n, double worst)
{
	print_message("%s: %d data sets, 95 %% interval holds %.1f %%, ±2 u %.1f %%, "
		      "farthest %.3f ms\n",
		      what, n, 100.0 * in / n, 100.0 * by_u / n, worst);
	assert_true(cases_hold(in, n, 0.95));
	assert_true(worst < 0.3); /* asked */
}

static void draw_hand(struct hand *h)
{
	*h = usual;
	h->hz = 1.7 + 0.6 * uniform();
	h->swing_hz = 0.8 + 0.5 * uniform();
	h->phase = 2 * M_PI * uniform();
}

TEST(test_force_intervals)
{
	int in = 0, by_u = 0;
	double worst = 0;

	for (int run = 1; run <= force_runs; run++) {
		struct link l = force_link;
		struct incise_delay_fit f;
		struct hand h;

		seed = (uint64_t)run;
		draw_hand(&h);
		l.delay_ms = 40 * uniform() - 10;
		l.contact_mm = 2 * uniform() - 1;
		l.viscous = 0.004 * uniform();
		l.even = 0.5 * uniform();
		make_force(&h, &l);
		if (fit(INCISE_DELAY_FORCE, 100, &f, &err))
			fail_msg("run %d: %s", run, err.text);
		in += l.delay_ms >= f.low_ms && l.delay_ms <= f.high_ms;
		by_u += fabs(l.delay_ms - f.delay_ms) <= 2 * f.sd_ms;
		worst = fmax(worst, fabs(l.delay_ms - f.delay_ms));
	}
	check_share("force", in, by_u, force_runs, worst);
}

TEST(test_camera_intervals)
{
	int in = 0, by_u = 0;
	double worst = 0;

	for (int run = 1; run <= camera_runs; run++) {
		struct link l = force_link;
		struct incise_delay_fit f;
		struct hand h;

		seed = (uint64_t)run;
		draw_hand(&h);
		l.delay_ms = 60 * uniform() - 50;
		l.contact_mm = run % 2 ? -100 : 0.5 * uniform();
		l.other_hz = 50;
		l.noise = 0.02;
		make_camera(&h, &l);
		if (fit(INCISE_DELAY_ALIKE, 100, &f, &err))
			fail_msg("run %d: %s", run, err.text);
		in += l.delay_ms >= f.low_ms && l.delay_ms <= f.high_ms;
		by_u += fabs(l.delay_ms - f.delay_ms) <= 2 * f.sd_ms;
		worst = fmax(worst, fabs(l.delay_ms - f.delay_ms));
	}
	check_share("camera", in, by_u, camera_runs, worst);
}

/* A delay that grows is found to, and one that does not is not. */
TEST(test_drift)
{
	for (int drifts = 0; drifts < 2; drifts++) {
		struct link l = force_link;
		struct incise_delay_fit f;

		seed = 9;
		l.delay_ms = 5;
		l.drift_ms = drifts ? 3 : 0;
		make_force(&usual, &l);
		assert_int_equal(fit(INCISE_DELAY_FORCE, 100, &f, &err), 0);
		assert_true(fabs(f.drift_ms - l.drift_ms) < 4 * f.drift_sd_ms);
		assert_true(f.drift_sd_ms < 0.5);
		assert_true(fabs(f.delay_ms - 5) < 0.3);
		assert_true(f.correlation > 0.99);
	}
}

TEST(test_refusals)
{
	const struct hand even = {8, 0, 5.5, 2.5, 0}, small = {2, 1.1, 0.2, 2.5, 0};
	struct link brief = force_link, loud = force_link, late = force_link,
		    clipped = force_link;
	struct incise_delay_fit f;

	brief.span_s = 5;
	loud.noise = 5;
	late.delay_ms = 118;
	clipped.clip = 0.01;
	const struct {
		const struct hand *hand;
		const struct link *link;
		const char *said;
	} cases[] = {
		{&even, &force_link, "periodic"}, {&small, &force_link, "motion"},
		{&usual, &brief, "common"},	  {&usual, &loud, "correlate"},
		{&usual, &late, "beyond"},	  {&usual, &clipped, "clipped"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		seed = 3;
		make_force(cases[i].hand, cases[i].link);
		if (!fit(INCISE_DELAY_FORCE, i == 4 ? 100 : 150, &f, &err))
			fail_msg("case %zu is taken: %g ms", i, f.delay_ms);
		assert_says(err.text, cases[i].said);
	}
	make_force(&usual, &force_link);
	motion[50].t_ns = motion[49].t_ns;
	assert_int_equal(fit(INCISE_DELAY_FORCE, 100, &f, &err), -EINVAL);
}

#define ROWS 60
#define M 4

static double rows[ROWS][M], right[ROWS];

static void make_rows(void)
{
	const uint64_t key = incise_random_key(7, INCISE_RANDOM_FORCE);

	for (int i = 0; i < ROWS; i++) {
		/* of very different size: columns are scaled alike first */
		for (int j = 0; j < M; j++)
			rows[i][j] = pow(100, j - 1) *
				     incise_random_normal(key, i * (M + 1) + j);
		right[i] = incise_random_normal(key, i * (M + 1) + M);
	}
}

static struct normal normal_of(int from, int to)
{
	struct normal normal = {.m = M};

	for (int i = from; i < to; i++)
		add_calibrate_delay_row(&normal, rows[i], right[i]);
	return normal;
}

TEST(solution_is_that_of_the_rows)
{
	struct normal normal;
	double a[ROWS][M], x[UNKNOWNS], b[ROWS];

	make_rows();
	normal = normal_of(0, ROWS);
	assert_true(solve_calibrate_delay(&normal, x));
	memcpy(a, rows, sizeof(a));
	memcpy(b, right, sizeof(b));
	assert_int_equal(LAPACKE_dgels(LAPACK_ROW_MAJOR, 'N', ROWS, M, 1, *a, M, b, 1),
			 0);
	/* 1e-12 is added to the scaled diagonal; the condition there is about 1 */
	for (int j = 0; j < M; j++)
		assert_true(fabs(x[j] - b[j]) < 1e-10 * fabs(b[j]) + 1e-15);
}

TEST(parts_add_up)
{
	struct normal whole, parts;

	make_rows();
	whole = normal_of(0, ROWS);
	parts = normal_of(0, 20);
	for (int from = 20; from < ROWS; from += 20) {
		struct normal part = normal_of(from, from + 20);

		add_normal(&parts, &part);
	}
	/* sums in another order */
	assert_true(fabs(parts.yy - whole.yy) < 1e-12 * whole.yy);
	for (int i = 0; i < M; i++) {
		assert_true(fabs(parts.b[i] - whole.b[i]) <
			    1e-12 * sqrt(whole.a[i * M + i] * whole.yy));
		for (int j = 0; j <= i; j++)
			assert_true(
				fabs(parts.a[i * M + j] - whole.a[i * M + j]) <
				1e-12 * sqrt(whole.a[i * M + i] * whole.a[j * M + j]));
	}
}

TEST(what_says_nothing_gets_nothing)
{
	struct normal normal;
	double x[UNKNOWNS];

	make_rows();
	for (int i = 0; i < ROWS; i++)
		rows[i][2] = 0;
	normal = normal_of(0, ROWS);
	assert_true(solve_calibrate_delay(&normal, x));
	assert_true(x[2] == 0 && x[0] != 0 && x[3] != 0);
	normal.a[0] = NAN;
	assert_false(solve_calibrate_delay(&normal, x));
	normal.a[0] = -1;
	assert_false(solve_calibrate_delay(&normal, x));
}

static int set_cases(void **state)
{
	force_runs = cases_of(40, 10);
	camera_runs = cases_of(200, 40);
	return 0;
}

GROUP(set_cases, NULL);
