/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What polhemus_setup.c does in the language of a family.
 */
#ifndef INCISE_POLHEMUS_FAMILY_H
#define INCISE_POLHEMUS_FAMILY_H

#include "polhemus_dialogue.h"
#include "polhemus_setup.h"

/* Who is there, once nothing flows; identity->layout.family is set by who calls. */
int polhemus_fastrak_identify(struct polhemus_dialogue *d,
			      struct polhemus_identity *identity);
int polhemus_fastrak_setup(struct polhemus_dialogue *d,
			   const struct incise_tracker_setup *setup,
			   struct polhemus_identity *identity);

/* LIBERTY or PATRIOT: which one is in its frames. */
int polhemus_liberty_identify(struct polhemus_dialogue *d,
			      struct polhemus_identity *identity);
int polhemus_liberty_setup(struct polhemus_dialogue *d,
			   const struct incise_tracker_setup *setup,
			   struct polhemus_identity *identity);

/*
 * Ask for one record of each station with P, which tells that they are as was set. A FASTRAK's
 * layout->switch_bytes is found by it.
 */
int polhemus_measure(struct polhemus_dialogue *d,
		     const struct incise_tracker_setup *setup,
		     struct polhemus_layout *layout);

/* Bit 0 is station 1. */
static inline uint8_t polhemus_mask(const struct incise_tracker_setup *setup)
{
	uint8_t mask = 0;

	for (int i = 0; i < setup->n_stations; i++)
		mask |= (uint8_t)(1 << (setup->stations[i] - 1));
	return mask;
}

#endif
