// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * tools/bench/metrics.c, on reports that are made: how often it calls two runs of one distribution
 * different, and what it finds.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../tools/bench/metrics.h"

#define TURNS 101
#define PAIRS 500
#define BENCH_NS 100

static double uniform(uint64_t *state)
{
	incise_random_step(state);
	return ((*state >> 11) + 0.5) * 0x1p-53;
}

static double normal(uint64_t *state)
{
	double angle = 2 * M_PI * uniform(state);

	return sqrt(-2 * log(uniform(state))) * cos(angle);
}

/* Factors that slow each kind of work down. */
struct made {
	double slower, chain, wide, memory;
};

static json_t *report_of(json_t *metrics)
{
	return json_pack("{so}", "figures", metrics);
}

/* Values that are off by a tenth, around what the machine and the build make of them. */
static json_t *made_report(const struct made *made, uint64_t *random)
{
	const double unit[WORKLOADS] = {made->chain, made->wide, made->memory};
	double ns[TURNS], by[TURNS];
	struct harness_time time;
	json_t *metrics = json_array();

	for (int i = 0; i < TURNS; i++)
		ns[i] = BENCH_NS * made->slower * exp(0.1 * normal(random));
	harness_spread(ns, TURNS, &time.ns);
	for (int w = 0; w < WORKLOADS; w++) {
		for (int i = 0; i < TURNS; i++)
			by[i] = ns[i] / (1e4 * unit[w]);
		harness_spread(by, TURNS, &time.by[w]);
	}
	metrics_add(metrics, METRIC_TIME, &time, "ns", "time");
	metrics_add(metrics, METRIC_MEASURED, &time.ns, "ns", "measured");
	metrics_add(metrics, METRIC_EXACT, &(double){1.0 / 3}, "N", "exact");
	return report_of(metrics);
}

static json_t *compared(json_t *was, json_t *is)
{
	json_t *comparison = compare_reports(was, "OLD", is, "NEW", &err);

	succeeds(comparison);
	json_decref(was);
	json_decref(is);
	return comparison;
}

static int count(const json_t *comparison, const char *key)
{
	const json_t *is = json_object_get(comparison, key);

	return json_is_array(is) ? (int)json_array_size(is) : (int)json_integer_value(is);
}

/* Counts the metrics that get worse and better over PAIRS pairs of reports. */
static void tally(const struct made *was, const struct made *is, int *worse, int *better)
{
	uint64_t random = 1;

	*worse = *better = 0;
	for (int i = 0; i < PAIRS; i++) {
		json_t *old = made_report(was, &random);
		json_t *comparison = compared(old, made_report(is, &random));

		assert_int_equal(count(comparison, "same") + count(comparison, "changed"),
				 3);
		*worse += count(comparison, "worse");
		*better += count(comparison, "better");
		json_decref(comparison);
	}
}

static const struct made steady = {1, 1, 1, 1};

TEST(test_the_same_is_the_same)
{
	int worse, better;

	tally(&steady, &steady, &worse, &better);
	/* At most 5 % of the pairs: intervals of 95 % that are apart are rare even without a
	 * floor below which nothing is called. */
	assert_true(worse + better <= PAIRS / 20);
}

TEST(test_slower_is_found)
{
	struct made slow = {1.15, 1, 1, 1};
	int worse, better;

	/* Of a median of 101 values that are off by a tenth half an interval is 3 %: twice that
	 * and the 5 % that are called nothing are all but always below 15 %. */
	tally(&steady, &slow, &worse, &better);
	assert_true(worse > PAIRS * 0.6 && !better);
	tally(&slow, &steady, &worse, &better);
	assert_true(better > PAIRS * 0.6 && !worse);
}

/* One metric of a time, by each reference workload, all off by 1 %: as a quiet machine gives it. */
static json_t *sharp(double value, double chain, double wide, double memory)
{
	const double unit[WORKLOADS] = {chain, wide, memory};
	struct harness_time time;
	json_t *metrics = json_array();

	time.ns =
		(struct harness_spread){value, value, value, value, value, value, value};
	for (int w = 0; w < WORKLOADS; w++) {
		double by = value / unit[w];

		time.by[w] =
			(struct harness_spread){by, by, by, 0.99 * by, 1.01 * by, by, by};
	}
	metrics_add(metrics, METRIC_TIME, &time, "us", "time");
	return report_of(metrics);
}

TEST(test_sharp_times)
{
	static const struct {
		double slower, chain, wide, memory;
		int worse, better;
	} cases[] = {
		{1, 1, 1, 1, 0, 0},	     {1.03, 1, 1, 1, 0, 0},
		{1.1, 1, 1, 1, 1, 0}, /* ten percent are found */
		{0.9, 1, 1, 1, 0, 1},	     {2, 2, 2, 2, 0, 0}, /* it is the machine */
		{2.2, 2, 2, 2, 1, 0},				 /* and the program */
		{1.5, 1.05, 1.5, 1.3, 0, 0}, /* of a core that is shared */
		{1.8, 1.05, 1.5, 1.3, 0, 0}, /* it cannot be determined */
		{3, 1.05, 1.5, 1.3, 1, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		json_t *c = compared(sharp(7, 1, 1, 1),
				     sharp(7 * cases[i].slower, cases[i].chain,
					   cases[i].wide, cases[i].memory));

		if (count(c, "worse") != cases[i].worse ||
		    count(c, "better") != cases[i].better)
			fail_msg("case %zu: %d worse, %d better", i, count(c, "worse"),
				 count(c, "better"));
		json_decref(c);
	}
}

static json_t *exact(double a, double b, bool more)
{
	json_t *metrics = json_array(), *metric;

	metrics_add(metrics, METRIC_EXACT, &a, "N", "a");
	metric = metrics_add(metrics, METRIC_EXACT, &b, "N", "b");
	if (more)
		metrics_more_is_better(metric);
	return report_of(metrics);
}

TEST(test_exact_ones)
{
	static const struct {
		double was, is;
		bool more;
		int worse, better, gone, new_ones;
	} cases[] = {
		{1, 1, false, 0, 0, 0, 0},
		{1, 1 + 1e-11, false, 0, 0, 0, 0}, /* a digit that is not printed */
		{1, 1.0001, false, 1, 0, 0, 0},
		{1, 1.0001, true, 0, 1, 0, 0},
		{1, 0.5, false, 0, 1, 0, 0},
		{1, 0.5, true, 1, 0, 0, 0},
		{0, 0, false, 0, 0, 0, 0},
		{0, 1e-30, false, 1, 0, 0, 0}, /* no longer nothing */
		{-1, 1, false, 1, 0, 0, 0},
		{1, NAN, false, 0, 0, 1, 0}, /* it failed: is not there */
		{INFINITY, 1, false, 0, 0, 0, 1},
		{1e308, -1e308, false, 0, 1, 0, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		json_t *c = compared(exact(5, cases[i].was, cases[i].more),
				     exact(5, cases[i].is, cases[i].more));

		if (count(c, "worse") != cases[i].worse ||
		    count(c, "better") != cases[i].better ||
		    count(c, "gone") != cases[i].gone ||
		    count(c, "new") != cases[i].new_ones)
			fail_msg("case %zu: %d worse, %d better, %d gone, %d new", i,
				 count(c, "worse"), count(c, "better"), count(c, "gone"),
				 count(c, "new"));
		assert_int_equal(compare_worse(c), cases[i].worse + cases[i].gone);
		json_decref(c);
	}
}

TEST(test_another_unit_is_another_metric)
{
	json_t *was = json_array(), *is = json_array(), *c;
	double one = 1;

	metrics_add(was, METRIC_EXACT, &one, "N", "a");
	metrics_add(is, METRIC_EXACT, &one, "mN", "a");
	metrics_add(was, METRIC_EXACT, &one, "N", "b");
	metrics_add(is, METRIC_EXACT, &one, "N", "b");
	c = compared(report_of(was), report_of(is));
	assert_int_equal(count(c, "gone"), 1);
	assert_int_equal(count(c, "new"), 1);
	assert_int_equal(count(c, "same"), 1);
	json_decref(c);
}

/* A word that is not there is one line; of many that takes no more than one look each. */
TEST(test_many_words)
{
	enum { WORDS = 20000 };
	json_t *was = json_object(), *is = json_object(), *c;
	char word[20];

	for (int i = 0; i < WORDS; i++) {
		snprintf(word, sizeof(word), "old%d", i);
		json_object_set_new(was, word, exact(1, 2, false));
		snprintf(word, sizeof(word), "new%d", i);
		json_object_set_new(is, word, exact(1, 2, false));
	}
	json_object_set_new(was, "both", exact(1, 2, false));
	json_object_set_new(is, "both", exact(1, 2, false));
	json_object_set_new(is, "empty", report_of(json_array()));
	c = compared(was, is);
	assert_int_equal(count(c, "same"), 2);
	assert_int_equal(count(c, "gone"), WORDS);
	assert_int_equal(count(c, "new"), WORDS);
	json_decref(c);
}
