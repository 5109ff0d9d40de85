// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/motor.c over lib/device/gpio/pulser.c, on lines and a clock that a test
 * makes: all cases of the conformance table, exactly in time and with a thread that is
 * late; the same table for the virtual rig.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/rig/motor.h"
#include "../../../lib/sim/sim.h"
#include "conformance.h"
#include "machine.h"

/* A motor with its own pulser and machine. */
struct bench {
	struct incise_motor motor;
	struct incise_stepper_setpoint setpoint;
	struct incise_stepper_motor_status status;
	struct incise_stepper_config config;
	struct incise_pulser pulser;
	struct machine machine;
	int64_t late_ns; /* at most */
	uint64_t random;
};

static void failed(const char *text)
{
	fail_msg("%s", text);
}

static int64_t lateness(struct bench *b)
{
	incise_random_step(&b->random);
	return b->late_ns ? (int64_t)((b->random >> 33) % (uint64_t)b->late_ns) : 0;
}

static void bench_advance(void *world, int64_t ns)
{
	struct bench *b = world;
	int64_t end = b->machine.now_ns + ns;

	for (;;) {
		int64_t due = incise_pulser_run(&b->pulser);

		if (due > end)
			break;
		if (due > b->machine.now_ns)
			b->machine.now_ns = due + lateness(b);
	}
	if (b->machine.now_ns < end)
		b->machine.now_ns = end;
}

static void bench_input(void *world, unsigned int input, bool active)
{
	struct bench *b = world;
	unsigned int line = input == INCISE_STEPPER_LINE_ESTOP
				    ? INCISE_STEPPER_LINE_ESTOP
				    : INCISE_STEPPER_LINE_LIMIT_MAX;

	b->machine.forced = active ? b->machine.forced | line : b->machine.forced & ~line;
}

static struct bench *of(struct incise_motor *motor)
{
	return (struct bench *)motor;
}

static int bench_enable(struct incise_motor *motor, struct incise_error *err)
{
	return incise_pulser_enable(&of(motor)->pulser);
}

static int bench_disable(struct incise_motor *motor)
{
	incise_pulser_disable(&of(motor)->pulser);
	return 0;
}

static int bench_clear(struct incise_motor *motor, struct incise_error *err)
{
	return incise_pulser_clear(&of(motor)->pulser);
}

static int bench_origin(struct incise_motor *motor, int32_t steps, bool homed)
{
	return incise_pulser_origin(&of(motor)->pulser, steps, homed);
}

static int64_t bench_now(struct incise_motor *motor)
{
	return of(motor)->machine.now_ns;
}

static int bench_wait(struct incise_motor *motor, int64_t ns)
{
	bench_advance(of(motor), ns);
	return 0;
}

static void bench_close(struct incise_motor *motor)
{
	(void)motor;
}

static const struct incise_motor_ops ops = {
	.enable = bench_enable,
	.disable = bench_disable,
	.clear = bench_clear,
	.origin = bench_origin,
	.close = bench_close,
	.now = bench_now,
	.wait = bench_wait,
};

/* 5 mm of travel, 1.25 µm a step, 8000 steps/s. */
static const struct incise_actuator actuator = {
	.spring_N_mm = 2,
	.travel_mm = 5,
	.lead_mm = 4,
	.steps_per_turn = 200,
	.microsteps = 16,
	.velocity_mm_s = 10,
	.acceleration_mm_s2 = 500,
	.jerk_mm_s3 = 50000,
	.deadman_s = 0.1,
	.tick_ns = 250000,
	.high_ns = 5000,
	.low_ns = 5000,
	.setup_ns = 20000,
	.hold_ns = 10000,
	.enable_ns = 1000000,
	.home_mm_s = 2,
};

static void bench_start(struct bench *b, bool home, bool limits, bool invert,
			int64_t late_ns)
{
	*b = (struct bench){
		.motor = {.ops = &ops,
			  .actuator = actuator,
			  .name = "bench",
			  .rate_max_hz = 20000,
			  .lines = INCISE_STEPPER_LINE_ESTOP},
		.machine = {.now_ns = 5000000000,
			    .look_ns = 200,
			    .invert = invert,
			    .at = home || limits ? 1500 : 0,
			    .end = 100000,
			    .wired_home = home,
			    .wired_limits = limits},
		.late_ns = late_ns,
		.random = 7,
	};
	b->motor.lines |= home ? INCISE_STEPPER_LINE_HOME : 0;
	b->motor.lines |=
		limits ? INCISE_STEPPER_LINE_LIMIT_MIN | INCISE_STEPPER_LINE_LIMIT_MAX
		       : 0;
	b->motor.actuator.invert = invert;
	b->motor.setpoint = &b->setpoint;
	b->motor.slot = &b->status;
	incise_motor_init(&b->motor);
	incise_motor_config(&b->motor.actuator, 0, &b->config);
	b->machine.config = &b->config;
	b->pulser = (struct incise_pulser){
		.ops = &machine_ops,
		.world = &b->machine,
		.motion.setpoint = &b->setpoint,
		.motion.slot = &b->status,
		.home = incise_motor_home_line(&b->motor),
	};
	assert_int_equal(incise_pulser_init(&b->pulser, &b->config), 0);
}

TEST(every_case_on_a_made_clock)
{
	static const struct {
		bool home, limits, invert;
		int64_t late_ns;
	} row[] = {
		{false, false, false, 0},
		{true, true, true, 0},
		{false, true, false, 0},
		/* A thread that is late now and then by less than a shortest time … */
		{true, true, false, 4000},
		/* … and by several: steps are lost to lateness, but never in a row of 20. */
		{true, false, true, 8000},
	};

	for (size_t k = 0; k < sizeof(row) / sizeof(*row); k++)
		for (int i = 0; conformance[i].name; i++) {
			static struct bench b;
			struct conformance c = {
				.stepper = &b.motor.stepper,
				.world = &b,
				.advance = bench_advance,
				.input = bench_input,
				.slack_s = 0.1,
				.say = failed,
			};
			const struct incise_stepper_motor_status *told =
				&b.pulser.motion.status;
			int64_t start;

			bench_start(&b, row[k].home, row[k].limits, row[k].invert,
				    row[k].late_ns);
			start = b.machine.at;
			incise_stepper_info(c.stepper, &c.info);
			bench_advance(&b, 1000000);
			conformance[i].run(&c);
			/* The lines reported the same as the status, and no time was short. */
			assert_int_equal(b.machine.too_short, 0);
			assert_int_equal(b.machine.unpowered, 0);
			assert_int_equal(b.machine.into_limit, 0);
			assert_int_equal(b.machine.at - start,
					 (int64_t)(told->steps_up - told->steps_down));
			assert_int_equal(b.machine.steps,
					 told->steps_up + told->steps_down);
			/* The edge is where the input changes, or a step of 2 mm/s·1 ms. */
			if (conformance[i].run == conform_home && row[k].home)
				assert_in_range(b.machine.at - told->position,
						MACHINE_HOME - 1, MACHINE_HOME + 1);
		}
}

/* A driver chip, and what it shall report. */
static struct {
	struct incise_driver driver;
	unsigned int faults;
	bool persists;
	int set_up; /* times */
} chip;

static unsigned int chip_faults(struct incise_driver *driver)
{
	(void)driver;
	return chip.faults;
}

static int chip_cause(struct incise_driver *driver, char *text, size_t size)
{
	(void)driver;
	return chip.faults ? snprintf(text, size, "chip: too hot; cool it, then clear")
			   : 0;
}

static int chip_clear(struct incise_driver *driver, struct incise_error *to)
{
	(void)driver;
	chip.set_up++;
	if (chip.persists)
		return incise_error_set(to, EBUSY, "chip: still too hot; cool it");
	chip.faults = 0;
	return 0;
}

static int chip_read(struct incise_driver *driver, struct incise_stepper_chip *to)
{
	(void)driver;
	*to = (struct incise_stepper_chip){.microsteps = 16, .load = 77};
	return 0;
}

static int chip_counter(struct incise_driver *driver, int i,
			struct incise_stepper_counter *to)
{
	(void)driver;
	*to = (struct incise_stepper_counter){"warm", "warnings", 3, true};
	return i ? -ENOENT : 0;
}

static const struct incise_driver_ops chip_ops = {
	.faults = chip_faults,
	.cause = chip_cause,
	.clear = chip_clear,
	.read = chip_read,
	.counter = chip_counter,
};

static struct incise_stepper_status status_of(struct bench *b)
{
	struct incise_stepper_status status;

	assert_int_equal(incise_stepper_status(&b->motor.stepper, &status), 0);
	return status;
}

/* A chip's fault takes no target any more, then power by the deadman, and lasts until cleared. */
TEST(a_fault_of_the_driver_chip_stops_the_motor)
{
	static struct bench b;
	struct incise_stepper *stepper = &b.motor.stepper;
	struct incise_stepper_counter counter;
	struct incise_stepper_chip read;
	char text[200];

	bench_start(&b, true, false, false, 0);
	assert_int_equal(incise_stepper_chip(stepper, &read), -EOPNOTSUPP);
	assert_int_equal(incise_stepper_counter(stepper, 0, &counter), 0);
	assert_string_equal(counter.key, "lost_steps");
	assert_int_equal(incise_stepper_counter(stepper, 1, &counter), -ENOENT);
	chip.driver.ops = &chip_ops;
	assert_int_equal(stepper->ops->attach(stepper, &chip.driver), 0);
	assert_int_equal(incise_stepper_chip(stepper, &read), 0);
	assert_int_equal(read.load, 77);
	assert_int_equal(incise_stepper_counter(stepper, 1, &counter), 0);
	assert_string_equal(counter.key, "warm");
	assert_int_equal(incise_stepper_counter(stepper, 2, &counter), -ENOENT);

	succeeds(!incise_stepper_enable(stepper, &err));
	bench_advance(&b, 2000000);
	succeeds(!incise_stepper_home(stepper, NULL, NULL, &err));
	assert_int_equal(incise_stepper_set(stepper, 1), 0);
	chip.faults = INCISE_STEPPER_FAULT_ALARM;
	assert_int_equal(incise_stepper_set(stepper, 1), -EIO);
	assert_int_equal(status_of(&b).faults, INCISE_STEPPER_FAULT_ALARM);
	assert_int_equal(status_of(&b).state, INCISE_STEPPER_STATE_STOPPING);
	assert_false(status_of(&b).homed);
	incise_stepper_cause(stepper, text, sizeof(text));
	assert_string_equal(text, "chip: too hot; cool it, then clear");
	assert_error(incise_stepper_clear(stepper, &err), EBUSY, &err, "still moves");
	bench_advance(&b, 300000000);
	assert_int_equal(status_of(&b).state, INCISE_STEPPER_STATE_FAULT);
	assert_error(incise_stepper_enable(stepper, &err), EPERM, &err, "too hot");
	assert_int_equal(chip.set_up, 0);
	chip.persists = true;
	assert_error(incise_stepper_clear(stepper, &err), EBUSY, &err, "still too hot");
	chip.persists = false;
	succeeds(!incise_stepper_clear(stepper, &err));
	assert_int_equal(chip.set_up, 2);
	assert_int_equal(status_of(&b).state, INCISE_STEPPER_STATE_DISABLED);
	assert_false(status_of(&b).homed);
	succeeds(!incise_stepper_enable(stepper, &err));

	/* The module keeps no home for a later program, whether the fault is cleared or not … */
	bench_advance(&b, 2000000);
	succeeds(!incise_stepper_home(stepper, NULL, NULL, &err));
	assert_true(b.pulser.motion.status.flags & INCISE_STEPPER_FLAG_HOMED);
	chip.faults = INCISE_STEPPER_FAULT_FOLLOWING;
	succeeds(!incise_stepper_disable(stepper, &err));
	assert_false(b.pulser.motion.status.flags & INCISE_STEPPER_FLAG_HOMED);
	/* … nor one for a chip that was off meanwhile. */
	succeeds(!incise_stepper_clear(stepper, &err));
	b.pulser.motion.status.flags |= INCISE_STEPPER_FLAG_HOMED;
	chip.driver.restarted = true;
	bench_advance(&b, 2000000);
	b.motor.driver = NULL;
	assert_int_equal(stepper->ops->attach(stepper, &chip.driver), 0);
	assert_false(b.pulser.motion.status.flags & INCISE_STEPPER_FLAG_HOMED);
	chip.driver.restarted = false;
}

/* A stall as the edge: at full speed both times, and with the way to reach it. */
TEST(homing_by_a_stall)
{
	static struct bench b;
	struct incise_stepper *stepper = &b.motor.stepper;
	struct incise_stepper_homing homing;

	bench_start(&b, true, false, false, 0);
	assert_int_equal(stepper->ops->homing(stepper, &homing), 0);
	assert_float_equal(homing.edge_mm_s, 0.2, 1e-12);
	assert_float_equal(homing.clearance_mm, 0.2, 1e-12);
	b.motor.actuator.tmc.stall_home = true;
	chip.faults = 0;
	stepper->ops->attach(stepper, &chip.driver);
	assert_int_equal(stepper->ops->homing(stepper, &homing), 0);
	assert_float_equal(homing.edge_mm_s, 2, 1e-12);
	/* 2² / 500 to get to that speed and to leave it, and 20 of 0.02 mm */
	assert_float_equal(homing.clearance_mm, 0.408, 1e-12);
}

#define STALL_MM_S 1

/*
 * An end stop at step 0 and DIAG as the home input: it is active while the motor is driven into the stop
 * at speed, and the nut stays where it is.
 */
static int stall_wait(struct incise_motor *motor, int64_t ns)
{
	struct bench *b = of(motor);
	double mm_s;

	for (; ns > 0; ns -= 250000) {
		bench_advance(b, 250000);
		mm_s = (double)b->pulser.motion.status.velocity / 65536 *
		       incise_actuator_step_mm(&motor->actuator);
		b->machine.forced &= ~(unsigned int)INCISE_STEPPER_LINE_HOME;
		if (b->machine.at <= 0 && mm_s < -STALL_MM_S)
			b->machine.forced |= INCISE_STEPPER_LINE_HOME;
		if (b->machine.at < 0)
			b->machine.at = 0;
	}
	return 0;
}

TEST(a_stall_homes)
{
	static const int64_t starts[] = {0, 1, 100, 1500, 3999};
	struct incise_motor_ops stalling = ops;
	static struct bench b;
	int64_t first = 0;

	stalling.wait = stall_wait;
	for (size_t i = 0; i < sizeof(starts) / sizeof(*starts); i++) {
		struct incise_stepper *stepper = &b.motor.stepper;

		bench_start(&b, true, false, false, 0);
		b.motor.ops = &stalling;
		b.machine.wired_home = false;
		b.machine.at = starts[i];
		b.motor.actuator.tmc.stall_home = true;
		stepper->ops->attach(stepper, &chip.driver);
		succeeds(!incise_stepper_enable(stepper, &err));
		stall_wait(&b.motor, 2000000);
		succeeds(!incise_stepper_home(stepper, NULL, NULL, &err));
		assert_true(status_of(&b).homed);
		/*
		 * The stop holds the nut while the count comes to rest, and on the way back it leaves
		 * the stop by as much: v²/2a + va/2j and 2 ms of polls, 18 µm or 15 steps, and a few for
		 * ticks; from each start the same.
		 */
		assert_in_range(b.machine.at, 15, 20);
		assert_int_equal(b.machine.at, i ? first : b.machine.at);
		first = b.machine.at;
		assert_int_equal(b.pulser.motion.status.position, 0);
	}
}

/* To a position, or until it stops. */
static void go_to(struct bench *b, double mm)
{
	for (int i = 0; i < 200 && !incise_stepper_set(&b->motor.stepper, mm); i++)
		bench_advance(b, 10000000);
	bench_advance(b, 60000000);
}

static unsigned long long lost_steps(struct bench *b)
{
	struct incise_stepper_counter counter;

	assert_int_equal(incise_stepper_counter(&b->motor.stepper, 0, &counter), 0);
	return counter.value;
}

/* Homed, with its edge 1 mm up the travel, and then at 3 mm. */
static void bench_home(struct bench *b, bool home, double home_mm, int max)
{
	bench_start(b, home, !home, false, 0);
	b->motor.actuator.home_mm = home_mm;
	b->motor.actuator.has_home = true;
	b->motor.actuator.lost_steps_max = b->pulser.motion.config.lost_steps_max = max;
	succeeds(!incise_stepper_enable(&b->motor.stepper, &err));
	bench_advance(b, 2000000);
	succeeds(!incise_stepper_home(&b->motor.stepper, NULL, NULL, &err));
	go_to(b, 3);
	assert_int_equal(status_of(b).faults, 0);
}

static void lost(struct bench *b, const char *steps)
{
	char text[200];

	assert_int_equal(status_of(b).faults, INCISE_STEPPER_FAULT_STEPS);
	assert_false(status_of(b).homed);
	assert_true(incise_stepper_cause(&b->motor.stepper, text, sizeof(text)) > 0);
	assert_non_null(strstr(text, steps));
	succeeds(!incise_stepper_clear(&b->motor.stepper, &err));
	assert_int_equal(status_of(b).state, INCISE_STEPPER_STATE_DISABLED);
}

TEST(lost_steps_are_found_where_the_home_edge_is_passed)
{
	static struct bench b;

	/* As often as one likes, at full speed: no step is missing. */
	bench_home(&b, true, 1, 1);
	for (int i = 0; i < 5; i++) {
		go_to(&b, 0);
		go_to(&b, 3);
	}
	assert_int_equal(lost_steps(&b), 0);

	/* Few on the way up are counted; with more of them it stops. */
	bench_home(&b, true, 1, 40);
	b.machine.at -= 40;
	go_to(&b, 0);
	assert_int_equal(status_of(&b).faults, 0);
	assert_int_equal(lost_steps(&b), 40);
	go_to(&b, 3);
	b.machine.at -= 1;
	go_to(&b, 0);
	lost(&b, "bench: 41 steps are missing: ");

	/* On the way down: the edge is behind where it is due. */
	bench_home(&b, true, 1, 40);
	b.machine.at += 40;
	go_to(&b, 0);
	assert_int_equal(status_of(&b).faults, 0);
	assert_int_equal(lost_steps(&b), 40);
	go_to(&b, 3);
	b.machine.at += 90;
	go_to(&b, 0);
	/* Found in the tick after the 40th, so not all of them. */
	lost(&b, "bench: 4");

	/* Any number may be. */
	bench_home(&b, true, 1, 0);
	b.machine.at -= 300;
	go_to(&b, 0);
	assert_int_equal(status_of(&b).faults, 0);
	assert_int_equal(lost_steps(&b), 300);

	/* The limit as home, 0.5 mm below 0. */
	bench_home(&b, false, -0.5, 40);
	go_to(&b, 0);
	go_to(&b, 3);
	b.machine.at -= 500;
	go_to(&b, 0);
	assert_true(status_of(&b).faults & INCISE_STEPPER_FAULT_STEPS);
	assert_false(status_of(&b).homed);
}

struct virtual_rig {
	struct incise_clock *clock;
	int64_t now;
};

static void virtual_advance(void *world, int64_t ns)
{
	struct virtual_rig *v = world;

	v->now += ns;
	incise_clock_wait_until(v->clock, v->now);
}

TEST(every_case_on_the_virtual_rig)
{
	for (int i = 0; conformance[i].name; i++) {
		struct virtual_rig v = {incise_clock_new_simulated(1000000000),
					1000000000};
		struct incise_sim_config config;
		struct conformance c = {
			.world = &v,
			.advance = virtual_advance,
			.always_powered = true,
			.say = failed,
		};
		struct incise_sim *sim;

		incise_sim_config_init(&config);
		sim = incise_sim_new(&config, v.clock, NULL);
		c.stepper = incise_sim_stepper_new(sim, 0);
		incise_stepper_info(c.stepper, &c.info);
		conformance[i].run(&c);
		c.stepper->ops->close(c.stepper);
		incise_sim_free(sim);
		incise_clock_free(v.clock);
	}
}
