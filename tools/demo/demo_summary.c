// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What incise demo found: what the model is worth, beside what the paper says, and all of it
 * as summary.txt and summary.json.
 */
#include <math.h>
#include <stdlib.h>
#include <incise/fixed.h>
#include <incise/sim.h>
#include <incise/version.h>
#include "../cli/cli.h"
#include "demo.h"
#include "../cli/json.h"
#include "../cli/file.h"

/* What the paper reports after 80 epochs, §4.3. Its data are not published. */
#define PAPER_MSE_TRAIN 0.036
#define PAPER_MSE_CHECK 0.0804

json_t *demo_summary_begin(long seed)
{
	return json_pack("{ss sI ss s{sf sf}}", "version", incise_version(), "seed",
			 (json_int_t)seed, "note",
			 "virtual liver: the paper's data are not published", "paper",
			 "mse_train", PAPER_MSE_TRAIN, "mse_check", PAPER_MSE_CHECK);
}

/* ---- what the model is worth ---- */

#define GRID 400

/* Largest difference of the two arithmetics on a grid over the support, N. */
static double fixed_difference(const struct incise_model *model, double *bound)
{
	const struct incise_model_info *info = incise_model_info(model);
	struct incise_error err = {0};
	struct incise_fixed *fixed = incise_fixed_compile(model, NULL, &err);
	double largest = 0;

	if (!fixed)
		cli_fail_with(&err);
	for (int i = 0; i <= GRID; i++)
		for (int j = 0; j <= GRID; j++) {
			const struct incise_variable *d = &info->input[0];
			const struct incise_variable *v = &info->input[1];
			double x[] = {d->min + (d->max - d->min) * i / GRID,
				      v->min + (v->max - v->min) * j / GRID};

			largest = fmax(largest, fabs(incise_model_eval(model, x, NULL) -
						     incise_fixed_eval_double(fixed, x)));
		}
	*bound = incise_fixed_bound(fixed);
	incise_fixed_free(fixed);
	return largest;
}

/* RMSE of the model against the virtual tissue's mean force, at the averaged pairs. */
static double truth_error(const struct demo *demo, const struct incise_model *model)
{
	static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_dataset *pairs = demo_dataset(demo, "pairs.csv", columns, 3, NULL);
	size_t n = incise_dataset_rows(pairs);
	struct incise_sim_config config;
	double sum = 0;

	incise_sim_config_init(&config);
	for (size_t i = 0; i < n; i++) {
		const double *row = incise_dataset_row(pairs, i);
		double e = incise_model_eval(model, row, NULL) -
			   incise_sim_mean_force(&config, row[0], row[1]);

		sum += e * e / n;
	}
	incise_dataset_free(pairs);
	return sqrt(sum);
}

void demo_worth(struct demo *demo, const struct incise_model *model)
{
	double bound, difference = fixed_difference(model, &bound);

	json_object_set_new(demo->summary, "fixed_point",
			    json_pack("{sf sf si}", "max_difference_N", difference,
				      "bound_N", bound, "points",
				      (GRID + 1) * (GRID + 1)));
	json_object_set_new(demo->summary, "truth_rmse_N",
			    json_number(truth_error(demo, model)));
}

/* ---- both forms ---- */

void demo_summary_print(const struct demo *demo, FILE *out, double seconds)
{
	const json_t *capture = json_object_get(demo->summary, "capture");
	const json_t *halves = json_object_get(demo->summary, "train_random_halves");
	const json_t *unseen = json_object_get(demo->summary, "train_unseen_cuts");
	const json_t *lines = json_object_get(unseen, "baselines");
	const json_t *haptic = json_object_get(demo->summary, "haptic");
	char *late50 = demo_quantile_us(haptic, "lateness_us", "median", 1);
	char *late999 = demo_quantile_us(haptic, "lateness_us", "p999", 1);
	char *tick50 = demo_quantile_us(haptic, "tick_ns", "median", 1e-3);
	char *tick999 = demo_quantile_us(haptic, "tick_ns", "p999", 1e-3);

	fprintf(out,
		"incise demo, version %s, virtual rig with seed %ld\n\n"
		"recording          %.1f s, %.0f force samples, %.0f lost, %.0f clipped\n"
		"pairs              %.0f, averaged over depth and velocity as in paper 1, "
		"section 4.1\n\n"
		"Random halves, as the paper does it (classic ANFIS, 20 rules, 80 epochs). Its data "
		"are\nnot published and ours are of a virtual liver: the figures compare in kind, "
		"not in value.\n"
		"                         training      check\n"
		"  MSE here / N^2     %12.5f %10.5f\n"
		"  MSE in the paper   %12.5f %10.5f   (its unit is not stated)\n\n"
		"By unseen cuts, ridge and epochs by cross-validation, RMSE / N:\n"
		"  this model         %12.4f %10.4f\n"
		"  mean                            %10.4f\n"
		"  linear regression               %10.4f\n"
		"  nearest neighbours              %10.4f\n\n"
		"model against the tissue's true mean force   %.4f N rms at the pairs\n"
		"model against a new cut at 5 mm              %.4f N rms\n"
		"fixed point against double                   %.4f mN largest of %d points, "
		"certified to %.4f mN\n\n"
		"haptic loop        %.0f ticks at %g Hz, %.0f skipped (%s)\n"
		"  lateness         median %s, 99.9 %% %s, largest %.0f us\n"
		"  tick             median %s, 99.9 %% %s\n"
		"  force            largest %.3f N, actuator off by %.4f N rms\n\n"
		"took               %.0f s\n",
		incise_version(), demo->seed, demo_number(capture, "seconds", NULL),
		demo_number(capture, "force", NULL),
		demo_number(capture, "force_lost", NULL) +
			demo_number(capture, "tracker_lost", NULL),
		demo_number(capture, "force_clipped", NULL),
		demo_number(halves, "pairs", NULL),
		demo_number(halves, "train", "mse_N2"),
		demo_number(halves, "check", "mse_N2"), PAPER_MSE_TRAIN, PAPER_MSE_CHECK,
		demo_number(unseen, "train", "rmse_N"),
		demo_number(unseen, "check", "rmse_N"),
		demo_number(lines, "mean", "rmse_N"),
		demo_number(lines, "linear", "rmse_N"),
		demo_number(lines, "knn", "rmse_N"),
		demo_number(demo->summary, "truth_rmse_N", NULL),
		demo_number(demo->summary, "new_cut_rmse_N", NULL),
		demo_number(demo->summary, "fixed_point", "max_difference_N") * 1e3,
		(GRID + 1) * (GRID + 1),
		demo_number(demo->summary, "fixed_point", "bound_N") * 1e3,
		demo_number(haptic, "ticks", NULL), demo_number(haptic, "rate_hz", NULL),
		demo_number(haptic, "skipped", NULL),
		json_string_value(json_object_get(haptic, "scheduling")), late50, late999,
		demo_number(haptic, "lateness_us", "max"), tick50, tick999,
		demo_number(haptic, "force_max_N", NULL),
		demo_number(haptic, "rendered_rms_error_N", NULL), seconds);
	free(late50), free(late999), free(tick50), free(tick999);
}

void demo_summary_save(const struct demo *demo, double seconds)
{
	char *json = demo_path(demo, "summary.json");
	char *txt = demo_path(demo, "summary.txt");
	struct incise_outfile *file;

	json_dumpf(demo->summary, whole_file_begin(json, &file),
		   JSON_INDENT(2) | JSON_REAL_PRECISION(12));
	whole_file_end(file);
	demo_summary_print(demo, whole_file_begin(txt, &file), seconds);
	whole_file_end(file);
	free(json);
	free(txt);
}
