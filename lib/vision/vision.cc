// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Depth from a picture: the object behind incise/vision.h, and the way of a frame through
 * this room. Regions are tried until one shows the handle:
 *
 *   frame ─ picture ─┬─ around the last place, or setup.roi ─┬─ handle ─ edge, edge ─ result
 *                    └─ all of it ───────────────────────────┘
 *
 * No exception gets past this file.
 */
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <new>
#include <incise/vision.h>
#include "edge.h"
#include "handle.h"
#include "picture.h"
#include "vision_opencv.h"

enum { MARGIN = 24 }; /* pixels that a handle may stray from where its motion takes it */

static const char unclear[] = "the handle's ends or sides are not clear";
static constexpr double worst_quality = 0.2;
static constexpr double seam_quality = 0.25;
static constexpr double most_misfit = 0.1; /* liver of 12 levels of texture: 0.02 */

struct opencv_vision {
	struct incise_vision vision;
	struct incise_vision_setup setup;
	cv::Rect region; /* to look at first; empty: all */
	cv::Rect last;	 /* around the handle in the picture before; empty: not seen */
	vision::picture picture;
	vision::handle_search handle;
	vision::edge_search edge;
};

static bool within(const int range[2], int most)
{
	return range[0] >= 0 && range[0] <= range[1] && range[1] <= most;
}

static int check_setup(const struct incise_vision_setup *s, struct incise_error *err)
{
	const struct incise_vision_box *roi = &s->roi;

	if (s->hue[0] < 0 || s->hue[0] > 179 || s->hue[1] < 0 || s->hue[1] > 179)
		return incise_error_set(
			err, EINVAL,
			"vision: hue %d to %d: give degrees over 2, 0 to 179", s->hue[0],
			s->hue[1]);
	if (!within(s->saturation, 255) || !within(s->value, 255))
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

static void say_nothing(struct incise_vision_result *result, int64_t t_ns,
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

static void say(struct opencv_vision *v, const vision::handle &handle,
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

/* Where it is and where it will be if all sides go on as from @last, and a margin. */
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

/* Look in a region. 0, or a negative errno; result->found says the rest. */
static int look(struct opencv_vision *v, const cv::Rect &region,
		struct incise_vision_result *result)
{
	vision::edge top, bottom;
	vision::handle handle;
	const char *why;
	int ret = v->picture.bring(region);

	if (ret)
		return ret;
	if (!vision::handle_find(v->handle, v->picture, v->setup, region, handle, &why)) {
		result->why = why;
		return 0;
	}
	why = vision::edge_find(v->edge, v->picture, handle.bottom, handle.axis,
				handle.half_px, bottom);
	if (!why)
		why = vision::edge_find(v->edge, v->picture, handle.top, -handle.axis,
					handle.half_px, top);
	if (why) {
		result->why = why;
		return 0;
	}
	say(v, handle, top, bottom, result);
	if (result->quality < worst_quality) {
		say_nothing(result, result->t_ns, unclear);
		return 0;
	}
	v->region = follow(v->last, handle.box);
	v->last = handle.box;
	return 0;
}

/* Within the picture, and from an even column to an even one, for YUYV. */
static cv::Rect fit_region(cv::Rect region, const cv::Size &size)
{
	/* sums of what rig.conf says could overflow */
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

static int measure(struct opencv_vision *v, const struct incise_camera_frame *frame,
		   struct incise_vision_result *result)
{
	int ret = v->picture.take(*frame);

	if (ret)
		return ret;
	cv::Rect all(cv::Point(), v->picture.size), region;

	region = fit_region(v->region, v->picture.size);
	if (region.area() > 0) {
		bool followed = v->last.area() > 0;

		ret = look(v, region, result);
		if (ret || result->found)
			return ret;
		/* Seen, but not clearly: so it would be in all of it, and a picture is to
		 * take no longer than that. The next one is searched as a whole. */
		if (followed && result->why == unclear) {
			v->region = v->last = cv::Rect();
			return 0;
		}
	}
	v->region = v->last = cv::Rect();
	return look(v, all, result);
}

static int opencv_measure(struct incise_vision *vision,
			  const struct incise_camera_frame *frame,
			  struct incise_vision_result *result)
{
	int ret;

	say_nothing(result, frame->t_ns, "no picture");
	try {
		ret = measure((struct opencv_vision *)vision, frame, result);
	} catch (const std::bad_alloc &) {
		ret = -ENOMEM;
	} catch (const cv::Exception &e) {
		ret = e.code == cv::Error::StsNoMem ? -ENOMEM : -EIO;
	} catch (...) {
		ret = -EIO;
	}
	if (ret)
		say_nothing(result, frame->t_ns, "no picture");
	return ret;
}

static void opencv_close(struct incise_vision *vision)
{
	delete (struct opencv_vision *)vision;
}

void *vision_opencv_open(const struct incise_backend_request *request,
			 struct incise_error *err)
{
	static const struct incise_vision_ops ops = {opencv_measure, vision_opencv_learn,
						     opencv_close};
	const struct incise_vision_setup *setup = request->vision;
	int ret = check_setup(setup, err);

	if (ret) {
		errno = -ret;
		return NULL;
	}
	try {
		struct opencv_vision *v = new opencv_vision();

		/* It is quicker so on a region of interest, and a capture that has a core for
		 * itself wants no threads beside its own. */
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
