// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Cells: their distances are distances, and no square of the search shows.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include "../../../lib/view/cells.h"

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
static void test_distances(void **state)
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
static void test_warp(void **state)
{
	static float near[SIZE][SIZE], moved[SIZE][SIZE], far[SIZE][SIZE];
	struct cells *cells = cells_new(3, SIZE, 16, 16);

	rows(cells, 0, near, far);
	rows(cells, 1, moved, far);
	for (int y = 0; y < SIZE - 16; y++)
		for (int x = 0; x < SIZE - 16; x++)
			assert_true(fabsf(moved[y][x] - near[y + 16][x + 16]) < 1e-5F);
	/* Beyond what is promised there is some distance, and nothing else is read. */
	rows(cells, 1e6F, moved, far);
	rows(cells, -1e6F, moved, far);
	assert_true(isfinite(moved[0][0]) && isfinite(far[0][0]));
	cells_free(cells);
}

static void test_none(void **state)
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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_distances),
		cmocka_unit_test(test_warp),
		cmocka_unit_test(test_none),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
