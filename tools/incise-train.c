// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise train DATA.csv -o MODEL.fis: learn a fuzzy force model, and say whether it is
 * better than simpler predictors.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/dataset.h>
#include <incise/train.h>
#include "cli/cli.h"
#include "train/train_report.h"
#include "train/train_wish.h"
#include "cli/file.h"

struct history {
	FILE *csv; /* or NULL */
	int epochs;
};

static void on_epoch(void *user, int epoch, double train_rmse, double check_rmse)
{
	struct history *history = user;

	cli_progress("epoch %d of %d: training error %.6g", epoch, history->epochs,
		     train_rmse);
	if (!history->csv)
		return;
	fprintf(history->csv, "%d,%.17g,", epoch, train_rmse);
	if (!isnan(check_rmse))
		fprintf(history->csv, "%.17g", check_rmse);
	fputc('\n', history->csv);
}

/*
 * Training takes time: a place that cannot be written is told before, not after. The data
 * themselves are no such place.
 */
static void check_writable(const struct train_wish *wish, const char *path)
{
	struct incise_outfile *file;
	struct stat data, out;

	if (!path)
		return;
	if (!stat(wish->data, &data) && !stat(path, &out) && data.st_dev == out.st_dev &&
	    data.st_ino == out.st_ino && S_ISREG(out.st_mode))
		cli_fail("%s: is the data to train from; give another file to write",
			 path);
	/* A pipe's reader would take the trial for the end. */
	if (!stat(path, &out) && !S_ISREG(out.st_mode) && !S_ISDIR(out.st_mode))
		return;
	whole_file_begin(path, &file);
	incise_outfile_abort(file);
}

static void judge_interval(struct train_interval *interval,
			   const struct incise_model *model,
			   const struct incise_train_side *check)
{
	size_t inside = 0;

	interval->noise = incise_uncertainty_noise(interval->uncertainty);
	interval->coverage = NAN;
	for (size_t i = 0; check && i < check->pairs.n; i++) {
		const double *x = check->pairs.rows + i * (check->pairs.n_inputs + 1);
		double e = incise_model_eval(model, x, NULL) - x[check->pairs.n_inputs];
		double sd = incise_uncertainty_sd(interval->uncertainty, model, x);

		inside += fabs(e) <= INCISE_INTERVAL95 * sd;
	}
	if (check)
		interval->coverage = (double)inside / check->pairs.n;
}

/* Beside the model, unless that is no file; a name of its own would be a surprise there. */
static void save_uncertainty(const struct train_interval *interval, const char *model)
{
	struct incise_error err = {0};
	struct stat st;
	char *path;

	if (!strcmp(model, "-") || stat(model, &st) || !S_ISREG(st.st_mode))
		return;
	if (asprintf(&path, "%s.sd", model) < 0)
		cli_fail("%s: no memory for its standard deviation", model);
	if (incise_uncertainty_save(interval->uncertainty, path, &err))
		cli_fail_with(&err);
	free(path);
}

static void train(struct train_wish *wish, struct incise_model *model,
		  struct train_result *result)
{
	const struct incise_train_side *check = result->check;
	struct incise_error err = {0};
	struct incise_outfile *file = NULL;
	struct history history = {.epochs = wish->train.epochs};

	if (wish->history) {
		history.csv = whole_file_begin(wish->history, &file);
		fprintf(history.csv, "epoch,train_rmse,check_rmse\n");
	}
	wish->train.progress = on_epoch;
	wish->train.user = &history;
	wish->train.uncertainty = &result->interval.uncertainty;
	if (incise_train(model, &result->fit->pairs, check ? &check->pairs : NULL,
			 &wish->train, &result->report, &err)) {
		incise_outfile_abort(file);
		cli_fail("%s: %s", wish->data, err.text);
	}
	cli_progress_end();
	judge_interval(&result->interval, model, check);
	whole_file_end(file);
}

int main(int argc, char **argv)
{
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1];
	struct incise_train_side fit = {0}, check = {0};
	struct train_wish wish;
	struct train_result result = {.wish = &wish, .fit = &fit};
	struct incise_error err = {0};
	struct incise_dataset *data;
	struct incise_model *model;
	json_t *warned;

	train_wish_take(&wish, argc, argv);
	for (int i = 0; i < wish.n_inputs; i++)
		columns[i] = wish.inputs[i];
	columns[wish.n_inputs] = wish.output;
	check_writable(&wish, wish.model);
	check_writable(&wish, wish.initial);
	check_writable(&wish, wish.history);
	data = incise_dataset_read(wish.data, columns, wish.n_inputs + 1, wish.group,
				   &err);
	if (!data)
		cli_fail_with(&err);
	if (incise_train_split(data, wish.check, wish.train.seed, &fit, &check, &err))
		cli_fail("%s: %s", wish.data, err.text);
	result.check = wish.check > 0 ? &check : NULL;
	wish.train.groups = fit.groups;
	if (wish.auto_mfs)
		wish.mfs[0] = 0;
	result.model = model = incise_train_start(&fit.pairs, columns, wish.type,
						  wish.mfs, &wish.train, &err);
	if (!model)
		cli_fail("%s: %s", wish.data, err.text);
	if (wish.initial && incise_model_save(model, wish.initial, &err))
		cli_fail_with(&err);
	train(&wish, model, &result);
	if (incise_baselines(&fit.pairs, fit.groups,
			     &(result.check ? &check : &fit)->pairs, &result.baselines,
			     &err))
		cli_fail("%s: %s", wish.data, err.text);
	if (incise_model_save(model, wish.model, &err))
		cli_fail_with(&err);
	save_uncertainty(&result.interval, wish.model);
	warned = train_warnings(&result);
	if (wish.json)
		train_report_json(&result, warned);
	else if (strcmp(wish.model, "-"))
		train_report_text(&result);
	if (!wish.json)
		json_decref(warned);
	cli_finish();
	incise_model_free(model);
	incise_uncertainty_free(result.interval.uncertainty);
	incise_dataset_free(data);
	incise_train_side_free(&fit);
	incise_train_side_free(&check);
	return 0;
}
