/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Comparison of samples of the library with records that the emulator sent.
 */
#ifndef INCISE_TEST_POLHEMUS_SENT_H
#define INCISE_TEST_POLHEMUS_SENT_H

#include <math.h>
#include <stdbool.h>
#include <incise/tracker.h>
#include "emulator.h"

/* Whether a sample is what the emulator sent in this slot, to the float's last digit. */
static inline bool polhemus_is_sent(const struct incise_tracker_sample *s,
				    const struct emulator_sent *sent)
{
	struct emulator_pose pose = emulator_pose(sent->slot, sent->station);

	for (int i = 0; i < 3; i++)
		if (s->position_mm[i] != (double)pose.xyz_cm[i] * 10)
			return false;
	/* It is made unit: the float's rounding, 4 times 6e-8. */
	for (int i = 0; i < 4; i++)
		if (fabs(s->quaternion[i] - (double)pose.q[i]) > 5e-7)
			return false;
	return s->station == sent->station && s->button == pose.button &&
	       s->status == pose.error;
}

#endif
