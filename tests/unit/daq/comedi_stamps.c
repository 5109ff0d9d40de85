// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/comedi_stamps.c against a card of which the times of conversion are known.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include "../../../lib/device/daq/comedi_stamps.h"

#define T 100000.0
#define START 7000000000LL

/*
 * Blocks of @block samples over @seconds, each late by @delay_ns and up to @jitter_ns more;
 * the card's clock is off by @ppm. The most that a stamp is off by in the last half, ns.
 */
static double run(int block, double delay_ns, double jitter_ns, double ppm, int seconds)
{
	struct comedi_stamps stamps;
	double period = T * (1 + ppm * 1e-6), most = 0;
	int64_t last = 0;
	int n = 0;

	srand(1);
	comedi_stamps_init(&stamps, T);
	comedi_stamps_begin(&stamps, START);
	while (n < seconds * 10000) {
		double late = delay_ns + jitter_ns * rand() / RAND_MAX;
		int64_t arrival = START + llround(period * (n + block) + late);

		comedi_stamps_block(&stamps, arrival, (uint64_t)block, true);
		for (int i = 0; i < block; i++) {
			int64_t t = comedi_stamps_next(&stamps);
			double off = (double)(t - START) - period * ++n;

			assert_true(t > last);
			/* half a nanosecond of rounding, up */
			assert_true(t <= arrival + 1);
			last = t;
			if (n > seconds * 5000)
				most = fmax(most, fabs(off));
		}
	}
	return most;
}

static void times(void **state)
{
	static const struct {
		int block;
		double delay_ns, jitter_ns, ppm;
		double most_ns;
	} cases[] = {
		/* a sound clock: exact but for rounding, however late blocks come */
		{1, 0, 0, 0, 2},
		{80, 0, 0, 0, 2},
		{512, 2e6, 0, 0, 2},
		/* the least of 125 delays of a second is within some 3 % of the jitter */
		{80, 1e6, 4e6, 0, 300e3},
		/* 100 ppm: 0.1 ms a second, followed with a second's delay or two */
		{80, 0, 0, 100, 250e3},
		{80, 1e6, 0, -100, 350e3},
		{80, 1e6, 1e6, 200, 700e3},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double most = run(cases[i].block, cases[i].delay_ns, cases[i].jitter_ns,
				  cases[i].ppm, 60);

		if (most > cases[i].most_ns)
			fail_msg("case %zu: off by %.0f ns", i, most);
	}
}

/* Started again: stamps go on behind those before. */
static void again(void **state)
{
	struct comedi_stamps stamps;
	int64_t last;

	comedi_stamps_init(&stamps, T);
	comedi_stamps_begin(&stamps, START);
	comedi_stamps_block(&stamps, START + 1000000, 10, true);
	for (int i = 0; i < 10; i++)
		last = comedi_stamps_next(&stamps);
	assert_int_equal(last, START + 1000000);
	comedi_stamps_begin(&stamps, START + 5000000);
	comedi_stamps_block(&stamps, START + 5200000, 2, true);
	assert_int_equal(comedi_stamps_next(&stamps), START + 5100000);
	/* a clock of the computer that stood still */
	comedi_stamps_begin(&stamps, START);
	comedi_stamps_block(&stamps, START, 2, true);
	assert_int_equal(comedi_stamps_next(&stamps), START + 5100001);
	assert_int_equal(comedi_stamps_next(&stamps), START + 5100002);
}

/* A reader that was held for 5 s finds blocks of 4096 waiting: their stamps stay true. */
static void held_up(void **state)
{
	struct comedi_stamps stamps;
	int n = 0;

	comedi_stamps_init(&stamps, T);
	comedi_stamps_begin(&stamps, START);
	while (n < 200000) {
		bool held = n >= 60000 && n < 110000;
		int block = held ? 4096 : 80;
		int64_t taken = START + llround(T * (n + block));
		/* from 6 s on all comes at 11 s */
		int64_t arrival = taken < START + 11000000000LL && n >= 60000
					  ? START + 11000000000LL
					  : taken;

		comedi_stamps_block(&stamps, arrival, (uint64_t)block, block == 80);
		for (int i = 0; i < block; i++)
			assert_true(llabs(comedi_stamps_next(&stamps) - START -
					  llround(T * ++n)) < 2);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(times),
		cmocka_unit_test(again),
		cmocka_unit_test(held_up),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
