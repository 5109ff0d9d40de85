/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The Takagi–Sugeno fuzzy model of Song et al. (2006), eq. (1)–(3), in double precision, and
 * its file, MATLAB's .fis.
 *
 *   rule r:  if x1 is A(1,r) and x2 is A(2,r) then  y = p(r,0) + p(r,1) x1 + p(r,2) x2
 *   output:  Σ w(r) y(r) / Σ w(r),  w(r) = weight(r) · Π A(i,r)(x(i))
 *
 * With the AND method min the smallest membership grade replaces the product. A rule may
 * exclude inputs, and the rules need not form the full grid.
 *
 * A cutting model has the inputs depth_mm and velocity_mm_s and the output force_N. This interface
 * does not depend on that: the training data give the units.
 *
 * Song et al. write the Gaussian as exp(-(x-m)²/σ²). Files and this interface use MATLAB's
 * form exp(-(x-c)²/(2 s²)): s = σ/√2.
 */
#ifndef INCISE_MODEL_H
#define INCISE_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Largest number of inputs of a model. */
#define INCISE_MODEL_INPUTS_MAX 8
#define INCISE_MODEL_MFS_MAX \
	32 /**< largest number of membership functions of one input */
/** Largest number of rules of a model. */
#define INCISE_MODEL_RULES_MAX 256
#define INCISE_MODEL_NAME_MAX 64 /**< bytes, including the final NUL */

/**
 * Kinds of membership functions, each with its name in a .fis file. All parameters are finite.
 * Edges may be vertical (trimf with a = b or b = c, trapmf with a = b or c = d): the
 * membership grade is 1 on such an edge.
 */
enum incise_mf_type {
	INCISE_MF_GAUSS, /**< gaussmf [s c]: exp(-(x-c)²/(2 s²)), s > 0 */
	INCISE_MF_GBELL, /**< gbellmf [a b c]: 1/(1 + |(x-c)/a|^(2b)), a > 0, b > 0 */
	/**
	 * gauss2mf [s1 c1 s2 c2]: gaussmf [s1 c1] left of c1 times gaussmf [s2 c2] right of
	 * c2, each 1 on its other side; s1 > 0, s2 > 0. With c1 > c2 the peak is below 1.
	 */
	INCISE_MF_GAUSS2,
	INCISE_MF_TRI, /**< trimf [a b c]: feet a and c, peak b; a ≤ b ≤ c */
	/**
	 * trapmf [a b c d]: the smaller of a rise from a to b and a fall from c to d; a ≤ b, c
	 * ≤ d, a ≤ d. With b > c the slopes cross below 1; then a < d.
	 */
	INCISE_MF_TRAP,
	INCISE_MF_SIG, /**< sigmf [a c]: 1/(1 + exp(-a(x-c))); a may be negative or 0 */
};

/** The operation that combines the membership grades of a rule into its firing strength. */
enum incise_and_method {
	INCISE_AND_PROD, /**< product of the grades */
	INCISE_AND_MIN,	 /**< smallest grade */
};

/** One membership function. Parameters in the order of MATLAB's file. */
struct incise_mf {
	enum incise_mf_type type;
	char name[INCISE_MODEL_NAME_MAX];
	double p[4];
};

/** One input or output: its name (with unit) and the range it was trained on. */
struct incise_variable {
	char name[INCISE_MODEL_NAME_MAX];
	double min, max; /**< support; min < max, both finite */
};

/** A model without its membership functions and rules. */
struct incise_model_info {
	char name[INCISE_MODEL_NAME_MAX]; /**< in the .fis file */
	int n_inputs;			  /**< 1 … INCISE_MODEL_INPUTS_MAX */
	int n_rules;
	enum incise_and_method and_method; /**< combines the grades of a rule */
	struct incise_variable input[INCISE_MODEL_INPUTS_MAX], output;
	int n_mfs[INCISE_MODEL_INPUTS_MAX]; /**< membership functions of each input */
};

/** One rule; its output is p[0] + p[1] x1 + … */
struct incise_rule {
	int8_t mf[INCISE_MODEL_INPUTS_MAX]; /**< function of each input; -1: none */
	/** 0 … 1; a rule of weight 0 never fires, and at least one weight is larger. */
	double weight;
	double p[INCISE_MODEL_INPUTS_MAX + 1];
};

/** Flags of an evaluation. */
enum incise_model_flag {
	/**
	 * An input was outside its range or NaN; or no rule fires there (all firing strengths
	 * are 0, or too small for a double) and the nearest rules gave the output.
	 */
	INCISE_MODEL_EXTRAPOLATED = 1,
};

struct incise_model;

/**
 * A model whose rules form the full grid of the inputs' membership functions. Inputs get
 * evenly spaced functions over their range, neighbours crossing at 0.5 (genfis1), named for a
 * reader: "shallow" … "deep" over an input whose name begins with depth, "slow" … "fast" over
 * velocity or speed, else, and over negative values, "low" … "high"; "level_1" … from eight on.
 * Consequents are zero.
 *
 * @param n_inputs  1 … INCISE_MODEL_INPUTS_MAX
 * @param inputs    n_inputs names and ranges
 * @param n_mfs     n_inputs counts, each 1 … INCISE_MODEL_MFS_MAX
 * @param type      kind of all functions; not INCISE_MF_SIG, which is not a peak
 * @param output    name and range of the output
 * @return model, to be freed with incise_model_free(); NULL with errno EINVAL (a range,
 *         a count, the kind), E2BIG (more than INCISE_MODEL_RULES_MAX rules), ENOMEM.
 */
INCISE_API struct incise_model *incise_model_new_grid(
	int n_inputs, const struct incise_variable *inputs, const int *n_mfs,
	enum incise_mf_type type, const struct incise_variable *output,
	struct incise_error *err);

/**
 * Read a .fis file: Sugeno, first or zero order, all kinds of incise_mf_type, prod or min,
 * wtaver, rule weights.
 *
 * Every number is validated, and an error names file and line.
 *
 * @param path file, or "-" for standard input
 * @return model, to be freed with incise_model_free(); NULL with errno of incise_infile_open()
 *         or incise_infile_line(), EINVAL (malformed), ENOTSUP (Mamdani, an unknown membership
 *         function or method, 'or' and 'not' in a rule), E2BIG, ENOMEM.
 */
INCISE_API struct incise_model *incise_model_load(const char *path,
						  struct incise_error *err);

/**
 * Write a .fis file with 17 significant digits, completely or not at all.
 *
 * @return 0, or a negative errno of incise_outfile_open() and incise_outfile_commit().
 */
INCISE_API int incise_model_save(const struct incise_model *model, const char *path,
				 struct incise_error *err);

/**
 * Write a .fis file with notes: comments, which MATLAB skips. incise train notes the recordings,
 * calibrations, options and version that a model came from.
 *
 * @param notes lines that end with a newline
 * @return as incise_model_save()
 */
INCISE_API int incise_model_save_notes(const struct incise_model *model, const char *path,
				       const char *notes, struct incise_error *err);

/**
 * Read the notes of a .fis file, which a model in memory does not have.
 *
 * @return lines that end with a newline, "" without notes, to be freed with free(3); NULL with
 *         errno of incise_infile_open(), ENOMEM
 */
INCISE_API char *incise_model_notes(const char *path, struct incise_error *err);

/** @return a copy, to be freed with incise_model_free(); NULL with errno ENOMEM. */
INCISE_API struct incise_model *incise_model_copy(const struct incise_model *model);

/** Copy @from to @to without an allocation. */
INCISE_API void incise_model_assign(struct incise_model *to,
				    const struct incise_model *from);
/** NULL is accepted. */
INCISE_API void incise_model_free(struct incise_model *model);

/** Name, inputs and output; owned by the model. */
INCISE_API const struct incise_model_info *incise_model_info(
	const struct incise_model *model);

/** Membership function @mf of input @input; owned by the model. */
INCISE_API const struct incise_mf *incise_model_mf(const struct incise_model *model,
						   int input, int mf);

/**
 * Replace the parameters of a membership function; kind and name stay.
 *
 * @param p incise_mf_n_params() values
 * @return 0, or -EINVAL if they are out of range; see incise_mf_type.
 */
INCISE_API int incise_model_set_mf(struct incise_model *model, int input, int mf,
				   const double p[4]);

/** Rule @rule, 0 … n_rules-1; owned by the model. */
INCISE_API const struct incise_rule *incise_model_rule(const struct incise_model *model,
						       int rule);

/**
 * Replace a consequent.
 *
 * @param p n_inputs+1 coefficients, the constant first
 * @return 0, or -EINVAL if one is not finite.
 */
INCISE_API int incise_model_set_consequent(struct incise_model *model, int rule,
					   const double *p);

/**
 * Clamp inputs to their range (default on). If off, the consequents extrapolate linearly.
 */
INCISE_API void incise_model_set_clamp(struct incise_model *model, bool clamp);

/** Membership grade in [0, 1]; 0 for NaN. Real-time safe. */
INCISE_API double incise_mf_eval(const struct incise_mf *mf, double x);

/** Number of parameters in incise_mf.p that a kind uses: 2 to 4. */
INCISE_API int incise_mf_n_params(enum incise_mf_type type);

/** Name of a kind in .fis files, for example "gaussmf". */
INCISE_API const char *incise_mf_type_name(enum incise_mf_type type);

/**
 * Check points that a person or a program gives, before they are evaluated: a model answers for
 * any number, as a loop needs it to.
 *
 * @param inputs  n_inputs names and ranges
 * @param x       n × n_inputs values, the inputs of one point next to each other
 * @param outside set to the number of points that lie outside the ranges, whose inputs are clamped
 *                to them or extrapolated
 * @return 0; -EINVAL: a value is not finite, with its point and input in the message
 */
INCISE_API int incise_inputs_check(const struct incise_variable *inputs, int n_inputs,
				   const double *x, size_t n, size_t *outside,
				   struct incise_error *err);

/**
 * Evaluate eq. (3). Firing strengths are normalised in the log domain, so that the rule with
 * the largest one decides even if all of them underflow.
 *
 * Outside a triangle or trapezoid a strength is exactly 0, and any rule with a larger strength
 * takes precedence. If all strengths are 0, the nearest rule gives the output: the one with
 * the smallest distance to the feet, in widths (foot to foot), summed over the inputs (with
 * min: the largest over the inputs). Equally near rules share the output by the grades of
 * their other inputs.
 *
 * A NaN input counts as the middle of its range.
 *
 * @param x     n_inputs values
 * @param flags set to incise_model_flag bits, or NULL
 * @return finite output. Real-time safe.
 */
INCISE_API double incise_model_eval(const struct incise_model *model, const double *x,
				    unsigned int *flags) INCISE_REALTIME;

/**
 * Evaluate many points, each bit-exact with incise_model_eval(), with the gradient.
 *
 * @param x        n × n_inputs values, the inputs of one point next to each other
 * @param n        may be 0
 * @param y        n outputs
 * @param gradient n × n_inputs slopes ∂y/∂x, output's unit per input's; or NULL. For a clamped
 *                 or NaN input the slope is 0; at a kink it is one-sided or 0. Finite.
 *                 Real-time safe.
 */
INCISE_API void incise_model_eval_many(const struct incise_model *model, const double *x,
				       size_t n, double *y, double *gradient);

/**
 * Normalised firing strengths w(r)/Σw of all rules, as in incise_model_eval(); their sum is 1.
 * Inputs are not clamped to their ranges.
 *
 * @param x n_inputs values; NaN counts as the middle of the range
 * @param w n_rules results
 */
INCISE_API void incise_model_firing(const struct incise_model *model, const double *x,
				    double *w);

INCISE_END_DECLS
#endif
