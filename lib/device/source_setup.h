/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading what rig.conf sets real sources to: the groups tracker_setup, force_setup and
 * camera_setup; and vision, which looks at the camera's pictures. Without its group a source
 * is as by default.
 */
#ifndef INCISE_SOURCE_SETUP_H
#define INCISE_SOURCE_SETUP_H

#include <incise/camera.h>
#include <incise/force.h>
#include <incise/tracker.h>
#include <incise/vision.h>
#include "../base/conf.h"

/* Each reads the group of its name within @root. Returns 0 or -EINVAL; err names file, line,
 * key and what to do. */
int incise_tracker_setup_read(struct incise_tracker_setup *setup,
			      const config_setting_t *root, const char *path,
			      struct incise_error *err);
int incise_force_setup_read(struct incise_force_setup *setup,
			    const config_setting_t *root, const char *path,
			    struct incise_error *err);
int incise_camera_setup_read(struct incise_camera_setup *setup,
			     const config_setting_t *root, const char *path,
			     struct incise_error *err);

/* *given says whether there is such a group. depth_mm_px stays 0: calibration.conf has it. */
int incise_vision_setup_read(struct incise_vision_setup *setup, bool *given,
			     const config_setting_t *root, const char *path,
			     struct incise_error *err);

#endif
