/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Uncertainties of training pairs, propagated into the fit and its prediction interval. A pair has
 * columns of standard uncertainties of its inputs and output behind it.
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
 * The slopes are those of a model before, so pairs are passed over two or three times:
 *
 *     start ─► origin ─► add … ─► origin ─► add … ─► end ─┐   model of the weighted pairs
 *       ▲─────────────────────────────────────────────────┘
 *
 * Not real-time safe; an object is for one thread at a time.
 */
#ifndef INCISE_LEARN_PROPAGATION_H
#define INCISE_LEARN_PROPAGATION_H

#include <incise/corpus.h>

struct incise_propagation;

/*
 * A propagation without pairs; parts: n columns, in the order in which they follow those of a pair;
 * copied. To be freed with incise_propagation_free(); NULL with errno EINVAL (a column or a source
 * that cannot be), ENOMEM.
 */
struct incise_propagation *incise_propagation_new(
	int n_inputs, const struct incise_propagation_part *parts, int n,
	struct incise_error *err);

/* NULL is accepted. */
void incise_propagation_free(struct incise_propagation *propagation);

/*
 * Start a pass over all pairs, with the slopes of a model, which is evaluated during the pass and so
 * outlives it; scatter: standard deviation of the output about the model without own parts, > 0.
 * 0, -EINVAL, -ENOMEM.
 */
int incise_propagation_start(struct incise_propagation *propagation,
			     const struct incise_model *model, double scatter,
			     struct incise_error *err);

/* Say where the next rows come from, by any texts. 0, -ENOMEM. */
int incise_propagation_origin(struct incise_propagation *propagation,
			      const char *recording, const char *calibration,
			      struct incise_error *err);

/*
 * Add a pair: inputs, output, and the columns of uncertainties, finite. Returns its weight, above 0
 * and at most 1.
 */
double incise_propagation_add(struct incise_propagation *propagation, const double *row);

/*
 * End a pass, with the model of the weighted pairs, its standard deviation, of which the factor is
 * used, and its RMSE over the pairs, weighted, from which the scatter of the next pass follows, above
 * 0. 0; -EDOM (the errors have no finite effect), -ENODATA (no pair), -ENOMEM.
 */
int incise_propagation_end(struct incise_propagation *propagation,
			   const struct incise_model *model,
			   const struct incise_uncertainty *uncertainty, double rmse,
			   double *scatter, struct incise_error *err);

/*
 * Put the effect of the common parts into the standard deviation of the final model, after the end
 * of a pass with it. Its noise, found from pairs of these rigs, is reduced by what their
 * calibrations had in it. The report may be NULL. 0; -EINVAL, -ENOMEM.
 */
int incise_propagation_finish(const struct incise_propagation *propagation,
			      struct incise_uncertainty *uncertainty,
			      struct incise_propagation_report *report,
			      struct incise_error *err);

#endif
