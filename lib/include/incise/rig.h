/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A rig: the devices of rig.conf with their common clock. Each device is a string,
 * `BACKEND:ARGUMENTS`; `sim:` is the simulated rig. Other backends are modules, loaded when
 * rig.conf names them (incise/backend.h).
 *
 *     clock   = "real";          # or "simulated"
 *     haptic  = "haply:";        # in place of tracker and stepper
 *     tracker = "sim:";
 *     force   = "sim:";
 *     camera  = "sim:";
 *     stepper = "sim:";          # or up to three: [ "…", "…" ], each with its direction
 *     surface = { point_mm = [0.0, 0.0, 0.0]; normal = [0.0, 0.0, 1.0]; };
 *     sim     = { seed = 1; };   # see incise/sim.h
 */
#ifndef INCISE_RIG_H
#define INCISE_RIG_H

#include <stdbool.h>
#include <incise/calibration.h>
#include <incise/camera.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/settings.h>
#include <incise/export.h>
#include <incise/foot_switch.h>
#include <incise/force.h>
#include <incise/haptic.h>
#include <incise/stepper.h>
#include <incise/tracker.h>
#include <incise/vision.h>

INCISE_BEGIN_DECLS

/** Largest number of actuators of a rig. */
#define INCISE_RIG_AXES_MAX 3

struct incise_rig;
struct incise_sim;

/** Kinds of devices, as bits. */
enum incise_rig_device {
	INCISE_RIG_TRACKER = 1,
	INCISE_RIG_FORCE = 2,
	INCISE_RIG_CAMERA = 4,
	/** All actuators. */
	INCISE_RIG_STEPPER = 8,
	/** With STEPPER: only read their state, while another program drives them. */
	INCISE_RIG_WATCH = 16,
	/** With CAMERA: only if a rig.conf names one; "sim:KEY=VALUE,…" names no camera. */
	INCISE_RIG_IF_NAMED = 32,
	/**
	 * The haptic device. It is opened for TRACKER and STEPPER, too, in a rig that has one.
	 */
	INCISE_RIG_HAPTIC = 64,
	/** With FORCE: a rig with a haptic device need not name a force channel. */
	INCISE_RIG_FORCE_IF_NAMED = 128,
};

/**
 * Open a rig.
 *
 * @param spec    path of a rig.conf, or "sim:KEY=VALUE,…" for a simulated rig with the scalar
 *                keys of the `sim` group and `clock`; "sim:" for its defaults; or a haptic
 *                device alone, "haply:", "sim:haptic,KEY=VALUE,…"
 * @param devices incise_rig_device bits to open
 * @return rig, to be closed with incise_rig_close(); NULL with errno of incise_infile_open(),
 *         EINVAL (syntax, unknown key, value out of range; the message has file and line),
 *         ENODEV (a device that the file does not name, or an unknown backend), ENOEXEC (a
 *         broken module), ENOMEM; for a real device also ENOENT, EACCES, EBUSY (another
 *         program drives it), ERANGE (this machine is too slow for its steps; no such range or
 *         value), EOPNOTSUPP (it cannot be watched, or lacks a setting), ETIMEDOUT (no
 *         answer), EPROTO (invalid answers of its driver), EIO (it does not accept or keep a
 *         setting), ENOSPC (its bus has no bandwidth left).
 */
INCISE_API struct incise_rig *incise_rig_open(const char *spec, unsigned int devices,
					      struct incise_error *err);

/** Close the devices, unload their modules and free the clock. NULL is accepted. */
INCISE_API void incise_rig_close(struct incise_rig *rig);

/** The @spec of incise_rig_open(); owned by the rig. */
INCISE_API const char *incise_rig_spec(const struct incise_rig *rig);

/** The rig's clock; owned by the rig. */
INCISE_API struct incise_clock *incise_rig_clock(struct incise_rig *rig);

/** The device, or NULL if it was not opened; owned by the rig. */
INCISE_API struct incise_tracker *incise_rig_tracker(struct incise_rig *rig);
/** @see incise_rig_tracker() */
INCISE_API struct incise_force *incise_rig_force(struct incise_rig *rig);
/** @see incise_rig_tracker() */
INCISE_API struct incise_camera *incise_rig_camera(struct incise_rig *rig);
/** The first actuator. @see incise_rig_tracker() */
INCISE_API struct incise_stepper *incise_rig_stepper(struct incise_rig *rig);

/**
 * An actuator, and the direction in which it pushes the handle.
 *
 * @param i         0 …
 * @param direction unit vector in the tracker's frame; unchanged without an actuator; may
 *                  be NULL
 * @return the actuator, owned by the rig; NULL if there are at most @i opened actuators
 */
INCISE_API struct incise_stepper *incise_rig_axis(struct incise_rig *rig, int i,
						  double direction[3]);

/** The haptic device, or NULL; owned by the rig. Its poses are the rig's tracker, too. */
INCISE_API struct incise_haptic *incise_rig_haptic(struct incise_rig *rig);

/**
 * Place the rig's haptic device in the scene by the frame of a calibration, in place of rig.conf's. A
 * calibration without a frame changes nothing. A rig without a haptic device ignores these three calls; its
 * ages are 0.
 */
INCISE_API void incise_rig_haptic_place(struct incise_rig *rig,
					const struct incise_calibration *calibration);

/** Assume another latency than the device's nominal one, for plans that are made later. */
INCISE_API void incise_rig_haptic_assume(struct incise_rig *rig, int64_t latency_ns);

/** Get the ages of the samples of the rig's haptic device, since the last call of assume. */
INCISE_API void incise_rig_haptic_ages(const struct incise_rig *rig,
				       struct incise_haptic_ages *ages);

/** The simulated rig of the `sim:` devices, or NULL; owned by the rig. */
INCISE_API struct incise_sim *incise_rig_sim(struct incise_rig *rig);

/** The tissue surface: a point on it and the outward unit normal. */
INCISE_API void incise_rig_surface(const struct incise_rig *rig, double point_mm[3],
				   double normal[3]);

/**
 * Settings for incise_vision_new(): the group `vision` of rig.conf, with depth_mm_px = 0; if
 * full_px is not 0, the caller sets it from calibration.conf. Without the group, a simulated
 * camera has known settings with their scale. The camera need not be open, and no module is
 * loaded.
 *
 * @return 0; -ENOENT (no such group and no simulated camera): *setup is unchanged
 */
INCISE_API int incise_rig_vision(const struct incise_rig *rig,
				 struct incise_vision_setup *setup);

/**
 * The group `foot_switch` of rig.conf, for incise_foot_switch_open(). The rig does not open
 * it.
 *
 * @return 0; -ENOENT (no such group): *setup is unchanged
 */
INCISE_API int incise_rig_foot_switch(const struct incise_rig *rig,
				      struct incise_foot_switch_setup *setup);

/** Largest length of the path of incise_rig_sign_key(), with its NUL. */
#define INCISE_RIG_KEY_PATH_MAX 300

/**
 * The key `sign_key` of rig.conf: path of the private key of SSH that signs recordings of this rig.
 *
 * @return path, owned by the rig; NULL: no file
 */
INCISE_API const char *incise_rig_sign_key(const struct incise_rig *rig);

/**
 * List the keys of a rig: the given ones, and the defaults of the clock, the surface and each
 * named device. No device is opened.
 *
 * @param spec as for incise_rig_open()
 * @return 0; the value of @found; a negative errno of incise_rig_open() without devices
 */
INCISE_API int incise_rig_keys(const char *spec, incise_key_found *found, void *context,
			       struct incise_error *err);

/** Whether rig.conf may have this key at its top level. */
INCISE_API bool incise_rig_has_key(const char *key);

INCISE_END_DECLS
#endif
