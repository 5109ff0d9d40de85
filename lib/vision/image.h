/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The image in a camera's frame: checked sizes, JPEG decoded in the part that is needed. Other
 * pixels are not copied.
 */
#ifndef INCISE_IMAGE_H
#define INCISE_IMAGE_H

#include <vector>
#include <opencv2/core.hpp>
#include <incise/camera.h>

namespace vision
{

struct image {
	cv::Size size;
	cv::Rect area;		   /* the available part */
	enum incise_pixels pixels; /* RGB, GREY or YUYV */
	bool smeared; /* colour has less than full resolution: use luma for edges */

	/* 0 or a negative errno; @frame stays in use. The area is empty at first. */
	int take(const struct incise_camera_frame &frame);

	/* Make at least @wanted, a part of the image, available in area. */
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
