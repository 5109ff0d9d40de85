// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Frames with checked sizes and decoded JPEG; see image.h.
 */
#include <cerrno>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include "image.h"
#include "vision_opencv.h"

namespace vision
{

enum { SMALLEST = 16, LARGEST = 8192 };

/* Bytes of a row; 0: no such format. */
static size_t row_bytes(const struct incise_camera_frame &frame)
{
	switch (frame.pixels) {
	case INCISE_PIXELS_RGB:
		return (size_t)frame.width * 3;
	case INCISE_PIXELS_GREY:
		return frame.width;
	case INCISE_PIXELS_YUYV:
		return frame.width % 2 ? 0 : (size_t)frame.width * 2;
	default:
		return 0;
	}
}

int image::take(const struct incise_camera_frame &f)
{
	int format;

	/* From C, an enum may have any value, which C++ must not load as an enum. */
	memcpy(&format, &f.pixels, sizeof(format));
	if (format < INCISE_PIXELS_RGB || format > INCISE_PIXELS_MJPEG)
		return -EINVAL;
	bool jpeg = f.pixels == INCISE_PIXELS_MJPEG;

	if (!f.data || f.width < SMALLEST || f.height < SMALLEST || f.width > LARGEST ||
	    f.height > LARGEST)
		return -EINVAL;
	if (!jpeg) {
		size_t row = row_bytes(f);

		if (!row || f.stride < 0 || (size_t)f.stride < row ||
		    (size_t)f.stride * (f.height - 1) + row > f.size)
			return -EINVAL;
	}
	frame = &f;
	size = cv::Size(f.width, f.height);
	area = jpeg ? cv::Rect() : cv::Rect(cv::Point(), size);
	pixels = jpeg ? INCISE_PIXELS_RGB : f.pixels;
	smeared = jpeg;
	data = f.data;
	left = 0;
	stride = f.stride;
	return 0;
}

int image::bring(const cv::Rect &wanted)
{
	if ((wanted & area) == wanted)
		return 0;
	struct incise_vision_box box = {wanted.x, wanted.y, wanted.width, wanted.height};

	stride = (size_t)size.width * 3;
	area = cv::Rect();
	if (decoded.size() < stride * box.height)
		decoded.resize(stride * box.height);
	int ret = incise_jpeg_decode(frame, &box, decoded.data());
	if (ret)
		return ret;
	area = cv::Rect(box.x, box.y, box.width, box.height);
	data = decoded.data();
	left = box.x;
	return 0;
}

void image::hsv(const cv::Rect &box, int step, cv::Mat &out)
{
	int rows = (box.height + step - 1) / step;
	int bytes = pixels == INCISE_PIXELS_RGB	   ? 3
		    : pixels == INCISE_PIXELS_YUYV ? 2
						   : 1;
	/* OpenCV has no const views; no function writes to this one. */
	uint8_t *from = const_cast<uint8_t *>(data) + stride * (box.y - area.y) +
			(size_t)(box.x - left) * bytes;
	cv::Mat view(rows, box.width, CV_8UC(bytes), from, stride * step);

	switch (pixels) {
	case INCISE_PIXELS_RGB:
		cv::cvtColor(view, out, cv::COLOR_RGB2HSV);
		break;
	case INCISE_PIXELS_YUYV:
		cv::cvtColor(view, rgb, cv::COLOR_YUV2RGB_YUYV);
		cv::cvtColor(rgb, out, cv::COLOR_RGB2HSV);
		break;
	default:
		out = view;
	}
}

void image::pixel(int x, int y, float *value) const
{
	const uint8_t *row = data + stride * (y - area.y);
	size_t column = x - left;

	switch (pixels) {
	case INCISE_PIXELS_RGB: {
		const uint8_t *rgb = row + column * 3;

		if (smeared) {
			*value = 0.299f * rgb[0] + 0.587f * rgb[1] + 0.114f * rgb[2];
			break;
		}
		for (int k = 0; k < 3; k++)
			value[k] = rgb[k];
		break;
	}
	case INCISE_PIXELS_YUYV:
		*value = row[2 * column];
		break;
	default:
		*value = row[column];
	}
}

} // namespace vision
