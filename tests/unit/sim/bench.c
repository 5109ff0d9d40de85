// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/bench.c: backlash, loss, friction and lost steps, each where it can be told by hand;
 * and the force channel, which shows it.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include "../../../lib/sim/bench.h"
#include "../../../lib/sim/sim.h"

/* Go there in microsteps; the force then. */
static double go(struct incise_bench *bench, const struct incise_sim_config *config,
		 double to_mm, double mm_s)
{
	double from = bench->nut_mm;
	int n = 1 + (int)ceil(fabs(to_mm - from) / 0.0005);

	for (int i = 1; i <= n; i++)
		incise_bench_follow(bench, config, from + (to_mm - from) * i / n, mm_s);
	return bench->force_N;
}

/* Rounding only. */
static bool same(double a, double b)
{
	return fabs(a - b) < 1e-9;
}

static void each_by_hand(void **state)
{
	struct incise_sim_config config;
	struct incise_bench b = {0};

	incise_sim_config_init(&config);
	config.handle_friction_N = 0;
	assert_true(same(go(&b, &config, 1, 0), 2) && same(go(&b, &config, 0.5, 0), 1));

	config.backlash_mm = 0.1;
	b = (struct incise_bench){0};
	assert_true(same(go(&b, &config, 1, 0), 1.9));
	assert_true(same(go(&b, &config, 0.9, 0), 1.9));
	assert_true(same(go(&b, &config, 0.5, 0), 1.1));

	config.backlash_mm = 0;
	config.hysteresis_N = 0.1;
	b = (struct incise_bench){0};
	assert_true(same(go(&b, &config, 1, 0), 2.05));
	assert_true(same(go(&b, &config, 0.5, 0), 0.95));

	/* Friction of 0.02 N, and 0.05 N more at rest. */
	config.hysteresis_N = 0;
	config.handle_friction_N = 0.02;
	config.stiction_N = 0.05;
	b = (struct incise_bench){0};
	assert_true(same(go(&b, &config, 1, 0), 1.98));
	assert_true(same(go(&b, &config, 0.956, 0), 1.98)); /* less than 0.09 N */
	assert_true(same(go(&b, &config, 0.954, 0), 1.928));
	assert_true(same(go(&b, &config, 0.5, 0), 1.02));

	/* What was lost is lost for good. */
	config.handle_friction_N = config.stiction_N = 0;
	config.stall_mm_s = 10;
	b = (struct incise_bench){0};
	assert_true(same(go(&b, &config, 0.5, 10), 1));
	assert_true(same(go(&b, &config, 0.6, 10.1), 1));
	assert_true(same(go(&b, &config, 1, 5), 1.8));
}

/* The mean force of the channel's last samples, by its true sensitivity. */
static double channel_N(struct incise_force *force,
			const struct incise_sim_config *config)
{
	struct incise_force_sample s[64];
	double sum = 0;
	int n, all = 0;

	while ((n = force->ops->read(force, s, 64)) > 0)
		for (int i = 0; i < n; i++, all++)
			sum += s[i].code;
	return (sum / all * 5000 / 4096 - config->force_zero_mV) / config->force_mV_N;
}

static void force_channel_shows_it(void **state)
{
	struct incise_clock *clock = incise_clock_new_simulated(0);
	struct incise_stepper *stepper;
	struct incise_sim_config config;
	struct incise_force *force;
	struct incise_sim *sim;

	incise_sim_config_init(&config);
	config.bench = 1;
	config.handle_friction_N = 0;
	config.backlash_mm = 0.1;
	sim = incise_sim_new(&config, clock, NULL);
	force = incise_sim_force_new(sim);
	stepper = incise_sim_stepper_new(sim);
	for (int i = 1; i < 20; i++) {
		assert_int_equal(stepper->ops->set(stepper, 1), 0);
		incise_clock_wait_until(clock, i * 20000000);
	}
	channel_N(force, &config);
	stepper->ops->set(stepper, 1);
	incise_clock_wait_until(clock, 430000000);
	/* 500 samples of 3 mV and a code of 1.2 mV: 0.11 mN; five of them. */
	assert_true(fabs(channel_N(force, &config) - 1.9) < 6e-4);
	/* At a speed, which it keeps. */
	assert_int_equal(stepper->ops->jog(stepper, 2), 0);
	incise_clock_wait_until(clock, 500000000);
	channel_N(force, &config);
	stepper->ops->jog(stepper, 0);
	incise_clock_wait_until(clock, 550000000);
	channel_N(force, &config);
	incise_clock_wait_until(clock, 600000000);
	/* 2 mm/s for 70 ms, and 0.7 µm to stop; a step is 0.6 µm. */
	assert_true(fabs(channel_N(force, &config) - 1.9 - 0.28) < 4e-3);
	stepper->ops->close(stepper);
	incise_clock_wait_until(clock, 700000000);
	channel_N(force, &config);
	force->ops->close(force);
	incise_sim_free(sim);
	incise_clock_free(clock);
}

static void no_jog_elsewhere(void **state)
{
	struct incise_clock *clock = incise_clock_new_simulated(0);
	struct incise_stepper *stepper;
	struct incise_sim_config config;
	struct incise_sim *sim;

	incise_sim_config_init(&config);
	sim = incise_sim_new(&config, clock, NULL);
	stepper = incise_sim_stepper_new(sim);
	assert_int_equal(stepper->ops->jog(stepper, 1), -EOPNOTSUPP);
	stepper->ops->close(stepper);
	incise_sim_free(sim);
	incise_clock_free(clock);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_by_hand),
		cmocka_unit_test(force_channel_shows_it),
		cmocka_unit_test(no_jog_elsewhere),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
