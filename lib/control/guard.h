/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The guard of passivity: watches the energy that a rendered force gives to the hand, and
 * damps where more came out of the virtual tissue than was pressed into it.
 *
 *   tick        k              k+1             k+2
 *   ────────────┼───────────────┼───────────────┼──▶ t
 *   apply()     x_k             x_{k+1}
 *   sent()      f_k ───held─────▶
 *                ╰── ΔE = f_k·(x_{k+1} - x_k): exact for a force that is held,
 *                    whatever the hand did in between
 *
 * After Hannaford and Ryu, Time-domain passivity control of haptic interfaces, IEEE
 * Trans. Robotics and Automation 18 (2002): observer W += f·v T + α v² T, controller
 * α = -W/(v² T) where W < 0. Three things differ. The energy is that of the held force,
 * not f·v T at the samples: that misses f² T²/(2m) per tick, which on a bare device is all
 * that a sampled spring makes. α has a cap: damping above m/T turns the velocity round
 * within one period and makes the energy that it should take. And the credit has a bound:
 * what was dissipated long ago does not pay for what is made now. Debt has none: only
 * damping ends it, or a new contact.
 *
 * With the cap a wall of up to 200 kN/m stays bounded even where it answers 15 ticks late,
 * as long as the damping itself acts at once. Damping that takes effect d ticks late is
 * stable below 2 sin(π/(4d+2)) m/T only: 1 for a tick, 0.28 for 5, 0.10 for 15. Lower the
 * cap to half of that for an actuator or a velocity that lags.
 *
 * It is no limit of force: the renderer has one behind it, and reports the force by sent().
 * All functions are real-time safe. An object belongs to one thread.
 */
#ifndef INCISE_GUARD_H
#define INCISE_GUARD_H

#include <stdbool.h>
#include <incise/export.h>

/*
 * Part of m/T that the damping may reach. `incise bench stability` tries others: from 0.5
 * to 1 all is bounded; 0.5 keeps a factor of two for a tick of delay in the velocity.
 */
#define INCISE_GUARD_SHARE 0.5

/* Made by incise_guard_init(). Settings may be changed, state may be read. */
struct incise_guard {
	double cap_N_s_mm;   /* setting: most damping; 0: off */
	double reserve_N_mm; /* setting: most energy that can be owed; 0: off */
	double period_s;     /* setting */
	/* Energy that was pressed in and may come out again, up to reserve_N_mm; below 0:
	 * so much more came out. */
	double energy_N_mm;
	double damping_N_s_mm; /* of the last apply(), 0 … cap_N_s_mm */
	double force_N[3];     /* held since the last apply() */
	double position_mm[3]; /* at the last apply() */
	bool placed;	       /* position_mm is set */
	bool watching;	       /* force_N is set too */
};

/*
 * Begin with no contact.
 *
 * @param mass_kg      moving mass of the device, without the hand; > 0
 * @param period_s     of the loop; > 0
 * @param reserve_N_mm what the tissue can have stored at most: for a spring half of
 *                     largest force times depth. The credit is bounded by it. With 0, or
 *                     when an argument is not a positive number, the guard is off: forces
 *                     pass to the bit.
 */
void incise_guard_init(struct incise_guard *guard, double mass_kg, double period_s,
		       double reserve_N_mm);

/* A contact starts: no energy went in or out yet, no force is held. */
void incise_guard_reset(struct incise_guard *guard) INCISE_REALTIME;

/*
 * The point that is watched is elsewhere now, and did not go there: another end of the
 * instrument, or a discontinuity of the tracker's. Up to the next apply() no energy is
 * counted; debt and credit stay.
 */
void incise_guard_discontinuity(struct incise_guard *guard) INCISE_REALTIME;

/*
 * Once per tick, out of contact too: observe the force that was held since the last call,
 * and add damping to the next one where more energy came out than went in. What a stiff
 * wall made is often seen when the device has left it already; asked in contact only, the
 * guard does not hold walls that it holds otherwise (`incise bench stability` shows it).
 *
 * Arguments that are not finite are neither observed nor damped, and stay as they are.
 *
 * @param position_mm   of the device, the point that the force acts on
 * @param velocity_mm_s of the same
 * @param force_N       on the device; damping is added
 * @return whether damping was added
 */
bool incise_guard_apply(struct incise_guard *guard, const double position_mm[3],
			const double velocity_mm_s[3], double force_N[3]) INCISE_REALTIME;

/*
 * Set the force that is really held from now on, after limits. Where an actuator takes some
 * ticks, this is the force that takes effect now. Without a call the last one counts as held.
 */
void incise_guard_sent(struct incise_guard *guard,
		       const double force_N[3]) INCISE_REALTIME;

#endif
