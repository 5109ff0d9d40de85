// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A compiled model under construction; see fx_image.h.
 *
 * A part of one noun: tests/unit/model/compile.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "compiled.h"
#include "fx_image.h"

int incise_fx_bits(double v)
{
	int e;

	frexp(v, &e);
	return v > 0 ? e : -1000;
}

int32_t incise_fx_q16(double x)
{
	return (int32_t)lrint(x * INCISE_FIXED_ONE);
}

const struct incise_axis *incise_fx_input_axis(const struct incise_grid *grid, int i)
{
	return i == 0 && !grid->one ? &grid->a : &grid->b;
}

int incise_fx_n_inputs(const struct incise_grid *grid)
{
	return grid->one ? 1 : 2;
}

/* A name cut to fit, and zero-padded: the header was zeroed. */
static void put_name(char *to, size_t size, const char *name)
{
	memcpy(to, name, strnlen(name, size - 1));
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
}

void incise_fx_image_begin(struct incise_fx_image *image, const struct incise_grid *grid,
			   enum incise_fixed_arithmetic arithmetic,
			   const struct incise_model *model)
{
	memset(image, 0, sizeof(*image));
	image->grid = grid;
	memcpy(image->head.magic, INCISE_FX_MAGIC, sizeof(image->head.magic));
	image->head.version = INCISE_FX_VERSION;
	image->head.arithmetic = arithmetic;
	image->head.n_inputs = incise_fx_n_inputs(grid);
	image->head.n_rules = grid->a.n * grid->b.n;
	put_name(image->head.name, sizeof(image->head.name), incise_model_name(model));
	put_name(image->head.output, sizeof(image->head.output),
		 incise_model_output(model)->name);
	for (int i = 0; i < incise_fx_n_inputs(grid); i++) {
		const struct incise_axis *axis = incise_fx_input_axis(grid, i);

		image->head.input[i].min = incise_fx_q16(axis->min);
		image->head.input[i].max = incise_fx_q16(axis->max);
		image->head.input[i].n_mfs = axis->n;
		put_name(image->head.input[i].name, sizeof(image->head.input[i].name),
			 incise_model_input(model, i)->name);
	}
}

void *incise_fx_image_extend(struct incise_fx_image *image, size_t n, uint32_t *offset)
{
	uint8_t *data = realloc(image->data, image->size + n);

	if (!data)
		return NULL;
	*offset = (uint32_t)(sizeof(image->head) + image->size);
	image->data = data;
	image->size += n;
	memset(data + image->size - n, 0, n);
	return data + image->size - n;
}

void incise_fx_image_set_cells(struct incise_fx_image *image, int i, int n)
{
	struct incise_fx_input *in = &image->head.input[i];
	int64_t range = (int64_t)in->max - in->min;
	int shift = 0;

	while (shift < 30 && (range >> (shift + 1)) + 1 >= n)
		shift++;
	in->cell_shift = shift;
	in->cells = (uint32_t)((range >> shift) + 1);
}

static struct incise_cells cells_of(const struct incise_fx_image *image, int i)
{
	const struct incise_fx_input *in = &image->head.input[i];

	return (struct incise_cells){
		.from = in->min / (double)INCISE_FIXED_ONE,
		.width = ldexp(1, (int)in->cell_shift - 16),
		.n = (int)in->cells,
	};
}

long double incise_fx_knot(const struct incise_cells *cells, int k)
{
	return cells->from + (long double)cells->width * k;
}

void incise_fx_image_cells(const struct incise_fx_image *image, struct incise_cells *a,
			   struct incise_cells *b)
{
	*a = image->grid->one ? (struct incise_cells){0} : cells_of(image, 0);
	*b = cells_of(image, image->grid->one ? 0 : 1);
}

struct incise_fixed *incise_fx_image_finish(struct incise_fx_image *image,
					    struct incise_error *err)
{
	size_t size = sizeof(image->head) + image->size;
	struct incise_compiled *owned = malloc(sizeof(*owned) + size);
	struct incise_fx_header *head;
	int rc;

	if (!owned) {
		incise_error_set(err, ENOMEM, "no memory for a compiled model");
		return NULL;
	}
	head = (struct incise_fx_header *)owned->blob;
	*head = image->head;
	memcpy(head + 1, image->data, image->size);
	head->size = incise_fx_le32((uint32_t)size);
	head->version = incise_fx_le32(head->version);
	head->arithmetic = incise_fx_le32(head->arithmetic);
	head->n_inputs = incise_fx_le32(head->n_inputs);
	head->n_rules = incise_fx_le32(head->n_rules);
	head->shift_a = (int32_t)incise_fx_le32((uint32_t)head->shift_a);
	head->shift_b = (int32_t)incise_fx_le32((uint32_t)head->shift_b);
	head->bound = incise_fx_le64((uint64_t)ceil(ldexp(image->bound, 32)));
	head->data = incise_fx_le32(head->data);
	for (int i = 0; i < INCISE_FIXED_INPUTS_MAX; i++) {
		struct incise_fx_input *in = &head->input[i];

		in->min = (int32_t)incise_fx_le32((uint32_t)in->min);
		in->max = (int32_t)incise_fx_le32((uint32_t)in->max);
		in->n_mfs = incise_fx_le32(in->n_mfs);
		in->cell_shift = incise_fx_le32(in->cell_shift);
		in->cells = incise_fx_le32(in->cells);
		in->offset = incise_fx_le32(in->offset);
	}
	head->crc =
		incise_fx_le32(incise_fx_crc((const uint8_t *)head + INCISE_FX_CRC_FROM,
					     (uint32_t)(size - INCISE_FX_CRC_FROM)));
	rc = incise_fixed_open(&owned->fx, owned->blob, (uint32_t)size);
	if (rc) {
		free(owned);
		incise_error_set(
			err, ERANGE,
			"fixed point: the model's numbers fit no format; use double");
		return NULL;
	}
	return &owned->fx;
}
