// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/calib/board_lens.c: rotations there and back, a lens there and back, and the
 * place on a board that a pixel shows.
 */
#include "../unit.h"
#include "../../../lib/calib/board_lens.h"

static const union board_lens lens = {
	.by_name = {1000, 1010, 322, 238, -0.25, 0.1, 0.001, -0.001}};

/* R is a rotation, turns about its vector, and comes back; also near 0 and half a turn. */
TEST(test_rotation)
{
	static const double vectors[][3] = {
		{0, 0, 0},	{1e-9, 0, 0},  {1e-5, -2e-5, 3e-5}, {0.3, -0.2, 0.1},
		{1.5, 1, -0.5}, {3.1, 0, 0},   {0, M_PI - 1e-9, 0}, {M_PI, 0, 0},
		{0, 0, -2.9},	{0, 2.2, 2.2}, {-1.8, 1.8, 1.8},
	};

	for (size_t i = 0; i < sizeof(vectors) / sizeof(*vectors); i++) {
		double r[9], again[9], back[3];

		board_rotation(vectors[i], r);
		for (int a = 0; a < 3; a++) {
			double turned = 0;

			for (int b = 0; b < 3; b++) {
				double dot = 0;

				for (int k = 0; k < 3; k++)
					dot += r[3 * a + k] * r[3 * b + k];
				assert_true(fabs(dot - (a == b)) < 1e-12);
				turned += r[3 * a + b] * vectors[i][b];
			}
			assert_true(fabs(turned - vectors[i][a]) < 1e-12);
		}
		board_rotation_vector(r, back);
		board_rotation(back, again);
		/* near half a turn a sine of 1e-6 and less is taken for 0 */
		for (int k = 0; k < 9; k++)
			assert_true(fabs(again[k] - r[k]) < 1e-6);
	}
	/* a quarter turn about z takes x to y */
	double r[9];

	board_rotation((double[]){0, 0, M_PI / 2}, r);
	assert_true(fabs(r[0]) < 1e-12 && fabs(r[3] - 1) < 1e-12);
}

/* Each pixel of a frame, through the lens and back. */
TEST(test_back)
{
	static const double straight[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
	static const double at[3] = {0, 0, 100};

	for (int i = 0; i < 33 * 25; i++) {
		double px[2] = {i % 33 * 20, i / 33 * 20}, ray[2], again[2];

		board_undistort(&lens, px, ray);
		board_project(&lens, straight, at, (double[]){100 * ray[0], 100 * ray[1]},
			      again);
		assert_true(fabs(again[0] - px[0]) < 1e-9);
		assert_true(fabs(again[1] - px[1]) < 1e-9);
	}
}

/* board_meet() returns the point of a tilted board that board_project() projected. */
TEST(test_meet)
{
	static const double pose[BOARD_POSE] = {0.4, -0.3, 0.8, -20, 5, 130};
	double r[9];

	board_rotation(pose, r);
	for (int i = 0; i < 100; i++) {
		double mm[2] = {i % 10 * 4, i / 10 * 3}, px[2], met[2];

		board_project(&lens, r, pose + 3, mm, px);
		board_meet(&lens, pose, px, met);
		assert_true(fabs(met[0] - mm[0]) < 1e-9 && fabs(met[1] - mm[1]) < 1e-9);
	}
}
