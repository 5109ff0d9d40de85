/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Sets a tracker up, reads every setting back, and starts and stops its records.
 *
 * Set are binary output, centimetres, items, stations, hemisphere, no filters, no
 * increment (it would hold records back), a stylus button that is only reported (else it
 * stops the stream) and the sync mode. Not changed are alignment, boresight, mounting
 * frame and tip offset of a stylus, which a user may have set on purpose: those that can be
 * read are noted. (B of a FASTRAK sets the boresight; G reads its angles alone.) Nothing is
 * written to the EEPROM: power off and on restores the old settings.
 */
#ifndef INCISE_POLHEMUS_SETUP_H
#define INCISE_POLHEMUS_SETUP_H

#include <incise/error.h>
#include <incise/tracker.h>
#include "polhemus_line.h"
#include "polhemus_records.h"

struct polhemus_identity {
	struct polhemus_layout layout; /* of its records from now on */
	char name[64];		       /* "FASTRAK 3.02 OutputCompensat CPG2030-003-10" */
	char version[16];
	char note[300]; /* see struct incise_tracker_info */
	int sensors;	/* bit 0: station 1 has one; -1: not known */
	int test_error; /* of the self-test at power-on */
};

/*
 * Set up and start records. Blocks for a second or two.
 *
 * 0; -ENODEV (gone), -EIO (not taken; no tracker), -EINVAL (a command refused; a setup
 * that the family does not have), -ETIMEDOUT (no answer), -EBUSY; message in @err.
 */
int polhemus_setup(struct polhemus_line *line, const struct incise_tracker_setup *setup,
		   struct polhemus_identity *identity, const char *where,
		   struct incise_error *err);

/*
 * Only identify the tracker; no setting is changed, but a stream ends. Errors as above.
 */
int polhemus_identify(struct polhemus_line *line, struct polhemus_identity *identity,
		      const char *where, struct incise_error *err);

/* Stop records; errors are ignored. */
void polhemus_stop(struct polhemus_line *line, enum polhemus_family family);

#endif
