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

#include "../session/procedure.h"
#include "haptic.h"

struct haptic_job {
	struct haptic haptic;
	struct incise_realtime_setup realtime;
	const char *rig, *log, *calibration, *state;
	struct session_options session;
	double duration;
	int timer_cpu; /* of HAPTIC_FEED: where the module's timers fire; < 0: any */
	bool json, home, recover, no_rt, verbose, scripted, in_kernel;
	struct procedure procedure; /* scripted */
	char **feeder;		    /* arguments of incise feed; with HAPTIC_WATCH */
};

/* Rows of the tables of options that both commands have. */
#define HAPTIC_TIP_OPTION CALIBRATION_OPTION(struct haptic_job, calibration)
#define HAPTIC_HOLD_OPTIONS                                                       \
	{0, "duration", "TIME",                                                   \
	 "stop after this time, for example 10s (default: at Ctrl-C)",            \
	 CLI_DURATION(struct haptic_job, duration, 0.01, 86400)},                 \
		{0, "home", NULL, "home each actuator first, unless it is homed", \
		 CLI_FLAG(struct haptic_job, home)},                              \
	{                                                                         \
		0, "recover", NULL,                                               \
			"first clear faults that a crashed program left latched", \
			CLI_FLAG(struct haptic_job, recover)                      \
	}

/* Run it; the command line was parsed before, and incise_realtime_prepare() called. Returns the exit
 * code, or fails the program. */
int haptic_run(struct haptic_job *job);

#endif
