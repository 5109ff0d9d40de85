// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Blade, handle or tube; see instrument.h.
 */
#include "../base/vector.h"
#include "instrument.h"

/*
 * sin of the angle between the scalpel and the surface, to either side, within which it
 * stays what it was: 12° are more than a hand's tremor.
 */
#define UNDECIDED 0.2

static enum incise_tool by_place(const struct incise_instrument *instrument,
				 const double attitude[4], const double normal[3])
{
	double axis[3], up;

	if (instrument->tube_nearer)
		return INCISE_TOOL_TUBE;
	v3_rotate(axis, attitude, instrument->axis);
	up = v3_dot(axis, normal);
	if (up > UNDECIDED)
		return INCISE_TOOL_BLADE;
	if (up < -UNDECIDED)
		return INCISE_TOOL_HANDLE;
	return instrument->held == INCISE_TOOL_TUBE ? INCISE_TOOL_BLADE
						    : instrument->held;
}

bool incise_instrument_choose(struct incise_instrument *instrument,
			      const double attitude[4], const double normal[3],
			      bool touching)
{
	enum incise_tool before = instrument->held;

	if (touching)
		return false;
	instrument->held = instrument->wanted == INCISE_TOOL_AUTO
				   ? by_place(instrument, attitude, normal)
				   : instrument->wanted;
	return instrument->held != before;
}

bool incise_instrument_waits(const struct incise_instrument *instrument)
{
	if (instrument->wanted == INCISE_TOOL_AUTO)
		return (instrument->held == INCISE_TOOL_TUBE) != instrument->tube_nearer;
	return instrument->wanted != instrument->held;
}

void incise_instrument_end(const struct incise_instrument *instrument,
			   const double tip_mm[3], const double attitude[4],
			   double end_mm[3])
{
	double axis[3];

	v3_copy(end_mm, tip_mm);
	if (instrument->held != INCISE_TOOL_HANDLE)
		return;
	v3_rotate(axis, attitude, instrument->axis);
	v3_add(end_mm, end_mm, instrument->handle_mm, axis);
}
