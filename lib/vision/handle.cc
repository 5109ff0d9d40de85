// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The handle in an image; see handle.h. Pixels within the thresholds are cleaned of specks and
 * joined; the largest region with the form of a handle is taken:
 *
 *      x            the first and last pixel of each row give two sides, each fitted with a
 *      ·┌──┐·       line x = a + b y; rows far from it, by a reflection or a shadow, weigh
 *      ·│  │·       little; rows that cross an end of a tilted handle are left out
 *      ·└──┘·
 *
 * Tall images need every second row only: ends and sides are refined from all pixels.
 */
#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include "handle.h"

namespace vision
{

/*
 * Regions: each run starts a region of its own, and regions that touch a run of the row above
 * are joined with it.
 *
 *      row above   ·███····██·      two runs touch when neither ends before the
 *      row         ··██████···      other starts
 */
static int root_of(std::vector<int> &parent, int i)
{
	while (parent[i] != i) {
		parent[i] = parent[parent[i]];
		i = parent[i];
	}
	return i;
}

static void read_runs(const cv::Mat &mask, int y, std::vector<run> &runs)
{
	const uint8_t *row = mask.ptr(y);
	int x = 0;

	while (x < mask.cols) {
		uint64_t eight;

		/* most pixels are not the handle */
		if (x + 8 <= mask.cols) {
			memcpy(&eight, row + x, sizeof(eight));
			if (!eight) {
				x += 8;
				continue;
			}
		}
		if (!row[x]) {
			x++;
			continue;
		}
		const void *end = memchr(row + x, 0, mask.cols - x);
		int to = end ? (int)((const uint8_t *)end - row) : mask.cols;

		runs.push_back({y, x, to, (int)runs.size()});
		x = to;
	}
}

void pieces::find(const cv::Mat &mask)
{
	size_t above = 0, row = 0;

	runs.clear();
	list.clear();
	parent.clear();
	for (int y = 0; y < mask.rows; y++) {
		size_t a = above;

		row = runs.size();
		read_runs(mask, y, runs);
		for (size_t i = row; i < runs.size(); i++) {
			parent.push_back((int)i);
			while (a < row && runs[a].to < runs[i].from)
				a++;
			for (size_t b = a; b < row && runs[b].from <= runs[i].to; b++) {
				int one = root_of(parent, (int)b);
				int other = root_of(parent, (int)i);

				/* the root is a piece's first run */
				parent[std::max(one, other)] = std::min(one, other);
			}
		}
		above = row;
	}
	for (size_t i = 0; i < runs.size(); i++) {
		run &r = runs[i];
		cv::Rect box(r.from, r.y, r.to - r.from, 1);
		int root = root_of(parent, (int)i);

		if (root == (int)i) {
			r.piece = (int)list.size();
			list.push_back({box, box.width});
			continue;
		}
		r.piece = runs[root].piece;
		piece &p = list[r.piece];
		p.box |= box;
		p.area += box.width;
	}
}

enum {
	HIGH = 400,	 /* rows: taller images are searched every second row */
	CANDIDATES = 8,	 /* number of largest pieces that are judged */
	FEWEST = 12,	 /* rows for the fit of a side */
	BORDER = 6,	 /* pixels of background that an end needs */
	LEAST_PIECE = 6, /* rows of a piece that continues the handle behind a gap */
};

static constexpr double longest_ratio = 1.5; /* length over width at least */
static constexpr double least_fill = 0.6;    /* of the rectangle between the sides */
static constexpr double most_tilt = 1.75;    /* tan 60° and a little */
static constexpr double most_rms_px = 3;
static constexpr double seam_levels =
	8; /* beyond the effect of light and noise on black */

/* 255 where a pixel has the handle's colour. */
static void find_colour(handle_search &s, const struct incise_vision_setup &setup)
{
	double low[3], high[3];

	if (s.hsv.channels() == 1) {
		cv::inRange(s.hsv, setup.value[0], setup.value[1], s.mask);
		return;
	}
	low[0] = setup.hue[0];
	high[0] = setup.hue[1];
	low[1] = setup.saturation[0];
	high[1] = setup.saturation[1];
	low[2] = setup.value[0];
	high[2] = setup.value[1];
	if (low[0] > high[0]) {
		cv::inRange(s.hsv, cv::Scalar(low[0], low[1], low[2]),
			    cv::Scalar(179, high[1], high[2]), s.mask);
		cv::inRange(s.hsv, cv::Scalar(0, low[1], low[2]),
			    cv::Scalar(high[0], high[1], high[2]), s.cleaned);
		cv::bitwise_or(s.mask, s.cleaned, s.mask);
	} else {
		cv::inRange(s.hsv, cv::Scalar(low[0], low[1], low[2]),
			    cv::Scalar(high[0], high[1], high[2]), s.mask);
	}
}

struct line {
	double a, b, rms;
};

/* x = a + b y through the rows from @y0 to @y1, by weights of Tukey's. */
static bool fit_handle_line(handle_search &s, const std::vector<double> &x, double y0,
			    double y1, line &line)
{
	size_t n = s.y.size(), used = 0;
	double scale = 0;

	s.weight.assign(n, 0);
	for (size_t i = 0; i < n; i++)
		if (s.y[i] >= y0 && s.y[i] <= y1) {
			s.weight[i] = 1;
			used++;
		}
	if (used < FEWEST)
		return false;
	for (int pass = 0; pass < 6; pass++) {
		double w = 0, my = 0, mx = 0, yy = 0, xy = 0, square = 0;

		for (size_t i = 0; i < n; i++) {
			w += s.weight[i];
			my += s.weight[i] * s.y[i];
			mx += s.weight[i] * x[i];
		}
		if (w < FEWEST / 2)
			return false;
		my /= w;
		mx /= w;
		for (size_t i = 0; i < n; i++) {
			yy += s.weight[i] * (s.y[i] - my) * (s.y[i] - my);
			xy += s.weight[i] * (s.y[i] - my) * (x[i] - mx);
		}
		if (!(yy > 0))
			return false;
		line.b = xy / yy;
		line.a = mx - line.b * my;
		for (size_t i = 0; i < n; i++) {
			double r = x[i] - line.a - line.b * s.y[i];

			square += s.weight[i] * r * r;
		}
		line.rms = std::sqrt(square / w);
		/* From wide to narrow: a bad start must not discard good rows. */
		scale = std::max(1.5, pass < 2 ? 4 * line.rms : 3 * line.rms);
		for (size_t i = 0; i < n; i++) {
			double r = (x[i] - line.a - line.b * s.y[i]) / scale;

			if (s.y[i] < y0 || s.y[i] > y1)
				continue;
			s.weight[i] = std::fabs(r) < 1 ? (1 - r * r) * (1 - r * r) : 0;
		}
	}
	return true;
}

/* First and last pixel of each row of a piece, in pixels of the image. */
static void read_sides(handle_search &s, int piece, const cv::Rect &box, int step)
{
	int last = -1;

	s.y.clear();
	s.side[0].clear();
	s.side[1].clear();
	for (const run &r : s.found.runs) {
		if (r.piece != piece)
			continue;
		if (r.y != last) {
			s.y.push_back(box.y + r.y * step + 0.5);
			s.side[0].push_back(box.x + r.from);
			s.side[1].push_back(0);
		}
		s.side[1].back() = box.x + r.to;
		last = r.y;
	}
}

static bool fit_sides(handle_search &s, double y0, double y1, line *side)
{
	return fit_handle_line(s, s.side[0], y0, y1, side[0]) &&
	       fit_handle_line(s, s.side[1], y0, y1, side[1]);
}

/* NULL for a handle; else the reason why it is no handle. */
static const char *judge_handle(handle_search &s, double area, handle &h)
{
	double y0, y1, slope, width, corner, length;
	line side[2];

	if (s.y.size() < FEWEST)
		return "what has the handle's colour is too small";
	y0 = s.y.front();
	y1 = s.y.back();
	corner = (y1 - y0) / 8;
	if (!fit_sides(s, y0 + corner, y1 - corner, side))
		return "what has the handle's colour has no straight sides";
	for (int pass = 0; pass < 2; pass++) {
		slope = (side[0].b + side[1].b) / 2;
		if (!(std::fabs(slope) < most_tilt))
			return "what has the handle's colour lies flat";
		h.axis = cv::Point2d(slope, 1) / std::hypot(slope, 1);
		width = (side[1].a - side[0].a +
			 (side[1].b - side[0].b) * (y0 + y1) / 2) *
			h.axis.y;
		/* Leave out rows that cross an end, square to the axis or level. */
		corner = std::min(width * std::fabs(h.axis.x) + 4, (y1 - y0) / 3);
		if (!fit_sides(s, y0 + corner, y1 - corner, side))
			return "what has the handle's colour has no straight sides";
	}
	h.half_px = width / 2;
	h.rms_px = std::max(side[0].rms, side[1].rms);
	if (h.half_px < 2)
		return "what has the handle's colour is too thin";
	if (h.rms_px > most_rms_px)
		return "what has the handle's colour has no straight sides";

	/* The axis enters and leaves the piece there. */
	double a = (side[0].a + side[1].a) / 2, b = (side[0].b + side[1].b) / 2;
	size_t first = s.y.size(), last = 0;

	for (size_t i = 0; i < s.y.size(); i++) {
		double x = a + b * s.y[i];

		if (x < s.side[0][i] || x > s.side[1][i])
			continue;
		first = std::min(first, i);
		last = i;
	}
	if (first >= last)
		return "what has the handle's colour has no straight sides";
	h.top = cv::Point2d(a + b * s.y[first], s.y[first]);
	h.bottom = cv::Point2d(a + b * s.y[last], s.y[last]);
	length = (h.bottom - h.top).dot(h.axis);
	if (length < longest_ratio * width)
		return "what has the handle's colour is not long enough for a handle";
	if (area < least_fill * length * width)
		return "what has the handle's colour is not filled as a handle is";
	return nullptr;
}

static bool at_border(const handle &h, const cv::Rect &within)
{
	cv::Point2d out = h.axis * (double)BORDER;

	for (const cv::Point2d &p : {h.top - out, h.bottom + out})
		if (p.x < within.x || p.y < within.y || p.x > within.x + within.width ||
		    p.y > within.y + within.height)
			return true;
	return false;
}

/*
 * Whether a piece other than @own continues the handle at its width: a reflection all across it,
 * or a tape, has cut it, or this is its mirror image in the tissue.
 */
static bool is_cut(handle_search &s, int own, const handle &h, const cv::Rect &box,
		   int step)
{
	double width = 2 * h.half_px / h.axis.y; /* of a row */
	std::vector<cv::Vec3d> &sum =
		s.rows; /* pixels on the handle's way, off it; rows */

	sum.assign(s.found.list.size(), cv::Vec3d());
	for (const run &r : s.found.runs) {
		double y = box.y + r.y * step + 0.5;
		double middle = h.top.x + (y - h.top.y) * h.axis.x / h.axis.y;
		double on = std::min<double>(box.x + r.to, middle + width / 2) -
			    std::max<double>(box.x + r.from, middle - width / 2);

		on = std::max(on, 0.0);
		sum[r.piece] += cv::Vec3d(on, r.to - r.from - on, 1);
	}
	for (size_t k = 0; k < sum.size(); k++) {
		double rows = s.found.list[k].box.height;

		if ((int)k != own && rows * step >= LEAST_PIECE &&
		    sum[k][0] > 0.6 * rows * width && sum[k][1] < 0.25 * sum[k][0])
			return true;
	}
	return false;
}

/* Value and chroma of the handle in the middle of each row, as medians: no reflections. */
static void read_colour(handle_search &s, const handle &h, const cv::Rect &box, int step)
{
	enum { POINTS = 15 };
	double reach = 0.6 * h.half_px / h.axis.y;
	double end = 1.2 * h.half_px * std::fabs(h.axis.x) + 8; /* blurred, aslant */

	s.colour.clear();
	for (int j = 0; j < s.hsv.rows; j++) {
		double y = box.y + j * step + 0.5;
		double x = h.top.x + (y - h.top.y) * h.axis.x / h.axis.y - box.x;
		uint8_t value[POINTS], chroma[POINTS] = {};

		if (y < h.top.y + end || y > h.bottom.y - end)
			continue;
		for (int k = 0; k < POINTS; k++) {
			int at = (int)(x + reach * (2 * k / (POINTS - 1.0) - 1));

			at = std::min(std::max(at, 0), s.hsv.cols - 1);
			if (s.hsv.channels() == 1) {
				value[k] = *s.hsv.ptr(j, at);
				continue;
			}
			const uint8_t *hsv = s.hsv.ptr(j, at);
			value[k] = hsv[2];
			chroma[k] = (uint8_t)(hsv[1] * hsv[2] / 255);
		}
		std::nth_element(value, value + POINTS / 2, value + POINTS);
		std::nth_element(chroma, chroma + POINTS / 2, chroma + POINTS);
		s.colour.push_back(cv::Vec2d(value[POINTS / 2], chroma[POINTS / 2]));
	}
}

/*
 * Whether the handle's colour has a step from one row to the next. A shadow on the tissue, or
 * blood, may have the handle's colour and continue it.
 */
static bool has_seam(handle_search &s, const handle &h, const cv::Rect &box, int step)
{
	enum { LEAST = 3, NEAR = 8 };

	read_colour(s, h, box, step);
	int n = (int)s.colour.size(), split = 0;
	double most = 0;

	s.sum.assign(1, cv::Vec2d());
	for (const cv::Vec2d &c : s.colour)
		s.sum.push_back(s.sum.back() + c);
	auto mean = [&s](int from, int to) {
		return (s.sum[to] - s.sum[from]) * (1.0 / (to - from));
	};
	for (int i = LEAST; i <= n - LEAST; i++) {
		cv::Vec2d step = mean(i, n) - mean(0, i);
		double between = step.dot(step) * i * (n - i);

		if (between > most) {
			most = between;
			split = i;
		}
	}
	if (!split)
		return false;
	cv::Vec2d all = mean(split, n) - mean(0, split);
	/* Fading light has no step. */
	cv::Vec2d here = mean(std::min(split + 1, n - 2), std::min(split + NEAR, n)) -
			 mean(std::max(split - NEAR, 0), std::max(split - 1, 2));
	double size = cv::norm(all);
	return size > seam_levels && here.dot(all) > 0.7 * size * size;
}

bool handle_find(handle_search &s, image &image, const struct incise_vision_setup &setup,
		 const cv::Rect &box, handle &found, const char **why)
{
	int step = image.size.height >= HIGH ? 2 : 1;
	int smallest = 16 * FEWEST / step;
	double most = 0;
	int own = -1;

	*why = "nothing has the handle's colour";
	image.hsv(box, step, s.hsv);
	find_colour(s, setup);
	/* Close first: reflections on the handle are more than specks. */
	cv::morphologyEx(s.mask, s.cleaned, cv::MORPH_CLOSE,
			 cv::getStructuringElement(cv::MORPH_RECT, cv::Size(5, 3)));
	cv::morphologyEx(s.cleaned, s.mask, cv::MORPH_OPEN,
			 cv::getStructuringElement(cv::MORPH_RECT, cv::Size(3, 3)));
	s.found.find(s.mask);

	const std::vector<piece> &list = s.found.list;
	s.order.clear();
	for (size_t k = 0; k < list.size(); k++)
		if (list[k].area >= smallest)
			s.order.push_back((int)k);
	std::sort(s.order.begin(), s.order.end(),
		  [&list](int a, int b) { return list[a].area > list[b].area; });
	if (s.order.size() > CANDIDATES)
		s.order.resize(CANDIDATES);
	for (int k : s.order) {
		const cv::Rect &piece = list[k].box;
		double area = (double)list[k].area * step;
		const char *fault;
		handle h;

		read_sides(s, k, box, step);
		fault = judge_handle(s, area, h);
		if (!fault && (at_border(h, box) || piece.x == 0 || piece.y == 0 ||
			       piece.x + piece.width == s.mask.cols ||
			       piece.y + piece.height == s.mask.rows))
			/* if cut off, the border would pass for a side */
			fault = "the handle reaches the picture's border";
		if (!fault && area > most) {
			most = area;
			h.box = cv::Rect(box.x + piece.x, box.y + piece.y * step,
					 piece.width, piece.height * step);
			found = h;
			own = k;
		} else if (fault && most == 0 && k == s.order.front()) {
			*why = fault;
		}
	}
	if (own < 0)
		return false;
	if (is_cut(s, own, found, box, step)) {
		*why = "the handle is cut in two";
		return false;
	}
	found.seam = has_seam(s, found, box, step);
	return true;
}

} // namespace vision
