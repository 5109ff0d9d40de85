/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Closed forms about a sampled wall that benchmarks compare with simulation; see
 * incise/stability.h.
 */
#ifndef INCISE_STABILITY_PRIVATE_H
#define INCISE_STABILITY_PRIVATE_H

#include <incise/stability.h>

/*
 * The linear law: K < (b + B)/(T/2 + t_d), what incise_stability_limit() tends to for
 * small (b + B) T/m. Gil, Avello, Rubio, Flórez, Stability analysis of a 1 DOF haptic
 * interface, IEEE Trans. Control Systems Technology 12 (2004); Hulin, Preusche, Hirzinger,
 * Stability boundary for haptic rendering, IROS 2006.
 *
 * @param damping_N_s_mm of the wall, B
 * @return N/mm, ≥ 0
 */
double incise_stability_gil(const struct incise_haptic_device *device,
			    double damping_N_s_mm);

/*
 * Amplitude below which Coulomb friction lets an oscillation at the wall die, and above
 * which it grows: X* = 4c / (π √(K/m) (K (T/2 + t_d) - b)), by describing function. Within
 * 3 % for √(K/m) T up to 0.32.
 *
 * @param stiffness_N_mm of a spring that pulls as well as pushes, > 0
 * @return mm; infinite when every oscillation dies: K (T/2 + t_d) ≤ b
 */
double incise_stability_amplitude(const struct incise_haptic_device *device,
				  double stiffness_N_mm);

/*
 * Energy that a spring gives to the hand beyond what was pressed into it, on the way to a
 * depth and back at one speed: E = K (T + 2 t_d) u X, on average over where between two
 * samples the contact starts. The device's damping takes 2 b u X.
 *
 * @param stiffness_N_mm ≥ 0
 * @param speed_mm_s     ≥ 0
 * @param depth_mm       ≥ 0
 * @return N mm
 */
double incise_stability_leak(const struct incise_haptic_device *device,
			     double stiffness_N_mm, double speed_mm_s, double depth_mm);

#endif
