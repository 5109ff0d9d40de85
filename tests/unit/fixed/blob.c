// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Blobs from strangers: refused, or harmless. The sanitizers' run of this test sees any
 * read outside of the blob, which stands at the end of its memory, and any overflow.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/fixed/layout.h"
#include "compiled.h"

static const struct {
	int arithmetic, n_inputs;
} kinds[] = {{INCISE_FIXED_DIRECT, 2}, {INCISE_FIXED_TABLE, 2}, {INCISE_FIXED_FORCE, 2},
	     {INCISE_FIXED_DIRECT, 1}, {INCISE_FIXED_TABLE, 1}, {INCISE_FIXED_FORCE, 1},
	     {INCISE_FIXED_DIRECT, 3}, {INCISE_FIXED_DIRECT, 4}};
#define KINDS (sizeof(kinds) / sizeof(*kinds))

/* A blob of some kind in memory of just its size. */
static void *blob_of(int kind, uint32_t *size)
{
	struct incise_model *model = kinds[kind].n_inputs == 1 ? line_model(1)
				     : kinds[kind].n_inputs == 2
					     ? paper_model(INCISE_MF_GAUSS, 1, 2)
					     : many_model(kinds[kind].n_inputs, 1);
	struct incise_fixed *fx = compiled(model, kinds[kind].arithmetic, 8);
	void *blob;

	assert_non_null(fx);
	*size = fx->size;
	blob = malloc(fx->size);
	memcpy(blob, fx->blob, fx->size);
	incise_fixed_free(fx);
	incise_model_free(model);
	return blob;
}

static void seal(void *blob, uint32_t size)
{
	struct incise_fx_header *head = blob;

	head->crc = incise_fx_le32(incise_fx_crc((uint8_t *)blob + INCISE_FX_CRC_FROM,
						 size - INCISE_FX_CRC_FROM));
}

/* CRC-32C's check value, from its specification. */
TEST(test_crc)
{
	assert_int_equal(incise_fx_crc((const uint8_t *)"123456789", 9), 0xe3069283);
}

TEST(test_good_blobs_open)
{
	for (size_t k = 0; k < KINDS; k++) {
		struct incise_fixed fx;
		uint32_t size;
		void *blob = blob_of(k, &size);

		assert_int_equal(incise_fixed_open(&fx, blob, size), 0);
		assert_int_equal(fx.arithmetic, kinds[k].arithmetic);
		assert_int_equal(fx.n_inputs, kinds[k].n_inputs);
		assert_string_equal(fx.input[0].name, "depth_mm");
		assert_string_equal(fx.output, "force_N");
		free(blob);
	}
}

TEST(test_any_single_damage_is_seen)
{
	for (size_t k = 0; k < KINDS; k++) {
		struct incise_fixed fx;
		uint32_t size;
		uint8_t *blob = blob_of(k, &size);

		for (uint32_t at = 0; at < size; at += 1 + at / 64) {
			blob[at] ^= 1 << at % 8;
			assert_int_not_equal(incise_fixed_open(&fx, blob, size), 0);
			blob[at] ^= 1 << at % 8;
		}
		for (uint32_t n = 0; n < size; n += 1 + n / 16)
			assert_int_not_equal(incise_fixed_open(&fx, blob, n), 0);
		assert_int_equal(incise_fixed_open(&fx, blob, size), 0);
		free(blob);
	}
}

TEST(test_versions)
{
	struct incise_fixed fx;
	uint32_t size;
	struct incise_fx_header *head = blob_of(0, &size);

	head->version = incise_fx_le32(3);
	seal(head, size);
	assert_int_equal(incise_fixed_open(&fx, head, size), -ENOTSUP);
	/* The second one is of three inputs and more, and the first one of fewer. */
	head->version = incise_fx_le32(2);
	seal(head, size);
	assert_int_equal(incise_fixed_open(&fx, head, size), -EINVAL);
	head->version = incise_fx_le32(1);
	head->arithmetic = incise_fx_le32(7);
	seal(head, size);
	assert_int_equal(incise_fixed_open(&fx, head, size), -ENOTSUP);
	free(head);
	head = blob_of(6, &size);
	head->version = incise_fx_le32(1);
	seal(head, size);
	assert_int_equal(incise_fixed_open(&fx, head, size), -EINVAL);
	free(head);
}

/* The batch evaluator trusts the same validation, in 32-bit lanes. */
static void same_in_batches(const struct incise_fixed *fx, uint64_t *seed)
{
	int32_t x[64 * INCISE_FIXED_INPUTS_MAX], y[64];

	for (int i = 0; i < 64 * fx->n_inputs; i++) {
		const struct incise_fixed_input *in = &fx->input[i % fx->n_inputs];

		incise_random_step(seed);
		x[i] = i / 2 % 3 == 0	? in->min
		       : i / 2 % 3 == 1 ? in->max
					: (int32_t)(*seed >> 32);
	}
	incise_fixed_eval_batch(fx, x, y, 64);
	for (int n = 0; n < 64; n++)
		assert_int_equal(y[n], incise_fixed_eval(fx, x + n * fx->n_inputs));
}

/* Unused fields that must be zero, a bound that every input has, and names that must be valid. */
TEST(test_unused_fields)
{
	static const struct {
		int kind;
		size_t at;
		uint8_t value;
	} cases[] = {
		{0, offsetof(struct incise_fx_header, reserved), 1},
		{0, offsetof(struct incise_fx_header, input[0].reserved[1]), 1},
		{3, offsetof(struct incise_fx_header, input[1].min), 1},
		{0, offsetof(struct incise_fx_header, name[0]), '\n'},
		{0, offsetof(struct incise_fx_header, name[63]), 'x'},
		{0, offsetof(struct incise_fx_header, input[0].name[1]), '\033'},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_fixed fx;
		uint32_t size;
		uint8_t *blob = blob_of(cases[i].kind, &size);

		blob[cases[i].at] = cases[i].value;
		seal(blob, size);
		assert_int_equal(incise_fixed_open(&fx, blob, size), -EINVAL);
		free(blob);
	}
}

/* A sum of weights just over 1 is floored away from 0: found by a reviewer. */
TEST(test_weights_over_one)
{
	struct incise_fixed fx;
	uint32_t size;
	struct incise_fx_header *head = blob_of(1, &size);
	int32_t *w = (int32_t *)((uint8_t *)head + incise_fx_le32(head->input[0].offset));
	uint64_t seed = 1;

	assert_int_equal(incise_fixed_open(&fx, head, size), 0);
	for (int row = 0; row <= fx.input[0].cells; row++)
		w[row * fx.input[0].n_mfs] += 64;
	seal(head, size);
	if (!incise_fixed_open(&fx, head, size))
		same_in_batches(&fx, &seed);
	free(head);
}

/* Sizes that wrap when multiplied must not pass for small ones. */
TEST(test_huge_counts)
{
	struct incise_fixed fx;
	uint32_t size;
	struct incise_fx_header *head = blob_of(2, &size);

	for (int i = 0; i < 2; i++) {
		head->input[i].min = (int32_t)incise_fx_le32(0);
		head->input[i].max = (int32_t)incise_fx_le32(0x7fffffff);
		head->input[i].cell_shift = incise_fx_le32(0);
		head->input[i].cells = incise_fx_le32(0x80000000);
	}
	seal(head, size);
	assert_int_equal(incise_fixed_open(&fx, head, size), -EINVAL);
	free(head);
}
