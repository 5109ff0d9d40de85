// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_stepper.c with a real thread and the computer's clock, which the
 * simulated drive follows. Times are not checked.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <time.h>
#include "rig.h"

static struct can_rig rig;
static struct can_bus_ops ops; /* the drive's, on the computer's clock */
static int64_t offset_ns;

/*
 * Advances the drive to the present. One thread at a time has the bus: that is the test.
 */
static int64_t real_now(struct can_bus *bus)
{
	struct drive *drive = (struct drive *)bus;
	struct timespec t;
	int64_t now;

	clock_gettime(CLOCK_MONOTONIC, &t);
	now = t.tv_sec * 1000000000LL + t.tv_nsec;
	if (!offset_ns)
		offset_ns = now - drive->now_ns;
	return now - offset_ns;
}

static void catch_up(struct can_bus *bus)
{
	struct drive *drive = (struct drive *)bus;
	int64_t now = real_now(bus);

	if (now > drive->now_ns)
		drive_advance(drive, now - drive->now_ns);
}

static int real_receive(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns)
{
	catch_up(bus);
	return drive_receive(bus, frame, t_ns);
}

static int real_send(struct can_bus *bus, const struct can_frame *frame)
{
	catch_up(bus);
	return drive_send(bus, frame);
}

static int real_wait(struct can_bus *bus, int64_t until_ns)
{
	while (real_now(bus) < until_ns && !((struct drive *)bus)->queued) {
		nanosleep(&(struct timespec){.tv_nsec = 200000}, NULL);
		catch_up(bus);
	}
	return 0;
}

static const struct can_transport real_time = {"can", can_rig_transport, NULL};

static struct incise_stepper *open_real(struct incise_error *err)
{
	struct incise_backend_request request = {
		.arguments = rig.arguments,
		.where = "rig.conf:3: stepper",
		.watch = rig.watch,
		.actuator = &rig.actuator,
	};

	ops = *rig.drive.bus.ops;
	ops.now = real_now;
	ops.receive = real_receive;
	ops.send = real_send;
	ops.wait = real_wait;
	rig.drive.bus.ops = &ops;
	offset_ns = 0;
	return rig.stepper = can_stepper_open(&real_time, &request, err);
}

static void nap(void)
{
	nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
}

static void it_runs_and_lends_the_bus(void **state)
{
	struct incise_stepper_status s = {0};
	struct incise_error err = {0};

	can_rig_init(&rig);
	/* Longer than any stall of a machine. */
	rig.actuator.deadman_s = 10;
	if (!open_real(&err))
		fail_msg("%s", err.text);
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), 0);
	for (int i = 0; i < 5000 && fabs(s.position_mm - 0.5) > 1e-3; i++) {
		assert_int_equal(incise_stepper_set(rig.stepper, 0.5), 0);
		nap();
		assert_int_equal(incise_stepper_status(rig.stepper, &s), 0);
	}
	assert_true(fabs(s.position_mm - 0.5) < 1e-3);
	/* Borrowed again and again: disable, SDOs, enable. */
	for (int i = 0; i < 3; i++) {
		if (incise_stepper_disable(rig.stepper, &err) ||
		    incise_stepper_clear(rig.stepper, &err) ||
		    incise_stepper_enable(rig.stepper, &err))
			fail_msg("%s", err.text);
	}
	incise_stepper_set(rig.stepper, 15);
	for (int i = 0; i < 20; i++)
		nap();
	/* Closed under way. */
	rig.stepper->ops->close(rig.stepper);
	catch_up(&rig.drive.bus);
	if (drive_powered(&rig.drive))
		fail_msg("left in %s", cia402_state_name(rig.drive.state));
	assert_int_equal(rig.drive.enabled_unasked, 0);
}

static void a_watcher_has_a_thread_too(void **state)
{
	struct incise_stepper_status s = {0};
	struct incise_error err = {0};

	can_rig_init(&rig);
	rig.watch = true;
	if (!open_real(&err))
		fail_msg("%s", err.text);
	/* The first status is valid at once. */
	assert_int_equal(incise_stepper_status(rig.stepper, &s), 0);
	assert_true(s.t_ns && s.state == INCISE_STEPPER_STATE_DISABLED);
	for (int i = 0; i < 5000; i++) {
		int64_t t_ns = s.t_ns;

		nap();
		incise_stepper_status(rig.stepper, &s);
		if (s.t_ns > t_ns)
			break;
		assert_true(i < 4999);
	}
	rig.stepper->ops->close(rig.stepper);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_runs_and_lends_the_bus),
		cmocka_unit_test(a_watcher_has_a_thread_too),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
