// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A model as one table of its output, for lib/fixed/force.c.
 *
 * A part of one noun: tests/unit/model/compile.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include "fx_image.h"

int incise_fx_build_force(struct incise_fx_image *image, const struct incise_grid *grid,
			  const struct incise_survey *survey, int cells,
			  const struct incise_grid_size *size,
			  const struct incise_model *model)
{
	long double at_a[INCISE_FIXED_MFS_MAX], at_b[INCISE_FIXED_MFS_MAX];
	struct incise_cells a, b;
	int32_t *to;

	incise_fx_image_begin(image, grid, INCISE_FIXED_FORCE, model);
	for (int i = 0; i < incise_fx_n_inputs(grid); i++)
		incise_fx_image_set_cells(image, i, cells);
	image->head.shift_a = (int)fmin(28, 30 - incise_fx_bits(1.25 * size->rule));
	if (image->head.shift_a < 17)
		return -ERANGE;
	incise_fx_image_cells(image, &a, &b);
	if ((size_t)(a.n + 1) * (b.n + 1) * 4 > INCISE_FX_FORCE_SIZE_MAX)
		return -E2BIG;
	to = incise_fx_image_extend(image,
				    (size_t)(grid->one ? 1 : a.n + 1) * (b.n + 1) * 4,
				    &image->head.data);
	if (!to)
		return -ENOMEM;
	for (int k = 0; k <= a.n; k++) {
		long double xa = incise_fx_knot(&a, k);

		incise_axis_at(&grid->a, xa, at_a);
		for (int l = 0; l <= b.n; l++) {
			long double xb = incise_fx_knot(&b, l), y = 0;

			incise_axis_at(&grid->b, xb, at_b);
			for (int i = 0; i < grid->a.n; i++)
				for (int j = 0; j < grid->b.n; j++) {
					const double *p = grid->p[i][j];

					y += at_a[i] * at_b[j] *
					     (p[0] + p[1] * xa + p[2] * xb);
				}
			*to++ = (int32_t)incise_fx_le32((uint32_t)(int32_t)llrintl(
				ldexpl(y, image->head.shift_a)));
		}
	}
	/* Half an LSB in the table, two floored between knots, half one of the output. */
	image->bound = incise_survey_force(survey, a.width, b.width) +
		       ldexp(2.5, -image->head.shift_a) + 0.5 / INCISE_FIXED_ONE;
	return 0;
}
