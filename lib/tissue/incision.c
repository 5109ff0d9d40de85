// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The incision for readers of ticks; see incise/incision.h. All memory is allocated at the
 * start.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "incision.h"

/* Values beyond are no place and no depth. */
#define PLACE_MOST_MM 1e6

struct incise_incision {
	struct incise_double_incision_setup setup;
	double side[3];
	struct incise_double_incision *cuts; /* behind this */
};

static size_t size_of_incision(const struct incise_double_incision_setup *setup)
{
	return sizeof(struct incise_incision) + sizeof(struct incise_double_incision) +
	       (size_t)setup->cuts_most * sizeof(struct incise_cut);
}

struct incise_incision *incise_incision_make(
	const struct incise_double_incision_setup *setup, const double side[3],
	struct incise_error *err)
{
	struct incise_incision *incision = calloc(1, size_of_incision(setup));

	if (!incision)
		return INCISE_ERROR_NULL(err, ENOMEM,
					 "no memory for an incision of %d cuts",
					 setup->cuts_most);
	incision->setup = *setup;
	v3_copy(incision->side, side);
	incision->cuts = (struct incise_double_incision *)(void *)(incision + 1);
	return incision;
}

void incise_incision_free(struct incise_incision *incision)
{
	free(incision);
}

size_t incise_incision_memory(const struct incise_incision *incision)
{
	return size_of_incision(&incision->setup);
}

struct incise_double_incision *incise_incision_of(struct incise_incision *incision)
{
	return incision->cuts;
}

int incise_incision_cuts(const struct incise_incision *incision)
{
	return incision->cuts->n;
}

const struct incise_cut *incise_incision_cut(const struct incise_incision *incision,
					     int i)
{
	return i >= 0 && i < incision->cuts->n ? &incision->cuts->cut[i] : NULL;
}

int incise_cut_place(double at_mm)
{
	double half_mm = INCISE_CUT_PLACES * INCISE_CUT_SPACING_MM / 2;
	double place = floor((at_mm + half_mm) / INCISE_CUT_SPACING_MM);

	return (int)fmin(fmax(place, 0), INCISE_CUT_PLACES - 1);
}

void incise_incision_opening(const struct incise_incision *incision,
			     enum incise_tool tool, const double at_mm[3],
			     struct incise_opening *opening)
{
	incise_double_incision_find(incision->cuts, &incision->setup, tool, at_mm,
				    opening);
}

/* In the tissue with numbers that a hand can have. */
static bool counts(const struct incise_tick *tick)
{
	double turned = 0;

	for (int i = 0; i < 3; i++)
		if (!(fabs(tick->proxy_mm[i]) <= PLACE_MOST_MM))
			return false;
	for (int i = 0; i < 4; i++)
		turned += tick->quaternion[i] * tick->quaternion[i];
	/* Unit vectors, but for rounding. */
	return fabs(turned - 1) < 1e-3 &&
	       fabs(v3_dot(tick->normal, tick->normal) - 1) < 1e-3 && tick->depth_mm >= 0;
}

bool incise_incision_tick(struct incise_incision *incision,
			  const struct incise_tick *tick)
{
	struct incise_double_incision *cuts = incision->cuts;
	double side[3];

	if (tick->phase == INCISE_PHASE_FREE || !counts(tick)) {
		incise_double_incision_leave(cuts);
		return true;
	}
	v3_rotate(side, tick->quaternion, incision->side);
	if (tick->phase == INCISE_PHASE_CUTTING)
		return incise_double_incision_cut(cuts, &incision->setup, tick->proxy_mm,
						  tick->normal, side, tick->depth_mm);
	incise_double_incision_open(cuts, &incision->setup, tick->tool, tick->proxy_mm,
				    side, tick->depth_mm);
	return true;
}
