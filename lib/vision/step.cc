// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A blurred step and its fit; see step.h.
 *
 *                    ____      RISE …: a random walk, where the tissue has a texture
 *               ____/          BEYOND, one level up to here: what rises nearer is the edge
 *             /
 *   _________/ PLACE           INSIDE; BLUR: sd of a Gaussian, beside the pixel's width
 */
#include <algorithm>
#include <cmath>
#include "step.h"

namespace vision
{

enum { PASSES = 15 };

static constexpr double level_px = 2, rise_px = 2;
static constexpr double rise_sd = 1; /* levels, of a step */

static double normal(double x)
{
	return std::exp(-0.5 * x * x) * 0.3989422804014327;
}

static double cumulated(double x)
{
	return 0.5 * std::erfc(-x * 0.7071067811865475);
}

double at(const curve &c, double x, unknowns *d)
{
	double s = c.p[BLUR], a = (x + 0.5 - c.p[PLACE]) / s,
	       b = (x - 0.5 - c.p[PLACE]) / s;
	double ca = b >= 5, cb = ca, na = 0, nb = 0;

	/* Most of it is far from the edge. */
	if (a > -5 && b < 5) {
		ca = cumulated(a);
		cb = cumulated(b);
		na = normal(a);
		nb = normal(b);
	}
	double part = s * (a * ca + na - b * cb - nb); /* of the step, in 0 … 1 */
	double far = (x - c.level) / rise_px, beyond = c.p[BEYOND];

	for (int k = 0; k < RISES; k++)
		beyond += c.p[RISE + k] * std::min(std::max(far - k, 0.0), 1.0);
	double step = beyond - c.p[INSIDE];

	if (d) {
		*d = unknowns();
		(*d)[PLACE] = -step * (ca - cb);
		(*d)[BLUR] = step * (na - nb);
		(*d)[INSIDE] = 1 - part;
		(*d)[BEYOND] = part;
		for (int k = 0; k < RISES; k++)
			(*d)[RISE + k] = part * std::min(std::max(far - k, 0.0), 1.0);
	}
	return c.p[INSIDE] + step * part;
}

double level_from(const curve &c)
{
	return c.p[PLACE] + std::max(level_px, 1.25 * c.p[BLUR]);
}

bool fit(const bin *bins, int n, double noise, curve &c, double *variance)
{
	double damping = 1e-3, best = HUGE_VAL,
	       flat = noise * noise / (rise_sd * rise_sd);
	unknowns start = c.p, gradient;
	equations normal_matrix;
	curve trial = c;

	for (int pass = 0; pass < PASSES; pass++) {
		equations m = equations::zeros();
		unknowns g;
		double sum = 0;

		for (int i = 0; i < n; i++) {
			unknowns d;
			double r = bins[i].y - at(trial, bins[i].x, &d);

			sum += bins[i].weight * r * r;
			for (int k = 0; k < UNKNOWNS; k++) {
				double w = bins[i].weight * d[k];

				g[k] += w * r;
				for (int l = 0; l <= k; l++)
					m(k, l) += w * d[l];
			}
		}
		for (int k = RISE; k < UNKNOWNS; k++) {
			m(k, k) += flat;
			g[k] -= flat * trial.p[k];
			sum += flat * trial.p[k] * trial.p[k];
		}
		for (int k = 0; k < UNKNOWNS; k++)
			for (int l = 0; l < k; l++)
				m(l, k) = m(k, l);
		if (!std::isfinite(sum))
			return false;
		if (sum <= best) {
			/* a hundredth of the sd, for a hundred bins */
			bool settled = best - sum <= 1e-6 * sum;

			best = sum;
			c = trial;
			normal_matrix = m;
			gradient = g;
			damping *= 0.2;
			if (settled)
				break;
		} else {
			damping *= 8;
		}
		/* From the best so far; after a bad step by its old equations. */
		equations damped = normal_matrix;
		for (int k = 0; k < UNKNOWNS; k++)
			damped(k, k) += damping * normal_matrix(k, k) + 1e-9;
		bool ok;
		unknowns by = damped.inv(cv::DECOMP_CHOLESKY, &ok) * gradient;
		if (!ok)
			return false;
		trial.p = c.p + by;
		trial.p[BLUR] = std::min(std::max(trial.p[BLUR], 0.05), 8.0);
		trial.p[PLACE] = std::min(std::max(trial.p[PLACE], start[PLACE] - 8),
					  start[PLACE] + 8);
	}
	bool ok;
	for (int k = 0; k < UNKNOWNS; k++)
		normal_matrix(k, k) += 1e-9;
	*variance = normal_matrix.inv(cv::DECOMP_CHOLESKY, &ok)(PLACE, PLACE);
	return ok && std::fabs(c.p[PLACE] - start[PLACE]) < 7.9;
}

} // namespace vision
