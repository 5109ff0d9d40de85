// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * tools/bench/harness.c: whether the interval of a median holds the median as often as it says, on
 * values whose median is known; and that variants take turns.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../tools/bench/harness.h"
#include "../../../tools/cli/stopwatch.h"

#define TRIALS 4000
#define VALUES_MAX 200

static double uniform(uint64_t *state)
{
	incise_random_step(state);
	return ((*state >> 11) + 0.5) * 0x1p-53;
}

/* Median 1, and a tail to the right, as run times have it. */
static double skewed(uint64_t *state)
{
	double angle = 2 * M_PI * uniform(state);

	return exp(0.3 * sqrt(-2 * log(uniform(state))) * cos(angle));
}

static double covered(int n)
{
	double values[VALUES_MAX];
	uint64_t state = (uint64_t)n;
	int held = 0;

	for (int t = 0; t < TRIALS; t++) {
		struct harness_spread s;

		for (int i = 0; i < n; i++)
			values[i] = skewed(&state);
		harness_spread(values, n, &s);
		assert_true(s.min <= s.low && s.low <= s.median);
		assert_true(s.median <= s.high && s.high <= s.max);
		if (n >= 20)
			assert_true(s.p5 <= s.low && s.high <= s.p95);
		else
			assert_true(isnan(s.p5) && isnan(s.p95));
		held += s.low <= 1 && 1 <= s.high;
	}
	return (double)held / TRIALS;
}

TEST(test_intervals_hold_the_median)
{
	/* By ranks: 1 - 2 sum C(n, i) / 2^n; from 24 on 96.1 % by 12 medians, which lean a
	 * little where the distribution does. Four sd of 4000 trials are 1.2 %. */
	static const struct {
		int n;
		double part;
	} cases[] = {{6, 0.969},  {9, 0.961},	{15, 0.965}, {23, 0.965},
		     {60, 0.961}, {101, 0.961}, {180, 0.961}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double part = covered(cases[i].n);

		if (fabs(part - cases[i].part) > 0.015)
			fail_msg("%d values: %g of the intervals hold the median, not %g",
				 cases[i].n, part, cases[i].part);
	}
}

/* A machine that is slow for a while makes neighbours alike; an interval by the ranks of all
 * values would take them for as many witnesses. */
TEST(test_a_slow_while_widens_it)
{
	double steady[120], slow[120];
	struct harness_spread a, b;
	uint64_t random = 1;

	for (int i = 0; i < 120; i++) {
		steady[i] = skewed(&random);
		slow[i] = steady[i] * (i >= 40 && i < 80 ? 1.5 : 1);
	}
	harness_spread(steady, 120, &a);
	harness_spread(slow, 120, &b);
	assert_true(b.high / b.low > 1.2 * a.high / a.low);
}

TEST(test_few_values)
{
	static const double values[] = {3, 1, 2};
	struct harness_spread s;

	harness_spread(values, 0, &s);
	assert_true(isnan(s.median) && isnan(s.low) && isnan(s.high));
	harness_spread(values, 1, &s);
	assert_true(s.median == 3 && s.low == 3 && s.high == 3);
	harness_spread(values, 3, &s);
	assert_true(s.median == 2 && s.low == 1 && s.high == 3);
}

static char order[100];

static double say(void *context)
{
	strcat(order, context);
	return 1000 + (double)strlen(order);
}

/* One value in twenty lies beyond the 95th percentile, one in a thousand beyond the 99.9th. */
TEST(test_percentiles_take_values)
{
	static const struct {
		double share;
		uint64_t needs;
	} cases[] = {{0.5, 1},	  {0.05, 20},	 {0.95, 20},	 {0.01, 100},
		     {0.99, 100}, {0.999, 1000}, {0.9999, 10000}};
	double values[1000];

	for (int i = 0; i < 1000; i++)
		values[i] = i;
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_true(stopwatch_resolves(cases[i].needs, cases[i].share));
		assert_false(stopwatch_resolves(cases[i].needs - 1, cases[i].share));
	}
	assert_true(stopwatch_quantile(values, 1000, 0.999) == 998);
	assert_true(isnan(stopwatch_quantile(values, 999, 0.999)));
}

TEST(test_variants_take_turns)
{
	struct harness_time times[3];
	const struct harness_variant variants[] = {
		{.ns = say, .context = "a", .time = &times[0]},
		{.time = &times[1]},
		{.ns = say, .context = "b", .time = &times[2]}};

	*order = 0;
	harness_times(variants, 3, 4);
	assert_string_equal(order, "abababab");
	/* 1001, 1003, 1005, 1007: nearest rank, the upper one of two */
	assert_true(times[0].ns.median == 1005);
	assert_true(isnan(times[1].ns.median) && isnan(times[1].by[0].median));
	for (int w = 0; w < WORKLOADS; w++)
		assert_true(times[2].by[w].low > 0 &&
			    times[2].by[w].low <= times[2].by[w].high);
}
