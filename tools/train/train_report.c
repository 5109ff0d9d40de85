// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What came of training; see train_report.h.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "train_report.h"

/* A model is worse than a baseline when its error is this much larger: below it, another
 * split may turn the order round. */
#define WORSE 1.02

/* Pairs per parameter below which a model follows noise rather than tissue. */
#define PAIRS_PER_PARAMETER 3

/* The unit of a column, from its name: force_N is in N. */
static const char *unit_of(const char *column)
{
	const char *score = strrchr(column, '_');

	return score ? score + 1 : "";
}

static json_t *error_object(const struct train_wish *wish, double rmse, double r2,
			    size_t pairs)
{
	const char *unit = unit_of(wish->output);
	json_t *object = json_object();
	char key[80];

	snprintf(key, sizeof(key), "rmse%s%s", *unit ? "_" : "", unit);
	json_object_set_new(object, key, json_number(rmse));
	if (!pairs)
		return object;
	snprintf(key, sizeof(key), "mse%s%s%s", *unit ? "_" : "", unit, *unit ? "2" : "");
	json_object_set_new(object, key, json_number(rmse * rmse));
	json_object_set_new(object, "r2", json_number(r2));
	json_object_set_new(object, "pairs", json_integer(pairs));
	return object;
}

/* What a person should know before using the model; printed, and kept for JSON. */
static void warn(json_t *list, const char *fmt, ...) INCISE_PRINTF(2, 3);
static void warn(json_t *list, const char *fmt, ...)
{
	char text[300];
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	cli_warn("%s", text);
	json_array_append_new(list, json_string(text));
}

json_t *train_warnings(const struct train_result *result)
{
	const struct train_wish *wish = result->wish;
	const struct incise_model *model = result->model;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const size_t pairs = result->fit->pairs.n;
	const double rmse = result->check ? report->check_rmse : report->train_rmse;
	const struct {
		const char *name;
		double rmse;
	} others[] = {
		{"the mean", baselines->mean},
		{"linear regression", baselines->linear},
		{"k nearest neighbours", baselines->knn},
	};
	/* In the classic way the check data have chosen the epoch: they were seen. */
	const char *data = !wish->check		 ? "its own"
			   : wish->train.classic ? "the check"
						 : "unseen";
	const struct incise_variable *out = &incise_model_info(model)->output;
	/* Rounding of a double, some hundred times over, is no error worth a word. */
	double rounding = 1e-13 * fmax(fabs(out->min), fabs(out->max));
	json_t *list = json_array();

	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++)
		if (rmse > WORSE * others[i].rmse && rmse > rounding)
			warn(list,
			     "%s predicts %s data better than this model: RMSE %.4g against "
			     "%.4g; try fewer rules or more data",
			     others[i].name, data, others[i].rmse, rmse);
	if (report->rules_unfired)
		warn(list,
		     "%d of %d rules never fire in the data: the model is a guess there; "
		     "ask for fewer membership functions or record more",
		     report->rules_unfired, incise_model_info(model)->n_rules);
	if (pairs < (size_t)PAIRS_PER_PARAMETER * report->parameters)
		warn(list,
		     "%zu training pairs for %d parameters: the model can follow noise; at "
		     "least %d pairs support %d rules",
		     pairs, report->parameters, PAIRS_PER_PARAMETER * report->parameters,
		     incise_model_info(model)->n_rules);
	return list;
}

void train_report_json(const struct train_result *result, json_t *warned)
{
	const struct train_wish *wish = result->wish;
	const struct incise_model *model = result->model;
	const struct incise_train_side *fit = result->fit, *check = result->check;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const struct train_interval *interval = &result->interval;
	json_t *object = json_object(), *unfired = json_array(), *mfs = json_array();
	const char *unit = unit_of(wish->output);
	char key[80];

	json_object_set_new(object, "pairs",
			    json_integer(fit->pairs.n + (check ? check->pairs.n : 0)));
	json_object_set_new(object, "train",
			    error_object(wish, report->train_rmse, report->train_r2,
					 fit->pairs.n));
	json_object_set_new(object, "check",
			    check ? error_object(wish, report->check_rmse,
						 report->check_r2, check->pairs.n)
				  : json_null());
	json_object_set_new(object, "baselines",
			    json_pack("{sososo}", "mean",
				      error_object(wish, baselines->mean, 0, 0), "linear",
				      error_object(wish, baselines->linear, 0, 0), "knn",
				      error_object(wish, baselines->knn, 0, 0)));
	json_object_set_new(object, "knn_k", json_integer(baselines->k));
	json_object_set_new(object, "train_groups", json_integer(fit->n_groups));
	json_object_set_new(object, "check_groups",
			    json_integer(check ? check->n_groups : 0));
	json_object_set_new(object, "rules",
			    json_integer(incise_model_info(model)->n_rules));
	json_object_set_new(object, "parameters", json_integer(report->parameters));
	json_object_set_new(object, "epochs", json_integer(report->epochs));
	json_object_set_new(object, "best_epoch", json_integer(report->best_epoch));
	json_object_set_new(object, "ridge", json_number(report->ridge));
	json_object_set_new(object, "condition", json_number(report->condition));
	json_object_set_new(object, "rules_unfired", json_integer(report->rules_unfired));
	for (int r = 0; r < incise_model_info(model)->n_rules; r++)
		if (report->unfired[r])
			json_array_append_new(unfired, json_integer(r + 1));
	json_object_set_new(object, "unfired_rules", unfired);
	for (int i = 0; i < wish->n_inputs; i++)
		json_array_append_new(mfs, json_integer(wish->mfs[i]));
	json_object_set_new(object, "mf", mfs);
	json_object_set_new(object, "start", json_integer(report->start));
	json_object_set_new(object, "pairs_tuned", json_integer(report->pairs_tuned));
	snprintf(key, sizeof(key), "crossval_rmse%s%s", *unit ? "_" : "", unit);
	json_object_set_new(object, key, json_number(report->crossval_rmse));
	snprintf(key, sizeof(key), "noise%s%s", *unit ? "_" : "", unit);
	json_object_set_new(object, key, json_number(interval->noise));
	json_object_set_new(object, "interval95_coverage",
			    json_number(interval->coverage));
	json_object_set_new(object, "warnings", warned);
	json_object_set_new(object, "model", json_string(wish->model));
	json_print(object);
}

static void print_row(const char *name, double train, double check)
{
	printf("  %-22s", name);
	isnan(train) ? printf("%12s", "") : printf("%12.5g", train);
	isnan(check) ? printf("\n") : printf("%14.5g\n", check);
}

void train_report_text(const struct train_result *result)
{
	const struct train_wish *wish = result->wish;
	const struct incise_model *model = result->model;
	const struct incise_train_side *fit = result->fit, *check = result->check;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const struct train_interval *interval = &result->interval;
	const char *unseen = wish->train.classic ? "check"
			     : wish->group	 ? "unseen cuts"
						 : "unseen pairs";
	char knn[40];

	printf("%s: %zu pairs to train", wish->data, fit->pairs.n);
	if (wish->group)
		printf(" (%d cuts)", fit->n_groups);
	if (check)
		printf(", %zu to check", check->pairs.n);
	if (check && wish->group)
		printf(" (%d cuts)", check->n_groups);
	printf("\n%d rules, %d parameters, %d epochs (kept %d), ridge %g, condition %.2g\n",
	       incise_model_info(model)->n_rules, report->parameters, report->epochs,
	       report->best_epoch, report->ridge, report->condition);
	printf("  %-22s%12s%14s\n", "RMSE", "training", check ? unseen : "");
	print_row("this model", report->train_rmse, report->check_rmse);
	snprintf(knn, sizeof(knn), "%d nearest", baselines->k);
	print_row("mean", check ? NAN : baselines->mean, check ? baselines->mean : NAN);
	print_row("linear regression", check ? NAN : baselines->linear,
		  check ? baselines->linear : NAN);
	print_row(knn, check ? NAN : baselines->knn, check ? baselines->knn : NAN);
	printf("  %-22s%12.5g", "MSE of this model",
	       report->train_rmse * report->train_rmse);
	check ? printf("%14.5g\n", report->check_rmse * report->check_rmse)
	      : printf("\n");
	print_row("R² of this model", report->train_r2, report->check_r2);
	printf("  95 %% interval: noise %.4g %s", interval->noise, unit_of(wish->output));
	if (check)
		printf(", holds %.1f %% of the %s", 100 * interval->coverage, unseen);
	printf("\n");
	if (report->pairs_tuned && report->pairs_tuned < fit->pairs.n)
		printf("  membership functions from a random %zu of the pairs, consequents "
		       "from all\n",
		       report->pairs_tuned);
	if (strcmp(wish->model, "-"))
		printf("wrote %s\n", wish->model);
}
