// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise info FILE: describes a model, a compiled model, a recording or a controller of the
 * stepper module, or lists the drives on a bus.
 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/factor.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/recalibration.h>
#include <incise/recording.h>
#include <incise/rig.h>
#include <incise/scan.h>
#include <incise/scene.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/joined_report.h"
#include "cli/json.h"
#include "cli/keys.h"
#include "cli/plan_report.h"
#include "cli/proof_report.h"
#include "cli/recording.h"
#include "cli/scene_argument.h"
#include "cli/stream_report.h"
#include "cli/texture_report.h"
#include "cli/wall_report.h"
#include "stepper/module.h"
#include "train/sources.h"

struct info_job {
	bool json, all, damaged, dataset, all_rows;
	const char *group, *target;
	char *inputs[INCISE_MODEL_INPUTS_MAX];
	int n_inputs;
};

static void parse_inputs(void *whole, char *text)
{
	struct info_job *job = whole;

	job->n_inputs = cli_list("inputs", text, job->inputs, INCISE_MODEL_INPUTS_MAX);
}

static const struct cli_option options[] = {
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct info_job, json)},
	{0, "all", NULL,
	 "rig, scene: also the keys that the file leaves out, with their defaults",
	 CLI_FLAG(struct info_job, all)},
	RECORDING_DAMAGED(struct info_job, damaged),
	{0, "dataset", NULL,
	 "describe DATA.csv and NAME.rec as training data: rows, ranges, and "
	 "groups that differ from the others",
	 CLI_FLAG(struct info_job, dataset)},
	{0, "group", "GROUP",
	 "dataset: recording, rig, or a column that names the groups (default: "
	 "cut, where all sources have it), or none",
	 CLI_TEXT(struct info_job, group)},
	{0, "inputs", "A,B", "dataset: input columns (default: depth_mm,velocity_mm_s)",
	 CLI_PARSED_BY(parse_inputs)},
	{0, "target", "COLUMN", "dataset: column to learn (default: force_N)",
	 CLI_TEXT(struct info_job, target)},
	{0, "all-rows", NULL, "dataset: also rows in which the blade did not advance",
	 CLI_FLAG(struct info_job, all_rows)},
	{0},
};

static const struct cli_command command = {
	.name = "info",
	.synopsis =
		"MODEL.fis|MODEL.fx|MODEL.fis.tex|NAME.plan|NAME.fac|NAME.rec|NAME.scene|rig.conf|rig|stepper|"
		"/dev/incise-stepperN|can:IFACE|"
		"slcan:TTY|devices|DATA.csv… [OPTIONS]",
	.summary =
		"Describe a model, a compiled model, a texture, a compiled scene, a factor, a "
		"recording, a scene or a rig; the state and cost of the kernel's stepper module; the drives "
		"on a CAN bus; or the devices that are attached.",
	.options = options,
	.examples = "incise info can:can0",
};

/* --- models -------------------------------------------------------------------------- */

static json_t *input_json(const struct incise_model *model, int i)
{
	const struct incise_model_info *info = incise_model_info(model);
	const struct incise_variable *v = &info->input[i];
	json_t *mfs = json_array();

	for (int k = 0; k < info->n_mfs[i]; k++) {
		const struct incise_mf *mf = incise_model_mf(model, i, k);

		json_array_append_new(
			mfs,
			json_pack("{so ss so}", "name", json_text(mf->name), "type",
				  incise_mf_type_name(mf->type), "params",
				  json_numbers(mf->p, incise_mf_n_params(mf->type))));
	}
	return json_pack("{so sf sf so}", "name", json_text(v->name), "min", v->min,
			 "max", v->max, "mfs", mfs);
}

/* As .fis files spell it. */
static const char *and_method(const struct incise_model *model)
{
	return incise_model_info(model)->and_method == INCISE_AND_MIN ? "min" : "prod";
}

/* Cells per input; empty if the arithmetic has none. */
static json_t *cells_json(const struct incise_fixed *fx)
{
	json_t *cells = json_array();

	for (int i = 0; i < fx->n_inputs && fx->input[i].cells; i++)
		json_array_append_new(cells, json_integer(fx->input[i].cells));
	return cells;
}

/* "table, 316 x 362 cells, 21148 bytes, error certified to 0.059 mN" */
static void put_fixed(const struct incise_fixed *fx)
{
	printf("%s", incise_fixed_arithmetic_name(fx->arithmetic));
	for (int i = 0; i < fx->n_inputs && fx->input[i].cells; i++)
		printf(i ? " x %d" : ", %d", fx->input[i].cells);
	printf("%s, %u bytes, error certified to %.3g mN\n",
	       fx->input[0].cells ? " cells" : "", fx->size,
	       incise_fixed_bound(fx) * 1e3);
}

/* The model at the default budget; keys are null if that is refused. */
static void add_fixed_json(json_t *report, const struct incise_fixed *fx,
			   const char *refused)
{
	json_object_set_new(report, "fixed_point", json_boolean(fx != NULL));
	json_object_set_new(report, "fixed_point_refused",
			    fx ? json_null() : json_string(refused));
	json_object_set_new(report, "fixed_point_arithmetic",
			    fx ? json_string(incise_fixed_arithmetic_name(fx->arithmetic))
			       : json_null());
	json_object_set_new(report, "fixed_point_cells",
			    fx ? cells_json(fx) : json_null());
	json_object_set_new(report, "fixed_point_size_bytes",
			    fx ? json_integer(fx->size) : json_null());
	json_object_set_new(report, "fixed_point_bound_N",
			    fx ? json_number(incise_fixed_bound(fx)) : json_null());
}

/* Each line of the notes. */
static json_t *notes_json(const char *notes)
{
	json_t *list = json_array();

	for (size_t n; *notes; notes += n + (notes[n] == '\n')) {
		char *line;

		n = strcspn(notes, "\n");
		line = cli_text("%.*s", (int)n, notes);
		json_array_append_new(list, json_text(line));
		free(line);
	}
	return list;
}

static void model_json(const struct incise_model *model, const struct incise_fixed *fx,
		       const char *refused, const char *notes,
		       const struct incise_texture *texture)
{
	const struct incise_model_info *info = incise_model_info(model);
	const struct incise_variable *out = &info->output;
	json_t *inputs = json_array(), *rules = json_array(), *report;

	for (int i = 0; i < info->n_inputs; i++)
		json_array_append_new(inputs, input_json(model, i));
	for (int r = 0; r < info->n_rules; r++) {
		const struct incise_rule *rule = incise_model_rule(model, r);
		json_t *mfs = json_array();

		for (int i = 0; i < info->n_inputs; i++)
			json_array_append_new(mfs, json_integer(rule->mf[i] + 1));
		json_array_append_new(rules,
				      json_pack("{so so sf}", "mfs", mfs, "consequent",
						json_numbers(rule->p, info->n_inputs + 1),
						"weight", rule->weight));
	}
	report = json_pack("{ss so so s{so sf sf} ss so}", "kind", "model", "name",
			   json_text(info->name), "inputs", inputs, "output", "name",
			   json_text(out->name), "min", out->min, "max", out->max,
			   "and_method", and_method(model), "rules", rules);
	json_object_set_new(report, "notes", notes_json(notes));
	add_fixed_json(report, fx, refused);
	json_object_set_new(report, "texture", texture_json(texture));
	json_print(report);
}

static void model_text(const struct incise_model *model, const struct incise_fixed *fx,
		       const char *refused, const char *notes)
{
	const struct incise_model_info *info = incise_model_info(model);
	const struct incise_variable *v = &info->output;
	int n = info->n_inputs;

	printf("model %s: %s, %s, output %s (%g to %g in the data)\n", info->name,
	       cli_count(info->n_rules, "rule"), cli_count(n, "input"), v->name, v->min,
	       v->max);
	for (size_t k; *notes; notes += k + (notes[k] == '\n')) {
		k = strcspn(notes, "\n");
		printf("%.*s\n", (int)k, notes);
	}
	for (int i = 0; i < n; i++) {
		v = &info->input[i];
		printf("input %s, support %g to %g\n", v->name, v->min, v->max);
		for (int k = 0; k < info->n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			printf("  %-10s %s", mf->name, incise_mf_type_name(mf->type));
			for (int j = 0; j < incise_mf_n_params(mf->type); j++)
				printf(" %.6g", mf->p[j]);
			putchar('\n');
		}
	}
	printf("rules by %s (functions: constant, then one coefficient for each "
	       "input)\n",
	       and_method(model));
	for (int r = 0; r < info->n_rules; r++) {
		const double *p = incise_model_rule(model, r)->p;

		printf(" ");
		for (int i = 0; i < n; i++)
			printf(" %2d", incise_model_rule(model, r)->mf[i] + 1);
		printf(":");
		for (int i = 0; i <= n; i++)
			printf(" %12.6g", p[i]);
		if (incise_model_rule(model, r)->weight != 1)
			printf("  weight %.6g", incise_model_rule(model, r)->weight);
		putchar('\n');
	}
	if (fx) {
		printf("fixed point: ");
		put_fixed(fx);
	} else {
		puts(refused);
	}
}

/* The texture beside a model, or NULL; a damaged one is a warning. */
static struct incise_texture *texture_beside(const char *path,
					     const struct incise_model *model)
{
	char *tex = cli_text("%s.tex", path);
	struct incise_texture *texture = NULL;
	struct incise_error err = {0};

	if (!access(tex, F_OK) && !(texture = incise_texture_load(tex, model, &err)))
		cli_warn("%s", err.text);
	free(tex);
	return texture;
}

static void show_texture(const char *path, bool json)
{
	struct incise_error err = {0};
	struct incise_texture *texture =
		cli_require(incise_texture_load(path, NULL, &err), &err);

	if (json)
		json_print(json_pack("{ss so}", "kind", "texture", "texture",
				     texture_json(texture)));
	else
		texture_print(texture);
	incise_texture_free(texture);
}

static void show_model(const char *path, bool json)
{
	struct incise_error err = {0}, refused = {0};
	struct incise_texture *texture;
	struct incise_model *model;
	struct incise_fixed *fixed;
	struct stat st;
	char *notes;

	model = cli_require(incise_model_load(path, &err), &err);
	/* A pipe has been read. */
	notes = !stat(path, &st) && S_ISREG(st.st_mode)
			? cli_require(incise_model_notes(path, &err), &err)
			: cli_text("%s", "");
	fixed = incise_fixed_compile(model, NULL, &refused);
	texture = texture_beside(path, model);
	if (json)
		model_json(model, fixed, refused.text, notes, texture);
	else
		model_text(model, fixed, refused.text, notes);
	if (texture && !json)
		texture_print(texture);
	incise_texture_free(texture);
	free(notes);
	incise_fixed_free(fixed);
	incise_model_free(model);
}

static void compiled_json(const struct incise_fixed *fx)
{
	json_t *inputs = json_array();

	for (int i = 0; i < fx->n_inputs; i++) {
		const struct incise_fixed_input *in = &fx->input[i];

		json_array_append_new(
			inputs, json_pack("{so sf sf si}", "name", json_text(in->name),
					  "min", in->min / (double)INCISE_FIXED_ONE,
					  "max", in->max / (double)INCISE_FIXED_ONE,
					  "n_mfs", (int)in->n_mfs));
	}
	json_print(json_pack("{ss so so s{so} si ss so s[ii] si sf}", "kind", "compiled",
			     "name", json_text(fx->name), "inputs", inputs, "output",
			     "name", json_text(fx->output), "n_rules", (int)fx->n_rules,
			     "arithmetic", incise_fixed_arithmetic_name(fx->arithmetic),
			     "cells", cells_json(fx), "format_bits", (int)fx->shift_a,
			     (int)fx->shift_b, "size_bytes", (int)fx->size, "bound_N",
			     incise_fixed_bound(fx)));
}

/* Print the values that the two formats of an arithmetic hold; see lib/fixed/layout.h. */
static void put_formats(const struct incise_fixed *fx)
{
	static const char *const of[][2] = {
		[INCISE_FIXED_DIRECT] = {"consequents", "rule outputs"},
		[INCISE_FIXED_TABLE] = {"outputs", "slopes"},
		[INCISE_FIXED_FORCE] = {"outputs", NULL},
	};
	const char *const *names = of[fx->arithmetic];
	bool both =
		names[1] && !(fx->arithmetic == INCISE_FIXED_TABLE && fx->n_inputs == 1);

	printf("formats  inputs and output Q16.16, %s Q%d", names[0], fx->shift_a);
	if (both)
		printf(", %s Q%d", names[1], fx->shift_b);
	putchar('\n');
}

static void compiled_text(const struct incise_fixed *fx)
{
	printf("compiled model %s: %s, %s, output %s\n", fx->name,
	       cli_count(fx->n_rules, "rule"), cli_count(fx->n_inputs, "input"),
	       fx->output);
	for (int i = 0; i < fx->n_inputs; i++) {
		const struct incise_fixed_input *in = &fx->input[i];

		printf("input %s, support %.10g to %.10g, %s", in->name,
		       in->min / (double)INCISE_FIXED_ONE,
		       in->max / (double)INCISE_FIXED_ONE,
		       cli_count(in->n_mfs, "function"));
		if (in->cells)
			printf(", %s of %g", cli_count(in->cells, "cell"),
			       (double)(1u << in->cell_shift) / INCISE_FIXED_ONE);
		putchar('\n');
	}
	put_formats(fx);
	printf("fixed point: ");
	put_fixed(fx);
}

static void show_compiled(const char *path, bool json)
{
	struct incise_error err = {0};
	struct incise_fixed *fx = cli_require(incise_fixed_load(path, &err), &err);

	if (json)
		compiled_json(fx);
	else
		compiled_text(fx);
	incise_fixed_free(fx);
}

/* --- plans ---------------------------------------------------------------------------- */

static void show_plan(const char *path, bool json)
{
	struct incise_error err = {0};
	struct incise_plan_file *file =
		cli_require(incise_plan_file_load(path, &err), &err);
	struct incise_plan_file_info info;

	incise_plan_file_info(file, &info);
	if (json)
		json_print(plan_report_json(&info));
	else
		plan_report_text(&info);
	incise_plan_file_free(file);
}

/* --- recordings ---------------------------------------------------------------------- */

/* Whether a recording has a stream; in format 1 all have force and tracker. */
static bool has_stream(const struct incise_recording_info *info, const char *name)
{
	for (int i = 0; i < info->n_streams; i++)
		if (!strcmp(info->streams[i].name, name))
			return true;
	return !info->n_streams;
}

static json_t *adc_json(const struct incise_recording_info *info)
{
	return json_pack("{si sf sf sb}", "bits", info->bits, "full_scale_V",
			 info->full_scale_V, "offset_V", info->offset_V, "newtons",
			 info->newtons);
}

/* The codec of its frames; "": it has none, or they cannot be read. */
static const char *camera_codec(struct incise_recording *recording)
{
	struct incise_frame_reader *reader = incise_frame_reader_new(recording, NULL);
	const char *codec = reader ? incise_frame_reader_codec(reader) : NULL;

	incise_frame_reader_free(reader);
	return codec ? codec : "";
}

static void recording_json(const struct incise_recording_info *info, const char *codec,
			   bool intact, const struct incise_wall *wall, json_t *members,
			   json_t *calibrations, json_t *seals)
{
	bool force = has_stream(info, "force"), tracker = has_stream(info, "tracker");

	json_print(json_pack(
		"{so so so so so sb sb so ss sb sf so so s{sI sI sI} s{sI sI} sI so s{so so so} so so so}",
		"camera_codec", json_text_or_null(codec), "seals", seals, "calibrations",
		calibrations, "wall",
		wall ? wall_json(wall, info->start_ns, info->end_ns) : json_null(),
		"members", members, "intact", intact, "summary", info->summary, "streams",
		stream_json(info->streams, info->n_streams), "kind", "recording",
		"complete", info->complete, "seconds",
		(info->end_ns - info->start_ns) * 1e-9, "started",
		json_text(info->started), "rig", json_text(info->rig), "rows", "force",
		(json_int_t)info->force, "tracker", (json_int_t)info->tracker, "depth",
		(json_int_t)info->depth, "lost", "force", (json_int_t)info->force_lost,
		"tracker", (json_int_t)info->tracker_lost, "force_clipped",
		(json_int_t)info->force_clipped, "adc",
		force ? adc_json(info) : json_null(), "calibration", "force_mV_N",
		force ? json_number(info->force_mV_N) : json_null(), "force_zero_mV",
		json_number(info->zero_mV), "depth_mm_px", json_number(info->depth_mm_px),
		"cuts", tracker ? json_integer(info->cuts) : json_null(), "depth_max_mm",
		tracker ? json_number(info->depth_max_mm) : json_null(), "force_max_N",
		force && tracker ? json_number(info->force_max_N) : json_null()));
}

/* Add the calibrations of a recording, or of a member, to a list. */
static void add_calibrations(json_t *to, const char *path, const char *member)
{
	struct incise_recalibration *list;
	struct incise_error err = {0};
	char *folder = *member ? cli_text("%s/%s", path, member) : cli_text("%s", path);
	int n = incise_recalibrations(folder, &list, &err);

	cli_check(n < 0, &err);
	for (int i = 0; i < n; i++) {
		const struct incise_recalibration *at = &list[i];
		char *file = cli_text("%s%s%s", member, *member && *at->file ? "/" : "",
				      at->file);

		json_array_append_new(
			to,
			json_pack("{so so sb so sb}", "file", json_text_or_null(file),
				  "date", json_text_or_null(at->date), "original",
				  at->original || !i, "sha256",
				  json_text_or_null(at->sha256), "active", at->active));
		free(file);
	}
	free(list);
	free(folder);
}

static json_t *calibrations_json(const char *path,
				 const struct incise_session_info *members, int n)
{
	char *folder = file_without_choice(path);
	json_t *list = json_array();

	if (!n)
		add_calibrations(list, path, "");
	for (int i = 0; i < n; i++)
		add_calibrations(list, folder, members[i].name);
	free(folder);
	return list;
}

/* Nothing for a recording that was never recalibrated. */
static void calibrations_text(json_t *list)
{
	size_t i;
	json_t *at;

	json_array_foreach(list, i, at)
	{
		const char *file = json_string_value(json_object_get(at, "file"));
		const char *sha = json_string_value(json_object_get(at, "sha256"));

		if (json_array_size(list) == 1)
			break;
		printf("  %s %s%s%s\n",
		       json_is_true(json_object_get(at, "active")) ? "*" : " ",
		       file ? file : "of the capture", sha ? ", SHA-256 " : "",
		       sha ? sha : "");
	}
	json_decref(list);
}

static void force_text(const struct incise_recording_info *info)
{
	char unit = info->newtons ? 'N' : 'V';

	printf("force    %s, %llu lost, %llu clipped; %d bits over %g %c",
	       cli_count(info->force, "sample"), (unsigned long long)info->force_lost,
	       (unsigned long long)info->force_clipped, info->bits, info->full_scale_V,
	       unit);
	if (info->offset_V != 0)
		printf(" from %g %c", info->offset_V, unit);
	putchar('\n');
}

static void recording_text(const char *path, const struct incise_recording_info *info,
			   const char *codec, const struct incise_wall *wall,
			   json_t *calibrations, const struct incise_proof *proof)
{
	bool tracker = has_stream(info, "tracker");

	printf("recording %s: %.1f s, started %s, rig %s\n", path,
	       (info->end_ns - info->start_ns) * 1e-9, info->started, info->rig);
	if (!info->complete)
		printf("incomplete: its capture was interrupted; readable up to the last commit\n");
	if (has_stream(info, "force"))
		force_text(info);
	if (tracker) {
		printf("tracker  %llu samples, %llu lost\n",
		       (unsigned long long)info->tracker,
		       (unsigned long long)info->tracker_lost);
		printf("depth    %llu rows, largest %.2f mm",
		       (unsigned long long)info->depth, info->depth_max_mm);
		if (has_stream(info, "force"))
			printf("; largest force %.3f N", info->force_max_N);
		putchar('\n');
	}
	if (*codec)
		printf("camera   frames in %s%s\n", codec,
		       strcmp(codec, "mjpeg") ? ", lossless" : ", of the camera");
	fputs("calibration  ", stdout);
	if (has_stream(info, "force"))
		printf("%g mV/N, zero %.1f mV, ", info->force_mV_N, info->zero_mV);
	printf("%g mm/px\n", info->depth_mm_px);
	calibrations_text(calibrations);
	if (tracker)
		printf("cuts     %d\n", info->cuts);
	if (wall)
		wall_text(wall, info->start_ns, info->end_ns);
	else
		puts("wall time  none");
	proof_print_heads(proof);
	if (info->summary)
		printf("samples  not read: 'incise verify %s' proves them\n", path);
	stream_table(info->streams, info->n_streams);
}

static void show_recording(const char *path, bool json, bool damaged)
{
	const struct incise_prove_options listed = {.level = INCISE_PROVE_SEALS};
	struct incise_recording_info info;
	struct incise_proof proof;
	struct incise_error err = {0};
	const struct incise_session_info *members = NULL;
	char *any = cli_text("%s:*", path);
	/* A joined recording is described without a choice of its machines too. */
	struct incise_recording *recording = incise_recording_open(any, NULL);
	struct incise_wall *wall;
	const char *codec;
	bool intact;
	int n;

	if (!recording)
		recording = recording_open(path);
	free(any);
	n = incise_session_members(recording, &members);

	cli_check(incise_recording_info(recording, &info, &err), &err);
	wall = incise_recording_wall(recording, &err);
	if (!wall && err.code != ENODATA)
		cli_fail_with(&err);
	err = (struct incise_error){0};
	codec = camera_codec(recording);
	cli_check(incise_prove(path, &listed, &proof, &err), &err);
	intact = recording_intact(path, !info.summary, damaged, &err);
	if (json)
		recording_json(&info, codec, intact, wall,
			       n ? joined_json(members, n) : json_null(),
			       calibrations_json(path, members, n),
			       proof_heads_json(&proof));
	else
		recording_text(path, &info, codec, wall,
			       calibrations_json(path, members, n), &proof);
	if (!json)
		joined_print(members, n);
	incise_proof_free(&proof);
	incise_wall_free(wall);
	incise_recording_close(recording);
	cli_check(err.code, &err);
}

/* --- devices on a bus ---------------------------------------------------------------- */

/* A device, copied: the backend's module is unloaded when the scan ends. */
struct answer {
	char kind[16], device[320], what[240];
	bool usable;
	int n;
	struct {
		char key[40], text[100];
	} property[INCISE_SCAN_PROPERTIES];
};

/* In the order in which they answered. */
struct found {
	struct answer *answer;
	int n;
};

/*
 * "BACKEND:…", for example can:can0. A model or a recording may have a colon in its name, and
 * is recognized by its suffix.
 */
static bool is_bus(const char *what)
{
	static const char *const files[] = {".fis", ".fx", ".rec", ".rec/"};
	size_t n = strspn(what, "abcdefghijklmnopqrstuvwxyz0123456789_");

	if (!n || what[n] != ':')
		return false;
	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		if (cli_ends_with(what, files[i]))
			return false;
	return true;
}

static int keep_info(void *context, const struct incise_scan_device *device)
{
	struct found *found = context;
	struct answer *one;

	found->answer = cli_resize(found->answer, (size_t)found->n + 1, sizeof(*one));
	one = &found->answer[found->n++];
	*one = (struct answer){0};
	snprintf(one->kind, sizeof(one->kind), "%s", device->kind);
	snprintf(one->device, sizeof(one->device), "%s", device->device);
	snprintf(one->what, sizeof(one->what), "%s", device->what);
	one->usable = device->usable;
	for (; one->n < device->n && one->n < INCISE_SCAN_PROPERTIES; one->n++) {
		const struct incise_scan_property *from = &device->property[one->n];

		snprintf(one->property[one->n].key, sizeof(one->property->key), "%s",
			 from->key);
		snprintf(one->property[one->n].text, sizeof(one->property->text), "%s",
			 from->text);
	}
	return 0;
}

/* A drive reports its own name, which must not reach the terminal as commands. */
static void put_plain(const char *text)
{
	for (; *text; text++)
		putchar(iscntrl((unsigned char)*text) ? '?' : *text);
}

static void put_device(const struct answer *device)
{
	int width = (int)strlen(device->kind);

	for (int i = 0; i < device->n; i++)
		if ((int)strlen(device->property[i].key) > width)
			width = (int)strlen(device->property[i].key);
	putchar('\n');
	put_plain(device->what);
	putchar('\n');
	if (device->usable) {
		printf("  %-*s = \"", width, device->kind);
		put_plain(device->device);
		fputs("\";\n", stdout);
	}
	for (int i = 0; i < device->n; i++) {
		printf("  %-*s   ", width, device->property[i].key);
		put_plain(device->property[i].text);
		putchar('\n');
	}
}

static json_t *device_json(const struct answer *device)
{
	json_t *object = json_pack("{ss so so sb}", "kind", device->kind, "device",
				   json_text(device->device), "what",
				   json_text(device->what), "usable", device->usable);

	for (int i = 0; i < device->n; i++)
		json_object_set_new(object, device->property[i].key,
				    json_text(device->property[i].text));
	return object;
}

static void devices_json(const char *kind, const char *bus, const struct found *found)
{
	json_t *report = json_pack("{ss}", "kind", kind), *devices = json_array();

	for (int i = 0; i < found->n; i++)
		json_array_append_new(devices, device_json(&found->answer[i]));
	if (bus)
		json_object_set_new(report, "bus", json_text(bus));
	json_object_set_new(report, "devices", devices);
	json_print(report);
}

static void devices_text(const char *what, const struct found *found)
{
	printf("%s: %s\n", what, cli_count(found->n, "device"));
	for (int i = 0; i < found->n; i++)
		put_device(&found->answer[i]);
}

/* Print backends that could not scan as warnings, and remove them from the devices. */
static void warn_of_failed(struct found *found)
{
	int n = 0;

	for (int i = 0; i < found->n; i++) {
		const struct answer *one = &found->answer[i];
		size_t length = strlen(one->device);

		if (one->usable || one->n || !length || one->device[length - 1] != ':')
			found->answer[n++] = *one;
		else
			cli_warn("%s", one->what);
	}
	found->n = n;
}

static void show_attached(bool json)
{
	struct found found = {0};
	int rc;

	cli_progress("looking for devices");
	rc = incise_scan(NULL, NULL, keep_info, &found, NULL);
	cli_progress_end();
	if (rc)
		cli_fail("devices: %s", strerror(-rc));
	warn_of_failed(&found);
	if (json)
		devices_json("devices", NULL, &found);
	else if (found.n)
		devices_text("attached", &found);
	else
		puts("no tracker, force channel, camera or stepper is attached; drives on a "
		     "CAN bus are listed by `incise info can:can0`");
	free(found.answer);
}

static void show_bus(const char *what, bool json)
{
	struct incise_error err = {0};
	struct found found = {0};
	int rc;

	cli_progress("looking on %s", what);
	rc = incise_scan(NULL, what, keep_info, &found, &err);
	cli_progress_end();
	cli_check(rc, &err);
	/* A failure, as a file that is missing. */
	if (!found.n)
		cli_fail("%s: no answer; check power and cable; on a bus also the node "
			 "id, the bit rate and the two terminators of 120 ohm",
			 what);
	if (json)
		devices_json("bus", what, &found);
	else
		devices_text(what, &found);
	free(found.answer);
}

/* --- what the operand is ------------------------------------------------------------- */

/* A folder, or NAME.rec of which only NAME.rec.part exists. */
static bool is_recording(const char *path)
{
	size_t n = strlen(path);
	struct stat st;

	while (n > 1 && path[n - 1] == '/')
		n--;
	if (file_kind_of(path) == FILE_RECORDING)
		return true;
	if (!stat(path, &st))
		return S_ISDIR(st.st_mode);
	return n >= 4 && !strncmp(path + n - 4, ".rec", 4);
}

static void check_exists(const char *path)
{
	struct stat st;

	if (strcmp(path, "-") && stat(path, &st))
		cli_fail(
			"%s: %s; give a scene or its name, a model (.fis, .fx), a texture (.tex), "
			"a compiled scene (.plan), a recording (NAME.rec), rig, stepper, devices or "
			"a bus such as can:can0; %s",
			path, strerror(errno), scene_argument_installed());
}

/* A factor, which incise merge makes models of. */
static void show_factor(const char *path, bool json)
{
	struct incise_error err = {0};
	struct incise_factor *factor = cli_require(incise_factor_load(path, &err), &err);
	struct incise_factor_info info;
	json_t *sources = json_array();

	incise_factor_info(factor, &info);
	for (int i = 0; i < info.n_sources; i++)
		json_array_append_new(
			sources, json_pack("{ss so sI}", "sha256", info.sources[i].hash,
					   "text", json_text(info.sources[i].text),
					   "rows", (json_int_t)info.sources[i].rows));
	if (json) {
		json_print(json_pack("{ss sI sI si si ss so so so}", "kind", "factor",
				     "pairs", (json_int_t)info.rows, "groups",
				     (json_int_t)info.groups, "n_inputs", info.n_inputs,
				     "n_rules", info.n_rules, "premises", info.premises,
				     "version", json_text(info.version), "options",
				     json_text(info.options), "sources", sources));
	} else {
		printf("factor of %s, groups %llu, %s, %s\n"
		       "premises   %s\nversion    %s\noptions    %s\n",
		       cli_count(info.rows, "pair"), (unsigned long long)info.groups,
		       cli_count(info.n_rules, "rule"), cli_count(info.n_inputs, "input"),
		       info.premises, info.version, info.options);
		for (int i = 0; i < info.n_sources; i++)
			printf("source     %s  %llu pairs, %s\n", info.sources[i].hash,
			       (unsigned long long)info.sources[i].rows,
			       info.sources[i].text);
		json_decref(sources);
	}
	incise_factor_free(factor);
}

/* The rig that is used here, and what comes before it and was not: printed, or as an array. */
static json_t *passed_over(const char *rig, bool json)
{
	json_t *list = json_array();
	const char *reason;

	if (!json)
		printf("rig          %s\n", rig);
	for (int i = 0; (reason = cli_rig_passed_over(i)); i++) {
		if (!json)
			printf("passed over  %s\n", reason);
		json_array_append_new(list, json_text(reason));
	}
	if (!json)
		putchar('\n');
	return list;
}

/* The keys of a scene, or of a rig: "rig" is the one that is used here. */
static void show_keys(const char *path, bool scene, const struct info_job *job)
{
	const bool here = !strcmp(path, "rig");
	const char *rig = here ? cli_rig(NULL) : path;
	struct incise_error err = {0};
	struct keys keys = {0};
	json_t *passed = NULL;

	cli_check(scene ? incise_scene_keys(path, keys_add, &keys, &err)
			: incise_rig_keys(rig, keys_add, &keys, &err),
		  &err);
	if (here)
		passed = passed_over(rig, job->json);
	if (job->json)
		json_print(json_pack("{ss so so* so}", "kind", scene ? "scene" : "rig",
				     "file", json_text(rig), "passed_over", passed,
				     "keys", keys_json(&keys, rig, job->all)));
	else
		keys_print(&keys, rig, job->all);
	if (!job->json)
		json_decref(passed);
	free(keys.key);
}

static void show_dataset(struct info_job *job, char **paths, int n)
{
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1];
	struct recording_rows rows = {.damaged = job->damaged};
	struct incise_sources_options how = {
		.columns = columns,
		.n_inputs = job->n_inputs,
		.group = job->group,
		.all_rows = job->all_rows,
	};
	struct incise_train_source *sources;

	if (!n)
		cli_usage("missing DATA.csv or NAME.rec (training data)");
	for (int i = 0; i < job->n_inputs; i++)
		columns[i] = job->inputs[i];
	columns[job->n_inputs] = job->target;
	incise_train_options_init(&how.train);
	sources = sources_new(paths, n, &rows);
	dataset_show(sources, n, &how, job->json);
	sources_free(sources, n);
}

int main(int argc, char **argv)
{
	struct info_job job = {.inputs = {"depth_mm", "velocity_mm_s"},
			       .n_inputs = 2,
			       .target = "force_N"};
	enum file_kind kind;
	bool compiled, plan, rig;
	char *path;

	cli_parse(&command, argc, argv, &job);
	if (job.dataset) {
		show_dataset(&job, argv + optind, argc - optind);
		cli_finish();
		return 0;
	}
	if (job.group || job.all_rows)
		cli_usage("--group and --all-rows go with --dataset");
	path = cli_operand(argc, argv, "FILE", "recording, model or plan; or a device");
	kind = file_kind_of(path);
	rig = kind == FILE_RIG || !strcmp(path, "rig") || !strcmp(path, "sim") ||
	      !strncmp(path, "sim:", 4);
	if (!rig && !stepper_module_is(path) && strcmp(path, "devices") && !is_bus(path))
		file_expect(path, FILE_RECORDING | FILE_MODEL | FILE_COMPILED |
					  FILE_PLAN | FILE_FACTOR | FILE_SCENE |
					  FILE_TEXTURE);
	compiled = kind ? kind == FILE_COMPILED : cli_ends_with(path, ".fx");
	plan = kind ? kind == FILE_PLAN : cli_ends_with(path, ".plan");
	if (job.all && !rig && kind != FILE_SCENE)
		cli_usage("--all goes with a rig or a scene");
	if (stepper_module_is(path)) {
		stepper_module_show(path, job.json);
	} else if (!strcmp(path, "devices")) {
		show_attached(job.json);
	} else if (rig || kind == FILE_SCENE) {
		show_keys(path, kind == FILE_SCENE, &job);
	} else if (is_bus(path)) {
		show_bus(path, job.json);
	} else if (is_recording(path)) {
		show_recording(path, job.json, job.damaged);
	} else {
		check_exists(path);
		if (compiled)
			show_compiled(path, job.json);
		else if (kind == FILE_FACTOR || (!kind && cli_ends_with(path, ".fac")))
			show_factor(path, job.json);
		else if (kind == FILE_TEXTURE || (!kind && cli_ends_with(path, ".tex")))
			show_texture(path, job.json);
		else if (plan)
			show_plan(path, job.json);
		else
			show_model(path, job.json);
	}
	cli_finish();
	return 0;
}
