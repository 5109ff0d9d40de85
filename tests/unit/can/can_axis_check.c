// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_axis_check.c, and when an axis lets the drive's own watch stop it: drives and
 * buses that fail in part, so that one way of noticing is taken away.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include "rig.h"

#define MS DRIVE_MS
#define COUNTS_PER_MM 12800 /* 51200 a turn of 4 mm */

static struct can_rig rig;

static void start(enum incise_actuator_mode mode, double deadman_s)
{
	struct incise_error err = {0};

	can_rig_init(&rig);
	rig.actuator.deadman_s = deadman_s;
	rig.actuator.can.mode = mode;
	rig.actuator.can.stiffness_permille_mm = 50;
	rig.actuator.can.damping_permille_s_mm = 5;
	rig.actuator.can.torque_max_permille = 300;
	rig.drive.torque_counts_s2 = 0.1 * 1000 * COUNTS_PER_MM / 10;
	if (!can_rig_open(&rig, &err) || incise_stepper_enable(rig.stepper, &err))
		fail_msg("%s", err.text);
	rig.drive.tripped = false;
}

static double at_mm(void)
{
	return rig.drive.position / COUNTS_PER_MM;
}

/* Stopped for good, for the reason that is given. */
static void stopped(unsigned int fault, const char *says)
{
	struct incise_stepper_status s;
	char cause[300];

	can_rig_hold(&rig, 10, 3000 * MS);
	s = can_rig_look(&rig);
	incise_stepper_cause(rig.stepper, cause, sizeof(cause));
	if (s.state != INCISE_STEPPER_FAULT || !(s.faults & fault) ||
	    !strstr(cause, says))
		fail_msg("%s, faults %#x, \"%s\"", incise_stepper_state_name(s.state),
			 s.faults, cause);
	assert_false(drive_powered(&rig.drive));
	assert_int_equal(rig.drive.velocity, 0);
	assert_int_equal(rig.drive.enabled_unasked, 0);
}

/* A loop that is closed here is not closed over silence, however long the deadman is. */
static void silence_of_the_drive_moves_nothing(void **state)
{
	for (int mode = INCISE_ACTUATOR_CSP; mode <= INCISE_ACTUATOR_CST; mode++)
		for (int k = 0; k < 2; k++) {
			start((enum incise_actuator_mode)mode, k ? 1.0 : 0.1);
			can_rig_hold(&rig, 4, 300 * MS);
			rig.drive.no_tpdo = true;
			can_rig_hold(&rig, 4, 3000 * MS);
			/* On its way it goes there at most; a torque's swing is let run out. */
			assert_true(at_mm() < (mode == INCISE_ACTUATOR_CST ? 5 : 4.01));
			assert_true(at_mm() > 0);
			rig.drive.no_tpdo = mode == INCISE_ACTUATOR_CSP;
			stopped(INCISE_STEPPER_LOST, "no status (TPDO1)");
			can_rig_close(&rig);
		}
}

/* It hears no set-points, but beats, and tells where it is. */
static void a_drive_that_does_not_obey_is_left_to_its_own_watch(void **state)
{
	for (int mode = INCISE_ACTUATOR_CSP; mode <= INCISE_ACTUATOR_CSV; mode++) {
		double from_mm;

		start((enum incise_actuator_mode)mode, 0.1);
		can_rig_hold(&rig, 10, 300 * MS);
		from_mm = at_mm();
		rig.drive.od[OD_RPDO1_COB].value |= 0x80000000u;
		can_rig_hold(&rig, from_mm, 1000 * MS);
		assert_int_equal(rig.drive.velocity, 0);
		/*
		 * In csv it goes on at 10 mm/s until it is off by following_mm for following_ms,
		 * has not obeyed for 20 ms, and its own watch of 100 ms and a beat is over; the
		 * targets go on for v²/2a as well, and its ramp takes as much.
		 */
		assert_true(at_mm() - from_mm <
			    1 + 10 * (0.05 + 0.02 + 0.125) + 2 * 0.1 + 0.1);
		stopped(INCISE_STEPPER_FOLLOWING | INCISE_STEPPER_LOST |
				INCISE_STEPPER_ALARM,
			"drive 0x10 at can-test: ");
		can_rig_close(&rig);
	}
}

static int (*all_sent)(struct can_bus *bus, const struct can_frame *frame);

static int no_sync(struct can_bus *bus, const struct can_frame *frame)
{
	return frame->can_id == CANOPEN_SYNC ? -ENOBUFS : all_sent(bus, frame);
}

/* A queue that empties by a frame a cycle: set-points find room, SYNCs do not. */
static void a_set_point_without_its_sync_is_none(void **state)
{
	static struct can_bus_ops ops;
	const struct can_bus_ops *before;
	double from_mm;

	start(INCISE_ACTUATOR_CSV, 0.1);
	can_rig_hold(&rig, 10, 300 * MS);
	before = rig.drive.bus.ops;
	ops = *before;
	all_sent = ops.send;
	ops.send = no_sync;
	rig.drive.bus.ops = &ops;
	from_mm = at_mm();
	can_rig_hold(&rig, 5, 1000 * MS);
	/* Its own watch, and a beat that was on its way. */
	assert_true(at_mm() - from_mm < 10 * 0.125 + 0.3);
	rig.drive.bus.ops = before;
	stopped(INCISE_STEPPER_BUS, "queue is full");
	can_rig_close(&rig);
}

/* What is to say that the e-stop was pressed does not come any more. */
static void inputs_that_fall_silent_are_a_fault(void **state)
{
	start(INCISE_ACTUATOR_CSP, 0.1);
	can_rig_hold(&rig, 10, 300 * MS);
	assert_int_equal(can_rig_look(&rig).faults, 0);
	rig.drive.od[OD_TPDO2_COB].value |= 0x80000000u;
	can_rig_hold(&rig, 10, 400 * MS);
	stopped(INCISE_STEPPER_LOST, "its inputs (TPDO2) were not heard");
	can_rig_close(&rig);
	/* Of a drive that does not send them again by itself nothing is known of that. */
	can_rig_init(&rig);
	rig.drive.od[OD_TPDO2_TIMER].size = 0;
	assert_non_null(can_rig_open(&rig, NULL));
	assert_int_equal(incise_stepper_enable(rig.stepper, NULL), 0);
	can_rig_hold(&rig, 10, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).faults, 0);
	can_rig_close(&rig);
}

/* Somebody else gives it power while nothing is driven here. */
static void power_that_nobody_gave_is_a_fault(void **state)
{
	struct incise_error err = {0};

	start(INCISE_ACTUATOR_CSP, 0.1);
	assert_int_equal(incise_stepper_disable(rig.stepper, NULL), 0);
	drive_enter(&rig.drive, CIA402_ENABLED);
	can_rig_advance(&rig, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).state, INCISE_STEPPER_FAULT);
	/* And its watch ends that. */
	assert_false(drive_powered(&rig.drive));
	if (incise_stepper_clear(rig.stepper, &err))
		fail_msg("%s", err.text);
	rig.drive.tripped = false;
	if (incise_stepper_enable(rig.stepper, &err))
		fail_msg("%s", err.text);
	can_rig_close(&rig);
}

/* The shortest deadman that is taken: its watch must not end while nothing moves. */
static void the_shortest_deadman_holds_at_rest(void **state)
{
	struct incise_error err = {0};

	can_rig_init(&rig);
	rig.actuator.deadman_s = 0.02;
	assert_non_null(can_rig_open(&rig, &err));
	for (int i = 0; i < 3; i++) {
		can_rig_advance(&rig, 2000 * MS);
		rig.drive.tripped = false;
		if (incise_stepper_enable(rig.stepper, &err))
			fail_msg("%s", err.text);
		assert_int_equal(incise_stepper_disable(rig.stepper, NULL), 0);
	}
	assert_int_equal(rig.drive.quick_stops, 0);
	can_rig_close(&rig);
}

/* As its brake opens. */
static void one_that_gives_way_gets_no_jump(void **state)
{
	static const double way_mm[] = {-0.3, -2, 0.005};

	for (size_t i = 0; i < sizeof(way_mm) / sizeof(*way_mm); i++) {
		struct incise_error err = {0};
		struct can_stepper *c;

		can_rig_init(&rig);
		rig.drive.enable_ns = 50 * MS;
		assert_non_null(can_rig_open(&rig, &err));
		c = (struct can_stepper *)rig.stepper;
		assert_int_equal(can_thread_borrow(&c->thread, &err), 0);
		assert_int_equal(can_link_ready(&c->link, false, &err), 0);
		assert_int_equal(can_axis_power(&c->link.axis, rig.drive.now_ns, 0), 1);
		can_thread_give_back(&c->thread);
		can_rig_advance(&rig, 30 * MS);
		rig.drive.position += way_mm[i] * COUNTS_PER_MM;
		rig.drive.demand = rig.drive.position;
		can_rig_advance(&rig, 2000 * MS);
		assert_int_equal(c->link.axis.result, way_mm[i] < 0 ? -ERANGE : 0);
		/* A cycle at 10 mm/s, and rounding: no target is farther from where it is. */
		assert_true(rig.drive.fastest <= 10 * COUNTS_PER_MM + 2000);
		assert_false(drive_powered(&rig.drive));
		can_rig_close(&rig);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(silence_of_the_drive_moves_nothing),
		cmocka_unit_test(a_drive_that_does_not_obey_is_left_to_its_own_watch),
		cmocka_unit_test(a_set_point_without_its_sync_is_none),
		cmocka_unit_test(inputs_that_fall_silent_are_a_fault),
		cmocka_unit_test(power_that_nobody_gave_is_a_fault),
		cmocka_unit_test(the_shortest_deadman_holds_at_rest),
		cmocka_unit_test(one_that_gives_way_gets_no_jump),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
