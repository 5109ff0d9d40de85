// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * lib/device/stepper.c: every call reaches the backend with its arguments, and what the
 * backend says comes back.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include "../../../lib/device/backend.h"

/* A backend that remembers what it was called with. */
struct fake {
	struct incise_stepper stepper;
	double position_mm;
};

static int fake_set(struct incise_stepper *stepper, double position_mm)
{
	((struct fake *)stepper)->position_mm = position_mm;
	return -EDOM;
}

static int fake_status(struct incise_stepper *stepper,
		       struct incise_stepper_status *status)
{
	status->position_mm = ((struct fake *)stepper)->position_mm;
	return -EIO;
}

static void fake_info(const struct incise_stepper *stepper,
		      struct incise_stepper_info *info)
{
	info->travel_mm = ((const struct fake *)stepper)->position_mm;
}

static void calls_reach_the_backend(void **state)
{
	static const struct incise_stepper_ops ops = {
		.set = fake_set, .status = fake_status, .info = fake_info};
	struct fake fake = {.stepper.ops = &ops};
	struct incise_stepper_status status = {0};
	struct incise_stepper_info info = {0};

	assert_int_equal(incise_stepper_set(&fake.stepper, 1.25), -EDOM);
	assert_true(fake.position_mm == 1.25);
	assert_int_equal(incise_stepper_status(&fake.stepper, &status), -EIO);
	assert_true(status.position_mm == 1.25);
	incise_stepper_info(&fake.stepper, &info);
	assert_true(info.travel_mm == 1.25);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(calls_reach_the_backend),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
