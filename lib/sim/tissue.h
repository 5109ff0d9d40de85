/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The liver of the virtual rig: the force on a blade that moves through it.
 */
#ifndef INCISE_SIM_TISSUE_H
#define INCISE_SIM_TISSUE_H

#include <incise/export.h>
#include "surgeon.h"

struct incise_tissue {
	const struct incise_sim_config *config;
	uint64_t tooth_key, boundary_key;
	double path_mm;	    /* cut so far */
	double fracture_mm; /* path at the last fracture */
	double tooth_mm;    /* path from there to the next */
	uint64_t teeth;
};

/* @config must outlive @tissue. */
void incise_tissue_init(struct incise_tissue *tissue,
			const struct incise_sim_config *config);

/* Let the blade move on at its speed for a short time. */
void incise_tissue_advance(struct incise_tissue *tissue, const struct incise_blade *blade,
			   double dt_s) INCISE_REALTIME;

/* Force on a blade that has moved on for @ahead_s since the last advance, N. */
double incise_tissue_force(const struct incise_tissue *tissue,
			   const struct incise_blade *blade,
			   double ahead_s) INCISE_REALTIME;

#endif
