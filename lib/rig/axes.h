/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Axes of a rig: the unit directions along which its actuators push the handle. Together they
 * push with
 *
 *   felt = Σ f[i] direction[i]
 *
 * The f that bring this nearest to a wanted force are its least-squares solution, which is linear
 * in the force: f[i] = dual[i] · force. The duals lie in the span of the directions, with
 * dual[i] · direction[k] = 1 where i = k, else 0. For directions at right angles each is its own
 * dual.
 */
#ifndef INCISE_AXES_H
#define INCISE_AXES_H

/*
 * The duals of @n linearly independent unit directions, 1 … INCISE_RIG_AXES_MAX. 1 / |dual[i]| is
 * the sine of the angle between direction i and the span of the others.
 */
void incise_axes_dual(int n, const double direction[][3], double dual[][3]);

#endif
