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

struct incise_stylus;

/* NULL: no memory. @haptic must outlive it. */
struct incise_stylus *incise_stylus_new(struct incise_haptic *haptic,
					const struct incise_haptic_setup *setup);
void incise_stylus_free(struct incise_stylus *stylus);

/* Its poses: time, period and latency are the device's. Owned by the stylus. */
struct incise_tracker *incise_stylus_tracker(struct incise_stylus *stylus);

/* Push with a force in the scene's frame. 0 or a negative errno. */
int incise_stylus_push(struct incise_stylus *stylus,
		       const double force_N[3]) INCISE_REALTIME;

/* The state after the last poses at time @now_ns. */
enum incise_haptic_off incise_stylus_off(struct incise_stylus *stylus,
					 int64_t now_ns) INCISE_REALTIME;

const struct incise_haptic_setup *incise_stylus_setup(const struct incise_stylus *stylus);

/* Another latency than the device's nominal one, for plans to come. */
void incise_stylus_assume(struct incise_stylus *stylus, int64_t latency_ns);

/* Place the device's frame in the scene. */
void incise_stylus_place(struct incise_stylus *stylus, const double turn[4],
			 const double origin_mm[3]);

void incise_stylus_ages(const struct incise_stylus *stylus,
			struct incise_haptic_ages *ages);

/* The stylus of a rig with a haptic device, or NULL. */
struct incise_stylus *incise_rig_stylus(struct incise_rig *rig);

#endif
