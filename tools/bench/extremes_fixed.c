// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Compiled models: each arithmetic, any inputs, models at the end of what formats hold, and
 * blobs with broken bytes under a right checksum.
 */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include "any_pose.h"
#include "../cli/cli.h"
#include "extremes.h"

#define MODELS 120 /* compiling takes some 7 ms */
#define POINTS 120000
#define BATCHES 300
#define BATCH_MAX 67
#define BLOBS 100000
#define CRC_AT 16
#define CRC_FROM 20

static const struct {
	const char *name, *what;
	enum incise_fixed_arithmetic arithmetic;
} arithmetics[] = {
	{"fixed_direct",
	 "models at the end of what the formats hold, any inputs, in 64-bit integers by "
	 "polynomial: within the certified bound of the model in double",
	 INCISE_FIXED_DIRECT},
	{"fixed_table", "the same by tables of weights", INCISE_FIXED_TABLE},
	{"force_table", "the same by a table of the output", INCISE_FIXED_FORCE},
};

/* From tame to what no format holds. */
static struct incise_model *any_model(void)
{
	double wild = below(2) ? 1 : exp(between(0, 9)), width = exp(between(-5, 5));
	struct incise_variable in[2] = {{"depth_mm", 0, 20}, {"velocity_mm_s", 0, 50}};
	struct incise_variable out = {"force_N", 0, 3};
	int n = 1 + (int)below(2), mfs[2];
	struct incise_error err = {0};
	struct incise_model *model;

	for (int i = 0; i < n; i++) {
		mfs[i] = 1 + (int)below(5);
		if (below(2)) {
			in[i].min = between(-32768, 32767) / (below(2) ? 1 : 1000);
			in[i].max = in[i].min + exp(between(-9, 10));
		}
	}
	model = incise_model_new_grid(n, in, mfs, INCISE_MF_GAUSS, &out, &err);
	if (!model)
		cli_fail_with(&err);
	for (int i = 0; i < n; i++)
		for (int k = 0; k < mfs[i]; k++) {
			double p[4];

			memcpy(p, incise_model_mf(model, i, k)->p, sizeof(p));
			p[0] *= below(2) ? 1 : width;
			incise_model_set_mf(model, i, k, p);
		}
	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		double p[3] = {wild * between(-2, 2), wild * between(-0.1, 0.1),
			       wild * between(-0.1, 0.1)};

		incise_model_set_consequent(model, r, p);
	}
	return model;
}

static int32_t any_input(const struct incise_fixed_input *in)
{
	static const int32_t ends[] = {INT32_MIN, INT32_MAX, INT32_MIN + 1, 0, -1, 1};

	switch (below(5)) {
	case 0:
		return ends[below(6)];
	case 1:
		return (int32_t)any();
	case 2:
		return below(2) ? in->min : in->max;
	default:
		return (int32_t)between(in->min, in->max);
	}
}

static void evaluate(struct extremes_row *row, const struct incise_model *model,
		     const struct incise_fixed *fx)
{
	double bound = incise_fixed_bound(fx);

	for (int k = 0; k < POINTS / MODELS; k++) {
		int32_t x[2] = {0}, y;
		double at[2], exact;

		for (int i = 0; i < fx->n_inputs; i++) {
			x[i] = any_input(&fx->input[i]);
			at[i] = x[i] * 0x1p-16;
		}
		y = incise_fixed_eval(fx, x);
		exact = incise_model_eval(model, at, NULL);
		/* The double has roundings of its own. */
		if (extremes_first_wrong(row, fabs(y * 0x1p-16 - exact) <=
						      bound + 1e-12 * (1 + fabs(exact))))
			extremes_tell(row,
				      "%d at (%d, %d), %a in double, bound %a, case %ld",
				      y, x[0], x[1], exact, bound, row->tried);
	}
}

static void try_arithmetic(struct extremes *all, int a)
{
	struct extremes_row *row =
		extremes_begin(all, arithmetics[a].name, arithmetics[a].what);

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, MODELS); k; k--) {
		struct incise_fixed_options options = {.arithmetic =
							       arithmetics[a].arithmetic,
						       .cells = (int)below(3) * 16};
		struct incise_model *model = any_model();
		struct incise_error err = {0};
		struct incise_fixed *fx = incise_fixed_compile(model, &options, &err);

		if (fx)
			evaluate(row, model, fx);
		else
			extremes_refused(row, &err);
		incise_fixed_free(fx);
		incise_model_free(model);
	}
}

static struct incise_fixed *compile(int a)
{
	struct incise_fixed_options options = {.arithmetic = arithmetics[a].arithmetic};
	struct incise_fixed *fx;

	do {
		struct incise_model *model = any_model();

		fx = incise_fixed_compile(model, &options, NULL);
		incise_model_free(model);
	} while (!fx);
	return fx;
}

static void try_batch(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "fixed_batch",
		"up to 66 evaluations at once, any inputs: as one after the other, to the bit");

	rng = extremes_seed(all, row);
	for (int a = 0; a < 3; a++) {
		struct incise_fixed *fx = compile(a);

		for (long k = extremes_cases(all, BATCHES * 10); k; k--) {
			int32_t x[2 * BATCH_MAX], y[BATCH_MAX];
			size_t n = below(BATCH_MAX), bad;

			for (size_t i = 0; i < n * (size_t)fx->n_inputs; i++)
				x[i] = any_input(&fx->input[i % (size_t)fx->n_inputs]);
			incise_fixed_eval_batch(fx, x, y, n);
			for (bad = 0; bad < n; bad++)
				if (y[bad] !=
				    incise_fixed_eval(fx, x + bad * (size_t)fx->n_inputs))
					break;
			if (extremes_first_wrong(row, bad == n))
				extremes_tell(
					row, "%s: %d of %zu evaluations at %d, case %ld",
					incise_fixed_arithmetic_name(fx->arithmetic),
					(int)bad, n, x[bad * (size_t)fx->n_inputs],
					row->tried);
		}
		incise_fixed_free(fx);
	}
}

/* CRC-32C, bit by bit: incise-fx(5). */
static uint32_t crc(const uint8_t *data, size_t n)
{
	uint32_t crc = UINT32_MAX;

	while (n--) {
		crc ^= *data++;
		for (int i = 0; i < 8; i++)
			crc = crc >> 1 ^ (crc & 1 ? 0x82f63b78 : 0);
	}
	return ~crc;
}

/* A 32-bit field of the header or of the data behind it becomes another. */
static void damage(uint8_t *blob, uint32_t size)
{
	for (uint32_t n = 1 + below(3); n; n--) {
		uint32_t field = below(2) ? below(288 / 4) : below(size / 4), value;

		switch (below(3)) {
		case 0:
			value = (uint32_t)any();
			break;
		case 1:
			value = below(2) ? INT32_MAX : (uint32_t)INT32_MIN;
			break;
		default:
			memcpy(&value, blob + 4 * field, 4);
			value ^= UINT32_C(1) << below(32);
		}
		memcpy(blob + 4 * field, &value, 4);
	}
}

static void open_blob(struct extremes_row *row, const uint8_t *blob, uint32_t size)
{
	struct incise_fixed fx;
	int rc = incise_fixed_open(&fx, blob, size);

	if (rc == -EINVAL || rc == -ENOTSUP) {
		row->tried++;
		row->refused++;
		return;
	}
	/* What evaluates does so whatever the inputs are; its numbers are what was signed. */
	for (int k = 0; k < 4 && !rc; k++) {
		int32_t x[2] = {any_input(&fx.input[0]), any_input(&fx.input[1])}, y;

		incise_fixed_eval_batch(&fx, x, &y, 1);
		if (y != incise_fixed_eval(&fx, x))
			rc = -1;
	}
	if (extremes_first_wrong(row, !rc))
		extremes_tell(row, "open or evaluation: %d, case %ld", rc, row->tried);
}

static void try_blobs(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "fixed_blob",
		"compiled models with broken bytes, most of them under a right checksum: "
		"refused, or evaluated within their memory");

	rng = extremes_seed(all, row);
	for (int a = 0; a < 3; a++) {
		struct incise_fixed *fx = compile(a);
		uint8_t *copy = aligned_alloc(8, (fx->size + 7) / 8 * 8);

		if (!copy)
			cli_fail("no memory");
		for (long k = extremes_cases(all, BLOBS / 3 * 2000 / (2000 + fx->size));
		     k; k--) {
			memcpy(copy, fx->blob, fx->size);
			damage(copy, fx->size);
			if (below(8)) {
				uint32_t sum = crc(copy + CRC_FROM, fx->size - CRC_FROM);

				memcpy(copy + CRC_AT, &sum, 4);
			}
			open_blob(row, copy,
				  below(50) ? fx->size : below(fx->size / 8) * 8);
		}
		free(copy);
		incise_fixed_free(fx);
	}
}

void extremes_fixed(struct extremes *all)
{
	for (int a = 0; a < 3; a++)
		try_arithmetic(all, a);
	try_batch(all);
	try_blobs(all);
}
