// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_stepper.c with its real thread, on the simulated drive's clock.
 */
#include "../unit.h"
#include "../virtual_time.h" /* with __wrap_clock_gettime() and others */
#include "rig.h"

static struct can_rig rig;

static void advance(int64_t now_ns)
{
	drive_advance(&rig.drive, now_ns - rig.drive.now_ns);
}

/* For a frame: it can only be sent in a tick of the drive. */
static int wait_frame(struct can_bus *bus, int64_t until_ns)
{
	struct drive *d = &rig.drive;

	while (d->now_ns < until_ns &&
	       !(d->queued && d->queue[d->head].at_ns <= d->now_ns))
		virtual_sleep_until(d->now_ns + DRIVE_TICK_NS);
	return 0;
}

static struct incise_stepper *open_stepper(struct incise_error *err)
{
	static const struct can_transport transport = {"can", can_rig_transport, NULL};
	static struct can_bus_ops ops;
	struct incise_backend_request request = {
		.arguments = rig.arguments,
		.where = "rig.conf:3: stepper",
		.watch = rig.watch,
		.actuator = &rig.actuator,
	};

	virtual_time_start(rig.drive.now_ns, advance);
	ops = *rig.drive.bus.ops;
	ops.wait = wait_frame;
	rig.drive.bus.ops = &ops;
	return rig.stepper = can_stepper_open(&transport, &request, err);
}

static void nap(int64_t ns)
{
	virtual_sleep_until(rig.drive.now_ns + ns);
}

TEST(it_runs_and_lends_the_bus)
{
	struct incise_stepper_status s = {0};

	can_rig_init(&rig);
	succeeds(open_stepper(&err));
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), 0);
	/* 0.5 mm at 10 mm/s and 500 mm/s². */
	for (int i = 0; i < 50; i++) {
		assert_int_equal(incise_stepper_set(rig.stepper, 0.5), 0);
		nap(2 * DRIVE_MS);
	}
	assert_int_equal(incise_stepper_status(rig.stepper, &s), 0);
	assert_true(fabs(s.position_mm - 0.5) < 1e-3);
	/* Borrowed again and again: disable, SDOs, enable. */
	for (int i = 0; i < 3; i++) {
		succeeds(!incise_stepper_disable(rig.stepper, &err) &&
			 !incise_stepper_clear(rig.stepper, &err) &&
			 !incise_stepper_enable(rig.stepper, &err));
	}
	incise_stepper_set(rig.stepper, 15);
	nap(40 * DRIVE_MS);
	assert_true(rig.drive.velocity > 0);
	/* Closed under way. */
	rig.stepper->ops->close(rig.stepper);
	if (drive_powered(&rig.drive))
		fail_msg("left in %s", cia402_state_name(rig.drive.state));
	assert_int_equal(rig.drive.enabled_unasked, 0);
}

TEST(a_watcher_has_a_thread_too)
{
	struct incise_stepper_status s = {0};
	int64_t t_ns;

	can_rig_init(&rig);
	rig.watch = true;
	succeeds(open_stepper(&err));
	/* The first status is valid at once. */
	assert_int_equal(incise_stepper_status(rig.stepper, &s), 0);
	assert_true(s.t_ns && s.state == INCISE_STEPPER_STATE_DISABLED);
	t_ns = s.t_ns;
	nap(30 * DRIVE_MS);
	incise_stepper_status(rig.stepper, &s);
	assert_true(s.t_ns > t_ns);
	rig.stepper->ops->close(rig.stepper);
}
