// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A model as tables of what its rules depend upon, for lib/fixed/table.c.
 *
 * A part of one noun: tests/unit/model/compile.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include "fx_image.h"

/* Weights at each knot of input a, rounded so that they add up to just 2^30. */
static int put_weights(struct incise_fx_image *image, const struct incise_cells *cells)
{
	const struct incise_axis *a = &image->grid->a;
	int32_t *w = incise_fx_image_extend(image, (size_t)(cells->n + 1) * a->n * 4,
					    &image->head.input[0].offset);
	long double at[INCISE_FIXED_MFS_MAX];

	if (!w)
		return -ENOMEM;
	for (int k = 0; k <= cells->n; k++, w += a->n) {
		int64_t rest = 1 << 30;
		int largest = 0;

		incise_axis_at(a, incise_fx_knot(cells, k), at);
		for (int i = 0; i < a->n; i++) {
			w[i] = (int32_t)llrintl(at[i] * (1 << 30));
			rest -= w[i];
			largest = at[i] > at[largest] ? i : largest;
		}
		w[largest] += (int32_t)rest;
		for (int i = 0; i < a->n; i++)
			w[i] = (int32_t)incise_fx_le32((uint32_t)w[i]);
	}
	return 0;
}

/* Outputs and slopes of input a's functions at each knot of input b. */
static int put_fold(struct incise_fx_image *image, const struct incise_cells *cells)
{
	const struct incise_grid *grid = image->grid;
	int stride = grid->one ? 1 : 2 * grid->a.n;
	int32_t *to = incise_fx_image_extend(image, (size_t)(cells->n + 1) * stride * 4,
					     &image->head.data);
	/* The middle as lib/fixed/table.c counts it. */
	int64_t range = (int64_t)image->head.input[0].max - image->head.input[0].min;
	long double middle =
		(image->head.input[0].min + (range >> 1)) / (long double)INCISE_FIXED_ONE;
	long double at[INCISE_FIXED_MFS_MAX];

	if (!to)
		return -ENOMEM;
	for (int k = 0; k <= cells->n; k++) {
		long double x = incise_fx_knot(cells, k);

		incise_axis_at(&grid->b, x, at);
		for (int i = 0; i < grid->a.n; i++) {
			long double g = 0, h = 0;

			for (int j = 0; j < grid->b.n; j++) {
				const double *p = grid->p[i][j];

				g += at[j] * (p[0] + p[1] * middle + p[2] * x);
				h += at[j] * p[1];
			}
			*to++ = (int32_t)incise_fx_le32((uint32_t)(int32_t)llrintl(
				ldexpl(g, image->head.shift_a)));
			if (!grid->one)
				*to++ = (int32_t)incise_fx_le32(
					(uint32_t)(int32_t)llrintl(
						ldexpl(h, image->head.shift_b)));
		}
	}
	return 0;
}

/* Roundings on the way through lib/fixed/table.c; see there. */
static double table_rounding(const struct incise_fx_image *image,
			     const struct incise_grid_size *size)
{
	const struct incise_grid *grid = image->grid;
	double lsb_g = ldexp(1, -image->head.shift_a),
	       lsb_h = ldexp(1, -image->head.shift_b);
	double reach = (grid->a.max - grid->a.min) / 2 + 1;
	double weights = grid->a.n * (grid->a.n / 2.0 + 2) * 0x1p-30;
	double output = 0.5 / INCISE_FIXED_ONE;

	/* g: half an LSB in the table, one for the floor of its sum, one of x·h's, one floored
	 * between knots; h: half an LSB, one for its sum's floor, times x. */
	if (grid->one)
		return output + 2 * lsb_g;
	return output + 4 * lsb_g + 2 * lsb_h * reach + weights * size->rule;
}

int incise_fx_build_table(struct incise_fx_image *image, const struct incise_grid *grid,
			  const struct incise_survey *survey, int cells,
			  const struct incise_grid_size *size,
			  const struct incise_model *model)
{
	struct incise_cells a, b;
	int rc = 0;

	incise_fx_image_begin(image, grid, INCISE_FIXED_TABLE, model);
	for (int i = 0; i < incise_fx_n_inputs(grid); i++)
		incise_fx_image_set_cells(image, i, cells);
	/* g + x·h within 2^31 with one bit to spare: knots lie beyond the support, too. */
	image->head.shift_a = (int)fmin(28, 30 - incise_fx_bits(1.25 * size->rule));
	image->head.shift_b = (int)fmin(45, 30 - incise_fx_bits(size->slope));
	if (image->head.shift_a < 17 || 16 + image->head.shift_b < image->head.shift_a)
		return -ERANGE;
	/* A shift by more than 62 is none; more digits of h than that say nothing. */
	if (16 + image->head.shift_b - image->head.shift_a > 62)
		image->head.shift_b = 46 + image->head.shift_a;
	incise_fx_image_cells(image, &a, &b);
	if (!grid->one)
		rc = put_weights(image, &a);
	if (!rc)
		rc = put_fold(image, &b);
	if (!rc)
		image->bound = incise_survey_table(survey, a.width, b.width) +
			       table_rounding(image, size);
	return rc;
}
