// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An end of the handle to a few hundredths of a pixel. Pixels are used at their own places,
 * without interpolation:
 *
 *   value    ·····──────   beyond      1. strips along the axis give place and slant
 *          /                           2. medians over the width, a curve fitted to them
 *   ──────/                handle      3. pixels far from that curve are discarded
 *         u                            4. means of the others, the curve fitted again
 *
 * The curve is a step, blurred by a Gaussian and by the pixel's own width, from a level to
 * one that may wander farther out. It is at half of its height at u whatever the blur. For
 * colours, the sum that differs most between handle and background is used: for liver mostly red.
 * tests/unit/vision/edge.c compares its error with the theoretical bound.
 */
#include <algorithm>
#include <cmath>
#include "handle.h"

namespace vision
{

/*
 * The curve that is fitted to an end: a step along the axis, blurred, from the handle's level to
 * that beyond. Pixels and levels.
 *
 *                    ____      RISE …: a random walk, where the tissue has a texture
 *               ____/          BEYOND, one level up to here: what rises nearer is the edge
 *             /
 *   _________/ PLACE           INSIDE; BLUR: sd of a Gaussian, beside the pixel's width
 */
enum { PLACE, BLUR, INSIDE, BEYOND, RISE, RISES = 5, UNKNOWNS = RISE + RISES };

typedef cv::Vec<double, UNKNOWNS> unknowns;
typedef cv::Matx<double, UNKNOWNS, UNKNOWNS> equations;

/* Place of the step, sd of the blur, level of the handle, level beyond at the edge, and the
 * increase of that farther out, per rise_px each. */
struct curve {
	unknowns p;
	double level; /* from here on the level beyond may rise */
};

/* A mean of pixels. */
struct bin {
	double x, y, weight;
};

enum {
	STRIPS = 16,
	FEWEST_STRIPS = 6,
	REFINEMENTS = 3,
	BINS = 96,
	FEWEST = 60,
	PASSES = 15
};

static constexpr double level_px = 2, rise_px = 2;
static constexpr double rise_sd = 1; /* levels, of a step */

static constexpr double reach_px = 14;	/* of the search, at least */
static constexpr double widest_px = 48; /* of the search, at most */
static constexpr double clear_px = 8;	/* from the end on: mostly one colour */
static constexpr double window_px = 12; /* of the curve, to each side */
/* Largest misfit; beyond it, the fit is repeated with this smaller reach. */
static constexpr double most_misfit = 0.04;
static constexpr double near_px = 1.5, near_blurs = 2;
static constexpr double across = 0.8;	 /* share of the width: the sides are blurred */
static constexpr double steepest = 1.5;	 /* slant of the edge */
static constexpr double most_more = 0.1; /* correction of the slant */
static constexpr double least_step = 8;	 /* levels */
static constexpr double keep_sd = 3.5;
static constexpr double floor_share[2] = {0.04, 0.02}; /* of the step: no outlier below */

static double normal(double x)
{
	return std::exp(-0.5 * x * x) * 0.3989422804014327;
}

static double cumulated(double x)
{
	return 0.5 * std::erfc(-x * 0.7071067811865475);
}

/* The curve at @x; its derivatives in @d, unless that is NULL. */
static double curve_at(const curve &c, double x, unknowns *d)
{
	double s = c.p[BLUR], a = (x + 0.5 - c.p[PLACE]) / s,
	       b = (x - 0.5 - c.p[PLACE]) / s;
	double ca = b >= 5, cb = ca, na = 0, nb = 0;

	/* Most pixels are far from the edge. */
	if (a > -5 && b < 5) {
		ca = cumulated(a);
		cb = cumulated(b);
		na = normal(a);
		nb = normal(b);
	}
	double part = s * (a * ca + na - b * cb - nb); /* of the step, in 0 … 1 */
	double far = (x - c.level) / rise_px, beyond = c.p[BEYOND];

	for (int k = 0; k < RISES; k++)
		beyond += c.p[RISE + k] * std::min(std::max(far - k, 0.0), 1.0);
	double step = beyond - c.p[INSIDE];

	if (d) {
		*d = unknowns();
		(*d)[PLACE] = -step * (ca - cb);
		(*d)[BLUR] = step * (na - nb);
		(*d)[INSIDE] = 1 - part;
		(*d)[BEYOND] = part;
		for (int k = 0; k < RISES; k++)
			(*d)[RISE + k] = part * std::min(std::max(far - k, 0.0), 1.0);
	}
	return c.p[INSIDE] + step * part;
}

/* The level beyond starts to wander here, past the blur. */
static double level_from(const curve &c)
{
	return c.p[PLACE] + std::max(level_px, 1.25 * c.p[BLUR]);
}

/*
 * Least squares from @c, which is nearly right: Levenberg-Marquardt. @noise: of a pixel.
 * @variance: of PLACE, over the variance of a mean of weight 1.
 */
static bool fit_curve(const bin *bins, int n, double noise, curve &c, double *variance)
{
	double damping = 1e-3, best = HUGE_VAL,
	       flat = noise * noise / (rise_sd * rise_sd);
	unknowns start = c.p, gradient;
	equations normal_matrix;
	curve trial = c;

	for (int pass = 0; pass < PASSES; pass++) {
		equations m = equations::zeros();
		unknowns g;
		double sum = 0;

		for (int i = 0; i < n; i++) {
			unknowns d;
			double r = bins[i].y - curve_at(trial, bins[i].x, &d);

			sum += bins[i].weight * r * r;
			for (int k = 0; k < UNKNOWNS; k++) {
				double w = bins[i].weight * d[k];

				g[k] += w * r;
				for (int l = 0; l <= k; l++)
					m(k, l) += w * d[l];
			}
		}
		for (int k = RISE; k < UNKNOWNS; k++) {
			m(k, k) += flat;
			g[k] -= flat * trial.p[k];
			sum += flat * trial.p[k] * trial.p[k];
		}
		for (int k = 0; k < UNKNOWNS; k++)
			for (int l = 0; l < k; l++)
				m(l, k) = m(k, l);
		if (!std::isfinite(sum))
			return false;
		if (sum <= best) {
			/* a hundredth of the sd, for a hundred bins */
			bool settled = best - sum <= 1e-6 * sum;

			best = sum;
			c = trial;
			normal_matrix = m;
			gradient = g;
			damping *= 0.2;
			if (settled)
				break;
		} else {
			damping *= 8;
		}
		/* From the best so far; after a bad step by its old equations. */
		equations damped = normal_matrix;
		for (int k = 0; k < UNKNOWNS; k++)
			damped(k, k) += damping * normal_matrix(k, k) + 1e-9;
		bool ok;
		unknowns by = damped.inv(cv::DECOMP_CHOLESKY, &ok) * gradient;
		if (!ok)
			return false;
		trial.p = c.p + by;
		trial.p[BLUR] = std::min(std::max(trial.p[BLUR], 0.05), 8.0);
		trial.p[PLACE] = std::min(std::max(trial.p[PLACE], start[PLACE] - 8),
					  start[PLACE] + 8);
	}
	bool ok;
	for (int k = 0; k < UNKNOWNS; k++)
		normal_matrix(k, k) += 1e-9;
	*variance = normal_matrix.inv(cv::DECOMP_CHOLESKY, &ok)(PLACE, PLACE);
	return ok && std::fabs(c.p[PLACE] - start[PLACE]) < 7.9;
}

/* The curve over the window, for many pixels: between 16 values per pixel by a line. */
struct drawn {
	enum { FINE = 16, VALUES = 2 * (int)window_px * FINE + 2 };
	float value[VALUES];
	double from;

	drawn(const curve &c, double place) : from(place - window_px)
	{
		for (int i = 0; i < VALUES; i++)
			value[i] = (float)curve_at(c, from + (double)i / FINE, nullptr);
	}

	/* @u: within the window */
	float operator()(double u) const
	{
		double x = std::min(std::max((u - from) * FINE, 0.0), VALUES - 2.0);
		int i = (int)x;

		return value[i] + (float)(x - i) * (value[i + 1] - value[i]);
	}
};

static float median(std::vector<float> &values)
{
	auto middle = values.begin() + values.size() / 2;

	std::nth_element(values.begin(), middle, values.end());
	return *middle;
}

static int middle_of(const int *count, int n)
{
	int value = 0;

	for (int below = count[0]; below <= n / 2 && value < 255; below += count[value])
		value++;
	return value;
}

/* The pixels around the end; a colour becomes one number that rises outwards. */
static bool gather_edge(edge_search &s, const image &image, const cv::Point2d &end,
			const cv::Point2d &out, double reach, double half)
{
	int channels = image.channels();
	double wide = std::fabs(out.x) * reach + std::fabs(out.y) * half;
	double high = std::fabs(out.y) * reach + std::fabs(out.x) * half;
	cv::Rect box(
		cv::Point((int)std::floor(end.x - wide), (int)std::floor(end.y - high)),
		cv::Point((int)std::ceil(end.x + wide), (int)std::ceil(end.y + high)));
	int count[2][3][256] = {};
	double weight[3] = {1, 0, 0}, norm = 0;
	int n[2] = {};

	box &= image.area;
	s.samples.clear();
	for (int pass = 0; pass < 2; pass++) {
		for (int y = box.y; y < box.y + box.height; y++)
			for (int x = box.x; x < box.x + box.width; x++) {
				double dx = x + 0.5 - end.x, dy = y + 0.5 - end.y;
				double u = dx * out.x + dy * out.y;
				double v = dx * out.y - dy * out.x;
				float value[3];

				if (std::fabs(u) > reach || std::fabs(v) > half)
					continue;
				if (!pass && std::fabs(u) < clear_px)
					continue;
				image.pixel(x, y, value);
				if (!pass) {
					n[u > 0]++;
					for (int k = 0; k < channels; k++)
						count[u > 0][k][(uint8_t)value[k]]++;
					continue;
				}
				double total = 0;
				for (int k = 0; k < channels; k++)
					total += weight[k] * value[k];
				s.samples.push_back({(float)u, (float)v, (float)total});
			}
		if (pass)
			break;
		if (n[0] < FEWEST || n[1] < FEWEST)
			return false;
		for (int k = 0; k < channels; k++) {
			weight[k] = middle_of(count[1][k], n[1]) -
				    middle_of(count[0][k], n[0]);
			norm += weight[k] * weight[k];
		}
		norm = std::sqrt(norm);
		for (int k = 0; k < channels; k++)
			weight[k] = norm > 0 ? weight[k] / norm : k == 0;
	}
	return true;
}

/*
 * The best split of a strip's profile, one value per pixel: as few values as possible are on the
 * wrong side of half of the height, so that neither reflections on the handle nor crumbs beyond
 * it pass for its end. The area around the split then gives the place.
 */
static bool cross(const double *profile, int n, double *place)
{
	enum { AROUND = 4, NEAR = 8 };
	std::vector<float> inner(profile, profile + n / 4);
	std::vector<float> outer(profile + n - n / 4, profile + n);
	double low = median(inner), high = median(outer), half = (low + high) / 2;
	int wrong = 0, least = n, split = 0;

	if (high - low < least_step)
		return false;
	for (int i = 0; i < n; i++)
		wrong += profile[i] < half;
	for (int i = 0; i < n; i++) {
		wrong += profile[i] < half ? -1 : 1;
		if (wrong < least) {
			least = wrong;
			split = i + 1;
		}
	}
	if (split < NEAR || split + NEAR > n)
		return false;
	/* Levels from close by: the background has a texture. */
	inner.assign(profile + split - NEAR, profile + split - 2);
	outer.assign(profile + split + 2, profile + split + NEAR);
	low = median(inner);
	high = median(outer);
	if (high - low < least_step)
		return false;
	*place = split - AROUND;
	for (int i = split - AROUND; i < split + AROUND; i++)
		*place +=
			std::min(std::max((high - profile[i]) / (high - low), 0.0), 1.0);
	return true;
}

static int strip_of(const sample &p, double half)
{
	int strip = (int)((p.v / half + 1) / 2 * STRIPS);

	return std::min(std::max(strip, 0), STRIPS - 1);
}

/*
 * A robust line u = place + slope v through the strips' places. Strips far from it, by a
 * reflection over the edge, lose their pixels; @share of the strips is left.
 */
static bool find_line(edge_search &s, double reach, double half, double *place,
		      double *slope, double *share)
{
	int bins = 2 * (int)reach, found = 0;
	double sum[STRIPS][2 * (int)widest_px] = {}, u[STRIPS], v[STRIPS];
	int count[STRIPS][2 * (int)widest_px] = {}, which[STRIPS], left = 0;
	bool good[STRIPS] = {};
	double phase[STRIPS] = {};
	int total[STRIPS] = {};

	for (const sample &p : s.samples) {
		int strip = strip_of(p, half);
		int i = (int)std::floor(p.u + bins / 2);

		if (i < 0 || i >= bins)
			continue;
		sum[strip][i] += p.value;
		/* If upright, all pixels of a row are at one place within their bin. */
		phase[strip] += p.u + bins / 2 - i - 0.5;
		total[strip]++;
		count[strip][i]++;
	}
	for (int k = 0; k < STRIPS; k++) {
		double profile[2 * (int)widest_px];
		int from = 0, to = bins;

		/* The image may end within the reach. */
		while (from < bins && !count[k][from])
			from++;
		while (to > from && !count[k][to - 1])
			to--;
		for (int i = from; i < to; i++)
			profile[i] =
				count[k][i] ? sum[k][i] / count[k][i] : profile[i - 1];
		if (to - from < 16 || !cross(profile + from, to - from, &u[found]))
			continue;
		u[found] += from - bins / 2 + phase[k] / total[k];
		v[found] = ((k + 0.5) / STRIPS * 2 - 1) * half;
		which[found++] = k;
	}
	if (found < FEWEST_STRIPS)
		return false;
	/* Each pair proposes a line, all vote. */
	const double limit = 1.2;
	double most = 0;
	*slope = *place = 0;
	for (int k = 0; k < found; k++)
		for (int l = 0; l < k; l++) {
			double a = (u[k] - u[l]) / (v[k] - v[l]), b = u[k] - a * v[k];
			double votes = 0;

			if (std::fabs(a) > steepest)
				continue;
			for (int m = 0; m < found; m++) {
				double r = (u[m] - b - a * v[m]) / limit;

				votes += std::max(0.0, 1 - r * r);
			}
			/* The mask's end is accurate to some pixels. */
			votes -= 0.1 * std::fabs(b);
			if (votes > most) {
				most = votes;
				*slope = a;
				*place = b;
			}
		}
	if (!(most > 0))
		return false;
	for (int k = 0; k < found; k++)
		if (std::fabs(u[k] - *slope * v[k] - *place) <= limit) {
			good[which[k]] = true;
			left++;
		}
	/* Refine the slant by least squares, so that it does not smear the edge. */
	double mu = 0, mv = 0, vv = 0, uv = 0;
	for (int k = 0; k < found; k++)
		if (good[which[k]]) {
			mu += u[k] / left;
			mv += v[k] / left;
		}
	for (int k = 0; k < found; k++)
		if (good[which[k]]) {
			vv += (v[k] - mv) * (v[k] - mv);
			uv += (v[k] - mv) * (u[k] - mu);
		}
	if (left >= FEWEST_STRIPS && vv > 0) {
		*slope = std::min(std::max(uv / vv, -steepest), steepest);
		*place = mu - *slope * mv;
	}
	*share = (double)left / STRIPS;
	s.samples.erase(
		std::remove_if(s.samples.begin(), s.samples.end(),
			       [&](const sample &p) { return !good[strip_of(p, half)]; }),
		s.samples.end());
	return left >= FEWEST_STRIPS;
}

/* Medians of the pixels in bins of half a pixel. */
static int by_medians(edge_search &s, double place, bin *bins)
{
	enum { HALVES = 4 * (int)window_px };
	std::vector<float> &values = s.sorted;
	int begin[HALVES + 1] = {}, filled[HALVES] = {}, n = 0;
	double sum[HALVES] = {};
	auto which = [place](const sample &p) {
		return (int)std::floor((p.u - place) * 2) + HALVES / 2;
	};

	for (const sample &p : s.samples)
		begin[which(p) + 1]++;
	for (int i = 0; i < HALVES; i++)
		begin[i + 1] += begin[i];
	values.resize(s.samples.size());
	for (const sample &p : s.samples) {
		int i = which(p);

		values[begin[i] + filled[i]++] = p.value;
		sum[i] += p.u;
	}
	for (int i = 0; i < HALVES; i++) {
		if (!filled[i])
			continue;
		auto from = values.begin() + begin[i], to = from + filled[i];
		auto middle = from + filled[i] / 2;

		std::nth_element(from, middle, to);
		bins[n++] = {sum[i] / filled[i], *middle, (double)filled[i]};
	}
	return n;
}

/* Means of those near the curve, in bins of a quarter. */
static int by_means(edge_search &s, double place, double end, double limit, bin *bins,
		    double *kept)
{
	double x[BINS] = {}, y[BINS] = {};
	int count[BINS] = {}, n = 0, all = 1, good = 0;

	for (size_t k = 0; k < s.samples.size(); k++) {
		const sample &p = s.samples[k];
		int i = (int)std::floor((p.u - place) * 4) + BINS / 2;

		if (p.u > end || i < 0 || i >= BINS)
			continue;
		all++;
		if (s.sorted[k] > limit)
			continue;
		good++;
		x[i] += p.u;
		y[i] += p.value;
		count[i]++;
	}
	for (int i = 0; i < BINS; i++)
		if (count[i])
			bins[n++] = {x[i] / count[i], y[i] / count[i], (double)count[i]};
	*kept = (double)good / all;
	return n;
}

/*
 * Refine the slant from all pixels near the curve, by least squares of its residuals, together
 * with the place. The line may have been affected by a reflection over a corner.
 */
static void straighten(edge_search &s, const drawn &line, double limit)
{
	double dd = 0, dv = 0, vv = 0, rd = 0, rv = 0;

	for (size_t k = 0; k < s.samples.size(); k++) {
		const sample &p = s.samples[k];
		double d = 2 * (line(p.u + 0.25) - line(p.u - 0.25));
		double r = p.value - line(p.u);

		if (s.sorted[k] > limit)
			continue;
		dd += d * d;
		dv += d * d * p.v;
		vv += d * d * p.v * p.v;
		rd += r * d;
		rv += r * d * p.v;
	}
	double by = dd * vv - dv * dv;
	double more = by > 1e-6 * dd * vv ? (dd * rv - dv * rd) / by : 0;
	/* The curve has the pixel at u + more v. */
	more = std::min(std::max(more, -most_more), most_more);
	for (sample &p : s.samples)
		p.u += (float)(more * p.v);
}

/*
 * From a curve that is nearly right: discard pixels far from it, fit means, and repeat. The
 * background counts as far as @blurs blurs and @more pixels.
 */
static bool refine(edge_search &s, double place, double more, double blurs, curve c,
		   edge &found)
{
	double variance, limit, end, square = 0;
	bin bins[BINS];
	int n;

	for (int pass = 0; pass < REFINEMENTS; pass++) {
		double step = std::fabs(c.p[BEYOND] - c.p[INSIDE]), noise;
		drawn line(c, place);

		s.sorted.clear();
		for (const sample &p : s.samples)
			s.sorted.push_back(std::fabs(p.value - line(p.u)));
		s.residuals = s.sorted;
		noise = std::max(1.0, 1.4826 * median(s.residuals));
		limit = keep_sd * std::max(noise, 1 + floor_share[pass > 0] * step);
		end = c.p[PLACE] + more + blurs * c.p[BLUR];
		n = by_means(s, place, end, limit, bins, &found.kept);
		c.level = level_from(c);
		if (n < 8 || !fit_curve(bins, n, noise, c, &variance))
			return false;
		if (pass + 1 < REFINEMENTS)
			straighten(s, drawn(c, place), limit);
	}

	drawn line(c, place);
	size_t used = 0;
	for (size_t k = 0; k < s.samples.size(); k++) {
		const sample &p = s.samples[k];

		if (s.sorted[k] > limit || p.u > end)
			continue;
		double r = p.value - line(p.u);
		square += r * r;
		used++;
	}
	found.u = c.p[PLACE];
	found.step = c.p[BEYOND] - c.p[INSIDE];
	found.noise = std::sqrt(square / std::max<size_t>(used, 6));
	/* Texture, or a curve of another form, does not average out as noise does. */
	double excess = 0, near = 0, weight = 0, white = 0;
	for (int i = 0; i < n; i++) {
		double r = bins[i].y - curve_at(c, bins[i].x, nullptr);

		excess += bins[i].weight * r * r;
		if (std::fabs(bins[i].x - c.p[PLACE]) > clear_px)
			continue;
		near += bins[i].weight * r * r;
		weight += bins[i].weight;
		white += found.noise * found.noise;
	}
	excess = std::sqrt(excess / std::max(n - 5, 1));
	found.sd = std::max(found.noise, excess) * std::sqrt(variance);
	found.misfit = std::sqrt(std::max(near - white, 0.0) / std::max(weight, 1.0)) /
		       std::max(found.step, 1.0);
	return found.step >= least_step && std::isfinite(found.sd);
}

const char *edge_find(edge_search &s, const image &image, const cv::Point2d &end,
		      const cv::Point2d &out, double half_px, edge &found)
{
	static const char *const no_step = "the handle's end does not stand out";
	double half = across * half_px;
	double reach = std::floor(std::min(reach_px + half, widest_px));
	double place, slope, share, variance;
	bin bins[BINS];
	curve c;
	int n;

	if (!gather_edge(s, image, end, out, reach, half))
		return "the handle reaches the picture's border";
	if (!find_line(s, reach, half, &place, &slope, &share))
		return no_step;

	/* From here on u is corrected for the slant. */
	size_t left = 0;
	int n_inside = 0, n_beyond = 0;
	for (sample p : s.samples) {
		p.u -= (float)(slope * p.v);
		if (!(std::fabs(p.u - place) < window_px))
			continue;
		n_inside += p.u < place - 4;
		n_beyond += p.u > place + 4;
		s.samples[left++] = p;
	}
	s.samples.resize(left);
	if (n_inside < FEWEST || n_beyond < FEWEST)
		return "the handle reaches the picture's border";

	n = by_medians(s, place, bins);
	c.p = unknowns();
	c.p[PLACE] = place;
	c.p[BLUR] = 1;
	c.p[INSIDE] = bins[0].y;
	c.p[BEYOND] = bins[n - 1].y;
	c.level = level_from(c);
	if (!fit_curve(bins, n, 4, c, &variance))
		return no_step;
	if (!refine(s, place, window_px, 0, c, found))
		return no_step;
	if (found.misfit > most_misfit) {
		/* Something else beyond, such as a bright rim: use a smaller reach. */
		edge near;

		if (refine(s, place, near_px, near_blurs, c, near) &&
		    near.misfit < found.misfit)
			found = near;
	}
	found.kept *= share;
	return nullptr;
}

} // namespace vision
