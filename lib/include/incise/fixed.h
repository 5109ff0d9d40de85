/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The fuzzy model in integers: what the 1 kHz loop evaluates, and what a kernel or a
 * microcontroller can. Compiled from an incise_model by incise_fixed_compile(), evaluated
 * by incise_fixed_eval(), which uses 64-bit integers only: no float, no libc.
 *
 *   inputs   Q16.16 of the model's unit (1 LSB = 15 nm for mm)
 *   output   Q16.16 of the model's unit (1 LSB = 15 µN for N)
 */
#ifndef INCISE_FIXED_H
#define INCISE_FIXED_H

#include <incise/export.h>
#ifdef __KERNEL__
#include <linux/types.h>
#else
#include <stdint.h>
#include <incise/error.h>
#endif

INCISE_BEGIN_DECLS

#define INCISE_FIXED_INPUTS_MAX 4
#define INCISE_FIXED_MFS_MAX 16
#define INCISE_FIXED_RULES_MAX 64

#define INCISE_FIXED_ONE (1 << 16) /**< 1.0 as input or output */

/** One Gaussian as 2^-z², z = (x - centre) · slope · 2^-shift - offset in Q24. */
struct incise_fixed_mf {
	int32_t centre; /**< Q16.16 */
	int32_t slope;	/**< mantissa, 2^29 … 2^30 */
	int32_t shift;	/**< right shift that brings the product to Q24, 0 … 62 */
	int32_t offset; /**< what centre lost by rounding, as z, Q24 */
};

/** One input: its support and its membership functions. */
struct incise_fixed_input {
	int32_t min, max; /**< Q16.16; inputs are clamped to this */
	int32_t n_mfs;
	struct incise_fixed_mf mf[INCISE_FIXED_MFS_MAX];
};

/**
 * A compiled model: no pointers, owned by the caller. Made by incise_fixed_compile();
 * a hand-made one is not checked.
 */
struct incise_fixed {
	int32_t n_inputs;
	int32_t n_rules;
	struct incise_fixed_input input[INCISE_FIXED_INPUTS_MAX];
	int32_t p_shift; /**< p is in Q(p_shift) */
	int32_t y_shift; /**< a rule's output is held in Q(y_shift) */
	/** Consequents, grid order (last input fastest), the constant first. */
	int64_t p[INCISE_FIXED_RULES_MAX][INCISE_FIXED_INPUTS_MAX + 1];
};

/**
 * Evaluate. Inputs outside their support are clamped to it.
 *
 * @param fx a compiled model
 * @param x  n_inputs values, Q16.16
 * @return output, Q16.16, saturated. Real-time safe; builds in a kernel.
 */
INCISE_API int32_t incise_fixed_eval(const struct incise_fixed *fx, const int32_t *x);

#ifndef __KERNEL__
struct incise_model;

/**
 * Compile a model to fixed point, choosing number formats by its parameters.
 *
 * @param model grid of Gaussians; others are refused by name
 * @param fx    result
 * @return 0; -ENOTSUP (not a grid, a kind without a fixed form), -E2BIG (more inputs,
 *         functions or rules than fit), -ERANGE (support, width or consequent that no
 *         format holds; the message says which).
 */
INCISE_API int incise_fixed_compile(const struct incise_model *model,
				    struct incise_fixed *fx, struct incise_error *err);

/**
 * Evaluate with inputs and output in double, for tools and tests. NaN counts as the
 * middle of the support, as in incise_model_eval().
 */
INCISE_API double incise_fixed_eval_double(const struct incise_fixed *fx,
					   const double *x);
#endif

INCISE_END_DECLS
#endif
