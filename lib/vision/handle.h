/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The handle in a picture: what has its colour, hangs together, is long and has straight
 * sides. Good to a pixel or two along the axis; edge.h is finer.
 */
#ifndef INCISE_HANDLE_H
#define INCISE_HANDLE_H

#include <vector>
#include <opencv2/core.hpp>
#include <incise/vision.h>
#include "picture.h"
#include "pieces.h"

namespace vision
{

/*
 *      top ┌──┐
 *          │  │ ↘ axis, unit, downwards
 *          │  │
 *          └──┘ bottom     half: half of its width
 */
struct handle {
	cv::Point2d top, bottom; /* of the axis; pixel (0, 0) covers 0 … 1 */
	cv::Point2d axis;
	double half_px;
	double rms_px; /* of the sides from straight lines */
	cv::Rect box;  /* around all of it */
	bool seam; /* its colour changes at once, on its way: is all of it the handle? */
};

/* What the search keeps from picture to picture, so that it need not allocate. */
struct handle_search {
	cv::Mat hsv, mask, cleaned;
	pieces found;
	std::vector<double> y, side[2], weight;
	std::vector<int> order;
	std::vector<cv::Vec3d> rows;
	std::vector<cv::Vec2d> colour, sum; /* of rows: value and chroma, levels */
};

/* Whether there is one within @box of the picture. *@why is set where not, to what is most
 * wrong with what comes closest. */
bool handle_find(handle_search &s, picture &picture,
		 const struct incise_vision_setup &setup, const cv::Rect &box,
		 handle &found, const char **why);

/* Whether thresholds mean a hue. */
inline bool all_hues(const struct incise_vision_setup &setup)
{
	return setup.hue[0] == 0 && setup.hue[1] == 179;
}

} // namespace vision

#endif
