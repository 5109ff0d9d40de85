// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Validates a blob in full: after this no input can make an evaluator read outside of
 * it, shift by a wrong amount or overflow. Blobs come from files and go to kernels.
 */
#include "integers.h"
#include "layout.h"

/* Without errno.h, which a kernel does not have in this form. */
#define BAD (-EINVAL)
#define UNSUPPORTED (-EOPNOTSUPP)

#ifdef __KERNEL__
#include <linux/crc32c.h>

uint32_t incise_fx_crc(const uint8_t *bytes, uint32_t n)
{
	return ~crc32c(~0u, bytes, n);
}
#else
uint32_t incise_fx_crc(const uint8_t *bytes, uint32_t n)
{
	uint32_t crc = ~0u;

	for (uint32_t i = 0; i < n; i++) {
		crc ^= bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = (crc >> 1) ^ (crc & 1 ? 0x82f63b78u : 0);
	}
	return ~crc;
}
#endif

static uint64_t magnitude(int64_t v)
{
	return v < 0 ? -(uint64_t)v : (uint64_t)v;
}

/* True where n bytes at offset lie within the blob, behind the shortest header, aligned. */
static int check_within_blob(uint64_t offset, uint64_t n, uint32_t size, uint32_t align)
{
	return offset >= incise_fx_header_size(INCISE_FX_VERSION) &&
	       offset % align == 0 && offset <= size && n <= size - offset;
}

/* Supports, counts, and for tables that the cells reach over the whole support. */
static int check_inputs(const struct incise_fixed *fx)
{
	int32_t n_rules = 1;

	for (int i = 0; i < fx->n_inputs; i++) {
		const struct incise_fixed_input *in = &fx->input[i];
		int64_t range = (int64_t)in->max - in->min;

		/* The distance from min must fit in 31 bits. */
		if (range < 1 || range > INT32_MAX)
			return BAD;
		if (in->n_mfs < 1 || in->n_mfs > INCISE_FIXED_MFS_MAX)
			return BAD;
		n_rules *= in->n_mfs;
		if (fx->arithmetic == INCISE_FIXED_DIRECT) {
			if (in->cell_shift || in->cells)
				return BAD;
			continue;
		}
		/* Few enough cells that products of sizes cannot wrap. */
		if (in->cell_shift < 0 || in->cell_shift > 30 ||
		    in->cells != (range >> in->cell_shift) + 1 ||
		    in->cells > INCISE_FIXED_SIZE_MAX)
			return BAD;
	}
	return fx->n_rules == n_rules && n_rules <= INCISE_FIXED_RULES_MAX ? 0 : BAD;
}

static int check_mfs(const struct incise_fixed *fx, int i, uint32_t offset)
{
	const struct incise_fixed_input *in = &fx->input[i];
	const struct incise_fx_mf *mf = (const struct incise_fx_mf *)in->values;

	if (!check_within_blob(offset, (uint64_t)in->n_mfs * sizeof(*mf), fx->size, 4))
		return BAD;
	for (int k = 0; k < in->n_mfs; k++) {
		int32_t slope = incise_fx_int32(mf[k].slope);
		int32_t shift = incise_fx_int32(mf[k].shift);

		/* (x - centre)·slope: 32 + 30 bits. */
		if (slope < 0 || slope > 1 << 30 || shift < 0 || shift > 62)
			return BAD;
	}
	return 0;
}

/* No consequent may overflow the direct arithmetic's sums anywhere in the support. */
static int check_direct(const struct incise_fixed *fx)
{
	const int64_t *p = fx->data;
	int n = fx->n_inputs, shift;
	uint64_t largest = 0;

	if (fx->shift_a < 0 || fx->shift_a > 40 || fx->shift_b < 17 || fx->shift_b > 40)
		return BAD;
	shift = fx->shift_a + 16 - fx->shift_b;
	if (shift < 0)
		return BAD;
	for (int r = 0; r < fx->n_rules; r++, p += n + 1) {
		uint64_t sum = 0;

		for (int i = 0; i <= n; i++) {
			uint64_t c = magnitude(incise_fx_int64(p[i]));
			uint64_t x = INCISE_FIXED_ONE;

			if (i) {
				uint64_t low = magnitude(fx->input[i - 1].min);

				x = magnitude(fx->input[i - 1].max);
				x = x > low ? x : low;
			}
			if (x && c > div64_u64((uint64_t)1 << 62, x))
				return BAD;
			sum += c * x;
			if (sum > (uint64_t)1 << 62)
				return BAD;
		}
		/* A rule is linear: its largest output is at a corner of the support. */
		for (int corner = 0; corner < 1 << n; corner++) {
			int64_t y = incise_fx_int64(p[0]) * INCISE_FIXED_ONE;

			for (int i = 0; i < n; i++)
				y += incise_fx_int64(p[i + 1]) *
				     (corner & 1 << i ? fx->input[i].max
						      : fx->input[i].min);
			/* One more, for the floor of a negative number. */
			sum = (magnitude(y) >> shift) + 1;
			largest = largest > sum ? largest : sum;
		}
	}
	/* Σ w·y with w ≤ 2^30. */
	return largest <= div_u64(1ull << 62 >> 30, (uint32_t)fx->n_rules) ? 0 : BAD;
}

/* Weights are not negative and add up to 1 within rounding, in every row. */
static int check_weights(const struct incise_fixed *fx)
{
	const struct incise_fixed_input *a = &fx->input[0];

	for (int64_t row = 0; row <= a->cells; row++) {
		int64_t sum = 0;

		for (int i = 0; i < a->n_mfs; i++) {
			int32_t w = incise_fx_int32(a->values[row * a->n_mfs + i]);

			if (w < 0)
				return BAD;
			sum += w;
		}
		if (sum < (1 << 30) - 64 || sum > (1 << 30) + 64)
			return BAD;
	}
	return 0;
}

/* 32 bits, less the excess of the weights' sum over 1 (2^-24), and a rounding to Q16. */
#define FOLD_MAX (INT32_MAX - (1 << 14))

/*
 * Outputs g + x·h, and h, weighed, stay within 32 bits: sums do within 62, and the batch
 * evaluator holds them in halves of 64-bit lanes.
 */
static int check_fold(const struct incise_fixed *fx)
{
	const int32_t *fold = fx->data;
	int n = fx->input[0].n_mfs, to_g;
	uint64_t reach =
		((uint64_t)((int64_t)fx->input[0].max - fx->input[0].min) >> 1) + 1;

	if (fx->shift_a < 17 || fx->shift_a > 30 || fx->shift_b < -16 || fx->shift_b > 76)
		return BAD;
	to_g = 16 + fx->shift_b - fx->shift_a;
	if (to_g < 0 || to_g > 62)
		return BAD;
	for (int64_t row = 0; row <= fx->input[1].cells; row++)
		for (int i = 0; i < n; i++) {
			uint64_t g = magnitude(incise_fx_int32(fold[2 * (row * n + i)]));
			uint64_t h =
				magnitude(incise_fx_int32(fold[2 * (row * n + i) + 1]));

			/* One more of h: a sum of weights over 1 is floored away from 0. */
			if (h + 1 > FOLD_MAX ||
			    g + ((h + 1) * reach >> to_g) + 2 > FOLD_MAX)
				return BAD;
		}
	return 0;
}

/* The sections of a blob: their places and their numbers. */
static int check_data(const struct incise_fixed *fx, const struct incise_fx_header *head)
{
	uint32_t data = incise_fx_le32(head->data), n = (uint32_t)fx->n_inputs;
	uint64_t a = (uint64_t)fx->input[0].cells + 1, b = 1;
	int rc;

	if (n > 1)
		b = (uint64_t)fx->input[1].cells + 1;
	switch (fx->arithmetic) {
	case INCISE_FIXED_DIRECT:
		for (uint32_t i = 0; i < n; i++) {
			rc = check_mfs(fx, (int)i, incise_fx_le32(head->input[i].offset));
			if (rc)
				return rc;
		}
		if (!check_within_blob(data, (uint64_t)fx->n_rules * (n + 1) * 8,
				       fx->size, 8))
			return BAD;
		return check_direct(fx);
	case INCISE_FIXED_TABLE:
		if (n == 1)
			return check_within_blob(data, a * 4, fx->size, 4) &&
					       fx->shift_a >= 17 && fx->shift_a <= 30
				       ? 0
				       : BAD;
		if (!check_within_blob(incise_fx_le32(head->input[0].offset),
				       a * (uint32_t)fx->input[0].n_mfs * 4, fx->size,
				       4) ||
		    !check_within_blob(data, b * (uint32_t)fx->input[0].n_mfs * 8,
				       fx->size, 4))
			return BAD;
		rc = check_weights(fx);
		return rc ? rc : check_fold(fx);
	case INCISE_FIXED_FORCE:
		return check_within_blob(data, a * b * 4, fx->size, 4) &&
				       fx->shift_a >= 17 && fx->shift_a <= 30
			       ? 0
			       : BAD;
	}
	return UNSUPPORTED;
}

bool incise_fx_is_name(const char *name, int size)
{
	int i = 0;

	for (; i < size && name[i]; i++)
		if ((unsigned char)name[i] < ' ' || name[i] == 0x7f)
			return false;
	if (i == size)
		return false;
	for (; i < size; i++)
		if (name[i])
			return false;
	return true;
}

/* Bytes without a meaning in this version must be zero, so that a later one can use them. */
static int check_unused(const struct incise_fx_header *head)
{
	const uint8_t *input = (const uint8_t *)head->input;
	uint32_t room = incise_fx_header_inputs(incise_fx_le32(head->version));

	if (head->reserved[0] || head->reserved[1] || head->reserved[2])
		return BAD;
	for (uint32_t i = 0; i < room; i++)
		if (head->input[i].reserved[0] || head->input[i].reserved[1])
			return BAD;
	for (uint32_t i = incise_fx_le32(head->n_inputs) * (uint32_t)sizeof(*head->input);
	     i < room * sizeof(*head->input); i++)
		if (input[i])
			return BAD;
	return 0;
}

int incise_fixed_open(struct incise_fixed *fx, const void *blob, uint32_t size)
{
	const struct incise_fx_header *head = blob;
	const uint8_t *bytes = blob;
	uint32_t version;

	if (size < incise_fx_header_size(INCISE_FX_VERSION) ||
	    size > INCISE_FIXED_SIZE_MAX)
		return BAD;
	for (int i = 0; i < 8; i++)
		if (head->magic[i] != INCISE_FX_MAGIC[i])
			return BAD;
	version = incise_fx_le32(head->version);
	if (version != INCISE_FX_VERSION && version != INCISE_FX_VERSION_MANY)
		return UNSUPPORTED;
	if (size < incise_fx_header_size(version) || incise_fx_le32(head->size) != size ||
	    incise_fx_le32(head->crc) !=
		    incise_fx_crc(bytes + INCISE_FX_CRC_FROM, size - INCISE_FX_CRC_FROM))
		return BAD;
	if (incise_fx_le32(head->arithmetic) > INCISE_FIXED_FORCE)
		return UNSUPPORTED;
	*fx = (struct incise_fixed){
		.arithmetic =
			(enum incise_fixed_arithmetic)incise_fx_le32(head->arithmetic),
		.n_inputs = (int32_t)incise_fx_le32(head->n_inputs),
		.n_rules = (int32_t)incise_fx_le32(head->n_rules),
		.shift_a = incise_fx_int32(head->shift_a),
		.shift_b = incise_fx_int32(head->shift_b),
		.bound = incise_fx_le64(head->bound),
		.name = head->name,
		.output = head->output,
		.blob = blob,
		.size = size,
	};
	/* Differences of formats are checked below, and must not overflow there. */
	if (fx->shift_a < 0 || fx->shift_a > 127 || fx->shift_b < 0 || fx->shift_b > 127)
		return BAD;
	if (fx->n_inputs < 1 ||
	    fx->n_inputs > (int32_t)incise_fx_header_inputs(version) ||
	    (version == INCISE_FX_VERSION_MANY &&
	     (fx->n_inputs <= INCISE_FX_INPUTS_FEW ||
	      fx->arithmetic != INCISE_FIXED_DIRECT)) ||
	    !fx->bound || check_unused(head) ||
	    !incise_fx_is_name(head->name, sizeof(head->name)) ||
	    !incise_fx_is_name(head->output, sizeof(head->output)))
		return BAD;
	for (int i = 0; i < fx->n_inputs; i++) {
		const struct incise_fx_input *in = &head->input[i];

		if (!incise_fx_is_name(in->name, sizeof(in->name)))
			return BAD;
		fx->input[i] = (struct incise_fixed_input){
			.name = in->name,
			.min = incise_fx_int32(in->min),
			.max = incise_fx_int32(in->max),
			.n_mfs = (int32_t)incise_fx_le32(in->n_mfs),
			.cell_shift = (int32_t)incise_fx_le32(in->cell_shift),
			.cells = (int32_t)incise_fx_le32(in->cells),
			/* A pointer beyond the blob must not even be formed. */
			.values = (const int32_t *)(bytes +
						    (incise_fx_le32(in->offset) <= size
							     ? incise_fx_le32(in->offset)
							     : 0)),
		};
	}
	fx->data = bytes +
		   (incise_fx_le32(head->data) <= size ? incise_fx_le32(head->data) : 0);
	if (check_inputs(fx))
		return BAD;
	return check_data(fx, head);
}
