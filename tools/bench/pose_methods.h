/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Ways of telling where the tip is now from poses that came before.
 */
#ifndef INCISE_POSE_METHODS_H
#define INCISE_POSE_METHODS_H

#include <stdint.h>
#include <incise/tracker.h>
#include "motions.h"

struct pose_method {
	const char *name;
	/* Begin with a tracker as it says of itself; to be ended. */
	void *(*begin)(const struct pose_method *method,
		       const struct incise_tracker_info *info);
	void (*add)(void *state, const struct incise_tracker_sample *sample);
	void (*at)(const void *state, int64_t t_ns, struct motion_state *shown);
	void (*end)(void *state);
	double noise_mm; /* told to the library; 0: it is not told */
	bool punctual;	 /* told that the tracker is not late */
};

#define POSE_METHODS 7
#define POSE_METHOD_HELD 0
#define POSE_METHOD_LIBRARY 3
extern const struct pose_method pose_methods[POSE_METHODS];

#endif
