/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The bytes of a blob, all little-endian:
 *
 *   0    struct incise_fx_header
 *   288  data, by arithmetic; at 416 in version 2, which has room for four inputs in its
 *        header, for models of three and four
 *
 *   direct  per input, at its offset: n_mfs × struct incise_fx_mf
 *           at data: n_rules × (n_inputs + 1) consequents, int64 in Q(shift_a), the
 *           constant first, grid order (last input fastest); a rule's output is held in
 *           Q(shift_b)
 *
 *   table   one input: at data (cells+1) values, int32 in Q(shift_a)
 *           two: at input 0's offset (cells+1) × n_mfs weights, int32 in Q30, each row
 *           adding up to 1; at data (cells+1) of input 1 × n_mfs of input 0 × 2, int32:
 *           the outputs of input 0's functions with its input at the middle of its
 *           support, in Q(shift_a), and their slopes by that input, in Q(shift_b)
 *
 *   force   at data (cells+1) of input 0 × (cells+1) of input 1, int32 in Q(shift_a)
 *
 * Knot k of an input lies at min + k·2^cell_shift; between knots tables are linear. There
 * is always a knot beyond max, so that max itself lies within a cell.
 */
#ifndef INCISE_FX_LAYOUT_H
#define INCISE_FX_LAYOUT_H

#include <incise/fixed.h>

#include "integers.h"

#define INCISE_FX_MAGIC "INCISEFX"
#define INCISE_FX_VERSION 1	 /* of one and two inputs */
#define INCISE_FX_VERSION_MANY 2 /* of three and four */
#define INCISE_FX_INPUTS_FEW 2

struct incise_fx_input {
	int32_t min, max;
	uint32_t n_mfs;
	uint32_t cell_shift;
	uint32_t cells;
	uint32_t offset;
	uint32_t reserved[2]; /* zero */
	char name[32];	      /* zero-padded, as all names */
};

struct incise_fx_header {
	char magic[8];
	uint32_t version;
	uint32_t size; /* of the whole blob */
	uint32_t crc;  /* CRC-32C of all bytes behind this field */
	uint32_t arithmetic;
	uint32_t n_inputs;
	uint32_t n_rules;
	int32_t shift_a;
	int32_t shift_b;
	uint64_t bound;	      /* 2^-32 of the output's unit */
	uint32_t data;	      /* offset */
	uint32_t reserved[3]; /* zero */
	char name[64];	      /* of the model */
	char output[32];
	struct incise_fx_input
		input[INCISE_FIXED_INPUTS_MAX]; /* INCISE_FX_INPUTS_FEW in version 1 */
};

/* Inputs for which a header of this version has room, and its size. */
static inline uint32_t incise_fx_header_inputs(uint32_t version)
{
	return version == INCISE_FX_VERSION ? INCISE_FX_INPUTS_FEW
					    : INCISE_FIXED_INPUTS_MAX;
}

static inline uint32_t incise_fx_header_size(uint32_t version)
{
	return (uint32_t)(sizeof(struct incise_fx_header) -
			  (INCISE_FIXED_INPUTS_MAX - incise_fx_header_inputs(version)) *
				  sizeof(struct incise_fx_input));
}

#define INCISE_FX_CRC_FROM 20 /* offset of the first byte behind crc */

/* A Gaussian as 2^-z², z = (x - centre)·slope·2^-shift - offset in Q24. */
struct incise_fx_mf {
	int32_t centre; /* Q16.16 */
	int32_t slope;	/* mantissa, 0 … 2^30 */
	int32_t shift;	/* right shift that brings the product to Q24, 0 … 62 */
	int32_t offset; /* rounding of centre, as z, Q24 */
};

/* Little-endian to host, and back: the same. */
static inline uint32_t incise_fx_le32(uint32_t v)
{
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
	return __builtin_bswap32(v);
#else
	return v;
#endif
}

static inline uint64_t incise_fx_le64(uint64_t v)
{
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
	return __builtin_bswap64(v);
#else
	return v;
#endif
}

/* The same for signed numbers. */
static inline int32_t incise_fx_int32(int32_t v)
{
	return (int32_t)incise_fx_le32((uint32_t)v);
}

static inline int64_t incise_fx_int64(int64_t v)
{
	return (int64_t)incise_fx_le64((uint64_t)v);
}

/* Whether a name is text that ends, and zero from there on: it will be printed. */
bool incise_fx_is_name(const char *name, int size);

/* CRC-32C (Castagnoli) of n bytes. */
uint32_t incise_fx_crc(const uint8_t *bytes, uint32_t n);

/*
 * The value of a table's column within a cell, from neighbours in the blob:
 * from + (to - from)·frac/2^shift, floored.
 */
static inline int64_t incise_fx_lerp(int32_t from, int32_t to, uint32_t frac, int shift)
{
	int64_t low = incise_fx_int32(from);

	return low + (((incise_fx_int32(to) - low) * frac) >> shift);
}

#endif
