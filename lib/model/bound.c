// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Certified bounds of fixed-point error, by interval arithmetic over blocks that cover
 * the support; see grid.h. In a block, with T(i) = Σj b̄(j) r(i,j) and its derivatives by
 * xb, T' and T'':
 *
 *   F       = Σ ā(i) T(i)
 *   ∂F/∂a   = Σ ā(i)' T(i) + Σ ā(i) h(i)           h(i) = Σj b̄(j) p(i,j,1)
 *   ∂F/∂b   = Σ ā(i) T(i)'
 *   ∂²F/∂a² = Σ ā(i)'' T(i) + 2 Σ ā(i)' h(i)
 *   ∂²F/∂b² = Σ ā(i) T(i)''
 *
 * Degrees add up to 1, so their derivatives add up to 0: in sums with ā', ā'' a constant
 * is taken off T, which keeps the enclosures tight. Linear interpolation over a cell of
 * width w is off by at most w²/8 times the largest second derivative.
 */
#include <math.h>
#include <stdlib.h>
#include "grid.h"

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

/* A part of one input's support. */
struct block {
	struct interval x;
	struct incise_axis_range range;
	int main; /* function with the largest degree in the middle */
};

struct blocks {
	int n;
	struct block *block;
};

/* What is known of the model over block a × block b. */
struct patch {
	struct interval t[N];	 /* T(i) - T(main) */
	struct interval t1[N];	 /* T(i)' */
	struct interval t2[N];	 /* T(i)'' */
	struct interval h[N];	 /* h(i) - h(main) */
	struct interval h_mean;	 /* Σ ā(i) h(i) */
	double f1, f2, f11, f22; /* magnitudes of F's derivatives */
};

static int make_blocks(struct blocks *blocks, const struct incise_axis *axis,
		       bool trivial)
{
	double from = axis->min;
	double to = axis->max + (axis->max - axis->min) / (INCISE_SURVEY_CELLS - 2);
	long double at[N];

	blocks->n = trivial ? 1 : BLOCKS;
	blocks->block = calloc(blocks->n, sizeof(*blocks->block));
	if (!blocks->block)
		return -1;
	for (int k = 0; k < blocks->n; k++) {
		struct block *block = &blocks->block[k];

		block->x.lo = from + (to - from) * k / blocks->n;
		block->x.hi = from + (to - from) * (k + 1) / blocks->n;
		/* Ends that round inwards would leave gaps. */
		block->x = iv_out(block->x.lo, block->x.hi);
		incise_axis_over(axis, block->x, &block->range);
		incise_axis_at(axis, (block->x.lo + block->x.hi) / 2, at);
		for (int i = 1; i < axis->n; i++)
			if (at[i] > at[block->main])
				block->main = i;
	}
	return 0;
}

/* r(i,j) - r(k,l) over a patch. */
static struct interval rule_difference(const struct incise_grid *grid, int i, int j,
				       int k, int l, struct interval xa,
				       struct interval xb)
{
	const double *p = grid->p[i][j], *q = grid->p[k][l];
	struct interval d = iv_sub(iv(p[0]), iv(q[0]));

	d = iv_add(d, iv_mul(iv_sub(iv(p[1]), iv(q[1])), xa));
	return iv_add(d, iv_mul(iv_sub(iv(p[2]), iv(q[2])), xb));
}

static void rule_sums(const struct incise_grid *grid, const struct block *a,
		      const struct block *b, int i, struct patch *patch)
{
	const struct incise_axis_range *rb = &b->range;
	int m = b->main;

	patch->t[i] = patch->t1[i] = patch->t2[i] = patch->h[i] = iv(0);
	for (int j = 0; j < grid->b.n; j++) {
		const double *p = grid->p[i][j];
		struct interval r = rule_difference(grid, i, j, i, m, a->x, b->x);
		struct interval slope = iv_sub(iv(p[2]), iv(grid->p[i][m][2]));

		patch->t[i] = iv_add(patch->t[i],
				     iv_mul(rb->a[j], rule_difference(grid, i, j, a->main,
								      j, a->x, b->x)));
		patch->t1[i] = iv_add(patch->t1[i], iv_add(iv_mul(rb->d1[j], r),
							   iv_scale(rb->a[j], p[2])));
		patch->t2[i] = iv_add(patch->t2[i],
				      iv_add(iv_mul(rb->d2[j], r),
					     iv_scale(iv_mul(rb->d1[j], slope), 2)));
		patch->h[i] = iv_add(
			patch->h[i],
			iv_mul(rb->a[j], iv_sub(iv(p[1]), iv(grid->p[a->main][j][1]))));
	}
}

static void inspect(const struct incise_grid *grid, const struct block *a,
		    const struct block *b, struct patch *patch)
{
	const struct incise_axis_range *ra = &a->range;
	struct interval f1 = iv(0), f2 = iv(0), f11 = iv(0), f22 = iv(0);

	patch->h_mean = iv(0);
	for (int i = 0; i < grid->a.n; i++) {
		rule_sums(grid, a, b, i, patch);
		for (int j = 0; j < grid->b.n; j++)
			patch->h_mean = iv_add(patch->h_mean,
					       iv_scale(iv_mul(ra->a[i], b->range.a[j]),
							grid->p[i][j][1]));
	}
	for (int i = 0; i < grid->a.n; i++) {
		f1 = iv_add(f1, iv_mul(ra->d1[i], patch->t[i]));
		f2 = iv_add(f2, iv_mul(ra->a[i], patch->t1[i]));
		f11 = iv_add(f11, iv_add(iv_mul(ra->d2[i], patch->t[i]),
					 iv_scale(iv_mul(ra->d1[i], patch->h[i]), 2)));
		f22 = iv_add(f22, iv_mul(ra->a[i], patch->t2[i]));
	}
	patch->f1 = iv_mag(iv_add(f1, patch->h_mean));
	patch->f2 = iv_mag(f2);
	patch->f11 = iv_mag(f11);
	patch->f22 = iv_mag(f22);
}

/* The larger; a NaN counts as endless. */
static double larger(double largest, double e)
{
	if (isnan(e))
		return INFINITY;
	return e > largest ? e : largest;
}

/* Of the weights' table and the folded one: see lib/fixed/table.c. */
static void table_errors(const struct incise_grid *grid, const struct block *a,
			 const struct patch *patch, struct incise_survey *survey)
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
static void degree_errors(const struct incise_axis *axis, const struct block *block,
			  double *error)
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

static double direct_error(const struct incise_grid *grid, const struct block *a,
			   const struct block *b)
{
	double ea[N], eb[N], sum = 0, spread = 0;

	degree_errors(&grid->a, a, ea);
	degree_errors(&grid->b, b, eb);
	if (grid->one)
		ea[0] = 0;
	/* |r - F| is at most the distance between the farthest two rules here. */
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			double d = iv_mag(rule_difference(grid, i, j, a->main, b->main,
							  a->x, b->x));

			spread = fmax(spread,
				      a->range.a[i].hi * b->range.a[j].hi > 1e-9 ? d : 0);
		}
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			double d = iv_mag(rule_difference(grid, i, j, a->main, b->main,
							  a->x, b->x));

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
		const struct block *a = &ba.block[k / bb.n], *b = &bb.block[k % bb.n];
		struct patch patch;

		inspect(grid, a, b, &patch);
		survey->input = larger(survey->input, (patch.f1 + patch.f2) * HALF_LSB);
		survey->f11 = larger(survey->f11, patch.f11);
		survey->f22 = larger(survey->f22, patch.f22);
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
