// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Frame of a haptic device: exact points give it back, truth is within the stated intervals over
 * random frames, and points that do not fix it are refused with their reason.
 */
#include "../unit.h"
#include <incise/calibrate_frame.h>
#include <incise/calibration.h>
#include "../../../lib/base/vector.h"
#include "../cases.h"
#include "draws.h"

#define N INCISE_FRAME_POINTS_MAX

static const double scene_mm[N][3] = {{0, 0, 0},    {60, 0, 0},	  {0, 50, 0},
				      {20, 20, 40}, {-40, 10, 5}, {10, -50, 20}};

struct frame {
	double turn_deg[3], origin_mm[3], noise_mm;
};

static void quaternion_of(const double turn_deg[3], double q[4])
{
	struct incise_calibration c = {.frame_mm = {1, 2, 3}};
	double origin[3];

	v3_copy(c.frame_turn_deg, turn_deg);
	assert_true(incise_calibration_frame(&c, q, origin));
	assert_true(origin[0] == 1 && origin[1] == 2 && origin[2] == 3);
}

static void touch(const struct frame *frame, struct incise_frame_point *points, int n)
{
	double q[4];

	quaternion_of(frame->turn_deg, q);
	for (int k = 1; k < 4; k++)
		q[k] = -q[k];
	for (int i = 0; i < n; i++) {
		double away[3];

		v3_copy(points[i].scene_mm, scene_mm[i]);
		v3_sub(away, scene_mm[i], frame->origin_mm);
		v3_rotate(points[i].device_mm, q, away);
		for (int k = 0; k < 3; k++)
			points[i].device_mm[k] += frame->noise_mm * normal();
		points[i].sd_mm = 0;
	}
}

static int fit_points(const struct incise_frame_point *points, int n,
		      struct incise_frame_fit *fit, struct incise_error *err)
{
	*err = (struct incise_error){0};
	return incise_calibrate_frame(points, n, fit, err);
}

TEST(test_exact)
{
	static const struct frame frames[] = {
		{{0, 0, 0}, {0, 0, 0}, 0},	     {{90, 0, 0}, {5, -100, 30}, 0},
		{{-120, 60, 80}, {0, 300, -200}, 0}, {{0, 179.9, 0}, {1, 2, 3}, 0},
		{{1e-5, -2e-5, 1e-5}, {1, 2, 3}, 0},
	};
	struct incise_frame_point points[N];
	struct incise_frame_fit fit;
	struct incise_error err;

	for (size_t f = 0; f < sizeof(frames) / sizeof(*frames); f++)
		for (int n = 3; n <= N; n++) {
			touch(&frames[f], points, n);
			assert_int_equal(fit_points(points, n, &fit, &err), 0);
			for (int k = 0; k < 3; k++) {
				assert_true(fabs(fit.turn_deg[k] -
						 frames[f].turn_deg[k]) < 1e-6);
				assert_true(fabs(fit.origin_mm[k] -
						 frames[f].origin_mm[k]) < 1e-6);
			}
			assert_int_equal(fit.freedom, 3 * n - 6);
			assert_true(fit.rms_mm < 1e-9 && fit.flat == (n == 3));
			assert_true(fabs(fit.scale - 1) < 1e-9);
		}
}

/* The share of coordinates within U = 2 u, over frames; Student's for few points. */
TEST(test_intervals)
{
	const int rounds = cases_of(4000, 400);
	int within[N + 1][6] = {{0}}, touched = 0;
	struct incise_frame_point points[N];
	struct incise_frame_fit fit;
	struct incise_error err;

	seed = 7;
	for (int n = 3; n <= N; n++)
		for (int round = 0; round < rounds; round++) {
			struct frame frame = {.noise_mm = 0.3};
			double axis[3] = {normal(), normal(), normal()};

			v3_unit(axis, axis, 0);
			for (int k = 0; k < 3; k++) {
				frame.turn_deg[k] = 170 * uniform() * axis[k];
				frame.origin_mm[k] = 200 * normal();
			}
			touch(&frame, points, n);
			assert_int_equal(fit_points(points, n, &fit, &err), 0);
			for (int k = 0; k < 6; k++) {
				double off = k < 3 ? fit.turn_deg[k] - frame.turn_deg[k]
						   : fit.origin_mm[k - 3] -
							     frame.origin_mm[k - 3];

				within[n][k] += off * off <= 4 * fit.covariance[7 * k];
			}
			touched += fit.u_touch_mm > 0.1;
		}
	for (int n = 3; n <= N; n++)
		for (int k = 0; k < 6; k++) {
			double share = (double)within[n][k] / rounds;

			if (!(share > 0.93 && share < 0.975))
				fail_msg("%d points: %.3f of element %d within U, "
					 "expected 0.954",
					 n, share, k);
		}
	assert_true(touched > 3 * rounds);
}

/* A spread above the residuals is the uncertainty. */
TEST(test_spread)
{
	struct incise_frame_point points[N];
	struct incise_frame_fit fit;
	struct incise_error err;

	touch(&(struct frame){{10, 20, 30}, {1, 2, 3}, 0}, points, 4);
	for (int i = 0; i < 4; i++)
		points[i].sd_mm = i % 2 ? 0.5 : 0.1;
	assert_int_equal(fit_points(points, 4, &fit, &err), 0);
	assert_true(fabs(fit.spread_mm - sqrt((0.25 + 0.01) / 2)) < 1e-12);
	assert_true(fabs(fit.u_touch_mm - fit.spread_mm) < 1e-12);
}

TEST(test_refusals)
{
	struct incise_frame_point good[N], points[N];
	struct incise_frame_fit fit;
	struct incise_error err;

	touch(&(struct frame){{10, 20, 30}, {1, 2, 3}, 0}, good, N);
	assert_error(fit_points(good, 2, &fit, &err), EDOM, &err, "2 points", "3 to 6");
	assert_error(fit_points(good, 7, &fit, &err), EDOM, &err, "7 points");
	memcpy(points, good, sizeof(good));
	points[1].device_mm[2] = NAN;
	assert_error(fit_points(points, N, &fit, &err), EINVAL, &err, "point 2");
	points[1].device_mm[2] = 1e7;
	assert_error(fit_points(points, N, &fit, &err), EINVAL, &err, "point 2");
	memcpy(points, good, sizeof(good));
	points[2].sd_mm = NAN;
	assert_error(fit_points(points, N, &fit, &err), EINVAL, &err, "point 3");
	/* The same point of the device for two of the scene, and of the scene for two of the device. */
	memcpy(points, good, sizeof(good));
	v3_copy(points[2].device_mm, points[0].device_mm);
	assert_error(fit_points(points, N, &fit, &err), EDOM, &err, "points 1 and 3",
		     "the device's frame");
	memcpy(points, good, sizeof(good));
	v3_copy(points[2].scene_mm, points[0].scene_mm);
	assert_error(fit_points(points, N, &fit, &err), EDOM, &err, "points 1 and 3",
		     "the scene");
	/* On a line, but for 3 mm. */
	for (int i = 0; i < 4; i++)
		for (int k = 0; k < 3; k++)
			points[i].scene_mm[k] = points[i].device_mm[k] =
				k ? 3 * (i == k) : 30 * i;
	assert_error(fit_points(points, 4, &fit, &err), EDOM, &err, "nearly on a line");
	/* Mirrored: seen out of a plane only. */
	memcpy(points, good, sizeof(good));
	for (int i = 0; i < N; i++)
		points[i].scene_mm[1] *= -1;
	assert_error(fit_points(points, N, &fit, &err), EDOM, &err, "mirrored");
	assert_int_equal(fit_points(points, 3, &fit, &err), 0);
	assert_true(fit.flat);
	/* In the wrong order, and in m. */
	memcpy(points, good, sizeof(good));
	v3_copy(points[0].scene_mm, good[1].scene_mm);
	v3_copy(points[1].scene_mm, good[2].scene_mm);
	v3_copy(points[2].scene_mm, good[0].scene_mm);
	assert_error(fit_points(points, N, &fit, &err), EDOM, &err, "miss each other",
		     "order");
	for (int i = 0; i < N; i++)
		for (int k = 0; k < 3; k++)
			points[i].device_mm[k] = 1000 * good[i].device_mm[k];
	assert_error(fit_points(points, N, &fit, &err), EDOM, &err, "1e+03 times", "mm");
}
