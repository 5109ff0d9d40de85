/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The curve that is fitted to an end of the handle: a step along the axis, blurred, from
 * the handle's level to that of what is beyond. Pixels and levels.
 */
#ifndef INCISE_STEP_H
#define INCISE_STEP_H

#include <opencv2/core.hpp>

namespace vision
{

enum { PLACE, BLUR, INSIDE, BEYOND, RISE, RISES = 5, UNKNOWNS = RISE + RISES };

typedef cv::Vec<double, UNKNOWNS> unknowns;
typedef cv::Matx<double, UNKNOWNS, UNKNOWNS> equations;

/* Where the step is, sd of the blur, level of the handle, level beyond at the edge; what this
 * rises by farther out, over each rise_px. */
struct curve {
	unknowns p;
	double level; /* from here on it may rise */
};

/* A mean of pixels. */
struct bin {
	double x, y, weight;
};

/* The curve at @x, and by @d its derivatives, where that is not NULL. */
double at(const curve &c, double x, unknowns *d);

/* Where the level beyond begins to wander, past the blur. */
double level_from(const curve &c);

/*
 * Least squares, from @c, which is nearly right: Levenberg-Marquardt. @noise: of a pixel.
 * @variance: of PLACE, over that of a mean of weight 1.
 */
bool fit(const bin *bins, int n, double noise, curve &c, double *variance);

} // namespace vision

#endif
