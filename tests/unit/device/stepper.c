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
#include <string.h>
#include <incise/backend.h>

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

static int fake_jog(struct incise_stepper *stepper, double velocity_mm_s)
{
	((struct fake *)stepper)->position_mm = velocity_mm_s;
	return -ENODEV;
}

static int fake_enable(struct incise_stepper *stepper, struct incise_error *err)
{
	((struct fake *)stepper)->position_mm = 1;
	return incise_error_set(err, EPERM, "clear it");
}

static int fake_disable(struct incise_stepper *stepper, struct incise_error *err)
{
	((struct fake *)stepper)->position_mm = 2;
	return incise_error_set(err, ETIMEDOUT, "it moves");
}

static int fake_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	((struct fake *)stepper)->position_mm = 3;
	return incise_error_set(err, EBUSY, "the e-stop is active");
}

static void fake_info(const struct incise_stepper *stepper,
		      struct incise_stepper_info *info)
{
	info->travel_mm = ((const struct fake *)stepper)->position_mm;
}

static void calls_reach_the_backend(void **state)
{
	static const struct incise_stepper_ops ops = {
		.set = fake_set,
		.jog = fake_jog,
		.status = fake_status,
		.enable = fake_enable,
		.disable = fake_disable,
		.clear = fake_clear,
		.info = fake_info,
	};
	struct fake fake = {.stepper.ops = &ops};
	struct incise_stepper_status status = {0};
	struct incise_stepper_info info = {0};
	struct incise_error err = {0};

	assert_int_equal(incise_stepper_set(&fake.stepper, 1.25), -EDOM);
	assert_true(fake.position_mm == 1.25);
	assert_int_equal(incise_stepper_status(&fake.stepper, &status), -EIO);
	assert_true(status.position_mm == 1.25);
	incise_stepper_info(&fake.stepper, &info);
	assert_true(info.travel_mm == 1.25);
	assert_int_equal(incise_stepper_jog(&fake.stepper, -2.5), -ENODEV);
	assert_true(fake.position_mm == -2.5);
	assert_int_equal(incise_stepper_enable(&fake.stepper, &err), -EPERM);
	assert_string_equal(err.text, "clear it");
	assert_true(fake.position_mm == 1);
	assert_int_equal(incise_stepper_disable(&fake.stepper, &err), -ETIMEDOUT);
	assert_true(fake.position_mm == 2);
	assert_int_equal(incise_stepper_clear(&fake.stepper, &err), -EBUSY);
	assert_true(fake.position_mm == 3);
}

static void named_info(const struct incise_stepper *stepper,
		       struct incise_stepper_info *info)
{
	*info = (struct incise_stepper_info){.name = "a simple one"};
}

static void what_a_backend_has_not_is_said(void **state)
{
	static const struct incise_stepper_ops ops = {.info = named_info};
	struct incise_stepper stepper = {.ops = &ops};
	struct incise_error err;

	assert_int_equal(incise_stepper_jog(&stepper, 1), -EOPNOTSUPP);
	for (int i = 0; i < 4; i++) {
		err = (struct incise_error){0};
		assert_int_equal(i == 0	  ? incise_stepper_enable(&stepper, &err)
				 : i == 1 ? incise_stepper_disable(&stepper, &err)
				 : i == 2 ? incise_stepper_clear(&stepper, &err)
					  : incise_stepper_home(&stepper, NULL, &err),
				 -EOPNOTSUPP);
		assert_int_equal(err.code, EOPNOTSUPP);
		assert_int_equal(strncmp(err.text, "a simple one cannot be ", 23), 0);
	}
}

static void states_and_faults_have_words(void **state)
{
	static const char *const states[] = {"disabled", "ready", "moving",
					     "stopping", "fault", "unknown"};
	const char *seen[INCISE_STEPPER_FAULTS + 1];

	for (int i = 0; i < 6; i++)
		assert_string_equal(incise_stepper_state_name(i), states[i]);
	/* One for each bit, all different; the one beyond is unknown. */
	for (int i = 0; i <= INCISE_STEPPER_FAULTS; i++) {
		seen[i] = incise_stepper_fault_text(1u << i);
		assert_true(!!strstr(seen[i], "unknown") == (i == INCISE_STEPPER_FAULTS));
		for (int j = 0; j < i; j++)
			assert_string_not_equal(seen[i], seen[j]);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(calls_reach_the_backend),
		cmocka_unit_test(what_a_backend_has_not_is_said),
		cmocka_unit_test(states_and_faults_have_words),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
