/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Largest stable stiffness of a virtual wall: a spring and a damper in a sampled loop.
 *
 *   position  x_k ──▶ f = -K x_k - B (x_k - x_{k-1})/T ──▶ delay_ticks ──▶ held for T
 *      ▲                                                                      │
 *      └── device: mass, viscous damping b, Coulomb friction c, encoder Δ ◀───┘
 *
 * Between the samples the held force belongs to where the device was, not to where it is.
 * On the way in it is too small, on the way out too large: every press makes energy, some
 * K T u X. The device's own damping has to take it, or the wall hums.
 *
 * Forces in N, lengths in mm, times in s: stiffness in N/mm (= kN/m), damping in N s/mm.
 * Functions compute and nothing else: no state, no allocation; of a device that cannot be
 * (see its ranges) they say 0.
 */
#ifndef INCISE_STABILITY_H
#define INCISE_STABILITY_H

#include <incise/export.h>

INCISE_BEGIN_DECLS

#define INCISE_STABILITY_DELAY_MAX 64 /**< ticks */

/** A haptic device as the sampled wall sees it. */
struct incise_haptic_device {
	double mass_kg;	       /**< > 0 */
	double damping_N_s_mm; /**< viscous, b ≥ 0 */
	double coulomb_N;      /**< dry friction, c ≥ 0 */
	double encoder_mm;     /**< step of the position, Δ ≥ 0; 0: none */
	double period_s;       /**< of the loop, T > 0 */
	int delay_ticks; /**< until a force takes effect, 0 … INCISE_STABILITY_DELAY_MAX */
};

/**
 * Stiffness up to which the wall alone on the device is stable: exact. Coulomb friction
 * and encoder are left out.
 *
 * It is the least K at which an eigenvalue of the loop's state matrix
 *
 *   x' = x + a w + c u    w = v T, u = f T²/m, δ = b T/m, p = e^-δ,
 *   w' = p w + a u        a = (1-p)/δ, c = (1-a)/δ
 *
 * with the delay's states meets the unit circle, to some 12 digits for b T/m of 1e-6 to
 * 100. With B = 0 and no delay: min{δ(1-p)/(1-p-pδ), 2(1+p)/(1+p-2(1-p)/δ)} b/T.
 *
 * @param damping_N_s_mm of the wall, B, by backward difference; may be < 0
 * @return N/mm; 0 when even the softest wall is unstable. Takes up to a millisecond.
 */
INCISE_API double incise_stability_limit(const struct incise_haptic_device *device,
					 double damping_N_s_mm);

/**
 * Stiffness up to which the wall is passive: stable in whatever hand, as long as the hand
 * is passive itself. Colgate and Schenkel, Passivity of a class of sampled-data systems,
 * J. Robotic Systems 14 (1997): b > K (T/2 + t_d) + |B|. Exact where there is no delay or no
 * B; with both it is enough, but more than is needed.
 *
 * @param damping_N_s_mm of the wall, B
 * @return N/mm, ≥ 0
 */
INCISE_API double incise_stability_colgate(const struct incise_haptic_device *device,
					   double damping_N_s_mm);

/**
 * Stiffness up to which sampling and an encoder's steps make no energy that friction does
 * not take: min(2b/T, 2c/Δ). Abbott and Okamura, Effects of position quantization and
 * sampling rate on virtual-wall passivity, IEEE Trans. Robotics 21 (2005). For a spring
 * without damper and delay.
 *
 * @return N/mm, ≥ 0
 */
INCISE_API double incise_stability_quantisation(
	const struct incise_haptic_device *device);

INCISE_END_DECLS
#endif
