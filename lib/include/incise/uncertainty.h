/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The uncertainty of a model's prediction: the standard deviation of an output that has
 * not been seen, of Bayesian linear consequents,
 *
 *   sd(x)² = noise² (1 + |R⁻ᵀφ(x)|²)
 *
 * with φ(x) the firing strengths times (1, x), inputs scaled to [0, 1] over their ranges,
 * and R the triangular factor of the training rows with their ridge. So it grows where
 * there were few data. The noise is that of groups left out in training, hence ±1.96 sd is
 * meant to hold 95 % of a new cut.
 *
 * MATLAB could not read a .fis that held this: it lies beside it, in MODEL.fis.sd
 * (incise-sd(5)), tied to the parameters of its model by a checksum.
 */
#ifndef INCISE_UNCERTAINTY_H
#define INCISE_UNCERTAINTY_H

#include <stddef.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/model.h>

INCISE_BEGIN_DECLS

struct incise_uncertainty;

/** Standard deviations of a normal distribution that hold 95 %. */
#define INCISE_INTERVAL95 1.959963984540054

/**
 * Tie a factor to a model.
 *
 * @param noise  in the unit of the output, ≥ 0
 * @param factor R, row by row, n = n_rules·(n_inputs+1); what lies below its diagonal is
 *               not read
 * @param stride from one row to the next
 * @return uncertainty, to be freed with incise_uncertainty_free(); NULL with errno EINVAL
 *         (not finite, or 0 on the diagonal), ENOMEM.
 */
INCISE_API struct incise_uncertainty *incise_uncertainty_new(
	const struct incise_model *model, double noise, const double *factor,
	size_t stride, struct incise_error *err);

/**
 * Read MODEL.fis.sd. The content is not trusted: every number is checked, and an error
 * names file and line.
 *
 * @param path  file, or "-" for standard input
 * @param model the model it must belong to, to the bit
 * @return uncertainty; NULL with errno of incise_infile_open() or incise_infile_line(), EINVAL
 *         (malformed), ESTALE (made for other parameters), ENOMEM.
 */
INCISE_API struct incise_uncertainty *incise_uncertainty_load(
	const char *path, const struct incise_model *model, struct incise_error *err);

/**
 * Write it with 17 significant digits; whole or not at all.
 *
 * @return 0, or a negative errno of incise_outfile_open() and incise_outfile_commit().
 */
INCISE_API int incise_uncertainty_save(const struct incise_uncertainty *uncertainty,
				       const char *path, struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_uncertainty_free(struct incise_uncertainty *uncertainty);

/** The noise, in the unit of the output. */
INCISE_API double incise_uncertainty_noise(const struct incise_uncertainty *uncertainty);

/**
 * The standard deviation at x. Inputs outside the ranges are taken as incise_model_eval()
 * takes them.
 *
 * @param model the one it was made or loaded with
 * @return finite, at least the noise. Real-time safe.
 */
INCISE_API double incise_uncertainty_sd(const struct incise_uncertainty *uncertainty,
					const struct incise_model *model,
					const double *x);

/**
 * The same for many points: sd[k] of the n_inputs values at x + k·n_inputs. Real-time safe.
 */
INCISE_API void incise_uncertainty_sd_many(const struct incise_uncertainty *uncertainty,
					   const struct incise_model *model,
					   const double *x, size_t n, double *sd);

INCISE_END_DECLS
#endif
