// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Thresholds from a box of pixels on the handle. Their values are sorted, 2 % at both ends
 * are left to noise and reflections, and what remains is widened:
 *
 *   black        value up to 10 and a quarter of the middle more: as bright as light that
 *   or grey      changes makes it; hue and saturation are noise
 *   coloured     hue ± 8, saturation down to half, value by half and twice
 */
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <vector>
#include <incise/vision.h>
#include "picture.h"
#include "vision_opencv.h"

namespace
{

enum {
	CLICK = 3,    /* pixels around a click to each side */
	DARK = 64,    /* value below which a colour is black */
	PALE = 50,    /* saturation below which it is grey */
	SPREAD = 60,  /* of the value within one colour */
	HUES = 20,    /* of the hue */
	HUE_MORE = 8, /* beyond what is in the box */
};

struct range {
	int low, middle, high;
};

range range_of(std::vector<uint8_t> &values)
{
	size_t n = values.size();

	std::sort(values.begin(), values.end());
	return {values[n / 50], values[n / 2], values[n - 1 - n / 50]};
}

int up_to_255(int value)
{
	return std::min(255, value);
}

/* Hues lie on a circle: turn it so that the one most of them have is in the middle. */
range range_of_hues(std::vector<uint8_t> &hues, int *turn)
{
	int count[180] = {};

	for (uint8_t hue : hues)
		count[hue % 180]++;
	*turn = 90 - (int)(std::max_element(count, count + 180) - count);
	for (uint8_t &hue : hues)
		hue = (uint8_t)((hue + *turn + 180) % 180);
	return range_of(hues);
}

int learn(const struct incise_camera_frame &frame, const struct incise_vision_box &given,
	  struct incise_vision_setup &setup, struct incise_error *err)
{
	vision::picture picture;
	int turn, ret = picture.take(frame);

	if (ret)
		return incise_error_set(err, -ret,
					"vision: the picture's sizes do not fit");
	if (given.width < 1 || given.height < 1 || given.x < 0 || given.y < 0 ||
	    given.width > frame.width - given.x || given.height > frame.height - given.y)
		return incise_error_set(
			err, EINVAL,
			"vision: a box of %d x %d at %d, %d is not within "
			"the picture, which is %d x %d",
			given.width, given.height, given.x, given.y, frame.width,
			frame.height);

	cv::Rect box(given.x, given.y, given.width, given.height);
	if (box.area() == 1)
		box = cv::Rect(box.x - CLICK, box.y - CLICK, 2 * CLICK + 1,
			       2 * CLICK + 1) &
		      cv::Rect(cv::Point(), picture.size);
	/* YUYV has colour for two columns at a time. */
	cv::Rect even(box.x - box.x % 2, box.y, box.width + box.x % 2, box.height);
	even.width += even.width % 2;
	even &= cv::Rect(cv::Point(), picture.size);
	ret = picture.bring(even);
	if (ret)
		return incise_error_set(err, -ret,
					"vision: the picture cannot be decoded");

	std::vector<uint8_t> channel[3];
	cv::Mat hsv;

	picture.hsv(even, 1, hsv);
	for (int y = 0; y < box.height; y++)
		for (int x = box.x - even.x; x < box.x - even.x + box.width; x++)
			for (int k = 0; k < hsv.channels(); k++)
				channel[hsv.channels() == 1 ? 2 : k].push_back(
					hsv.ptr(y)[x * hsv.channels() + k]);

	range value = range_of(channel[2]);
	if (value.high - value.low > SPREAD)
		return incise_error_set(
			err, ERANGE,
			"vision: the box spans values from %d to %d, which "
			"is not one colour: draw it within the handle",
			value.low, value.high);
	setup.hue[0] = 0;
	setup.hue[1] = 179;
	setup.saturation[0] = 0;
	setup.saturation[1] = 255;
	setup.value[0] = value.middle < DARK ? 0 : value.low / 2;
	setup.value[1] = up_to_255(value.high + value.middle / 4 + 10);
	if (channel[0].empty() || value.middle < DARK)
		return 0;

	range saturation = range_of(channel[1]);
	if (saturation.middle < PALE) {
		setup.saturation[1] = up_to_255(saturation.high * 3 / 2 + 10);
		return 0;
	}
	range hue = range_of_hues(channel[0], &turn);
	if (hue.high - hue.low > HUES)
		return incise_error_set(
			err, ERANGE,
			"vision: the box spans hues over %d of 180, which is "
			"not one colour: draw it within the handle",
			hue.high - hue.low);
	setup.hue[0] = (hue.low - HUE_MORE - turn + 360) % 180;
	setup.hue[1] = (hue.high + HUE_MORE - turn + 360) % 180;
	setup.saturation[0] = saturation.low / 2;
	setup.value[1] = up_to_255(value.high * 2);
	return 0;
}

} // namespace

int vision_opencv_learn(struct incise_vision *, const struct incise_camera_frame *frame,
			const struct incise_vision_box *box,
			struct incise_vision_setup *setup, struct incise_error *err)
{
	/* So that thresholds are either all learnt or all as they were. */
	struct incise_vision_setup learnt = *setup;
	int ret;

	try {
		ret = learn(*frame, *box, learnt, err);
	} catch (const std::bad_alloc &) {
		ret = incise_error_set(err, ENOMEM, "vision: out of memory");
	} catch (...) {
		ret = incise_error_set(err, EIO, "vision: OpenCV failed");
	}
	if (!ret)
		*setup = learnt;
	return ret;
}
