/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A stepper on a simulated drive: all of lib/device/can with its thread, on the drive's clock.
 *
 *	struct can_rig rig;
 *
 *	can_rig_init(&rig);
 *	rig.actuator.invert = true;		set by rig.conf
 *	rig.drive->blocked = true;		a fault of the drive
 *	stepper = can_rig_open(&rig, &err);
 *	can_rig_hold(&rig, 3.0, 100 * DRIVE_MS);	a target each 5 ms
 */
#ifndef INCISE_TEST_CAN_RIG_H
#define INCISE_TEST_CAN_RIG_H

#include <incise/backend.h>
#include "../../../lib/device/can/cia402/can_stepper.h"
#include "drive.h"

struct can_rig {
	struct drive drive;
	struct incise_actuator actuator;
	struct incise_stepper *stepper;
	const char *arguments;
	bool watch;
};

/* One at a time: a transport has no context. */
static struct can_rig *can_rig_now;

static inline int can_rig_transport(struct can_bus **bus,
				    const struct can_bus_request *request,
				    struct incise_error *err)
{
	(void)request;
	(void)err;
	*bus = &can_rig_now->drive.bus;
	return 0;
}

static inline void can_rig_sleep_until(struct can_bus *bus, int64_t t_ns)
{
	struct drive *drive = (struct drive *)bus;

	if (t_ns > drive->now_ns)
		drive_advance(drive, t_ns - drive->now_ns);
}

static inline void can_rig_init(struct can_rig *rig)
{
	memset(rig, 0, sizeof(*rig));
	drive_init(&rig->drive);
	can_rig_now = rig;
	rig->arguments = "can-test:0x10";
	rig->actuator = (struct incise_actuator){
		.spring_N_mm = 2,
		.travel_mm = 20,
		.lead_mm = 4,
		.steps_per_turn = 200,
		.microsteps = 16,
		.velocity_mm_s = 10,
		.acceleration_mm_s2 = 500,
		.deadman_s = 0.1,
		.tick_ns = 250000,
		.home_mm_s = 2,
		.can = {.cycle_ns = 1000000,
			.following_mm = 1,
			.following_s = 0.05,
			.start_s = 0.5,
			.answer_s = 0.2,
			.homing_method = 17,
			.position_gain_1_s = 20,
			.master = 127},
	};
}

static const struct can_transport can_rig_of = {"can", can_rig_transport,
						can_rig_sleep_until};

static inline struct incise_stepper *can_rig_open(struct can_rig *rig,
						  struct incise_error *err)
{
	struct incise_backend_request request = {
		.arguments = rig->arguments,
		.where = "rig.conf:3: stepper",
		.watch = rig->watch,
		.actuator = &rig->actuator,
	};

	return rig->stepper = can_stepper_open(&can_rig_of, &request, err);
}

static inline void can_rig_open_or_fail(struct can_rig *rig)
{
	struct incise_error err = {0};

	if (!can_rig_open(rig, &err))
		fail_msg("%s", err.text);
}

/* The user enables it. */
static inline void can_rig_enable_or_fail(struct can_rig *rig)
{
	struct incise_error err = {0};

	rig->drive.tripped = false;
	if (incise_stepper_enable(rig->stepper, &err))
		fail_msg("%s", err.text);
	assert_int_equal(rig->drive.state, CIA402_ENABLED);
}

static inline void can_rig_close(struct can_rig *rig)
{
	rig->stepper->ops->close(rig->stepper);
}

/* Advance the clock; the thread's work is done meanwhile. */
static inline void can_rig_advance(void *world, int64_t ns)
{
	struct can_rig *rig = world;

	rig->stepper->ops->wait(rig->stepper, ns);
}

static inline void can_rig_hold(struct can_rig *rig, double mm, int64_t ns)
{
	for (; ns > 0; ns -= 5 * DRIVE_MS) {
		incise_stepper_set(rig->stepper, mm);
		can_rig_advance(rig, 5 * DRIVE_MS);
	}
}

static inline struct incise_stepper_status can_rig_look(struct can_rig *rig)
{
	struct incise_stepper_status status;

	incise_stepper_status(rig->stepper, &status);
	return status;
}

#endif
