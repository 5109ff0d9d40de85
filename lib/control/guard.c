// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Passivity observer and controller; see incise/guard.h. N, mm, s.
 */
#include <string.h>
#include "guard.h"
#include "../base/units.h"
#include "../base/vector.h"

/* More than any hand has: so that sums stay numbers. */
#define DEBT_N_mm 1e30

void incise_guard_init(struct incise_guard *guard, double mass_kg, double period_s,
		       double reserve_N_mm)
{
	double cap = INCISE_GUARD_SHARE * mass_kg * N_S2_PER_MM_KG / period_s;

	memset(guard, 0, sizeof(*guard));
	if (!(mass_kg > 0) || !(period_s > 0) || !(reserve_N_mm > 0) || !isfinite(cap) ||
	    !isfinite(reserve_N_mm))
		return;
	guard->cap_N_s_mm = cap;
	guard->reserve_N_mm = reserve_N_mm;
	guard->period_s = period_s;
}

void incise_guard_reset(struct incise_guard *guard)
{
	guard->energy_N_mm = 0;
	guard->damping_N_s_mm = 0;
	guard->placed = guard->watching = false;
}

void incise_guard_discontinuity(struct incise_guard *guard)
{
	guard->placed = false;
}

static void observe(struct incise_guard *guard, const double position_mm[3])
{
	double way[3], energy = guard->energy_N_mm;

	if (!v3_finite(position_mm)) {
		/* What happens until the next good position is not known. */
		guard->placed = false;
		return;
	}
	if (guard->placed && guard->watching) {
		v3_sub(way, position_mm, guard->position_mm);
		energy -= v3_dot(guard->force_N, way);
		/* fmax() and fmin() drop what is no number, which huge products can give. */
		if (!isnan(energy))
			guard->energy_N_mm =
				fmax(-DEBT_N_mm, fmin(guard->reserve_N_mm, energy));
	}
	v3_copy(guard->position_mm, position_mm);
	guard->placed = true;
}

bool incise_guard_apply(struct incise_guard *guard, const double position_mm[3],
			const double velocity_mm_s[3], double force_N[3])
{
	double speed2, damping, damped[3];

	guard->damping_N_s_mm = 0;
	if (!(guard->cap_N_s_mm > 0) || !(guard->reserve_N_mm > 0))
		return false;
	observe(guard, position_mm);
	speed2 = v3_dot(velocity_mm_s, velocity_mm_s);
	if (!(guard->energy_N_mm < 0) || !(speed2 > 0))
		return false;
	damping =
		fmin(guard->cap_N_s_mm, -guard->energy_N_mm / (guard->period_s * speed2));
	v3_add(damped, force_N, -damping, velocity_mm_s);
	if (!(damping > 0) || !v3_finite(damped))
		return false;
	v3_copy(force_N, damped);
	guard->damping_N_s_mm = damping;
	return true;
}

void incise_guard_sent(struct incise_guard *guard, const double force_N[3])
{
	guard->watching = v3_finite(force_N);
	if (guard->watching)
		v3_copy(guard->force_N, force_N);
}
