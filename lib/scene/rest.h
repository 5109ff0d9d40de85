/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Whether a plan comes to rest: a search by closed loops in time, for what no linear view of a
 * point of rest shows. A model's force depends on |v|, which has a corner at rest, and a
 * tissue that unloads has memory: both can swing for ever where each slope alone is stable.
 *
 *   hand leans ─▶ device ─▶ tracker ─▶ the plan's own stages ─▶ late ticks, slew ─┐
 *                   ▲                                                             │
 *                   └────────────────── held for a tick ◀─────────────────────────┘
 *
 * The device is bare and without dry friction, which is the worst of hands and devices: see
 * incise_hands. It starts in the air above the surface's top and leans along its normal with
 * a constant force up to the scene's limit, while it stands or goes along the skin, which is
 * taken as the plane that touches the top.
 */
#ifndef INCISE_REST_H
#define INCISE_REST_H

#include "../control/pose_loop.h"
#include "plan.h"

/* Outward travel in the last quarter of a run that counts as a swing. */
#define INCISE_REST_SWING_MM 0.01

/* Sd per axis of a magnetic tracker near its source, as predict.h assumes. */
#define INCISE_REST_NOISE_MM 0.02

/* Changes to the plan in a search. */
struct incise_rest_trial {
	double gain;	       /* of all forces, times the plan's; 1: as it is */
	double damping_N_s_mm; /* of the device */
	int way;	       /* of the search, the only one to try; -1: all */
};

struct incise_rest {
	bool rests;
	int runs;
	/* The first run that swings, or the one that took longest to come to rest. */
	double lean_N, along_mm_s;
	double depth_mm, swing_mm, swing_N, settle_s;
	int way; /* of the search */
	/* Range of position and force, of a hand that leans with half of the scene's limit, by
	 * the noise of a tracker: INCISE_REST_NOISE_MM. Of a plan that rests. */
	double noise_mm, noise_N;
};

/*
 * @return 0 or -ENOMEM. Takes 0.1 s. The plan stays as it is; it must be ready to run.
 */
int incise_plan_rest(const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker,
		     const struct incise_rest_trial *trial, struct incise_rest *rest);

/*
 * A hand on a stylus, lighter and firmer: mass, damping and stiffness of the arm that van
 * Beek, Bergmann Tiest, Mugge and Kappers measured in a typical trial (Haptic perception of
 * force magnitude and its relation to postural arm dynamics in 3D, Scientific Reports 5, 18004,
 * 2015, fig. 3: 0.554 kg, 6.45 N s/m, 135 N/m), as it is, a quarter of it, and with four times
 * its damping and stiffness. With each of them a wall may be stiffer than without a hand.
 */
#define INCISE_HANDS 3
extern const struct incise_hand_impedance incise_hands[INCISE_HANDS];

#endif
