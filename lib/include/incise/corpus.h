/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Training from many recordings, files and tables, each read twice and never held in memory: a
 * survey (rows, ranges, groups, a random sample), then the sums of a factor (incise/factor.h).
 * Nothing depends on the order of the sources, or on which process reads which. Part of
 * libincise-learn.
 *
 *     source ──► survey ──┐                              ┌── sources ──► sums ──► model
 *     source ──► survey ──┴► sample ──► search of premises
 */
#ifndef INCISE_CORPUS_H
#define INCISE_CORPUS_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/factor.h>
#include <incise/ranks.h>
#include <incise/realism.h>
#include <incise/texture.h>
#include <incise/train.h>
#include <incise/uncertainty.h>

INCISE_BEGIN_DECLS

/** Rows of a sample that settles premises and ridge. */
#define INCISE_CORPUS_SAMPLE 20000

/** Membership functions of each input by default, but for two inputs, which have 5 and 4. */
#define INCISE_TRAIN_MFS 3

struct ArrowArrayStream;

/** A CSV file, or the rows of an Arrow stream: of a recording, of a table. */
struct incise_train_source {
	const char *name; /**< for messages */
	const char *path; /**< of a CSV file; NULL: the rows are those of @ref stream */
	/** Start to read the rows, the same at each call. 0 or a negative errno. */
	int (*stream)(struct incise_train_source *source, struct ArrowArrayStream *stream,
		      struct incise_error *err);
	bool cuts; /**< the stream has a column cut */
	/** File by whose SHA-256 the source is known; NULL: @ref path, else its name is hashed. */
	const char *hashed;
	const char *
		text; /**< name, rig, calibration: provenance, one line; NULL: the name */
	const char *rig; /**< of all rows, where groups are rigs; NULL: the column rig */
	/** Calibration of its rig, any text that is the same for the same one; NULL: its own. */
	const char *calibration;
	/**
	 * Called once before the source is read, by the process that reads it: check it, and set
	 * the texts above. 0 or a negative errno; NULL: nothing is to be done.
	 */
	int (*open)(struct incise_train_source *source, struct incise_error *err);
	/**
	 * Return a text that is another one if the rows may be others, such as sizes and times
	 * of files; to be freed with free(3). NULL: those of @ref path, or rows cannot change.
	 */
	char *(*state)(const struct incise_train_source *source);
	void *user;
};

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

/** Uncertainties of a model of weighted pairs. */
struct incise_propagation_report {
	double own; /**< root mean square of the own parts, in the unit of the output */
	/** The same of the common parts' effect on the model, and of those of a rig on an output. */
	double calibration, rig;
	double weight;		      /**< smallest weight */
	int recordings, calibrations; /**< number of different ones */
};

/** The last result of incise_train_sources(); each needs those before it. */
enum incise_train_end {
	INCISE_TRAIN_TO_MODEL,
	INCISE_TRAIN_TO_FACTOR, /**< the sums at given premises */
	INCISE_TRAIN_TO_CORPUS, /**< the survey */
};

/** Further inputs that a training tries, at most. */
#define INCISE_TRAIN_FURTHER_MAX 6

/** Options of a training from sources; zeroed but for @ref train are the defaults. */
struct incise_sources_options {
	/** Columns of the inputs, of the output, of the uncertainties, then of further inputs. */
	const char *const *columns;
	int n_inputs;
	const struct incise_propagation_part *parts; /**< of the uncertainties */
	int n_parts;				     /**< 0: all pairs weigh the same */
	/**
	 * Each is tried as a third input, one that has a number in all rows. At most
	 * INCISE_TRAIN_FURTHER_MAX, else EINVAL; 0 with other than two inputs, ranks, premises, classic or tuned.
	 */
	int n_further;
	/** recording, rig, none, or a column; NULL: cut if all sources have it, else none. */
	const char *group;
	bool all_rows; /**< also rows whose column advancing is 0 */
	bool averaged; /**< rows are means, as the model notes: --rate */
	/** Take 3 functions of the first input and 2 of each other one, unless n_mfs have an error smaller by 5 %. */
	bool smooth;
	double check; /**< share held out, 0 ≤ check < 1, as near as groups and equal rows allow */
	/** Membership functions and ranges to keep; NULL: they are searched. */
	const struct incise_model *premises;
	enum incise_mf_type type;
	int n_mfs[INCISE_MODEL_INPUTS_MAX]; /**< if the first is 0, they are chosen */
	/**
	 * Options of the search; the groups, the ranges and the uncertainty are found here.
	 * Those that are classic keep all different pairs in memory.
	 */
	struct incise_train_options train;
	/**
	 * File in which an interrupted training of several sources leaves what it has read, and
	 * goes on from; it is removed at the end. NULL: none. Not with weights or ranks.
	 */
	const char *progress;
	/** Processes that share the sources, all with the same options; NULL: this one alone. */
	const struct incise_ranks *ranks;
	enum incise_train_end end;
};

struct incise_corpus;

/** Results of a training from sources; those that it did not reach are zero. */
struct incise_trained {
	struct incise_model *model; /**< NULL in other processes than that of rank 0 */
	struct incise_uncertainty *uncertainty;
	char *notes; /**< of the model, for incise_model_save_notes() */
	struct incise_train_report report;
	struct incise_baselines
		baselines;	     /**< on the sample held out, else on the sample */
	uint64_t pairs, check_pairs; /**< rows used; those held out */
	uint64_t left_out;	     /**< rows in which the blade did not advance */
	uint64_t repeated;	     /**< rows that are equal to another one */
	uint64_t
		check_outside; /**< rows held out whose output is a whole range or more outside */
	uint64_t
		clamped; /**< pairs of the sample whose inputs are outside the model's ranges */
	const char *group; /**< what the pairs were grouped by; NULL: nothing */
	struct incise_model *initial; /**< before the search */
	struct incise_factor *factor; /**< sums of the pairs that are not held out */
	struct incise_corpus *corpus;
	double noise; /**< of @ref uncertainty */
	double coverage; /**< share of the held-out sample in the 95 % interval; NaN without */
	double thirds[3]; /**< the same of the thirds of its pairs by the first input */
	double least; /**< the same of the group of which the fewest are; NAN without groups */
	/**
	 * Lowest and highest 5 % of the first input in the sample held out, else in the sample: where
	 * they end, and the mean error of the model there, as a share of the mean output there, if it is not 0.
	 */
	double end[2], end_bias[2];
	struct incise_propagation_report propagated; /**< with weights */
	/**
	 * The further input with the smallest error in cross-validation over groups, if that is smaller
	 * by 5 % and a standard error, and so in most groups, by two of their number; NULL: none.
	 */
	const char *better;
	double better_rmse; /**< that error */
	bool shared; /**< of ranks: all know of the failure, or only this one still works */
};

/**
 * Train a model from sources; or end before, as options->end says.
 *
 * Memory is that of the sample, unless train.classic or train.tuned ask for all pairs. Not real-time
 * safe; any number of trainings may run at a time, each in one thread, which calls the functions of
 * its sources and options->train.progress.
 *
 * @param sources n of them; they outlive the result
 * @param options outlive the result
 * @param trained result, to be freed with incise_trained_free(), also after an error
 * @return 0; -EEXIST (a source is given twice, by its hash or by a recording that its text names),
 *         -EINVAL (fewer than two groups or different rows to share; premises, as of
 *         incise_factor_new()), -ENODATA (no rows), -ESTALE (rows changed between readings),
 *         -ECANCELED (by the progress), -ENOMEM, a negative errno of the sources, of incise_train(),
 *         of incise_train_start() or of incise_factor_solve()
 */
INCISE_API int incise_train_sources(struct incise_train_source *sources, int n,
				    const struct incise_sources_options *options,
				    struct incise_trained *trained,
				    struct incise_error *err);

/**
 * The same from files of factors (incise/factor.h) instead of their pairs.
 *
 * @param paths  n files
 * @param ridge  as of incise_factor_ridge
 * @param end    INCISE_TRAIN_TO_MODEL or INCISE_TRAIN_TO_FACTOR
 * @return 0, or a negative errno of incise_factor_load(), incise_factor_merge() and
 *         incise_factor_solve()
 */
INCISE_API int incise_train_factors(const char *const *paths, int n, double ridge,
				    enum incise_train_end end,
				    struct incise_trained *trained,
				    struct incise_error *err);

/**
 * Learn the texture of a trained model from the same sources, which need a column cut and rows in their
 * order at full rate. Not real-time safe.
 *
 * @param trained with its corpus, or a model alone; its first input depth_UNIT is the way, where sources have no column
 *                way_UNIT; cuts that it holds out are not learned from
 * @param options progress and seed
 * @param realism measured on the cuts that are held out; or NULL
 * @return texture, to be freed with incise_texture_free(); NULL with errno EINVAL (no such input or column,
 *         rows that are means or out of order), ENODATA (too few events), EDOM (none is better
 *         than the model alone, which realism is of then), ECANCELED (by the progress),
 *         ENOMEM, or one of the sources
 */
INCISE_API struct incise_texture *incise_train_texture(
	struct incise_train_source *sources, int n, const struct incise_trained *trained,
	const struct incise_train_options *options, struct incise_realism *realism,
	struct incise_error *err);

/** Free the members; zeroed results are accepted. */
INCISE_API void incise_trained_free(struct incise_trained *trained);

/** A group of rows, for example a cut. */
struct incise_corpus_group {
	uint64_t key;  /**< as of incise_group_key() */
	char name[64]; /**< cut to this length */
	uint64_t rows;
	/** Sum, smallest and largest value of each column. */
	double sum[INCISE_MODEL_INPUTS_MAX + 1], min[INCISE_MODEL_INPUTS_MAX + 1],
		max[INCISE_MODEL_INPUTS_MAX + 1];
	bool check; /**< held out */
	int number; /**< that of its pairs in a sample (incise_train_side), and of its namesakes elsewhere */
};

/** The survey of a source. */
struct incise_corpus_survey {
	char hash[65], text[INCISE_FACTOR_TEXT_MAX];
	uint64_t rows, left_out;
	uint64_t digest; /**< of its rows and their groups in their order */
	int n_groups;
	struct incise_corpus_group *groups; /**< in order of appearance */
	double min[INCISE_MODEL_INPUTS_MAX + 1], max[INCISE_MODEL_INPUTS_MAX + 1];
	char name[200];	      /**< for messages; cut to this length */
	char group[256];      /**< of all its rows; "": the text of each row */
	unsigned int missing; /**< bit i: rows have no number in further input i */
};

/** Number of sources. */
INCISE_API int incise_corpus_sources(const struct incise_corpus *corpus);

/** Survey of a source, in order of their hashes; owned by the corpus. */
INCISE_API const struct incise_corpus_survey *incise_corpus_source(
	const struct incise_corpus *corpus, int i);

/** Rows, groups and ranges of a side. */
struct incise_corpus_side {
	/** A sample of its rows, equal rows of a group once; owned by the corpus. */
	struct incise_train_side sample;
	uint64_t rows;
	/** Rows, equal ones of a group counted once; an estimate beyond the size of the sample. */
	uint64_t different;
	int n_groups;
};

/** A side of the corpus: of the training, or held out; owned by the corpus. */
INCISE_API const struct incise_corpus_side *incise_corpus_side(
	const struct incise_corpus *corpus, bool check);

/** Ranges of all rows that are not held out by group: inputs, then output. */
INCISE_API void incise_corpus_ranges(const struct incise_corpus *corpus, double *min,
				     double *max);

INCISE_END_DECLS
#endif
