// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The loop on clocks that started long ago: its results depend on elapsed time only.
 * Four seconds of the virtual rig are the same to the bit wherever the
 * clock starts: at 0, across 32 bits of ns, µs and ms, across 2^53 ns, where a
 * double loses precision, and close to the end of 64 bits.
 */
#include "../unit.h"
#include "../cases.h"
#include <incise/loop.h>
#include "../scene/felt.h"

#define TICKS 4000

/* Without trailing padding. */
#define TICK_BYTES (offsetof(struct incise_tick, tool) + sizeof(enum incise_tool))

static int64_t start_ns;

/* Replaces the rig's clock, which starts at 1 s. */
struct incise_clock *__real_incise_clock_new_simulated(int64_t ns);
struct incise_clock *__wrap_incise_clock_new_simulated(int64_t ns)
{
	return __real_incise_clock_new_simulated(start_ns);
}

static struct incise_loop_stats stats;

static void run(int64_t from_ns, struct incise_tick *log)
{
	struct incise_loop_options options = {.rate_hz = 1000,
					      .duration_ns = 4 * INCISE_NS_PER_S,
					      .log = log,
					      .log_size = TICKS};
	struct felt f;

	start_ns = from_ns;
	memset(log, 0, TICKS * sizeof(*log));
	felt_start(&f, "double", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER);
	assert_int_equal(incise_loop_run(f.plan, incise_rig_clock(f.rig), &options,
					 &stats, NULL),
			 0);
	assert_int_equal(stats.ticks, TICKS);
	assert_int_equal(stats.skipped, 0);
	assert_int_equal(stats.lateness_max_ns, 0);
	felt_end(&f);
}

TEST(test_same_to_the_bit)
{
	static const int64_t second = INCISE_NS_PER_S;
	static struct incise_tick usual[TICKS], log[TICKS];
	const int64_t starts[] = {
		0,
		(1LL << 31) - second,
		(1LL << 32) - second,
		(1LL << 32) * 1000 - second,
		(1LL << 31) * 1000000 - second,
		(1LL << 32) * 1000000 - second,
		(1LL << 53) - second + 1,
		(1LL << 62) + 1,
		INT64_MAX - 10 * second,
	};

	run(second, usual);
	/* There is a force to compare. */
	assert_true(stats.force_max_N > 0.1);
	assert_true(stats.flagged[0] > 100);
	for (size_t i = 0; i < sizeof(starts) / sizeof(*starts);
	     i += cases_are_all() ? 1 : 3) {
		run(starts[i], log);
		for (int k = 0; k < TICKS; k++) {
			assert_int_equal(log[k].t_ns, starts[i] + (k + 1) * 1000000LL);
			log[k].t_ns = usual[k].t_ns;
			assert_memory_equal(&log[k], &usual[k], TICK_BYTES);
		}
	}
}
