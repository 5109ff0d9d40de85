// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/publish/interpolators.c: the smoother: velocity against what theory says of it, for sines, straight
 * ways, gaps and noise.
 */
#include "../unit.h"
#include "../../../lib/publish/interpolators.h"

#define RECORDS 4000

/* The result for records whose position is a function of their number. */
static struct incise_smooth_record out[RECORDS];

static int run(double rate_hz, int n,
	       struct incise_smooth_record (*make)(int i, void *way), void *way)
{
	const struct incise_smooth_record *done;
	struct incise_smooth smooth;
	int taken = 0;

	assert_int_equal(incise_smooth_init(&smooth, rate_hz), 0);
	for (int i = 0; i <= n; i++) {
		struct incise_smooth_record record = make(i, way);

		if (i < n)
			incise_smooth_push(&smooth, &record);
		else
			incise_smooth_end(&smooth);
		while ((done = incise_smooth_take(&smooth)))
			out[taken++] = *done;
	}
	incise_smooth_free(&smooth);
	assert_int_equal(taken, n);
	for (int i = 0; i < n; i++)
		assert_int_equal(out[i].seq, i);
	return taken;
}

struct sine {
	double rate_hz, hz;
};

static struct incise_smooth_record sine(int i, void *way)
{
	const struct sine *s = way;
	double phase = 2 * M_PI * s->hz * i / s->rate_hz;

	return (struct incise_smooth_record){
		.seq = i,
		.t_ns = llround(i * 1e9 / s->rate_hz) - 5000000000,
		.position_mm = {cos(phase), -2 * sin(phase), 7},
	};
}

/* Tracking index as of predict.h: the hand's jerk of 4e6 mm²/s⁵, 0.02 mm of noise. */
static double gain(double rate_hz, double hz)
{
	double period = 1 / rate_hz, half = M_PI * hz * period;
	double index = sqrt(4e6 * period) * period * period / 0.02;

	return 2 * rate_hz * tan(half) /
	       (1 + pow(2 * sin(half), 6) / pow(index * cos(half), 2));
}

TEST(a_sine_comes_out_as_theory_says)
{
	static const struct sine cases[] = {
		{60, 1},  {60, 9},     {120, 2},  {120, 10}, {120, 16.8}, {120, 30},
		{240, 3}, {240, 18.5}, {240, 50}, {1000, 5}, {1000, 18},
	};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct sine s = cases[c];
		double g = gain(s.rate_hz, s.hz);

		run(s.rate_hz, RECORDS, sine, &s);
		/* the ends have no records on one side */
		for (int i = 500; i < RECORDS - 500; i++) {
			double phase = 2 * M_PI * s.hz * i / s.rate_hz;

			/* times are whole ns: at 1 kHz a part in 1e6, and the fading of
			 * 1e-7; in amplitude and, as it holds at any phase, in phase */
			assert_true(fabs(out[i].velocity_mm_s[0] + g * sin(phase)) <
				    3e-6 * 2 * M_PI * s.hz);
			assert_true(fabs(out[i].velocity_mm_s[1] + 2 * g * cos(phase)) <
				    6e-6 * 2 * M_PI * s.hz);
			assert_true(fabs(out[i].velocity_mm_s[2]) < 1e-9);
		}
	}
	/* what the header says */
	assert_true(fabs(gain(120, 16.8) / (2 * M_PI * 16.8) - 0.5) < 0.005);
	assert_true(fabs(gain(240, 18.5) / (2 * M_PI * 18.5) - 0.5) < 0.005);
}

/* 30 mm/s, with missing records, gaps, discontinuities and impossible positions. */
static struct incise_smooth_record straight(int i, void *way)
{
	double period = 1 / 240., t = i * period;
	struct incise_smooth_record record = {.seq = i};

	t += i >= 700 ? 3 * period : 0; /* the filter goes on */
	t += i >= 1200 ? 0.04 : 0;	/* and restarts */
	t += i >= 2000 ? 100 : 0;
	record.t_ns = llround(t * 1e9);
	record.position_mm[0] = 30 * t + (i >= 2600 ? 500 : 0);
	record.position_mm[1] = -40 * t;
	record.depth_mm = 2;
	if (i == 3000)
		record.position_mm[2] = 1e200;
	return record;
}

TEST(a_straight_way_is_exact)
{
	run(240, RECORDS, straight, NULL);
	for (int i = 0; i < RECORDS; i++) {
		const double *v = out[i].velocity_mm_s;

		if (i == 3000) {
			assert_true(isnan(v[0]) && isnan(v[1]) && isnan(v[2]));
			continue;
		}
		/* whole ns in 4 ms are 2.4e-7 of a speed; at a beginning twice that */
		assert_true(fabs(v[0] - 30) < 1e-4);
		assert_true(fabs(v[1] + 40) < 1e-4);
		assert_true(fabs(v[2]) < 1e-9);
	}
}

TEST(few_records_are_enough)
{
	for (int n = 0; n < 12; n++) {
		run(240, n, straight, NULL);
		for (int i = 0; i < n; i++) {
			double expected = n > 1 ? 30 : 0; /* of one nothing is known */

			assert_true(fabs(out[i].velocity_mm_s[0] - expected) < 1e-4);
			assert_int_equal(isnan(out[i].noise_mm), n < 3);
		}
	}
}

/* A noise of sd 1: 12 uniform ones, less 6. */
static struct incise_smooth_record noisy(int i, void *way)
{
	struct incise_smooth_record record = straight(i, NULL);

	for (int k = 0; k < 4; k++) {
		double noise = -6;

		for (int j = 0; j < 12; j++)
			noise += rand() / (RAND_MAX + 1.0);
		if (k < 3)
			record.position_mm[k] += 0.02 * noise;
		else
			record.depth_mm += 0.03 * noise;
	}
	return record;
}

TEST(noise_is_told)
{
	double noise = 0, depth = 0, v = 0;
	int n = 600;

	srand(1);
	run(240, n, noisy, NULL);
	for (int i = 0; i < n; i++) {
		noise += out[i].noise_mm / n;
		depth += out[i].depth_noise_mm / n;
		v += pow(out[i].velocity_mm_s[0] - 30, 2) / n;
	}
	/* of 33 records about, 3 axes: 1/√200 each, and a bias of their root of 1 % */
	assert_true(fabs(noise / 0.02 - 1) < 0.04);
	assert_true(fabs(depth / 0.03 - 1) < 0.08);
	/* sum of the gain's square over all frequencies: white noise of 0.02 mm */
	{
		double sum = 0;

		for (int k = 0; k < 1000; k++)
			sum += pow(gain(240, (k + 0.5) * 0.12), 2) / 1000;
		/* 600 records have some 100 independent velocities: 7 % of the sd */
		assert_true(fabs(sqrt(v / sum) / 0.02 - 1) < 0.2);
	}
}
