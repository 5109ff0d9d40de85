// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Certified bounds of fixed-point error, by interval arithmetic over patches that cover
 * the support; see grid.h and patch.h. Linear interpolation over a cell of width w is off
 * by at most w²/8 times the largest second derivative.
 */
#include <math.h>
#include <stdlib.h>
#include "patch.h"

/* Blocks per input: more give a tighter bound and take time, with the square. */
#define BLOCKS 128

/* Rounding an input to Q16.16. */
#define HALF_LSB (0.5 / INCISE_FIXED_ONE)

#define N INCISE_FIXED_MFS_MAX

/*
 * The largest of each, over the whole support. They are added up though they need not meet
 * in one place: a cell of a table reaches over several blocks.
 */
struct incise_survey {
	double input;	 /* rounding of the inputs */
	double f11, f22; /* second derivatives */
	double weights;	 /* table: times wa²/8 */
	double slopes;	 /* the same for an output wa further on: times wa³/8 */
	double outputs;	 /* times wb²/8 */
	double bends,
		worst; /* weights that are off meet outputs that are: wa²/8 · wb²/8 */
	double direct;
};

struct blocks {
	int n;
	struct incise_block *block;
};

static int make_blocks(struct blocks *blocks, const struct incise_axis *axis,
		       bool trivial)
{
	double from = axis->min;
	double to = axis->max + (axis->max - axis->min) / (INCISE_SURVEY_CELLS - 2);

	blocks->n = trivial ? 1 : BLOCKS;
	blocks->block = calloc(blocks->n, sizeof(*blocks->block));
	if (!blocks->block)
		return -1;
	for (int k = 0; k < blocks->n; k++) {
		struct interval x = {from + (to - from) * k / blocks->n,
				     from + (to - from) * (k + 1) / blocks->n};

		/* Ends that round inwards would leave gaps. */
		incise_block_over(&blocks->block[k], axis, iv_out(x.lo, x.hi));
	}
	return 0;
}

/* The larger; a NaN counts as endless. */
static double larger(double largest, double e)
{
	if (isnan(e))
		return INFINITY;
	return e > largest ? e : largest;
}

/* Of the weights' table and the folded one: see lib/fixed/table.c. */
static void table_errors(const struct incise_grid *grid, const struct incise_block *a,
			 const struct incise_patch *patch, struct incise_survey *survey)
{
	struct interval of_a = iv(0), of_h = iv(0), of_b = iv(0);
	double bends = 0;

	for (int i = 0; i < grid->a.n; i++) {
		double e = iv_mag(patch->t2[i]);

		of_a = iv_add(of_a, iv_mul(a->range.d2[i], patch->t[i]));
		of_h = iv_add(of_h, iv_mul(a->range.d2[i], patch->h[i]));
		of_b = iv_add(of_b, iv_mul(a->range.a[i], (struct interval){0, e}));
		bends += iv_mag(a->range.d2[i]);
		survey->worst = larger(survey->worst, e);
	}
	survey->weights = larger(survey->weights, iv_mag(of_a));
	survey->slopes = larger(survey->slopes, iv_mag(of_h));
	survey->outputs = larger(survey->outputs, iv_mag(of_b));
	survey->bends = larger(survey->bends, bends);
}

/*
 * Error of degrees that lib/fixed/direct.c computes, relative to the largest being 1.
 * z: slope to 2^-30, two roundings in Q24; q = z² floored in Q26; 2^-q to 8 LSB of Q30.
 */
static void degree_errors(const struct incise_axis *axis,
			  const struct incise_block *block, double *error)
{
	double q_error[N], worst = 0, main;

	for (int i = 0; i < axis->n; i++) {
		double far = fmax(fabs(block->x.lo - axis->c[i]),
				  fabs(block->x.hi - axis->c[i]));
		double z = fmin(128, far / (axis->s[i] * sqrt(2 * M_LN2)) * (1 + 1e-12));
		double z_error = z * 0x1p-29 + 0x1p-23;

		q_error[i] = 2 * z * z_error + z_error * z_error + 0x1p-26;
	}
	/* The exponent that is taken off may be that of any function near the largest. */
	for (int i = 0; i < axis->n; i++)
		if (block->range.a[i].hi >= 0.5 * block->range.a[block->main].lo)
			worst = fmax(worst, q_error[i]);
	main = fmax(block->range.a[block->main].lo, 1.0 / (2 * axis->n));
	for (int i = 0; i < axis->n; i++) {
		double degree = fmin(1, block->range.a[i].hi / main);

		error[i] = degree * 1.01 * M_LN2 * (q_error[i] + worst) + 0x1p-27;
	}
}

static double direct_error(const struct incise_grid *grid, const struct incise_block *a,
			   const struct incise_block *b)
{
	double ea[N], eb[N], sum = 0, spread = 0;

	degree_errors(&grid->a, a, ea);
	degree_errors(&grid->b, b, eb);
	if (grid->one)
		ea[0] = 0;
	/* |r - F| is at most the distance between the farthest two rules here. */
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			double d = iv_mag(
				incise_patch_rules(grid, i, j, a->main, b->main, a, b));

			spread = fmax(spread,
				      a->range.a[i].hi * b->range.a[j].hi > 1e-9 ? d : 0);
		}
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			double d = iv_mag(
				incise_patch_rules(grid, i, j, a->main, b->main, a, b));

			sum += (ea[i] + eb[j] + 0x1p-29) * (d + spread);
		}
	/* The largest weight is 1 within 1e-6. */
	return sum * 1.001;
}

struct incise_survey *incise_survey_new(const struct incise_grid *grid)
{
	struct incise_survey *survey = calloc(1, sizeof(*survey));
	struct blocks ba = {0}, bb = {0};

	if (!survey || make_blocks(&ba, &grid->a, grid->one) ||
	    make_blocks(&bb, &grid->b, false)) {
		free(survey);
		survey = NULL;
		goto out;
	}
	for (int k = 0; k < ba.n * bb.n; k++) {
		const struct incise_block *a = &ba.block[k / bb.n],
					  *b = &bb.block[k % bb.n];
		struct incise_patch patch;

		incise_patch_over(&patch, grid, a, b);
		survey->input = larger(survey->input,
				       (iv_mag(patch.f1) + iv_mag(patch.f2)) * HALF_LSB);
		survey->f11 = larger(survey->f11, iv_mag(patch.f11));
		survey->f22 = larger(survey->f22, iv_mag(patch.f22));
		survey->direct = larger(survey->direct, direct_error(grid, a, b));
		table_errors(grid, a, &patch, survey);
	}
out:
	free(ba.block);
	free(bb.block);
	return survey;
}

void incise_survey_free(struct incise_survey *survey)
{
	free(survey);
}

/* Sums of a few doubles, each rounded: 1e-12 covers them. */
#define SLACK (1 + 1e-12)

double incise_survey_table(const struct incise_survey *s, double wa, double wb)
{
	double a2 = wa * wa / 8, b2 = wb * wb / 8;
	double bound = s->input + (s->weights + s->slopes * wa) * a2 + s->outputs * b2 +
		       s->bends * a2 * s->worst * b2;

	return larger(0, bound * SLACK);
}

double incise_survey_force(const struct incise_survey *s, double wa, double wb)
{
	return larger(0,
		      (s->input + s->f11 * wa * wa / 8 + s->f22 * wb * wb / 8) * SLACK);
}

double incise_survey_direct(const struct incise_survey *s)
{
	return larger(0, (s->input + s->direct) * SLACK);
}
