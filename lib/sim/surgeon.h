/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The surgeon of the virtual rig: where the blade is at any time of the script, as a
 * function of that time alone. Positions are continuously differentiable.
 */
#ifndef INCISE_SIM_SURGEON_H
#define INCISE_SIM_SURGEON_H

#include <incise/sim.h>
#include "hand.h"

/* Values of the key `motion`. */
enum incise_surgeon_motion {
	INCISE_SURGEON_CUTS,
	INCISE_SURGEON_TURNS,
	INCISE_SURGEON_PRESSES,
	INCISE_SURGEON_HAND,
};

struct incise_surgeon {
	const struct incise_sim_config *config;
	uint64_t key;
	int cuts;
	int64_t cut_ns, pause_ns;
	double tremor_phase[2];
	struct incise_hand hand; /* with that motion */
};

/* The blade at one time. */
struct incise_blade {
	int cut;	       /* under way, or -1 */
	int boundary;	       /* the cut that the tissue's boundary was last made for */
	double slab;	       /* how far along the slab, 0 fixed end … 1 free end */
	double position_mm[3]; /* of the tip */
	double velocity_mm_s[3];
	double speed_mm_s;
	double depth_mm; /* below the surface, else 0 */
};

/* @config stays the caller's and must outlive @surgeon. */
void incise_surgeon_init(struct incise_surgeon *surgeon,
			 const struct incise_sim_config *config);

/* Length of the script. */
int64_t incise_surgeon_duration(const struct incise_surgeon *surgeon);

/* @t_ns since the script's start. */
void incise_surgeon_blade(const struct incise_surgeon *surgeon, int64_t t_ns,
			  struct incise_blade *blade) INCISE_REALTIME;

/*
 * How the scalpel is held: its axes in the frame of incise/sim.h. Its z runs from the tip
 * up the handle, its x along the edge in the direction of the cut, its y across the flat.
 */
void incise_surgeon_grip(const struct incise_surgeon *surgeon, int64_t t_ns,
			 double quaternion[4]) INCISE_REALTIME;

#endif
