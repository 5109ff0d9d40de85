/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The handle in an image (handle.cc): a connected region of its colour that is long and has
 * straight sides, accurate to a pixel or two along the axis. Its ends (edge.cc) are accurate to a
 * few hundredths of a pixel.
 */
#ifndef INCISE_HANDLE_H
#define INCISE_HANDLE_H

#include <vector>
#include <opencv2/core.hpp>
#include <incise/vision.h>
#include "image.h"

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
	bool seam;     /* its colour changes abruptly: part of it may be something else */
};

/* Pixels of a row from @from to before @to; @piece: an index into pieces::list. */
struct run {
	int y, from, to, piece;
};

struct piece {
	cv::Rect box;
	int area;
};

/*
 * Connected regions of a mask, by runs of pixels. The mask of an image has few runs: this takes
 * a tenth of the time of OpenCV's labels, which write a number per pixel.
 */
struct pieces {
	std::vector<run> runs; /* row by row, from left to right */
	std::vector<piece> list;

	/* Regions of bytes other than 0 in @mask; corners touch. */
	void find(const cv::Mat &mask);

      private:
	std::vector<int> parent;
};

/* Buffers of the search, kept from image to image. */
struct handle_search {
	cv::Mat hsv, mask, cleaned;
	pieces found;
	std::vector<double> y, side[2], weight;
	std::vector<int> order;
	std::vector<cv::Vec3d> rows;
	std::vector<cv::Vec2d> colour, sum; /* of rows: value and chroma, levels */
};

/* Whether there is a handle within @box of the image. If not, *@why is the main fault of the best
 * candidate. */
bool handle_find(handle_search &s, image &image, const struct incise_vision_setup &setup,
		 const cv::Rect &box, handle &found, const char **why);

/* A pixel near an end: its place along the axis and across it, and its brightness. */
struct sample {
	float u, v, value;
};

struct edge {
	double u;      /* outwards from the start of the search, on the axis */
	double sd;     /* of u */
	double step;   /* from the handle to the background, levels */
	double noise;  /* sd of the fit's residuals, levels */
	double misfit; /* rms residual of the means of pixels beyond noise, over step */
	double kept;   /* share of the pixels that the fit kept */
};

/* Buffers of the search, kept from image to image. */
struct edge_search {
	std::vector<sample> samples;
	std::vector<float> sorted, residuals;
};

/*
 * Find the edge along @out, a unit vector, from @end, which is accurate to some pixels. @half_px:
 * half of the handle's width. Returns NULL, or the reason why there is no edge.
 */
const char *edge_find(edge_search &s, const image &image, const cv::Point2d &end,
		      const cv::Point2d &out, double half_px, edge &found);

} // namespace vision

#endif
