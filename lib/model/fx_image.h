/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A compiled model under construction: its header, and behind that weights, tables and
 * functions in the order in which room for them was asked for; see lib/fixed/layout.h. The
 * header's numbers are the machine's own until it is finished.
 */
#ifndef INCISE_FX_IMAGE_H
#define INCISE_FX_IMAGE_H

#include "../fixed/layout.h"
#include "grid.h"

/* A force table is the cheapest only while it stays in the cache beside all else. */
#define INCISE_FX_FORCE_SIZE_MAX (256 << 10)

struct incise_fx_image {
	const struct incise_grid *grid;
	struct incise_fx_header head;
	uint8_t *data; /* behind the header */
	size_t size;
	double bound;
};

/* Cells of one input. */
struct incise_cells {
	double from;  /* lower end of the support */
	double width; /* of a cell */
	int n;
};

/* Least k with 2^k > v. */
int incise_fx_bits(double v);

int32_t incise_fx_q16(double x);

const struct incise_axis *incise_fx_input_axis(const struct incise_grid *grid, int i);
int incise_fx_n_inputs(const struct incise_grid *grid);

/* Empty, with what the header says of the model. */
void incise_fx_image_begin(struct incise_fx_image *image, const struct incise_grid *grid,
			   enum incise_fixed_arithmetic arithmetic,
			   const struct incise_model *model);

/* Room for n bytes at the end; *offset from the blob's begin. NULL without memory. */
void *incise_fx_image_extend(struct incise_fx_image *image, size_t n, uint32_t *offset);

/* Cells of input i: the width is the largest power of two that gives at least n cells. */
void incise_fx_image_set_cells(struct incise_fx_image *image, int i, int n);

/* The two inputs' cells as the grid's a and b; a trivial input a has none. */
void incise_fx_image_cells(const struct incise_fx_image *image, struct incise_cells *a,
			   struct incise_cells *b);

long double incise_fx_knot(const struct incise_cells *cells, int k);

/*
 * Fill in an image in one arithmetic, its bound included. 0, -ERANGE (no format holds it),
 * -E2BIG (a force table larger than INCISE_FX_FORCE_SIZE_MAX), -ENOMEM; image->data is the
 * caller's to free.
 */
int incise_fx_build_table(struct incise_fx_image *image, const struct incise_grid *grid,
			  const struct incise_survey *survey, int cells,
			  const struct incise_grid_size *size,
			  const struct incise_model *model);
int incise_fx_build_force(struct incise_fx_image *image, const struct incise_grid *grid,
			  const struct incise_survey *survey, int cells,
			  const struct incise_grid_size *size,
			  const struct incise_model *model);
int incise_fx_build_direct(struct incise_fx_image *image, const struct incise_grid *grid,
			   const struct incise_survey *survey,
			   const struct incise_grid_size *size,
			   const struct incise_model *model);

/* Put header and data together, and look at the result as a stranger would. */
struct incise_fixed *incise_fx_image_finish(struct incise_fx_image *image,
					    struct incise_error *err);

#endif
