/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A scene on the virtual rig in simulated time, with hands between the plan and its devices:
 * they can hold back what a device says, say something else, or do what no tick may do.
 *
 *     plan ──▶ hands ──▶ virtual tracker, virtual stepper
 */
#ifndef INCISE_TEST_RTSAN_HANDS_H
#define INCISE_TEST_RTSAN_HANDS_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <incise/backend.h>
#include <incise/plan.h>
#include <incise/rig.h>
#include <incise/scene.h>

struct hands {
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_plan *plan;
	struct incise_stepper *stepper; /* NULL without one */
	const struct incise_tracker_ops *tracker_ops;
	const struct incise_stepper_ops *stepper_ops; /* the rig's own */
	struct incise_tracker_ops own_tracker_ops;
	struct incise_stepper_ops own_stepper_ops;
	int reads; /* of poses: one a tick */
	/*
	 * What a read of poses comes to, of the @n that the tracker gave; may change them. Or
	 * NULL.
	 */
	int (*poses)(struct incise_tracker_sample *samples, int n);
	/* What it does to the stepper's answers. Or NULL. */
	int (*status)(struct incise_stepper_status *status, int rc);
	int (*set)(int rc);
};

/* Functions of devices know of no context; one test at a time has its hands in a rig. */
static struct hands hands;

static int hands_read(struct incise_tracker *tracker,
		      struct incise_tracker_sample *samples, int n)
{
	int rc = hands.tracker_ops->read(tracker, samples, n);

	hands.reads++;
	return hands.poses ? hands.poses(samples, rc) : rc;
}

static int hands_status(struct incise_stepper *stepper,
			struct incise_stepper_status *status)
{
	int rc = hands.stepper_ops->status(stepper, status);

	return hands.status ? hands.status(status, rc) : rc;
}

static int hands_set(struct incise_stepper *stepper, double position_mm)
{
	int rc = hands.stepper_ops->set(stepper, position_mm);

	return hands.set ? hands.set(rc) : rc;
}

static inline void hands_fail(const char *what, const char *why)
{
	fprintf(stderr, "FAIL  rtsan: %s: %s\n", what, why);
	exit(1);
}

/* @devices: INCISE_RIG_… bits. */
static inline void hands_begin(const char *scene, const char *arithmetic, bool full,
			       unsigned int devices)
{
	struct incise_error err = {0};
	struct incise_tracker *tracker;

	hands = (struct hands){.scene = incise_scene_load(scene, NULL, &err)};
	if (!hands.scene || incise_scene_set_arithmetic(hands.scene, arithmetic, &err))
		hands_fail(scene, err.text);
	incise_scene_set_full(hands.scene, full);
	/* One cut of 2 s, half a second before it and after. */
	hands.rig = incise_rig_open("sim:clock=simulated,depth_mm=8,times=1,cut_s=2,"
				    "pause_s=0.5",
				    devices, &err);
	if (!hands.rig)
		hands_fail(scene, err.text);
	hands.plan = incise_plan_new(hands.scene, hands.rig, &err);
	if (!hands.plan)
		hands_fail(scene, err.text);
	tracker = incise_rig_tracker(hands.rig);
	hands.tracker_ops = tracker->ops;
	hands.own_tracker_ops = *tracker->ops;
	hands.own_tracker_ops.read = hands_read;
	tracker->ops = &hands.own_tracker_ops;
	hands.stepper = incise_rig_stepper(hands.rig);
	if (!hands.stepper)
		return;
	hands.stepper_ops = hands.stepper->ops;
	hands.own_stepper_ops = *hands.stepper->ops;
	hands.own_stepper_ops.status = hands_status;
	hands.own_stepper_ops.set = hands_set;
	hands.stepper->ops = &hands.own_stepper_ops;
}

static inline void hands_end(void)
{
	/* The rig closes its devices with their own functions. */
	incise_rig_tracker(hands.rig)->ops = hands.tracker_ops;
	if (hands.stepper)
		hands.stepper->ops = hands.stepper_ops;
	incise_plan_free(hands.plan);
	incise_rig_close(hands.rig);
	incise_scene_free(hands.scene);
}

#endif
