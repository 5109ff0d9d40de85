// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Each operation of the numbers that carry a bound, as a property: on operands that differ by no more than
 * is said, its results in integers and in double differ by no more than the bound.
 */
#include "../unit.h"
#include "../cases.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "operands.h"

#define CASES 20000
#define CASES_LEAST 1000

static double size_of(uint64_t *seed)
{
	return exp(4 * incise_random_symmetric(seed));
}

static void draw_parts(uint64_t *seed, double *to, double *off, int n, double size,
		       double most)
{
	for (int i = 0; i < n; i++) {
		to[i] = size * incise_random_symmetric(seed);
		/* Mostly as far off as it may be: there a bound is tight. */
		off[i] = most * fmax(-1, fmin(2 * incise_random_symmetric(seed), 1));
	}
}

static void unit(double *to, int n)
{
	double sum = 0;

	for (int i = 0; i < n; i++)
		sum += to[i] * to[i];
	for (int i = 0; i < n; i++)
		to[i] /= sqrt(sum);
}

static void draw(uint64_t *seed, struct operands *of)
{
	double size = size_of(seed);

	draw_parts(seed, &of->x, &of->off_x, 1, size_of(seed), NUMBER_OFF);
	draw_parts(seed, &of->y, &of->off_y, 1, size_of(seed), NUMBER_OFF);
	draw_parts(seed, &of->z, &of->off_z, 1, size_of(seed), NUMBER_OFF);
	of->z = fmax(fabs(of->z), 0.01);
	draw_parts(seed, of->a, of->off_a, 3, size, NUMBER_OFF);
	draw_parts(seed, of->b, of->off_b, 3, size_of(seed), NUMBER_OFF);
	draw_parts(seed, of->u, of->off_u, 3, 1, DIRECTION_OFF);
	draw_parts(seed, of->v, of->off_v, 3, 1, DIRECTION_OFF);
	draw_parts(seed, of->q, of->off_q, 4, 1, DIRECTION_OFF);
	unit(of->u, 3);
	unit(of->v, 3);
	unit(of->q, 4);
}

static const char *const names[] = {
#define OP(name, ...) #name,
	OPERATIONS(OP)
#undef OP
};

TEST(test_results_are_within_their_bounds)
{
	int n = cases_of(CASES, CASES_LEAST);
	uint64_t seed = cases_seed(1);
	double most[OPERATION_COUNT] = {0};

	for (int i = 0; i < n; i++) {
		struct operands of;

		draw(&seed, &of);
		for (int op = 0; op < OPERATION_COUNT; op++) {
			struct result exact = {{0}}, integer = {{0}};
			double bound = operation_bound((enum operation)op, &of);
			double way[3], off;

			operate_in_double((enum operation)op, &of, &exact);
			operate_in_integers((enum operation)op, &of, &integer);
			v3_sub(way, exact.part, integer.part);
			off = v3_length(way);
			if (!(off <= bound))
				fail_msg("%s, case %d: off by %g of %g", names[op], i,
					 off, bound);
			most[op] = fmax(most[op], off / bound);
		}
	}
	for (int op = 0; op < OPERATION_COUNT; op++) {
		printf("%s: up to %.2f of its bound\n", names[op], most[op]);
		/* A bound that nothing comes near says nothing of its parts. */
		assert_true(most[op] > (op < OPERATION_towards ? 0.5 : 0.001));
	}
}
