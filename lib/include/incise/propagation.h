/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Uncertainties of training pairs, propagated into the fit and its prediction interval. A pair has
 * columns of standard uncertainties of its inputs and output behind it. Part of libincise-learn.
 *
 *     own parts      variance of a pair: own part of the output, and the slope of the model times
 *                    those of the inputs (effective variance; Orear, Am. J. Phys. 50, 912, 1982).
 *                    Pairs weigh scatter² / (scatter² + own²), at most 1.
 *     common parts   one error for all rows of a recording or calibration, g(row) ξ with
 *                    g = part of the output - slopes · parts of the inputs, signed. In the linear
 *                    least squares of the consequents it moves them by
 *                    b = (ΦᵀWΦ + ridge)⁻¹ Φᵀ W g, so each adds b bᵀ to their covariance. With one
 *                    recording it does not average out; with n rigs its square falls as 1/n.
 *
 * An earlier model gives the slopes, so pairs are passed over two or three times:
 *
 *     start ─► origin ─► add … ─► origin ─► add … ─► end ─┐   model of the weighted pairs
 *       ▲─────────────────────────────────────────────────┘
 *
 * Not real-time safe; an object is for one thread at a time.
 */
#ifndef INCISE_PROPAGATION_H
#define INCISE_PROPAGATION_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/model.h>
#include <incise/uncertainty.h>

INCISE_BEGIN_DECLS

/** Largest number of columns of uncertainties. */
#define INCISE_PROPAGATION_PARTS 64

/** A column of standard uncertainties. */
struct incise_propagation_part {
	int of; /**< column of the pair that it is of: 0 … n_inputs - 1; n_inputs: the output */
	/** Common source, 0 … INCISE_UNCERTAINTY_SOURCES - 1; below 0: the row's own. */
	int source;
	/** Common to all rows of one calibration; else to all of one recording. */
	bool calibration;
};

struct incise_propagation;

/**
 * Make a propagation without pairs.
 *
 * @param parts n columns, in the order in which they follow those of a pair; copied
 * @return propagation, to be freed with incise_propagation_free(); NULL with errno EINVAL (a column
 *         or a source that cannot be), ENOMEM
 */
INCISE_API struct incise_propagation *incise_propagation_new(
	int n_inputs, const struct incise_propagation_part *parts, int n,
	struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_propagation_free(struct incise_propagation *propagation);

/**
 * Start a pass over all pairs.
 *
 * @param model   whose slopes are used; it is evaluated during the pass, so it must outlive it
 * @param scatter standard deviation of the output about the model without own parts, > 0
 * @return 0, -EINVAL, -ENOMEM
 */
INCISE_API int incise_propagation_start(struct incise_propagation *propagation,
					const struct incise_model *model, double scatter,
					struct incise_error *err);

/**
 * Say where the next rows come from, by any texts.
 *
 * @return 0, -ENOMEM
 */
INCISE_API int incise_propagation_origin(struct incise_propagation *propagation,
					 const char *recording, const char *calibration,
					 struct incise_error *err);

/**
 * Add a pair with its uncertainties.
 *
 * @param row inputs, output, and the columns of uncertainties, finite
 * @return its weight, above 0 and at most 1
 */
INCISE_API double incise_propagation_add(struct incise_propagation *propagation,
					 const double *row);

/**
 * End a pass.
 *
 * @param model       of the weighted pairs
 * @param uncertainty its own, of which the factor is used
 * @param rmse        of that model over the pairs, weighted; the scatter of the next pass follows
 * @param scatter     set to that, above 0
 * @return 0; -EDOM (the errors have no finite effect), -ENODATA (no pair), -ENOMEM
 */
INCISE_API int incise_propagation_end(struct incise_propagation *propagation,
				      const struct incise_model *model,
				      const struct incise_uncertainty *uncertainty,
				      double rmse, double *scatter,
				      struct incise_error *err);

/** Results of the last pass. */
struct incise_propagation_report {
	double own; /**< root mean square of the own parts, in the unit of the output */
	/** The same for the common parts' effect on the model, and a rig's on an output. */
	double calibration, rig;
	double weight;		      /**< smallest weight */
	int recordings, calibrations; /**< number of different ones */
};

/**
 * Put the effect of the common parts into the standard deviation of the final model, after the end
 * of a pass with it. Its noise, found from pairs of these rigs, is reduced by the share of their
 * calibrations.
 *
 * @param report or NULL
 * @return 0; -EINVAL, -ENOMEM
 */
INCISE_API int incise_propagation_finish(const struct incise_propagation *propagation,
					 struct incise_uncertainty *uncertainty,
					 struct incise_propagation_report *report,
					 struct incise_error *err);

INCISE_END_DECLS
#endif
