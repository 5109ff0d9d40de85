/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of an incision: what lib/scene sets of it. See incise/incision.h.
 */
#ifndef INCISE_TISSUE_INCISION_H
#define INCISE_TISSUE_INCISION_H

#include <incise/incision.h>

/* Of a scene's groups tissue and tool. */
struct incise_incision_setup {
	double cut_from_mm; /* the blade cuts where it is deeper */
	double stretch_mm;  /* elastic part of an opening */
	int cuts_most;	    /* 1 … */
	double side[3]; /* normal of the flat side of blade and handle, in their frame */
	double handle_width_mm, handle_thickness_mm, tube_mm;
};

/* @return incision; NULL with errno ENOMEM. */
struct incise_incision *incise_incision_make(const struct incise_incision_setup *setup,
					     struct incise_error *err);

/* Memory that it holds, bytes. */
size_t incise_incision_memory(const struct incise_incision *incision);

/* Forget all cuts; no tool is in it. */
void incise_incision_clear(struct incise_incision *incision) INCISE_REALTIME;

/* Add a cut of another one. Returns whether there was room. */
bool incise_incision_add(struct incise_incision *incision,
			 const struct incise_cut *cut) INCISE_REALTIME;

/* The opening that a handle or tube met at the last tick, before that widened it. */
const struct incise_opening *incise_incision_met(const struct incise_incision *incision)
	INCISE_REALTIME;

/*
 * The share of a handle's width or a tube's diameter that an opening must still give, 0 … 1: of a
 * handle 1 where nothing has widened the cut, of a tube less, as the tissue stretches; 0 where it
 * is as wide as the tool less what the tissue stretches.
 */
double incise_incision_tightness(const struct incise_incision *incision,
				 const struct incise_opening *opening,
				 enum incise_tool tool) INCISE_REALTIME;

#endif
