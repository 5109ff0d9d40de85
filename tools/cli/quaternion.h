/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Unit quaternions, w first, as a tracker gives them.
 */
#ifndef INCISE_TOOLS_QUATERNION_H
#define INCISE_TOOLS_QUATERNION_H

/* v turned by q: v + 2 w (u × v) + 2 u × (u × v), where u is (x, y, z); to is not v. */
static inline void quaternion_turn(double to[3], const double q[4], const double v[3])
{
	double across[3];

	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		across[i] = q[1 + j] * v[k] - q[1 + k] * v[j];
	}
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		to[i] = v[i] + 2 * q[0] * across[i] +
			2 * (q[1 + j] * across[k] - q[1 + k] * across[j]);
	}
}

#endif
