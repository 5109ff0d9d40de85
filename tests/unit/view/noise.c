// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Noise compared with the sum over its lattice by the closed form of the B-spline; cells.
 */
#include "../unit.h"
#include "../../../lib/view/noise.h"

#define SIZE 256

static double spline(double x)
{
	x = fabs(x);
	if (x >= 2)
		return 0;
	if (x >= 1)
		return pow(2 - x, 3) / 6;
	return (3 * x * x * x - 6 * x * x + 4) / 6;
}

TEST(test_is_a_spline)
{
	static const double cells[][2] = {{3, 3}, {7.3, 4.1}, {40, 90}, {1000, 333}};
	float row[SIZE];

	for (size_t k = 0; k < sizeof(cells) / sizeof(*cells); k++) {
		const double *cell = cells[k];
		struct noise *noise = noise_new(9, SIZE, cell[0], cell[1]);

		assert_non_null(noise);
		for (int y = 0; y < SIZE; y += 51) {
			for (int x = 0; x < SIZE; x++)
				row[x] = 1;
			noise_row(noise, y, 0.5F, row);
			for (int x = 0; x < SIZE; x++) {
				double u = (x + 0.5) / cell[0] + 1;
				double v = (y + 0.5) / cell[1] + 1, sum = 0;

				for (int j = (int)v - 1; j <= (int)v + 2; j++)
					for (int i = (int)u - 1; i <= (int)u + 2; i++)
						sum += spline(u - i) * spline(v - j) *
						       (2 * (double)noise_at(9, i, j) -
							1);
				/* Floats of up to 4; deviation 1 is 3.61 times as much. */
				assert_true(fabs(row[x] - 1 - 0.5 * 3.61 * sum) < 1e-5);
			}
		}
		noise_free(noise);
	}
	noise_free(NULL);
}

TEST(test_mean_and_deviation)
{
	struct noise *noise = noise_new(4, SIZE, 4, 4);
	double sum = 0, square = 0;

	for (int y = 0; y < SIZE; y++) {
		float row[SIZE] = {0};

		noise_row(noise, y, 1, row);
		for (int x = 0; x < SIZE; x++) {
			sum += row[x];
			square += (double)row[x] * row[x];
			assert_true(fabsf(row[x]) < 4);
		}
	}
	/* Of 4096 cells: 1/64 each, times 3; neighbours are alike, which widens it. */
	assert_true(fabs(sum) / (SIZE * SIZE) < 0.1);
	assert_true(fabs(sqrt(square / (SIZE * SIZE)) - 1) < 0.1);
	noise_free(noise);
}

/* Noise finer than texels fades, and an invalid size gives none. */
TEST(test_fades)
{
	static const struct {
		double cell;
		float share;
	} cases[] = {{0, 0},	   {-5, 0}, {1.5, 0},	{NAN, 0},
		     {2.25, 0.5F}, {3, 1},  {1e300, 1}, {INFINITY, 1}};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct noise *noise = noise_new(4, SIZE, cases[k].cell, cases[k].cell);
		double most = 0;

		assert_non_null(noise);
		for (int y = 0; y < SIZE; y++) {
			float row[SIZE] = {0};

			noise_row(noise, y, 1, row);
			for (int x = 0; x < SIZE; x++)
				most = fmax(most, fabsf(row[x]));
		}
		if (cases[k].share == 0)
			assert_true(most == 0);
		else
			assert_true(most > 0 && most < 4 * cases[k].share);
		noise_free(noise);
	}
}

/* Numbers of neighbouring places, or of seeds, are independent. */
TEST(test_places)
{
	double sum = 0, product[3] = {0};

	for (int y = -50; y < 50; y++)
		for (int x = -50; x < 50; x++) {
			double here = noise_at(7, x, y) - 0.5;

			assert_true(here >= -0.5 && here < 0.5);
			sum += here;
			product[0] += here * (noise_at(7, x + 1, y) - 0.5);
			product[1] += here * (noise_at(7, x, y + 1) - 0.5);
			product[2] += here * (noise_at(8, x, y) - 0.5);
		}
	/* Deviations of 10 000: of the mean 0.29 / 100, of a product 0.083 / 100; times 4. */
	assert_true(fabs(sum / 1e4) < 0.012);
	for (int k = 0; k < 3; k++)
		assert_true(fabs(product[k] / 1e4) < 0.0034);
}

#define SIZE 256

static void rows(const struct cells *cells, float warp, float (*near)[SIZE],
		 float (*far)[SIZE])
{
	float warps[SIZE];

	for (int x = 0; x < SIZE; x++)
		warps[x] = warp;
	for (int y = 0; y < SIZE; y++)
		cells_row(cells, y, warps, warps, near[y], far[y]);
}

/* A step of a texel changes a distance by its length at most: no square has an edge. */
TEST(test_distances)
{
	static const double cell[2] = {12, 9};
	static float near[SIZE][SIZE], far[SIZE][SIZE];
	struct cells *cells = cells_new(3, SIZE, cell[0], cell[1]);
	double mean = 0, gap = 0;
	int centres = 0;

	assert_non_null(cells);
	assert_true(cells_fade(cells) == 1);
	rows(cells, 0, near, far);
	for (int y = 1; y < SIZE - 1; y++)
		for (int x = 1; x < SIZE - 1; x++) {
			float here = near[y][x];

			assert_true(here >= 0 && here < 1.3F && far[y][x] >= 0);
			/* Roundings of places of up to 30 cells. */
			assert_true(fabsf(near[y][x + 1] - here) < 1 / cell[0] + 1e-5);
			assert_true(fabsf(near[y + 1][x] - here) < 1 / cell[1] + 1e-5);
			mean += here / (SIZE * SIZE);
			gap += far[y][x] / (SIZE * SIZE);
			centres += here <= near[y][x + 1] && here < near[y][x - 1] &&
				   here <= near[y + 1][x] && here < near[y - 1][x];
		}
	/* The header's averages. */
	assert_true(fabs(mean - 0.4) < 0.05 && fabs(gap - 0.3) < 0.08);
	/* As many points as squares; those at the border are cut off. */
	assert_true(fabs(centres / (SIZE / cell[0] * SIZE / cell[1]) - 1) < 0.1);
	cells_free(cells);
	cells_free(NULL);
}

/* Moved by one cell both ways all of it is moved by that. */
TEST(test_warp)
{
	static float near[SIZE][SIZE], moved[SIZE][SIZE], far[SIZE][SIZE];
	struct cells *cells = cells_new(3, SIZE, 16, 16);

	rows(cells, 0, near, far);
	rows(cells, 1, moved, far);
	for (int y = 0; y < SIZE - 16; y++)
		for (int x = 0; x < SIZE - 16; x++)
			assert_true(fabsf(moved[y][x] - near[y + 16][x + 16]) < 1e-5F);
	/* Beyond the documented range there is some distance, without a wrong access. */
	rows(cells, 1e6F, moved, far);
	rows(cells, -1e6F, moved, far);
	assert_true(isfinite(moved[0][0]) && isfinite(far[0][0]));
	cells_free(cells);
}

TEST(test_none)
{
	static const double sizes[] = {0, -1, 2, NAN};
	static float near[SIZE][SIZE], far[SIZE][SIZE];

	for (size_t k = 0; k < sizeof(sizes) / sizeof(*sizes); k++) {
		struct cells *cells = cells_new(3, SIZE, sizes[k], sizes[k]);

		assert_non_null(cells);
		assert_true(cells_fade(cells) == 0);
		rows(cells, 0, near, far);
		assert_true(near[9][9] == 0.4F && far[9][9] == 0.3F);
		cells_free(cells);
	}
}
