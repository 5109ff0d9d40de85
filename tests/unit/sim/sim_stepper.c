// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/sim_stepper.c: limits, faults, and a handle that obeys the equation of motion at any
 * stiffness; on the bench backlash, loss, friction and lost steps, and the force channel.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/sim/sim.h"
#include "../../../lib/sim/world.h"

#define START_NS INCISE_NS_PER_S
#define TICK_NS 100000

static struct incise_sim_config config;
static struct incise_stepper_status s;
static struct {
	struct incise_clock *clock;
	struct incise_sim *sim;
	struct incise_stepper *stepper;
	int64_t now;
} rig;

static void rig_new(void)
{
	rig.clock = incise_clock_new_simulated(START_NS);
	rig.now = START_NS;
	rig.sim = incise_sim_new(&config, rig.clock, NULL);
	assert_non_null(rig.sim);
	rig.stepper = incise_sim_stepper_new(rig.sim, 0);
}

static void rig_free(void)
{
	rig.stepper->ops->close(rig.stepper);
	incise_sim_free(rig.sim);
	incise_clock_free(rig.clock);
}

/* A test sets the configuration that it begins with, and has the rig until its end. */
static int begin(void **state)
{
	incise_sim_config_init(&config);
	return 0;
}

static int end(void **state)
{
	rig_free();
	return 0;
}

static struct incise_stepper_status rig_after(int64_t ns)
{
	rig.now += ns;
	incise_clock_wait_until(rig.clock, rig.now);
	assert_int_equal(incise_stepper_status(rig.stepper, &s), 0);
	return s;
}

/* Hold a target for some time, renewed before the deadman acts. */
static struct incise_stepper_status rig_hold(double mm, double seconds)
{
	for (int i = 0; i < seconds * 20; i++) {
		incise_stepper_set(rig.stepper, mm);
		rig_after(50000000);
	}
	return rig_after(0);
}

TEST(spring_law_at_rest, begin)
{
	static const double target_mm[] = {0, 0.5, 5, 12.3456789, 20};

	for (size_t i = 0; i < sizeof(target_mm) / sizeof(target_mm[0]); i++) {
		rig_new();
		rig_hold(target_mm[i], 2);

		/* To the nearest microstep. */
		assert_true(fabs(s.position_mm - target_mm[i]) <= 2.0 / 3200 / 2 + 1e-12);
		assert_true(s.force_N == 2 * (s.position_mm - s.handle_mm));
		/* Springs 2 and 1 N/mm in series, less what friction of 0.01 N holds. */
		assert_true(fabs(s.handle_mm - s.position_mm * 2 / 3) <= 0.01 / 3 + 1e-9);
		assert_int_equal(s.faults, 0);
		rig_free();
	}
}

TEST(limits_are_never_exceeded, begin)
{
	/* screw_mm_s, screw_mm_s2, steps_per_turn */
	static const double row[][3] = {
		{30, 3000, 3200},
		{30, 100, 200},
		{10000, 1e7, 1000000},
		{0.1, 1e7, 3200},
	};
	uint64_t key = incise_random_key(9, INCISE_RANDOM_SURGEON);

	for (size_t k = 0; k < sizeof(row) / sizeof(row[0]); k++) {
		double step = 2 / row[k][2], v = row[k][0] * 1e-4, dv = row[k][1] * 1e-8;
		double before = 0, moved = 0;

		incise_sim_config_init(&config);
		config.screw_mm_s = row[k][0];
		config.screw_mm_s2 = row[k][1];
		config.steps_per_turn = (int)row[k][2];
		rig_new();
		for (int i = 0; i < 20000; i++) {
			/* Targets in and out of the travel, often while it still moves. */
			if (i % 97 == 0)
				incise_stepper_set(rig.stepper,
						   40 * incise_random_uniform(key, i) -
							   10);
			rig_after(TICK_NS);
			assert_true(s.position_mm >= 0 && s.position_mm <= 20);
			/* A position is off by half a step: a difference by one, a second by two. */
			assert_true(fabs(s.position_mm - before) <= v + step + 1e-12);
			assert_true(fabs(s.position_mm - before - moved) <=
				    dv + 2 * step + 1e-12);
			moved = s.position_mm - before;
			before = s.position_mm;
		}
		rig_free();
	}
}

TEST(target_is_reached_in_the_time_of_a_trapezoid, begin, end)
{
	int ticks = 0;

	rig_new();
	for (double mm = 0; mm != 10; ticks++) {
		double last = mm;

		if (ticks % 500 == 0)
			incise_stepper_set(rig.stepper, 10);
		mm = rig_after(TICK_NS).position_mm;
		assert_true(mm >= last && mm <= 10); /* neither back nor beyond */
	}
	/*
	 * 10 mm at 30 mm/s and 3000 mm/s²: 333.3 + 10 ms. The last half microstep, 0.3 µm,
	 * shows before it is gone, √(2·0.3 µm/3000 mm/s²) = 0.5 ms early.
	 */
	assert_true(fabs(ticks * 0.1 - 343.3) < 0.7);
	assert_true(rig_after(10000000).position_mm == 10);
}

TEST(faults_are_reported, begin, end)
{
	rig_new();
	/* Not yet in use. */
	assert_int_equal(rig_after(INCISE_NS_PER_S).faults, 0);
	rig_hold(25, 1);
	assert_int_equal(s.faults, INCISE_STEPPER_FAULT_TRAVEL);
	assert_true(s.position_mm == 20);
	rig_hold(-1, 1);
	assert_int_equal(s.faults, INCISE_STEPPER_FAULT_TRAVEL);
	assert_true(s.position_mm == 0);
	rig_hold(1, 1);
	assert_int_equal(s.faults, 0);
	/* A NaN is neither a target nor a heartbeat. */
	assert_int_equal(incise_stepper_set(rig.stepper, 1), 0);
	rig_after(60000000);
	assert_int_equal(incise_stepper_set(rig.stepper, NAN), -EDOM);
	assert_int_equal(incise_stepper_set(rig.stepper, INFINITY), -EDOM);
	assert_int_equal(incise_stepper_set(rig.stepper, -INFINITY), -EDOM);
	rig_after(39900000);
	assert_int_equal(s.faults, 0);
	assert_true(s.position_mm == 1);
	/* The tick that starts 100 ms after the target is the first to act. */
	assert_int_equal(rig_after(100000).faults, 0);
	assert_int_equal(rig_after(100000).faults, INCISE_STEPPER_FAULT_DEADMAN);
	rig_after(INCISE_NS_PER_S);
	assert_int_equal(s.faults, INCISE_STEPPER_FAULT_DEADMAN);
	assert_true(s.position_mm == 0);
	/* What friction of 0.01 N holds against both springs. */
	assert_true(fabs(s.handle_mm) <= 0.01 / 3 + 1e-9);
	assert_int_equal(incise_stepper_set(rig.stepper, 2), 0);
	assert_int_equal(rig_after(0).faults, 0);
}

/* Handle in mm and mm/s under m x'' = k (nut - x) - k_h x - b x'. */
static void rates(const struct incise_sim_config *c, double nut, const double y[2],
		  double dy[2])
{
	dy[0] = y[1];
	dy[1] = (c->spring_N_mm * (nut - y[0]) - c->hand_N_mm * y[0] -
		 c->hand_N_s_mm * y[1]) *
		1000 / c->handle_kg;
}

static void runge_kutta(const struct incise_sim_config *c, double nut, double h,
			double y[2])
{
	double k[4][2], at[2];

	rates(c, nut, y, k[0]);
	for (int i = 1; i < 4; i++) {
		for (int j = 0; j < 2; j++)
			at[j] = y[j] + h * (i < 3 ? 0.5 : 1) * k[i - 1][j];
		rates(c, nut, at, k[i]);
	}
	for (int j = 0; j < 2; j++)
		y[j] += h / 6 * (k[0][j] + 2 * k[1][j] + 2 * k[2][j] + k[3][j]);
}

TEST(handle_moves_as_the_equation_says, begin, end)
{
	double y[2] = {0}, before = 0, farthest = 0;

	config.handle_friction_N = 0;
	rig_new();
	for (int i = 0; i < 6000; i++) {
		if (i % 500 == 0)
			incise_stepper_set(rig.stepper, i < 3000 ? 8 : 2);
		rig_after(TICK_NS);
		/* Ten steps a tick: its own error is 1e-4 of what is looked for. */
		for (int k = 0; k < 10; k++)
			runge_kutta(&config, (before + s.position_mm) / 2, 1e-5, y);
		/*
		 * The midpoint rule's period is (ωT)²/12 = 5e-5 too long, ω = 245/s: over
		 * a decay time of 10 ms a phase of 1.2e-4. The nut's 30 mm/s excite
		 * 2/3·30/ω = 0.08 mm: an error of 1e-5 mm. Ten times that is allowed.
		 */
		assert_true(fabs(y[0] - s.handle_mm) < 1e-4);
		farthest = fmax(farthest, s.handle_mm);
		before = s.position_mm;
	}
	assert_true(farthest > 5.3); /* 2/3 of 8 mm: it has moved at all */
}

TEST(friction_holds, begin, end)
{
	config.handle_friction_N = 1;
	rig_new();
	rig_hold(0.4, 1); /* 0.8 N */
	assert_true(s.handle_mm == 0);
	assert_true(s.force_N == 2 * s.position_mm);
	rig_hold(0.6, 1); /* 1.2 N: away, until within 1 N of balance */
	assert_true(s.handle_mm > 0);
	assert_true(fabs(2 * (s.position_mm - s.handle_mm) - s.handle_mm) <= 1 + 1e-9);
}

TEST(bounded_however_stiff, begin)
{
	/* spring, hand N/mm; hand N s/mm; kg; friction N */
	static const double row[][5] = {
		{1000, 1000, 0.0001, 0.001, 0},	  {1000, 0, 0.0001, 0.001, 0},
		{1000, 1000, 10, 0.001, 0},	  {0.001, 0, 0.0001, 100, 0},
		{1000, 1000, 0.0001, 0.001, 100}, {1000, 0, 0.0001, 100, 0.01},
	};

	for (size_t k = 0; k < sizeof(row) / sizeof(row[0]); k++) {
		incise_sim_config_init(&config);
		config.spring_N_mm = row[k][0];
		config.hand_N_mm = row[k][1];
		config.hand_N_s_mm = row[k][2];
		config.handle_kg = row[k][3];
		config.handle_friction_N = row[k][4];
		config.screw_mm_s = 10000;
		config.screw_mm_s2 = 1e7;
		rig_new();
		for (int i = 0; i < 20000; i++) {
			/* Ten moves in all over the whole travel. */
			if (i % 500 == 0)
				incise_stepper_set(rig.stepper, i / 2000 % 2 ? 0 : 20);
			rig_after(TICK_NS);
			/*
			 * Without any damping, each move adds an oscillation no larger than
			 * the travel about a rest within it: (10 + 1)·20 mm. An unstable
			 * method leaves that behind in a few ticks.
			 */
			assert_true(fabs(s.handle_mm) <= 11 * 20);
		}
		rig_free();
	}
}

TEST(asking_changes_nothing, begin)
{
	struct incise_stepper_status end[2];

	for (int k = 0; k < 2; k++) {
		incise_sim_config_init(&config);
		rig_new();
		for (int i = 0; i < 300; i++) {
			incise_stepper_set(rig.stepper, i % 40);
			/* 1.2345 ms at once, or in parts. */
			for (int part = 0; k && part < 5; part++)
				rig_after(200000);
			rig_after(k ? 234500 : 1234500);
		}
		end[k] = rig_after(0);
		rig_free();
	}
	assert_true(end[0].handle_mm == end[1].handle_mm && end[0].handle_mm != 0);
	assert_true(end[0].position_mm == end[1].position_mm);
	assert_int_equal(end[0].t_ns, end[1].t_ns);
}

TEST(it_is_always_powered_and_reports_its_motion, begin, end)
{
	rig_new();
	rig_after(0);
	assert_int_equal(s.state, INCISE_STEPPER_STATE_READY);
	assert_true(s.homed && !s.inputs && !s.late && s.velocity_mm_s == 0);
	assert_int_equal(incise_stepper_set(rig.stepper, 10), 0);
	/* 30 mm/s are reached after 10 ms. */
	rig_after(20000000);
	assert_int_equal(s.state, INCISE_STEPPER_STATE_MOVING);
	assert_true(s.velocity_mm_s == 30);
	/* Enabled, it stays where it is, and the deadman runs from there on. */
	assert_int_equal(incise_stepper_enable(rig.stepper, NULL), 0);
	rig_after(90000000);
	assert_int_equal(s.state, INCISE_STEPPER_STATE_READY);
	assert_true(s.position_mm > 0.3 && s.position_mm < 1 && !s.faults);
	rig_after(10200000);
	assert_int_equal(s.faults, INCISE_STEPPER_FAULT_DEADMAN);
	assert_int_equal(s.state, INCISE_STEPPER_STATE_STOPPING);
	rig_after(INCISE_NS_PER_S);
	assert_int_equal(s.state, INCISE_STEPPER_STATE_READY);
	assert_int_equal(incise_stepper_clear(rig.stepper, NULL), 0);
	assert_int_equal(rig_after(0).faults, 0);
	/* Disabled, it moves to zero force, without a deadman. */
	rig_hold(5, 1);
	assert_int_equal(incise_stepper_disable(rig.stepper, NULL), 0);
	rig_after(INCISE_NS_PER_S);
	assert_true(s.position_mm == 0 && !s.faults);
	assert_int_equal(incise_stepper_jog(rig.stepper, 1), -EOPNOTSUPP);
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, NULL), -EOPNOTSUPP);
}

TEST(info_is_the_configuration, begin, end)
{
	struct incise_stepper_info info;

	rig_new();
	incise_stepper_info(rig.stepper, &info);
	assert_true(info.spring_N_mm == 2 && info.travel_mm == 20);
	assert_true(info.step_mm == 2.0 / 3200);
	assert_true(info.velocity_mm_s == 30 && info.acceleration_mm_s2 == 3000);
	assert_true(info.deadman_s == 0.1 && info.measures_handle && !info.inputs);
	assert_string_equal(info.name, "simulated haptic scalpel");
}

/* Move in microsteps; returns the force. */
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

TEST(bench_agrees_with_hand_calculation, begin)
{
	struct incise_bench b = {0};

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

	/* Lost steps stay lost. */
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

TEST(force_channel_shows_the_bench, begin)
{
	struct incise_clock *clock = incise_clock_new_simulated(0);
	struct incise_stepper *stepper;
	struct incise_force *force;
	struct incise_sim *sim;

	config.bench = 1;
	config.handle_friction_N = 0;
	config.backlash_mm = 0.1;
	sim = incise_sim_new(&config, clock, NULL);
	force = incise_sim_force_new(sim);
	stepper = incise_sim_stepper_new(sim, 0);
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

TEST(jog_is_for_the_bench_only, begin)
{
	struct incise_clock *clock = incise_clock_new_simulated(0);
	struct incise_stepper *stepper;
	struct incise_sim *sim;

	sim = incise_sim_new(&config, clock, NULL);
	stepper = incise_sim_stepper_new(sim, 0);
	assert_int_equal(stepper->ops->jog(stepper, 1), -EOPNOTSUPP);
	stepper->ops->close(stepper);
	incise_sim_free(sim);
	incise_clock_free(clock);
}
