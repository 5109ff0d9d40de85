// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The cut as a line in the surface; see incision.h.
 */
#include "../base/vector.h"
#include "incision.h"

/* Below this the blade lies flat on the surface, and its cut has no direction. */
#define FLAT 1e-3

void incise_incision_begin(struct incise_incision *incision, const double at_mm[3],
			   const double normal[3], const double side[3])
{
	double along[3], axis[3] = {0};
	int least = 0;

	*incision = (struct incise_incision){.there = true, .along = {1, 0, 0}};
	v3_copy(incision->at_mm, at_mm);
	v3_copy(incision->side, side);
	v3_cross(along, side, normal);
	if (v3_unit(incision->along, along, FLAT))
		return;
	/* Any direction in the surface: across the axis that is least along the normal. */
	for (int i = 1; i < 3; i++)
		if (fabs(normal[i]) < fabs(normal[least]))
			least = i;
	axis[least] = 1;
	v3_cross(along, axis, normal);
	v3_unit(incision->along, along, FLAT);
}

static double along_mm(const struct incise_incision *incision, const double at_mm[3])
{
	double off[3];

	v3_sub(off, at_mm, incision->at_mm);
	return v3_dot(off, incision->along);
}

void incise_incision_extend(struct incise_incision *incision, const double at_mm[3])
{
	double s = along_mm(incision, at_mm);

	incision->from_mm = fmin(incision->from_mm, s);
	incision->to_mm = fmax(incision->to_mm, s);
}

bool incise_incision_holds(const struct incise_incision *incision, const double at_mm[3],
			   double reach_mm)
{
	double off[3], s;

	if (!incision->there)
		return false;
	s = along_mm(incision, at_mm);
	s = fmax(incision->from_mm, fmin(incision->to_mm, s));
	v3_sub(off, at_mm, incision->at_mm);
	v3_add(off, off, -s, incision->along);
	return v3_length(off) <= reach_mm;
}
