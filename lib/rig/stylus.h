/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A haptic device as the tool of a rig: in the scene's frame, with clutch and enabling button, and
 * from no force at each start.
 *
 *             off ── in the middle of the workspace, enabled, ready ──▶ on
 *              ▲                                                        │
 *              ╰── clutch, enabling button let go, not ready, too late ─╯
 *
 * Its poses are a tracker. Off it takes no force, and a plan fades its own.
 */
#ifndef INCISE_STYLUS_H
#define INCISE_STYLUS_H

#include <incise/backend.h>
#include <incise/rig.h>

struct incise_stylus {
	/* Its poses: time, period and latency are the device's. */
	struct incise_tracker tracker;
	struct incise_haptic *haptic;
	struct incise_haptic_info info;
	struct incise_haptic_setup setup; /* turn and origin are those of now */
	struct incise_haptic_sample last; /* device's frame */
	bool seen;
	double held_mm
		[3]; /* in the scene, where the tool was as the clutch was pressed */
	bool clutched;
	enum incise_haptic_off off;
	int64_t latency_ns; /* assumed */
	double age_ns;	    /* mean of the last ticks */
	struct incise_haptic_ages ages;
};

/* NULL: no memory; free(3). @haptic must outlive it. */
struct incise_stylus *incise_stylus_new(struct incise_haptic *haptic,
					const struct incise_haptic_setup *setup);

/* Push with a force in the scene's frame. 0 or a negative errno. */
int incise_stylus_push(struct incise_stylus *stylus,
		       const double force_N[3]) INCISE_REALTIME;

/* The state after the last poses at time @now_ns. */
enum incise_haptic_off incise_stylus_off(struct incise_stylus *stylus,
					 int64_t now_ns) INCISE_REALTIME;

/* Another latency than the device's nominal one, for plans to come. */
void incise_stylus_assume(struct incise_stylus *stylus, int64_t latency_ns);

void incise_stylus_ages(const struct incise_stylus *stylus,
			struct incise_haptic_ages *ages);

/* The stylus of a rig with a haptic device, or NULL. */
struct incise_stylus *incise_rig_stylus(struct incise_rig *rig);

#endif
