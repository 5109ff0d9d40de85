// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From a model in double to a blob in integers: number formats chosen such that nothing
 * can overflow, tables as coarse as the budget allows, and the certified bound written
 * in; see incise/fixed.h. The arithmetics are built in fx_*.c.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "fx_image.h"

/* 0.1 mN: an order of magnitude below a 12-bit step of the force channel. */
#define DEFAULT_BUDGET 1e-4

/* Cells per input that are tried, from coarse to fine. */
static const int cell_counts[] = {
	INCISE_SURVEY_CELLS, 64, 128, 256, 512, 1024, 2048, 4096};
#define N_COUNTS ((int)(sizeof(cell_counts) / sizeof(*cell_counts)))

/* Terms of a rule beyond which no format holds it: Q16.16 ends at 32768. */
#define LARGEST 1e12

static const char *const names[] = {"direct", "table", "force"};

const char *incise_fixed_arithmetic_name(enum incise_fixed_arithmetic arithmetic)
{
	return names[arithmetic];
}

void incise_fixed_options_init(struct incise_fixed_options *options)
{
	*options =
		(struct incise_fixed_options){.budget = DEFAULT_BUDGET, .arithmetic = -1};
}

/* Build one candidate; 0, or -errno when it cannot be. */
static int build(struct incise_fx_image *image, const struct incise_grid *grid,
		 const struct incise_survey *survey, int arithmetic, int cells,
		 const struct incise_grid_size *size, const struct incise_model *model)
{
	int rc;

	switch (arithmetic) {
	case INCISE_FIXED_FORCE:
		rc = incise_fx_build_force(image, grid, survey, cells, size, model);
		break;
	case INCISE_FIXED_TABLE:
		rc = incise_fx_build_table(image, grid, survey, cells, size, model);
		break;
	default:
		rc = incise_fx_build_direct(image, grid, survey, size, model);
	}
	if (!rc && !(ldexp(image->bound, 32) < 0x1p62))
		rc = -ERANGE;
	if (rc) {
		free(image->data);
		image->data = NULL;
	}
	return rc;
}

/* The first candidate, from cheap to dear, whose bound is within the budget; else the one
 * of the least bound is left in *best. */
static int choose(struct incise_fx_image *best, const struct incise_grid *grid,
		  const struct incise_fixed_options *o, const struct incise_model *model)
{
	static const int order[] = {INCISE_FIXED_FORCE, INCISE_FIXED_TABLE,
				    INCISE_FIXED_DIRECT};
	struct incise_survey *survey;
	struct incise_grid_size size;
	int rc = -ERANGE;

	incise_grid_size(grid, &size);
	*best = (struct incise_fx_image){.bound = INFINITY};
	/* Nothing of that size has a format; what follows may count on finite numbers. */
	if (!(size.parts < LARGEST))
		return rc;
	survey = incise_survey_new(grid);
	if (!survey)
		return -ENOMEM;
	for (int k = 0; k < 3; k++)
		for (int c = 0; c < N_COUNTS; c++) {
			struct incise_fx_image image;
			int built;

			if ((o->arithmetic >= 0 && order[k] != o->arithmetic) ||
			    (order[k] == INCISE_FIXED_DIRECT && c) ||
			    (order[k] != INCISE_FIXED_DIRECT &&
			     cell_counts[c] < o->cells))
				continue;
			built = build(&image, grid, survey, order[k], cell_counts[c],
				      &size, model);
			if (built == -ENOMEM) {
				rc = built;
				goto out;
			}
			/* What went wrong last counts if all did. */
			rc = rc && built ? built : 0;
			if (built)
				continue;
			if (image.bound >= best->bound) {
				free(image.data);
				continue;
			}
			free(best->data);
			*best = image;
			if (!(o->budget > 0) || image.bound <= o->budget)
				goto out;
		}
out:
	incise_survey_free(survey);
	return rc;
}

struct incise_fixed *incise_fixed_compile(const struct incise_model *model,
					  const struct incise_fixed_options *options,
					  struct incise_error *err)
{
	struct incise_grid *grid = malloc(sizeof(*grid));
	struct incise_fixed_options o;
	struct incise_fixed *fx = NULL;
	struct incise_fx_image best = {0};
	int rc;

	incise_fixed_options_init(&o);
	if (options)
		o = *options;
	if (!grid) {
		incise_error_set(err, ENOMEM, "no memory to compile a model");
		return NULL;
	}
	if (o.arithmetic > INCISE_FIXED_FORCE || o.cells > cell_counts[N_COUNTS - 1]) {
		incise_error_set(
			err, EINVAL,
			"fixed point: there is no such arithmetic, or more than %d "
			"cells were asked for",
			cell_counts[N_COUNTS - 1]);
		goto out;
	}
	if (incise_grid_init(grid, model, err))
		goto out;
	rc = choose(&best, grid, &o, model);
	if (rc == -ENOMEM)
		incise_error_set(err, ENOMEM, "no memory to compile a model");
	else if (rc == -E2BIG)
		incise_error_set(
			err, E2BIG,
			"fixed point: a force table of so many cells exceeds %d bytes; ask for "
			"fewer, or for the arithmetic 'table'",
			INCISE_FX_FORCE_SIZE_MAX);
	else if (rc)
		incise_error_set(
			err, ERANGE,
			"fixed point: consequents or widths are too extreme for any "
			"format; train with more ridge, or use double");
	else if (o.budget > 0 && best.bound > o.budget)
		incise_error_set(
			err, ERANGE,
			"fixed point: no arithmetic holds an error of %.3g: the best, %s, "
			"is certain to %.3g; allow more, or use double",
			o.budget, names[best.head.arithmetic], best.bound);
	else
		fx = incise_fx_image_finish(&best, err);
out:
	rc = errno;
	free(best.data);
	free(grid);
	errno = rc;
	return fx;
}
