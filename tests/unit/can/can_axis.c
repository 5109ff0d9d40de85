// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_axis.c, cycle by cycle: frames with any content give the drive no power;
 * each cause of a stop has a text that says what to do. can_stepper.c tests faults as a whole.
 */
#include "../unit.h"
#include "../../../lib/device/can/cia402/can_axis.h"
#include "../../../lib/rig/page.h"
#include "led.h"

#define MS DRIVE_MS

struct bench {
	struct led led;
	struct can_axis axis;
	struct incise_stepper_setpoint setpoint;
	struct incise_stepper_motor_status slot;
};

static void start(struct bench *b)
{
	const struct can_axis_setup setup = {
		.config = {.tick_ns = MS,
			   .velocity = 10000,
			   .acceleration = 200000,
			   .position_max = 100000,
			   .deadman_ns = 100 * MS},
		.step_mm = 0.001,
		.mode = CIA402_CSP,
		.counts_per_step = 1,
		.silence_ns = 150 * MS,
		.following = 500,
		.following_ns = 20 * MS,
		.start_ns = 500 * MS,
		.inputs = true,
		.wired = INCISE_STEPPER_LINE_LIMIT_MIN | INCISE_STEPPER_LINE_LIMIT_MAX |
			 INCISE_STEPPER_LINE_HOME | INCISE_STEPPER_LINE_ESTOP,
	};

	memset(b, 0, sizeof(*b));
	led_init(&b->led);
	assert_int_equal(led_configure(&b->led), 0);
	canopen_await(&b->led.master, NULL, b->led.drive.now_ns + 50 * MS);
	b->axis.motion.setpoint = &b->setpoint;
	b->axis.motion.slot = &b->slot;
	assert_int_equal(can_axis_init(&b->axis, &setup), 0);
	b->axis.master = &b->led.master;
}

/* Run cycles, with set-points unless @target is negative. */
static void cycles(struct bench *b, int n, int64_t target)
{
	for (int i = 0; i < n; i++) {
		if (target >= 0)
			incise_page_put_setpoint(&b->setpoint,
						 INCISE_STEPPER_MODE_POSITION, target,
						 b->led.drive.now_ns);
		can_axis_cycle(&b->axis, b->led.drive.now_ns, 0, 0);
		drive_advance(&b->led.drive, MS);
	}
}

static void power(struct bench *b)
{
	b->led.drive.tripped = false;
	assert_int_equal(can_axis_power(&b->axis, b->led.drive.now_ns, 0), 1);
	for (int i = 0; i < 100 && b->axis.result == 1; i++)
		cycles(b, 1, -1);
	assert_int_equal(b->axis.result, 0);
	assert_int_equal(b->led.drive.state, CIA402_ENABLED);
}

TEST(it_takes_no_target_before_it_heard_where_it_is)
{
	struct bench b;

	start(&b);
	b.led.drive.position = b.led.drive.target = 4321;
	power(&b);
	/* The first targets were its own position. */
	assert_in_range(b.led.drive.least_target, 4320, 4322);
	assert_in_range(b.led.drive.most_target, 4320, 4322);
	assert_int_equal(b.slot.position, 4321);
}

TEST(outside_of_its_travel_it_gets_no_power)
{
	/* A cycle at the largest speed is 10 steps; a count is rounded. */
	static const struct {
		int32_t at;
		int rc;
	} cases[] = {{-11, 1}, {-12, -ERANGE}, {100011, 1}, {100012, -ERANGE}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct bench b;

		start(&b);
		b.led.drive.position = b.led.drive.target = cases[i].at;
		cycles(&b, 3, -1);
		assert_int_equal(can_axis_power(&b.axis, b.led.drive.now_ns, 0),
				 cases[i].rc);
	}
}

/* Disabled while it starts, runs and stops: it ends without power and without a fault. */
TEST(it_can_be_disabled_at_any_time)
{
	for (int n = 0; n < 150; n++) {
		struct bench b;

		start(&b);
		assert_int_equal(can_axis_power(&b.axis, b.led.drive.now_ns, 0), 1);
		cycles(&b, n, 5000);
		can_axis_disable(&b.axis);
		can_axis_disable(&b.axis);
		cycles(&b, 300, 5000);
		assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_DISABLED);
		assert_int_equal(b.slot.faults, 0);
		assert_int_equal(b.axis.phase, CAN_AXIS_IDLE);
		assert_false(cia402_powered(b.led.drive.state));
		assert_true(b.axis.result <= 0);
	}
}

TEST(a_drive_that_does_not_start_is_left)
{
	struct bench b;

	start(&b);
	b.led.drive.enable_ns = 10000 * MS;
	assert_int_equal(can_axis_power(&b.axis, b.led.drive.now_ns, 0), 1);
	cycles(&b, 3000, -1);
	assert_int_equal(b.axis.result, -ETIMEDOUT);
	assert_int_equal(b.axis.cause, CAN_AXIS_NO_START);
	assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_DISABLED);
	assert_false(cia402_powered(b.led.drive.state));
	drive_advance(&b.led.drive, 20000 * MS);
	assert_false(cia402_powered(b.led.drive.state));
}

TEST(a_few_set_points_may_wait_for_the_queue)
{
	struct bench b;

	start(&b);
	power(&b);
	cycles(&b, 50, 20000);
	/* The next frames: a set-point, a SYNC and a heartbeat at times. */
	b.led.drive.send_error = -ENOBUFS;
	b.led.drive.send_errors = 10;
	cycles(&b, 50, 20000);
	assert_int_equal(b.slot.faults, 0);
	b.led.drive.send_error = -ENOBUFS;
	b.led.drive.send_errors = 0;
	cycles(&b, 50, 20000);
	assert_int_equal(b.slot.faults, INCISE_STEPPER_FAULT_BUS);
	assert_int_equal(b.axis.cause, CAN_AXIS_QUEUE_FULL);
}

TEST(what_is_late_is_counted)
{
	struct bench b;

	start(&b);
	power(&b);
	cycles(&b, 10, 100);
	can_axis_cycle(&b.axis, b.led.drive.now_ns, MS / 2, 0);
	assert_int_equal(b.axis.counts.sync_late, 0);
	drive_advance(&b.led.drive, MS);
	can_axis_cycle(&b.axis, b.led.drive.now_ns, MS / 2 + 1, 0);
	assert_int_equal(b.axis.counts.sync_late, 1);
	drive_advance(&b.led.drive, MS);
	can_axis_cycle(&b.axis, b.led.drive.now_ns, 0, 7);
	assert_int_equal(b.axis.counts.sync_late, 8);
	assert_int_equal(b.slot.late, 8);
	/* A cycle too early for the answer to the last SYNC. */
	can_axis_cycle(&b.axis, b.led.drive.now_ns, 0, 0);
	assert_int_equal(b.axis.counts.tpdo_missing, 1);
}

static uint64_t random_state = 88172645463325252ULL;

static uint64_t draw(void)
{
	random_state ^= random_state << 13;
	random_state ^= random_state >> 7;
	random_state ^= random_state << 17;
	return random_state;
}

/* Random data under the ids of this drive, for hours of cycles. */
TEST(whatever_comes_gives_no_power)
{
	static const uint32_t ids[] = {0x080,
				       0x090,
				       0x190,
				       0x290,
				       0x590,
				       0x710,
				       0x77f,
				       0x210,
				       CAN_ERR_FLAG | CAN_ERR_BUSOFF,
				       CAN_EFF_FLAG | 0x190,
				       CAN_RTR_FLAG | 0x190};
	struct bench b;

	start(&b);
	for (int i = 0; i < 20000; i++) {
		struct can_frame frame = {
			.can_id = ids[draw() % (sizeof(ids) / sizeof(*ids))],
			.can_dlc = (uint8_t)(draw() % 9),
		};
		uint64_t data = draw(), enables = b.led.drive.enables;

		memcpy(frame.data, &data, sizeof(data));
		drive_say(&b.led.drive, &frame);
		cycles(&b, 1, (int64_t)(draw() % 200000));
		assert_int_equal(b.led.drive.enables, enables);
		assert_false(b.axis.motion.powered);
	}
	/* With power, they cause a fault sooner or later, which stays. */
	for (int k = 0; k < 200; k++) {
		uint64_t enables;

		start(&b);
		power(&b);
		enables = b.led.drive.enables;
		for (int i = 0; i < 300; i++) {
			struct can_frame frame = {
				.can_id = ids[draw() % (sizeof(ids) / sizeof(*ids))],
				.can_dlc = (uint8_t)(draw() % 9),
			};
			uint64_t data = draw();

			memcpy(frame.data, &data, sizeof(data));
			drive_say(&b.led.drive, &frame);
			cycles(&b, 1, 50000);
		}
		cycles(&b, 3000, 50000);
		assert_true(b.slot.faults);
		assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_FAULT);
		assert_int_equal(b.led.drive.enables, enables);
		assert_int_equal(b.led.drive.velocity, 0);
	}
}

/* No cycle for longer than the deadman, and the drive goes on: while it runs and homes. */
TEST(cycles_that_stop_for_too_long_end_in_a_quick_stop)
{
	for (int homing = 0; homing < 2; homing++) {
		struct bench b;

		start(&b);
		b.led.drive.tripped = false;
		assert_int_equal(can_axis_power(&b.axis, b.led.drive.now_ns,
						homing ? 60000 * MS : 0),
				 1);
		for (int i = 0; i < 100 && b.axis.phase == CAN_AXIS_STARTING; i++)
			cycles(&b, 1, -1);
		assert_int_equal(b.axis.phase,
				 homing ? CAN_AXIS_HOMING : CAN_AXIS_RUNNING);
		/* A cycle behind the deadman is no fault: that is how long the last one lasts. */
		b.led.drive.watching = false;
		drive_advance(&b.led.drive, 100 * MS);
		cycles(&b, 1, 0);
		assert_int_equal(b.slot.faults, 0);
		b.led.drive.watching = false;
		drive_advance(&b.led.drive, 101 * MS);
		assert_true(cia402_powered(b.led.drive.state));
		cycles(&b, 1, 5000);
		assert_int_equal(b.slot.faults, INCISE_STEPPER_FAULT_DEADMAN);
		assert_int_equal(b.axis.cause, CAN_AXIS_STOOD_STILL);
		assert_int_equal(b.axis.phase, CAN_AXIS_QUICK_STOP);
		cycles(&b, 300, 5000);
		assert_int_equal(b.slot.state, INCISE_STEPPER_STATE_FAULT);
		assert_false(cia402_powered(b.led.drive.state));
		assert_int_equal(b.led.drive.enabled_unasked, 0);
	}
}

TEST(a_flood_is_taken_in_parts)
{
	const struct can_frame noise = {.can_id = 0x590, .can_dlc = 8};
	struct bench b;

	start(&b);
	for (int i = 0; i < 200; i++)
		drive_say(&b.led.drive, &noise);
	drive_advance(&b.led.drive, MS);
	can_axis_cycle(&b.axis, b.led.drive.now_ns, 0, 0);
	/* And its answer to the SYNC. */
	assert_int_equal(b.led.drive.queued, 200 - 64 + 1);
}

TEST(each_reason_has_its_own_line)
{
	static const struct {
		enum can_axis_cause why;
		int64_t a, b;
		const char *says;
	} cases[] = {
		{CAN_AXIS_EMCY, 0x8611, 0x21, "(8611h), error register 21h"},
		{CAN_AXIS_DRIVE_FAULT, 0, 0, "without a reported cause"},
		{CAN_AXIS_NOT_ENABLED, CIA402_DISABLED, 0, "switch-on disabled"},
		{CAN_AXIS_NO_HEARTBEAT, 150, 0, "no heartbeat from it for 150 ms"},
		{CAN_AXIS_NO_TPDO, 150, 0, "(TPDO1) from it for 150 ms"},
		{CAN_AXIS_NO_INPUTS, 300, 0, "including the e-stop, from it for 300 ms"},
		{CAN_AXIS_REBOOTED, 0, 0, "it restarted"},
		{CAN_AXIS_NMT, CANOPEN_STOPPED, 0, "stopped"},
		{CAN_AXIS_BUS_OFF, 0, 0, "the bus is off"},
		{CAN_AXIS_QUEUE_FULL, 6, 0, "for 6 cycles"},
		{CAN_AXIS_BUS_FAILED, ENETDOWN, 0, "Network is down"},
		{CAN_AXIS_FOREIGN, 0, 0, "another program"},
		{CAN_AXIS_OFF_TARGET, 200, 0, "by 1.5 mm"},
		{CAN_AXIS_NO_START, CIA402_READY, 0, "remains in ready to switch on"},
		{CAN_AXIS_NO_MODE, 0, 0, "in the mode none (0)"},
		{CAN_AXIS_NO_HOME, 0, 0, "its homing failed"},
		{CAN_AXIS_HOME_TIME, 0, 0, "not done in time"},
		{CAN_AXIS_OUTSIDE, -100, 0, "to -0.750 mm"},
		{CAN_AXIS_STOOD_STILL, 3000, 0, "was stopped for 3000 ms"},
		{CAN_AXIS_HOME_OLD, 0, 0, "off and on"},
		{CAN_AXIS_HOME_SPEED, 400, 0, "moved at 3 mm/s by"},
		{CAN_AXIS_HOME_OPEN, 0, 0, "bit 12 of its statusword set"},
		{CAN_AXIS_NO_STOP, CIA402_ENABLED, 0, "operation enabled: switch"},
	};
	struct can_axis axis = {.setup.step_mm = 0.0075};
	char text[300] = "as it was";

	assert_int_equal(can_axis_cause_text(&axis, text, sizeof(text)), 0);
	assert_string_equal(text, "as it was");
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int length;

		axis.cause = (int)cases[i].why;
		axis.cause_a = cases[i].a;
		axis.cause_b = cases[i].b;
		length = can_axis_cause_text(&axis, text, sizeof(text));
		if (length != (int)strlen(text) || !strstr(text, cases[i].says))
			fail_msg("%d: \"%s\"", cases[i].why, text);
		/* What to do: after a colon or a semicolon. */
		assert_non_null(strpbrk(text, ":;"));
	}
	/* All of them, from the first to the last. */
	assert_int_equal(sizeof(cases) / sizeof(*cases), CAN_AXIS_NO_STOP);
}
