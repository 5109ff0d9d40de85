/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Numbers that look random and are a function of where, or of which: so nothing depends on
 * the order in which they are asked for.
 */
#ifndef INCISE_VIEW_GRAIN_H
#define INCISE_VIEW_GRAIN_H

#include <math.h>
#include <stdint.h>

/* -1 … 1 at a point of a grid; cheap, for pixels. */
static inline float noise_grid(uint32_t key, int x, int y)
{
	uint32_t h = key ^ ((uint32_t)x * 0x8da6b343u) ^ ((uint32_t)y * 0xd8163841u);

	h = (h ^ (h >> 15)) * 0x2c1b3c6du;
	h = (h ^ (h >> 12)) * 0x297a2d39u;
	h ^= h >> 15;
	return (float)(h >> 8) * (2.0f / 16777216.0f) - 1.0f;
}

/* -1 … 1, smooth between the points of a grid; x and y within ±1e9. */
static inline float noise_smooth(uint32_t key, float x, float y)
{
	float fx = floorf(x), fy = floorf(y);
	int ix = (int)fx, iy = (int)fy;
	float u = x - fx, v = y - fy;
	float a, b;

	u = u * u * (3 - 2 * u);
	v = v * v * (3 - 2 * v);
	a = noise_grid(key, ix, iy) * (1 - u) + noise_grid(key, ix + 1, iy) * u;
	b = noise_grid(key, ix, iy + 1) * (1 - u) + noise_grid(key, ix + 1, iy + 1) * u;
	return a * (1 - v) + b * v;
}

#endif
