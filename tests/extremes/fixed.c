// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Compiled models: each arithmetic, any inputs, models at the end of what formats hold, and
 * blobs with broken bytes under a right checksum.
 */
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include "../../lib/fixed/layout.h"
#include "../../tools/cli/cli.h"
#include "extremes.h"
#include "numbers.h"

#define MODELS 120  /* compiling takes some 7 ms */
#define POINTS 1000 /* of each */
#define BATCH_MAX 67
#define BLOBS 100000
#define ARITHMETICS 3

static const int32_t ends[] = {INT32_MIN, INT32_MAX, INT32_MIN + 1, 0, -1, 1};
#define ENDS 6

/* A model from tame to what no format holds. */
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
	switch (below(5)) {
	case 0:
		return ends[below(ENDS)];
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

	for (int k = 0; k < POINTS; k++) {
		int32_t x[2] = {0}, y;
		double at[2], exact;

		for (int i = 0; i < fx->n_inputs; i++) {
			x[i] = any_input(&fx->input[i]);
			at[i] = x[i] * 0x1p-16;
		}
		y = incise_fixed_eval(fx, x);
		exact = incise_model_eval(model, at, NULL);
		/* The double has roundings of its own. */
		extremes_check(row,
			       fabs(y * 0x1p-16 - exact) <=
				       bound + 1e-12 * (1 + fabs(exact)),
			       "%d at (%d, %d), %a in double, bound %a", y, x[0], x[1],
			       exact, bound);
	}
}

static void try_arithmetic(struct extremes_row *row, const struct property *property)
{
	struct incise_fixed_options options = {
		.arithmetic = (enum incise_fixed_arithmetic)property->kind,
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

static struct incise_fixed *any_compiled(int arithmetic)
{
	struct incise_fixed_options options = {
		.arithmetic = (enum incise_fixed_arithmetic)arithmetic};
	struct incise_fixed *fx;

	do {
		struct incise_model *model = any_model();

		fx = incise_fixed_compile(model, &options, NULL);
		incise_model_free(model);
	} while (!fx);
	return fx;
}

static void compare_batch(struct extremes_row *row, const struct incise_fixed *fx)
{
	int32_t x[2 * BATCH_MAX], y[BATCH_MAX];
	size_t n = below(BATCH_MAX), inputs = (size_t)fx->n_inputs, same = 0;

	for (size_t i = 0; i < n * inputs; i++)
		x[i] = any_input(&fx->input[i % inputs]);
	incise_fixed_eval_batch(fx, x, y, n);
	while (same < n && y[same] == incise_fixed_eval(fx, x + same * inputs))
		same++;
	extremes_check(row, same == n, "%s: only %zu of %zu evaluations are the same",
		       incise_fixed_arithmetic_name(fx->arithmetic), same, n);
}

static void try_batches(struct extremes_row *row, const struct property *property)
{
	for (int a = 0; a < ARITHMETICS; a++) {
		struct incise_fixed *fx = any_compiled(a);

		for (long k = extremes_cases(row, property->cases); k; k--)
			compare_batch(row, fx);
		incise_fixed_free(fx);
	}
}

/* Values that are likely to hurt: ends of types, sizes, zero, one off. */
static uint32_t nasty(void)
{
	static const uint32_t values[] = {0,	      1,	  2,	      16,
					  17,	      31,	  32,	      63,
					  64,	      255,	  0x7fff,     0xffff,
					  0x10000,    1u << 22,	  1u << 30,   0x3fffffff,
					  0x7fffffff, 0x80000000, 0x80000001, 0xffffffff};

	return below(3) ? values[below(20)] : (uint32_t)any();
}

/* Change 32-bit fields of the header or of the data behind it. */
static void damage(uint8_t *blob, uint32_t size, bool nastily)
{
	for (uint32_t n = 1 + below(3); n; n--) {
		uint32_t field = below(2) ? below(288 / 4) : below(size / 4), value;

		switch (nastily ? 3 : below(3)) {
		case 0:
			value = (uint32_t)any();
			break;
		case 1:
			value = below(2) ? INT32_MAX : (uint32_t)INT32_MIN;
			break;
		case 2:
			memcpy(&value, blob + 4 * field, 4);
			value ^= UINT32_C(1) << below(32);
			break;
		default:
			value = nasty();
		}
		memcpy(blob + 4 * field, &value, 4);
	}
}

/* A damaged blob with a right checksum: the checks behind it must refuse it. */
static void sign(uint8_t *blob, uint32_t size)
{
	uint32_t sum = incise_fx_le32(
		incise_fx_crc(blob + INCISE_FX_CRC_FROM, size - INCISE_FX_CRC_FROM));

	memcpy(blob + offsetof(struct incise_fx_header, crc), &sum, sizeof(sum));
}

/* Evaluate at all ends and at some other inputs: no access beyond the blob, no overflow. */
static bool evaluates(const struct incise_fixed *fx)
{
	int32_t x[2 * (ENDS * ENDS + 4)], y[ENDS * ENDS + 4];
	int n = 0, inputs = fx->n_inputs;

	for (; n < ENDS * ENDS; n++) {
		x[n * inputs + inputs - 1] = ends[n / ENDS];
		x[n * inputs] = ends[n % ENDS];
	}
	for (; n < ENDS * ENDS + 4; n++) {
		int32_t any[2] = {any_input(&fx->input[0]), any_input(&fx->input[1])};

		memcpy(x + n * inputs, any, (size_t)inputs * sizeof(*x));
	}
	incise_fixed_eval_batch(fx, x, y, (size_t)n);
	while (n && y[n - 1] == incise_fixed_eval(fx, x + (n - 1) * inputs))
		n--;
	return !n;
}

static void open_blob(struct extremes_row *row, const uint8_t *blob, uint32_t size)
{
	struct incise_fixed fx;
	int rc = incise_fixed_open(&fx, blob, size);

	if (rc == -EINVAL || rc == -ENOTSUP)
		extremes_refused_plainly(row);
	else
		extremes_check(row, !rc && evaluates(&fx), "open or evaluation: %d", rc);
}

static void try_blobs(struct extremes_row *row, const struct property *property)
{
	for (int a = 0; a < ARITHMETICS; a++) {
		struct incise_fixed *fx = any_compiled(a);
		uint8_t *copy = aligned_alloc(8, (fx->size + 7) / 8 * 8);
		long n = property->cases / 3 * 2000 / (2000 + fx->size);

		if (!copy)
			cli_fail("no memory");
		for (long k = extremes_cases(row, n); k; k--) {
			memcpy(copy, fx->blob, fx->size);
			damage(copy, fx->size, property->kind);
			if (below(8))
				sign(copy, fx->size);
			open_blob(row, copy,
				  below(50) ? fx->size : below(fx->size / 8) * 8);
		}
		free(copy);
		incise_fixed_free(fx);
	}
}

const struct property fixed_properties[] = {
	{"fixed_direct",
	 "models at the end of what the formats hold, any inputs, in 64-bit integers by "
	 "polynomial: within the certified bound of the model in double",
	 MODELS, .each = try_arithmetic, .kind = INCISE_FIXED_DIRECT},
	{"fixed_table", "the same by tables of weights", MODELS, .each = try_arithmetic,
	 .kind = INCISE_FIXED_TABLE},
	{"force_table", "the same by a table of the output", MODELS,
	 .each = try_arithmetic, .kind = INCISE_FIXED_FORCE},
	{"fixed_batch",
	 "up to 66 evaluations at once, any inputs: as one after the other, to the bit",
	 3000, .all = try_batches},
	{"fixed_blob",
	 "compiled models with broken bytes, most of them under a right checksum: "
	 "refused, or evaluated within their memory",
	 BLOBS, .all = try_blobs},
	{"fixed_blob_nasty", "the same with numbers that are likely to hurt", BLOBS,
	 .all = try_blobs, .kind = true, .for_tests_only = true},
	{0},
};
