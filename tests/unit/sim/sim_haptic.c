// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/sim/sim_haptic.c: its mechanics against closed forms; times, buttons and faults as configured. */
#include "../unit.h"
#include <incise/haptic.h>

#define START_NS INCISE_NS_PER_S
#define MAX 20000
/* A bare, exact device that nothing delays. */
#define BARE                                                                        \
	"motion=still,z_mm=0,hand_kg=0,hand_N_mm=0,hand_N_s_mm=0,damping_N_s_mm=0," \
	"encoder_mm=0,latency_ms=0,force_latency_ms=0,motor_ms=0,mass_kg=0.1,"

static struct incise_haptic_sample sample[MAX];
static int n;
static struct incise_clock *clock_of;
static const struct incise_haptic_setup none;

static struct incise_haptic *start(const char *keys)
{
	struct incise_haptic *haptic;
	char device[600];

	snprintf(device, sizeof(device), "sim:%s", keys);
	clock_of = incise_clock_new_simulated(START_NS);
	haptic = incise_haptic_open(device, "a test", &none, clock_of, &err);
	succeeds(haptic);
	n = 0;
	return haptic;
}

static void stop(struct incise_haptic *haptic)
{
	incise_haptic_close(haptic);
	incise_clock_free(clock_of);
}

/* Until a time of the script, with a force along x that is pushed every @every_s. Returns the last error. */
static int run(struct incise_haptic *haptic, double until_s, double every_s, double N)
{
	int64_t now_ns = incise_clock_now(clock_of);
	int64_t end_ns = START_NS + llround(until_s * 1e9),
		step_ns = llround(every_s * 1e9);
	int got = 0;

	for (; now_ns < end_ns && got >= 0; incise_clock_wait_until(clock_of, now_ns)) {
		got = incise_haptic_read(haptic, sample + n, MAX - n);
		n += got > 0 ? got : 0;
		if (!isnan(N) && got >= 0)
			got = incise_haptic_push(haptic, (double[3]){N}, NULL);
		now_ns += step_ns;
		now_ns = now_ns < end_ns ? now_ns : end_ns;
	}
	if (got < 0)
		return got;
	got = incise_haptic_read(haptic, sample + n, MAX - n);
	n += got > 0 ? got : 0;
	return got < 0 ? got : 0;
}

static const struct incise_haptic_sample *last(void)
{
	assert_true(n > 0);
	return &sample[n - 1];
}

TEST(a_force_moves_a_mass)
{
	static const struct {
		const char *keys;
		double N, s, mm, tolerance_mm;
	} rows[] = {
		/* F t² / 2 m */
		{BARE, 0.2, 0.1, 10, 1e-6},
		/* … which begins later */
		{BARE "force_latency_ms=10", 0.2, 0.1, 8.1, 0.005},
		{BARE "motor_ms=10", 0.2, 0.1, 8.2, 0.01},
		/* … with at most so much */
		{BARE "peak_N=0.1", 0.2, 0.1, 5, 1e-6},
		/* F / b (t - m / b) */
		{BARE "damping_N_s_mm=0.01", 0.2, 0.1, 1.8, 0.005},
		/* (F - Coulomb) t² / 2 m, or rest */
		{BARE "coulomb_N=0.1", 0.2, 0.1, 5, 1e-6},
		{BARE "coulomb_N=0.1,stiction_N=0.11", 0.2, 0.1, 0, 0},
		{BARE "coulomb_N=0.1,stiction_N=0.09", 0.2, 0.1, 5, 1e-6},
		/* F / k of the hand */
		{BARE "hand_N_mm=0.1,hand_N_s_mm=0.01", 0.2, 2, 2, 1e-6},
		/* F / k beyond the end of the workspace */
		{BARE "workspace_mm=10,stop_N_mm=0.5,damping_N_s_mm=0.01", 0.2, 2, 5.4,
		 1e-4},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct incise_haptic *haptic = start(rows[i].keys);

		assert_int_equal(run(haptic, rows[i].s, 1e-3, rows[i].N), 0);
		if (!(fabs(last()->position_mm[0] - rows[i].mm) <= rows[i].tolerance_mm))
			fail_msg("%s: %.9g mm, not %g", rows[i].keys,
				 last()->position_mm[0], rows[i].mm);
		assert_true(last()->position_mm[1] == 0);
		stop(haptic);
	}
}

TEST(the_motor_crosses_the_play)
{
	struct incise_haptic *haptic = start(BARE "backlash_mm=0.4,coulomb_N=10");

	run(haptic, 0.1, 1e-3, 1);
	assert_float_equal(last()->position_mm[0], 0.2, 1e-12);
	run(haptic, 0.2, 1e-3, -1);
	assert_float_equal(last()->position_mm[0], -0.2, 1e-12);
	stop(haptic);
}

TEST(a_force_ends_with_its_owner)
{
	struct incise_haptic *haptic = start(BARE "deadman_s=0.1");
	double x;

	run(haptic, 1e-3, 1e-3, 0.01);
	run(haptic, 0.5, 1e-3, NAN);
	/* 0.1 m/s² for 0.1 s, then it goes on as fast */
	x = last()->position_mm[0];
	assert_float_equal(x, 0.5 + 0.4 * 10, 0.02);
	stop(haptic);
}

TEST(samples_come_at_their_times)
{
	struct incise_haptic *haptic =
		start("rate_hz=3000,latency_ms=1.25,encoder_mm=0.05");

	assert_int_equal(incise_haptic_read(haptic, sample, MAX), 0);
	run(haptic, 0.00124, 1, NAN);
	assert_int_equal(n, 0);
	run(haptic, 0.00125, 1, NAN);
	assert_int_equal(n, 1);
	run(haptic, 2.00125, 0.01, NAN);
	assert_int_equal(n, 6001);
	for (int i = 0; i < n; i++) {
		double steps = sample[i].position_mm[2] / 0.05;

		assert_int_equal(sample[i].seq, i);
		assert_int_equal(sample[i].t_ns, START_NS + llround(i * 1e9 / 3000));
		assert_float_equal(steps, rint(steps), 1e-9);
	}
	assert_int_equal(incise_haptic_lost(haptic), 0);
	stop(haptic);
}

TEST(samples_do_not_depend_on_the_reading)
{
	static struct incise_haptic_sample first[MAX];
	const char *keys = "noise_mm=0.02,begin_s=0,cycle_s=1,backlash_mm=0.1,seed=3";
	struct incise_haptic *haptic = start(keys);
	int taken;

	run(haptic, 3, 1e-3, NAN);
	memcpy(first, sample, sizeof(first));
	taken = n;
	stop(haptic);
	haptic = start(keys);
	run(haptic, 3, 0.0737, NAN);
	assert_int_equal(n, taken);
	assert_memory_equal(first, sample, (size_t)n * sizeof(*first));
	stop(haptic);
}

TEST(the_hand_follows_its_script)
{
	/* A hand so stiff that it is where it wants to be: x, y, z after a quarter and half of a cycle. */
#define STIFF \
	"hand_N_mm=1000,hand_kg=0.01,hand_N_s_mm=0.2,encoder_mm=0,cycle_s=4,begin_s=1,"
	static const struct {
		const char *keys;
		double quarter[3], half[3];
	} rows[] = {
		{STIFF "motion=still,x_mm=1,y_mm=2,z_mm=3", {1, 2, 3}, {1, 2, 3}},
		{STIFF "motion=press,depth_mm=6,z_mm=10", {0, 0, 2}, {0, 0, -6}},
		{STIFF "motion=circle,radius_mm=7,z_mm=1", {7, 7, 1}, {0, 14, 1}},
		{STIFF "motion=lean,lean_N=100,z_mm=1", {0, 0, 0.9}, {0, 0, 0.9}},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct incise_haptic *haptic = start(rows[i].keys);

		for (int k = 1; k <= 2; k++) {
			const double *at = k == 1 ? rows[i].quarter : rows[i].half;

			run(haptic, 1 + k, 0.01, NAN);
			for (int axis = 0; axis < 3; axis++)
				assert_float_equal(last()->position_mm[axis], at[axis],
						   0.02);
		}
		stop(haptic);
	}
}

TEST(buttons_are_pressed_by_the_script)
{
	struct incise_haptic *haptic = start(
		"button1_from_s=0.1,button1_to_s=0.3,button2_from_s=0.2,button2_to_s=0.4");

	run(haptic, 0.5, 0.01, NAN);
	for (int i = 0; i < n; i++)
		assert_int_equal(sample[i].buttons,
				 (i >= 100 && i < 300) | (i >= 200 && i < 400) << 1);
	stop(haptic);
}

TEST(faults_begin_at_their_times)
{
	static const struct {
		const char *key;
		int rc, samples;
		unsigned int flags;
	} rows[] = {
		{"unplugged_s", -ENODEV, 100, 0},
		{"dies_s", 0, 100, 0},
		{"nan_s", 0, 201, 0},
		{"late_ms=50,late_s", 0, 151, 0},
		{"changes_s", 0, 201, INCISE_HAPTIC_CHANGED},
		{"not_ready_s", 0, 201, INCISE_HAPTIC_NOT_READY},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		const char *key = strrchr(rows[i].key, ',');
		struct incise_haptic *haptic;
		char keys[80], why[200];

		snprintf(keys, sizeof(keys), "latency_ms=0,%s=0.1", rows[i].key);
		haptic = start(keys);
		run(haptic, 0.09, 1e-3, 0);
		assert_int_equal(incise_haptic_cause(haptic, why, sizeof(why)), 0);
		assert_int_equal(last()->flags, 0);
		assert_int_equal(run(haptic, 0.2, 1e-3, 0), rows[i].rc);
		assert_int_equal(n, rows[i].samples);
		assert_int_equal(last()->flags, rows[i].flags);
		assert_int_equal(isnan(last()->position_mm[2]), i == 2);
		assert_true(incise_haptic_cause(haptic, why, sizeof(why)) > 0);
		assert_non_null(strstr(why, key ? key + 1 : rows[i].key));
		stop(haptic);
	}
}

TEST(wrong_arguments_are_named)
{
	static const struct {
		const char *keys, *text;
	} rows[] = {
		{"mass=1", "a test: sim.mass: unknown key; rig.conf(5) lists them"},
		{"mass_kg", "a test: sim.mass_kg: "},
		{"rate_hz=5", "a test: sim.rate_hz: "},
		{"motion=run", "a test: sim.motion: "},
		{"seed=1,,seed=2", "a test: sim.: unknown key; "},
	};

	clock_of = incise_clock_new_simulated(START_NS);
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		char device[80];

		snprintf(device, sizeof(device), "sim:%s", rows[i].keys);
		assert_null(incise_haptic_open(device, "a test", &none, clock_of, &err));
		assert_int_equal(errno, EINVAL);
		assert_memory_equal(err.text, rows[i].text, strlen(rows[i].text));
	}
	incise_clock_free(clock_of);
}
