/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Largest stable stiffness of a virtual wall: a spring and a damper in a sampled loop.
 *
 *   position  x_k ──▶ f = -K x_k - B (x_k - x_{k-1})/T ──▶ delay_ticks ──▶ held for T
 *      ▲                                                                      │
 *      └── device: mass, viscous damping b, Coulomb friction c, encoder Δ ◀───┘
 *
 * Between samples the held force belongs to a past position of the device. On the way in it is
 * too small, on the way out too large: each press generates energy of about K T u X. The
 * damping of the device must dissipate it; otherwise the wall vibrates.
 *
 * Forces in N, lengths in mm, times in s: stiffness in N/mm (= kN/m), damping in N s/mm. The
 * functions have no state and allocate nothing; for a device out of range they return 0.
 */
#ifndef INCISE_STABILITY_H
#define INCISE_STABILITY_H

#include <incise/export.h>

INCISE_BEGIN_DECLS

#define INCISE_STABILITY_DELAY_MAX 64 /**< ticks */

/** A haptic device in a sampled loop. */
struct incise_haptic_device {
	double mass_kg;	       /**< > 0 */
	double damping_N_s_mm; /**< viscous, b ≥ 0 */
	double coulomb_N;      /**< dry friction, c ≥ 0 */
	double encoder_mm;     /**< resolution of the position, Δ ≥ 0; 0: continuous */
	double period_s;       /**< period of the loop, T > 0 */
	int delay_ticks; /**< until a force takes effect, 0 … INCISE_STABILITY_DELAY_MAX */
};

/**
 * Exact limit of the stiffness of a stable wall on the device alone, without Coulomb friction
 * and encoder.
 *
 * It is the smallest K at which an eigenvalue of the loop's state matrix
 *
 *   x' = x + a w + c u    w = v T, u = f T²/m, δ = b T/m, p = e^-δ,
 *   w' = p w + a u        a = (1-p)/δ, c = (1-a)/δ
 *
 * with the delay's states reaches the unit circle, to about 12 digits for b T/m of 1e-6 to
 * 100. With B = 0 and no delay: min{δ(1-p)/(1-p-pδ), 2(1+p)/(1+p-2(1-p)/δ)} b/T.
 *
 * @param damping_N_s_mm damping of the wall, B, by backward difference; may be < 0
 * @return N/mm; 0 if every wall is unstable. Takes up to a millisecond.
 */
INCISE_API double incise_stability_limit(const struct incise_haptic_device *device,
					 double damping_N_s_mm);

/**
 * Limit of the stiffness of a passive wall: it is stable in every passive hand. Colgate and
 * Schenkel, Passivity of a class of sampled-data systems, J. Robotic Systems 14 (1997): b > K
 * (T/2 + t_d) + |B|. Exact without delay or without B; with both it is sufficient, but not
 * necessary.
 *
 * @param damping_N_s_mm damping of the wall, B @return N/mm, ≥ 0
 */
INCISE_API double incise_stability_colgate(const struct incise_haptic_device *device,
					   double damping_N_s_mm);

/**
 * Limit of the stiffness at which friction dissipates the energy of sampling and encoder
 * quantisation: min(2b/T, 2c/Δ). Abbott and Okamura, Effects of position quantization and
 * sampling rate on virtual-wall passivity, IEEE Trans. Robotics 21 (2005). For a spring
 * without damper and delay.
 *
 * @return N/mm, ≥ 0
 */
INCISE_API double incise_stability_quantisation(
	const struct incise_haptic_device *device);

INCISE_END_DECLS
#endif
