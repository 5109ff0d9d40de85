// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise info FILE: what a model or a recording holds.
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/recording.h>
#include "cli.h"
#include "json.h"

enum { OPT_JSON = CLI_LONG };

static const struct cli_option options[] = {
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_verb verb = {
	.name = "info",
	.synopsis = "MODEL.fis|NAME.rec [OPTIONS]",
	.summary = "Say what a model or a recording holds.",
	.options = options,
	.notes = "Exit: 0 shown, 1 failed, 2 bad usage. See incise-info(1).",
};

static json_t *input_json(const struct incise_model *model, int i)
{
	const struct incise_variable *v = incise_model_input(model, i);
	json_t *mfs = json_array();

	for (int k = 0; k < incise_model_n_mfs(model, i); k++) {
		const struct incise_mf *mf = incise_model_mf(model, i, k);
		json_t *params = json_array();

		for (int j = 0; j < incise_mf_n_params(mf->type); j++)
			json_array_append_new(params, json_real(mf->p[j]));
		json_array_append_new(
			mfs, json_pack("{so ss so}", "name", json_text(mf->name), "type",
				       incise_mf_type_name(mf->type), "params", params));
	}
	return json_pack("{so sf sf so}", "name", json_text(v->name), "min", v->min,
			 "max", v->max, "mfs", mfs);
}

/* As .fis files spell it. */
static const char *and_method(const struct incise_model *model)
{
	return incise_model_and_method(model) == INCISE_AND_MIN ? "min" : "prod";
}

static void model_json(const struct incise_model *model, const char *refused)
{
	const struct incise_variable *out = incise_model_output(model);
	json_t *inputs = json_array(), *rules = json_array();

	for (int i = 0; i < incise_model_n_inputs(model); i++)
		json_array_append_new(inputs, input_json(model, i));
	for (int r = 0; r < incise_model_n_rules(model); r++) {
		json_t *mfs = json_array(), *p = json_array();

		for (int i = 0; i < incise_model_n_inputs(model); i++)
			json_array_append_new(
				mfs, json_integer(incise_model_rule_mf(model, r, i) + 1));
		for (int i = 0; i <= incise_model_n_inputs(model); i++)
			json_array_append_new(
				p, json_real(incise_model_consequent(model, r)[i]));
		json_array_append_new(
			rules, json_pack("{so so sf}", "mfs", mfs, "consequent", p,
					 "weight", incise_model_rule_weight(model, r)));
	}
	json_print(json_pack(
		"{ss so so s{so sf sf} ss so sb so}", "kind", "model", "name",
		json_text(incise_model_name(model)), "inputs", inputs, "output", "name",
		json_text(out->name), "min", out->min, "max", out->max, "and_method",
		and_method(model), "rules", rules, "fixed_point", !refused,
		"fixed_point_refused", refused ? json_text(refused) : json_null()));
}

static void model_text(const struct incise_model *model, const char *refused)
{
	const struct incise_variable *v = incise_model_output(model);
	int n = incise_model_n_inputs(model);

	printf("model %s: %d rules, %d inputs, output %s (%g to %g in the data)\n",
	       incise_model_name(model), incise_model_n_rules(model), n, v->name, v->min,
	       v->max);
	for (int i = 0; i < n; i++) {
		v = incise_model_input(model, i);
		printf("input %s, support %g to %g\n", v->name, v->min, v->max);
		for (int k = 0; k < incise_model_n_mfs(model, i); k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			printf("  %-10s %s", mf->name, incise_mf_type_name(mf->type));
			for (int j = 0; j < incise_mf_n_params(mf->type); j++)
				printf(" %.6g", mf->p[j]);
			putchar('\n');
		}
	}
	printf("rules by %s (functions: constant, then a coefficient per input)\n",
	       and_method(model));
	for (int r = 0; r < incise_model_n_rules(model); r++) {
		const double *p = incise_model_consequent(model, r);

		printf(" ");
		for (int i = 0; i < n; i++)
			printf(" %2d", incise_model_rule_mf(model, r, i) + 1);
		printf(":");
		for (int i = 0; i <= n; i++)
			printf(" %12.6g", p[i]);
		if (incise_model_rule_weight(model, r) != 1)
			printf("  weight %.6g", incise_model_rule_weight(model, r));
		putchar('\n');
	}
	printf("fixed point: %s\n", refused ? refused : "fits");
}

static void show_model(const char *path, bool json)
{
	struct incise_error err = {0}, refused = {0};
	struct incise_model *model = incise_model_load(path, &err);
	struct incise_fixed *fixed;

	if (!model)
		cli_fail_with(&err);
	fixed = incise_fixed_compile(model, NULL, &refused);
	incise_fixed_free(fixed);
	if (json)
		model_json(model, refused.code ? refused.text : NULL);
	else
		model_text(model, refused.code ? refused.text : NULL);
	incise_model_free(model);
}

static void recording_json(const struct incise_recording_info *info)
{
	json_print(json_pack(
		"{ss sb sf so so s{sI sI sI} s{sI sI} sI s{si sf} s{sf so sf} si sf sf}",
		"kind", "recording", "complete", info->complete, "seconds",
		(info->end_ns - info->start_ns) * 1e-9, "started",
		json_text(info->started), "rig", json_text(info->rig), "rows", "force",
		(json_int_t)info->force, "tracker", (json_int_t)info->tracker, "depth",
		(json_int_t)info->depth, "lost", "force", (json_int_t)info->force_lost,
		"tracker", (json_int_t)info->tracker_lost, "force_clipped",
		(json_int_t)info->force_clipped, "adc", "bits", info->bits,
		"full_scale_V", info->full_scale_V, "calibration", "force_mV_N",
		info->force_mV_N, "force_zero_mV", json_number(info->zero_mV),
		"depth_mm_px", info->depth_mm_px, "cuts", info->cuts, "depth_max_mm",
		info->depth_max_mm, "force_max_N", info->force_max_N));
}

static void recording_text(const char *path, const struct incise_recording_info *info)
{
	printf("recording %s: %.1f s, started %s, rig %s\n", path,
	       (info->end_ns - info->start_ns) * 1e-9, info->started, info->rig);
	if (!info->complete)
		printf("incomplete: its capture was interrupted; readable up to the last commit\n");
	printf("force    %llu samples, %llu lost, %llu clipped; %d bits over %g V\n",
	       (unsigned long long)info->force, (unsigned long long)info->force_lost,
	       (unsigned long long)info->force_clipped, info->bits, info->full_scale_V);
	printf("tracker  %llu records, %llu lost\n", (unsigned long long)info->tracker,
	       (unsigned long long)info->tracker_lost);
	printf("depth    %llu rows, largest %.2f mm; largest force %.3f N\n",
	       (unsigned long long)info->depth, info->depth_max_mm, info->force_max_N);
	printf("calibration  %g mV/N, zero %.1f mV, %g mm/px\n", info->force_mV_N,
	       info->zero_mV, info->depth_mm_px);
	printf("cuts     %d\n", info->cuts);
}

static void show_recording(const char *path, bool json)
{
	struct incise_recording_info info;
	struct incise_error err = {0};
	struct incise_recording *recording = incise_recording_open(path, &err);

	if (!recording || incise_recording_info(recording, &info, &err))
		cli_fail_with(&err);
	if (json)
		recording_json(&info);
	else
		recording_text(path, &info);
	incise_recording_close(recording);
}

/* A recording is a folder, or would be one: NAME.rec whose .part is all there is. */
static bool is_recording(const char *path)
{
	size_t n = strlen(path);
	struct stat st;

	while (n > 1 && path[n - 1] == '/')
		n--;
	if (!stat(path, &st))
		return S_ISDIR(st.st_mode);
	return n >= 4 && !strncmp(path + n - 4, ".rec", 4);
}

static void check_exists(const char *path)
{
	struct stat st;

	if (strcmp(path, "-") && stat(path, &st))
		cli_fail("%s: %s; give a model (.fis) or a recording (NAME.rec)", path,
			 strerror(errno));
}

int main(int argc, char **argv)
{
	bool json = false;
	int opt;

	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		if (opt == OPT_JSON)
			json = true;
	if (optind + 1 != argc)
		cli_usage("expected one file, got %d", argc - optind);
	if (is_recording(argv[optind]))
		show_recording(argv[optind], json);
	else
		check_exists(argv[optind]), show_model(argv[optind], json);
	cli_finish();
	return 0;
}
