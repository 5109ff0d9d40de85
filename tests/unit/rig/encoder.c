// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/encoder.c on a count in a folder that stands for sysfs, and a motor whose status the test
 * writes.
 */
#include "../unit.h"
#include <sys/stat.h>
#include "../../../lib/rig/encoder.h"
#include "../../../lib/rig/page.h"

static char folder[40];
static struct incise_stepper_motor_status slot;
static struct incise_stepper_motor_status status;
static struct incise_motor motor;
static int disabled;

static void put(const char *name, const char *text)
{
	char path[100];
	FILE *file;

	snprintf(path, sizeof(path), "%s/counter0/count0/%s", folder, name);
	file = fopen(path, "w");
	assert_non_null(file);
	fputs(text, file);
	assert_int_equal(fclose(file), 0);
}

static void drop(const char *name)
{
	char path[100];

	snprintf(path, sizeof(path), "%s/counter0/count0/%s", folder, name);
	unlink(path);
}

static int make_folder(void **state)
{
	char path[60];

	(void)state;
	snprintf(folder, sizeof(folder), "/tmp/incise-test-XXXXXX");
	if (!mkdtemp(folder))
		return -1;
	snprintf(path, sizeof(path), "%s/counter0", folder);
	mkdir(path, 0755);
	snprintf(path, sizeof(path), "%s/counter0/count0", folder);
	return mkdir(path, 0755);
}

static int remove_folder(void **state)
{
	char path[60];

	(void)state;
	drop("count");
	drop("ceiling");
	snprintf(path, sizeof(path), "%s/counter0/count0", folder);
	rmdir(path);
	snprintf(path, sizeof(path), "%s/counter0", folder);
	rmdir(path);
	return rmdir(folder);
}

GROUP(make_folder, remove_folder);

static int fake_disable(struct incise_motor *of)
{
	(void)of;
	disabled++;
	return 0;
}

static int fake_origin(struct incise_motor *of, int32_t steps, bool homed)
{
	(void)of;
	(void)steps;
	status.flags = homed;
	incise_page_put_status(&slot, &status);
	return 0;
}

static int fake_clear(struct incise_motor *of, struct incise_error *error)
{
	(void)of;
	(void)error;
	return 0;
}

static const struct incise_motor_ops ops = {
	.disable = fake_disable,
	.clear = fake_clear,
	.origin = fake_origin,
};

/* 400 steps and -1000 counts per mm; 2 steps of velocity in a tick. */
static struct incise_driver *open_encoder(const char *count)
{
	struct incise_driver *encoder;

	disabled = 0;
	motor = (struct incise_motor){
		.ops = &ops,
		.name = "bench",
		.slot = &slot,
		.actuator = {.travel_mm = 20,
			     .lead_mm = 4,
			     .steps_per_turn = 200,
			     .microsteps = 8,
			     .velocity_mm_s = 20,
			     .acceleration_mm_s2 = 500,
			     .tick_ns = 250000,
			     .deadman_s = 0.1,
			     .lost_steps_max = 80,
			     .encoder = "counter0/count0",
			     .encoder_counts_per_mm = -1000},
	};
	incise_motor_init(&motor);
	put("count", count);
	encoder = incise_encoder_open(&motor, folder, "rig.conf:3", &err);
	assert_non_null(encoder);
	assert_int_equal(motor.stepper.ops->attach(&motor.stepper, encoder), 0);
	return encoder;
}

/* The motor stands there, and so does the encoder. */
static unsigned int look(struct incise_driver *encoder, long long steps, bool homed,
			 enum incise_stepper_state state, const char *count)
{
	struct incise_stepper_status read;

	status.steps_up = 5000000000ULL + (unsigned long long)steps;
	status.steps_down = 5000000000ULL;
	status.flags = homed ? INCISE_STEPPER_FLAG_HOMED : 0;
	status.state = state;
	incise_page_put_status(&slot, &status);
	put("count", count);
	incise_encoder_look(encoder);
	assert_int_equal(incise_stepper_status(&motor.stepper, &read), 0);
	return read.faults;
}

#define OFF INCISE_STEPPER_STATE_DISABLED
#define READY INCISE_STEPPER_STATE_READY

TEST(a_difference_stops_the_motor_with_its_number)
{
	struct incise_driver *encoder = open_encoder("7");
	struct incise_stepper_status read;
	struct incise_stepper_counter counter;
	char text[240];

	assert_int_equal(incise_stepper_counter(&motor.stepper, 0, &counter), -ENOENT);
	/* Without power a hand may turn it, unless its place is known. */
	assert_int_equal(look(encoder, 0, false, OFF, "7"), 0);
	assert_int_equal(look(encoder, 0, false, OFF, "9000"), 0);
	assert_int_equal(look(encoder, 0, false, READY, "9000"), 0);
	/* 4000 steps are 10 mm and 10000 counts downwards, through 0 as 64 bits have it. */
	assert_int_equal(look(encoder, 4000, false, READY, "18446744073709550616"), 0);
	assert_int_equal(look(encoder, 4000, true, READY, "18446744073709550616"), 0);
	assert_int_equal(look(encoder, 0, true, READY, "9000"), 0);
	/* 82 of 82 steps, and 83. */
	assert_int_equal(look(encoder, 0, true, READY, "8795"), 0);
	assert_int_equal(look(encoder, 400, true, READY, "8208"),
			 INCISE_STEPPER_FAULT_STEPS);
	assert_true(incise_stepper_cause(&motor.stepper, text, sizeof(text)) > 0);
	assert_non_null(strstr(text, "encoder: 83 steps are missing: "));
	assert_int_equal(incise_stepper_set(&motor.stepper, 1), -EIO);
	incise_stepper_status(&motor.stepper, &read);
	assert_false(read.homed);
	/* It stays, and takes the home away where the motor is cleared. */
	assert_int_equal(look(encoder, 400, true, OFF, "8000"),
			 INCISE_STEPPER_FAULT_STEPS);
	assert_int_equal(incise_stepper_clear(&motor.stepper, &err), 0);
	assert_int_equal(status.flags, 0);
	assert_int_equal(look(encoder, 400, false, READY, "5"), 0);
	assert_int_equal(look(encoder, 400, true, OFF, "5"), 0);
	assert_int_equal(look(encoder, 400, true, OFF, "500"),
			 INCISE_STEPPER_FAULT_STEPS);
	encoder->ops->close(encoder);
	assert_null(motor.driver);
	assert_int_equal(disabled, 1);
	/* No program finds it homed. */
	assert_int_equal(status.flags, 0);
}

TEST(a_count_begins_again_behind_its_ceiling)
{
	struct incise_driver *encoder;

	put("ceiling", "65535\n");
	encoder = open_encoder("100");
	assert_int_equal(look(encoder, 0, true, READY, "100"), 0);
	assert_int_equal(look(encoder, 400, true, READY, "64636"), 0);
	assert_int_equal(look(encoder, 0, true, READY, "100"), 0);
	assert_int_equal(look(encoder, 0, true, READY, "64636"),
			 INCISE_STEPPER_FAULT_STEPS);
	encoder->ops->close(encoder);
	drop("ceiling");
}

/* A stall that homes the motor loses steps. */
TEST(homing_by_a_stall_is_not_compared)
{
	struct incise_driver *encoder = open_encoder("0");

	motor.actuator.tmc.stall_home = true;
	assert_int_equal(look(encoder, 0, false, READY, "0"), 0);
	assert_int_equal(look(encoder, 1000, false, READY, "0"), 0);
	assert_int_equal(look(encoder, 1000, true, READY, "0"), 0);
	assert_int_equal(look(encoder, 1100, true, READY, "0"),
			 INCISE_STEPPER_FAULT_STEPS);
	encoder->ops->close(encoder);
}

TEST(a_count_that_cannot_be_read_is_a_fault)
{
	struct incise_driver *encoder = open_encoder("0");
	struct incise_stepper_status read;
	char text[240];

	assert_int_equal(look(encoder, 0, true, READY, "?"), INCISE_STEPPER_FAULT_LINE);
	incise_stepper_cause(&motor.stepper, text, sizeof(text));
	assert_non_null(strstr(text, "cannot be read: Protocol error"));
	assert_int_equal(look(encoder, 0, true, OFF, "0"), INCISE_STEPPER_FAULT_LINE);
	assert_int_equal(incise_stepper_clear(&motor.stepper, &err), 0);
	drop("count");
	incise_encoder_look(encoder);
	assert_int_equal(incise_stepper_status(&motor.stepper, &read), 0);
	assert_int_equal(read.faults, INCISE_STEPPER_FAULT_LINE);
	encoder->ops->close(encoder);
	assert_error(incise_encoder_open(&motor, folder, "rig.conf:3", &err), ENOENT,
		     &err, "counter0/count0: No such file");
}

/* The thread finds it too, sooner or later. */
TEST(the_thread_looks)
{
	struct incise_driver *encoder = open_encoder("0");

	assert_int_equal(look(encoder, 0, true, READY, "0"), 0);
	put("count", "1000");
	assert_int_equal(incise_encoder_start(encoder), 0);
	while (!encoder->ops->faults(encoder))
		usleep(1000);
	encoder->ops->close(encoder);
}
