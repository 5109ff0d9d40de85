// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_gaps.c by itself: records of which it is known what was before
 * them. What it makes of a whole stream is in polhemus_stream.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/device/polhemus/polhemus_gaps.h"

#define LENGTH 34
#define PERIOD_NS INT64_C(8333333)

static const uint8_t stations[] = {1, 2, 3, 4};
static struct polhemus_gaps gaps;

static void begin(int n, bool counts, double hz)
{
	polhemus_gaps_init(&gaps, stations, n, counts, hz, LENGTH);
}

/* A record in its turn, @k periods after the first one and @late_ns. false: refused. */
static bool take(uint64_t k, int64_t late_ns, unsigned int skipped, uint64_t *seq)
{
	struct polhemus_record record = {
		.t_ns = INT64_C(5000000000) + (int64_t)k * PERIOD_NS + late_ns,
		.station = stations[k % (uint64_t)gaps.n],
		.frame = (uint32_t)(0xfffffff0 + k / (uint64_t)gaps.n),
		.skipped = skipped,
	};

	return polhemus_gaps_take(&gaps, &record, seq);
}

/* Records from @from on, none of which is missing. */
static uint64_t take_all(uint64_t from, uint64_t n)
{
	uint64_t seq = 0;

	for (uint64_t k = from; k < from + n; k++)
		assert_true(take(k, 0, 0, &seq));
	return seq;
}

/* Bytes that were no record, and the time it took: what it makes of them at once. */
static void damage(void **state)
{
	static const struct {
		uint64_t missing;
		unsigned int skipped;
		int64_t late_ns;
		uint64_t told;
	} cases[] = {
		{0, 0, 0, 0},
		{1, 34, 0, 1},
		{1, 33, 0, 1},
		{1, 35, 0, 1},
		{3, 102, 0, 3},
		{3, 100, 0, 3},
		{20, 680, 0, 20},
		/* Late by two periods as well: the bytes were one. */
		{1, 34, 2 * PERIOD_NS, 1},
		{1, 35, 2 * PERIOD_NS, 1},
		/* A byte from nowhere, and the host is late. */
		{0, 1, 3 * PERIOD_NS, 0},
		{0, 1, 0, 0},
		/* Noise between records that cost no time. */
		{0, 340, 0, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		uint64_t seq = 0;

		begin(1, false, 120);
		take_all(0, 200);
		assert_true(take(200 + cases[i].missing, cases[i].late_ns,
				 cases[i].skipped, &seq));
		if (gaps.lost != cases[i].told || seq != 200 + cases[i].told)
			fail_msg("case %zu: %llu lost, seq %llu", i,
				 (unsigned long long)gaps.lost, (unsigned long long)seq);
	}
}

/* Stations tell up to a round; the round itself only time does, a window later. */
static void order(void **state)
{
	for (int n = 1; n <= 4; n++)
		for (uint64_t missing = 0; missing < 12; missing++) {
			uint64_t seq = 0, from = 240 + missing;

			begin(n, false, 120);
			take_all(0, 240);
			assert_true(take(from, 0, 0, &seq));
			assert_int_equal(gaps.lost, missing % (uint64_t)n);
			seq = take_all(from + 1, 2 * POLHEMUS_GAPS_WINDOW);
			assert_int_equal(gaps.lost, missing);
			assert_int_equal(seq, from + 2 * POLHEMUS_GAPS_WINDOW);
		}
}

/* The count of frames says it at once, over its end as well. */
static void counted(void **state)
{
	for (int n = 1; n <= 4; n++)
		for (uint64_t missing = 0; missing < 12; missing++) {
			uint64_t seq = 0;

			begin(n, true, 120);
			take_all(0, 20);
			assert_true(take(20 + missing, 0, 0, &seq));
			assert_int_equal(gaps.lost, missing);
			assert_int_equal(seq, 20 + missing);
		}
}

/* The same one twice: the second is refused, and the next one goes on. */
static void doubled(void **state)
{
	for (int counts = 0; counts <= 1; counts++) {
		uint64_t seq = 0;

		begin(1, counts, 120);
		take_all(0, 200);
		assert_false(take(199, 0, 0, &seq));
		assert_true(take(200, 0, 0, &seq));
		assert_int_equal(seq, 200);
		assert_int_equal(gaps.lost, 0);
	}
}

/* Pulses from outside come when they like: only order and damage count. */
static void without_a_period(void **state)
{
	uint64_t seq = 0;

	begin(1, false, 0);
	take_all(0, 10);
	assert_true(take(5000, 0, 0, &seq));
	assert_int_equal(seq, 10);
	assert_true(take(5001, 0, 3 * LENGTH, &seq));
	assert_int_equal(seq, 14);
	begin(3, false, 0);
	take_all(0, 9);
	/* The first and the second of a round are missing. */
	assert_true(take(11, 0, 0, &seq));
	assert_int_equal(gaps.lost, 2);
	/* The link was gone for who knows how long: a round, so that it shows. */
	polhemus_gaps_broken(&gaps);
	assert_true(take(12, 0, 0, &seq));
	assert_int_equal(gaps.lost, 5);
}

/* What was told to send, and did not, or not so that it was understood. */
static void before_the_first(void **state)
{
	static const struct {
		int stations;
		bool counts, broken;
		unsigned int records_skipped;
		int64_t first; /* periods after the start */
		uint64_t lost;
	} cases[] = {
		{1, false, false, 0, 1, 0},   /* as it should be */
		{1, false, false, 0, 3, 0},   /* it takes its time */
		{1, false, false, 2, 3, 2},   /* two were no records */
		{1, false, false, 9, 3, 3},   /* not more than there was time for */
		{1, false, true, 2, 100, 99}, /* and the link was gone */
		{1, true, true, 0, 100, 99},
		{4, false, false, 1, 5, 4}, /* whole rounds */
		{4, false, true, 0, 100, 96},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct polhemus_record record = {.station = 1};
		uint64_t seq = 0;
		double hz = 120;

		begin(cases[i].stations, cases[i].counts, hz);
		polhemus_gaps_start(&gaps, 1000);
		if (cases[i].broken)
			polhemus_gaps_broken(&gaps);
		record.t_ns = 1000 + cases[i].first * gaps.period_ns;
		record.skipped = cases[i].records_skipped * gaps.length;
		assert_true(polhemus_gaps_take(&gaps, &record, &seq));
		if (seq != cases[i].lost || gaps.lost != cases[i].lost)
			fail_msg("case %zu: seq %d, lost %d", i, (int)seq,
				 (int)gaps.lost);
	}
}

/* The link was gone: the time it took is lost. */
static void broken(void **state)
{
	uint64_t seq = 0;

	begin(1, false, 120);
	/* Before the first record there is nothing to lose. */
	polhemus_gaps_broken(&gaps);
	take_all(0, 100);
	assert_int_equal(gaps.lost, 0);
	polhemus_gaps_broken(&gaps);
	assert_true(take(1000, 0, 0, &seq));
	assert_int_equal(seq, 1000);
	assert_int_equal(gaps.lost, 900);
	assert_true(gaps.anew);
	/* The last one before it was held up: that makes it no shorter. */
	take_all(1001, 200);
	assert_false(gaps.anew);
	assert_true(take(1201, PERIOD_NS, 0, &seq));
	polhemus_gaps_broken(&gaps);
	assert_true(take(1400, 0, 0, &seq));
	assert_int_equal(seq, 1400);
	assert_int_equal(gaps.lost, 900 + 198);
}

/* What never comes again is missing as well: never more of it than counts if it does. */
static void silent(void **state)
{
	for (int n = 1; n <= 4; n++)
		for (uint64_t missing = 1; missing < 40; missing++) {
			uint64_t seq = 0, known, next;

			begin(n, false, 120);
			assert_int_equal(polhemus_gaps_silent(&gaps, PERIOD_NS), 0);
			take_all(0, 100);
			next = 100 + missing;
			assert_int_equal(polhemus_gaps_silent(&gaps, gaps.last_ns), 0);
			known = polhemus_gaps_silent(
				&gaps, gaps.last_ns + (int64_t)missing * gaps.period_ns);
			assert_in_range(known + 2 * (uint64_t)n, missing,
					missing + 2 * n);
			polhemus_gaps_broken(&gaps);
			assert_true(take(next, 0, 0, &seq));
			assert_true(gaps.lost >= known);
		}
	begin(1, false, 0);
	take_all(0, 10);
	assert_int_equal(polhemus_gaps_silent(&gaps, INT64_C(1) << 50), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(damage),	    cmocka_unit_test(order),
		cmocka_unit_test(counted),	    cmocka_unit_test(doubled),
		cmocka_unit_test(without_a_period), cmocka_unit_test(broken),
		cmocka_unit_test(silent),	    cmocka_unit_test(before_the_first),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
