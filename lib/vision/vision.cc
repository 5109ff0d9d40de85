// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Depth from a camera's frame: the object behind incise/vision.h. Regions are searched until one
 * shows the handle:
 *
 *   frame ─ image ─┬─ around the last place, or setup.roi ─┬─ handle ─ edge, edge ─ result
 *                  └─ all of it ───────────────────────────┘
 *
 * No exception gets past this file.
 */
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <new>
#include <vector>
#include <incise/vision.h>
#include "handle.h"
#include "image.h"
#include "vision_opencv.h"

enum { MARGIN = 24 }; /* pixels around the extrapolated place of the handle */

static const char unclear[] = "the handle's ends or sides are not clear";
static constexpr double worst_quality = 0.2;
static constexpr double seam_quality = 0.25;
static constexpr double most_misfit = 0.1; /* liver of 12 levels of texture: 0.02 */

struct opencv_vision {
	struct incise_vision vision;
	struct incise_vision_setup setup;
	cv::Rect region; /* to search first; empty: all */
	cv::Rect last;	 /* around the handle in the previous image; empty: not found */
	vision::image image;
	vision::handle_search handle;
	vision::edge_search edge;
};

static bool within_vision(const int range[2], int most)
{
	return range[0] >= 0 && range[0] <= range[1] && range[1] <= most;
}

static int check_vision_setup(const struct incise_vision_setup *s,
			      struct incise_error *err)
{
	const struct incise_vision_box *roi = &s->roi;

	if (s->hue[0] < 0 || s->hue[0] > 179 || s->hue[1] < 0 || s->hue[1] > 179)
		return incise_error_set(
			err, EINVAL,
			"vision: hue %d to %d: give degrees over 2, 0 to 179", s->hue[0],
			s->hue[1]);
	if (!within_vision(s->saturation, 255) || !within_vision(s->value, 255))
		return incise_error_set(
			err, EINVAL,
			"vision: saturation %d to %d, value %d to %d: give "
			"0 to 255, the lower one first",
			s->saturation[0], s->saturation[1], s->value[0], s->value[1]);
	if (!(s->full_px >= 0 && s->full_px < 1e5) || !(s->depth_mm_px >= 0) ||
	    !std::isfinite(s->depth_mm_px) || (s->full_px > 0 && !(s->depth_mm_px > 0)))
		return incise_error_set(
			err, EINVAL,
			"vision: %g pixels at depth 0 and %g mm per pixel: "
			"calibrate the depth",
			s->full_px, s->depth_mm_px);
	if (roi->width < 0 || roi->height < 0 || roi->x < 0 || roi->y < 0 ||
	    (roi->width > 0) != (roi->height > 0))
		return incise_error_set(err, EINVAL,
					"vision: a region of %d x %d pixels at %d, %d",
					roi->width, roi->height, roi->x, roi->y);
	return 0;
}

static void report_nothing(struct incise_vision_result *result, int64_t t_ns,
			   const char *why)
{
	*result = {};
	result->t_ns = t_ns;
	result->length_px = result->sd_px = result->depth_mm = NAN;
	result->edge_px[0] = result->edge_px[1] = result->axis[0] = result->axis[1] = NAN;
	result->why = why;
}

static double clip01(double value)
{
	return std::min(1.0, std::max(0.0, value));
}

static void report_vision(struct opencv_vision *v, const vision::handle &handle,
			  const vision::edge &top, const vision::edge &bottom,
			  struct incise_vision_result *result)
{
	cv::Point2d edge = handle.bottom + bottom.u * handle.axis;
	double contrast = bottom.step / (10 * std::max(bottom.noise, 0.1));
	double straight = 1 - handle.rms_px / 3;
	double kept = 2 * std::min(top.kept, bottom.kept) - 1;
	double form = 1 - std::max(top.misfit, bottom.misfit) / most_misfit;
	double even = handle.seam ? seam_quality : 1;

	result->found = true;
	result->length_px =
		(handle.bottom - handle.top).dot(handle.axis) + bottom.u + top.u;
	result->sd_px = std::hypot(top.sd, bottom.sd);
	if (v->setup.full_px > 0)
		result->depth_mm =
			(v->setup.full_px - result->length_px) * v->setup.depth_mm_px;
	result->edge_px[0] = edge.x;
	result->edge_px[1] = edge.y;
	result->axis[0] = handle.axis.x;
	result->axis[1] = handle.axis.y;
	result->quality = clip01(std::min({contrast, straight, kept, form, even}));
}

/* Its place, the place extrapolated from @last, and a margin. */
static cv::Rect follow(const cv::Rect &last, const cv::Rect &now)
{
	cv::Rect next = now;

	if (last.area() > 0) {
		cv::Point from = 2 * now.tl() - last.tl(), to = 2 * now.br() - last.br();

		if (to.x > from.x && to.y > from.y)
			next |= cv::Rect(from, to);
	}
	return next + cv::Size(2 * MARGIN, 2 * MARGIN) - cv::Point(MARGIN, MARGIN);
}

/* Search a region. 0 with result->found, or a negative errno. */
static int search_vision(struct opencv_vision *v, const cv::Rect &region,
			 struct incise_vision_result *result)
{
	vision::edge top, bottom;
	vision::handle handle;
	const char *why;
	int ret = v->image.bring(region);

	if (ret)
		return ret;
	if (!vision::handle_find(v->handle, v->image, v->setup, region, handle, &why)) {
		result->why = why;
		return 0;
	}
	why = vision::edge_find(v->edge, v->image, handle.bottom, handle.axis,
				handle.half_px, bottom);
	if (!why)
		why = vision::edge_find(v->edge, v->image, handle.top, -handle.axis,
					handle.half_px, top);
	if (why) {
		result->why = why;
		return 0;
	}
	report_vision(v, handle, top, bottom, result);
	if (result->quality < worst_quality) {
		report_nothing(result, result->t_ns, unclear);
		return 0;
	}
	v->region = follow(v->last, handle.box);
	v->last = handle.box;
	return 0;
}

/* Within the image, and from an even column to an even one, for YUYV. */
static cv::Rect fit_region(cv::Rect region, const cv::Size &size)
{
	/* sums of values from rig.conf could overflow */
	region.x = std::min(region.x, size.width);
	region.y = std::min(region.y, size.height);
	region.width = std::min(region.width, 2 * size.width);
	region.height = std::min(region.height, 2 * size.height);
	region &= cv::Rect(cv::Point(), size);
	if (region.width < 16 || region.height < 16)
		return cv::Rect();
	region.width += region.x % 2;
	region.x -= region.x % 2;
	region.width -= region.width % 2;
	return region;
}

static int measure_vision(struct opencv_vision *v,
			  const struct incise_camera_frame *frame,
			  struct incise_vision_result *result)
{
	int ret = v->image.take(*frame);

	if (ret)
		return ret;
	cv::Rect all(cv::Point(), v->image.size), region;

	region = fit_region(v->region, v->image.size);
	if (region.area() > 0) {
		bool followed = v->last.area() > 0;

		ret = search_vision(v, region, result);
		if (ret || result->found)
			return ret;
		/* It is not clear, and would not be in the whole image: save that time. The
		 * next image is searched as a whole. */
		if (followed && result->why == unclear) {
			v->region = v->last = cv::Rect();
			return 0;
		}
	}
	v->region = v->last = cv::Rect();
	return search_vision(v, all, result);
}

static int opencv_measure(struct incise_vision *vision,
			  const struct incise_camera_frame *frame,
			  struct incise_vision_result *result)
{
	int ret;

	report_nothing(result, frame->t_ns, "no picture");
	try {
		ret = measure_vision((struct opencv_vision *)vision, frame, result);
	} catch (const std::bad_alloc &) {
		ret = -ENOMEM;
	} catch (const cv::Exception &e) {
		ret = e.code == cv::Error::StsNoMem ? -ENOMEM : -EIO;
	} catch (...) {
		ret = -EIO;
	}
	if (ret)
		report_nothing(result, frame->t_ns, "no picture");
	return ret;
}

static void opencv_close(struct incise_vision *vision)
{
	delete (struct opencv_vision *)vision;
}

/*
 * Thresholds from a box of pixels on the handle. Their values are sorted, 2 % at both ends are
 * dropped as noise and reflections, and the rest is widened:
 *
 *   black        value up to 10 and a quarter of the middle more, for changing light;
 *   or grey      hue and saturation are noise
 *   coloured     hue ± 8, saturation down to half, value by half and twice
 */
enum {
	CLICK = 3,    /* pixels around a click to each side */
	DARK = 64,    /* value below which a colour is black */
	PALE = 50,    /* saturation below which it is grey */
	SPREAD = 60,  /* of the value within one colour */
	HUES = 20,    /* of the hue */
	HUE_MORE = 8, /* beyond the hues in the box */
};

struct range {
	int low, middle, high;
};

static range range_of_vision(std::vector<uint8_t> &values)
{
	size_t n = values.size();

	std::sort(values.begin(), values.end());
	return {values[n / 50], values[n / 2], values[n - 1 - n / 50]};
}

static int up_to_255(int value)
{
	return std::min(255, value);
}

/* Hues lie on a circle: turn it so that the most frequent one is in the middle. */
static range range_of_hues(std::vector<uint8_t> &hues, int *turn)
{
	int count[180] = {};

	for (uint8_t hue : hues)
		count[hue % 180]++;
	*turn = 90 - (int)(std::max_element(count, count + 180) - count);
	for (uint8_t &hue : hues)
		hue = (uint8_t)((hue + *turn + 180) % 180);
	return range_of_vision(hues);
}

static int learn_vision(const struct incise_camera_frame &frame,
			const struct incise_vision_box &given,
			struct incise_vision_setup &setup, struct incise_error *err)
{
	vision::image image;
	int turn, ret = image.take(frame);

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
		      cv::Rect(cv::Point(), image.size);
	/* YUYV has colour for two columns at a time. */
	cv::Rect even(box.x - box.x % 2, box.y, box.width + box.x % 2, box.height);
	even.width += even.width % 2;
	even &= cv::Rect(cv::Point(), image.size);
	ret = image.bring(even);
	if (ret)
		return incise_error_set(err, -ret,
					"vision: the picture cannot be decoded");

	std::vector<uint8_t> channel[3];
	cv::Mat hsv;

	image.hsv(even, 1, hsv);
	for (int y = 0; y < box.height; y++)
		for (int x = box.x - even.x; x < box.x - even.x + box.width; x++)
			for (int k = 0; k < hsv.channels(); k++)
				channel[hsv.channels() == 1 ? 2 : k].push_back(
					hsv.ptr(y)[x * hsv.channels() + k]);

	range value = range_of_vision(channel[2]);
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

	range saturation = range_of_vision(channel[1]);
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

static int opencv_learn(struct incise_vision *, const struct incise_camera_frame *frame,
			const struct incise_vision_box *box,
			struct incise_vision_setup *setup, struct incise_error *err)
{
	/* Thresholds change all or not at all. */
	struct incise_vision_setup learnt = *setup;
	int ret;

	try {
		ret = learn_vision(*frame, *box, learnt, err);
	} catch (const std::bad_alloc &) {
		ret = incise_error_set(err, ENOMEM, "vision: out of memory");
	} catch (...) {
		ret = incise_error_set(err, EIO, "vision: OpenCV failed");
	}
	if (!ret)
		*setup = learnt;
	return ret;
}

void *vision_opencv_open(const struct incise_backend_request *request,
			 struct incise_error *err)
{
	static const struct incise_vision_ops ops = {opencv_measure, opencv_learn,
						     opencv_close};
	const struct incise_vision_setup *setup = request->vision;
	int ret = check_vision_setup(setup, err);

	if (ret) {
		errno = -ret;
		return NULL;
	}
	try {
		struct opencv_vision *v = new opencv_vision();

		/* This is faster for a region of interest, and a capture with a core of its own
		 * has no cores for more threads. */
		cv::setNumThreads(1);
		v->vision.ops = &ops;
		v->setup = *setup;
		v->region = cv::Rect(setup->roi.x, setup->roi.y, setup->roi.width,
				     setup->roi.height);
		return v;
	} catch (...) {
		errno = -incise_error_set(err, ENOMEM, "vision: out of memory");
		return NULL;
	}
}
