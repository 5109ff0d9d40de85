/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A haptic loop from its set-up to its report.
 *
 *   HAPTIC_LOOP    tracker ─▶ this process ─▶ actuators              incise haptic
 *   HAPTIC_FEED    tracker ─▶ this process ─▶ kernel ─▶ actuators    incise feed
 *   HAPTIC_WATCH              this process ◀─ kernel                 incise haptic --in-kernel,
 *                                                                    which starts incise feed
 */
#ifndef INCISE_HAPTIC_RUN_H
#define INCISE_HAPTIC_RUN_H

#include "../cli/procedure.h"
#include "haptic.h"

struct haptic_job {
	struct haptic haptic;
	struct incise_realtime_setup realtime;
	const char *rig, *log, *calibration, *state;
	struct session_options session;
	double duration;
	bool json, home, recover, no_rt, verbose, scripted, in_kernel;
	struct procedure procedure; /* scripted */
	char **feeder;		    /* arguments of incise feed; with HAPTIC_WATCH */
};

/* Run it; the command line was parsed before, and incise_realtime_prepare() called. Returns the exit
 * code, or fails the program. */
int haptic_run(struct haptic_job *job);

#endif
