// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A model as its functions and consequents themselves, for lib/fixed/direct.c.
 *
 * A part of one noun: tests/unit/model/compile.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include "fx_image.h"

/* Returns whether the width has a format. */
static bool compile_mf(const struct incise_axis *axis, int i, struct incise_fx_mf *fx)
{
	/* exp(-(x-c)²/(2s²)) = 2^-((x-c)·k)²; Q16 in, Q24 out. */
	double k = 1 / (axis->s[i] * sqrt(2 * M_LN2)), scaled = k * 256;
	int shift = 30 - incise_fx_bits(scaled);
	double slope = rint(ldexp(scaled, shift)), lost;

	if (shift < 0)
		return false;
	fx->centre = incise_fx_q16(axis->c[i]);
	/* So wide that it is flat: 2^-32 of a width is less than an LSB of the result. */
	fx->slope = shift > 62 ? 0 : (int32_t)fmin(slope, 1 << 30);
	fx->shift = shift > 62 ? 62 : shift;
	/* The rounding of the centre would act like one of the input: as much as 30 µN. */
	lost = axis->c[i] - fx->centre / (double)INCISE_FIXED_ONE;
	fx->offset = (int32_t)lrint(ldexp(fmax(-127, fmin(lost * k, 127)), 24));
	fx->centre = (int32_t)incise_fx_le32((uint32_t)fx->centre);
	fx->slope = (int32_t)incise_fx_le32((uint32_t)fx->slope);
	fx->shift = (int32_t)incise_fx_le32((uint32_t)fx->shift);
	fx->offset = (int32_t)incise_fx_le32((uint32_t)fx->offset);
	return true;
}

/*
 * Distances are held at 128 widths. Between two functions that are both further away the
 * nearer one could not be told: the largest such distance is where neighbours cross, or
 * at the ends of the support.
 */
static bool covered(const struct incise_axis *axis)
{
	double points[2 + INCISE_FIXED_MFS_MAX * INCISE_FIXED_MFS_MAX];
	int n = 0;

	points[n++] = axis->min;
	points[n++] = axis->max;
	for (int i = 0; i < axis->n; i++)
		for (int k = 0; k < i; k++) {
			double x = (axis->c[i] * axis->s[k] + axis->c[k] * axis->s[i]) /
				   (axis->s[i] + axis->s[k]);

			if (x > axis->min && x < axis->max)
				points[n++] = x;
		}
	for (int j = 0; j < n; j++) {
		double least = INFINITY;

		for (int k = 0; k < axis->n; k++)
			least = fmin(least, fabs(points[j] - axis->c[k]) /
						    (axis->s[k] * sqrt(2 * M_LN2)));
		if (least > 127)
			return false;
	}
	return true;
}

int incise_fx_build_direct(struct incise_fx_image *image, const struct incise_grid *grid,
			   const struct incise_survey *survey,
			   const struct incise_grid_size *size,
			   const struct incise_model *model)
{
	int n = incise_fx_n_inputs(grid);
	double reach = 1;
	int64_t *p;

	incise_fx_image_begin(image, grid, INCISE_FIXED_DIRECT, model);
	for (int i = 0; i < n; i++) {
		const struct incise_axis *axis = incise_fx_input_axis(grid, i);
		struct incise_fx_mf *mf = incise_fx_image_extend(
			image, axis->n * sizeof(*mf), &image->head.input[i].offset);

		if (!mf)
			return -ENOMEM;
		if (!covered(axis))
			return -ERANGE;
		for (int k = 0; k < axis->n; k++)
			if (!compile_mf(axis, k, &mf[k]))
				return -ERANGE;
		reach += fmax(fabs(axis->min), fabs(axis->max));
	}
	/* p·x adds up in Q(shift_a + 16), Σ w·y in Q(shift_b + 30): within 62 bits. */
	image->head.shift_a = (int)fmin(30, 61 - 16 - incise_fx_bits(size->parts + 1));
	image->head.shift_b =
		(int)fmin(26, 61 - 30 - incise_fx_bits(grid->a.n * grid->b.n) -
				      incise_fx_bits(size->rule + 1e-3));
	if (image->head.shift_b < 17 || image->head.shift_a < 1 ||
	    image->head.shift_a + 16 < image->head.shift_b)
		return -ERANGE;
	p = incise_fx_image_extend(image, (size_t)grid->a.n * grid->b.n * (n + 1) * 8,
				   &image->head.data);
	if (!p)
		return -ENOMEM;
	for (int i = 0; i < grid->a.n; i++)
		for (int j = 0; j < grid->b.n; j++) {
			const double *c = grid->p[i][j];
			const double order[] = {c[0], grid->one ? c[2] : c[1], c[2]};

			for (int k = 0; k <= n; k++)
				*p++ = (int64_t)incise_fx_le64((uint64_t)llrint(
					ldexp(order[k], image->head.shift_a)));
		}
	/* A consequent's half LSB times the inputs; a rule's floor and the quotient's; half
	 * an LSB of the output. */
	image->bound = incise_survey_direct(survey) +
		       ldexp(0.5 * reach, -image->head.shift_a) +
		       ldexp(2, -image->head.shift_b) + 0.5 / INCISE_FIXED_ONE;
	return 0;
}
