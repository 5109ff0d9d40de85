/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The uncertainty of a model's prediction: the standard deviation of a new output, by Bayesian
 * linear consequents,
 *
 *   sd(x)² = noise(x)² (1 + |R⁻ᵀφ(x)|²)
 *
 * with φ(x) the firing strengths times (1, x), inputs scaled to [0, 1] over their ranges, and
 * R the triangular factor of the training rows with their ridge. It grows where training data
 * are sparse. The noise comes from held-out groups, so that ±1.96 sd should contain 95 % of a
 * new cut; its logarithm is linear in the inputs.
 *
 * With uncertainties of pairs (incise/propagation.h), the calibrations of the rigs add to it: of
 * the rigs that the model was trained on, and of the rig that measures a new output.
 *
 *   sd(x)² = noise(x)² (1 + |R⁻ᵀφ(x)|²) + |K φ(x)|² + |B φ(x)|²
 *            data        model            calibration  rig
 *
 * MATLAB cannot read a .fis file with this data. It is in a separate file, MODEL.fis.sd
 * (incise-sd(5)), with a checksum of the parameters of its model.
 */
#ifndef INCISE_UNCERTAINTY_H
#define INCISE_UNCERTAINTY_H

#include <stddef.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/model.h>

INCISE_BEGIN_DECLS

struct incise_uncertainty;

/** Half the width of the 95 % interval of a normal distribution, in standard deviations. */
#define INCISE_INTERVAL95 1.959963984540054

/**
 * Make the uncertainty of a model from its factor.
 *
 * @param noise  noise in the unit of the output, ≥ 0
 * @param factor R, row by row, n = n_rules·(n_inputs+1); values below its diagonal are not
 *               read
 * @param stride distance of rows in @factor
 * @return uncertainty, to be freed with incise_uncertainty_free(); NULL with errno EINVAL
 *         (not finite, or 0 on the diagonal), ENOMEM.
 */
INCISE_API struct incise_uncertainty *incise_uncertainty_new(
	const struct incise_model *model, double noise, const double *factor,
	size_t stride, struct incise_error *err);

/**
 * Read MODEL.fis.sd. Every number is validated, and an error names file and line.
 *
 * @param path  file, or "-" for standard input
 * @param model its model, bit-exact
 * @return uncertainty, to be freed with incise_uncertainty_free(); NULL with errno of
 *         incise_infile_open() or incise_infile_line(), EINVAL (malformed), ESTALE (made for
 *         other parameters), ENOMEM.
 */
INCISE_API struct incise_uncertainty *incise_uncertainty_load(
	const char *path, const struct incise_model *model, struct incise_error *err);

/**
 * Write MODEL.fis.sd with 17 significant digits, completely or not at all.
 *
 * @return 0, or a negative errno of incise_outfile_open() and incise_outfile_commit().
 */
INCISE_API int incise_uncertainty_save(const struct incise_uncertainty *uncertainty,
				       const char *path, struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_uncertainty_free(struct incise_uncertainty *uncertainty);

/**
 * The noise by the inputs: noise(x) = noise·exp(offset + Σ slope·u), with u of each input 0 up to
 * low and 1 from high on. All 0: the noise is the same everywhere.
 */
struct incise_uncertainty_shape {
	double offset;
	double slope[INCISE_MODEL_INPUTS_MAX];
	double low[INCISE_MODEL_INPUTS_MAX], high[INCISE_MODEL_INPUTS_MAX];
	/** Variance of the mean tissue that few cuts leave, as a part of that of the noise, ≥ 0; NaN: not known. */
	double shared;
};

/**
 * Set that; a new uncertainty has none, and its shared is not known.
 *
 * @return 0; -EINVAL (a number but shared is not finite, shared is infinite or below 0, a slope with high not above low): then
 *         nothing is changed
 */
INCISE_API int incise_uncertainty_set_shape(struct incise_uncertainty *uncertainty,
					    const struct incise_uncertainty_shape *shape,
					    struct incise_error *err);

/** The noise, in the unit of the output: its root mean square over the training. */
INCISE_API double incise_uncertainty_noise(const struct incise_uncertainty *uncertainty);

/**
 * The standard deviation at x. Inputs outside the ranges are handled as in
 * incise_model_eval().
 *
 * @param model its model
 * @return finite, at least the noise there. Real-time safe.
 */
INCISE_API double incise_uncertainty_sd(const struct incise_uncertainty *uncertainty,
					const struct incise_model *model,
					const double *x);

/** Parts of a standard deviation, in the unit of the output. */
struct incise_uncertainty_parts {
	double total; /**< root of the sum of squares, as of incise_uncertainty_sd() */
	double data;  /**< scatter of new cuts: the noise there */
	double model; /**< of a fit to limited data; it grows where they are sparse */
	double calibration; /**< of the rigs that the model was trained on; 0: not stated */
	double rig; /**< of another rig as well calibrated, that measures; 0: not stated */
	double mean; /**< of the mean of all cuts, not of a new one: no part of the total; NaN: not known */
};

/**
 * The parts at x, as incise_uncertainty_sd(). Real-time safe.
 */
INCISE_API void incise_uncertainty_parts(const struct incise_uncertainty *uncertainty,
					 const struct incise_model *model,
					 const double *x,
					 struct incise_uncertainty_parts *parts);

/**
 * The same for many points: parts[k] of the n_inputs values at x + k·n_inputs; NaN outside the ranges or where
 * no rule fires: nothing bounds the error there. Real-time safe.
 */
INCISE_API void incise_uncertainty_parts_many(
	const struct incise_uncertainty *uncertainty, const struct incise_model *model,
	const double *x, size_t n, struct incise_uncertainty_parts *parts);

/** Largest number of sources of a rig's calibration. */
#define INCISE_UNCERTAINTY_SOURCES 64

/**
 * Set the calibrations, and the noise that is left without them.
 *
 * @param common n_common rows K of as many numbers as unknowns, row by row; at most that many rows
 * @param rig    n_rig rows B of the same; at most INCISE_UNCERTAINTY_SOURCES
 * @return 0; -EINVAL (a number is not finite, too many rows), -ENOMEM: then nothing is changed
 */
INCISE_API int incise_uncertainty_set_calibration(struct incise_uncertainty *uncertainty,
						  double noise, const double *common,
						  int n_common, const double *rig,
						  int n_rig, struct incise_error *err);

/** Number of unknowns of φ: rules · (inputs + 1). */
INCISE_API int incise_uncertainty_unknowns(const struct incise_uncertainty *uncertainty);

/**
 * φ(x) of a model, with inputs as in incise_uncertainty_sd(). Real-time safe.
 *
 * @param phi room for n_rules · (n_inputs + 1) numbers
 */
INCISE_API void incise_uncertainty_row(const struct incise_model *model, const double *x,
				       double *phi);

/** Solve RᵀR v' = v in place. @return 0; -EDOM (not finite). Real-time safe. */
INCISE_API int incise_uncertainty_solve(const struct incise_uncertainty *uncertainty,
					double *v);

/**
 * The same for many points: sd[k] of the n_inputs values at x + k·n_inputs; NaN as above.
 * Real-time safe.
 */
INCISE_API void incise_uncertainty_sd_many(const struct incise_uncertainty *uncertainty,
					   const struct incise_model *model,
					   const double *x, size_t n, double *sd);

INCISE_END_DECLS
#endif
