// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Scale from two points and from a line: planted truth, stated intervals on 2000
 * random rigs, outliers that are named, and what is refused.
 */
#include "../unit.h"
#include <incise/calibrate_depth.h>
#include "../../../lib/calib/calibrate_depth.c"
#include "draws.h"

#define RIGS 2000
#define PAIRS 60

/* Seeds that follow each other would have much in common. */
static void begin(uint64_t rig)
{
	seed = rig * 0x9e3779b97f4a7c15u;
	seed ^= seed >> 29;
	for (int i = 0; i < 10; i++)
		uniform();
}

/* 95.45 % of 2000 are 1909, with a standard deviation of 9.3: three of these. */
static void in_interval(int held)
{
	assert_in_range(held, 1881, 1937);
}

static struct incise_depth_points points_of(const double *px, int n)
{
	return (struct incise_depth_points){
		.length_mm = 47.5,
		.u_length_mm = 0.012,
		.length_px = px,
		.n = n,
		.u_px = 0.02,
	};
}

/* The paper's figures, to the last digit; the budget by hand. */
TEST(test_paper)
{
	const double px[] = {400};
	struct incise_depth_points points = points_of(px, 1);
	struct incise_depth_fit fit;
	bool inlier[1];

	assert_int_equal(incise_calibrate_depth_points(&points, inlier, &fit, NULL), 0);
	assert_true(fit.mm_px == 47.5 / 400);
	assert_true(fit.full_px == 400);
	assert_true(inlier[0]);
	assert_int_equal(fit.budget.n, 3);
	/* u/mm_px: 0.012/47.5 and 0.02/400 */
	assert_true(fabs(fit.u_mm_px / fit.mm_px - hypot(0.012 / 47.5, 0.02 / 400)) <
		    1e-12);
}

/* Repeats: 1 to 50 of them, with noise, a length that is off, ends that are off. */
static void points_truth(int n, double correlation)
{
	int held = 0;

	for (int rig = 1; rig <= RIGS; rig++) {
		double px[50], truth, full, off, noise = 0;
		struct incise_depth_points points = points_of(px, n);
		struct incise_depth_fit fit;

		begin(1000 * n + rig);
		truth = 0.1 + 0.04 * uniform();
		full = (47.5 + 0.012 * normal()) / truth;
		off = 0.02 * normal();
		for (int i = 0; i < n; i++) {
			noise = correlation * noise +
				sqrt(1 - correlation * correlation) * 0.05 * normal();
			px[i] = full + off + noise;
		}
		assert_int_equal(incise_calibrate_depth_points(&points, NULL, &fit, NULL),
				 0);
		held += fabs(fit.mm_px - truth) <= 2 * fit.u_mm_px;
		/* 0.12 % is 4.7 standard uncertainties of the length */
		assert_true(fabs(fit.mm_px / truth - 1) < 1.2e-3);
	}
	in_interval(held);
}

TEST(test_points_truth)
{
	points_truth(10, 0);
	points_truth(50, 0);
	points_truth(50, 0.6);
}

/* Few repeats and nothing else that is uncertain: the interval is Student's. */
TEST(test_few_repeats)
{
	for (int n = 2; n <= 6; n++) {
		int held = 0;

		for (int rig = 1; rig <= RIGS; rig++) {
			double px[6];
			struct incise_depth_points points = points_of(px, n);
			struct incise_depth_fit fit;

			begin(7000 * n + rig);
			points.u_length_mm = points.u_px = 0;
			for (int i = 0; i < n; i++)
				px[i] = 400 + 0.05 * normal();
			assert_int_equal(incise_calibrate_depth_points(&points, NULL,
								       &fit, NULL),
					 0);
			held += fabs(fit.full_px - 400) <= 2 * fit.u_full_px;
		}
		in_interval(held);
	}
}

TEST(test_points_outliers)
{
	double px[20];
	struct incise_depth_points points = points_of(px, 20);
	struct incise_depth_fit fit;
	bool inlier[20];

	seed = 5;
	for (int i = 0; i < 20; i++)
		px[i] = 400 + 0.05 * normal();
	px[3] = 371;
	px[11] = 402;
	assert_int_equal(incise_calibrate_depth_points(&points, inlier, &fit, &err), 0);
	assert_int_equal(fit.inliers, 18);
	for (int i = 0; i < 20; i++)
		assert_int_equal(inlier[i], i != 3 && i != 11);
	/* more than 30 %, one of before among them */
	for (int i = 0; i < 7; i++)
		px[i] = 300 + 10 * i;
	assert_error(incise_calibrate_depth_points(&points, inlier, &fit, &err), EDOM,
		     &err, "8 of 20");
}

TEST(test_points_refused)
{
	static const struct {
		double px, mm, u;
		int n, code;
		const char *text;
	} cases[] = {
		{400, 47.5, 0.01, 0, -EDOM, "no length"},
		{-1, 47.5, 0.01, 1, -EINVAL, "-1"},
		{NAN, 47.5, 0.01, 1, -EINVAL, "nan"},
		{400, 0, 0.01, 1, -EINVAL, "known length"},
		{400, NAN, 0.01, 1, -EINVAL, "known length"},
		{400, 47.5, -1, 1, -EINVAL, "uncertainty"},
		{47.5, 400, 0.01, 1, -EDOM, "swapped"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_depth_points points = points_of(&cases[i].px, cases[i].n);
		struct incise_depth_fit fit;
		struct incise_error err = {0};

		points.length_mm = cases[i].mm;
		points.u_length_mm = cases[i].u;
		assert_int_equal(incise_calibrate_depth_points(&points, NULL, &fit, &err),
				 cases[i].code);
		assert_says(err.text, cases[i].text);
	}
}

/* ---- line --------------------------------------------------------------------------- */

struct line_data {
	double mm[PAIRS], px[PAIRS], truth, full;
};

static void make_line(struct line_data *d, int n, double noise_mm)
{
	d->truth = 0.1 + 0.04 * uniform();
	d->full = 47.5 / d->truth;
	for (int i = 0; i < n; i++) {
		double depth = 20 * uniform();

		d->mm[i] = depth + noise_mm * normal();
		d->px[i] = d->full - depth / d->truth + 0.03 * normal();
	}
}

static struct incise_depth_lengths pairs_of(const struct line_data *d, int n)
{
	return (struct incise_depth_lengths){
		.depth_mm = d->mm, .length_px = d->px, .n = n};
}

TEST(test_line_truth)
{
	static const struct {
		int n;
		double wrong, noise_mm, gauge;
	} cases[] = {{8, 0, 0.02, 0}, {60, 0, 0.02, 0.0003}, {60, 0.1, 0.02, 0}};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		int held = 0, held_full = 0, n = cases[c].n;

		for (int rig = 1; rig <= RIGS; rig++) {
			struct line_data d;
			struct incise_depth_lengths pairs = pairs_of(&d, n);
			struct incise_depth_fit fit;
			bool inlier[PAIRS];
			double gauge;
			int wrong = (int)(cases[c].wrong * n);

			begin(100000 * (c + 1) + rig);
			make_line(&d, n, cases[c].noise_mm);
			gauge = 1 + cases[c].gauge * normal();
			for (int i = 0; i < n; i++)
				d.mm[i] *= gauge;
			/* 10 % of the pairs: some to one side, some swapped */
			for (int i = 0; i < wrong; i++) {
				if (i % 2)
					d.px[i] -= 15 + 50 * uniform();
				else {
					double swap = d.mm[i];

					d.mm[i] = d.px[i];
					d.px[i] = swap;
				}
			}
			pairs.u_scale = cases[c].gauge;
			if (incise_calibrate_depth_line(&pairs, inlier, &fit, &err))
				fail_msg("case %zu, rig %d: %s", c, rig, err.text);
			for (int i = 0; i < wrong; i++)
				assert_false(inlier[i]);
			/* chance alone takes one good pair of 16000 */
			assert_true(fit.inliers >= n - wrong - 3 || n < 10);
			held += fabs(fit.mm_px - d.truth) <= 2 * fit.u_mm_px;
			held_full += fabs(fit.full_px - d.full) <= 2 * fit.u_full_px;
		}
		in_interval(held);
		in_interval(held_full);
	}
}

/* A camera that looks on askance bends the line: it is reported with its uncertainty. */
TEST(test_bend)
{
	struct line_data d;
	struct incise_depth_lengths pairs = pairs_of(&d, PAIRS);
	struct incise_depth_fit fit;

	seed = 3;
	make_line(&d, PAIRS, 0.02);
	assert_int_equal(incise_calibrate_depth_line(&pairs, NULL, &fit, NULL), 0);
	assert_true(fit.bend_mm < 4 * fit.bend_sd_mm);
	for (int i = 0; i < PAIRS; i++)
		d.mm[i] += 0.004 * (d.mm[i] - 10) * (d.mm[i] - 10);
	assert_int_equal(incise_calibrate_depth_line(&pairs, NULL, &fit, NULL), 0);
	assert_true(fit.bend_mm > 8 * fit.bend_sd_mm);
}

static void swap_columns(struct line_data *d)
{
	for (int i = 0; i < PAIRS; i++) {
		double swap = d->mm[i];

		d->mm[i] = d->px[i];
		d->px[i] = swap;
	}
}

static void turn_sign(struct line_data *d)
{
	for (int i = 0; i < PAIRS; i++)
		d->mm[i] = -d->mm[i];
}

static void one_depth(struct line_data *d)
{
	for (int i = 0; i < PAIRS; i++) {
		d->px[i] += d->mm[i] / d->truth;
		d->mm[i] = 0;
	}
}

static void all_alike(struct line_data *d)
{
	for (int i = 0; i < PAIRS; i++)
		d->px[i] = 400;
}

static void no_number(struct line_data *d)
{
	d->px[7] = NAN;
}

static void half_wrong(struct line_data *d)
{
	for (int i = 0; i < PAIRS / 5 * 2; i++)
		d->px[i] -= 30 + i;
}

TEST(test_line_refused)
{
	static const struct {
		void (*spoil)(struct line_data *);
		int n, code;
		const char *text;
	} cases[] = {
		{swap_columns, PAIRS, -EDOM, "swapped"},
		{turn_sign, PAIRS, -EDOM, "depth"},
		{one_depth, PAIRS, -EDOM, "span"},
		{all_alike, PAIRS, -EDOM, "span"},
		{no_number, PAIRS, -EINVAL, "length 8"},
		{half_wrong, PAIRS, -EDOM, "outliers"},
		{NULL, 5, -EDOM, "5 pairs"},
		{NULL, 0, -EDOM, "0 pairs"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct line_data d;
		struct incise_depth_lengths pairs = pairs_of(&d, cases[i].n);
		struct incise_depth_fit fit;
		struct incise_error err = {0};

		seed = 11;
		make_line(&d, PAIRS, 0.02);
		if (cases[i].spoil)
			cases[i].spoil(&d);
		assert_int_equal(incise_calibrate_depth_line(&pairs, NULL, &fit, &err),
				 cases[i].code);
		assert_says(err.text, cases[i].text);
	}
}

/* Each value five times: a fifth of them count, which is √5 in the uncertainty. */
TEST(test_correlated)
{
	double apart[200], alike[1000], u;
	uint64_t seed = 1;
	int effective;

	for (int i = 0; i < 200; i++) {
		incise_random_step(&seed);
		apart[i] = (seed >> 11) * 0x1p-52 - 1;
		for (int k = 0; k < 5; k++)
			alike[5 * i + k] = apart[i];
	}
	u = repeats_u(apart, 200, 1, &effective);
	assert_int_equal(effective, 200);
	/* the correlation is itself an estimate: to a fifth */
	assert_true(fabs(repeats_u(alike, 1000, 1, &effective) / u - 1) < 0.2);
	assert_in_range(effective, 140, 280);
}
