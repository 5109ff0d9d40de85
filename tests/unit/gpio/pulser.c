// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/gpio/pulser.c: what it does when something is wrong, on lines and a clock that
 * a test makes. What it does when all is well is in tests/unit/rig/motor.c.
 */
#include "../unit.h"
#include "../../../lib/rig/page.h"
#include "../rig/machine.h"

#define MS 1000000LL

struct bench {
	struct incise_stepper_setpoint setpoint;
	struct incise_stepper_motor_status status;
	struct incise_stepper_config config;
	struct incise_pulser pulser;
	struct machine machine;
};

/* 4000 steps/s, 200 000 steps/s²: 80 steps to a stop. */
static void start(struct bench *b, unsigned int flags)
{
	*b = (struct bench){
		.config = {.flags = flags,
			   .tick_ns = 250000,
			   .velocity = 4000,
			   .acceleration = 200000,
			   .late_max = 20,
			   .position_max = 20000,
			   .deadman_ns = 100 * MS,
			   .high_ns = 5000,
			   .low_ns = 6000,
			   .setup_ns = 20000,
			   .hold_ns = 10000,
			   .enable_ns = 2 * MS},
		.machine = {.now_ns = 1000 * MS,
			    .look_ns = 100,
			    .end = 100000,
			    .invert = flags & INCISE_STEPPER_CONFIG_INVERT},
	};
	b->machine.config = &b->config;
	b->pulser = (struct incise_pulser){
		.ops = &machine_ops,
		.world = &b->machine,
		.motion.setpoint = &b->setpoint,
		.motion.slot = &b->status,
	};
	assert_int_equal(incise_pulser_init(&b->pulser, &b->config), 0);
	assert_int_equal(b->status.state, INCISE_STEPPER_STATE_DISABLED);
}

/* @late_ns: by how much each wake-up is late. */
static void go(struct bench *b, int64_t ns, int64_t late_ns)
{
	int64_t end = b->machine.now_ns + ns;

	for (;;) {
		int64_t due = incise_pulser_run(&b->pulser);

		if (due > end)
			break;
		if (due > b->machine.now_ns)
			b->machine.now_ns = due + late_ns;
	}
	if (b->machine.now_ns < end)
		b->machine.now_ns = end;
}

static void want(struct bench *b, unsigned int mode, int64_t target)
{
	incise_page_put_setpoint(&b->setpoint, mode, target, b->machine.now_ns);
}

/* Under way at full speed: at some 1500 steps. */
static void under_way(struct bench *b, unsigned int flags)
{
	start(b, flags);
	assert_int_equal(incise_pulser_enable(&b->pulser), 0);
	for (int i = 0; i < 10; i++) {
		want(b, INCISE_STEPPER_MODE_POSITION, 15000);
		go(b, 40 * MS, 0);
	}
	assert_int_equal(b->status.state, INCISE_STEPPER_STATE_MOVING);
	assert_in_range(b->status.position, 1400, 1600);
	assert_int_equal(b->status.velocity, 4000 << 16);
}

static void over(struct bench *b)
{
	assert_int_equal(b->status.state, INCISE_STEPPER_STATE_FAULT);
	assert_false(b->machine.enable || b->machine.step);
	assert_int_equal(b->machine.too_short, 0);
	assert_int_equal(b->machine.unpowered, 0);
	assert_int_equal(b->machine.at, b->status.position);
}

TEST(a_deadman_brakes_or_retracts)
{
	/* flags, homed, where it ends: at once, or 0 */
	static const struct {
		unsigned int flags;
		bool homed, back;
	} cases[] = {
		{0, false, false},
		{0, true, false},
		{INCISE_STEPPER_CONFIG_RETRACT, false, false},
		{INCISE_STEPPER_CONFIG_RETRACT, true, true},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct bench b;
		int64_t at;

		start(&b, cases[i].flags);
		assert_int_equal(incise_pulser_origin(&b.pulser, 0, cases[i].homed), 0);
		assert_int_equal(incise_pulser_enable(&b.pulser), 0);
		want(&b, INCISE_STEPPER_MODE_POSITION, 15000);
		go(&b, 99 * MS, 0);
		assert_int_equal(b.status.state, INCISE_STEPPER_STATE_MOVING);
		go(&b, 2 * MS, 0);
		at = b.status.position;
		assert_int_equal(b.status.state, INCISE_STEPPER_STATE_STOPPING);
		assert_int_equal(b.status.faults, INCISE_STEPPER_FAULT_DEADMAN);
		/* What is asked now comes too late. */
		want(&b, INCISE_STEPPER_MODE_POSITION, 15000);
		go(&b, 1000 * MS, 0);
		over(&b);
		if (cases[i].back)
			assert_int_equal(b.status.position, 0);
		else
			/* v²/(2a) = 40 steps. */
			assert_in_range(b.status.position, at, at + 41);
		/* It came to rest within its limits: it knows where it is. */
		assert_int_equal(b.status.flags & INCISE_STEPPER_FLAG_HOMED,
				 cases[i].homed);
	}
}

TEST(some_faults_halt_at_once)
{
	static const struct {
		unsigned int forced;
		int write_error;
		unsigned int fault;
	} cases[] = {
		{INCISE_STEPPER_LINE_ESTOP, 0, INCISE_STEPPER_FAULT_ESTOP},
		{INCISE_STEPPER_LINE_ALARM, 0, INCISE_STEPPER_FAULT_ALARM},
		{INCISE_STEPPER_LINE_LIMIT_MAX, 0, INCISE_STEPPER_FAULT_LIMIT_MAX},
		{0, -EIO, INCISE_STEPPER_FAULT_LINE},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct bench b;
		uint64_t steps;

		under_way(&b, 0);
		b.pulser.motion.status.flags |= INCISE_STEPPER_FLAG_HOMED;
		steps = b.machine.steps;
		b.machine.forced = cases[i].forced;
		b.machine.write_error = cases[i].write_error;
		go(&b, 50 * MS, 0);
		assert_int_equal(b.status.faults, cases[i].fault);
		assert_int_equal(b.status.state, INCISE_STEPPER_STATE_FAULT);
		assert_int_equal(b.machine.steps, steps);
		assert_false(b.status.flags & INCISE_STEPPER_FLAG_HOMED);
		assert_int_equal(incise_pulser_enable(&b.pulser), -EPERM);
	}
}

/* The other limit is behind it: it may go on. */
TEST(a_limit_stops_one_direction)
{
	struct bench b;

	under_way(&b, 0);
	b.machine.forced = INCISE_STEPPER_LINE_LIMIT_MIN;
	want(&b, INCISE_STEPPER_MODE_POSITION, 15000);
	go(&b, 50 * MS, 0);
	assert_int_equal(b.status.faults, 0);
	assert_true(b.status.inputs & INCISE_STEPPER_LINE_LIMIT_MIN);
	/* Back: not one step down. */
	want(&b, INCISE_STEPPER_MODE_POSITION, 0);
	go(&b, 90 * MS, 0);
	assert_int_equal(b.status.faults, INCISE_STEPPER_FAULT_LIMIT_MIN);
	assert_int_equal(b.status.steps_down, 0);
	over(&b);
}

TEST(some_faults_brake)
{
	static const unsigned int faults[] = {INCISE_STEPPER_FAULT_OWNER,
					      INCISE_STEPPER_FAULT_SUSPEND,
					      INCISE_STEPPER_FAULT_GONE,
					      INCISE_STEPPER_FAULT_SETPOINT};

	for (size_t i = 0; i < sizeof(faults) / sizeof(*faults); i++) {
		struct bench b;
		int64_t at;

		under_way(&b, 0);
		at = b.status.position;
		if (faults[i] == INCISE_STEPPER_FAULT_SETPOINT)
			want(&b, 7, 0);
		else
			incise_pulser_fault(&b.pulser, faults[i]);
		go(&b, 300 * MS, 0);
		over(&b);
		assert_int_equal(b.status.faults, faults[i]);
		assert_in_range(b.status.position, at + 30, at + 50);
	}
}

TEST(a_thread_that_is_late_goes_slower_and_then_stops)
{
	struct bench b;

	/* Always late, but by less than the shortest times: nothing is lost. */
	start(&b, 0);
	assert_int_equal(incise_pulser_enable(&b.pulser), 0);
	for (int i = 0; i < 20; i++) {
		want(&b, INCISE_STEPPER_MODE_POSITION, 500);
		go(&b, 20 * MS, 4000);
	}
	assert_int_equal(b.status.position, 500);
	assert_int_equal(b.status.late, 0);
	assert_int_equal(b.machine.too_short, 0);
	/* By more than that, but for a step that is due while a tick is late: the fault. */
	start(&b, 0);
	assert_int_equal(incise_pulser_enable(&b.pulser), 0);
	want(&b, INCISE_STEPPER_MODE_POSITION, 500);
	go(&b, 90 * MS, 7000);
	assert_int_equal(b.status.faults, INCISE_STEPPER_FAULT_LATE);
	assert_in_range(b.status.late, 20, 60);
	over(&b);
}

/* Times so long that the profile alone would not keep one of them, and a late thread. */
TEST(shortest_times_hold_where_the_profile_would_not_keep_them)
{
	uint64_t random = 88172645463325252ULL, reversals = 0;
	int64_t target = 3000;
	struct bench b;

	start(&b, 0);
	b.config.high_ns = 110000;
	b.config.low_ns = 130000;
	b.config.setup_ns = 700000;
	b.config.hold_ns = 900000;
	b.config.enable_ns = 30 * MS;
	b.config.acceleration = 4000000;
	assert_int_equal(incise_pulser_init(&b.pulser, &b.config), 0);
	assert_int_equal(incise_pulser_enable(&b.pulser), 0);
	for (int i = 0; i < 2000; i++) {
		random ^= random << 13;
		random ^= random >> 7;
		random ^= random << 17;
		/* A few steps to and fro, while it is still under way. */
		target = (int64_t)(b.status.position + (i % 2 ? 1 : -1) * (random >> 60));
		target = target < 0 ? 0 : target;
		want(&b, INCISE_STEPPER_MODE_POSITION, target);
		go(&b, (int64_t)(random % (6 * MS)), (int64_t)(random >> 32) % 90000);
		assert_int_equal(b.status.faults, 0);
		reversals += b.pulser.direction == (i % 2 ? 1 : -1);
	}
	for (int i = 0; i < 40; i++) {
		want(&b, INCISE_STEPPER_MODE_POSITION, target);
		go(&b, 50 * MS, 0);
	}
	assert_int_equal(b.status.position, target);
	assert_int_equal(b.machine.at, target);
	assert_int_equal(b.machine.too_short, 0);
	/* It did turn, and it did step. */
	assert_true(reversals > 500 && b.machine.steps > 2000);
}

/* A stall of 30 ms: the motion goes on where it was, with no burst. */
TEST(a_stall_shifts_the_motion)
{
	struct bench b;
	int64_t at;

	under_way(&b, 0);
	want(&b, INCISE_STEPPER_MODE_POSITION, 15000);
	go(&b, 10 * MS, 0);
	at = b.machine.at;
	b.machine.now_ns += 30 * MS;
	go(&b, 10 * MS, 0);
	/* 10 ms at 4000 steps/s; one was due when it stalled. */
	assert_in_range(b.machine.at - at, 39, 42);
	assert_in_range(b.status.shifted_ns, 29 * MS, 31 * MS);
	assert_int_equal(b.machine.too_short, 0);
	assert_int_equal(b.status.faults, 0);
}

/*
 * A stop of the whole program for 3 s, in motion or at rest, a new target or none behind it:
 * no step follows but those back to the safe position, and those only from rest.
 */
TEST(a_stop_beyond_the_deadman_ends_the_motion)
{
	/* flags, at rest, a target is written before the thread runs again */
	static const struct {
		unsigned int flags;
		bool rests, asked;
	} cases[] = {
		{0, false, true},
		{0, false, false},
		{0, true, true},
		{INCISE_STEPPER_CONFIG_RETRACT, false, true},
		{INCISE_STEPPER_CONFIG_RETRACT, true, true},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		bool rests = cases[i].rests, back = rests && cases[i].flags;
		struct bench b;
		int64_t at;

		start(&b, cases[i].flags);
		assert_int_equal(incise_pulser_origin(&b.pulser, 0, true), 0);
		assert_int_equal(incise_pulser_enable(&b.pulser), 0);
		for (int k = 0; k < 10; k++) {
			want(&b, INCISE_STEPPER_MODE_POSITION, rests ? 300 : 15000);
			go(&b, 40 * MS, 0);
		}
		assert_int_equal(b.status.state, rests ? INCISE_STEPPER_STATE_READY
						       : INCISE_STEPPER_STATE_MOVING);
		at = b.machine.at;
		b.machine.now_ns += 3000 * MS;
		for (int k = 0; k < 20; k++) {
			if (cases[i].asked)
				want(&b, INCISE_STEPPER_MODE_POSITION, 15000);
			go(&b, 40 * MS, 0);
		}
		over(&b);
		assert_int_equal(b.status.faults, INCISE_STEPPER_FAULT_DEADMAN);
		assert_int_equal(b.machine.at, back ? 0 : at);
		/* The rotor stopped at once: in motion it may have lost steps. */
		assert_int_equal(!!(b.status.flags & INCISE_STEPPER_FLAG_HOMED), rests);
	}
}

TEST(a_count_is_named_only_at_rest)
{
	struct bench b;

	under_way(&b, INCISE_STEPPER_CONFIG_INVERT);
	assert_int_equal(incise_pulser_origin(&b.pulser, 5, true), -EBUSY);
	incise_pulser_disable(&b.pulser);
	assert_int_equal(incise_pulser_enable(&b.pulser), -EBUSY);
	go(&b, 200 * MS, 0);
	assert_int_equal(b.status.state, INCISE_STEPPER_STATE_DISABLED);
	assert_int_equal(incise_pulser_origin(&b.pulser, -1, true), -EINVAL);
	assert_int_equal(incise_pulser_origin(&b.pulser, 20001, true), -EINVAL);
	assert_int_equal(incise_pulser_origin(&b.pulser, 20000, true), 0);
	assert_int_equal(b.status.position, 20000);
	assert_true(b.status.flags & INCISE_STEPPER_FLAG_HOMED);
	assert_int_equal(b.machine.too_short, 0);
}
