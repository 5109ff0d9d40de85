/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The fuzzy model in integers, for the 1 kHz loop, a kernel or a microcontroller. A model is
 * compiled to a blob with a certified error bound; the file MODEL.fx contains the blob byte
 * for byte. Evaluation uses 64-bit integers only: no floating point, no libc, no allocation.
 *
 *   model ─▶ incise_fixed_compile() ─▶ blob ─▶ incise_fixed_open() ─▶ incise_fixed_eval()
 *                                       │ ▲
 *                                     MODEL.fx
 *
 *   inputs   Q16.16 of the model's unit (1 LSB = 15 nm for mm), clamped to the support
 *   output   Q16.16 of the model's unit (1 LSB = 15 µN for N)
 */
#ifndef INCISE_FIXED_H
#define INCISE_FIXED_H

#include <incise/export.h>
#ifdef __KERNEL__
#include <linux/types.h>
#else
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#endif

INCISE_BEGIN_DECLS

/** Largest number of inputs of a compiled model. */
#define INCISE_FIXED_INPUTS_MAX 4
/** Largest number of membership functions of one input. */
#define INCISE_FIXED_MFS_MAX 32
/** Largest number of rules. */
#define INCISE_FIXED_RULES_MAX 256
#define INCISE_FIXED_SIZE_MAX (1 << 22) /**< largest size of a blob, bytes */

#define INCISE_FIXED_ONE (1 << 16) /**< 1.0 as input or output */

/** The arithmetic of a blob; see lib/fixed. */
enum incise_fixed_arithmetic {
	INCISE_FIXED_DIRECT, /**< exponentials by polynomial, one division */
	/** tables of normalised weights: no exponential, no division; one or two inputs */
	INCISE_FIXED_TABLE,
	INCISE_FIXED_FORCE, /**< a table of the output itself; one or two inputs */
};

/** One input of a compiled model. */
struct incise_fixed_input {
	const char *name;      /**< into the blob */
	int32_t min, max;      /**< support, Q16.16 */
	int32_t n_mfs;	       /**< membership functions */
	int32_t cell_shift;    /**< tables: a cell is 2^cell_shift LSB wide */
	int32_t cells;	       /**< tables: number of cells; there is one more knot */
	const int32_t *values; /**< into the blob, little-endian */
};

/**
 * A view of a validated blob. Programs may read its fields; only incise_fixed_open() and the
 * functions that call it set them.
 */
struct incise_fixed {
	enum incise_fixed_arithmetic arithmetic;
	int32_t n_inputs;
	int32_t n_rules;
	int32_t shift_a, shift_b; /**< number formats, see lib/fixed/layout.h */
	uint64_t bound; /**< certified error bound, 2^-32 of the output's unit */
	struct incise_fixed_input input[INCISE_FIXED_INPUTS_MAX];
	const char *name,
		*output;  /**< names of the model and its output, into the blob */
	const void *data; /**< into the blob: consequents or table */
	const void *blob;
	uint32_t size; /**< size of the blob, bytes */
};

/**
 * Validate a blob completely and make a view of it. Checked are magic, version, checksum,
 * sizes, and that no input can make an evaluation overflow or read outside of the blob. For
 * blobs from files, and for kernels.
 *
 * @param fx   result
 * @param blob aligned to 8 bytes; must outlive @fx
 * @return 0; -22 (EINVAL: not a blob, damaged, or would overflow), -95 (ENOTSUP: another
 *         version or arithmetic). Builds in a kernel.
 */
INCISE_API int incise_fixed_open(struct incise_fixed *fx, const void *blob,
				 uint32_t size);

/**
 * Evaluate. Inputs outside their support are clamped to it.
 *
 * @param x n_inputs values, Q16.16
 * @return output, Q16.16, saturated. Real-time safe; builds in a kernel.
 */
INCISE_API int32_t incise_fixed_eval(const struct incise_fixed *fx,
				     const int32_t *x) INCISE_REALTIME;

#ifndef __KERNEL__
struct incise_model;

/** Options of a compilation. */
struct incise_fixed_options {
	/**
	 * Largest error, output's unit: the cheapest arithmetic within it is selected; 0: no
	 * limit.
	 */
	double budget;
	int arithmetic; /**< a required enum incise_fixed_arithmetic, or -1 */
	int cells;	/**< smallest number of cells per input of tables, or 0 */
};

/** Set the defaults: budget 1e-4 (0.1 mN), any arithmetic, any number of cells. */
INCISE_API void incise_fixed_options_init(struct incise_fixed_options *options);

/**
 * Compile a model to fixed point and certify its error.
 *
 * The bound is valid for every real input in the support and includes its rounding to Q16.16.
 * It comes from interval arithmetic over the whole support, not from samples.
 *
 * @param model  full grid of Gaussians over one to four inputs; others are rejected by name.
 *               Three and four have the direct arithmetic only
 * @param options or NULL for the defaults
 * @return compiled model, to be freed with incise_fixed_free(); NULL with errno ENOTSUP (a
 *         kind or shape without a fixed-point form), E2BIG, ERANGE (a support, width or
 *         consequent outside of all number formats, or a budget below the error of every
 *         arithmetic; the message names it), EINVAL, ENOMEM.
 */
INCISE_API struct incise_fixed *incise_fixed_compile(
	const struct incise_model *model, const struct incise_fixed_options *options,
	struct incise_error *err);

/**
 * Read and validate a MODEL.fx.
 *
 * @return as incise_fixed_compile(); NULL with errno of incise_infile_read(), EINVAL,
 *         ENOTSUP, ENOMEM.
 */
INCISE_API struct incise_fixed *incise_fixed_load(const char *path,
						  struct incise_error *err);

/** Write a MODEL.fx, completely or not at all. @return 0 or as incise_outfile_commit(). */
INCISE_API int incise_fixed_save(const struct incise_fixed *fx, const char *path,
				 struct incise_error *err);

/**
 * Write a compiled model as a C99 file for a microcontroller: constant tables and `int32_t
 * SYMBOL_eval(const int32_t *x)`, which is bit-exact with incise_fixed_eval(). The file
 * includes only stdint.h.
 *
 * @param symbol prefix of the function's name: letters, digits, '_', no digit first
 * @return 0, -EINVAL (@symbol), or as incise_outfile_open() and incise_outfile_commit().
 */
INCISE_API int incise_fixed_write_c(const struct incise_fixed *fx, const char *path,
				    const char *symbol, struct incise_error *err);

/** Free a model of incise_fixed_compile() or incise_fixed_load(); NULL is accepted. */
INCISE_API void incise_fixed_free(struct incise_fixed *fx);

/** The certified error bound, output's unit. */
INCISE_API double incise_fixed_bound(const struct incise_fixed *fx);

/** "direct", "table" or "force". */
INCISE_API const char *incise_fixed_arithmetic_name(
	enum incise_fixed_arithmetic arithmetic);

/**
 * Evaluate many times: y[k] = incise_fixed_eval(fx, x + k·n_inputs), bit-exact, and several
 * times as fast on a processor with AVX2 (except the direct arithmetic).
 *
 * @param x n × n_inputs values, Q16.16, the inputs of one evaluation next to each other
 * @param y n outputs, Q16.16; must not overlap @x
 * @param n may be 0. Real-time safe.
 */
INCISE_API void incise_fixed_eval_batch(const struct incise_fixed *fx, const int32_t *x,
					int32_t *y, size_t n);

/**
 * Evaluate with inputs and output in double. NaN counts as the middle of the support, as
 * in incise_model_eval(). Real-time safe.
 */
INCISE_API double incise_fixed_eval_double(const struct incise_fixed *fx,
					   const double *x) INCISE_REALTIME;
#endif

INCISE_END_DECLS
#endif
