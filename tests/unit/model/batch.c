// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The batch evaluator: what the scalar one says, to the bit, whatever the model, the
 * arithmetic, the inputs, their number and where they lie in memory.
 */
#include "../unit.h"
#include <limits.h>
#include "../../../lib/base/random.h"
#include "../../../lib/fixed/layout.h"
#include "paper_model.h"
#include "../cases.h"

#define N 100000
#define UNTOUCHED 0x5a5a5a5a

/* A model of any shape with consequents by seed, compiled. */
static struct incise_fixed *compiled(int n_inputs, int n_a, int n_b, int arithmetic,
				     int cells, uint64_t seed)
{
	const struct incise_variable in[] = {{"depth_mm", -3, 20},
					     {"velocity_mm_s", 0, 50}};
	const struct incise_variable out = {"force_N", 0, 4};
	const int mfs[] = {n_a, n_b};
	struct incise_fixed_options options = {.arithmetic = arithmetic, .cells = cells};
	struct incise_model *model =
		incise_model_new_grid(n_inputs, in, mfs, INCISE_MF_GAUSS, &out, NULL);
	struct incise_fixed *fx;

	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		double p[] = {5 * paper_random(&seed), paper_random(&seed),
			      paper_random(&seed)};

		incise_model_set_consequent(model, r, p);
	}
	fx = incise_fixed_compile(model, &options, NULL);
	assert_non_null(fx);
	incise_model_free(model);
	return fx;
}

static uint32_t random_bits(uint64_t *seed)
{
	incise_random_step(seed);
	return *seed >> 32;
}

/* Within the support, just around its ends, anywhere, or an extreme. */
static int32_t random_input(const struct incise_fixed_input *in, uint64_t *seed)
{
	static const int32_t extremes[] = {INT32_MIN, INT32_MIN + 1, -1, 0, 1, INT32_MAX};
	uint32_t bits = random_bits(seed), range = (uint32_t)in->max - (uint32_t)in->min;

	switch (random_bits(seed) >> 28) {
	case 0:
		return (int32_t)bits;
	case 1:
		return extremes[bits % 6];
	case 2:
		return in->min + (int32_t)(bits % 5) - 2;
	case 3:
		return in->max + (int32_t)(bits % 5) - 2;
	default:
		return in->min + (int32_t)(bits % (range + 1));
	}
}

static void fill(const struct incise_fixed *fx, int32_t *x, size_t n, uint64_t seed)
{
	for (size_t k = 0; k < n; k++)
		for (int i = 0; i < fx->n_inputs; i++)
			*x++ = random_input(&fx->input[i], &seed);
}

static void check(const struct incise_fixed *fx, size_t n, uint64_t seed)
{
	int32_t *x = calloc(n, fx->n_inputs * sizeof(*x));
	int32_t *y = malloc((n + 1) * sizeof(*y));

	fill(fx, x, n, seed);
	y[n] = UNTOUCHED;
	incise_fixed_eval_batch(fx, x, y, n);
	for (size_t k = 0; k < n; k++)
		assert_int_equal(y[k], incise_fixed_eval(fx, x + k * fx->n_inputs));
	assert_int_equal(y[n], UNTOUCHED);
	free(x);
	free(y);
}

/* Counts of functions with every rest of a division by four; 32 is the most. */
TEST(test_shapes)
{
	static const struct {
		int n_inputs, n_a, n_b, arithmetic, cells;
	} cases[] = {
		{2, 5, 4, INCISE_FIXED_TABLE, 0},     {2, 5, 4, INCISE_FIXED_TABLE, 1024},
		{2, 1, 1, INCISE_FIXED_TABLE, 0},     {2, 2, 5, INCISE_FIXED_TABLE, 0},
		{2, 3, 3, INCISE_FIXED_TABLE, 64},    {2, 4, 4, INCISE_FIXED_TABLE, 0},
		{2, 6, 2, INCISE_FIXED_TABLE, 0},     {2, 7, 1, INCISE_FIXED_TABLE, 0},
		{2, 8, 3, INCISE_FIXED_TABLE, 4096},  {2, 9, 2, INCISE_FIXED_TABLE, 0},
		{2, 32, 1, INCISE_FIXED_TABLE, 0},    {1, 5, 0, INCISE_FIXED_TABLE, 0},
		{1, 32, 0, INCISE_FIXED_TABLE, 4096}, {2, 5, 4, INCISE_FIXED_FORCE, 0},
		{2, 5, 4, INCISE_FIXED_FORCE, 128},   {1, 5, 0, INCISE_FIXED_FORCE, 0},
		{2, 5, 4, INCISE_FIXED_DIRECT, 0},    {1, 5, 0, INCISE_FIXED_DIRECT, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases);
	     i += cases_are_all() ? 1 : 4) {
		struct incise_fixed *fx =
			compiled(cases[i].n_inputs, cases[i].n_a, cases[i].n_b,
				 cases[i].arithmetic, cases[i].cells, i);

		check(fx, (size_t)cases_of(N, 5000), i);
		incise_fixed_free(fx);
	}
}

/* Consequents from tiny to the largest that compile: every number format. */
TEST(test_formats)
{
	int compiled_models = 0;

	for (int arithmetic = INCISE_FIXED_TABLE; arithmetic <= INCISE_FIXED_FORCE;
	     arithmetic++)
		for (int e = -40; e < 20; e += cases_are_all() ? 4 : 19) {
			struct incise_fixed_options options = {.arithmetic = arithmetic};
			double size = e < 0 ? 1.0 / (1ll << -e) : 1ll << e;
			struct incise_model *model =
				paper_model(INCISE_MF_GAUSS, 7 + e + 40, size);
			struct incise_fixed *fx =
				incise_fixed_compile(model, &options, NULL);

			if (fx) {
				compiled_models++;
				check(fx, 5000, e + 40);
			}
			incise_fixed_free(fx);
			incise_model_free(model);
		}
	/* Up to 2^12 N there is a format. */
	assert_true(compiled_models >= 2 * (cases_are_all() ? 12 : 3));
}

/* Fill a section of the blob with values of any size up to limit, often just that. */
static void put_extremes(void *values, size_t n, int64_t limit, uint64_t *seed)
{
	uint32_t *to = values;

	for (size_t k = 0; k < n; k++) {
		uint32_t kind = random_bits(seed);
		int64_t v = kind & 1 ? limit : random_bits(seed) % (limit + 1);

		to[k] = incise_fx_le32((uint32_t)(kind & 2 ? -v : v));
	}
}

/* Blobs that no compiler made, whose numbers are as large as validation lets through. */
static void check_extreme(const struct incise_fixed *fx, int32_t shift_a, int32_t shift_b,
			  uint64_t seed)
{
	struct incise_fixed extreme;
	struct incise_fx_header *head = malloc(fx->size);
	uint8_t *bytes = (uint8_t *)head;
	uint32_t data;
	/* Half of what g + x·h may add up to, each. */
	int64_t limit = fx->arithmetic == INCISE_FIXED_TABLE && fx->n_inputs == 2
				? 1 << 30
				: INT32_MAX;

	memcpy(head, fx->blob, fx->size);
	head->shift_a = (int32_t)incise_fx_le32((uint32_t)shift_a);
	head->shift_b = (int32_t)incise_fx_le32((uint32_t)shift_b);
	data = incise_fx_le32(head->data);
	put_extremes(bytes + data, (fx->size - data) / 4, limit - (1 << 14), &seed);
	head->crc = incise_fx_le32(
		incise_fx_crc(bytes + INCISE_FX_CRC_FROM, fx->size - INCISE_FX_CRC_FROM));
	assert_int_equal(incise_fixed_open(&extreme, head, fx->size), 0);
	check(&extreme, (size_t)cases_of(20000, 2000), seed);
	free(head);
}

TEST(test_extreme_blobs)
{
	struct incise_fixed *line = compiled(1, 5, 4, INCISE_FIXED_TABLE, 8, 1),
			    *line_force = compiled(1, 5, 4, INCISE_FIXED_FORCE, 8, 1),
			    *grid = compiled(2, 5, 4, INCISE_FIXED_TABLE, 8, 1),
			    *grid_force = compiled(2, 5, 4, INCISE_FIXED_FORCE, 8, 1);

	for (int shift_a = 17; shift_a <= 30; shift_a++) {
		check_extreme(line, shift_a, 0, shift_a);
		check_extreme(line_force, shift_a, 0, shift_a);
		check_extreme(grid_force, shift_a, 0, shift_a);
		/* x·h, with |x| < 2^20, shifted by 20 to 62 bits: as large as g, or nothing. */
		for (int to_g = 20; to_g <= 62; to_g += 7)
			check_extreme(grid, shift_a, to_g - 16 + shift_a, to_g);
	}
	incise_fixed_free(line);
	incise_fixed_free(line_force);
	incise_fixed_free(grid);
	incise_fixed_free(grid_force);
}

/* Arrays that begin at any word: 13 results, and nothing beside them. */
static void check_shifted(const struct incise_fixed *fx, int shift_x, int shift_y)
{
	int32_t x[8 + 2 * 13], y[8 + 13 + 8];
	const int32_t *in = x + shift_x;

	fill(fx, x + shift_x, 13, shift_x);
	memset(y, 0x5a, sizeof(y));
	incise_fixed_eval_batch(fx, in, y + shift_y, 13);
	for (int k = 0; k < 8 + 13 + 8; k++)
		if (k < shift_y || k >= shift_y + 13)
			assert_int_equal(y[k], UNTOUCHED);
	for (int k = 0; k < 13; k++)
		assert_int_equal(y[shift_y + k],
				 incise_fixed_eval(fx, in + k * fx->n_inputs));
}

/* Ends of a run that are no multiple of the vector, none at all, and no alignment. */
TEST(test_lengths_and_alignment)
{
	for (int arithmetic = 0; arithmetic < 3; arithmetic++)
		for (int n_inputs = 1; n_inputs <= 2; n_inputs++) {
			struct incise_fixed *fx =
				compiled(n_inputs, 5, 4, arithmetic, 0, 3);

			for (size_t n = 0; n < 16; n++)
				check(fx, n, n);
			for (int shift = 0; shift < 64; shift++)
				check_shifted(fx, shift / 8, shift % 8);
			incise_fixed_eval_batch(fx, NULL, NULL, 0);
			incise_fixed_free(fx);
		}
}
