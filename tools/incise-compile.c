// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise compile MODEL.fis -o MODEL.fx, SCENE -o NAME.plan: a model, or all of a scene on a rig, in
 * integers, with a certified bound of its error.
 */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/plan_file.h>
#include "cli/calibration.h"
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/plan_report.h"
#include "cli/scene_argument.h"

struct compile_job {
	const char *output, *c_source, *rig, *calibration;
	bool json;
	struct incise_fixed_options options;
	struct scene_argument scene;
};

static const struct cli_unit newtons[] = {
	{"N", 1}, {"mN", 1e-3}, {"uN", 1e-6}, {"µN", 1e-6}, {0}};

static void parse_method(void *member, char *text)
{
	struct incise_fixed_options *options = member;
	char *colon = strchr(text, ':');
	const char *names[INCISE_FIXED_FORCE - INCISE_FIXED_DIRECT + 2] = {NULL};

	for (int a = INCISE_FIXED_DIRECT; a <= INCISE_FIXED_FORCE; a++)
		names[a - INCISE_FIXED_DIRECT] = incise_fixed_arithmetic_name(a);
	if (colon)
		*colon++ = '\0';
	options->arithmetic = INCISE_FIXED_DIRECT + cli_choice("method", text, names);
	if (colon)
		options->cells = (int)cli_integer("method", colon, 1, 4096);
}

/* "out/pig liver.c" makes pig_liver, a C name of the file's own: free(3). */
static char *symbol_of(const char *path)
{
	const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
	char *symbol = cli_text("%.*s", (int)strcspn(name, "."), name);

	for (char *c = symbol; *c; c++)
		if (!isalnum((unsigned char)*c) || (unsigned char)*c >= 0x80)
			*c = '_';
	if (!*symbol || isdigit((unsigned char)*symbol))
		cli_usage("--output: '%s' makes no name in C; begin the file's name "
			  "with a letter",
			  path);
	return symbol;
}

static void check_c_source(void *c_source, char *path)
{
	(void)c_source;
	free(symbol_of(path));
}

static const struct cli_option options[] = {
	{'o', "output", "FILE.fx|NAME.plan",
	 "write the compiled model or scene; - is standard output",
	 CLI_OUTPUT(struct compile_job, output), .extensions = ".fx .plan"},
	{'o', "output", "FILE.c",
	 "also write it as C for a microcontroller, with a function FILE_eval",
	 CLI_OUTPUT(struct compile_job, c_source), .parse = check_c_source,
	 .extensions = ".c"},
	{0, "budget", "ERROR",
	 "largest certified error, for example 0.1mN, 50uN or 1e-4 in the output's "
	 "unit (default: 0.1mN)",
	 CLI_QUANTITY(struct compile_job, options.budget, newtons, 1e-9, 1e9)},
	{0, "method", "KIND[:CELLS]",
	 "direct, table or force (default: the cheapest within the budget); of "
	 "tables with at least so many cells per input, up to 4096",
	 CLI_PARSED(struct compile_job, options, parse_method)},
	{0, "model", "FILE", "scene: use this model instead of its own",
	 CLI_INPUT(struct compile_job, scene.model)},
	{'r', "rig", "RIG",
	 "scene: rig.conf with the tracker and the actuators of the plan (default: "
	 "a tracker of 120 Hz and no actuator, which no kernel loads)",
	 CLI_INPUT(struct compile_job, rig)},
	CALIBRATION_OPTION(struct compile_job, calibration),
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct compile_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "compile",
	.synopsis = "MODEL.fis|SCENE -o MODEL.fx|NAME.plan [OPTIONS]",
	.summary =
		"Compile a model, or a whole scene on a rig, to fixed point for the "
		"haptic loop and for kernels, with a certified bound of the error, over "
		"the whole training range by interval arithmetic.",
	.options = options,
	.notes = "--budget, --method and -o FILE.c go with a model.",
	.examples = "incise compile liver.fis --budget 0.1mN -o liver.fx\n"
		    "incise compile neck --rig rig.conf -o neck.plan",
};

static void write_c(const struct incise_fixed *fx, const char *path)
{
	struct incise_error err = {0};
	char *symbol = symbol_of(path);

	cli_check(incise_fixed_write_c(fx, path, symbol, &err), &err);
	free(symbol);
}

static void report_compile(const struct incise_fixed *fx, const char *model,
			   const char *path, bool json)
{
	const char *name = incise_fixed_arithmetic_name(fx->arithmetic);
	json_t *cells = json_array();

	for (int i = 0; i < fx->n_inputs; i++)
		json_array_append_new(cells, json_integer(fx->input[i].cells));
	if (json) {
		json_print(json_pack("{so so ss so si sf}", "model", json_text(model),
				     "output", json_text(path), "arithmetic", name,
				     "cells", cells, "size_bytes", fx->size, "bound_N",
				     incise_fixed_bound(fx)));
		return;
	}
	json_decref(cells);
	if (!strcmp(path, "-"))
		return;
	printf("%s: %s", model, name);
	for (int i = 0; i < fx->n_inputs && fx->input[i].cells; i++)
		printf(i ? " x %d" : ", %d", fx->input[i].cells);
	printf("%s, %u bytes; error certified to %.3g mN\n",
	       fx->input[0].cells ? " cells" : "", fx->size,
	       incise_fixed_bound(fx) * 1e3);
	cli_written();
}

static void compile_model(const struct compile_job *job, const char *path)
{
	struct incise_error err = {0};
	struct incise_model *model = cli_require(incise_model_load(path, &err), &err);
	struct incise_fixed *fx = incise_fixed_compile(model, &job->options, &err);

	if (!fx)
		cli_fail("%s: %s", path, err.text);
	cli_check(incise_fixed_save(fx, job->output, &err), &err);
	if (job->c_source)
		write_c(fx, job->c_source);
	report_compile(fx, path, job->output, job->json);
	incise_fixed_free(fx);
	incise_model_free(model);
}

/* --- scenes --------------------------------------------------------------------------- */

/* Only to watch: a loop may drive the actuators. */
static struct incise_rig *open_rig(const char *spec)
{
	return cli_open_rig(spec,
			    INCISE_RIG_TRACKER | INCISE_RIG_STEPPER | INCISE_RIG_WATCH);
}

static void compile_scene(const struct compile_job *job)
{
	struct incise_rig *rig = job->rig ? open_rig(job->rig) : NULL;
	struct calibration_used calibration;
	struct incise_plan_file_info info;
	struct incise_error err = {0};
	struct incise_plan_file *file;
	struct incise_scene *scene;
	struct incise_plan *plan;

	calibration_use(&calibration, job->calibration, job->rig);
	scene = scene_argument_load(&job->scene);
	plan = cli_require(incise_plan_new(scene, rig, &err), &err);
	if (incise_plan_set_tip(plan, calibration.values.tip_mm))
		cli_fail("%s: tip_mm is too far from the tracked point; run incise "
			 "calibrate tip",
			 calibration.path);
	file = cli_require(incise_plan_file_new(plan, &err), &err);
	cli_check(incise_plan_file_save(file, job->output, &err), &err);
	incise_plan_file_info(file, &info);
	if (job->json) {
		json_print(plan_report_json(&info));
	} else if (strcmp(job->output, "-")) {
		plan_report_text(&info);
		printf("calibration %s\n", calibration_text(&calibration));
		cli_written();
	}
	if (!info.n_axes)
		cli_warn("the plan has no actuator; give --rig for one that the kernel "
			 "loads");
	incise_plan_file_free(file);
	incise_plan_free(plan);
	incise_scene_free(scene);
	incise_rig_close(rig);
}

static bool is_of_model(const struct compile_job *job)
{
	struct incise_fixed_options usual;

	incise_fixed_options_init(&usual);
	return job->c_source || job->options.budget != usual.budget ||
	       job->options.arithmetic != usual.arithmetic ||
	       job->options.cells != usual.cells;
}

int main(int argc, char **argv)
{
	struct compile_job job = {.scene.arith = "fixed"};
	const char *path;
	struct incise_fixed_options usual;
	bool found; /* a scene, by its path or name */

	incise_fixed_options_init(&job.options);
	incise_fixed_options_init(&usual);
	cli_parse(&command, argc, argv, &job);
	path = cli_operand(argc, argv, "MODEL.fis or SCENE", "model or scene to compile");
	if (!job.output || !*job.output)
		cli_usage(
			"missing -o FILE (output: MODEL.fx of a model, NAME.plan of a scene)");
	if (job.json && !strcmp(job.output, "-"))
		cli_usage("--json and -o - would both write to standard output");
	found = !cli_ends_with(path, ".fis") && scene_argument_find(&job.scene, path);
	file_expect(found ? job.scene.path : path, FILE_MODEL | FILE_SCENE);
	if (!found || file_kind_of(path) == FILE_MODEL) {
		if (!cli_ends_with(path, ".fis") && cli_ends_with(job.output, ".plan"))
			cli_fail("%s: no such file or scene", path);
		if (job.rig || job.calibration || job.scene.model)
			cli_usage("%s: --rig, --calibration and --model go with a "
				  "scene, this is a model",
				  path);
		cli_extension("output", job.output, ".fx");
		if (job.options.budget > 100 * usual.budget)
			cli_warn("--budget: an error of %g N, %.3g times the default of "
				 "%g mN; a number without a unit is newtons",
				 job.options.budget, job.options.budget / usual.budget,
				 usual.budget * 1e3);
		compile_model(&job, path);
	} else {
		if (is_of_model(&job))
			cli_usage("%s: --budget, --method and -o FILE.c go "
				  "with a model, this is a scene",
				  path);
		cli_extension("output", job.output, ".plan");
		compile_scene(&job);
	}
	cli_finish();
	return 0;
}
