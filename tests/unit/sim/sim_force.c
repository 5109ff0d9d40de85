// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/sim_force.c: codes against the true force, noise, clipping, the grid of times.
 */
#include "../unit.h"
#include "../../../lib/sim/sim.h"

#define START_NS INCISE_NS_PER_S
#define MAX 60000

static struct incise_force_sample sample[MAX];

/* The first seconds of a run; returns how many samples. */
static int run(const struct incise_sim_config *config, double seconds)
{
	struct incise_clock *clock = incise_clock_new_simulated(START_NS);
	struct incise_sim *sim = incise_sim_new(config, clock, NULL);
	struct incise_force *force = incise_sim_force_new(sim);
	int n = 0;

	for (int i = 1; i <= 10; i++) {
		incise_clock_wait_until(clock, START_NS + llround(seconds * i * 1e8));
		n += incise_force_read(force, sample + n, MAX - n);
	}
	assert_int_equal(incise_force_lost(force), 0);
	force->ops->close(force);
	incise_sim_free(sim);
	incise_clock_free(clock);
	return n;
}

TEST(codes_follow_the_truth)
{
	static const double rate[] = {1, 3000, 10000, 12345.678, 20000};
	struct incise_sim_config config;
	struct incise_sim_truth truth;

	incise_sim_config_init(&config);
	config.force_noise_mV = 0;
	for (size_t k = 0; k < sizeof(rate) / sizeof(rate[0]); k++) {
		struct incise_clock *clock = incise_clock_new_simulated(START_NS);
		struct incise_sim *sim;
		int n, loaded = 0;

		config.force_hz = rate[k];
		n = run(&config, 2.9);
		assert_true(fabs(n - 2.9 * rate[k]) <= 2);
		/* The same world again, asked at each sample's time. */
		sim = incise_sim_new(&config, clock, NULL);
		for (int i = 0; i < n; i++) {
			double exact;

			assert_int_equal(sample[i].seq, i);
			assert_int_equal(sample[i].t_ns - START_NS,
					 llround(i * (1e9 / rate[k])));
			incise_clock_wait_until(clock, sample[i].t_ns);
			incise_sim_truth(sim, &truth);
			exact = (180 + 1240 * truth.force_N) / 5000 * 4096;
			/* Half a code of rounding, and the rounding of the products. */
			assert_true(fabs(sample[i].code - exact) <= 0.5 + 1e-9);
			loaded += truth.force_N > 0.05;
		}
		assert_true(rate[k] == 1 || loaded > n / 10);
		incise_sim_free(sim);
		incise_clock_free(clock);
	}
}

TEST(noise_is_as_configured)
{
	struct incise_sim_config config;
	double mean = 0, squares = 0, sd;
	int n;

	incise_sim_config_init(&config);
	n = run(&config, 1); /* the pause: no force */
	assert_int_equal(n, 10000);
	for (int i = 0; i < n; i++)
		mean += sample[i].code / (double)n;
	for (int i = 0; i < n; i++)
		squares += pow(sample[i].code - mean, 2) / n;
	/* 3 mV of noise in codes of 1.2207 mV, and the uniform error of rounding. */
	sd = sqrt(pow(3 / 1.220703125, 2) + 1.0 / 12);
	/* sd of a mean, sd/√n, and of a standard deviation, sd/√(2n); bounds are 5 of each. */
	assert_true(fabs(mean - 180 / 1.220703125) < 5 * sd / sqrt(n));
	assert_true(fabs(sqrt(squares) - sd) < 5 * sd / sqrt(2 * n));
}

TEST(codes_stay_in_range)
{
	static const struct {
		double zero_mV, elastic_N_mm;
		int low, high; /* in the pause, and deep in the tissue */
	} row[] = {
		{-10000, 0, 0, 0},
		{10000, 0, 4095, 4095},
		{-100, 100, 0, 4095},
		{4999, 100, 4095, 4095},
	};
	struct incise_sim_config config;

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		int n;

		incise_sim_config_init(&config);
		config.force_zero_mV = row[i].zero_mV;
		config.elastic1_N_mm = row[i].elastic_N_mm;
		config.elastic2_N_mm2 = 0;
		config.unloading_N_mm = 1000; /* else the force rises no faster */
		config.force_noise_mV = 0;
		n = run(&config, 5);
		assert_int_equal(sample[0].code, row[i].low);
		assert_int_equal(sample[n - 1].code, row[i].high);
		for (int k = 0; k < n; k++)
			assert_in_range(sample[k].code, 0, 4095);
	}
}

/* A weight takes the place of the blade, until it is taken off and the blade is back. */
TEST(a_weight_hangs_in_place_of_the_blade)
{
	/* in the middle of the first cut */
	static const struct {
		double at_s, load_N;
		int code;
	} row[] = {
		{3, 2, (180 + 1240 * 2) * 4096 / 5000},
		{3.1, 0, 180 * 4096 / 5000},
		{3.2, 9, 4095},
		{3.3, NAN, -1}, /* of the cut: anything but these */
		{3.4, INFINITY, -1},
	};
	struct incise_clock *clock = incise_clock_new_simulated(START_NS);
	struct incise_sim_config config;
	struct incise_sim_truth truth;
	struct incise_force *force;
	struct incise_sim *sim;
	int n = 0;

	incise_sim_config_init(&config);
	config.force_noise_mV = 0;
	sim = incise_sim_new(&config, clock, NULL);
	force = incise_sim_force_new(sim);
	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		incise_clock_wait_until(clock, START_NS + llround(row[i].at_s * 1e9));
		incise_sim_load(sim, row[i].load_N);
		while (incise_force_read(force, sample, MAX) == MAX)
			;
		incise_clock_wait_until(clock,
					START_NS + llround((row[i].at_s + 0.05) * 1e9));
		n = incise_force_read(force, sample, MAX);
		/* 50 ms at 10 kHz; what was before its tick of 1 ms has been read */
		assert_in_range(n, 490, 510);
		incise_sim_truth(sim, &truth);
		for (int k = 10; k < n; k++)
			if (row[i].code >= 0)
				assert_in_range(sample[k].code, row[i].code,
						row[i].code + 1);
		if (row[i].code < 0)
			assert_true(fabs(truth.force_N -
					 (sample[n - 1].code * 5000 / 4096.0 - 180) /
						 1240) < 0.05);
	}
	force->ops->close(force);
	incise_sim_free(sim);
	incise_clock_free(clock);
}
