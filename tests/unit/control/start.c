// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Start-up and fading: nothing before a small force, ramps of the right length, no harm
 * from any time or force.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/control/start.h"

/* 0.1 N; full after 0.5 s, gone after 0.05 s. */
static struct incise_start settings(double gain, bool released)
{
	return (struct incise_start){0.1, 0.5, 0.05, gain, released};
}

/* Ticks in a row: what each lot of @ticks with the same input ends in. */
TEST(test_course)
{
	static const struct {
		int ticks;
		double wanted_N;
		bool fresh;
		double gain;
		bool released;
	} lots[] = {
		{1000, 3, true, 0, false},    /* waits in the tissue */
		{1000, -0.2, true, 0, false}, /* either sign */
		{1000, NAN, true, 0, false},  /* not small */
		{1000, 0, false, 0, false},   /* small, but of an old pose */
		{1, 0.1, true, 0.002, true},  /* let go in the very tick */
		{249, 3, true, 0.5, true},    /* whatever is wanted from here on */
		{249, 3, true, 0.998, true},  {1, 3, true, 1, true}, /* 0.5 s in all */
		{5000, 3, true, 1, true},     {25, 3, false, 0.5, true}, /* poses stop */
		{25, 3, true, 0.55, true}, /* and are back: from where it was */
		{27, 3, false, 0.01, true},   {100, 3, false, 0, true},
		{250, 3, true, 0.5, true}, /* without waiting for a small force */
		{250, NAN, true, 1, true},
	};
	struct incise_start s = settings(0, false);

	for (size_t i = 0; i < sizeof(lots) / sizeof(*lots); i++) {
		double gain = -1;

		for (int k = 0; k < lots[i].ticks; k++)
			gain = incise_start_gain(&s, lots[i].wanted_N, lots[i].fresh,
						 1e-3);
		/* Some thousand additions of numbers up to 1: 1e-13. */
		assert_true(fabs(gain - lots[i].gain) < 1e-12);
		assert_true(gain == s.gain);
		assert_int_equal(s.released, lots[i].released);
	}
}

/* One tick from half way, with times and settings that make little sense. */
TEST(test_times)
{
	static const struct {
		double ramp_s, fade_s, dt_s;
		double risen, faded;
	} cases[] = {
		{0.5, 0.05, 0.001, 0.502, 0.48},
		{0.5, 0.05, 0, 0.5, 0.5},
		{0.5, 0.05, -1, 0.5, 0.5},
		{0.5, 0.05, -INFINITY, 0.5, 0.5},
		{0.5, 0.05, NAN, 0.5, 0},
		{0.5, 0.05, 0.0499, 0.5998, 0},
		{0.5, 0.05, 3600, 0.6, 0},
		{0.5, 0.05, INFINITY, 0.6, 0},
		{INFINITY, INFINITY, 1e-3, 0.5, 0.5},
		{INFINITY, INFINITY, INFINITY, 0.6, 0},
		{0, 0, 1e-3, 0.6, 0},
		{-1, -1, 1e-3, 0.6, 0},
		{NAN, NAN, 1e-3, 0.6, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		for (int fresh = 0; fresh < 2; fresh++) {
			struct incise_start s = settings(0.5, true);
			double gain;

			s.ramp_s = cases[i].ramp_s;
			s.fade_s = cases[i].fade_s;
			gain = incise_start_gain(&s, 9, fresh, cases[i].dt_s);
			assert_true(fabs(gain - (fresh ? cases[i].risen
						       : cases[i].faded)) < 1e-12);
		}
	}
}

/* Any bits: the gain is a number from 0 to 1, and rises by no more than a tenth. */
TEST(test_any_bits)
{
	struct incise_start s = settings(0, false);
	uint64_t seed = 1;
	double last = 0;
	bool started = false;

	for (int i = 0; i < 100000; i++) {
		double bits[3], gain;

		for (int k = 0; k < 3; k++) {
			incise_random_step(&seed);
			memcpy(&bits[k], &seed, sizeof(seed));
		}
		if (i % 1000 == 999)
			s.gain = last = bits[2];
		if (!(last > 0))
			last = 0;
		gain = incise_start_gain(&s, bits[0], seed >> 62, bits[1]);
		assert_true(gain >= 0 && gain <= 1);
		assert_true(gain <= last + 0.1 + 1e-15);
		if (!s.released)
			assert_true(gain == 0);
		assert_true(s.released || !started);
		started = s.released;
		last = gain;
	}
	assert_true(started);
}
