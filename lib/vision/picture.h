/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A frame of a camera as the rest of this room sees it: sizes checked, JPEG decoded as far
 * as asked for. Pixels are not copied otherwise.
 */
#ifndef INCISE_PICTURE_H
#define INCISE_PICTURE_H

#include <vector>
#include <opencv2/core.hpp>
#include <incise/camera.h>

namespace vision
{

struct picture {
	cv::Size size;
	cv::Rect area;		   /* of it is here */
	enum incise_pixels pixels; /* RGB, GREY or YUYV */
	bool smeared; /* colour has less than full resolution: edges are seen in luma only */

	/* 0 or a negative errno; @frame stays in use. Nothing is in area yet. */
	int take(const struct incise_camera_frame &frame);

	/* Have at least @wanted, which is within the picture, in area. */
	int bring(const cv::Rect &wanted);

	/* Every @step-th row of @box, which is within area: hue, saturation and value in 3
	 * channels, or value alone. YUYV: the box must begin and end at even columns. */
	void hsv(const cv::Rect &box, int step, cv::Mat &out);

	bool has(int x, int y) const
	{
		return area.contains(cv::Point(x, y));
	}

	/* Luma, or red, green and blue: channels() values. Only where has(). */
	void pixel(int x, int y, float *value) const;

	int channels() const
	{
		return pixels == INCISE_PIXELS_RGB && !smeared ? 3 : 1;
	}

      private:
	const struct incise_camera_frame *frame;
	const uint8_t *data; /* of column left in row area.y */
	int left;
	size_t stride;
	std::vector<uint8_t> decoded;
	cv::Mat rgb;
};

} // namespace vision

#endif
