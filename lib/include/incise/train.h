/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Learning a model from data: as MATLAB's anfis does (paper 1, §4.3) or better, and the
 * baselines it has to beat. Part of libincise-learn.
 *
 * Data are plain arrays, row by row: n_inputs inputs, then the output.
 */
#ifndef INCISE_TRAIN_H
#define INCISE_TRAIN_H

#include <stdbool.h>
#include <stdint.h>
#include <stddef.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/model.h>
#include <incise/uncertainty.h>

INCISE_BEGIN_DECLS

struct incise_dataset;

/** Rows of inputs and output, row-major, n × (n_inputs + 1); not owned. */
struct incise_pairs {
	const double *rows;
	size_t n;
	int n_inputs;
};

/**
 * Called after each epoch of the final training with the epoch (from 1, the premises
 * given) and the RMSE; check is NaN without check data.
 */
typedef void (*incise_train_progress)(void *user, int epoch, double train_rmse,
				      double check_rmse);

/** Options of training; incise_train_options_init() fills in the defaults. */
struct incise_train_options {
	int epochs;  /**< at most, 1 …; default 80, the paper's */
	double step; /**< initial step of the premises, default 0.01; classic only */
	/**
	 * Ridge of the least squares: penalty ridge·Σp² on inputs scaled to [0, 1] and the
	 * output to its standard deviations; NAN (default) chooses it by cross-validation.
	 * Ignored when classic.
	 */
	double ridge;
	/**
	 * As MATLAB does it: inputs unscaled, ridge 1e-6 (that is what recursive least
	 * squares with S0 = 1e6 I amounts to), premises down the gradient, the best epoch
	 * by check error (by training error without check data).
	 */
	bool classic;
	/**
	 * Group of each training pair (n ints, from 0), or NULL. Cross-validation leaves
	 * whole groups out, because pairs of one cut are not independent.
	 */
	const int *groups;
	uint64_t seed;			/**< of the folds and the starts */
	incise_train_progress progress; /**< or NULL */
	void *user;
	/** Premises to start from: those given, and others near them; default 3. */
	int starts;
	/** Training ends soon with -ECANCELED when another thread or a signal handler makes it other
	 *  than 0; or NULL. */
	const volatile int *stop;
	/**
	 * Gets the predictive standard deviation, to be freed with
	 * incise_uncertainty_free(), or NULL. On error nothing is left there.
	 */
	struct incise_uncertainty **uncertainty;
};

/** Report of a training. */
struct incise_train_report {
	int epochs;	/**< run in the final training */
	int best_epoch; /**< from 1: the one whose parameters were kept */
	double ridge;	/**< used */
	double train_rmse,
		check_rmse; /**< of the kept parameters; check NaN without data */
	double condition;   /**< of the scaled least-squares problem, ridge excluded */
	int parameters;	    /**< linear + premise */
	int rules_unfired; /**< rules whose firing strength never exceeds 0.05 in the data */
	/** 1 - (squared error)/(spread about the side's own mean); NaN for a constant. */
	double train_r2, check_r2;
	/** RMSE on held-out pairs in cross-validation; NaN when classic. */
	double crossval_rmse;
	int start; /**< whose premises were kept: 0 for those given */
	/** Pairs that cross-validation and the search for premises used: where there are
	 *  very many, a random part; the consequents come from all. 0 when classic. */
	size_t pairs_tuned;
	bool unfired[INCISE_MODEL_RULES_MAX]; /**< which rules rules_unfired counts */
};

/** Defaults as documented above. */
INCISE_API void incise_train_options_init(struct incise_train_options *options);

/**
 * Train the consequents and the membership functions of a grid model in place.
 *
 * The default scales the data, and searches the premises by Levenberg–Marquardt on the
 * variable-projected problem (consequents always the best for the premises), with
 * functions kept in order and overlapping. Ridge, start and number of epochs are those
 * with the least error on held-out groups of the training pairs; check pairs take part
 * only when @options->classic (as in MATLAB's anfis), where they choose the epoch. So in
 * the default mode the check error is one on unseen data.
 *
 * @param model   initial premises, Gaussians or bells; its ranges should be those of the
 *                training pairs
 * @param check   or NULL
 * @param report  or NULL
 * @return 0; -EINVAL (no pairs, a value that is not finite, wrong n_inputs, an input that
 *         has one value only), -ENODATA (fewer pairs than consequent parameters), -ENOTSUP
 *         (the rules are no plain grid, the AND method is min, or another kind of
 *         membership function), -EDOM
 *         (least squares failed), -ECANCELED (options->stop), -ENOMEM. On error the model is
 *         unchanged.
 */
INCISE_API int incise_train(struct incise_model *model, const struct incise_pairs *train,
			    const struct incise_pairs *check,
			    const struct incise_train_options *options,
			    struct incise_train_report *report, struct incise_error *err);

/** RMSE over @on of predictors fitted on @train. */
struct incise_baselines {
	double mean;   /**< the mean of the training outputs */
	double linear; /**< linear regression with a constant */
	double knn;    /**< mean of the k nearest, inputs scaled to unit variance */
	int k;	       /**< chosen by leave-one-out over groups on the training pairs */
};

/**
 * The predictors that a model must beat to be worth its rules. Of very many pairs a random
 * part is taken for the neighbours: 20000 to look among, 5000 to look for.
 *
 * @param groups group of each training pair, or NULL
 * @return 0, -EINVAL, -ENOMEM, -EDOM.
 */
INCISE_API int incise_baselines(const struct incise_pairs *train, const int *groups,
				const struct incise_pairs *on,
				struct incise_baselines *result,
				struct incise_error *err);

/** The pairs on one side of a split, to train from or to check with. */
struct incise_train_side {
	struct incise_pairs pairs; /**< its rows are the side's */
	int *groups;		   /**< of each pair; NULL without groups */
	int n_groups;		   /**< distinct */
};

/**
 * Split a dataset into pairs to train from and pairs that are kept back for checking: by
 * whole groups where there are groups, else by single rows. The share of rows is met as
 * nearly as groups allow; both sides keep at least one group. The last column is the output.
 *
 * @param share 0 < share < 1; 0: all pairs are to train from, and @check stays as it is
 * @param seed  same seed, same split
 * @param fit   to be freed with incise_train_side_free(), as @check
 * @return 0, -EINVAL (share, or fewer than two groups or rows), -ENOMEM.
 */
INCISE_API int incise_train_split(const struct incise_dataset *data, double share,
				  uint64_t seed, struct incise_train_side *fit,
				  struct incise_train_side *check,
				  struct incise_error *err);

/** Free what the side holds; a zeroed one is accepted. */
INCISE_API void incise_train_side_free(struct incise_train_side *side);

/**
 * The model that training starts from: an even grid over the ranges of training pairs.
 *
 * @n_mfs may be chosen from the pairs: the fewest rules whose error on held-out groups is
 * within one standard error of the best, the standard error being that of their difference,
 * or whose squared error is within 1 % of it. Grids grow by one function at a time from one
 * function each, to 6 per input, with no more consequent parameters than half the pairs.
 *
 * @param names   of the inputs, then the output
 * @param type    kind of all functions
 * @param n_mfs   how many functions each input has; where the first is 0 they are chosen,
 *                and left here
 * @param options groups and seed are used where they are chosen
 * @return model, to be freed with incise_model_free(); NULL with errno EINVAL (a constant
 *         input, a range that no double holds), ENODATA (too few pairs to compare anything),
 *         E2BIG, EDOM, ECANCELED, ENOMEM.
 */
INCISE_API struct incise_model *incise_train_start(
	const struct incise_pairs *pairs, const char *const *names,
	enum incise_mf_type type, int *n_mfs, const struct incise_train_options *options,
	struct incise_error *err);

INCISE_END_DECLS
#endif
