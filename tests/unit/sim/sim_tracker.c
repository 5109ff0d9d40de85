// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/sim/sim_tracker.c: rate, drift, latency and noise against what was configured. */
#include "../unit.h"
#include "../../../lib/sim/sim.h"
#include "../../../lib/sim/world.h"

#define START_NS INCISE_NS_PER_S
#define MAX 20000

static struct incise_tracker_sample sample[MAX];

/* A virtual rig with its tracker only. */
static struct incise_sim_config config;
static struct {
	struct incise_clock *clock;
	struct incise_sim *sim;
	struct incise_tracker *tracker;
} rig;
static int n;

static void rig_new(void)
{
	rig.clock = incise_clock_new_simulated(START_NS);
	rig.sim = incise_sim_new(&config, rig.clock, NULL);
	assert_non_null(rig.sim);
	rig.tracker = incise_sim_tracker_new(rig.sim);
}

static void rig_free(void)
{
	rig.tracker->ops->close(rig.tracker);
	incise_sim_free(rig.sim);
	incise_clock_free(rig.clock);
}

static int begin(void **state)
{
	incise_sim_config_init(&config);
	return 0;
}

/* Make a rig, and read all of its first seconds. */
static void rig_read(int seconds)
{
	rig_new();
	n = 0;

	for (int i = 1; i <= seconds; i++) {
		incise_clock_wait_until(rig.clock, START_NS + i * INCISE_NS_PER_S);
		n += incise_tracker_read(rig.tracker, sample + n, MAX - n);
	}
	assert_int_equal(incise_tracker_lost(rig.tracker), 0);
}

static int64_t acquired_ns(int i)
{
	return START_NS + llround(i * (1e9 / (120 * (1 + 50e-6))));
}

TEST(rate_drifts_and_latency_is_exact_without_jitter, begin)
{
	config.tracker_jitter_ms = 0;
	rig_read(100);
	/* 100 s of 120 Hz that runs 50 ppm fast, and of which the last is on its way. */
	assert_in_range(n, 12000, 12001);
	for (int i = 0; i < n; i++) {
		assert_int_equal(sample[i].seq, i);
		assert_int_equal(sample[i].t_ns, acquired_ns(i) + 4200000);
		assert_int_equal(sample[i].status, ' ');
	}
	rig_free();
}

TEST(jitter_only_adds, begin)
{
	double mean_ms = 0;

	rig_read(100);
	for (int i = 0; i < n; i++) {
		double extra_ms = (double)(sample[i].t_ns - acquired_ns(i)) * 1e-6 - 4.2;

		assert_true(extra_ms >= -1e-6); /* a nanosecond's rounding */
		mean_ms += extra_ms / n;
	}
	/* |normal| of sd 0.2: mean 0.2·√(2/π), sd 0.2·√(1 - 2/π); 5 sd of the mean. */
	assert_true(fabs(mean_ms - 0.2 * sqrt(2 / M_PI)) <
		    5 * 0.2 * sqrt((1 - 2 / M_PI) / n));
	rig_free();
}

TEST(records_come_when_they_arrive_and_in_order, begin)
{
	/* Jitter below and far above the time between records. */
	static const double jitter_ms[] = {0.2, 100};

	for (int k = 0; k < 2; k++) {
		int64_t before = START_NS, arrival = 0;
		uint64_t seq = 0;

		config.tracker_jitter_ms = jitter_ms[k];
		rig_new();
		for (int64_t t = START_NS; t < START_NS + 3 * INCISE_NS_PER_S;
		     t += 130000) {
			int n;

			incise_clock_wait_until(rig.clock, t);
			n = incise_tracker_read(rig.tracker, sample, MAX);
			for (int i = 0; i < n; i++) {
				assert_true(sample[i].t_ns <= t &&
					    sample[i].t_ns > before);
				assert_true(sample[i].t_ns >= arrival);
				assert_int_equal(sample[i].seq, seq++);
				arrival = sample[i].t_ns;
			}
			before = t;
		}
		/* All but those that are on their way: at most 700 ms of 120 Hz. */
		assert_true(seq >= 3 * 120 - 84 - 2);
		rig_free();
	}
}

TEST(noise_is_as_configured, begin)
{
	double mean[3] = {0}, squares[3] = {0}, angle2 = 0, angle_sd;

	rig_read(100);
	for (int i = 0; i < n; i++) {
		struct incise_blade blade;
		double q[4], dot = 0, norm = 0;

		incise_surgeon_blade(&rig.sim->surgeon, acquired_ns(i) - START_NS,
				     &blade);
		incise_surgeon_grip(&rig.sim->surgeon, acquired_ns(i) - START_NS, q);
		for (int k = 0; k < 3; k++) {
			double e = sample[i].position_mm[k] - blade.position_mm[k];

			mean[k] += e / n;
			squares[k] += e * e / n;
		}
		for (int k = 0; k < 4; k++) {
			dot += q[k] * sample[i].quaternion[k];
			norm += sample[i].quaternion[k] * sample[i].quaternion[k];
		}
		assert_true(fabs(norm - 1) < 1e-14); /* a few roundings */
		angle2 += 8 * (1 - fabs(dot)) / n;   /* angle²; 1 - cos(a/2) ≈ a²/8 */
	}
	for (int k = 0; k < 3; k++) {
		/* sd/√n of a mean, sd/√(2n) of a standard deviation; 5 of each. */
		assert_true(fabs(mean[k]) < 5 * 0.02 / sqrt(n));
		assert_true(fabs(sqrt(squares[k]) - 0.02) < 5 * 0.02 / sqrt(2 * n));
	}
	/* Three axes of 0.025° each; 3n squares in the mean. */
	angle_sd = 0.025 * M_PI / 180 * sqrt(3);
	assert_true(fabs(sqrt(angle2) / angle_sd - 1) < 5 / sqrt(6 * n));
	rig_free();
}

/*
 * With a tube the two stations take turns at the same rate. The tube goes down from above to below
 * and back; the scalpel is where it is without it.
 */
TEST(tube_is_the_second_station, begin)
{
	static struct incise_tracker_sample alone[MAX];
	struct incise_tracker_info info;
	int n_alone;
	double least = INFINITY, most = -INFINITY;

	config.tracker_noise_mm = 0;
	rig_read(20);
	memcpy(alone, sample, (size_t)n * sizeof(*alone));
	incise_tracker_info(rig.tracker, &info);
	assert_true(info.stations == 1 && info.scalpel_station == 1);
	assert_int_equal(info.tube_station, 0);
	rig_free();

	config.tube_s = 10;
	n_alone = n;
	rig_read(20);
	assert_int_equal(n, n_alone);
	incise_tracker_info(rig.tracker, &info);
	assert_true(info.stations == 2 && info.scalpel_station == 1);
	assert_int_equal(info.tube_station, 2);
	assert_true(info.rate_hz == 120 && incise_tracker_station_hz(&info) == 60);
	for (int i = 0; i < n; i++) {
		assert_int_equal(sample[i].seq, i);
		assert_int_equal(sample[i].station, 1 + i % 2);
		assert_int_equal(sample[i].t_ns, alone[i].t_ns);
		if (sample[i].station == 1) {
			assert_memory_equal(&sample[i].position_mm, &alone[i].position_mm,
					    sizeof(alone[i].position_mm));
			continue;
		}
		assert_true(sample[i].position_mm[0] == 20 &&
			    sample[i].position_mm[1] == 0);
		least = fmin(least, sample[i].position_mm[2]);
		most = fmax(most, sample[i].position_mm[2]);
	}
	/* Within half a period of 60 Hz of its ends: 210 mm * (pi/10 * 1/120)^2, less than
	 * 2 um, and two runs of it. */
	assert_true(least >= -10 && least < -10 + 2e-3);
	assert_true(most <= 200 && most > 200 - 2e-3);
	rig_free();
}
