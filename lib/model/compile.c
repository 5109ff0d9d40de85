// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A compiled model: from a model in double to a blob in integers, to and from files, and
 * evaluated in double; see incise/fixed.h. Number formats are chosen such that nothing can
 * overflow, tables as coarse as the budget allows, and the certified bound is written in.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include "../fixed/layout.h"
#include "model_grid.h"

/* A compiled model with the bytes that it reads. */
struct compiled {
	struct incise_fixed fx; /* first: incise_fixed_free() gets its address */
	uint64_t blob[];	/* aligned to 8 */
};

/* A force table is the cheapest only while it stays in the cache beside all else. */
#define FORCE_SIZE_MAX (256 << 10)

/* The model to compile, in the forms that all evaluators are built from. */
struct source {
	const struct incise_model *model;
	struct incise_axis axis[INCISE_FIXED_INPUTS_MAX]; /* of each input */
	/* For one and two inputs; else NULL. */
	const struct incise_grid *grid;
	const struct incise_survey *survey;
	struct incise_grid_size size;
};

/*
 * A compiled model under construction: its header, and behind that weights, tables and
 * functions in the order in which they were added; see lib/fixed/layout.h. The header's
 * numbers are in the machine's own order until image_finish().
 */
struct image {
	const struct source *source;
	const struct incise_grid *grid; /* the source's */
	struct incise_fx_header head;
	uint8_t *data; /* behind the header */
	size_t size;
	double bound;
};

/* Cells of one input. */
struct cells {
	double from;  /* lower end of the support */
	double width; /* of a cell */
	int n;
};

/* Least k with 2^k > v. */
static int bits_of(double v)
{
	int e;

	frexp(v, &e);
	return v > 0 ? e : -1000;
}

static int32_t q16(double x)
{
	return (int32_t)lrint(x * INCISE_FIXED_ONE);
}

/* A name cut to fit, and zero-padded: the header was zeroed. */
static void put_compile_name(char *to, size_t size, const char *name)
{
	memcpy(to, name, strnlen(name, size - 1));
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
}

/* An image without data, its header filled in from the model. */
static void image_start(struct image *image, const struct source *source,
			enum incise_fixed_arithmetic arithmetic)
{
	const struct incise_model *model = source->model;
	const struct incise_model_info *info = incise_model_info(model);

	memset(image, 0, sizeof(*image));
	image->source = source;
	image->grid = source->grid;
	memcpy(image->head.magic, INCISE_FX_MAGIC, sizeof(image->head.magic));
	image->head.version = source->grid ? INCISE_FX_VERSION : INCISE_FX_VERSION_MANY;
	image->head.arithmetic = arithmetic;
	image->head.n_inputs = (uint32_t)info->n_inputs;
	image->head.n_rules = (uint32_t)info->n_rules;
	put_compile_name(image->head.name, sizeof(image->head.name), info->name);
	put_compile_name(image->head.output, sizeof(image->head.output),
			 info->output.name);
	for (int i = 0; i < info->n_inputs; i++) {
		const struct incise_axis *axis = &source->axis[i];

		image->head.input[i].min = q16(axis->min);
		image->head.input[i].max = q16(axis->max);
		image->head.input[i].n_mfs = axis->n;
		put_compile_name(image->head.input[i].name,
				 sizeof(image->head.input[i].name), info->input[i].name);
	}
}

/* Add n zero bytes at the end; *offset counts from the blob's start. NULL without memory. */
static void *image_extend(struct image *image, size_t n, uint32_t *offset)
{
	uint8_t *data = realloc(image->data, image->size + n);

	if (!data)
		return NULL;
	*offset = incise_fx_header_size(image->head.version) + (uint32_t)image->size;
	image->data = data;
	image->size += n;
	memset(data + image->size - n, 0, n);
	return data + image->size - n;
}

/* Cells of all inputs: the width is the largest power of two that gives at least n cells. */
static void set_cells(struct image *image, int n)
{
	for (uint32_t i = 0; i < image->head.n_inputs; i++) {
		struct incise_fx_input *in = &image->head.input[i];
		int64_t range = (int64_t)in->max - in->min;
		int shift = 0;

		while (shift < 30 && (range >> (shift + 1)) + 1 >= n)
			shift++;
		in->cell_shift = shift;
		in->cells = (uint32_t)((range >> shift) + 1);
	}
}

static struct cells cells_of(const struct image *image, int i)
{
	const struct incise_fx_input *in = &image->head.input[i];

	return (struct cells){
		.from = in->min / (double)INCISE_FIXED_ONE,
		.width = ldexp(1, (int)in->cell_shift - 16),
		.n = (int)in->cells,
	};
}

static long double knot(const struct cells *cells, int k)
{
	return cells->from + (long double)cells->width * k;
}

/* The two inputs' cells as the grid's a and b; a trivial input a has no cells. */
static void image_cells(const struct image *image, struct cells *a, struct cells *b)
{
	*a = image->grid->one ? (struct cells){0} : cells_of(image, 0);
	*b = cells_of(image, image->grid->one ? 0 : 1);
}

/* Put header and data together, and validate the result as one from a file. */
static struct incise_fixed *image_finish(struct image *image, struct incise_error *err)
{
	uint32_t front = incise_fx_header_size(image->head.version);
	size_t size = front + image->size;
	struct compiled *owned = malloc(sizeof(*owned) + size);
	struct incise_fx_header *head;
	int rc;

	if (!owned)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a compiled model");
	head = (struct incise_fx_header *)owned->blob;
	memcpy(owned->blob, &image->head, front);
	memcpy((uint8_t *)owned->blob + front, image->data, image->size);
	head->size = incise_fx_le32((uint32_t)size);
	head->version = incise_fx_le32(head->version);
	head->arithmetic = incise_fx_le32(head->arithmetic);
	head->n_inputs = incise_fx_le32(head->n_inputs);
	head->n_rules = incise_fx_le32(head->n_rules);
	head->shift_a = incise_fx_int32(head->shift_a);
	head->shift_b = incise_fx_int32(head->shift_b);
	head->bound = incise_fx_le64((uint64_t)ceil(ldexp(image->bound, 32)));
	head->data = incise_fx_le32(head->data);
	for (uint32_t i = 0; i < image->head.n_inputs; i++) {
		struct incise_fx_input *in = &head->input[i];

		in->min = incise_fx_int32(in->min);
		in->max = incise_fx_int32(in->max);
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
		return INCISE_ERROR_NULL(
			err, ERANGE,
			"fixed point: the model's numbers exceed all number formats; "
			"use double");
	}
	return &owned->fx;
}

/* --- table: the premises of the rules --- */

/* Weights at each knot of input a, rounded so that they add up to just 2^30. */
static int put_weights(struct image *image, const struct cells *cells)
{
	const struct incise_axis *a = &image->grid->a;
	int32_t *w = image_extend(image, (size_t)(cells->n + 1) * a->n * 4,
				  &image->head.input[0].offset);
	long double at[INCISE_FIXED_MFS_MAX];

	if (!w)
		return -ENOMEM;
	for (int k = 0; k <= cells->n; k++, w += a->n) {
		int64_t rest = 1 << 30;
		int largest = 0;

		incise_axis_at(a, knot(cells, k), at);
		for (int i = 0; i < a->n; i++) {
			w[i] = (int32_t)llrintl(at[i] * (1 << 30));
			rest -= w[i];
			largest = at[i] > at[largest] ? i : largest;
		}
		w[largest] += (int32_t)rest;
		for (int i = 0; i < a->n; i++)
			w[i] = incise_fx_int32(w[i]);
	}
	return 0;
}

/* Outputs and slopes of input a's functions at each knot of input b. */
static int put_fold(struct image *image, const struct cells *cells)
{
	const struct incise_grid *grid = image->grid;
	int stride = grid->one ? 1 : 2 * grid->a.n;
	int32_t *to = image_extend(image, (size_t)(cells->n + 1) * stride * 4,
				   &image->head.data);
	/* The middle as the evaluator counts it. */
	int64_t range = (int64_t)image->head.input[0].max - image->head.input[0].min;
	long double middle =
		(image->head.input[0].min + (range >> 1)) / (long double)INCISE_FIXED_ONE;
	long double at[INCISE_FIXED_MFS_MAX];

	if (!to)
		return -ENOMEM;
	for (int k = 0; k <= cells->n; k++) {
		long double x = knot(cells, k);

		incise_axis_at(&grid->b, x, at);
		for (int i = 0; i < grid->a.n; i++) {
			long double g = 0, h = 0;

			for (int j = 0; j < grid->b.n; j++) {
				const double *p = grid->p[i][j];

				g += at[j] * (p[0] + p[1] * middle + p[2] * x);
				h += at[j] * p[1];
			}
			*to++ = incise_fx_int32(
				(int32_t)llrintl(ldexpl(g, image->head.shift_a)));
			if (!grid->one)
				*to++ = incise_fx_int32(
					(int32_t)llrintl(ldexpl(h, image->head.shift_b)));
		}
	}
	return 0;
}

/* Roundings in the evaluator; see lib/fixed/eval.c. */
static double table_rounding(const struct image *image)
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
	return output + 4 * lsb_g + 2 * lsb_h * reach +
	       weights * image->source->size.rule;
}

static int build_table(struct image *image, int cells)
{
	const struct incise_grid *grid = image->grid;
	const struct incise_grid_size *size = &image->source->size;
	struct cells a, b;
	int rc = 0;

	set_cells(image, cells);
	/* g + x·h within 2^31 with one bit to spare: knots lie beyond the support, too. */
	image->head.shift_a = (int)fmin(28, 30 - bits_of(1.25 * size->rule));
	image->head.shift_b = (int)fmin(45, 30 - bits_of(size->slope));
	if (image->head.shift_a < 17 || 16 + image->head.shift_b < image->head.shift_a)
		return -ERANGE;
	/* Shifts by more than 62 are invalid; h needs no more digits than that. */
	if (16 + image->head.shift_b - image->head.shift_a > 62)
		image->head.shift_b = 46 + image->head.shift_a;
	image_cells(image, &a, &b);
	if (!grid->one)
		rc = put_weights(image, &a);
	if (!rc)
		rc = put_fold(image, &b);
	if (!rc)
		image->bound =
			incise_survey_table(image->source->survey, a.width, b.width) +
			table_rounding(image);
	return rc;
}

/* --- direct: the functions and consequents themselves --- */

/* Returns whether the width has a format. */
static bool compile_mf(const struct incise_axis *axis, int i, struct incise_fx_mf *fx)
{
	/* exp(-(x-c)²/(2s²)) = 2^-((x-c)·k)²; Q16 in, Q24 out. */
	double k = 1 / (axis->s[i] * sqrt(2 * M_LN2)), scaled = k * 256;
	int shift = 30 - bits_of(scaled);
	double slope = rint(ldexp(scaled, shift)), lost;

	if (shift < 0)
		return false;
	fx->centre = q16(axis->c[i]);
	/* So wide that it is flat: 2^-32 of a width is less than an LSB of the result. */
	fx->slope = shift > 62 ? 0 : (int32_t)fmin(slope, 1 << 30);
	fx->shift = shift > 62 ? 62 : shift;
	/* Rounding the centre would act like rounding the input: as much as 30 µN. */
	lost = axis->c[i] - fx->centre / (double)INCISE_FIXED_ONE;
	fx->offset = (int32_t)lrint(ldexp(fmax(-127, fmin(lost * k, 127)), 24));
	fx->centre = incise_fx_int32(fx->centre);
	fx->slope = incise_fx_int32(fx->slope);
	fx->shift = incise_fx_int32(fx->shift);
	fx->offset = incise_fx_int32(fx->offset);
	return true;
}

/*
 * Distances are held at 128 widths. Between two functions that are both further away the
 * nearer one would be unknown: the largest such distance is where neighbours cross, or
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

static int build_direct(struct image *image)
{
	const struct source *source = image->source;
	const struct incise_grid_size *size = &source->size;
	int n = (int)image->head.n_inputs, n_rules = (int)image->head.n_rules;
	double reach = 1, bound;
	int64_t *p;

	for (int i = 0; i < n; i++) {
		const struct incise_axis *axis = &source->axis[i];
		struct incise_fx_mf *mf = image_extend(image, axis->n * sizeof(*mf),
						       &image->head.input[i].offset);

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
	image->head.shift_a = (int)fmin(30, 61 - 16 - bits_of(size->parts + 1));
	image->head.shift_b =
		(int)fmin(26, 61 - 30 - bits_of(n_rules) - bits_of(size->rule + 1e-3));
	if (image->head.shift_b < 17 || image->head.shift_a < 1 ||
	    image->head.shift_a + 16 < image->head.shift_b)
		return -ERANGE;
	p = image_extend(image, (size_t)n_rules * (size_t)(n + 1) * 8, &image->head.data);
	if (!p)
		return -ENOMEM;
	for (int r = 0; r < n_rules; r++)
		for (int k = 0; k <= n; k++)
			*p++ = incise_fx_int64(
				llrint(ldexp(incise_model_rule(source->model, r)->p[k],
					     image->head.shift_a)));
	bound = source->survey ? incise_survey_direct(source->survey)
			       : incise_many_direct(source->model);
	/* A consequent's half LSB times the inputs; a rule's floor and the quotient's; half
	 * an LSB of the output. */
	image->bound = bound + ldexp(0.5 * reach, -image->head.shift_a) +
		       ldexp(2, -image->head.shift_b) + 0.5 / INCISE_FIXED_ONE;
	return 0;
}

/* --- force: a table of the output --- */

static int build_force(struct image *image, int cells)
{
	const struct incise_grid *grid = image->grid;
	long double at_a[INCISE_FIXED_MFS_MAX], at_b[INCISE_FIXED_MFS_MAX];
	struct cells a, b;
	int32_t *to;

	set_cells(image, cells);
	image->head.shift_a =
		(int)fmin(28, 30 - bits_of(1.25 * image->source->size.rule));
	if (image->head.shift_a < 17)
		return -ERANGE;
	image_cells(image, &a, &b);
	if ((size_t)(a.n + 1) * (b.n + 1) * 4 > FORCE_SIZE_MAX)
		return -E2BIG;
	to = image_extend(image, (size_t)(grid->one ? 1 : a.n + 1) * (b.n + 1) * 4,
			  &image->head.data);
	if (!to)
		return -ENOMEM;
	for (int k = 0; k <= a.n; k++) {
		long double xa = knot(&a, k);

		incise_axis_at(&grid->a, xa, at_a);
		for (int l = 0; l <= b.n; l++) {
			long double xb = knot(&b, l), y = 0;

			incise_axis_at(&grid->b, xb, at_b);
			for (int i = 0; i < grid->a.n; i++)
				for (int j = 0; j < grid->b.n; j++) {
					const double *p = grid->p[i][j];

					y += at_a[i] * at_b[j] *
					     (p[0] + p[1] * xa + p[2] * xb);
				}
			*to++ = incise_fx_int32(
				(int32_t)llrintl(ldexpl(y, image->head.shift_a)));
		}
	}
	/* Half an LSB in the table, two floored between knots, half one of the output. */
	image->bound = incise_survey_force(image->source->survey, a.width, b.width) +
		       ldexp(2.5, -image->head.shift_a) + 0.5 / INCISE_FIXED_ONE;
	return 0;
}

/* --- the choice of arithmetic and cells --- */

/* 0.1 mN: an order of magnitude below a 12-bit step of the force channel. */
#define DEFAULT_BUDGET 1e-4

/* Cells per input that are tried, from coarse to fine. */
static const int cell_counts[] = {
	INCISE_SURVEY_CELLS, 64, 128, 256, 512, 1024, 2048, 4096};
#define N_COUNTS ((int)(sizeof(cell_counts) / sizeof(*cell_counts)))

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

/*
 * Build one candidate, its bound included. 0; -ERANGE (no format holds it), -E2BIG (a force
 * table larger than FORCE_SIZE_MAX), -ENOMEM.
 */
static int build(struct image *image, const struct source *source, int arithmetic,
		 int cells)
{
	int rc;

	image_start(image, source, arithmetic);
	switch (arithmetic) {
	case INCISE_FIXED_FORCE:
		rc = build_force(image, cells);
		break;
	case INCISE_FIXED_TABLE:
		rc = build_table(image, cells);
		break;
	default:
		rc = build_direct(image);
	}
	if (!rc && !(ldexp(image->bound, 32) < 0x1p62))
		rc = -ERANGE;
	if (rc) {
		free(image->data);
		image->data = NULL;
	}
	return rc;
}

/* The cheapest candidate within the budget; else *best has the least bound. */
static int choose_compile(struct image *best, const struct incise_grid *grid,
			  const struct incise_fixed_options *o,
			  const struct incise_model *model)
{
	static const int order[] = {INCISE_FIXED_FORCE, INCISE_FIXED_TABLE,
				    INCISE_FIXED_DIRECT};
	struct source source = {.model = model, .grid = grid};
	struct incise_survey *survey = NULL;
	int rc = -ERANGE;

	for (int i = 0; i < incise_model_info(model)->n_inputs; i++)
		incise_axis_init(&source.axis[i], model, i);
	if (grid)
		incise_grid_size(grid, &source.size);
	else
		incise_many_size(model, &source.size);
	*best = (struct image){.bound = INFINITY};
	/* Nothing of that size has a format; the evaluators may count on finite numbers. */
	if (!(source.size.parts < INCISE_GRID_LARGEST))
		return rc;
	survey = grid ? incise_survey_new(grid) : NULL;
	if (grid && !survey)
		return -ENOMEM;
	source.survey = survey;
	for (int k = 0; k < 3; k++)
		for (int c = 0; c < N_COUNTS; c++) {
			struct image image;
			int built;

			if ((o->arithmetic >= 0 && order[k] != o->arithmetic) ||
			    (order[k] == INCISE_FIXED_DIRECT && c) ||
			    (order[k] != INCISE_FIXED_DIRECT &&
			     (!grid || cell_counts[c] < o->cells)))
				continue;
			built = build(&image, &source, order[k], cell_counts[c]);
			if (built == -ENOMEM) {
				rc = built;
				goto out;
			}
			/* The last error counts if all failed. */
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
	struct image best = {0};
	bool many;
	int rc;

	incise_fixed_options_init(&o);
	if (options)
		o = *options;
	if (!grid)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory to compile a model");
	if (o.arithmetic > INCISE_FIXED_FORCE || o.cells > cell_counts[N_COUNTS - 1]) {
		incise_error_set(err, EINVAL,
				 "fixed point: unknown arithmetic, or more than %d cells",
				 cell_counts[N_COUNTS - 1]);
		goto out;
	}
	many = incise_model_info(model)->n_inputs > INCISE_GRID_INPUTS_MAX;
	if (incise_many_check(model, err))
		goto out;
	if (many && o.arithmetic >= 0 && o.arithmetic != INCISE_FIXED_DIRECT) {
		incise_error_set(err, ENOTSUP,
				 "fixed point: a model of %d inputs has no tables; "
				 "give the arithmetic 'direct'",
				 incise_model_info(model)->n_inputs);
		goto out;
	}
	if (!many && incise_grid_init(grid, model, err))
		goto out;
	rc = choose_compile(&best, many ? NULL : grid, &o, model);
	if (rc == -ENOMEM)
		incise_error_set(err, ENOMEM, "no memory to compile a model");
	else if (rc == -E2BIG)
		incise_error_set(
			err, E2BIG,
			"fixed point: a force table with so many cells exceeds %d "
			"bytes; give fewer cells, or the arithmetic 'table'",
			FORCE_SIZE_MAX);
	else if (rc)
		incise_error_set(
			err, ERANGE,
			"fixed point: consequents or widths exceed all number formats; "
			"train with more ridge, or use double");
	else if (o.budget > 0 && best.bound > o.budget)
		incise_error_set(
			err, ERANGE,
			"fixed point: no arithmetic has an error of at most %.3g; the "
			"bound of the best, %s, is %.3g; allow more, or use double",
			o.budget, names[best.head.arithmetic], best.bound);
	else
		fx = image_finish(&best, err);
out:
	rc = errno;
	free(best.data);
	free(grid);
	errno = rc;
	return fx;
}

/* --- files --- */

struct incise_fixed *incise_fixed_load(const char *path, struct incise_error *err)
{
	static const struct incise_infile_kind kind = {
		.name = "a .fx file",
		.advice = "give a .fx file of incise compile",
		.size_max = INCISE_FIXED_SIZE_MAX,
	};
	struct compiled *owned;
	size_t size;
	char *bytes = incise_infile_read(path, &kind, &size, err);
	int rc = -ENOMEM;

	if (!bytes)
		return NULL;
	owned = malloc(sizeof(*owned) + size);
	if (owned) {
		memcpy(owned->blob, bytes, size);
		rc = incise_fixed_open(&owned->fx, owned->blob, (uint32_t)size);
	}
	free(bytes);
	if (!rc)
		return &owned->fx;
	free(owned);
	return INCISE_ERROR_NULL(
		err, -rc,
		rc == -EINVAL	 ? "%s: not a .fx file, or damaged; compile "
				   "the model again"
		: rc == -ENOTSUP ? "%s: a .fx file of another version; compile "
				   "the model again"
				 : "%s: no memory to read it",
		path);
}

int incise_fixed_save(const struct incise_fixed *fx, const char *path,
		      struct incise_error *err)
{
	struct incise_outfile *file = incise_outfile_open(path, err);

	if (!file)
		return -errno;
	fwrite(fx->blob, 1, fx->size, incise_outfile_stream(file));
	return incise_outfile_commit(file, err);
}

void incise_fixed_free(struct incise_fixed *fx)
{
	/* fx is the first member of struct compiled. */
	free(fx);
}

double incise_fixed_bound(const struct incise_fixed *fx)
{
	return ldexp((double)fx->bound, -32);
}

double incise_fixed_eval_double(const struct incise_fixed *fx, const double *x)
{
	int32_t in[INCISE_FIXED_INPUTS_MAX];

	for (int i = 0; i < fx->n_inputs; i++) {
		double min = fx->input[i].min, max = fx->input[i].max;

		if (isnan(x[i]))
			in[i] = (int32_t)(min + (max - min) / 2);
		else
			in[i] = (int32_t)lrint(
				fmax(min, fmin(max, x[i] * INCISE_FIXED_ONE)));
	}
	return incise_fixed_eval(fx, in) / (double)INCISE_FIXED_ONE;
}
