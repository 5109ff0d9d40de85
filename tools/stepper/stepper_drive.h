/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * An actuator driven by hand: targets are given again and again, which is the sign of life
 * that its deadman waits for, and whatever ends the program brings it to rest first.
 *
 *   open ─▶ power ─▶ ⟲ target, pass ─▶ end
 *             ╰────────────┴─▶ fault, Ctrl-C: to rest, power off, one line
 *
 * Times are those of the rig's clock, simulated or real.
 */
#ifndef INCISE_STEPPER_DRIVE_H
#define INCISE_STEPPER_DRIVE_H

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
	bool powered;			     /* by us */
	bool drove;			     /* it was */
	int64_t period_ns;		     /* of targets */
	int64_t shown_ns;		     /* when progress was shown */
};

/* All of these end the program with 1 and one line when they fail. */

/* Open the rig's stepper: to be its owner, or just to watch. */
void stepper_drive_open(struct stepper_drive *drive, const char *rig, bool watch,
			const char *doing);

/* The same as its owner, with other devices of the rig: INCISE_RIG_FORCE. */
void stepper_drive_open_with(struct stepper_drive *drive, const char *rig,
			     unsigned int devices, const char *doing);

/* Power it; from here on signals set cli_stop. */
void stepper_drive_power(struct stepper_drive *drive);

/* Read where it stands. */
void stepper_drive_look(struct stepper_drive *drive);

/* Give a target, or a speed; let a period pass; look. A fault ends the program. */
void stepper_drive_to(struct stepper_drive *drive, double position_mm);
void stepper_drive_at(struct stepper_drive *drive, double velocity_mm_s);

/* Hold it where it stands until Ctrl-C, or for a time; 0: for ever. */
void stepper_drive_hold(struct stepper_drive *drive, double seconds);

bool stepper_drive_rests(const struct stepper_drive *drive);

/* To rest, power off; look where that is. */
void stepper_drive_rest(struct stepper_drive *drive);

/* The same as far as it is powered, and close the rig. */
void stepper_drive_end(struct stepper_drive *drive);

/* stepper_drive_end(), then the line. */
_Noreturn void stepper_drive_fail(struct stepper_drive *drive, const char *fmt, ...)
	INCISE_PRINTF(2, 3);

#endif
