// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Place of a haptic device in the scene; see incise/calibrate_frame.h. Lengths in mm.
 */
#include <errno.h>
#include <math.h>
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

struct solution {
	double q[4], origin_mm[3];
	double square[INCISE_FRAME_POINTS_MAX], sum; /* of the residuals */
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

/* The turn that brings the device's points nearest to the scene's. */
static void find_turn(const struct side *device, const struct side *scene, int n,
		      double q[4])
{
	double s[9] = {0}, m[16], values[4], bound = 0;

	for (int i = 0; i < n; i++)
		for (int k = 0; k < 9; k++)
			s[k] += device->point[i][k / 3] * scene->point[i][k % 3];
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

static void solve_points(const struct side *device, const struct side *scene, int n,
			 struct solution *s)
{
	double r[3];

	find_turn(device, scene, n, s->q);
	s->sum = 0;
	for (int i = 0; i < n; i++) {
		v3_rotate(r, s->q, device->point[i]);
		v3_sub(r, scene->point[i], r);
		s->square[i] = v3_dot(r, r);
		s->sum += s->square[i];
	}
	v3_rotate(r, s->q, device->middle);
	v3_sub(s->origin_mm, scene->middle, r);
}

static bool fits_mirrored(struct side device, const struct side *scene, int n, double sum)
{
	struct solution s;

	for (int i = 0; i < n; i++)
		device.point[i][0] = -device.point[i][0];
	solve_points(&device, scene, n, &s);
	return s.sum < MIRROR_SHARE * MIRROR_SHARE * sum;
}

/* --- uncertainty ------------------------------------------------------------------------ */

#define MOVE_MM 1e-4 /* of a point, for derivatives */

/* Half of Student's two-sided 95.45 % for 3, 6, 9, 12 degrees of freedom (GUM, table G.2). */
static const double student[] = {1.653, 1.259, 1.160, 1.116};

/* Turn and origin; the turn on the side of @near, for half a turn has two axes. */
static void list_values(const struct solution *s, const double near[4], double values[6])
{
	double dot = s->q[0] * near[0] + v3_dot(s->q + 1, near + 1);
	double sign = dot < 0 ? -1 : 1, size = v3_length(s->q + 1);

	for (int k = 0; k < 3; k++) {
		values[k] = size > 0 ? 2 / DEG * atan2(size, sign * s->q[0]) * sign *
					       s->q[1 + k] / size
				     : 0;
		values[3 + k] = s->origin_mm[k];
	}
}

/* Each coordinate of each point has the same uncertainty, and its own error. */
static void add_covariance(const struct side *device, const struct side *scene, int n,
			   const struct solution *s, struct incise_frame_fit *fit)
{
	double at[6], moved[6];

	list_values(s, s->q, at);
	for (int i = 0; i < 3 * n; i++) {
		struct side other = *device;
		struct solution next;

		other.point[i / 3][i % 3] += MOVE_MM;
		other.middle[i % 3] += MOVE_MM / n;
		for (int k = 0; k < n; k++)
			other.point[k][i % 3] -= MOVE_MM / n;
		solve_points(&other, scene, n, &next);
		list_values(&next, s->q, moved);
		for (int k = 0; k < 36; k++)
			fit->covariance[k] += (moved[k / 6] - at[k / 6]) *
					      (moved[k % 6] - at[k % 6]) *
					      pow(fit->u_touch_mm / MOVE_MM, 2);
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
	struct solution s;
	double values[6];
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
	solve_points(&device, &scene, n, &s);
	list_values(&s, s.q, values);
	v3_copy(fit->turn_deg, values);
	v3_copy(fit->origin_mm, s.origin_mm);
	for (int i = 0; i < n; i++)
		fit->residual_mm[i] = sqrt(s.square[i]);
	fit->rms_mm = sqrt(s.sum / n);
	fit->flat = scene.extent[0] < FLAT_SHARE * scene.extent[2];
	fit->scale = v3_length(device.extent) / v3_length(scene.extent);
	fit->u_touch_mm = fmax(fit->spread_mm, student[n - INCISE_FRAME_POINTS_MIN] *
						       sqrt(s.sum / fit->freedom));
	add_covariance(&device, &scene, n, &s, fit);
	return judge_frame(fit, !fit->flat && fits_mirrored(device, &scene, n, s.sum),
			   err);
}
