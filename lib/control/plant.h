/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A mass with friction in front of a wall, without a time step of its own: the motion of a haptic device
 * under a held force, to rounding. For simulators and benches.
 *
 *            held force ──▶ ┌──────┐
 *   wall ▒┤├─/\/\/──        │ mass │  viscous damping, Coulomb friction
 *        ▒                  └──────┘
 *        ──────────────┼──────┼─────────▶ x
 *                    wall     x
 *
 * Between two events all is linear, and its closed form is evaluated, however many time
 * constants or oscillations a period has. Events are where the velocity turns, which
 * Coulomb friction notices and where it may hold the mass, and where the mass meets or
 * leaves the wall. The first have a closed form too; the second are roots of a function
 * that is monotone between the first, found to neighbouring numbers.
 *
 * The same in fewer words: x'' m = f - b x' - c sign(x') - [x < wall] (K (x-wall) + B x').
 * The wall's damper also pulls, at the end of a contact.
 *
 * Lengths in mm, forces in N, times in s. No allocation.
 */
#ifndef INCISE_PLANT_H
#define INCISE_PLANT_H

#include <stdbool.h>

/* Zero it, then set its members; all of them may be changed between two steps. */
struct incise_plant {
	double mass_kg;	       /* > 0 */
	double damping_N_s_mm; /* viscous, ≥ 0 */
	double coulomb_N;      /* dry friction, sliding and holding, ≥ 0 */
	double wall_N_mm;      /* stiffness of a continuous wall, ≥ 0 */
	double wall_N_s_mm;    /* damping of the wall, ≥ 0 */
	double wall_mm;	       /* the wall is at x < wall_mm */
	bool tied;	       /* the wall pulls too: a spring with its rest at wall_mm */
	double position_mm;
	double velocity_mm_s;
};

/*
 * Go on for a period under a constant force.
 *
 * With settings out of their ranges or not finite, or a force or period that is not finite, position and
 * velocity become NaN. After a million events in one period its rest is left out.
 *
 * @param force_N  held, on the mass, besides the wall's
 * @param period_s ≥ 0
 */
void incise_plant_step(struct incise_plant *plant, double force_N, double period_s);

#endif
