/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The plan of a rig, read from rig.conf or from the shorthand before anything is opened.
 */
#ifndef INCISE_RIG_PLAN_H
#define INCISE_RIG_PLAN_H

#include <stdbool.h>
#include <incise/backend.h>
#include <incise/camera.h>
#include <incise/error.h>
#include <incise/foot_switch.h>
#include <incise/force.h>
#include <incise/haptic.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include <incise/tracker.h>
#include <incise/vision.h>
#include "../base/settings.h"

/* The kinds of devices; their order is that of the incise_rig_device bits. */
enum { KIND_TRACKER, KIND_FORCE, KIND_CAMERA, KIND_STEPPER, N_KINDS };

/* The keys of rig.conf and of its groups, in a struct incise_rig_plan; the keys of sim
 * and actuator are in ../sim/sim.h and actuator.h. */
extern const struct incise_setting incise_rig_settings[];

/* A slot for each device: the actuators' are the last ones. */
#define N_SLOTS (KIND_STEPPER + INCISE_RIG_AXES_MAX)

extern const char *const incise_kind_name[N_KINDS];

static inline int slot_kind(int slot)
{
	return slot < KIND_STEPPER ? slot : KIND_STEPPER;
}

static inline unsigned int kind_bit(int kind)
{
	return 1u << kind;
}

/* A device that does not stand on the virtual rig. */
struct rig_real {
	char *name; /* of its backend; NULL: not wanted */
	char *arguments;
	char where[240];
};

struct incise_rig_plan {
	bool simulated;
	bool sim;	      /* one of the devices stands on the virtual rig */
	bool watch;	      /* the stepper */
	unsigned int devices; /* incise_rig_device bits of the devices to open */
	struct rig_real real[N_SLOTS];
	int n_axes; /* actuators to be opened */
	double direction[INCISE_RIG_AXES_MAX][3];
	struct incise_actuator actuator[INCISE_RIG_AXES_MAX];
	int n_actuators; /* groups of that name */
	struct incise_tracker_setup tracker;
	struct incise_force_setup force;
	struct incise_camera_setup camera;
	struct incise_vision_setup vision;
	bool has_vision; /* rig.conf has it, or the camera is the virtual one */
	/* The haptic device: its string, free(3); NULL: none, or not wanted. */
	char *haptic_device;
	char haptic_where[240];
	struct incise_haptic_setup haptic;
	struct incise_foot_switch_setup foot_switch;
	bool has_foot_switch;
	char sign_key[INCISE_RIG_KEY_PATH_MAX]; /* "": no key */
	struct incise_sim_config config;
	double point_mm[3], normal[3];
};

/*
 * Read a rig.conf, or "sim:KEY=VALUE,…". Only devices that will be opened must have what
 * they need. Returns 0 or a negative errno; incise_rig_plan_free() in both cases.
 */
int incise_rig_plan_read(struct incise_rig_plan *plan, const char *spec,
			 unsigned int devices, struct incise_error *err);

void incise_rig_plan_free(struct incise_rig_plan *plan);

#endif
