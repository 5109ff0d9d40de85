/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * An actuator driven by hand: targets are repeated, as its deadman requires, and the program
 * brings it to rest before any end.
 *
 *   open ─▶ power ─▶ ⟲ target, pass ─▶ end
 *             ╰────────────┴─▶ fault, Ctrl-C: to rest, power off, one line
 *
 * Times follow the rig's clock, simulated or real.
 */
#ifndef INCISE_STEPPER_DRIVE_TOOL_H
#define INCISE_STEPPER_DRIVE_TOOL_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/export.h>
#include <incise/rig.h>

struct stepper_drive {
	struct incise_rig *rig;
	struct incise_clock *clock;
	struct incise_stepper *stepper;
	struct incise_stepper_info info;
	struct incise_stepper_status status; /* the last one */
	const char *doing;		     /* "move" */
	bool powered;			     /* by this program */
	bool drove;			     /* it was powered */
	int64_t period_ns;		     /* of targets */
	int64_t shown_ns;		     /* when progress was shown */
};

/* All of these end the program with 1 and one line when they fail. */

/*
 * Open the rig's stepper. @axis: its number in rig.conf, from 1 on; @devices: others of the rig,
 * INCISE_RIG_WATCH, or STEPPER_DRIVE_OR_WATCH: watch it while another program drives it.
 */
#define STEPPER_DRIVE_OR_WATCH ~0U
void stepper_drive_open(struct stepper_drive *drive, const char *rig, int axis,
			unsigned int devices, const char *doing);

/* Power it; from here on signals set cli_stop. */
void stepper_drive_power(struct stepper_drive *drive);

/* Read its status. */
void stepper_drive_look(struct stepper_drive *drive);

/* Set a target or a speed, wait a period, read the status. A fault ends the program. */
void stepper_drive_to(struct stepper_drive *drive, double position_mm);
void stepper_drive_at(struct stepper_drive *drive, double velocity_mm_s);

/* Hold its position until Ctrl-C, or for a time; 0: no limit. */
void stepper_drive_hold(struct stepper_drive *drive, double seconds);

bool stepper_drive_rests(const struct stepper_drive *drive);

/* Whether it rests at the target, or at the nearest microstep. */
bool stepper_drive_arrived(const struct stepper_drive *drive, double to_mm);

/* Bring it to rest without power, and read the status. */
void stepper_drive_rest(struct stepper_drive *drive);

/* The same if it is powered, and close the rig. */
void stepper_drive_end(struct stepper_drive *drive);

/* Power off, close the rig, then fail the program. */
_Noreturn void stepper_drive_fail(struct stepper_drive *drive, const char *fmt, ...)
	INCISE_PRINTF(2, 3);

#endif
