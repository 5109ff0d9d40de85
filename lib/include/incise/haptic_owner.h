/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The owner of a rig's haptic device: it opens the device in this process, and serves it to one user over a
 * page in shared memory (incise/haptic_page.h). For `incise device`, which does nothing else.
 *
 *     device ── wait, read ──▶ page ──▶ user: incise_rig_open() of another process
 *        ▲                      │
 *        ╰── force ◀── 0 without the user's heartbeat
 */
#ifndef INCISE_HAPTIC_OWNER_H
#define INCISE_HAPTIC_OWNER_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/haptic.h>

INCISE_BEGIN_DECLS

struct incise_haptic_owner;

/** Result of a tick. */
struct incise_haptic_owner_tick {
	int64_t t_ns;	   /**< of the decision about the force, CLOCK_MONOTONIC */
	int64_t age_ns;	   /**< of the user's last heartbeat; < 0: there was none */
	int64_t period_ns; /**< of the user's ticks, as it says */
	const char *off;   /**< why there is no force, or less: one word; "": there is */
	double force_N[3]; /**< given */
	double torque_N_mm[3]; /**< given */
	const char *end;       /**< why the owner should end; NULL: it goes on */
};

/**
 * Open the haptic device of a rig, and publish its page.
 *
 * @param rig  file rig.conf, or BACKEND:ARGUMENTS
 * @param note added to the note of the device, for its user; or ""
 * @param first_s the owner waits so long for its first user, or lost_s of haptic_setup if that is longer
 * @return owner; NULL with errno of incise_rig_open() and incise_haptic_open(), EBUSY (the device has
 *         an owner)
 */
INCISE_API struct incise_haptic_owner *incise_haptic_owner_open(const char *rig,
								const char *note,
								double first_s,
								struct incise_error *err);

/**
 * Wait for the device, or for the next period; publish its samples; give the user's force, or none.
 *
 * @return 0; -EINTR: a signal handler ran; or the device failed: -EIO, -ENODEV, -EPROTO, and the cause is
 *         in the page and in @err
 */
INCISE_API int incise_haptic_owner_tick(struct incise_haptic_owner *owner,
					struct incise_haptic_owner_tick *tick,
					struct incise_error *err);

/** No force, then close device and page. @reason: for the user, if the device did not fail. */
INCISE_API void incise_haptic_owner_close(struct incise_haptic_owner *owner,
					  const char *reason);

INCISE_END_DECLS
#endif
