/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The surgeon of the virtual rig: the position of the blade as a function of the script's time
 * alone, continuously differentiable; or, with one motion, as a program holds it.
 */
#ifndef INCISE_SIM_SURGEON_H
#define INCISE_SIM_SURGEON_H

#include <stdatomic.h>
#include <incise/sim.h>

/* Values of the key `motion`. */
enum incise_surgeon_motion {
	INCISE_SURGEON_CUTS,
	INCISE_SURGEON_TURNS,
	INCISE_SURGEON_PRESSES,
	INCISE_SURGEON_HAND,
};

/* Values of the key `withdrawal`. */
enum incise_tissue_withdrawal { INCISE_TISSUE_DISSIPATIVE, INCISE_TISSUE_PAPER };

/*
 * A hand that holds the scalpel where a program puts it, a mouse for example. Another thread
 * reads the newest pose, always a whole one, and neither waits.
 */
struct incise_hand {
	_Atomic uint64_t turn; /* the pose of turn n is in pose[n % 2] */
	/* Position, velocity, quaternion; writing leaves the current pose alone. */
	_Atomic double pose[2][10];
};

/* In the air, at rest. */
void incise_hand_init(struct incise_hand *hand);

/* For one thread. */
void incise_hand_move(struct incise_hand *hand, const double position_mm[3],
		      const double velocity_mm_s[3], const double quaternion[4]);

/* For any thread. */
void incise_hand_look(const struct incise_hand *hand, double position_mm[3],
		      double velocity_mm_s[3], double quaternion[4]) INCISE_REALTIME;

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
	int boundary;	       /* number of the cut that selects the tissue's boundary */
	double slab;	       /* how far along the slab, 0 fixed end … 1 free end */
	double position_mm[3]; /* of the tip */
	double velocity_mm_s[3];
	double speed_mm_s;
	double depth_mm; /* below the surface, else 0 */
	double side[3];	 /* of the blade's flat side, across the cut */
};

/* @config must outlive @surgeon. */
void incise_surgeon_init(struct incise_surgeon *surgeon,
			 const struct incise_sim_config *config);

/* Length of the script. */
int64_t incise_surgeon_duration(const struct incise_surgeon *surgeon);

/* @t_ns since the script's start. */
void incise_surgeon_blade(const struct incise_surgeon *surgeon, int64_t t_ns,
			  struct incise_blade *blade) INCISE_REALTIME;

/*
 * Attitude of the scalpel: its axes in the frame of incise/sim.h. Its z runs from the tip
 * up the handle, its x along the edge in the direction of the cut, its y across the flat.
 */
void incise_surgeon_grip(const struct incise_surgeon *surgeon, int64_t t_ns,
			 double quaternion[4]) INCISE_REALTIME;

#endif
