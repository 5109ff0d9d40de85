/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The virtual rig and its devices, for incise_rig_open(). Each device belongs to the caller and
 * must be closed before the sim is freed.
 */
#ifndef INCISE_SIM_DEVICES_H
#define INCISE_SIM_DEVICES_H

#include <incise/sim.h>
#include <incise/backend.h>
#include <incise/vision.h>
#include "../base/settings.h"

/* The truth at one instant, without any device's errors. */
struct incise_sim_truth {
	int64_t t_ns;
	int cut;	       /* 0 … of the cut under way, -1 between cuts */
	double position_mm[3]; /* tip of the blade */
	double quaternion[4];  /* w first */
	double depth_mm;       /* ≥ 0; 0 in the air */
	double velocity_mm_s;  /* speed of the tip */
	double force_N;	       /* on the blade, saw-tooth and boundary included */
};

/*
 * Make a virtual rig; time 0 of its script is the clock's present time. To be freed after the
 * devices that use it. NULL with errno EINVAL (a value out of range: @err names key and range),
 * ENOMEM.
 */
struct incise_sim *incise_sim_new(const struct incise_sim_config *config,
				  struct incise_clock *clock, struct incise_error *err);
void incise_sim_free(struct incise_sim *sim);

/* The truth at the clock's present time. */
void incise_sim_truth(struct incise_sim *sim, struct incise_sim_truth *truth);

/* All return NULL with errno ENOMEM. */
struct incise_tracker *incise_sim_tracker_new(struct incise_sim *sim);
struct incise_force *incise_sim_force_new(struct incise_sim *sim);
struct incise_camera *incise_sim_camera_new(struct incise_sim *sim);
/* @axis: 0 … config.axes - 1 */
struct incise_stepper *incise_sim_stepper_new(struct incise_sim *sim, int axis);

/*
 * A simulated haptic device, with a hand on it, by the arguments "KEY=VALUE,…"; on its own, without
 * the virtual rig. NULL with errno EINVAL, ENOMEM.
 */
struct incise_haptic *incise_sim_haptic_new(const struct incise_backend_request *request,
					    struct incise_error *err);

/* The keys of these arguments, in a struct of sim_haptic.c. */
extern const struct incise_setting incise_sim_haptic_settings[];

/*
 * Directions of the actuators: out of the surface, whose normal is @normal; across the blade,
 * along y; along the cut, x. Returns how many there are.
 */
int incise_sim_directions(const struct incise_sim_config *config, const double normal[3],
			  double direction[][3]);

/* The keys of the group sim of rig.conf, in a struct incise_sim_config. */
extern const struct incise_setting incise_sim_settings[];

/* Set-up of vision for the virtual camera's frames, with its scale. */
void incise_sim_vision_setup(const struct incise_sim_config *config,
			     struct incise_vision_setup *setup);

/* True length of the scalpel in a frame of time t_ns (the clock's), pixels. */
double incise_sim_camera_exposed_px(const struct incise_sim *sim, int64_t t_ns);

#endif
