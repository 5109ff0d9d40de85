// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/calib/gravity.c: against the values that are published with the formula.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <incise/calibrate_force.h>

/* Values of the formula as published: 9.7803253359 at the equator, 9.8321849378 at the pole. */
static void gravity_is_that_of_wgs84(void **state)
{
	assert_float_equal(incise_calibrate_gravity(0, 0), 9.7803253359, 1e-10);
	assert_float_equal(incise_calibrate_gravity(90, 0), 9.8321849378, 1e-9);
	assert_float_equal(incise_calibrate_gravity(-90, 0), 9.8321849378, 1e-9);
	/* free air: 0.3086 mGal per metre at the ground, a little less above */
	assert_float_equal(incise_calibrate_gravity(45, 1000) -
				   incise_calibrate_gravity(45, 0),
			   -3.086e-3, 2e-6);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(gravity_is_that_of_wgs84),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
