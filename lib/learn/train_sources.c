// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Training from sources; see incise/corpus.h.
 *
 *   sources ─► survey ─► sample ─► premises and penalty ───┐
 *      └──────────────────────────► sums of all pairs ─────┴─► model, or a factor
 *
 * The sources are shared among processes: each surveys its own, all have all surveys, the first
 * one searches, each adds the pairs of its own, and the first one solves. With weights the sums are
 * found three times: weights follow from a model, and the model from the weights.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/version.h>
#include "../base/ascending.h"
#include "reader.h"
#include "train.h"

/* Operations for a row: reading it, and its part in the survey. */
#define READ 5e3

/* Passes by which weights have settled. */
#define PASSES 3

struct training {
	const struct incise_sources_options *options;
	const struct incise_ranks *ranks; /* or NULL */
	struct incise_trained *trained;
	struct incise_reader *sources;
	int n;
	struct incise_reading reading;
	char *how;				/* the options that the model notes */
	struct incise_progress *progress;	/* or NULL */
	struct incise_propagation *propagation; /* or NULL */
	struct incise_factor *check;		/* or NULL */
	struct incise_choice errors;		/* of the search */
	struct incise_watch watch;
	struct incise_error err;
	bool named; /* the error of a search names what it is of */
};

static int no_train_sources_memory(struct training *t)
{
	return incise_error_set(&t->err, ENOMEM, "no memory to train");
}

/* Put what is trained from in front of the error. */
static int name_error(struct training *t, int rc)
{
	struct incise_error own = t->err;

	return t->n == 1
		       ? incise_error_set(&t->err, -rc, "%s: %s",
					  t->sources[0].given->name, own.text)
		       : incise_error_set(&t->err, -rc, "%d sources: %s", t->n, own.text);
}

/* The same, with the rows that repeat others, which may be the cause. */
static int name_training(struct training *t, int rc)
{
	struct incise_error own;

	rc = name_error(t, rc);
	own = t->err;
	return t->trained->repeated
		       ? incise_error_set(&t->err, -rc,
					  "%s (%llu of %llu rows repeat another row)",
					  own.text,
					  (unsigned long long)t->trained->repeated,
					  (unsigned long long)(t->trained->pairs +
							       t->trained->check_pairs))
		       : rc;
}

/* The options of incise train that make this model of its sources: free(3). */
static char *describe_options(const struct training *t)
{
	const struct incise_sources_options *options = t->options;
	const struct incise_train_options *train = &options->train;
	int n = options->n_inputs;
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	if (!out)
		return NULL;
	fprintf(out, "--group %s%s%s", t->reading.group ? t->reading.group : "none",
		options->all_rows ? " --all-rows" : "",
		options->averaged ? " --rate HZ" : "");
	for (int i = 0; i <= n && !options->premises; i++)
		fprintf(out, "%s%s",
			!i	? " --inputs "
			: i < n ? ","
				: " --target ",
			options->columns[i]);
	if (options->n_parts)
		fputs(" --uncertainty parts", out);
	if (options->check > 0)
		fprintf(out, " --check %g", options->check);
	if (options->check > 0 || train->seed != 1)
		fprintf(out, " --seed %llu", (unsigned long long)train->seed);
	if (options->premises || options->smooth || !options->n_mfs[0])
		fputs(options->premises ? " --premises MODEL.fis"
		      : options->smooth ? " --texture"
					: " --mf auto",
		      out);
	else
		for (int i = 0; i < n; i++)
			fprintf(out, "%s%d", i ? "," : " --mf ", options->n_mfs[i]);
	if (options->type != INCISE_MF_GAUSS)
		fprintf(out, " --search type=%s", incise_mf_type_name(options->type));
	if (train->tuned)
		fprintf(out, " --search sample=%zu",
			train->tuned == SIZE_MAX ? 0 : train->tuned);
	if (train->classic)
		fprintf(out, " --search classic,step=%g --epochs %d", train->step,
			train->epochs);
	if (!isnan(train->ridge))
		fprintf(out, " --ridge %g", train->ridge);
	if (!fclose(out))
		return text;
	free(text);
	return NULL;
}

static void begin_phase(struct training *t, enum incise_train_phase phase, uint64_t total,
			double cost)
{
	t->watch.step = (struct incise_train_step){.phase = phase, .total = total};
	t->reading.cost = cost;
	if (phase == INCISE_TRAIN_SURVEY || phase == INCISE_TRAIN_ADD)
		t->watch.step.sources = t->n;
	incise_watch_ask(&t->watch);
}

/* --- many processes ------------------------------------------------------------------ */

static bool is_mine(const struct training *t, int source)
{
	return !t->ranks || source % t->ranks->size == t->ranks->rank;
}

static bool is_first(const struct training *t)
{
	return !t->ranks || !t->ranks->rank;
}

/* Fail if any rank has failed, with the error of the lowest one. */
static int agree_on_error(struct training *t, int rc)
{
	struct incise_error none = {0}, *all;
	size_t *sizes;
	void *bytes;

	if (t->watch.stopped)
		rc = incise_error_set(&t->err, ECANCELED, "training was stopped");
	if (!t->ranks)
		return rc;
	if (t->ranks->gather(rc ? &t->err : &none, sizeof(none), &bytes, &sizes))
		return no_train_sources_memory(t);
	all = bytes;
	for (int r = 0; r < t->ranks->size && !t->trained->shared; r++)
		if (all[r].code) {
			t->trained->shared = true;
			t->err = all[r];
			rc = -t->err.code;
		}
	free(bytes);
	free(sizes);
	return rc;
}

/* The surveys of all ranks at each. */
static int share_surveys(struct training *t)
{
	struct incise_corpus *corpus = t->trained->corpus;
	size_t n, *sizes;
	void *mine = incise_corpus_encode(corpus, &n), *all;
	int rc = mine ? t->ranks->gather(mine, n, &all, &sizes) : -ENOMEM;

	free(mine);
	if (rc)
		return no_train_sources_memory(t);
	for (size_t r = 0, at = 0; r < (size_t)t->ranks->size && !rc; at += sizes[r], r++)
		if (r != (size_t)t->ranks->rank)
			rc = incise_corpus_add(corpus, (char *)all + at, sizes[r],
					       &t->err);
	free(all);
	free(sizes);
	t->trained->shared = rc;
	return rc;
}

/* A factor without pairs at the premises of rank 0. */
static int share_premises(struct training *t, struct incise_factor **factor)
{
	size_t n = 0, *sizes;
	void *mine = *factor ? incise_factor_encode(*factor, &n) : NULL, *all;
	int rc = *factor && !mine ? -ENOMEM : t->ranks->gather(mine, n, &all, &sizes);

	free(mine);
	if (rc)
		return no_train_sources_memory(t);
	if (!*factor)
		*factor = incise_factor_decode(all, sizes[0], "rank 0", &t->err);
	free(all);
	free(sizes);
	return *factor ? 0 : -errno;
}

/* Add the sums of some pairs to those of others, and free them; NULL is an error before. */
static int add_sums(struct incise_factor *sums, struct incise_factor *more,
		    const char *name, struct incise_error *err)
{
	int rc = more ? incise_factor_merge(sums, more, name, err) : -errno;

	incise_factor_free(more);
	return rc;
}

/* The sum of all ranks' factors at rank 0, by a tree: any other gives the same. */
static int add_ranks(struct training *t, struct incise_factor *factor)
{
	static const char *const name = "another rank";
	const struct incise_ranks *ranks = t->ranks;
	void *bytes;
	size_t n;
	int rc = 0;

	for (int step = 1; step < ranks->size && !rc; step *= 2) {
		if (ranks->rank % (2 * step)) {
			bytes = incise_factor_encode(factor, &n);
			if (!bytes)
				return no_train_sources_memory(t);
			ranks->send(ranks->rank - step, bytes, n);
			free(bytes);
			return 0;
		}
		if (ranks->rank + step >= ranks->size)
			continue;
		bytes = ranks->receive(ranks->rank + step, &n);
		rc = bytes ? add_sums(factor,
				      incise_factor_decode(bytes, n, name, &t->err), name,
				      &t->err)
			   : no_train_sources_memory(t);
		free(bytes);
	}
	return rc;
}

/* --- the progress of an interrupted training ----------------------------------------- */

/* All that the surveys and sums depend on but the premises; NULL: nothing is kept. */
static struct incise_progress *open_progress(struct training *t)
{
	const struct incise_sources_options *options = t->options;
	struct incise_progress *progress = NULL;
	char *key = NULL;
	size_t size;
	FILE *out;

	if (!options->progress || t->ranks || options->train.classic || options->n_parts)
		return NULL;
	out = open_memstream(&key, &size);
	if (!out)
		return NULL;
	fprintf(out, "%s; seed %llu; ", t->how, (unsigned long long)options->train.seed);
	for (int i = 0; i < t->reading.n_columns; i++)
		fprintf(out, "%s,", options->columns[i]);
	if (!fclose(out))
		progress = incise_progress_open(options->progress, key, t->sources, t->n);
	free(key);
	return progress;
}

static void keep_part(struct training *t, enum incise_progress_part part,
		      struct incise_factor *factor)
{
	size_t size = 0;
	void *bytes = factor ? incise_factor_encode(factor, &size) : NULL;

	incise_progress_set(t->progress, part, bytes, size);
}

static void keep_progress(struct training *t)
{
	keep_part(t, PROGRESS_FIT, t->trained->factor);
	keep_part(t, PROGRESS_CHECK, t->check);
	incise_progress_write(t->progress);
}

static void keep_surveys(struct training *t)
{
	size_t size;
	void *bytes = incise_corpus_encode(t->trained->corpus, &size);

	incise_progress_set(t->progress, PROGRESS_SURVEYS, bytes, size);
	keep_progress(t);
}

static int fail_damaged(struct training *t)
{
	return incise_error_set(&t->err, EINVAL,
				"the progress of an interrupted training is damaged; it "
				"is removed, start again");
}

/* Take over the surveys of the first sources; returns how many, or a negative errno. */
static int resume_surveys(struct training *t)
{
	const struct incise_corpus *corpus = t->trained->corpus;
	size_t size;
	const void *surveys = incise_progress_part(t->progress, PROGRESS_SURVEYS, &size);

	if (!surveys)
		return 0;
	if (incise_corpus_add(t->trained->corpus, surveys, size, &t->err) ||
	    incise_corpus_sources(corpus) > t->n)
		return fail_damaged(t);
	for (int i = 0; i < incise_corpus_sources(corpus); i++)
		incise_reader_resume(&t->sources[i], incise_corpus_source(corpus, i));
	return incise_corpus_sources(corpus);
}

/* The kept sums replace those without pairs, if they are of the same premises. */
static bool resume_factor(const struct training *t, enum incise_progress_part part,
			  struct incise_factor **factor)
{
	struct incise_factor_info wanted, found;
	struct incise_factor *kept;
	size_t size;
	const void *bytes = incise_progress_part(t->progress, part, &size);

	kept = bytes ? incise_factor_decode(bytes, size, "progress", NULL) : NULL;
	if (!kept)
		return false;
	incise_factor_info(*factor, &wanted);
	incise_factor_info(kept, &found);
	if (strcmp(wanted.premises, found.premises)) {
		incise_factor_free(kept);
		return false;
	}
	incise_factor_free(*factor);
	*factor = kept;
	return true;
}

static int resume_factors(struct training *t)
{
	if (resume_factor(t, PROGRESS_FIT, &t->trained->factor) && t->check &&
	    !resume_factor(t, PROGRESS_CHECK, &t->check))
		return fail_damaged(t);
	return 0;
}

/* --- the survey ---------------------------------------------------------------------- */

static int survey_source(struct training *t, int i)
{
	struct incise_reader *source = &t->sources[i];
	int rc;

	t->watch.step.source = i;
	rc = incise_reader_open(source, &t->err);
	if (!rc)
		rc = incise_corpus_survey(t->trained->corpus, &source->corpus, &t->err);
	if (!rc && t->progress && (i == t->n - 1 || incise_progress_due(t->progress)))
		keep_surveys(t);
	return rc;
}

/* Rows, ranges, groups, and the sample of all sources. */
static int survey_sources(struct training *t)
{
	const struct incise_sources_options *options = t->options;
	size_t sample = options->train.classic ? SIZE_MAX : options->train.tuned;
	struct incise_trained *trained = t->trained;
	const struct incise_corpus_side *fit, *check;
	int rc = 0, first;

	trained->corpus = incise_corpus_new(
		options->n_inputs, t->reading.group, options->train.seed,
		sample > INCISE_CORPUS_SAMPLE ? sample : INCISE_CORPUS_SAMPLE);
	if (!trained->corpus)
		return no_train_sources_memory(t);
	incise_corpus_keep(trained->corpus, t->reading.n_required, options->n_further);
	first = resume_surveys(t);
	if (first < 0)
		return first;
	begin_phase(t, INCISE_TRAIN_SURVEY, 0, READ);
	t->watch.step.resumed = first;
	if (first)
		incise_watch_ask(&t->watch);
	for (int i = first; i < t->n && !rc && !t->watch.stopped; i++)
		if (is_mine(t, i))
			rc = survey_source(t, i);
	t->reading.n_columns = t->reading.n_required;
	rc = agree_on_error(t, rc);
	if (!rc && t->ranks)
		rc = share_surveys(t);
	if (rc)
		return rc;
	rc = incise_corpus_settle(trained->corpus, options->check, &t->err);
	trained->shared = rc;
	if (rc)
		return name_error(t, rc);
	fit = incise_corpus_side(trained->corpus, false);
	check = incise_corpus_side(trained->corpus, true);
	trained->pairs = fit->rows;
	trained->check_pairs = check->rows;
	trained->repeated = fit->rows - fit->different + check->rows - check->different;
	for (int i = 0; i < incise_corpus_sources(trained->corpus); i++)
		trained->left_out += incise_corpus_source(trained->corpus, i)->left_out;
	return 0;
}

/* --- the sums ------------------------------------------------------------------------ */

static int make_factor(struct training *t, const struct incise_model *premises,
		       struct incise_factor **factor)
{
	incise_factor_free(*factor);
	*factor = premises ? incise_factor_new(premises, &t->err) : NULL;
	if (premises && !*factor)
		return name_error(t, -errno);
	if (*factor)
		incise_factor_set_options(*factor, t->how);
	return t->ranks ? share_premises(t, factor) : 0;
}

static bool has_source(const struct incise_factor *factor, const char *hash)
{
	struct incise_factor_info info;
	bool found = false;

	incise_factor_info(factor, &info);
	for (int i = 0; i < info.n_sources; i++)
		found |= !strcmp(info.sources[i].hash, hash);
	return found;
}

static int fold_source(struct training *t, int i)
{
	struct incise_trained *trained = t->trained;
	struct incise_reader *source = &t->sources[i];
	int rc;

	t->watch.step.source = i;
	if (has_source(trained->factor, source->hash))
		return 0;
	rc = incise_corpus_fold(trained->corpus, &source->corpus, trained->factor,
				t->check, &t->err);
	if (!rc && incise_progress_due(t->progress))
		keep_progress(t);
	return rc;
}

/* Premises are those of rank 0, and the sums are complete there. */
static int fold_sources(struct training *t, const struct incise_model *premises)
{
	struct incise_trained *trained = t->trained;
	struct incise_factor_info info;
	int rc;

	rc = make_factor(t, premises, &trained->factor);
	if (!rc && t->options->check > 0)
		rc = make_factor(t, premises, &t->check);
	if (!rc)
		rc = resume_factors(t);
	if (rc)
		return rc;
	incise_factor_info(trained->factor, &info);
	begin_phase(t, INCISE_TRAIN_ADD, trained->pairs + trained->check_pairs,
		    READ + 4 * pow(info.n_rules * (info.n_inputs + 1), 2));
	for (int i = 0; i < t->n && !rc && !t->watch.stopped; i++)
		if (is_mine(t, i))
			rc = fold_source(t, i);
	rc = agree_on_error(t, rc);
	if (!rc && t->ranks)
		rc = add_ranks(t, trained->factor);
	if (!rc && t->ranks && t->check)
		rc = add_ranks(t, t->check);
	/* The others are at their end. */
	trained->shared |= !rc;
	return rc;
}

/* Root mean square error of a model on a sample; never 0. */
static double find_scatter(const struct incise_model *model,
			   const struct incise_pairs *pairs)
{
	int d = pairs->n_inputs;
	double sum = 0, least = 0;

	for (size_t i = 0; i < pairs->n; i++) {
		const double *x = pairs->rows + i * (size_t)(d + 1);
		double e = incise_model_eval(model, x, NULL) - x[d];

		sum += e * e;
		least = fmax(least, fabs(x[d]));
	}
	return fmax(sqrt(sum / (double)pairs->n), 1e-9 * fmax(least, 1e-9));
}

/* One pass with the weights that follow from a model, which the model of the weights replaces. */
static int fold_pass(struct training *t, struct incise_model **model, double *scatter)
{
	const struct incise_factor_ridge ridge = {1e-3, 1};
	struct incise_uncertainty *uncertainty = NULL;
	struct incise_model *next = NULL;
	int rc = incise_propagation_start(t->propagation, *model, *scatter, &t->err);

	if (!rc)
		rc = fold_sources(t, *model);
	if (rc)
		return rc;
	next = incise_factor_solve(t->trained->factor, &ridge, NULL, &uncertainty,
				   &t->watch, &t->err);
	rc = next ? incise_propagation_end(t->propagation, next, uncertainty,
					   incise_factor_rmse(t->trained->factor, next,
							      NULL),
					   scatter, &t->err)
		  : -errno;
	incise_uncertainty_free(uncertainty);
	incise_model_free(*model);
	*model = next;
	return rc ? name_error(t, rc) : 0;
}

/* The sums of all pairs, of which those with weights are passed over several times. */
static int fold_passes(struct training *t, const struct incise_model *premises)
{
	struct incise_model *model;
	double scatter;
	int rc;

	if (!t->propagation)
		return fold_sources(t, premises);
	model = incise_model_copy(premises);
	rc = model ? 0 : no_train_sources_memory(t);
	scatter = find_scatter(
		premises, &incise_corpus_side(t->trained->corpus, false)->sample.pairs);
	for (int pass = 0; pass < PASSES && !rc; pass++)
		rc = fold_pass(t, &model, &scatter);
	incise_model_free(model);
	return rc;
}

/* --- the model ----------------------------------------------------------------------- */

static int find_sums(void *user, const struct incise_model *premises,
		     struct incise_factor **sums)
{
	struct training *t = user;
	int rc = fold_passes(t, premises);

	*sums = t->trained->factor;
	t->named = rc;
	return rc;
}

/* An error that is smaller by less does not pay for an input, or for functions. */
#define WORTH 0.95

/* Find the held-out errors of pairs of the sample with such functions. */
static int judge_grid(struct training *t, const struct incise_pairs *pairs,
		      const char *const *names, int *n_mfs, struct incise_choice *choice)
{
	struct incise_train_options options = t->options->train;
	struct incise_train_sums none = {.choice = choice};
	struct incise_model *model;
	int rc;

	options.groups = incise_corpus_side(t->trained->corpus, false)->sample.groups;
	model = incise_train_start(pairs, names, t->options->type, n_mfs, &options, NULL);
	rc = model ? incise_train_sample(model, pairs, NULL, &options, &none, NULL, NULL)
		   : -errno;
	incise_model_free(model);
	return rc;
}

/* Take few functions unless the others pay. */
static int choose_smooth(struct training *t, int *n_mfs)
{
	const struct incise_pairs *pairs =
		&incise_corpus_side(t->trained->corpus, false)->sample.pairs;
	struct incise_choice base = {0}, few = {0};
	int smooth[INCISE_MODEL_INPUTS_MAX] = {INCISE_TRAIN_MFS}, rc;

	for (int i = 1; i < INCISE_MODEL_INPUTS_MAX; i++)
		smooth[i] = INCISE_TRAIN_MFS - 1;
	rc = judge_grid(t, pairs, t->options->columns, n_mfs, &base);
	if (rc != -ECANCELED)
		rc = judge_grid(t, pairs, t->options->columns, smooth, &few);
	if (base.n_units && base.n_units == few.n_units &&
	    base.total > WORTH * WORTH * few.total)
		memcpy(n_mfs, smooth, sizeof(smooth));
	free(base.error);
	free(few.error);
	return rc == -ECANCELED ? rc : 0;
}

static int search_premises(struct training *t)
{
	const struct incise_corpus *corpus = t->trained->corpus;
	const struct incise_corpus_side *fit = incise_corpus_side(corpus, false);
	const struct incise_corpus_side *check = incise_corpus_side(corpus, true);
	struct incise_variable ranges[INCISE_MODEL_INPUTS_MAX + 1];
	double min[INCISE_MODEL_INPUTS_MAX + 1], max[INCISE_MODEL_INPUTS_MAX + 1];
	struct incise_train_sums sums = {find_sums, t, &t->errors,
					 t->options->n_parts > 0};
	struct incise_train_options options = t->options->train;
	int n_mfs[INCISE_MODEL_INPUTS_MAX];
	struct incise_trained *trained = t->trained;
	int rc;

	incise_corpus_ranges(corpus, min, max);
	for (int i = 0; i <= t->options->n_inputs; i++)
		ranges[i] = (struct incise_variable){.min = min[i], .max = max[i]};
	options.groups = fit->sample.groups;
	options.ranges = ranges;
	options.uncertainty = &trained->uncertainty;
	memcpy(n_mfs, t->options->n_mfs, sizeof(n_mfs));
	rc = t->options->smooth ? choose_smooth(t, n_mfs) : 0;
	if (rc)
		return rc;
	trained->model = incise_train_start(&fit->sample.pairs, t->options->columns,
					    t->options->type, n_mfs, &options, &t->err);
	if (!trained->model)
		return name_error(t, -errno);
	trained->initial = incise_model_copy(trained->model);
	if (!trained->initial)
		return no_train_sources_memory(t);
	rc = incise_train_sample(trained->model, &fit->sample.pairs,
				 check->sample.pairs.n ? &check->sample.pairs : NULL,
				 &options, options.classic ? NULL : &sums,
				 &trained->report, &t->err);
	return rc && !t->named ? name_training(t, rc) : rc;
}

/* The consequents of all pairs at given premises. */
static int solve_premises(struct training *t)
{
	const struct incise_factor_ridge ridge = {t->options->train.ridge, NAN};
	struct incise_trained *trained = t->trained;
	int rc = fold_passes(t, t->options->premises);

	if (rc || t->options->end == INCISE_TRAIN_TO_FACTOR)
		return rc;
	begin_phase(t, INCISE_TRAIN_SOLVE, 0, 0);
	trained->model = incise_factor_solve(trained->factor, &ridge, &trained->report,
					     &trained->uncertainty, &t->watch, &t->err);
	return trained->model ? 0 : name_training(t, -errno);
}

/* Put the calibrations into the standard deviation of the model. */
static int finish_weighted(struct training *t)
{
	struct incise_trained *trained = t->trained;
	double scatter;
	int rc;

	if (!t->propagation)
		return 0;
	rc = incise_propagation_end(t->propagation, trained->model, trained->uncertainty,
				    trained->report.train_rmse, &scatter, &t->err);
	if (!rc)
		rc = incise_propagation_finish(t->propagation, trained->uncertainty,
					       &trained->propagated, &t->err);
	return rc ? name_error(t, rc) : 0;
}

struct share {
	double inside, n;
};

static bool is_inside(const struct incise_trained *trained, const double *row, int target)
{
	double e = incise_model_eval(trained->model, row, NULL) - row[target];

	return fabs(e) <= INCISE_INTERVAL95 * incise_uncertainty_sd(trained->uncertainty,
								    trained->model, row);
}

/* Count the pairs: in all, by thirds of the first input, by group (of which there is room). */
static void count_inside(struct training *t, const struct incise_train_side *side,
			 double *first, struct share *third, struct share *group)
{
	const struct incise_pairs *pairs = &side->pairs;
	double n = incise_uncertainty_unknowns(t->trained->uncertainty);
	int width = pairs->n_inputs + 1;

	for (size_t i = 0; i < pairs->n; i++)
		first[i] = pairs->rows[i * width];
	qsort(first, pairs->n, sizeof(*first), ascending);
	for (size_t i = 0; i < pairs->n && !incise_watch_count(&t->watch, n * n); i++) {
		const double *x = pairs->rows + i * width;
		bool inside = is_inside(t->trained, x, width - 1);
		struct share *of[] = {&third[(*x >= first[pairs->n / 3]) +
					     (*x >= first[pairs->n * 2 / 3])],
				      &group[side->groups ? side->groups[i] : 0]};

		for (int k = 0; k < 2; k++) {
			of[k]->inside += inside;
			of[k]->n++;
		}
	}
}

/* The shares of the sample that is held out within its interval. */
static int find_coverage(struct training *t)
{
	const struct incise_train_side *side =
		&incise_corpus_side(t->trained->corpus, true)->sample;
	struct incise_trained *trained = t->trained;
	size_t n = side->pairs.n, most = 0;
	struct share third[3] = {{0}}, all = {0}, *group;
	double *first = malloc((n + 1) * sizeof(*first));

	for (size_t i = 0; i < n && side->groups; i++)
		most = side->groups[i] > (int)most ? (size_t)side->groups[i] : most;
	group = calloc(most + 1, sizeof(*group));
	if (first && group && n)
		count_inside(t, side, first, third, group);
	for (int k = 0; k < 3; k++) {
		trained->thirds[k] = third[k].inside / third[k].n;
		all.inside += third[k].inside;
		all.n += third[k].n;
	}
	trained->coverage = all.inside / all.n;
	trained->least = NAN;
	for (size_t g = 0; g <= most && group && side->groups; g++)
		if (group[g].n > 0)
			trained->least =
				fmin(trained->least, group[g].inside / group[g].n);
	free(group);
	free(first);
	return group && first ? 0 : no_train_sources_memory(t);
}

/* Notes of a model, also of a classic one, which has no factor; free(3), NULL: no memory. */
static char *make_notes(const struct training *t)
{
	const struct incise_corpus *corpus = t->trained->corpus;
	char *text = NULL;
	size_t size;
	FILE *out;

	if (t->trained->factor)
		return incise_factor_notes(t->trained->factor);
	out = open_memstream(&text, &size);
	if (!out)
		return NULL;
	fprintf(out, "version: %s\noptions: %s\n", incise_version(), t->how);
	for (int i = 0; i < t->n; i++) {
		const struct incise_corpus_survey *survey =
			incise_corpus_source(corpus, i);

		fprintf(out, "source: %s %llu pairs, %s\n", survey->hash,
			(unsigned long long)survey->rows, survey->text);
	}
	return fclose(out) ? NULL : text;
}

/* The mean error at both ends of the first input. */
static int find_bias(struct training *t)
{
	struct incise_trained *trained = t->trained;
	const struct incise_corpus *corpus = trained->corpus;
	bool unseen = incise_corpus_side(corpus, true)->sample.pairs.n > 0;
	const struct incise_pairs *pairs =
		&incise_corpus_side(corpus, unseen)->sample.pairs;
	size_t width = pairs->n_inputs + 1, tail = (pairs->n - 1) / 20;
	double *sorted = malloc(pairs->n * sizeof(*sorted));
	double error[2] = {0}, output[2] = {0};

	if (!sorted)
		return no_train_sources_memory(t);
	for (size_t i = 0; i < pairs->n; i++)
		sorted[i] = pairs->rows[i * width];
	qsort(sorted, pairs->n, sizeof(*sorted), ascending);
	trained->end[0] = sorted[tail];
	trained->end[1] = sorted[pairs->n - 1 - tail];
	free(sorted);
	for (size_t i = 0; i < pairs->n; i++) {
		const double *x = pairs->rows + i * width;
		double e = incise_model_eval(trained->model, x, NULL) - x[width - 1];

		for (int high = 0; high < 2; high++)
			if (high ? *x >= trained->end[1] : *x <= trained->end[0]) {
				error[high] += e;
				output[high] += x[width - 1];
			}
	}
	for (int high = 0; high < 2; high++)
		trained->end_bias[high] = error[high] / fabs(output[high]);
	return 0;
}

/* The pairs of the sample that the ranges of the model leave out. */
static uint64_t count_clamped(const struct training *t)
{
	const struct incise_pairs *fit =
		&incise_corpus_side(t->trained->corpus, false)->sample.pairs;
	const struct incise_model *model =
		t->options->premises ? t->options->premises : t->trained->model;
	const struct incise_model_info *info = incise_model_info(model);
	uint64_t n = 0;

	for (size_t i = 0; i < fit->n; i++) {
		const double *x = fit->rows + i * (fit->n_inputs + 1);
		bool outside = false;

		for (int k = 0; k < fit->n_inputs; k++)
			outside |= x[k] < info->input[k].min || x[k] > info->input[k].max;
		n += outside;
	}
	return n;
}

/* Find what a report says about the model. */
static int judge_model(struct training *t)
{
	struct incise_trained *trained = t->trained;
	const struct incise_corpus_side *fit = incise_corpus_side(trained->corpus, false);
	const struct incise_corpus_side *check =
		incise_corpus_side(trained->corpus, true);
	struct incise_factor_info info;
	int rc = finish_weighted(t);

	if (rc)
		return rc;
	begin_phase(t, INCISE_TRAIN_SOLVE, 0, 0);
	if (t->check) {
		trained->report.check_rmse = incise_factor_rmse(
			t->check, trained->model, &trained->report.check_r2);
		incise_factor_info(t->check, &info);
		trained->check_outside = trained->check_pairs - info.rows;
	}
	trained->noise = incise_uncertainty_noise(trained->uncertainty);
	rc = find_coverage(t);
	if (!rc)
		rc = find_bias(t);
	if (rc || t->watch.stopped)
		return rc ? rc : -ECANCELED;
	if (incise_baselines(&fit->sample.pairs, fit->sample.groups,
			     &(check->sample.pairs.n ? check : fit)->sample.pairs,
			     t->watch.progress, t->watch.user, &trained->baselines,
			     &t->err))
		return name_error(t, -t->err.code);
	trained->notes = make_notes(t);
	return trained->notes ? 0 : no_train_sources_memory(t);
}

/* --- further inputs ------------------------------------------------------------------ */

/*
 * Whether a gain is beyond chance: few groups with large errors decide its sum, so the number of groups
 * that gain counts, too.
 */
static bool is_clear(const struct incise_choice *base, const struct incise_choice *with)
{
	int n = base->n_units, gaining = 0;

	for (int u = 0; u < n; u++)
		gaining += with->error[u] < base->error[u];
	return gaining > 0.5 * n + sqrt(n) &&
	       with->total < fmin(WORTH * WORTH * base->total,
				  base->total - incise_crossval_spread(n, with->error,
								       base->error));
}

/* Find the held-out errors of both inputs and further one i, on the same pairs and folds. */
static int judge_further(struct training *t, int i, struct incise_choice *choice)
{
	const struct incise_train_side *fit =
		&incise_corpus_side(t->trained->corpus, false)->sample;
	const char *const *columns = t->options->columns;
	const char *names[] = {columns[0], columns[1], columns[t->reading.n_required + i],
			       columns[2]};
	int n_mfs[] = {INCISE_TRAIN_MFS, INCISE_TRAIN_MFS, INCISE_TRAIN_MFS};
	double *rows = incise_corpus_extend(t->trained->corpus, i);
	struct incise_pairs pairs = {rows, fit->pairs.n, 3, NULL};
	int rc = rows ? judge_grid(t, &pairs, names, n_mfs, choice) : -ENOMEM;

	free(rows);
	return rc;
}

/* Find the best further input; one that cannot be judged is none. */
static int try_further(struct training *t)
{
	struct incise_trained *trained = t->trained;
	const struct incise_choice *base = &t->errors;
	double best = base->total;
	int rc = 0;

	for (int i = 0; i < t->options->n_further && rc != -ECANCELED; i++) {
		struct incise_choice with = {0};

		rc = judge_further(t, i, &with);
		if (with.n_units == base->n_units && with.total < best &&
		    is_clear(base, &with)) {
			best = with.total;
			trained->better = t->options->columns[t->reading.n_required + i];
			trained->better_rmse =
				trained->report.crossval_rmse * sqrt(best / base->total);
		}
		free(with.error);
	}
	return rc == -ECANCELED ? rc : 0;
}

/* --- all of it ----------------------------------------------------------------------- */

static int train_all(struct training *t)
{
	const struct incise_sources_options *options = t->options;
	int rc;

	if (t->ranks && (options->n_parts || options->train.classic))
		return incise_error_set(
			&t->err, EINVAL,
			"weights and classic trainings are of one process");
	rc = survey_sources(t);
	if (rc || options->end == INCISE_TRAIN_TO_CORPUS)
		return rc;
	if (options->n_parts) {
		t->propagation = incise_propagation_new(options->n_inputs, options->parts,
							options->n_parts, &t->err);
		if (!t->propagation)
			return -errno;
		incise_corpus_weigh(t->trained->corpus, t->propagation);
	}
	if (!is_first(t))
		return fold_sources(t, NULL);
	rc = options->premises ? solve_premises(t) : search_premises(t);
	if (!rc)
		t->trained->clamped = count_clamped(t);
	if (!rc && options->end == INCISE_TRAIN_TO_MODEL)
		rc = judge_model(t);
	if (!rc && t->trained->group && t->errors.n_units >= CROSSVAL_FOLDS)
		rc = try_further(t);
	return rc;
}

int incise_train_sources(struct incise_train_source *sources, int n,
			 const struct incise_sources_options *options,
			 struct incise_trained *trained, struct incise_error *err)
{
	struct training t = {
		.options = options,
		.ranks = options->ranks,
		.trained = trained,
		.n = n,
		.reading = {.columns = options->columns,
			    .n_required = options->n_inputs + 1 + options->n_parts,
			    .where = options->all_rows ? NULL : "advancing",
			    .watch = &t.watch},
		.watch = incise_watch_of(&options->train),
	};
	int rc;

	*trained = (struct incise_trained){0};
	if (options->n_further < 0 || options->n_further > INCISE_TRAIN_FURTHER_MAX ||
	    (options->n_further && options->n_inputs != 2))
		return incise_error_set(
			err, EINVAL,
			"%d further inputs beside %d: expected at most %d "
			"beside 2",
			options->n_further, options->n_inputs, INCISE_TRAIN_FURTHER_MAX);
	t.reading.n_columns = t.reading.n_required + options->n_further;
	t.sources = incise_readers_new(sources, n, options->group, &t.reading);
	t.how = describe_options(&t);
	rc = t.sources && t.how ? 0 : no_train_sources_memory(&t);
	trained->group = t.reading.group;
	if (!rc)
		t.progress = open_progress(&t);
	if (!rc)
		rc = train_all(&t);
	/* A search counts for itself. */
	if (t.watch.stopped || rc == -ECANCELED)
		rc = incise_error_set(&t.err, ECANCELED, "training was stopped");
	free(t.errors.error);
	incise_progress_close(t.progress, rc == -ECANCELED);
	incise_propagation_free(t.propagation);
	incise_factor_free(t.check);
	incise_readers_free(t.sources, n);
	free(t.how);
	return rc ? incise_error_set(err, -rc, "%s", t.err.text) : 0;
}

int incise_train_factors(const char *const *paths, int n, double ridge,
			 enum incise_train_end end, struct incise_trained *trained,
			 struct incise_error *err)
{
	const struct incise_factor_ridge wanted = {ridge, NAN};
	int rc = 0;

	*trained = (struct incise_trained){0};
	for (int i = 0; i < n && !rc; i++) {
		struct incise_factor *more = incise_factor_load(paths[i], err);

		if (trained->factor)
			rc = add_sums(trained->factor, more, paths[i], err);
		else if (!(trained->factor = more))
			rc = -errno;
	}
	if (rc || end == INCISE_TRAIN_TO_FACTOR)
		return rc;
	trained->model = incise_factor_solve(trained->factor, &wanted, &trained->report,
					     &trained->uncertainty, NULL, err);
	if (!trained->model)
		return -errno;
	trained->notes = incise_factor_notes(trained->factor);
	return trained->notes ? 0 : incise_error_set(err, ENOMEM, "no memory to train");
}

void incise_trained_free(struct incise_trained *trained)
{
	incise_model_free(trained->model);
	incise_model_free(trained->initial);
	incise_uncertainty_free(trained->uncertainty);
	incise_factor_free(trained->factor);
	incise_corpus_free(trained->corpus);
	free(trained->notes);
	*trained = (struct incise_trained){0};
}
