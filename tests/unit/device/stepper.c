// SPDX-License-Identifier: GPL-2.0-or-later
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
#include <stdio.h>
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

/* One that may tell more of its fault than that there is one, and counts two things. */
struct teller {
	struct incise_stepper stepper;
	unsigned int faults;
	const char *cause;
};

static int teller_status(struct incise_stepper *stepper,
			 struct incise_stepper_status *status)
{
	*status = (struct incise_stepper_status){
		.faults = ((struct teller *)stepper)->faults};
	return 0;
}

static int teller_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	const char *cause = ((struct teller *)stepper)->cause;

	return cause ? snprintf(text, size, "%s", cause) : 0;
}

static int teller_counter(struct incise_stepper *stepper, int i,
			  struct incise_stepper_counter *counter)
{
	static const struct incise_stepper_counter counters[] = {
		{"sync_late", "SYNCs sent late", 3, true},
		{"setpoints", "set-points sent", 0, false}};

	if (i > 1)
		return -ENOENT;
	*counter = counters[i];
	return 0;
}

static void the_cause_is_the_device_s_own_or_the_first_fault(void **state)
{
	static const struct incise_stepper_ops ops[] = {
		{.status = teller_status},
		{.status = teller_status, .cause = teller_cause},
	};
	static const struct {
		unsigned int faults;
		const char *cause, *says; /* says: the beginning, without a cause */
	} cases[] = {
		{0, NULL, ""},
		{INCISE_STEPPER_BUS | INCISE_STEPPER_LOST, NULL, "the bus to the drive"},
		/* What stopped nothing is said only where there is nothing else. */
		{INCISE_STEPPER_TRAVEL, NULL, "travel: "},
		{INCISE_STEPPER_TRAVEL | INCISE_STEPPER_ALARM, NULL, "alarm of"},
		{INCISE_STEPPER_ALARM, "short circuit (2320h)", "alarm of"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		for (size_t k = 0; k < 2; k++) {
			const char *own = k ? cases[i].cause : NULL;
			const char *says = own ? own : cases[i].says;
			struct teller teller = {{&ops[k]}, cases[i].faults, own};
			char text[200] = "untouched", little[8];
			int length = incise_stepper_cause(&teller.stepper, text, 200);

			assert_int_equal(length, strlen(text));
			assert_true(!*text == !*says);
			assert_memory_equal(text, says, strlen(says));
			/* Cut to what there is room for, as snprintf(3) does. */
			assert_int_equal(incise_stepper_cause(&teller.stepper, little,
							      sizeof(little)),
					 length);
			assert_int_equal(strncmp(little, text, sizeof(little) - 1), 0);
			assert_true(strlen(little) < sizeof(little));
		}
}

static void counters_are_the_backend_s(void **state)
{
	static const struct incise_stepper_ops ops = {.counter = teller_counter}, none;
	struct teller teller = {.stepper.ops = &ops};
	struct incise_stepper stepper = {.ops = &none};
	struct incise_stepper_counter counter = {0};

	assert_int_equal(incise_stepper_counter(&teller.stepper, 0, &counter), 0);
	assert_string_equal(counter.key, "sync_late");
	assert_true(counter.value == 3 && counter.trouble);
	assert_int_equal(incise_stepper_counter(&teller.stepper, 1, &counter), 0);
	assert_string_equal(counter.key, "setpoints");
	assert_int_equal(incise_stepper_counter(&teller.stepper, 2, &counter), -ENOENT);
	assert_int_equal(incise_stepper_counter(&teller.stepper, -1, &counter), -ENOENT);
	assert_int_equal(incise_stepper_counter(&stepper, 0, &counter), -ENOENT);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(calls_reach_the_backend),
		cmocka_unit_test(what_a_backend_has_not_is_said),
		cmocka_unit_test(states_and_faults_have_words),
		cmocka_unit_test(the_cause_is_the_device_s_own_or_the_first_fault),
		cmocka_unit_test(counters_are_the_backend_s),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
