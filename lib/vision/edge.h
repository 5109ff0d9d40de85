/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Where an end of the handle is, along its axis, to a few hundredths of a pixel.
 */
#ifndef INCISE_EDGE_H
#define INCISE_EDGE_H

#include <vector>
#include <opencv2/core.hpp>
#include "picture.h"

namespace vision
{

/* A pixel near the end: where it is by the axis and across it, how bright. */
struct sample {
	float u, v, value;
};

struct edge {
	double u;     /* outwards from where it was looked for, on the axis */
	double sd;    /* of u */
	double step;  /* from the handle to what is beyond, levels */
	double noise; /* sd of what the fit leaves, levels */
	double misfit; /* rms by which the means of pixels are off the fit, over step; no noise */
	double kept; /* share of the pixels that it kept */
};

struct edge_search {
	std::vector<sample> samples;
	std::vector<float> sorted, residuals;
};

/*
 * Look along @out, a unit vector, from @end, which is good to some pixels. @half_px: half of
 * the handle's width. Returns NULL, or why there is no edge.
 */
const char *edge_find(edge_search &s, const picture &picture, const cv::Point2d &end,
		      const cv::Point2d &out, double half_px, edge &found);

} // namespace vision

#endif
