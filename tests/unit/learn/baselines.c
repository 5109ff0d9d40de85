// SPDX-License-Identifier: GPL-2.0-or-later
/* Baselines where the right answer is known. */
#include "../unit.h"
#include <incise/train.h>
#include "../../../lib/base/random.h"

static double rows[400 * 3];

static void fill(double (*f)(double, double))
{
	for (int i = 0; i < 400; i++) {
		rows[3 * i] = i % 20;
		rows[3 * i + 1] = 1000 * (i / 20);
		rows[3 * i + 2] = f(rows[3 * i], rows[3 * i + 1]);
	}
}

static double plane(double x, double y)
{
	return 1 + 2 * x - 0.003 * y;
}

static double stairs(double x, double y)
{
	return (x > 9) + 2 * (y > 9000);
}

TEST(test_plane)
{
	struct incise_pairs pairs = {.rows = rows, .n = 400, .n_inputs = 2};
	struct incise_baselines b;
	double sum = 0, mean = 0;

	fill(plane);
	assert_int_equal(incise_baselines(&pairs, NULL, &pairs, NULL, NULL, &b, NULL), 0);
	for (int i = 0; i < 400; i++)
		mean += rows[3 * i + 2] / 400;
	for (int i = 0; i < 400; i++)
		sum += pow(rows[3 * i + 2] - mean, 2) / 400;
	assert_true(fabs(b.mean - sqrt(sum)) < 1e-12 * b.mean);
	/* The ridge of 1e-9 per pair pulls coefficients by 1e-9 of a spread of 23. */
	assert_true(b.linear < 1e-7);
}

/* On stairs the neighbours know and the line does not. */
TEST(test_stairs)
{
	struct incise_pairs pairs = {.rows = rows, .n = 400, .n_inputs = 2};
	struct incise_baselines b;

	fill(stairs);
	assert_int_equal(incise_baselines(&pairs, NULL, &pairs, NULL, NULL, &b, NULL), 0);
	assert_true(b.knn < 0.5 * b.linear);
	assert_true(b.linear < b.mean);
}

/*
 * A pair is not its own neighbour when judged on training data: on noise without any
 * rule the neighbours cannot be better than the mean (a pair predicting itself would
 * give 0). With groups the whole cut is left out.
 */
TEST(test_no_peeking)
{
	struct incise_pairs pairs = {.rows = rows, .n = 400, .n_inputs = 2};
	struct incise_baselines b;
	int groups[400];
	uint64_t seed = 3;

	fill(plane);
	for (int i = 0; i < 400; i++) {
		incise_random_step(&seed);
		rows[3 * i + 2] = (seed >> 11) * 0x1p-53;
	}
	assert_int_equal(incise_baselines(&pairs, NULL, &pairs, NULL, NULL, &b, NULL), 0);
	assert_true(b.knn > 0.95 * b.mean);
	/* Each cut with a level of its own, all in the same place of the inputs. */
	for (int i = 0; i < 400; i++) {
		groups[i] = i % 4;
		rows[3 * i + 2] = i % 4;
	}
	assert_int_equal(incise_baselines(&pairs, groups, &pairs, NULL, NULL, &b, NULL),
			 0);
	assert_true(b.knn > 0.95 * b.mean);
}

TEST(test_refusals)
{
	struct incise_pairs pairs = {.rows = rows, .n = 400, .n_inputs = 2},
			    none = {.rows = rows, .n = 0, .n_inputs = 2},
			    other = {.rows = rows, .n = 10, .n_inputs = 3};
	struct incise_baselines b;

	assert_int_equal(incise_baselines(&none, NULL, &pairs, NULL, NULL, &b, NULL),
			 -EINVAL);
	assert_int_equal(incise_baselines(&pairs, NULL, &none, NULL, NULL, &b, NULL),
			 -EINVAL);
	assert_int_equal(incise_baselines(&pairs, NULL, &other, NULL, NULL, &b, NULL),
			 -EINVAL);
}
