/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Sets a tracker up, reads it all back, and starts and stops its records.
 *
 * Set are: output in binary, centimetres, items, stations, hemisphere, no filters, no
 * increment (it would hold records back), a stylus button that is only told (else it stops
 * the stream), internal or external sync. Left alone is what somebody may have put there on
 * purpose: alignment, boresight, mounting frame, tip offset of a stylus. Nothing is ever
 * written to its EEPROM: switched off and on it is as it was.
 */
#ifndef INCISE_POLHEMUS_SETUP_H
#define INCISE_POLHEMUS_SETUP_H

#include <incise/error.h>
#include <incise/tracker.h>
#include "polhemus_line.h"
#include "polhemus_records.h"

struct polhemus_identity {
	struct polhemus_layout layout; /* its records from now on */
	char name[64];		       /* "FASTRAK 3.02 OutputCompensat CPG2030-003-10" */
	char version[16];
	int sensors;	/* bit 0: station 1 has one; -1: not known */
	int test_error; /* of its self-test, which it did when it was switched on */
};

/*
 * Set up and let records flow. Blocks, for a second or two.
 *
 * 0; -ENODEV (gone), -EIO (not taken; no tracker), -EINVAL (a command refused; a setup that
 * the family has not), -ETIMEDOUT (no answer), -EBUSY; and the line in @err.
 */
int polhemus_setup(struct polhemus_line *line, const struct incise_tracker_setup *setup,
		   struct polhemus_identity *identity, const char *where,
		   struct incise_error *err);

/* Only ask a serial line who is there; nothing is changed, but a stream ends. As above. */
int polhemus_identify(struct polhemus_line *line, struct polhemus_identity *identity,
		      const char *where, struct incise_error *err);

/* No more records; what went wrong does not matter any more. */
void polhemus_stop(struct polhemus_line *line, enum polhemus_family family);

#endif
