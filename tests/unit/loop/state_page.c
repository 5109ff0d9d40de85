// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/state_page.c: buckets without gaps, quantiles compared with sorted times; a tick there
 * and back.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "state_made.h"

static struct incise_state_histogram histogram;

TEST(test_buckets_follow_each_other)
{
	assert_int_equal(incise_state_bucket(INT64_MIN), 0);
	assert_int_equal(incise_state_bucket(-1), 0);
	assert_int_equal(incise_state_bucket(0), 0);
	assert_int_equal(incise_state_bucket(INT64_MAX), INCISE_STATE_BUCKETS - 1);
	for (int i = 0; i < INCISE_STATE_BUCKETS - 1; i++) {
		double last = incise_state_edge(i);
		double first = i ? incise_state_edge(i - 1) + 1 : 0;

		assert_int_equal(incise_state_bucket((int64_t)first), i);
		assert_int_equal(incise_state_bucket((int64_t)last), i);
		assert_int_equal(incise_state_bucket((int64_t)last + 1), i + 1);
		/* The width that the header states; below 32 ns each has one time. */
		assert_true(last == first || (last - first) / first < 0.032);
	}
	/* Each time below 10 s is in a closed bucket. */
	assert_true(incise_state_edge(INCISE_STATE_BUCKETS - 2) > 10e9);
	assert_true(isinf(incise_state_edge(INCISE_STATE_BUCKETS - 1)));
	assert_true(isinf(incise_state_edge(INT32_MAX)));
	assert_true(incise_state_edge(-1) == 0);
}

static int by_size(const void *a, const void *b)
{
	const int64_t *x = a, *y = b;

	return (*x > *y) - (*x < *y);
}

TEST(test_quantiles)
{
	enum { N = 20000 };
	static const double shares[] = {0, 0.001, 0.5, 0.9, 0.99, 0.999, 0.9999, 1};
	static int64_t ns[N];
	uint64_t seed = 1;

	memset(&histogram, 0, sizeof(histogram));
	for (int i = 0; i < N; i++) {
		incise_random_step(&seed);
		/* Over 9 decades, each as likely. */
		ns[i] = (int64_t)pow(10, (double)(seed >> 11) * 0x1p-53 * 9.5);
		histogram.count[incise_state_bucket(ns[i])]++;
	}
	qsort(ns, N, sizeof(*ns), by_size);
	assert_int_equal(incise_state_total(&histogram), N);
	for (size_t i = 0; i < sizeof(shares) / sizeof(*shares); i++) {
		int64_t rank = (int64_t)ceil(shares[i] * N);
		double exact = (double)ns[rank ? rank - 1 : 0];
		double found = incise_state_quantile(&histogram, shares[i]);

		assert_true(found >= exact);
		/* The width of a bucket. */
		assert_true(found <= exact * 1.032 + 1);
	}
}

TEST(test_nothing_and_too_much)
{
	memset(&histogram, 0, sizeof(histogram));
	assert_int_equal(incise_state_total(&histogram), 0);
	assert_true(incise_state_quantile(&histogram, 0.5) == 0);
	histogram.count[INCISE_STATE_BUCKETS - 1] = 1;
	assert_true(isinf(incise_state_quantile(&histogram, 0.5)));
	/* A page of garbage: counts saturate, and the work is finite. */
	memset(&histogram, 0xff, sizeof(histogram));
	assert_true(incise_state_total(&histogram) == UINT64_MAX);
	assert_true(incise_state_quantile(&histogram, 0) == 0);
	assert_true(incise_state_quantile(&histogram, NAN) >= 0);
}

TEST(test_there_and_back)
{
	for (int64_t n = 0; n < 5000; n++) {
		struct incise_tick tick = made_tick(n), back;
		struct state_tick packed;

		/* Every byte must be overwritten. */
		memset(&packed, 0xee, sizeof(packed));
		memset(&back, 0xee, sizeof(back));
		incise_state_pack(&packed, &tick);
		assert_int_equal(incise_state_unpack(&back, &packed), 0);
		assert_true(made_same(&back, &tick));
	}
}

TEST(test_what_is_no_tick)
{
	struct incise_tick tick = made_tick(7), back;
	struct state_tick packed;

	incise_state_pack(&packed, &tick);
	packed.phase = INCISE_PHASE_INSERTION + 1;
	assert_int_equal(incise_state_unpack(&back, &packed), -EIO);
	packed.phase = 0;
	packed.tool = INCISE_TOOL_TUBE + 1;
	assert_int_equal(incise_state_unpack(&back, &packed), -EIO);
	packed.tool = 0;
	/* Flags of a later release are cleared. */
	packed.flags = ~0u;
	assert_int_equal(incise_state_unpack(&back, &packed), 0);
	assert_int_equal(back.flags, (1 << INCISE_TICK_FLAGS) - 1);
}
