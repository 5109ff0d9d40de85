// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A model as a full grid of Gaussians, with certified bounds of its values and slopes between points;
 * see model_grid.h.
 *
 * With L(i) = -(x-c(i))²/(2s(i)²) and ⟨f⟩ = Σ ā(k) f(k), the degrees of one input are
 *
 *   ā(i)   = 1 / Σk exp(L(k) - L(i))
 *   ā(i)'  = ā(i) (L(i)' - ⟨L'⟩)
 *   ā(i)'' = ā(i) ((L(i)' - ⟨L'⟩)² + L(i)'' - ⟨L''⟩ - ⟨(L' - ⟨L'⟩)²⟩)
 *
 * and with
 *
 *   T(i) = Σj b̄(j) r(i,j)    S(j) = Σi ā(i) r(i,j)    h(i) = Σj b̄(j) p(i,j,1)
 *
 * the model and its derivatives are
 *
 *   F       = Σ ā(i) T(i) = Σ b̄(j) S(j)
 *   ∂F/∂a   = Σ ā(i)' T(i) + Σij ā(i) b̄(j) p(i,j,1)
 *   ∂F/∂b   = Σ b̄(j)' S(j) + Σij ā(i) b̄(j) p(i,j,2)
 *   ∂²F/∂a² = Σ ā(i)'' T(i) + 2 Σ ā(i)' h(i)
 *   ∂²F/∂b² = Σ ā(i) T(i)''
 *   ∂²F/∂a∂b = Σij ā(i)' b̄(j)' r(i,j) + ā(i)' b̄(j) p(i,j,2) + ā(i) b̄(j)' p(i,j,1)
 *
 * Degrees add up to 1, so their derivatives add up to 0: in sums with derivatives a
 * constant is taken off T, S and h, in sums with degrees it is taken out of the sum. That
 * keeps the enclosures tight; a plane's slopes come out exactly.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"
#include "model_grid.h"

/* --- one input --- */

void incise_axis_init(struct incise_axis *axis, const struct incise_model *model,
		      int input)
{
	const struct incise_variable *v = &model->info.input[input];

	axis->n = model->info.n_mfs[input];
	/* A compiled support ends at the nearest LSB, which may lie half an LSB outside. */
	axis->min = fmin(v->min, rint(v->min * INCISE_FIXED_ONE) / INCISE_FIXED_ONE);
	axis->max = fmax(v->max, rint(v->max * INCISE_FIXED_ONE) / INCISE_FIXED_ONE);
	for (int i = 0; i < axis->n; i++) {
		axis->s[i] = incise_model_mf(model, input, i)->p[0];
		axis->c[i] = incise_model_mf(model, input, i)->p[1];
	}
}

void incise_axis_at(const struct incise_axis *axis, long double x, long double *a)
{
	long double largest = -HUGE_VALL, sum = 0;

	for (int i = 0; i < axis->n; i++) {
		long double z = (x - axis->c[i]) / axis->s[i];

		a[i] = -z * z / 2;
		largest = fmaxl(largest, a[i]);
	}
	for (int i = 0; i < axis->n; i++) {
		a[i] = expl(a[i] - largest);
		sum += a[i];
	}
	for (int i = 0; i < axis->n; i++)
		a[i] /= sum;
}

/* L(k) - L(i) over [m-r, m+r] in mean-value form: its value at m, plus slope times ±r. */
static struct interval log_ratio(const struct incise_axis *axis, int k, int i,
				 struct interval x, const struct interval *slope)
{
	double m = x.lo + (x.hi - x.lo) / 2;
	struct interval zk = iv_scale(iv_sub(iv(m), iv(axis->c[k])), 1 / axis->s[k]);
	struct interval zi = iv_scale(iv_sub(iv(m), iv(axis->c[i])), 1 / axis->s[i]);
	struct interval at_m = iv_scale(iv_sub(iv_square(zi), iv_square(zk)), 0.5);
	struct interval off = iv_sub(x, iv(m));

	/* 1/s is rounded: two ulp of the squares more. */
	at_m = iv_add(at_m,
		      iv_scale((struct interval){-1, 1}, (zi.hi * zi.hi + zi.lo * zi.lo +
							  zk.hi * zk.hi + zk.lo * zk.lo) *
								 0x1p-50));
	return iv_add(at_m, iv_mul(iv_sub(slope[k], slope[i]), off));
}

void incise_axis_over(const struct incise_axis *axis, struct interval x,
		      struct incise_axis_range *range)
{
	struct interval slope[INCISE_FIXED_MFS_MAX], bend[INCISE_FIXED_MFS_MAX];
	struct interval mean = iv(0), mean_bend = iv(0), spread = iv(0);
	const struct interval unit = {0, 1};
	int n = axis->n;

	for (int i = 0; i < n; i++) {
		struct interval s2 = iv_square(iv(axis->s[i]));

		bend[i] = iv_scale(iv_inverse(s2), -1);
		slope[i] = iv_mul(iv_sub(x, iv(axis->c[i])), bend[i]);
	}
	for (int i = 0; i < n; i++) {
		struct interval sum = iv(1);

		for (int k = 0; k < n; k++)
			if (k != i)
				sum = iv_add(sum,
					     iv_exp(log_ratio(axis, k, i, x, slope)));
		range->a[i] = iv_intersect(iv_inverse(sum), unit);
	}
	for (int i = 0; i < n; i++) {
		mean = iv_add(mean, iv_mul(range->a[i], slope[i]));
		mean_bend = iv_add(mean_bend, iv_mul(range->a[i], bend[i]));
	}
	/* The weights add up to 1: a mean lies between the extremes. */
	for (int i = 0, lo = 0, hi = 0; i < n; i++) {
		lo = slope[i].lo < slope[lo].lo ? i : lo;
		hi = slope[i].hi > slope[hi].hi ? i : hi;
		if (i == n - 1)
			mean = iv_intersect(mean, (struct interval){slope[lo].lo,
								    slope[hi].hi});
	}
	for (int i = 0; i < n; i++)
		spread = iv_add(spread,
				iv_mul(range->a[i], iv_square(iv_sub(slope[i], mean))));
	for (int i = 0; i < n; i++) {
		struct interval off = iv_sub(slope[i], mean);

		range->d1[i] = iv_mul(range->a[i], off);
		range->d2[i] =
			iv_mul(range->a[i],
			       iv_sub(iv_add(iv_square(off), iv_sub(bend[i], mean_bend)),
				      spread));
	}
}

/* --- the grid --- */

/* Largest magnitude of an input: Q16.16 in 32 bits, ranges too. */
#define X_MAX 16383.0

static int check_input(const struct incise_model *model, int i, struct incise_error *err)
{
	const struct incise_variable *v = &model->info.input[i];
	int n = model->info.n_mfs[i];

	if (n > INCISE_FIXED_MFS_MAX)
		return incise_error_set(
			err, E2BIG,
			"fixed point: input %s has %d membership functions, at "
			"most %d fit; use double",
			v->name, n, INCISE_FIXED_MFS_MAX);
	if (fmax(fabs(v->min), fabs(v->max)) > X_MAX ||
	    v->max - v->min < 64.0 / INCISE_FIXED_ONE)
		return incise_error_set(
			err, ERANGE,
			"fixed point: input %s: its support %g to %g is beyond "
			"±%g or narrower than 0.001; use double",
			v->name, v->min, v->max, X_MAX);
	for (int k = 0; k < n; k++) {
		const struct incise_mf *mf = incise_model_mf(model, i, k);

		if (mf->type != INCISE_MF_GAUSS)
			return incise_error_set(
				err, ENOTSUP,
				"fixed point: input %s, function %s is a %s, only "
				"gaussmf has a fixed-point form; train with "
				"--search type=gaussmf or use double",
				v->name, mf->name, incise_mf_type_name(mf->type));
		if (fabs(mf->p[1]) > X_MAX)
			return incise_error_set(
				err, ERANGE,
				"fixed point: input %s, function %s: its centre %g is beyond "
				"±%g; use double",
				v->name, mf->name, mf->p[1], X_MAX);
		/* 2^-22 of a unit: some LSB of the input, below which there is no shape. */
		if (mf->p[0] < 64.0 / INCISE_FIXED_ONE / INCISE_FIXED_ONE)
			return incise_error_set(
				err, ERANGE,
				"fixed point: input %s, function %s: its width %g is "
				"too small for all number formats; use double",
				v->name, mf->name, mf->p[0]);
	}
	return 0;
}

/* Functions of a rule of a full grid: the last input's come fastest. */
static bool is_in_order(const struct incise_model *model, int r)
{
	int rest = r;

	for (int i = model->info.n_inputs - 1; i >= 0; i--) {
		if (incise_model_rule(model, r)->mf[i] != rest % model->info.n_mfs[i])
			return false;
		rest /= model->info.n_mfs[i];
	}
	return true;
}

int incise_many_check(const struct incise_model *model, struct incise_error *err)
{
	int n = model->info.n_inputs, n_rules = model->info.n_rules, grid_rules = 1, rc;

	if (n > INCISE_FIXED_INPUTS_MAX)
		return incise_error_set(
			err, E2BIG,
			"fixed point: the model has %d inputs, at most %d fit; "
			"use double",
			n, INCISE_FIXED_INPUTS_MAX);
	if (model->info.and_method != INCISE_AND_PROD)
		return incise_error_set(
			err, ENOTSUP,
			"fixed point: the model's AndMethod is min, only prod has a "
			"fixed-point form; use double");
	for (int i = 0; i < n; i++) {
		rc = check_input(model, i, err);
		if (rc)
			return rc;
		grid_rules *= model->info.n_mfs[i];
	}
	if (grid_rules != n_rules)
		return incise_error_set(
			err, ENOTSUP,
			"fixed point: the model has %d rules, its grid has %d: only "
			"full grids have a fixed-point form; use double",
			n_rules, grid_rules);
	for (int r = 0; r < n_rules; r++)
		if (model->rule[r].weight != 1 || !is_in_order(model, r))
			return incise_error_set(
				err, ENOTSUP,
				"fixed point: rule %d has a weight, or is out "
				"of the grid's order (last input fastest); use "
				"double",
				r + 1);
	return 0;
}

int incise_grid_init(struct incise_grid *grid, const struct incise_model *model,
		     struct incise_error *err)
{
	int n = model->info.n_inputs, n_b = model->info.n_mfs[n - 1];
	int rc;

	memset(grid, 0, sizeof(*grid));
	if (n > INCISE_GRID_INPUTS_MAX)
		return incise_error_set(err, E2BIG,
					"fixed point: the model has %d inputs, at most "
					"%d have a grid",
					n, INCISE_GRID_INPUTS_MAX);
	rc = incise_many_check(model, err);
	if (rc)
		return rc;
	grid->one = n == 1;
	grid->a = (struct incise_axis){.n = 1, .s = {1}};
	if (n == 2)
		incise_axis_init(&grid->a, model, 0);
	incise_axis_init(&grid->b, model, n - 1);
	for (int r = 0; r < model->info.n_rules; r++) {
		const double *p = incise_model_rule(model, r)->p;
		double *to = grid->p[r / n_b][r % n_b];

		to[0] = p[0];
		to[1] = n == 2 ? p[1] : 0;
		to[2] = p[n];
	}
	return 0;
}

void incise_grid_size(const struct incise_grid *grid, struct incise_grid_size *size)
{
	const struct incise_axis *a = &grid->a, *b = &grid->b;

	*size = (struct incise_grid_size){0};
	for (int i = 0; i < a->n; i++)
		for (int j = 0; j < b->n; j++) {
			const double *p = grid->p[i][j];
			double middle = p[0] + p[1] * (a->min + a->max) / 2 +
					p[2] * (b->min + b->max) / 2;
			double half = fabs(p[1]) * (a->max - a->min) / 2 +
				      fabs(p[2]) * (b->max - b->min) / 2;
			double parts = fabs(p[0]) +
				       fabs(p[1]) * fmax(fabs(a->min), fabs(a->max)) +
				       fabs(p[2]) * fmax(fabs(b->min), fabs(b->max));

			size->rule = fmax(size->rule, fabs(middle) + half);
			size->parts = fmax(size->parts, parts);
			size->slope = fmax(size->slope, fabs(p[1]));
		}
}

/* --- patches --- */

void incise_block_over(struct incise_block *block, const struct incise_axis *axis,
		       struct interval x)
{
	long double at[INCISE_FIXED_MFS_MAX];

	block->x = x;
	block->main = 0;
	incise_axis_over(axis, x, &block->range);
	incise_axis_at(axis, x.lo + (x.hi - x.lo) / 2, at);
	for (int i = 1; i < axis->n; i++)
		if (at[i] > at[block->main])
			block->main = i;
}

static struct interval rule_difference(const struct incise_grid *grid, int i, int j,
				       int k, int l, const struct incise_block *a,
				       const struct incise_block *b)
{
	const double *p = grid->p[i][j], *q = grid->p[k][l];
	struct interval d = iv_sub(iv(p[0]), iv(q[0]));

	d = iv_add(d, iv_mul(iv_sub(iv(p[1]), iv(q[1])), a->x));
	return iv_add(d, iv_mul(iv_sub(iv(p[2]), iv(q[2])), b->x));
}

/* Σij ā(i) b̄(j) p(i,j,k) for slopes 1 and 2, about the main rule's. */
static void mean_slopes(struct incise_patch *patch, const struct incise_grid *grid,
			const struct incise_block *a, const struct incise_block *b)
{
	const double *main = grid->p[a->main][b->main];

	patch->f1 = iv(main[1]);
	patch->f2 = iv(main[2]);
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			const double *p = grid->p[i][j];
			struct interval weight = iv_share(a->range.a[i], b->range.a[j]);

			patch->f1 =
				iv_add(patch->f1,
				       iv_share(weight, iv_sub(iv(p[1]), iv(main[1]))));
			patch->f2 =
				iv_add(patch->f2,
				       iv_share(weight, iv_sub(iv(p[2]), iv(main[2]))));
		}
}

void incise_patch_slopes(struct incise_patch *patch, const struct incise_grid *grid,
			 const struct incise_block *a, const struct incise_block *b)
{
	mean_slopes(patch, grid, a, b);
	for (int i = 0; i < grid->a.n; i++) {
		patch->t[i] = iv(0);
		for (int j = 0; j < grid->b.n; j++)
			patch->t[i] = iv_add(
				patch->t[i],
				iv_share(b->range.a[j],
					 rule_difference(grid, i, j, a->main, j, a, b)));
		patch->f1 = iv_add(patch->f1, iv_mul(a->range.d1[i], patch->t[i]));
	}
	for (int j = 0; j < grid->b.n; j++) {
		struct interval s = iv(0);

		for (int i = 0; i < grid->a.n; i++) {
			patch->r[i][j] = rule_difference(grid, i, j, i, b->main, a, b);
			s = iv_add(s, iv_share(a->range.a[i], patch->r[i][j]));
		}
		patch->f2 = iv_add(patch->f2, iv_mul(b->range.d1[j], s));
	}
}

/* t2 and h of function i of input a. */
static void rule_sums(struct incise_patch *patch, const struct incise_grid *grid,
		      const struct incise_block *a, const struct incise_block *b, int i)
{
	const struct incise_axis_range *rb = &b->range;

	patch->t2[i] = patch->h[i] = iv(0);
	for (int j = 0; j < grid->b.n; j++) {
		const double *p = grid->p[i][j];
		struct interval slope = iv_sub(iv(p[2]), iv(grid->p[i][b->main][2]));

		patch->t2[i] = iv_add(patch->t2[i],
				      iv_add(iv_mul(rb->d2[j], patch->r[i][j]),
					     iv_scale(iv_mul(rb->d1[j], slope), 2)));
		patch->h[i] = iv_add(
			patch->h[i],
			iv_share(rb->a[j], iv_sub(iv(p[1]), iv(grid->p[a->main][j][1]))));
	}
}

void incise_patch_over(struct incise_patch *patch, const struct incise_grid *grid,
		       const struct incise_block *a, const struct incise_block *b)
{
	const struct incise_axis_range *ra = &a->range;

	incise_patch_slopes(patch, grid, a, b);
	patch->f11 = patch->f22 = iv(0);
	for (int i = 0; i < grid->a.n; i++) {
		rule_sums(patch, grid, a, b, i);
		patch->f11 = iv_add(patch->f11,
				    iv_add(iv_mul(ra->d2[i], patch->t[i]),
					   iv_scale(iv_mul(ra->d1[i], patch->h[i]), 2)));
		patch->f22 = iv_add(patch->f22, iv_share(ra->a[i], patch->t2[i]));
	}
}

struct interval incise_patch_mixed(const struct incise_patch *patch,
				   const struct incise_grid *grid,
				   const struct incise_block *a,
				   const struct incise_block *b)
{
	const struct incise_axis_range *ra = &a->range, *rb = &b->range;
	struct interval f12 = iv(0);

	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			const double *p = grid->p[i][j];
			/* The parts of r that depend on i or j alone add up to 0 as well. */
			struct interval r = iv_sub(patch->r[i][j], patch->r[a->main][j]);
			struct interval by_b =
				iv_sub(iv(p[2]), iv(grid->p[a->main][j][2]));
			struct interval by_a =
				iv_sub(iv(p[1]), iv(grid->p[i][b->main][1]));

			f12 = iv_add(f12, iv_mul(iv_mul(ra->d1[i], rb->d1[j]), r));
			f12 = iv_add(f12, iv_mul(iv_mul(ra->d1[i], rb->a[j]), by_b));
			f12 = iv_add(f12, iv_mul(iv_mul(ra->a[i], rb->d1[j]), by_a));
		}
	return f12;
}

/*
 * --- survey ---
 *
 * Bounds by interval arithmetic over patches that cover the support. Linear interpolation over a
 * cell of width w is off by at most w²/8 times the largest second derivative.
 */

/*
 * Blocks per input of the finest patches: more give a tighter bound and take time, with the square.
 * Coarser ones of 2, 4 … blocks enclose the same and more: where a coarse patch adds nothing, the finer
 * ones within it are not looked at.
 */
#define LEVELS 5
#define BLOCKS 128

/* Every so many of the finest patches are looked at first, to compare coarse patches with. */
#define SAMPLE 8

/* Rounding an input to Q16.16. */
#define HALF_LSB (0.5 / INCISE_FIXED_ONE)

#define N INCISE_FIXED_MFS_MAX

/*
 * One input's support in blocks, n at level 0 and half as many at each next one; an input that is
 * trivial has one at each.
 */
struct blocks {
	int n;
	struct incise_block *level[LEVELS];
};

/*
 * The largest of each, over the whole support. They are added up though they need not meet
 * in one place: a cell of a table reaches over several blocks.
 */
enum largest {
	INPUT, /* rounding of the inputs */
	F11,   /* second derivatives */
	F22,
	WEIGHTS, /* table: times wa²/8 */
	SLOPES,	 /* the same for an output wa further on: times wa³/8 */
	OUTPUTS, /* times wb²/8 */
	WORST, /* outputs that are off, times wb²/8, meet weights that are: the survey's bends */
	N_LARGEST,
};

struct incise_survey {
	double largest[N_LARGEST];
	double bends; /* of the weights of input a, times wa²/8 */
	const struct incise_grid *grid;
	struct blocks a, b;
};

static void free_blocks(struct blocks *blocks)
{
	for (int level = 0; level < LEVELS; level++)
		free(blocks->level[level]);
}

static int count_blocks(const struct blocks *blocks, int level)
{
	return blocks->n > 1 ? blocks->n >> level : 1;
}

static int make_blocks(struct blocks *blocks, const struct incise_axis *axis, int n,
		       int levels)
{
	double from = axis->min;
	double to = axis->max + (axis->max - axis->min) / (INCISE_SURVEY_CELLS - 2);

	blocks->n = n;
	for (int level = 0; level < levels; level++) {
		int count = count_blocks(blocks, level);

		blocks->level[level] = calloc(count, sizeof(struct incise_block));
		if (!blocks->level[level])
			return -1;
		for (int k = 0; k < count; k++) {
			struct interval x = {from + (to - from) * k / count,
					     from + (to - from) * (k + 1) / count};

			/* Ends that round inwards would leave gaps. */
			incise_block_over(&blocks->level[level][k], axis,
					  iv_out(x.lo, x.hi));
		}
	}
	return 0;
}

/* The larger; a NaN counts as infinite. */
static double larger(double largest, double e)
{
	if (isnan(e))
		return INFINITY;
	return e > largest ? e : largest;
}

/* Find of a patch each quantity whose largest the survey keeps. */
static void look_at(const struct incise_grid *grid, const struct incise_block *a,
		    const struct incise_block *b, double found[N_LARGEST])
{
	struct interval of_a = iv(0), of_h = iv(0), of_b = iv(0);
	struct incise_patch patch;

	incise_patch_over(&patch, grid, a, b);
	found[INPUT] = (iv_mag(patch.f1) + iv_mag(patch.f2)) * HALF_LSB;
	found[F11] = iv_mag(patch.f11);
	found[F22] = iv_mag(patch.f22);
	/* Errors of the weights' table and the folded one: see lib/fixed/eval.c. */
	found[WORST] = 0;
	for (int i = 0; i < grid->a.n; i++) {
		double e = iv_mag(patch.t2[i]);

		of_a = iv_add(of_a, iv_mul(a->range.d2[i], patch.t[i]));
		of_h = iv_add(of_h, iv_mul(a->range.d2[i], patch.h[i]));
		of_b = iv_add(of_b, iv_mul(a->range.a[i], (struct interval){0, e}));
		found[WORST] = larger(found[WORST], e);
	}
	found[WEIGHTS] = iv_mag(of_a);
	found[SLOPES] = iv_mag(of_h);
	found[OUTPUTS] = iv_mag(of_b);
}

static void survey_patch(struct incise_survey *survey, int level, int k, int l)
{
	int wide = survey->a.n > 1 ? 2 : 1;
	double found[N_LARGEST];
	bool adds = false;

	look_at(survey->grid, &survey->a.level[level][k], &survey->b.level[level][l],
		found);
	for (int i = 0; i < N_LARGEST; i++)
		adds = adds || !(found[i] <= survey->largest[i]);
	if (!adds)
		return;
	for (int i = 0; i < N_LARGEST && !level; i++)
		survey->largest[i] = larger(survey->largest[i], found[i]);
	for (int i = 0; i < 2 * wide && level; i++)
		survey_patch(survey, level - 1, wide * k + i / 2, 2 * l + i % 2);
}

/*
 * Error of the direct arithmetic's degrees, relative to the largest being 1.
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
	/* The exponent that is taken off may belong to any function near the largest. */
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
	double ea[N], eb[N], d[N][N], sum = 0, spread = 0;

	degree_errors(&grid->a, a, ea);
	degree_errors(&grid->b, b, eb);
	if (grid->one)
		ea[0] = 0;
	/* |r - F| is at most the distance between the farthest two rules here. */
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			d[i][j] = iv_mag(
				rule_difference(grid, i, j, a->main, b->main, a, b));
			if (a->range.a[i].hi * b->range.a[j].hi > 1e-9)
				spread = fmax(spread, d[i][j]);
		}
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++)
			sum += (ea[i] + eb[j] + 0x1p-29) * (d[i][j] + spread);
	/* The largest weight is 1 within 1e-6. */
	return sum * 1.001;
}

struct incise_survey *incise_survey_new(const struct incise_grid *grid)
{
	struct incise_survey *survey = calloc(1, sizeof(*survey));

	if (!survey)
		return NULL;
	survey->grid = grid;
	if (make_blocks(&survey->a, &grid->a, grid->one ? 1 : BLOCKS, LEVELS) ||
	    make_blocks(&survey->b, &grid->b, BLOCKS, LEVELS)) {
		incise_survey_free(survey);
		return NULL;
	}
	for (int k = 0; k < survey->a.n; k++) {
		double bends = 0;

		for (int i = 0; i < grid->a.n; i++)
			bends += iv_mag(survey->a.level[0][k].range.d2[i]);
		survey->bends = larger(survey->bends, bends);
	}
	for (int k = 0; k < survey->a.n; k += SAMPLE)
		for (int l = 0; l < survey->b.n; l += SAMPLE)
			survey_patch(survey, 0, k, l);
	for (int k = 0; k < count_blocks(&survey->a, LEVELS - 1); k++)
		for (int l = 0; l < count_blocks(&survey->b, LEVELS - 1); l++)
			survey_patch(survey, LEVELS - 1, k, l);
	return survey;
}

void incise_survey_free(struct incise_survey *survey)
{
	if (!survey)
		return;
	free_blocks(&survey->a);
	free_blocks(&survey->b);
	free(survey);
}

/* Sums of a few doubles, each rounded: 1e-12 covers them. */
#define SLACK (1 + 1e-12)

double incise_survey_table(const struct incise_survey *s, double wa, double wb)
{
	const double *of = s->largest;
	double a2 = wa * wa / 8, b2 = wb * wb / 8;
	double bound = of[INPUT] + (of[WEIGHTS] + of[SLOPES] * wa) * a2 +
		       of[OUTPUTS] * b2 + s->bends * a2 * of[WORST] * b2;

	return larger(0, bound * SLACK);
}

double incise_survey_force(const struct incise_survey *s, double wa, double wb)
{
	const double *of = s->largest;

	return larger(0, (of[INPUT] + of[F11] * wa * wa / 8 + of[F22] * wb * wb / 8) *
				 SLACK);
}

/* Not part of the survey: most models are tables. */
double incise_survey_direct(const struct incise_survey *s)
{
	double direct = 0;

	for (int k = 0; k < s->a.n; k++)
		for (int l = 0; l < s->b.n; l++)
			direct = larger(direct, direct_error(s->grid, &s->a.level[0][k],
							     &s->b.level[0][l]));
	return larger(0, (s->largest[INPUT] + direct) * SLACK);
}

/* --- three inputs and more --- */

void incise_many_size(const struct incise_model *model, struct incise_grid_size *size)
{
	*size = (struct incise_grid_size){0};
	for (int r = 0; r < model->info.n_rules; r++) {
		const double *p = incise_model_rule(model, r)->p;
		double middle = p[0], half = 0, parts = fabs(p[0]);

		for (int i = 0; i < model->info.n_inputs; i++) {
			const struct incise_variable *in = &model->info.input[i];

			middle += p[i + 1] * (in->min + in->max) / 2;
			half += fabs(p[i + 1]) * (in->max - in->min) / 2;
			parts += fabs(p[i + 1]) * fmax(fabs(in->min), fabs(in->max));
		}
		size->rule = fmax(size->rule, fabs(middle) + half);
		size->parts = fmax(size->parts, parts);
	}
}

/* The farthest that two rules are apart anywhere within the blocks' supports. */
static double farthest(const struct incise_model *model, const struct interval *support)
{
	double most = 0;

	for (int r = 0; r < model->info.n_rules; r++)
		for (int k = 0; k < r; k++) {
			const double *p = incise_model_rule(model, r)->p,
				     *q = incise_model_rule(model, k)->p;
			struct interval d = iv_sub(iv(p[0]), iv(q[0]));

			for (int i = 0; i < model->info.n_inputs; i++)
				d = iv_add(d, iv_mul(iv_sub(iv(p[i + 1]), iv(q[i + 1])),
						     support[i]));
			most = larger(most, iv_mag(d));
		}
	return most;
}

/*
 * y = Σ w f / Σ w, w = Π μ, lies between the rules' outputs f, so that |f - y| ≤ D, the farthest that
 * two of them are apart. The largest of each input's degrees μ is 1. With errors e of the degrees, and
 * a floor of 2^-30 at each product,
 *
 *     |Δy| ≤ D · (Σi Σk e(i,k) + rules · inputs · 2^-30)
 *
 * and, of inputs that are off by half an LSB, with ā the degrees that add up to 1,
 *
 *     |∂y/∂xi| ≤ max |p(i)| + D/2 · Σk |∂ā(i,k)/∂xi|
 */
double incise_many_direct(const struct incise_model *model)
{
	int n = model->info.n_inputs;
	struct interval support[INCISE_FIXED_INPUTS_MAX];
	double degrees = model->info.n_rules * n * 0x1p-30, input = 0, bends = 0, D;

	for (int i = 0; i < n; i++) {
		struct incise_axis axis;
		struct blocks blocks = {0};
		const struct incise_block *block;
		double worst = 0, steepest = 0, slope = 0;

		incise_axis_init(&axis, model, i);
		if (make_blocks(&blocks, &axis, BLOCKS, 1)) {
			free_blocks(&blocks);
			return HUGE_VAL;
		}
		block = blocks.level[0];
		support[i] = (struct interval){block[0].x.lo, block[BLOCKS - 1].x.hi};
		for (int b = 0; b < BLOCKS; b++) {
			double e[N], sum = 0, turns = 0;

			degree_errors(&axis, &block[b], e);
			for (int k = 0; k < axis.n; k++) {
				sum += e[k];
				turns += iv_mag(block[b].range.d1[k]);
			}
			worst = larger(worst, sum);
			steepest = larger(steepest, turns);
		}
		free_blocks(&blocks);
		for (int r = 0; r < model->info.n_rules; r++)
			slope = fmax(slope, fabs(incise_model_rule(model, r)->p[i + 1]));
		degrees += worst;
		input += slope * HALF_LSB;
		bends += steepest / 2 * HALF_LSB;
	}
	D = farthest(model, support);
	/* Products of errors, and a sum of weights that is 1 within 1e-6. */
	return larger(0, (input + D * (bends + degrees * 1.001)) * SLACK);
}
