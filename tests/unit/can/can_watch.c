// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_watch.c: looking at a drive without driving it.
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

static void a_watcher_looks_and_writes_nothing(void **state)
{
	struct incise_stepper_status s;
	struct incise_error err = {0};
	uint64_t enables;

	can_rig_init(&rig);
	rig.drive.absolute = true;
	drive_reboot(&rig.drive);
	rig.drive.position = 3 * COUNTS_PER_MM;
	rig.actuator.can.absolute = true;
	rig.watch = true;
	can_rig_open_or_fail(&rig);
	enables = rig.drive.enables;
	can_rig_advance(&rig, 100 * MS);
	s = can_rig_look(&rig);
	assert_int_equal(s.state, INCISE_STEPPER_DISABLED);
	assert_true(s.homed && fabs(s.position_mm - 3) < 1e-3);
	assert_int_equal(incise_stepper_set(rig.stepper, 1), -EPERM);
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), -EPERM);
	/* Switches that are pressed by hand. */
	rig.drive.inputs = CIA402_AT_MAX | CIA402_AT_HOME;
	can_rig_advance(&rig, 100 * MS);
	s = can_rig_look(&rig);
	assert_int_equal(s.inputs, INCISE_STEPPER_AT_MAX | INCISE_STEPPER_AT_HOME);
	drive_fault(&rig.drive, 0x4310);
	can_rig_advance(&rig, 100 * MS);
	s = can_rig_look(&rig);
	assert_int_equal(s.state, INCISE_STEPPER_FAULT);
	assert_int_equal(s.faults, INCISE_STEPPER_ALARM);
	rig.drive.mute = true;
	can_rig_advance(&rig, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).faults, INCISE_STEPPER_LOST);
	assert_int_equal(rig.drive.enables, enables);
	assert_int_equal(rig.drive.master_beats, 0);
	can_rig_close(&rig);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_watcher_looks_and_writes_nothing),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
