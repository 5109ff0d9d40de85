// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A straight line in the surface; see line.h.
 */
#include "../base/vector.h"
#include "line.h"

/* Below this the blade lies flat on the surface, and its cut has no direction. */
#define FLAT 1e-3

void incise_line_begin(struct incise_line *line, const double at_mm[3],
		       const double normal[3], const double side[3])
{
	double along[3];

	*line = (struct incise_line){.there = true, .along = {1, 0, 0}};
	v3_copy(line->at_mm, at_mm);
	v3_copy(line->side, side);
	v3_cross(along, side, normal);
	if (!v3_unit(line->along, along, FLAT))
		v3_any_across(line->along, normal);
}

static double along_mm(const struct incise_line *line, const double at_mm[3])
{
	double off[3];

	v3_sub(off, at_mm, line->at_mm);
	return v3_dot(off, line->along);
}

void incise_line_extend(struct incise_line *line, const double at_mm[3])
{
	double s = along_mm(line, at_mm);

	line->from_mm = fmin(line->from_mm, s);
	line->to_mm = fmax(line->to_mm, s);
}

bool incise_line_holds(const struct incise_line *line, const double at_mm[3],
		       double reach_mm)
{
	double off[3], s;

	if (!line->there)
		return false;
	s = along_mm(line, at_mm);
	s = fmax(line->from_mm, fmin(line->to_mm, s));
	v3_sub(off, at_mm, line->at_mm);
	v3_add(off, off, -s, line->along);
	return v3_length(off) <= reach_mm;
}
