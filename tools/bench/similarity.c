// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * How alike two pictures are; see similarity.h.
 */
#include <math.h>
#include <stddef.h>
#include "similarity.h"

#define SIDE 8

static double rms_of(const uint8_t *a, const uint8_t *b, size_t n)
{
	uint64_t sum = 0;

	for (size_t i = 0; i < n; i++) {
		int d = a[i] - b[i];

		sum += (uint64_t)(d * d);
	}
	return sqrt((double)sum / (double)n);
}

/* Rec. 601, in 256ths. */
static int luma(const uint8_t *p)
{
	return 77 * p[0] + 150 * p[1] + 29 * p[2];
}

static double window(const uint8_t *a, const uint8_t *b, size_t row)
{
	const double n = SIDE * SIDE, c1 = 0.01 * 255 * 0.01 * 255,
		     c2 = 0.03 * 255 * 0.03 * 255;
	int64_t sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
	double ma, mb, va, vb, cov;

	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			int64_t p = luma(a + y * row + 3 * x),
				q = luma(b + y * row + 3 * x);

			sa += p;
			sb += q;
			saa += p * p;
			sbb += q * q;
			sab += p * q;
		}
	ma = sa / n;
	mb = sb / n;
	va = (saa / n - ma * ma) / 65536;
	vb = (sbb / n - mb * mb) / 65536;
	cov = (sab / n - ma * mb) / 65536;
	ma /= 256;
	mb /= 256;
	return (2 * ma * mb + c1) * (2 * cov + c2) /
	       ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

struct similarity similarity_of(const uint8_t *a, const uint8_t *b, int width, int height)
{
	size_t row = 3 * (size_t)width;
	double sum = 0;
	int n = 0;

	for (int y = 0; y + SIDE <= height; y += SIDE)
		for (int x = 0; x + SIDE <= width; x += SIDE, n++)
			sum += window(a + y * row + 3 * (size_t)x,
				      b + y * row + 3 * (size_t)x, row);
	return (struct similarity){.rms = rms_of(a, b, row * (size_t)height),
				   .ssim = sum / n};
}
