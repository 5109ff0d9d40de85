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
