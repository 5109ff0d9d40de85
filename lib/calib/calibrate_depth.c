// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Scale of the frame from two points and from a line; see incise/calibrate_depth.h.
 *
 *     pairs ─ robust start ─ choice of the near ones ─ least squares ─ budget
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibrate_depth.h>
#include "../base/ascending.h"

/* --- repeated readings --- */

#define FEW 20
#define LAGS_MAX 200 /* four seconds of frames */

/*
 * Standard deviation of noise from n absolute residuals, which are sorted, outliers or not
 * (at most a quarter of few). Few residuals give a larger one, so that a good reading is not
 * lost by chance: twice as large for 12.
 */
static double repeats_sd(double *absolute, int n)
{
	double sd = 1.4826 * median(absolute, n);

	/* Few can lie close together by chance: the distance that holds three quarters. */
	if (n < FEW)
		sd = absolute[3 * n / 4] / 1.1503;
	return sd * (1 + 12.0 / n);
}

/* Half of Student's t for 95.45 %, by degrees of freedom. */
static double widen_calibrate_depth(int dof)
{
	static const double t[] = {13.97, 4.53, 3.31, 2.87, 2.65, 2.52, 2.43, 2.37};

	if (dof < 1)
		return t[0] / 2;
	if (dof <= 8)
		return t[dof - 1] / 2;
	return 1 + 1.26 / dof; /* within 0.005 of the table from there on */
}

/*
 * 1 + 2 Σ ρ as long as the correlation is more than chance; ended as Sokal does, at a lag of
 * 5 times the sum so far.
 */
static double correlation_time(const double *r, int n, double power)
{
	double sum = 1;

	for (int lag = 1; lag < n / 4 && lag < LAGS_MAX && lag <= 5 * sum; lag++) {
		double product = 0;

		for (int i = lag; i < n; i++)
			product += r[i] * r[i - lag];
		if (product / power < 2 / sqrt(n))
			break;
		sum += 2 * product / power;
	}
	return sum;
}

/*
 * Standard uncertainty of the mean of n values whose residuals these are, in the order they
 * came; @fitted numbers have been taken from them. As with Student's t, few have a wider
 * one, so that twice it holds 95.45 %. 0 for one value, whose scatter is unknown. *effective:
 * the number of independent values that they are worth.
 */
static double repeats_u(const double *residual, int n, int fitted, int *effective)
{
	double power = 0, times;
	int worth = n;

	for (int i = 0; i < n; i++)
		power += residual[i] * residual[i];
	*effective = n;
	if (n <= fitted || !(power > 0))
		return 0;
	times = n >= 8 ? correlation_time(residual, n, power) : 1;
	worth = (int)(n / times);
	if (worth < fitted + 1)
		worth = fitted + 1;
	*effective = worth;
	return sqrt(power / (n - fitted) / worth) * widen_calibrate_depth(worth - fitted);
}

/* No camera over a cut is outside; calibration.conf takes more for depth_mm_px. */
#define SCALE_MIN 1e-4
#define SCALE_MAX 1.0

#define OUTLIERS_MAX 0.3
#define POINTS_NEAR 5.0 /* robust standard deviations */
#define PAIRS_NEAR 4.0	/* of which noise exceeds once in 16000 */
#define FLOOR_PX 0.01	/* noise below is rounding */
#define FEW_POINTS 10	/* their robust standard deviation is chance */
#define FEW_FLOOR_PX 0.2
#define MEDIANS_MAX 2000 /* pairs in the repeated median; its time is their square */
#define ROUNDS 20

static void add_calibrate_depth_part(struct incise_depth_fit *fit, const char *source,
				     char type, double u, const char *unit,
				     double sensitivity)
{
	fit->budget.part[fit->budget.n++] = (struct incise_calibration_part){
		source, type, u, unit, sensitivity, u * sensitivity};
}

static double sum_parts(const struct incise_calibration_budget *budget)
{
	double sum = 0;

	for (int i = 0; i < budget->n; i++) {
		const struct incise_calibration_part *part = &budget->part[i];

		sum += part->u * part->sensitivity * part->u * part->sensitivity;
	}
	return sqrt(sum);
}

static int check_values(const double *values, int n, const char *name, bool positive,
			struct incise_error *err)
{
	for (int i = 0; i < n; i++)
		if (!isfinite(values[i]) || (positive && !(values[i] > 0)))
			return incise_error_set(err, EINVAL, "%s %d is %g; give a %s",
						name, i + 1, values[i],
						positive ? "number above 0" : "number");
	return 0;
}

static int check_outliers(int n, int inliers, struct incise_error *err)
{
	if (n - inliers <= OUTLIERS_MAX * n)
		return 0;
	return incise_error_set(
		err, EDOM,
		"%d of %d readings are outliers, more than 30 %%; check that vision "
		"finds the scalpel in the frames",
		n - inliers, n);
}

static int check_scale(double mm_px, struct incise_error *err)
{
	if (mm_px >= SCALE_MIN && mm_px <= SCALE_MAX)
		return 0;
	return incise_error_set(
		err, EDOM,
		"%.5g mm per pixel is not a plausible scale; check that mm and pixels "
		"are not swapped",
		mm_px);
}

/* --- two points --- */

int incise_calibrate_depth_points(const struct incise_depth_points *points, bool *inlier,
				  struct incise_depth_fit *fit, struct incise_error *err)
{
	const double *px = points->length_px;
	double middle, spread, mean = 0, u_mean;
	double *copy;
	bool *near;
	int n = points->n, rc, k = 0;

	*fit = (struct incise_depth_fit){.mm_px = NAN, .u_mm_px = NAN, .n = n};
	fit->bend_mm = fit->bend_sd_mm = NAN;
	if (n < 1)
		return incise_error_set(err, EDOM, "no length in pixels was given");
	rc = check_values(px, n, "length", true, err);
	if (!rc)
		rc = check_values(&points->length_mm, 1, "the known length, mm: number",
				  true, err);
	if (!rc && (!(points->u_length_mm >= 0) || !(points->u_px >= 0) ||
		    !isfinite(points->u_length_mm + points->u_px)))
		rc = incise_error_set(err, EINVAL, "an uncertainty is below 0");
	if (rc)
		return rc;
	copy = malloc(n * sizeof(*copy));
	near = malloc(n * sizeof(*near));
	if (!copy || !near) {
		rc = incise_error_set(err, ENOMEM, "out of memory");
		goto out;
	}
	memcpy(copy, px, n * sizeof(*copy));
	middle = median(copy, n);
	for (int i = 0; i < n; i++)
		copy[i] = fabs(px[i] - middle);
	spread = fmax(repeats_sd(copy, n), n < FEW_POINTS ? FEW_FLOOR_PX : FLOOR_PX);
	for (int i = 0; i < n; i++) {
		near[i] = n < 5 || fabs(px[i] - middle) <= POINTS_NEAR * spread;
		if (near[i])
			copy[k++] = px[i];
	}
	if (inlier)
		memcpy(inlier, near, n * sizeof(*near));
	fit->inliers = k;
	rc = check_outliers(n, k, err);
	if (rc)
		goto out;
	fit->low_px = fit->high_px = copy[0];
	for (int i = 0; i < k; i++) {
		mean += copy[i] / k;
		fit->low_px = fmin(fit->low_px, copy[i]);
		fit->high_px = fmax(fit->high_px, copy[i]);
	}
	for (int i = 0; i < k; i++)
		copy[i] -= mean;
	u_mean = repeats_u(copy, k, 1, &fit->effective);
	fit->full_px = mean;
	fit->mm_px = points->length_mm / mean;
	for (int i = 0; i < k; i++) {
		fit->sd_mm += copy[i] * copy[i];
		fit->largest_mm = fmax(fit->largest_mm, fabs(copy[i]) * fit->mm_px);
	}
	fit->sd_mm = k > 1 ? sqrt(fit->sd_mm / (k - 1)) * fit->mm_px : NAN;
	add_calibrate_depth_part(fit, "known length", 'B', points->u_length_mm, "mm",
				 1 / mean);
	add_calibrate_depth_part(fit, "ends of the length, in all repeats", 'B',
				 points->u_px, "px", -fit->mm_px / mean);
	add_calibrate_depth_part(fit, "repeatability", 'A', u_mean, "px",
				 -fit->mm_px / mean);
	fit->u_mm_px = sum_parts(&fit->budget);
	fit->u_full_px = hypot(points->u_px, u_mean);
	fit->covariance = -fit->mm_px / mean * fit->u_full_px * fit->u_full_px;
	rc = check_scale(fit->mm_px, err);
out:
	free(copy);
	free(near);
	return rc;
}

/* --- line --- */

struct calibrate_depth_line {
	double slope, middle_px,
		middle_mm; /* depth = middle_mm + slope (px - middle_px) */
	double sxx;
};

static double off_line(const struct calibrate_depth_line *line, double px, double mm)
{
	return mm - line->middle_mm - line->slope * (px - line->middle_px);
}

/* Repeated medians: the median over pairs of the median slope to all others. */
static int start_line(const struct incise_depth_lengths *p,
		      struct calibrate_depth_line *line)
{
	int step = 1 + (p->n - 1) / MEDIANS_MAX, m = 0, rc = -ENOMEM;
	double *slopes = malloc(p->n * sizeof(*slopes));
	double *each = malloc(p->n * sizeof(*each));

	if (!slopes || !each)
		goto out;
	for (int i = 0; i < p->n; i += step) {
		int k = 0;

		for (int j = 0; j < p->n; j += step)
			if (fabs(p->length_px[j] - p->length_px[i]) > 1)
				slopes[k++] = (p->depth_mm[j] - p->depth_mm[i]) /
					      (p->length_px[j] - p->length_px[i]);
		if (k)
			each[m++] = median(slopes, k);
	}
	rc = -EDOM;
	if (!m)
		goto out;
	line->slope = median(each, m);
	line->middle_px = 0;
	m = 0;
	for (int i = 0; i < p->n; i++)
		each[m++] = p->depth_mm[i] - line->slope * p->length_px[i];
	line->middle_mm = median(each, m);
	rc = 0;
out:
	free(slopes);
	free(each);
	return rc;
}

/* Least squares of the near pairs. */
static void fit_calibrate_depth_line(const struct incise_depth_lengths *p,
				     const bool *near, struct calibrate_depth_line *line)
{
	double sxy = 0;
	int k = 0;

	line->middle_px = line->middle_mm = line->sxx = 0;
	for (int i = 0; i < p->n; i++)
		k += near[i];
	for (int i = 0; i < p->n; i++)
		if (near[i]) {
			line->middle_px += p->length_px[i] / k;
			line->middle_mm += p->depth_mm[i] / k;
		}
	for (int i = 0; i < p->n; i++)
		if (near[i]) {
			double x = p->length_px[i] - line->middle_px;

			line->sxx += x * x;
			sxy += x * (p->depth_mm[i] - line->middle_mm);
		}
	line->slope = sxy / line->sxx;
}

/* Returns the number of near pairs; *changed: they are another set than before. */
static int choose_calibrate_depth(const struct incise_depth_lengths *p,
				  const struct calibrate_depth_line *line,
				  double *residual, bool *near, bool *changed)
{
	double spread;
	int k = 0;

	for (int i = 0; i < p->n; i++)
		residual[i] = fabs(off_line(line, p->length_px[i], p->depth_mm[i]));
	spread = repeats_sd(residual, p->n);
	spread = fmax(spread, FLOOR_PX * fabs(line->slope));
	*changed = false;
	for (int i = 0; i < p->n; i++) {
		bool now = fabs(off_line(line, p->length_px[i], p->depth_mm[i])) <=
			   PAIRS_NEAR * spread;

		*changed |= now != near[i];
		near[i] = now;
		k += now;
	}
	return k;
}

/* The bend of a parabola at the ends of the lengths; q = x² without its part along 1, x. */
static void find_bend(const struct incise_depth_lengths *p, const bool *near,
		      const struct calibrate_depth_line *line,
		      struct incise_depth_fit *fit)
{
	double sx2 = 0, sx3 = 0, sqq = 0, sqr = 0, srr = 0, factor, end = 0;
	int k = fit->inliers;

	for (int i = 0; i < p->n; i++)
		if (near[i]) {
			double x = p->length_px[i] - line->middle_px;

			sx2 += x * x / k;
			sx3 += x * x * x;
		}
	for (int i = 0; i < p->n; i++)
		if (near[i]) {
			double x = p->length_px[i] - line->middle_px;
			double q = x * x - sx2 - sx3 / line->sxx * x;
			double r = off_line(line, p->length_px[i], p->depth_mm[i]);

			sqq += q * q;
			sqr += q * r;
			srr += r * r;
			end = fmax(end, fabs(q));
		}
	/* Only two depths have no parabola. */
	if (!(sqq > 1e-6 * k * sx2 * sx2)) {
		fit->bend_mm = fit->bend_sd_mm = NAN;
		return;
	}
	factor = (double)k / fit->effective;
	fit->bend_mm = fabs(sqr / sqq) * end;
	fit->bend_sd_mm =
		sqrt(fmax(0, srr - sqr * sqr / sqq) / (k - 3) / sqq * factor) * end;
}

static int check_line(const struct calibrate_depth_line *line,
		      const struct incise_depth_fit *fit, struct incise_error *err)
{
	double slope = line->slope;

	if (fit->high_px - fit->low_px < INCISE_DEPTH_SPAN_MIN_PX &&
	    fabs(slope) < SCALE_MAX)
		return incise_error_set(
			err, EDOM,
			"the lengths span only %.1f pixels, %.1f to %.1f; give depths "
			"over at least %g pixels",
			fit->high_px - fit->low_px, fit->low_px, fit->high_px,
			INCISE_DEPTH_SPAN_MIN_PX);
	if (fabs(slope) > SCALE_MAX && 1 / fabs(slope) > SCALE_MIN)
		return incise_error_set(
			err, EDOM,
			"the columns are swapped: %.4g mm per pixel; in the other "
			"order it is %.4g",
			fabs(slope), 1 / fabs(slope));
	if (slope > 0)
		return incise_error_set(
			err, EDOM,
			"the exposed length grows with the depth, %.4g mm per pixel, "
			"but must decrease; check the sign of the depth",
			slope);
	return check_scale(-slope, err);
}

static int fit_pairs(const struct incise_depth_lengths *p, bool *near, double *residual,
		     struct incise_depth_fit *fit, struct incise_error *err)
{
	struct calibrate_depth_line line = {0};
	bool changed = true;
	double u_slope, u_middle, mean_px, zero, *r;
	int rc, k = 0;

	if (start_line(p, &line) == -ENOMEM)
		return incise_error_set(err, ENOMEM, "out of memory");
	/* Equal lengths have no start; the check below names them. */
	fit->low_px = HUGE_VAL;
	fit->high_px = -HUGE_VAL;
	for (int i = 0; i < p->n; i++) {
		fit->low_px = fmin(fit->low_px, p->length_px[i]);
		fit->high_px = fmax(fit->high_px, p->length_px[i]);
	}
	if (fit->high_px - fit->low_px <= 1)
		line.slope = 0;
	rc = check_line(&line, fit, err);
	if (rc)
		return rc;
	for (int round = 0; round < ROUNDS && changed; round++) {
		k = choose_calibrate_depth(p, &line, residual, near, &changed);
		fit->inliers = k;
		rc = check_outliers(p->n, k, err);
		if (rc)
			return rc;
		fit_calibrate_depth_line(p, near, &line);
	}
	fit->low_px = HUGE_VAL;
	fit->high_px = -HUGE_VAL;
	r = residual;
	for (int i = 0; i < p->n; i++)
		if (near[i]) {
			fit->low_px = fmin(fit->low_px, p->length_px[i]);
			fit->high_px = fmax(fit->high_px, p->length_px[i]);
			*r++ = off_line(&line, p->length_px[i], p->depth_mm[i]);
		}
	rc = check_line(&line, fit, err);
	if (rc)
		return rc;
	if (k < INCISE_DEPTH_PAIRS_MIN)
		return incise_error_set(err, EDOM,
					"%d pairs without outliers: give at "
					"least %d",
					k, INCISE_DEPTH_PAIRS_MIN);
	for (int i = 0; i < k; i++) {
		fit->sd_mm += residual[i] * residual[i];
		fit->largest_mm = fmax(fit->largest_mm, fabs(residual[i]));
	}
	fit->sd_mm = sqrt(fit->sd_mm / (k - 2));
	u_middle = repeats_u(residual, k, 2, &fit->effective);
	u_slope = u_middle * sqrt(k / line.sxx);
	fit->mm_px = -line.slope;
	mean_px = line.middle_px;
	fit->full_px = mean_px + line.middle_mm / fit->mm_px;
	add_calibrate_depth_part(fit, "scatter about the line", 'A', u_slope, "mm/px", 1);
	add_calibrate_depth_part(fit, "scale of the gauge", 'B', p->u_scale, "1",
				 fit->mm_px);
	fit->u_mm_px = sum_parts(&fit->budget);
	/* full = middle + depth there / slope; a gauge's scale cancels but for the depth of
	 * the middle, where its zero is. */
	zero = hypot(u_middle, p->u_depth_mm) / fit->mm_px;
	fit->u_full_px = hypot(zero, line.middle_mm / fit->mm_px / fit->mm_px * u_slope);
	fit->covariance = -line.middle_mm / fit->mm_px / fit->mm_px * u_slope * u_slope;
	find_bend(p, near, &line, fit);
	return 0;
}

int incise_calibrate_depth_line(const struct incise_depth_lengths *pairs, bool *inlier,
				struct incise_depth_fit *fit, struct incise_error *err)
{
	bool *near = calloc(pairs->n > 0 ? pairs->n : 1, sizeof(*near));
	double *residual = calloc(pairs->n > 0 ? pairs->n : 1, sizeof(*residual));
	int rc = 0;

	*fit = (struct incise_depth_fit){.mm_px = NAN, .u_mm_px = NAN, .n = pairs->n};
	if (!near || !residual)
		rc = incise_error_set(err, ENOMEM, "out of memory");
	else if (pairs->n < INCISE_DEPTH_PAIRS_MIN)
		rc = incise_error_set(err, EDOM, "%d pairs: give at least %d", pairs->n,
				      INCISE_DEPTH_PAIRS_MIN);
	else if (!(pairs->u_scale >= 0) || !(pairs->u_depth_mm >= 0) ||
		 !isfinite(pairs->u_scale + pairs->u_depth_mm))
		rc = incise_error_set(err, EINVAL, "an uncertainty is below 0");
	if (!rc)
		rc = check_values(pairs->depth_mm, pairs->n, "depth", false, err);
	if (!rc)
		rc = check_values(pairs->length_px, pairs->n, "length", false, err);
	if (!rc)
		rc = fit_pairs(pairs, near, residual, fit, err);
	if (inlier && near)
		memcpy(inlier, near, (pairs->n > 0 ? pairs->n : 0) * sizeof(*near));
	free(near);
	free(residual);
	return rc;
}
