/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What stands behind a device: a table of functions per backend and kind. A backend
 * embeds the kind's struct as its first member.
 */
#ifndef INCISE_BACKEND_H
#define INCISE_BACKEND_H

#include <incise/camera.h>
#include <incise/force.h>
#include <incise/stepper.h>
#include <incise/tracker.h>

struct incise_tracker_ops {
	int (*read)(struct incise_tracker *tracker, struct incise_tracker_sample *samples,
		    int n);
	void (*info)(const struct incise_tracker *tracker,
		     struct incise_tracker_info *info);
	uint64_t (*lost)(const struct incise_tracker *tracker);
	void (*close)(struct incise_tracker *tracker);
};

struct incise_tracker {
	const struct incise_tracker_ops *ops;
};

struct incise_force_ops {
	int (*read)(struct incise_force *force, struct incise_force_sample *samples,
		    int n);
	void (*info)(const struct incise_force *force, struct incise_force_info *info);
	uint64_t (*lost)(const struct incise_force *force);
	void (*close)(struct incise_force *force);
};

struct incise_force {
	const struct incise_force_ops *ops;
};

struct incise_camera_ops {
	int (*read)(struct incise_camera *camera, struct incise_camera_frame *frame);
	void (*info)(const struct incise_camera *camera, struct incise_camera_info *info);
	uint64_t (*lost)(const struct incise_camera *camera);
	void (*close)(struct incise_camera *camera);
};

struct incise_camera {
	const struct incise_camera_ops *ops;
};

struct incise_stepper_ops {
	int (*set)(struct incise_stepper *stepper, double position_mm);
	int (*status)(struct incise_stepper *stepper,
		      struct incise_stepper_status *status);
	void (*info)(const struct incise_stepper *stepper,
		     struct incise_stepper_info *info);
	void (*close)(struct incise_stepper *stepper);
};

struct incise_stepper {
	const struct incise_stepper_ops *ops;
};

#endif
