// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Place of a haptic device in the scene; see incise/calibrate_frame.h. Lengths in mm.
 */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <incise/calibrate_frame.h>
#include "../base/vector.h"
#include "dense.h"

#define PLACE_MOST_MM 1e6
#define DEG (M_PI / 180)
/* Extent across the best line, and out of the best plane, of that along the line, rms. */
#define LINE_SHARE 0.15
#define FLAT_SHARE 0.15
/* A mirrored fit is better than the plain one by this factor of the residual. */
#define MIRROR_SHARE 0.25

/* The points of one side, about their middle. */
struct side {
	double middle[3], point[INCISE_FRAME_POINTS_MAX][3];
	double extent[3]; /* rms along the principal axes, ascending */
};

static void center_side(struct side *side, int n)
{
	double scatter[9] = {0}, values[3];

	for (int i = 0; i < n; i++)
		v3_add(side->middle, side->middle, 1.0 / n, side->point[i]);
	for (int i = 0; i < n; i++) {
		v3_sub(side->point[i], side->point[i], side->middle);
		for (int k = 0; k < 9; k++)
			scatter[k] += side->point[i][k / 3] * side->point[i][k % 3] / n;
	}
	incise_eigen(scatter, 3, values);
	for (int k = 0; k < 3; k++)
		side->extent[k] = sqrt(fmax(0, values[k]));
}

/* --- the rotation ----------------------------------------------------------------------- */

/* q turns the points of @from nearest to those of @to; its sign makes q[0] at least 0. */
static void find_turn(const struct side *from, const struct side *to, int n, double q[4])
{
	double s[9] = {0}, m[16], values[4], bound = 0;

	for (int i = 0; i < n; i++)
		for (int k = 0; k < 9; k++)
			s[k] += from->point[i][k / 3] * to->point[i][k % 3];
	for (int k = 0; k < 9; k++)
		bound += 3 * fabs(s[k]);
	/* The lower triangle, made positive by the bound. */
	m[0] = bound + s[0] + s[4] + s[8];
	m[4] = s[5] - s[7];
	m[5] = bound + s[0] - s[4] - s[8];
	m[8] = s[6] - s[2];
	m[9] = s[1] + s[3];
	m[10] = bound - s[0] + s[4] - s[8];
	m[12] = s[1] - s[3];
	m[13] = s[6] + s[2];
	m[14] = s[5] + s[7];
	m[15] = bound - s[0] - s[4] + s[8];
	incise_eigen(m, 4, values);
	for (int k = 0; k < 4; k++)
		q[k] = m[3] < 0 ? -m[4 * k + 3] : m[4 * k + 3];
}

/* Sum of squares of the residuals, each into @residual, if that is not NULL. */
static double sum_residuals(const struct side *from, const struct side *to, int n,
			    const double q[4], double *residual)
{
	double sum = 0, r[3];

	for (int i = 0; i < n; i++) {
		v3_rotate(r, q, from->point[i]);
		v3_sub(r, to->point[i], r);
		sum += v3_dot(r, r);
		if (residual)
			residual[i] = v3_length(r);
	}
	return sum;
}

static bool fits_mirrored(struct side device, const struct side *scene, int n, double sum)
{
	double q[4];

	for (int i = 0; i < n; i++)
		device.point[i][0] = -device.point[i][0];
	find_turn(&device, scene, n, q);
	return sum_residuals(&device, scene, n, q, NULL) <
	       MIRROR_SHARE * MIRROR_SHARE * sum;
}

/* --- uncertainty ------------------------------------------------------------------------ */

/* Half of Student's two-sided 95.45 % for 3, 6, 9, 12 degrees of freedom (GUM, table G.2). */
static const double student[] = {1.653, 1.259, 1.160, 1.116};

/* The further turn, radian, by a change of element @k of a rotation vector by 1 degree. */
static void differentiate_turn(double to[3], const double phi[3], int k)
{
	double axis[3] = {k == 0, k == 1, k == 2}, once[3], twice[3];
	double angle = v3_length(phi), a = 0.5, b = 1.0 / 6;

	if (angle > 1e-3) {
		a = (1 - cos(angle)) / (angle * angle);
		b = (angle - sin(angle)) / (angle * angle * angle);
	}
	v3_cross(once, phi, axis);
	v3_cross(twice, phi, once);
	for (int i = 0; i < 3; i++)
		to[i] = DEG * (axis[i] + a * once[i] + b * twice[i]);
}

/* Add the equations of a point, @x away from the device's origin: p = o + x. */
static void add_normal(double normal[36], const double phi[3], const double x[3])
{
	double rows[3][6] = {{0}}, turn[3], moved[3];

	for (int k = 0; k < 3; k++) {
		differentiate_turn(turn, phi, k);
		v3_cross(moved, turn, x);
		for (int e = 0; e < 3; e++)
			rows[e][k] = moved[e];
		rows[k][3 + k] = 1;
	}
	for (int e = 0; e < 3; e++)
		for (int k = 0; k < 36; k++)
			normal[k] += rows[e][k / 6] * rows[e][k % 6];
}

static void state_uncertainty(const struct incise_frame_point *points, int n,
			      const double q[4], double sum, struct incise_frame_fit *fit)
{
	double phi[3], x[3], normal[36] = {0};

	fit->u_touch_mm = fmax(fit->spread_mm, student[n - INCISE_FRAME_POINTS_MIN] *
						       sqrt(sum / fit->freedom));
	for (int k = 0; k < 3; k++)
		phi[k] = fit->turn_deg[k] * DEG;
	for (int i = 0; i < n; i++) {
		v3_rotate(x, q, points[i].device_mm);
		add_normal(normal, phi, x);
	}
	if (!incise_cholesky(normal, 6))
		return;
	for (int k = 0; k < 6; k++) {
		fit->covariance[7 * k] = fit->u_touch_mm * fit->u_touch_mm;
		incise_cholesky_solve(normal, 6, fit->covariance + 6 * k);
	}
}

/* --- judgement -------------------------------------------------------------------------- */

static int check_numbers(const struct incise_frame_point *points, int n,
			 struct incise_error *err)
{
	if (n < INCISE_FRAME_POINTS_MIN || n > INCISE_FRAME_POINTS_MAX)
		return incise_error_set(err, EDOM,
					"%d points: expected %d to %d; touch as many", n,
					INCISE_FRAME_POINTS_MIN, INCISE_FRAME_POINTS_MAX);
	for (int i = 0; i < n; i++)
		if (!(v3_length(points[i].scene_mm) <= PLACE_MOST_MM &&
		      v3_length(points[i].device_mm) <= PLACE_MOST_MM &&
		      points[i].sd_mm >= 0 && points[i].sd_mm <= PLACE_MOST_MM))
			return incise_error_set(err, EINVAL,
						"point %d: expected finite numbers up to "
						"%g mm; correct it",
						i + 1, PLACE_MOST_MM);
	return 0;
}

static int check_shape(const struct side *side, int n, const char *whose,
		       struct incise_error *err)
{
	double apart[3];

	for (int i = 1; i < n * n; i++) {
		v3_sub(apart, side->point[i / n], side->point[i % n]);
		if (i / n < i % n && v3_length(apart) < INCISE_FRAME_APART_MM)
			return incise_error_set(
				err, EDOM,
				"points %d and %d are %.2g mm apart in %s, less than %g mm; "
				"choose points further apart, and touch each once",
				i / n + 1, i % n + 1, v3_length(apart), whose,
				INCISE_FRAME_APART_MM);
	}
	if (side->extent[1] >= LINE_SHARE * side->extent[2])
		return 0;
	return incise_error_set(
		err, EDOM,
		"the points are nearly on a line in %s: %.2g mm across it, %.2g "
		"mm along it, rms; choose one further off it",
		whose, side->extent[1], side->extent[2]);
}

static int judge_frame(const struct incise_frame_fit *fit, bool mirrored,
		       struct incise_error *err)
{
	if (fit->rms_mm <= INCISE_FRAME_RMS_MM)
		return 0;
	if (mirrored)
		return incise_error_set(
			err, EDOM,
			"the points are mirrored: they fit, but with the sign of an axis "
			"changed; the scene is right-handed: correct its points");
	return incise_error_set(
		err, EDOM,
		"the points miss each other by %.2g mm rms, more than %g mm, and the touched "
		"ones are %.3g times as far apart as the scene's; check their order and that "
		"they are in mm, and keep the handle still",
		fit->rms_mm, INCISE_FRAME_RMS_MM, fit->scale);
}

int incise_calibrate_frame(const struct incise_frame_point *points, int n,
			   struct incise_frame_fit *fit, struct incise_error *err)
{
	struct side scene = {0}, device = {0};
	double q[4], sum, turned[3], size;
	int rc = check_numbers(points, n, err);

	*fit = (struct incise_frame_fit){.freedom = 3 * n - 6};
	if (rc)
		return rc;
	for (int i = 0; i < n; i++) {
		v3_copy(scene.point[i], points[i].scene_mm);
		v3_copy(device.point[i], points[i].device_mm);
		fit->spread_mm = hypot(fit->spread_mm, points[i].sd_mm / sqrt(n));
	}
	center_side(&scene, n);
	center_side(&device, n);
	rc = check_shape(&scene, n, "the scene", err);
	if (!rc)
		rc = check_shape(&device, n, "the device's frame", err);
	if (rc)
		return rc;
	find_turn(&device, &scene, n, q);
	sum = sum_residuals(&device, &scene, n, q, fit->residual_mm);
	fit->rms_mm = sqrt(sum / n);
	fit->flat = scene.extent[0] < FLAT_SHARE * scene.extent[2];
	fit->scale = v3_length(device.extent) / v3_length(scene.extent);
	size = v3_length(q + 1);
	for (int k = 0; k < 3 && size > 0; k++)
		fit->turn_deg[k] = 2 / DEG * atan2(size, q[0]) * q[1 + k] / size;
	v3_rotate(turned, q, device.middle);
	v3_sub(fit->origin_mm, scene.middle, turned);
	state_uncertainty(points, n, q, sum, fit);
	return judge_frame(fit, !fit->flat && fits_mirrored(device, &scene, n, sum), err);
}
