/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Training a model on data, like MATLAB's anfis (Song et al. 2006, §4.3) or with a better
 * method, and baselines to compare with. Part of libincise-learn.
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
	/**
	 * The weight of each training pair, above 0: one of weight 2 counts as two. NULL: 1.
	 * Reported errors and the noise of the standard deviation do not have weights.
	 */
	const double *weights;
};

/** A phase of a training. */
enum incise_train_phase {
	INCISE_TRAIN_SURVEY, /**< first reading of the sources (incise/corpus.h) */
	INCISE_TRAIN_SEARCH, /**< search of the membership functions */
	INCISE_TRAIN_ADD, /**< second reading of the sources, for the sums of all pairs */
	INCISE_TRAIN_SOLVE, /**< consequents, standard deviation and baselines */
};

/** A step of a training. */
struct incise_train_step {
	enum incise_train_phase phase;
	/** Epoch of the final training that has ended, 1: the given premises; 0: none has. */
	int epoch;
	double train_rmse, check_rmse; /**< after that; check is NaN without check data */
	/** While sources are read: the present one, from 0, and how many there are. */
	int source, sources;
	int resumed;	      /**< sources that an interrupted training has surveyed */
	uint64_t rows, total; /**< rows read, and in all; 0: not known */
};

/**
 * Called after each epoch of the final training, and about every 10 ms of computing, by no clock:
 * the same training calls it as often. It is called from the thread of the training.
 *
 * @return 0; else the training ends at once with -ECANCELED
 */
typedef int (*incise_train_progress)(void *user, const struct incise_train_step *step);

/** Options of training; incise_train_options_init() fills in the defaults. */
struct incise_train_options {
	int epochs;  /**< at most, 1 …; default 80, as in Song et al.; classic only */
	double step; /**< initial step of the premises, default 0.01; classic only */
	/**
	 * Ridge of the least squares: penalty ridge·Σp² with inputs scaled to [0, 1] and the
	 * output to its standard deviation; NAN (default) penalises the differences of
	 * neighbouring rules instead, with a strength selected by cross-validation.
	 * Ignored if classic.
	 */
	double ridge;
	/**
	 * The method of MATLAB: unscaled inputs, ridge 1e-6 (equivalent to recursive least
	 * squares with S0 = 1e6 I), gradient descent for the premises, the best epoch by check
	 * error (by training error without check data).
	 */
	bool classic;
	/**
	 * Group of each training pair (n ints, from 0), or NULL. Cross-validation holds out
	 * whole groups, because pairs of one cut are not independent.
	 */
	const int *groups;
	uint64_t seed;			/**< seed of the folds */
	incise_train_progress progress; /**< or NULL */
	void *user;
	/**
	 * Pairs that select the ridge, at random; at least three for each consequent. 0 (default): 3000. SIZE_MAX: all, in time that grows with them.
	 */
	size_t tuned;
	/**
	 * Set to the predictive standard deviation, to be freed with
	 * incise_uncertainty_free(); or NULL. Not set on error.
	 */
	struct incise_uncertainty **uncertainty;
	/**
	 * Ranges of inputs and output over all pairs, where the given pairs are a sample of them
	 * (n_inputs + 1; only min and max are used), for incise_train_start(); NULL: ranges of the
	 * given pairs.
	 */
	const struct incise_variable *ranges;
};

/** Report of a training. */
struct incise_train_report {
	int epochs;	/**< epochs of the training; 1 unless classic */
	int best_epoch; /**< from 1: the epoch whose parameters were kept */
	double ridge;	/**< strength of the penalty, or the ridge given */
	double train_rmse,
		check_rmse; /**< of the kept parameters; check NaN without data */
	/** Condition of the scaled least squares, without ridge; infinite: not all is determined. */
	double condition;
	int parameters;	   /**< linear + premise */
	int rules_unfired; /**< rules whose firing strength never exceeds 0.05 in the data */
	/**
	 * 1 - (squared error)/(variation about the mean of that side); NaN for a constant
	 * output.
	 */
	double train_r2, check_r2;
	/** RMSE on held-out pairs in cross-validation; NaN if classic. */
	double crossval_rmse;
	/**
	 * The same of a plane, of the mean, and of rules that are drawn towards a·d + b·d² + c·v + …,
	 * d the first input and v another (NaN without). The model is one of these where they are as good.
	 */
	double crossval_plane, crossval_mean, crossval_quadratic;
	/**
	 * Number of pairs for cross-validation: of very many pairs a random subset. The
	 * consequents are fitted to all pairs. 0 if classic.
	 */
	size_t pairs_tuned;
	bool unfired[INCISE_MODEL_RULES_MAX]; /**< the rules that rules_unfired counts */
};

/** Set the defaults documented above. */
INCISE_API void incise_train_options_init(struct incise_train_options *options);

/**
 * Train a grid model in place: its consequents, and if classic its membership functions.
 *
 * The default method scales the data, clamps inputs to the model's ranges, and penalises
 * the differences of neighbouring rules. The strength of the penalty is the one with the
 * smallest error on held-out groups of the training pairs; the strongest ones lead to a
 * plane and to the mean of the output. A pull towards the law a·d + b·d² + c·v + … through 0, of the
 * first input and the others, is preferred unless it is worse by more than a standard error. Check pairs are not used, except to
 * select the epoch with @options->classic (as in MATLAB's anfis). In the default mode the
 * check error is therefore an error on unseen data.
 *
 * @param model   initial premises, Gaussians or bells; its ranges should be the ranges of the
 * training pairs
 * @param check   or NULL
 * @param report  or NULL
 * @return 0; -EINVAL (no pairs, a value that is not finite, wrong n_inputs, a constant input, a weight
 *         that is not above 0, weights with classic),
 *         -ENODATA (fewer pairs than consequent parameters), -ENOTSUP (the rules are not a
 *         full grid, the AND method is min, or another kind of membership function), -EDOM
 *         (least squares failed), -ECANCELED (options->progress), -ENOMEM. On error the model is
 *         unchanged.
 */
INCISE_API int incise_train(struct incise_model *model, const struct incise_pairs *train,
			    const struct incise_pairs *check,
			    const struct incise_train_options *options,
			    struct incise_train_report *report, struct incise_error *err);

/** RMSE on @on of predictors fitted to @train. */
struct incise_baselines {
	double mean;   /**< mean of the training outputs */
	double linear; /**< linear regression with a constant */
	/** mean of the k nearest neighbours, inputs scaled to unit variance */
	double knn;
	int k; /**< selected by leaving out groups of the training pairs */
};

/**
 * Compute baselines that a useful model must beat. The nearest-neighbour baseline uses random
 * subsets of very many pairs: 20000 neighbours and 5000 queries.
 *
 * @param groups   group of each training pair, or NULL
 * @param progress as of incise_train_options, or NULL
 * @return 0, -EINVAL, -ENOMEM, -EDOM, -ECANCELED.
 */
INCISE_API int incise_baselines(const struct incise_pairs *train, const int *groups,
				const struct incise_pairs *on,
				incise_train_progress progress, void *user,
				struct incise_baselines *result,
				struct incise_error *err);

/** The pairs of one side of a split, for training or checking. */
struct incise_train_side {
	struct incise_pairs pairs; /**< rows owned by the side */
	int *groups;		   /**< group of each pair; NULL without groups */
	int n_groups;		   /**< number of distinct groups */
};

/**
 * Split a dataset into training pairs and held-out pairs for checking: by whole groups if
 * there are groups, else by rows. The share of rows is as close as the groups allow; each side
 * has at least one group. The last column is the output.
 *
 * @param share held-out share, 0 < share < 1; 0: all pairs are training pairs, and @check is
 *              unchanged
 * @param seed  equal seeds give equal splits
 * @param fit   to be freed with incise_train_side_free(), as @check
 * @return 0, -EINVAL (share, or fewer than two groups or rows), -ENOMEM.
 */
INCISE_API int incise_train_split(const struct incise_dataset *data, double share,
				  uint64_t seed, struct incise_train_side *fit,
				  struct incise_train_side *check,
				  struct incise_error *err);

/** Free the members of a side; a zeroed side is accepted. */
INCISE_API void incise_train_side_free(struct incise_train_side *side);

/**
 * Make the initial model of a training: functions at even quantiles of the training pairs, with
 * ranges that leave far tails out (beyond half the width of the inner 98 %); if classic, an even grid
 * over the ranges of the pairs.
 *
 * It can select @n_mfs from the pairs: the smallest number of rules whose error on held-out
 * groups is within one standard error of the best (the standard error of their difference), or
 * whose squared error is within 1 % of the best. Grids grow by one function at a time from one
 * function per input to 6, with at most half as many consequent parameters as pairs.
 *
 * @param names   names of the inputs, then of the output
 * @param type    kind of all functions
 * @param n_mfs   number of functions of each input; if the first is 0, they are selected and
 *                returned here
 * @param options groups and seed are used for the selection
 * @return model, to be freed with incise_model_free(); NULL with errno EINVAL (a constant
 *         input, a range too large for a double), ENODATA (too few pairs for a comparison),
 *         E2BIG, EDOM, ECANCELED, ENOMEM.
 */
INCISE_API struct incise_model *incise_train_start(
	const struct incise_pairs *pairs, const char *const *names,
	enum incise_mf_type type, int *n_mfs, const struct incise_train_options *options,
	struct incise_error *err);

INCISE_END_DECLS
#endif
