// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/calib/delay_normal.c: the least squares of its normal equations are those of
 * LAPACK on the rows themselves; a column of zeros gets 0.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <string.h>
#include <lapacke.h>
#include "../../../lib/calib/delay.h"
#include "../../../lib/base/random.h"

#define ROWS 60
#define M 4

static double rows[ROWS][M], right[ROWS];

static void make_rows(void)
{
	const uint64_t key = incise_random_key(7, INCISE_RANDOM_FORCE);

	for (int i = 0; i < ROWS; i++) {
		/* of very different size: columns are scaled alike first */
		for (int j = 0; j < M; j++)
			rows[i][j] = pow(100, j - 1) *
				     incise_random_normal(key, i * (M + 1) + j);
		right[i] = incise_random_normal(key, i * (M + 1) + M);
	}
}

static struct delay_normal normal_of(int from, int to)
{
	struct delay_normal normal = {.m = M};

	for (int i = from; i < to; i++)
		delay_add_row(&normal, rows[i], right[i]);
	return normal;
}

static void solution_is_that_of_the_rows(void **state)
{
	struct delay_normal normal;
	double a[ROWS][M], x[DELAY_UNKNOWNS], b[ROWS];

	make_rows();
	normal = normal_of(0, ROWS);
	assert_true(delay_solve(&normal, x));
	memcpy(a, rows, sizeof(a));
	memcpy(b, right, sizeof(b));
	assert_int_equal(LAPACKE_dgels(LAPACK_ROW_MAJOR, 'N', ROWS, M, 1, *a, M, b, 1),
			 0);
	/* 1e-12 is added to the scaled diagonal; the condition there is about 1 */
	for (int j = 0; j < M; j++)
		assert_true(fabs(x[j] - b[j]) < 1e-10 * fabs(b[j]) + 1e-15);
}

static void parts_add_up(void **state)
{
	struct delay_normal whole, parts;

	make_rows();
	whole = normal_of(0, ROWS);
	parts = normal_of(0, 20);
	for (int from = 20; from < ROWS; from += 20) {
		struct delay_normal part = normal_of(from, from + 20);

		delay_add_normal(&parts, &part, 1);
	}
	/* sums in another order */
	assert_true(fabs(parts.yy - whole.yy) < 1e-12 * whole.yy);
	for (int i = 0; i < M; i++) {
		assert_true(fabs(parts.b[i] - whole.b[i]) <
			    1e-12 * sqrt(whole.a[i * M + i] * whole.yy));
		for (int j = 0; j <= i; j++)
			assert_true(
				fabs(parts.a[i * M + j] - whole.a[i * M + j]) <
				1e-12 * sqrt(whole.a[i * M + i] * whole.a[j * M + j]));
	}
}

static void what_says_nothing_gets_nothing(void **state)
{
	struct delay_normal normal;
	double x[DELAY_UNKNOWNS];

	make_rows();
	for (int i = 0; i < ROWS; i++)
		rows[i][2] = 0;
	normal = normal_of(0, ROWS);
	assert_true(delay_solve(&normal, x));
	assert_true(x[2] == 0 && x[0] != 0 && x[3] != 0);
	normal.a[0] = NAN;
	assert_false(delay_solve(&normal, x));
	normal.a[0] = -1;
	assert_false(delay_solve(&normal, x));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(solution_is_that_of_the_rows),
		cmocka_unit_test(parts_add_up),
		cmocka_unit_test(what_says_nothing_gets_nothing),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
