// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Lens and pose: from mm of a board to pixels and back; see board_lens.h.
 */
#include <math.h>
#include <string.h>
#include "../base/vector.h"
#include "board_lens.h"

#define BACK_ROUNDS 50 /* it converges by a factor of 5 to 100 a round */

void board_rotation(const double v[3], double r[9])
{
	double angle = sqrt(v3_dot(v, v)), s, c;

	/* sin(a)/a and (1 - cos a)/a², whose quotients lose digits near 0 */
	s = angle > 1e-4 ? sin(angle) / angle : 1 - angle * angle / 6;
	c = angle > 1e-4 ? (1 - cos(angle)) / (angle * angle) : 0.5 - angle * angle / 24;
	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++)
			r[3 * i + j] = c * v[i] * v[j] + (i == j ? cos(angle) : 0);
	r[1] -= s * v[2];
	r[2] += s * v[1];
	r[3] += s * v[2];
	r[5] -= s * v[0];
	r[6] -= s * v[1];
	r[7] += s * v[0];
}

void board_rotation_vector(const double r[9], double v[3])
{
	double axis[3] = {r[7] - r[5], r[2] - r[6], r[3] - r[1]};
	double twice_sin = sqrt(v3_dot(axis, axis)), twice_cos = r[0] + r[4] + r[8] - 1;
	double angle = atan2(twice_sin, twice_cos);

	if (twice_sin > 1e-6) {
		for (int i = 0; i < 3; i++)
			v[i] = axis[i] / twice_sin * angle;
		return;
	}
	memset(v, 0, 3 * sizeof(*v));
	if (twice_cos > 0)
		return;
	/* Half a turn: R = 2 a aᵀ - I; the column of the longest component has the signs. */
	int k = r[0] > r[4] ? (r[0] > r[8] ? 0 : 2) : (r[4] > r[8] ? 1 : 2);
	double largest = sqrt(fmax(0, (r[4 * k] + 1) / 2));

	for (int i = 0; i < 3; i++)
		v[i] = M_PI * (i == k ? largest : r[3 * i + k] / 2 / largest);
}

/* Brown: radial, then tangential. */
static void bend(const struct incise_board_lens *l, const double at[2], double to[2])
{
	double x = at[0], y = at[1], r2 = x * x + y * y;
	double radial = 1 + r2 * (l->k1 + r2 * l->k2);

	to[0] = x * radial + 2 * l->p1 * x * y + l->p2 * (r2 + 2 * x * x);
	to[1] = y * radial + l->p1 * (r2 + 2 * y * y) + 2 * l->p2 * x * y;
}

void board_project(const union board_lens *lens, const double r[9], const double t[3],
		   const double mm[2], double px[2])
{
	double p[3], at[2], to[2];

	for (int i = 0; i < 3; i++)
		p[i] = r[3 * i] * mm[0] + r[3 * i + 1] * mm[1] + t[i];
	at[0] = p[0] / p[2];
	at[1] = p[1] / p[2];
	bend(&lens->by_name, at, to);
	px[0] = lens->by_name.fx * to[0] + lens->by_name.cx;
	px[1] = lens->by_name.fy * to[1] + lens->by_name.cy;
}

void board_undistort(const union board_lens *lens, const double px[2], double ray[2])
{
	const struct incise_board_lens *l = &lens->by_name;
	double want[2] = {(px[0] - l->cx) / l->fx, (px[1] - l->cy) / l->fy}, to[2];

	ray[0] = want[0];
	ray[1] = want[1];
	for (int round = 0; round < BACK_ROUNDS; round++) {
		bend(l, ray, to);
		ray[0] += want[0] - to[0];
		ray[1] += want[1] - to[1];
		if (fabs(want[0] - to[0]) + fabs(want[1] - to[1]) < 1e-15)
			break;
	}
}

void board_meet(const union board_lens *lens, const double pose[BOARD_POSE],
		const double px[2], double mm[2])
{
	double r[9], ray[3] = {0, 0, 1}, back[2][3], far, normal[3];
	const double *t = pose + 3;

	board_undistort(lens, px, ray);
	board_rotation(pose, r);
	for (int i = 0; i < 3; i++)
		normal[i] = r[3 * i + 2];
	far = v3_dot(normal, t) / v3_dot(normal, ray);
	for (int k = 0; k < 2; k++) {
		mm[k] = 0;
		for (int i = 0; i < 3; i++) {
			back[k][i] = r[3 * i + k];
			mm[k] += back[k][i] * (far * ray[i] - t[i]);
		}
	}
}
