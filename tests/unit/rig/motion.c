// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/motion.c, on no lines and no bus: what it says to who owns it. What comes of
 * that on lines is in pulser.c, on a bus in tests/unit/can/can_axis.c.
 */
#include "../unit.h"
#include "../../../lib/rig/motion.h"
#include "../../../lib/rig/page.h"

#define MS 1000000LL
#define TICK MS

struct bench {
	struct incise_stepper_setpoint setpoint;
	struct incise_stepper_motor_status slot;
	struct incise_motion motion;
	int64_t now_ns;
};

static void start(struct bench *b, unsigned int flags)
{
	const struct incise_stepper_config config = {
		.flags = flags,
		.tick_ns = TICK,
		.velocity = 1000,
		.acceleration = 20000,
		.position_max = 5000,
		.safe_position = 10,
		.deadman_ns = 50 * MS,
	};

	*b = (struct bench){.now_ns = 1000 * MS};
	b->motion.setpoint = &b->setpoint;
	b->motion.slot = &b->slot;
	assert_int_equal(incise_motion_init(&b->motion, &config), 0);
}

/* As an owner does. Returns whether it had to take power away at once. */
static bool go(struct bench *b, int64_t ms)
{
	struct incise_profile_slot slot;

	for (int64_t i = 0; i < ms && b->motion.powered; i++) {
		uint32_t fault;

		b->now_ns += TICK;
		fault = incise_motion_listen(&b->motion, b->now_ns);
		if (incise_motion_fault(&b->motion, fault))
			return true;
		incise_profile_tick(&b->motion.profile, &slot);
		b->motion.status.position = incise_profile_position(&b->motion.profile);
		incise_motion_ticked(&b->motion);
		if (b->motion.ending && b->motion.resting)
			incise_motion_power_off(&b->motion);
		incise_motion_publish(&b->motion, b->now_ns);
	}
	return false;
}

static void want(struct bench *b, unsigned int mode, int64_t target)
{
	incise_page_put_setpoint(&b->setpoint, mode, target, b->now_ns);
}

TEST(without_targets_it_ends)
{
	/* Where it then goes: on by v²/2a = 25 steps and a tick's at most, or back. */
	static const struct {
		unsigned int flags;
		bool homed;
		int least, most;
	} cases[] = {
		{0, true, 40, 140},
		{INCISE_STEPPER_CONFIG_RETRACT, false, 40, 140},
		{INCISE_STEPPER_CONFIG_RETRACT, true, 10, 10},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct bench b;

		start(&b, cases[i].flags);
		assert_int_equal(incise_motion_origin(&b.motion, 0, cases[i].homed), 0);
		assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 1);
		assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 0);
		want(&b, INCISE_STEPPER_MODE_POSITION, 4000);
		go(&b, 50);
		assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_MOVING);
		go(&b, 10);
		assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_STOPPING);
		assert_int_equal(b.slot.faults, INCISE_STEPPER_FAULT_DEADMAN);
		/* What comes now is not obeyed. */
		want(&b, INCISE_STEPPER_MODE_POSITION, 4000);
		assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), -EPERM);
		assert_int_equal(incise_motion_clear(&b.motion), -EBUSY);
		go(&b, 1000);
		assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_FAULT);
		assert_in_range(b.slot.position, cases[i].least, cases[i].most);
		assert_int_equal(!!(b.slot.flags & INCISE_STEPPER_FLAG_HOMED),
				 cases[i].homed);
		assert_int_equal(incise_motion_clear(&b.motion), 0);
		assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 1);
		/* Nothing old is obeyed. */
		go(&b, 20);
		assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_READY);
	}
}

/* Its owner stood still, with or without a set-point behind it. */
TEST(an_owner_that_stood_still_is_noticed)
{
	struct bench b;

	start(&b, 0);
	b.now_ns += 3000 * MS;
	/* Without power it need not run. */
	assert_int_equal(incise_motion_awake(&b.motion, b.now_ns), 0);
	b.now_ns += 3000 * MS;
	assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 1);
	b.now_ns += 50 * MS + TICK;
	assert_int_equal(incise_motion_awake(&b.motion, b.now_ns), 0);
	b.now_ns += 50 * MS + TICK + 1;
	want(&b, INCISE_STEPPER_MODE_POSITION, 4000);
	assert_int_equal(incise_motion_awake(&b.motion, b.now_ns),
			 INCISE_STEPPER_FAULT_DEADMAN);
	assert_int_equal(incise_motion_awake(&b.motion, b.now_ns), 0);
}

TEST(a_fault_ends_it_at_once_or_within_its_limits)
{
	for (unsigned int bit = 0; bit < 19; bit++) {
		uint32_t fault = 1u << bit;
		bool at_once = INCISE_MOTION_AT_ONCE & fault;
		struct bench b;

		start(&b, 0);
		/* Without power there is nothing to latch. */
		assert_false(incise_motion_fault(&b.motion, fault));
		assert_int_equal(b.motion.status.faults, 0);
		assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 1);
		assert_false(incise_motion_fault(&b.motion, 0));
		assert_false(b.motion.ending);
		assert_int_equal(incise_motion_fault(&b.motion, fault), at_once);
		assert_int_equal(b.motion.ending, !at_once);
		assert_int_equal(b.motion.status.faults, fault);
	}
}

TEST(what_forbids_power_is_told)
{
	struct bench b;

	start(&b, 0);
	b.motion.status.inputs = INCISE_STEPPER_LINE_ESTOP;
	assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), -EBUSY);
	b.motion.status.inputs = INCISE_STEPPER_LINE_LIMIT_MIN;
	assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 1);
	incise_motion_brake(&b.motion, 0);
	assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), -EBUSY);
	assert_int_equal(incise_motion_origin(&b.motion, 5, true), -EBUSY);
	incise_motion_power_off(&b.motion);
	assert_int_equal(incise_motion_origin(&b.motion, 5001, true), -EINVAL);
	assert_int_equal(incise_motion_origin(&b.motion, 5000, true), 0);
	assert_int_equal(b.motion.status.state, INCISE_STEPPER_STATE_DISABLED);
	b.motion.status.faults = INCISE_STEPPER_FAULT_ESTOP;
	b.motion.status.inputs = INCISE_STEPPER_LINE_ESTOP;
	assert_int_equal(incise_motion_clear(&b.motion), -EBUSY);
	b.motion.status.inputs = 0;
	assert_int_equal(incise_motion_clear(&b.motion), 0);
}

TEST(a_set_point_that_nobody_should_write_is_a_fault)
{
	struct bench b;

	start(&b, 0);
	assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 1);
	want(&b, 7, 0);
	go(&b, 1);
	assert_int_equal(b.slot.faults, INCISE_STEPPER_FAULT_SETPOINT);
	/* One beyond the limits is held, and said. */
	start(&b, 0);
	assert_int_equal(incise_motion_power_on(&b.motion, b.now_ns), 1);
	want(&b, INCISE_STEPPER_MODE_POSITION, 100000);
	go(&b, 1);
	assert_int_equal(b.slot.target, 5000);
	assert_true(b.slot.flags & INCISE_STEPPER_FLAG_HELD);
}
