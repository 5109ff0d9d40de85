// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_home.c: a drive that finds its own 0, or does not.
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

static void it_homes_by_itself(void **state)
{
	static const double home_mm[] = {0, -0.5, 1.5};

	for (size_t i = 0; i < sizeof(home_mm) / sizeof(*home_mm); i++) {
		struct incise_stepper_edge_found edge = {0, 0};
		struct incise_stepper_status s;
		struct incise_error err = {0};

		can_rig_init(&rig);
		rig.actuator.home_mm = home_mm[i];
		can_rig_open_or_fail(&rig);
		assert_false(can_rig_look(&rig).homed);
		can_rig_enable_or_fail(&rig);
		if (incise_stepper_home_edge(rig.stepper, NULL, &edge, &err))
			fail_msg("%s", err.text);
		s = can_rig_look(&rig);
		assert_true(s.homed && s.state == INCISE_STEPPER_READY && !s.faults);
		assert_true(isnan(edge.before_mm) && edge.after_mm == home_mm[i]);
		assert_true(fabs(s.position_mm - fmax(0, home_mm[i])) < 1e-3);
		/* The drive's own 0 is at its switch, that is at home_mm. */
		assert_true(fabs(rig.drive.position / COUNTS_PER_MM -
				 (fmax(0, home_mm[i]) - home_mm[i])) < 1e-3);
		assert_int_equal((int32_t)rig.drive.od[OD_RANGE_MIN].value,
				 (int32_t)lround(COUNTS_PER_MM *
						 (fmin(0, home_mm[i]) - home_mm[i] - 1)));
		can_rig_close(&rig);
		/* Whoever opens it next knows: the drive says so. */
		can_rig_open_or_fail(&rig);
		assert_true(can_rig_look(&rig).homed);
		can_rig_close(&rig);
		/* A reboot takes it away. */
		drive_reboot(&rig.drive);
		can_rig_open_or_fail(&rig);
		assert_false(can_rig_look(&rig).homed);
		can_rig_close(&rig);
	}
}

static void homing_can_fail_and_be_stopped(void **state)
{
	volatile int stop = 0;
	struct incise_error err = {0};

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, &err), -EIO);
	assert_non_null(strstr(err.text, "not powered"));
	can_rig_enable_or_fail(&rig);
	rig.drive.homing_fails = true;
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, &err), -EIO);
	assert_non_null(strstr(err.text, "its homing failed"));
	assert_false(drive_powered(&rig.drive));
	assert_false(can_rig_look(&rig).homed);
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), -EPERM);
	rig.drive.homing_fails = false;
	assert_int_equal(incise_stepper_clear(rig.stepper, &err), 0);
	can_rig_enable_or_fail(&rig);
	/* What failed before is not taken for what fails now, here or in the next program. */
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, &err), 0);
	assert_true(can_rig_look(&rig).homed);
	rig.drive.homing_fails = true;
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, &err), -EIO);
	assert_false(can_rig_look(&rig).homed);
	can_rig_close(&rig);
	rig.drive.homing_fails = false;
	can_rig_open_or_fail(&rig);
	assert_false(can_rig_look(&rig).homed);
	can_rig_enable_or_fail(&rig);
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, &err), 0);
	stop = 1;
	assert_int_equal(incise_stepper_home(rig.stepper, &stop, &err), -EINTR);
	assert_false(drive_powered(&rig.drive));
	assert_int_equal(can_rig_look(&rig).faults, 0);
	can_rig_enable_or_fail(&rig);
	can_rig_close(&rig);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_homes_by_itself),
		cmocka_unit_test(homing_can_fail_and_be_stopped),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
