// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/calib/calibrate_stepper.c: actuators of known truth, and what must be refused. The actuator here
 * is not the virtual rig's: its turns are written down in closed form, from the way since the
 * turn.
 */
#include "../unit.h"
#include <incise/calibrate_stepper.h>
#include "../../../lib/base/random.h"
#include "../../../lib/calib/calibrate_stepper.c"

#define STEP_MM 0.000625
#define POINTS_MAX 2000

struct truth {
	double N_mm, backlash_mm, loss_N, stiction_N, noise_N, zero_N;
	double gain; /* the sensor's: 1 is what it is calibrated for */
	double bend; /* of the spring, relative at the end of the range */
	double range_mm;
	int strokes, points; /* of one way; in a stroke */
	uint64_t seed;
};

static const struct truth usual = {
	.N_mm = 2,
	.backlash_mm = 0.05,
	.noise_N = 2e-4,
	.zero_N = 0.02,
	.gain = 1,
	.range_mm = 1.5,
	.strokes = 3,
	.points = 70,
};

/* Difference between the branch's line and the force, at a distance s behind the turn. */
static double behind_N(const struct truth *t, double s)
{
	double dead = t->backlash_mm + t->stiction_N / t->N_mm;
	/* between the lines: what is lost, less what the loss brings back */
	double D = t->backlash_mm - t->loss_N / t->N_mm;

	if (s <= dead)
		return t->N_mm * (s - D);
	return t->loss_N * fmax(0, 1 - (s - dead) / 0.1);
}

static int make(const struct truth *t, struct incise_calibrate_stepper_point *points)
{
	const uint64_t key = incise_random_key(t->seed, INCISE_RANDOM_FORCE);
	const double D = t->backlash_mm - t->loss_N / t->N_mm;
	int n = 0;

	for (int k = 0; k < 2 * t->strokes; k++)
		for (int i = 0; i < t->points; i++) {
			/* four times as many in the first quarter */
			double share = (double)i / (t->points - 1) * 7 / 4;
			double s, x, F;

			share = share < 1 ? share / 4 : 0.25 + (share - 1);
			s = round(share * t->range_mm / STEP_MM) * STEP_MM;
			x = 1 + (k % 2 ? t->range_mm - s : s);
			F = t->N_mm * (x - 1) + (k % 2 ? D : 0) * t->N_mm;
			F += t->bend * t->N_mm * (x - 1) * ((x - 1) / t->range_mm - 1);
			F += k % 2 ? behind_N(t, s) : k ? -behind_N(t, s) : 0;
			F = t->zero_N + t->gain * F +
			    t->noise_N * incise_random_normal(key, n);
			if (k && !i)
				continue; /* the turning point is there */
			points[n++] = (struct incise_calibrate_stepper_point){x, F};
		}
	return n;
}

static int run(const struct truth *t, struct incise_calibrate_stepper *result,
	       struct incise_error *err)
{
	static struct incise_calibrate_stepper_point points[POINTS_MAX];
	struct incise_calibrate_stepper_setup setup;
	int n = make(t, points);

	incise_calibrate_stepper_init(&setup);
	setup.sensor_u = 0.001;
	return incise_calibrate_stepper(points, n, &setup, result, NULL, err);
}

TEST(finds_what_is_there)
{
	/* backlash mm, loss N, stiction N */
	static const double row[][3] = {
		{0.05, 0, 0},	 {0, 0, 0},	    {0.05, 0.06, 0},
		{0.05, 0, 0.06}, {0, 0.06, 0},	    {0.15, 0, 0},
		{0, 0, 0.08},	 {0.1, 0.05, 0.08}, {0.004, 0, 0},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		struct truth t = usual;
		struct incise_calibrate_stepper r;

		t.backlash_mm = row[i][0];
		t.loss_N = row[i][1];
		t.stiction_N = row[i][2];
		if (run(&t, &r, &err))
			fail_msg("row %zu: %s", i, err.text);
		/* Noise of 0.2 mN over 400 points and 1.5 mm: 2e-5 N/mm; five of them. */
		assert_true(fabs(r.N_mm - 2) < 1e-4 && r.pass);
		assert_true(fabs(r.N_step - r.N_mm * STEP_MM) < 1e-15);
		/* Points behind a turn are 5.3 µm apart, which is 11 mN. */
		assert_true(fabs(r.backlash_mm - t.backlash_mm) < 0.006);
		assert_true(fabs(r.hysteresis_N - t.loss_N) < 0.012);
		assert_true(fabs(r.stiction_N - t.stiction_N) < 0.012);
		if (!t.loss_N && !t.stiction_N)
			assert_true(fabs(r.backlash_mm - t.backlash_mm) < 5e-4);
	}
}

static double uniform(uint64_t key, int i, double low, double high)
{
	return low + (high - low) * incise_random_uniform(key, i);
}

/*
 * The interval of 95 % has to hold the truth in 92 to 98 of 100, which is 2 sd of 200 draws to
 * both sides (of seeds up to 1000: 95.0 %); that of the backlash, whose shape is searched for,
 * may be too wide.
 */
TEST(intervals_hold_the_truth)
{
	int held = 0, held_backlash = 0;

	for (int seed = 1; seed <= 200; seed++) {
		const uint64_t key = incise_random_key(seed, INCISE_RANDOM_SURGEON);
		struct truth t = usual;
		struct incise_calibrate_stepper r;

		t.seed = seed;
		t.N_mm = uniform(key, 0, 0.5, 4);
		t.range_mm = 3 / t.N_mm;
		t.backlash_mm = uniform(key, 1, 0, 0.08) * t.range_mm;
		t.loss_N = seed % 3 == 1 ? uniform(key, 2, 0, 0.1) : 0;
		t.stiction_N = seed % 3 == 2 ? uniform(key, 3, 0, 0.1) : 0;
		/* small to as much as the sensor's own: which part leads must not matter */
		t.noise_N = pow(10, uniform(key, 4, -4, -1.8));
		t.strokes = 2 + seed % 4;
		t.gain = 1 + 0.001 * incise_random_normal(key, 5);
		if (run(&t, &r, &err))
			fail_msg("seed %d: %s", seed, err.text);
		held += fabs(r.N_step - t.N_mm * STEP_MM) <= 2 * r.N_step_u;
		held_backlash +=
			fabs(r.backlash_mm - t.backlash_mm) <= 2 * r.backlash_u_mm;
	}
	print_message("N per microstep: %.1f %%, backlash: %.1f %%\n", held / 2.0,
		      held_backlash / 2.0);
	assert_in_range(held, 184, 196);
	assert_in_range(held_backlash, 184, 200);
}

TEST(names_outliers)
{
	static struct incise_calibrate_stepper_point points[POINTS_MAX];
	static enum incise_calibrate_stepper_state states[POINTS_MAX];
	const uint64_t key = incise_random_key(3, INCISE_RANDOM_SURGEON);
	struct incise_calibrate_stepper_setup setup;
	struct incise_calibrate_stepper r;
	int n = make(&usual, points), bad = 0, found = 0, wrong = 0;
	bool is_bad[POINTS_MAX] = {false};

	incise_calibrate_stepper_init(&setup);
	for (int i = 5; i < n; i += 10) {
		points[i].force_N += uniform(key, i, -1, 1) > 0 ? 0.3 : -0.5;
		is_bad[i] = true;
	}
	assert_int_equal(incise_calibrate_stepper(points, n, &setup, &r, states, NULL),
			 0);
	for (int i = 0; i < n; i++) {
		if (states[i] == INCISE_CALIBRATE_STEPPER_TURN)
			continue;
		bad += is_bad[i];
		found += is_bad[i] && states[i] == INCISE_CALIBRATE_STEPPER_OUTLIER;
		wrong += !is_bad[i] && states[i] == INCISE_CALIBRATE_STEPPER_OUTLIER;
	}
	assert_true(bad > 20 && found == bad && wrong <= 1);
	assert_true(fabs(r.N_mm - 2) < 1e-4);
	assert_true(fabs(r.backlash_mm - 0.05) < 0.002);
}

static void swap_columns(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = 0; i < n; i++)
		p[i] = (struct incise_calibrate_stepper_point){p[i].force_N,
							       p[i].position_mm};
}

static void turn_sign(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = 0; i < n; i++)
		p[i].force_N = -p[i].force_N;
}

static void saturate(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = 0; i < n; i++)
		p[i].force_N = fmin(p[i].force_N, 2);
}

static void lift_off(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = 0; i < n; i++)
		p[i].force_N = fmax(p[i].force_N, 1 + 1e-4 * (i % 7));
}

static void unplug(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = 0; i < n; i++)
		p[i].force_N = 0.1 + 1e-3 * (i * 7 % 11);
}

static void lose_steps(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = n / 2; i < n; i++)
		p[i].force_N -= 0.08;
}

static void shrink(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = 0; i < n; i++)
		p[i].position_mm = 1 + (p[i].position_mm - 1) * 0.005;
}

static void scatter(struct incise_calibrate_stepper_point *p, int n)
{
	for (int i = 0; i < n; i += 5)
		p[i].force_N += i % 2 ? 0.4 : -0.7;
}

static void not_a_number(struct incise_calibrate_stepper_point *p, int n)
{
	p[n / 2].force_N = NAN;
}

TEST(refuses_by_name)
{
	static const struct {
		void (*spoil)(struct incise_calibrate_stepper_point *p, int n);
		int rc;
		const char *text;
	} row[] = {
		{swap_columns, -EDOM, "swapped"},   {turn_sign, -EDOM, "reversed"},
		{saturate, -EDOM, "follow"},	    {lift_off, -EDOM, "contact"},
		{unplug, -EDOM, "react"},	    {lose_steps, -EDOM, "lost"},
		{shrink, -EDOM, "small"},	    {scatter, -EDOM, "outliers"},
		{not_a_number, -EINVAL, "numbers"},
	};
	static struct incise_calibrate_stepper_point points[POINTS_MAX];
	struct incise_calibrate_stepper_setup setup;
	struct incise_calibrate_stepper r;
	struct truth t = usual;

	incise_calibrate_stepper_init(&setup);
	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		struct incise_error err = {0};
		int n = make(&usual, points);

		row[i].spoil(points, n);
		assert_int_equal(incise_calibrate_stepper(points, n, &setup, &r, NULL,
							  &err),
				 row[i].rc);
		assert_says(err.text, row[i].text);
	}
	t.strokes = 1;
	assert_int_equal(incise_calibrate_stepper(points, make(&t, points), &setup, &r,
						  NULL, NULL),
			 -ENODATA);
	setup.high_N = 2;
	assert_int_equal(incise_calibrate_stepper(points, make(&usual, points), &setup,
						  &r, NULL, NULL),
			 -EDOM);
	assert_true(r.saturated > 10);
}

TEST(passes_or_not)
{
	static struct incise_calibrate_stepper_point points[POINTS_MAX];
	struct incise_calibrate_stepper_setup setup;
	struct incise_calibrate_stepper r;
	struct truth t = usual;
	int n = make(&usual, points);

	incise_calibrate_stepper_init(&setup);
	setup.spring_N_mm = 2.2;
	assert_int_equal(incise_calibrate_stepper(points, n, &setup, &r, NULL, NULL), 0);
	assert_true(r.pass && r.linearity < 0.1);
	setup.spring_N_mm = 3;
	assert_int_equal(incise_calibrate_stepper(points, n, &setup, &r, NULL, NULL), 0);
	assert_false(r.pass);
	setup.spring_N_mm = NAN;
	/* A bend of a(x² - x) over 1 is off its line by a/6, 5 %, at the ends; an eighth of
	 * the range is less on average. */
	t.bend = 0.3;
	n = make(&t, points);
	assert_int_equal(incise_calibrate_stepper(points, n, &setup, &r, NULL, NULL), 0);
	assert_true(!r.pass && r.linearity > 2 && r.linearity < 6 && r.misfit > 2);
}

#define POINTS 101 /* of a stroke */
#define RANGE_MM 2.0
#define SLOPE 2.0
#define SKIP_MM 0.2

static struct incise_calibrate_stepper_point points[2 * POINTS];
static enum incise_calibrate_stepper_state states[2 * POINTS];
static struct stroke strokes[2];
static struct incise_calibrate_stepper_setup setup;

/* Up on one line and down on another, 0.2 N apart; behind the turns anything. */
static struct calibrate_stepper_work make_lines(double noise_N)
{
	const uint64_t key = incise_random_key(3, INCISE_RANDOM_FORCE);

	for (int i = 0; i < 2 * POINTS; i++) {
		double gone_mm = (i % POINTS) * RANGE_MM / (POINTS - 1);
		double x = i < POINTS ? gone_mm : RANGE_MM - gone_mm;

		points[i].position_mm = x;
		points[i].force_N = (i < POINTS ? 0.1 : 0.3) + SLOPE * x +
				    noise_N * incise_random_normal(key, i);
		if (gone_mm <= SKIP_MM)
			points[i].force_N += 1;
		states[i] = INCISE_CALIBRATE_STEPPER_USED;
	}
	strokes[0] = (struct stroke){.first = 0, .last = POINTS - 1, .way = 1};
	strokes[1] = (struct stroke){
		.first = POINTS, .last = 2 * POINTS - 1, .way = -1, .from_mm = RANGE_MM};
	incise_calibrate_stepper_init(&setup);
	return (struct calibrate_stepper_work){
		.points = points,
		.setup = &setup,
		.n = 2 * POINTS,
		.n_strokes = 2,
		.strokes = strokes,
		.states = states,
		.range_mm = RANGE_MM,
	};
}

/* A fifth of the points far off, all to one side; what is saturated is not even looked at. */
TEST(outliers_do_not_bend_them)
{
	struct calibrate_stepper_work w = make_lines(1e-3);

	for (int i = 15; i < 2 * POINTS; i += 5)
		points[i].force_N += 0.5;
	for (int i = 2; i < 2 * POINTS; i += 20) {
		points[i].force_N = 100;
		states[i] = INCISE_CALIBRATE_STEPPER_SATURATED;
	}
	assert_int_equal(fit_lines(&w, SKIP_MM), 0);
	for (int i = 15; i < POINTS; i += 5)
		if (i % 20 != 2)
			assert_int_equal(states[i], INCISE_CALIBRATE_STEPPER_OUTLIER);
	for (int i = 2; i < 2 * POINTS; i += 20)
		assert_int_equal(states[i], INCISE_CALIBRATE_STEPPER_SATURATED);
	/* five standard uncertainties: noise over the root of Σ (x - mean)² */
	assert_true(fabs(w.slope - SLOPE) < 5 * 1e-3 / sqrt(w.sxx));
	/* of 140 points the sd is known to 6 %; three times that */
	assert_true(fabs(w.sd - 1e-3) < 0.18e-3);
}

TEST(too_few_are_no_line)
{
	struct calibrate_stepper_work w = make_lines(0);

	/* all of it is behind the turn */
	assert_int_equal(fit_lines(&w, RANGE_MM), -EDOM);
	w = make_lines(0);
	for (int i = POINTS; i < 2 * POINTS; i++)
		states[i] = INCISE_CALIBRATE_STEPPER_SATURATED;
	assert_int_equal(fit_lines(&w, SKIP_MM), -EDOM);
}
