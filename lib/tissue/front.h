/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The front of a cut: tissue that takes work and does not give more of it back. Cutting force
 * laws such as Song et al.'s, F(depth, speed), describe a blade that advances. This adds the way
 * back, in double; lib/fixed/front.h has the same in integers.
 *
 *   force                        c  the model's force: the blade cuts, the front moves with it
 *     |          ____c           u  elastic: the tissue unloads with the stiffness K over
 *     |     _,-'    /               (c + f)/K, and loads again along the same line
 *     |  ,-'      u/         /   f  friction of the open cut, against the motion
 *     | /         /        u/    e  elastic again, from the front on
 *   0 |/________ /___f____,/___▶ depth
 *     |         ´‾‾‾‾‾‾‾‾‾  f
 *
 * In the terms of plasticity it is a stop: force = K (depth - rest), held to -f … upper by
 * moving `rest`; upper is the model's force c at the front, f in the open cut, and rises with
 * K in between. Work is only lost where rest moves, so that any closed motion takes work.
 * Fracture on the way in, small elastic unloading and friction on the way out: Mahvash and
 * Hayward, Haptic rendering of cutting, Haptics-e 2(3), 2001; Okamura, Simone and O'Leary, Force
 * modeling for needle insertion, IEEE Trans. Biomed. Eng. 51(10), 2004; Chanthasopeephan,
 * Desai and Lau, Modeling soft-tissue deformation prior to cutting, IEEE Trans. Biomed. Eng.
 * 54(3), 2007.
 *
 * A blade that moves along the skin meets new tissue at each mm, which the front has not
 * reached: front and rest come up by as much, as long as the elastic energy stays below the work
 * that was put in since the blade entered, a sixteenth of which is never given back. Back within
 * its own cut it meets nothing new.
 *
 * N, mm. All functions are real-time safe.
 */
#ifndef INCISE_FRONT_H
#define INCISE_FRONT_H

#include <incise/export.h>
#include "line.h"

/* A blade so far beside the line of its cut is in new tissue: half the width of a blade. */
#define INCISE_FRONT_BESIDE_MM 1.0

/* Share of the most work put in that no new tissue gives back. */
#define INCISE_FRONT_KEPT 0.0625

/* Begins with {0}. */
struct incise_front {
	double depth_mm, force_N; /* of the last call */
	double rest_mm;		  /* the elastic force is 0 here */
	double cut_mm;		  /* depth of the unloaded cut; ≥ 0 */
	double work_N_mm; /* put in since the blade entered, less what came back */
	double most_N_mm; /* of that, so far */
	struct incise_line line;
};

/*
 * The blade meets the skin: in the cut that it left, which stays, or in a new one.
 *
 * @param at_mm  on the surface; @param normal, side: as incise_line_begin()
 * @return whether the cut is new
 */
bool incise_front_enter(struct incise_front *front, const double at_mm[3],
			const double normal[3], const double side[3]) INCISE_REALTIME;

/* Length of new tissue since the last call, mm: the way of the blade beyond its own cut. */
double incise_front_advance(struct incise_front *front, const double at_mm[3],
			    const double normal[3], const double side[3]) INCISE_REALTIME;

/*
 * The force on the blade, out of the tissue: -friction × cutting_N … cutting_N.
 *
 * @param unloading_N_mm  K > 0
 * @param friction        0 … 1, share of the cutting force
 * @param depth_mm        ≥ 0
 * @param advance_mm      of incise_front_advance(), ≥ 0
 * @param cutting_N       the model's force at this depth and speed, ≥ 0
 */
double incise_front_force(struct incise_front *front, double unloading_N_mm,
			  double friction, double depth_mm, double advance_mm,
			  double cutting_N) INCISE_REALTIME;

#endif
