/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The handle of a rig's haptic device, read by a command that renders nothing. Every failure ends the
 * program, and the device's force with it.
 */
#ifndef INCISE_CLI_HANDLE_H
#define INCISE_CLI_HANDLE_H

#include <incise/rig.h>

struct handle_sample {
	struct incise_haptic_sample pose;
	int64_t age_ns; /* as it was read */
};

struct handle {
	struct incise_rig *rig;
	struct incise_haptic *haptic;
	struct incise_clock *clock;
	struct incise_haptic_info info;
	struct incise_haptic_sample last;
	int64_t seen_ns;
	bool pressed;	   /* a button went down since the caller cleared it */
	double force_N[3]; /* pushed at each poll */
	struct handle_sample *samples; /* of handle_record() */
	int n;
};

void handle_open(struct handle *handle, const char *rig);
void handle_close(struct handle *handle);

/* Read the samples that have arrived, push, and wait for some more; a device that is silent fails. */
void handle_poll(struct handle *handle);

/* Poll for @time_s, and keep the samples; at least two. */
void handle_record(struct handle *handle, double time_s);

/* Mean of the recorded positions; returns their standard deviation along one axis, rms of the three. */
double handle_mean(const struct handle *handle, double mean_mm[3]);

#endif
