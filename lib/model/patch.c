// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Enclosures of a model's derivatives over a patch; see patch.h. With
 *
 *   T(i) = Σj b̄(j) r(i,j)    S(j) = Σi ā(i) r(i,j)    h(i) = Σj b̄(j) p(i,j,1)
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
#include "patch.h"

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

struct interval incise_patch_rules(const struct incise_grid *grid, int i, int j, int k,
				   int l, const struct incise_block *a,
				   const struct incise_block *b)
{
	const double *p = grid->p[i][j], *q = grid->p[k][l];
	struct interval d = iv_sub(iv(p[0]), iv(q[0]));

	d = iv_add(d, iv_mul(iv_sub(iv(p[1]), iv(q[1])), a->x));
	return iv_add(d, iv_mul(iv_sub(iv(p[2]), iv(q[2])), b->x));
}

/* Σij ā(i) b̄(j) p(i,j,k), about the main rule's. */
static struct interval mean_slope(const struct incise_grid *grid,
				  const struct incise_block *a,
				  const struct incise_block *b, int k)
{
	struct interval sum = iv(grid->p[a->main][b->main][k]);

	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			struct interval off = iv_sub(iv(grid->p[i][j][k]),
						     iv(grid->p[a->main][b->main][k]));

			sum = iv_add(sum,
				     iv_mul(iv_mul(a->range.a[i], b->range.a[j]), off));
		}
	return sum;
}

void incise_patch_slopes(struct incise_patch *patch, const struct incise_grid *grid,
			 const struct incise_block *a, const struct incise_block *b)
{
	patch->f1 = mean_slope(grid, a, b, 1);
	patch->f2 = mean_slope(grid, a, b, 2);
	for (int i = 0; i < grid->a.n; i++) {
		patch->t[i] = iv(0);
		for (int j = 0; j < grid->b.n; j++)
			patch->t[i] = iv_add(
				patch->t[i],
				iv_mul(b->range.a[j],
				       incise_patch_rules(grid, i, j, a->main, j, a, b)));
		patch->f1 = iv_add(patch->f1, iv_mul(a->range.d1[i], patch->t[i]));
	}
	for (int j = 0; j < grid->b.n; j++) {
		struct interval s = iv(0);

		for (int i = 0; i < grid->a.n; i++)
			s = iv_add(s, iv_mul(a->range.a[i],
					     incise_patch_rules(grid, i, j, i, b->main, a,
								b)));
		patch->f2 = iv_add(patch->f2, iv_mul(b->range.d1[j], s));
	}
}

/* t2 and h of function i of input a. */
static void rule_sums(struct incise_patch *patch, const struct incise_grid *grid,
		      const struct incise_block *a, const struct incise_block *b, int i)
{
	const struct incise_axis_range *rb = &b->range;
	int m = b->main;

	patch->t2[i] = patch->h[i] = iv(0);
	for (int j = 0; j < grid->b.n; j++) {
		const double *p = grid->p[i][j];
		struct interval r = incise_patch_rules(grid, i, j, i, m, a, b);
		struct interval slope = iv_sub(iv(p[2]), iv(grid->p[i][m][2]));

		patch->t2[i] = iv_add(patch->t2[i],
				      iv_add(iv_mul(rb->d2[j], r),
					     iv_scale(iv_mul(rb->d1[j], slope), 2)));
		patch->h[i] = iv_add(
			patch->h[i],
			iv_mul(rb->a[j], iv_sub(iv(p[1]), iv(grid->p[a->main][j][1]))));
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
		patch->f22 = iv_add(patch->f22, iv_mul(ra->a[i], patch->t2[i]));
	}
}

struct interval incise_patch_mixed(const struct incise_grid *grid,
				   const struct incise_block *a,
				   const struct incise_block *b)
{
	const struct incise_axis_range *ra = &a->range, *rb = &b->range;
	struct interval f12 = iv(0);

	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			const double *p = grid->p[i][j];
			/* Of r, what depends on i or j alone adds up to 0 as well. */
			struct interval r =
				iv_sub(incise_patch_rules(grid, i, j, i, b->main, a, b),
				       incise_patch_rules(grid, a->main, j, a->main,
							  b->main, a, b));
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
