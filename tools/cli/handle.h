/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The handle of a rig's haptic device, read by a command that renders nothing.
 */
#ifndef INCISE_CLI_HANDLE_H
#define INCISE_CLI_HANDLE_H

#include <incise/rig.h>

struct handle_sample {
	struct incise_haptic_sample pose;
	int64_t age_ns; /* as it was read */
};

struct handle {
	struct incise_haptic *haptic;
	struct incise_clock *clock;
	struct incise_haptic_info info;
	struct incise_haptic_sample last;
	int64_t seen_ns;
	uint32_t flags;		       /* of any sample since handle_record() */
	double force_N[3];	       /* that handle_poll() pushes */
	bool pressed;		       /* a button or Enter, in handle_await_press() */
	struct handle_sample *samples; /* of handle_record(); free(3) */
	int n;
};

/* @rig: with its haptic device, which must outlive it. */
void handle_begin(struct handle *handle, struct incise_rig *rig);

/*
 * Read the samples that have arrived, or keep them, too, push the force, and wait a millisecond. 0; errno
 * of the device, or ETIMEDOUT if samples stop or are late, with no force.
 */
int handle_poll(struct handle *handle, bool keep, struct incise_error *err);

/* Set no force, before a command ends. */
void handle_release(struct handle *handle);

/* Whether samples were those of a device that is ready: 0; EIO with its cause. */
int handle_check(const struct handle *handle, struct incise_error *err);

/* Wait for a button, or for Enter; after the end of the input for a button only. 0; errno of the device. */
int handle_await_press(struct handle *handle, struct incise_error *err);

/* Keep the samples of the next @time_s, at least two. The same. */
int handle_record(struct handle *handle, double time_s, struct incise_error *err);

/* Mean of the recorded positions; returns their standard deviation along one axis, rms of the three. */
double handle_mean(const struct handle *handle, double mean_mm[3]);

#endif
