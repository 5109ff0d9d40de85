// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What scenes leave out; see bench_scenes.h.
 */
#include <glob.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "bench_scenes.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/mapped_libraries.h"
#include "../cli/plot.h"
#include "../cli/scene_argument.h"
#include "scene_row.h"
#include "scenes_picture.h"

struct bench {
	struct scene_row row[BENCH_SCENES_MOST];
	int n;
	struct machine machine;
	const char *counted_by, *not_counted; /* instructions; the other is NULL */
};

/* ---- which ---- */

static char *copy(const char *text, size_t length)
{
	char *made = strndup(text, length);

	if (!made)
		cli_fail("no memory");
	return made;
}

static void add_given(struct bench *b, const char *operand)
{
	struct scene_row *row = &b->row[b->n++];
	struct scene_argument argument = {0};

	row->name = copy(operand, strlen(operand));
	/* It may be the name of a file, that another gave: no line is broken by it. */
	for (char *c = row->name; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	if (scene_argument_find(&argument, operand))
		row->path = argument.path;
}

static void add_shipped(struct bench *b)
{
	char pattern[4200];
	glob_t found;

	snprintf(pattern, sizeof(pattern), "%s/*.scene", scene_argument_shipped());
	if (glob(pattern, 0, NULL, &found))
		cli_fail("%s: no scenes are there, though they come with the program",
			 scene_argument_shipped());
	for (size_t i = 0; i < found.gl_pathc && b->n < BENCH_SCENES_MOST - MADE_SCENES;
	     i++) {
		const char *name = strrchr(found.gl_pathv[i], '/') + 1;
		struct scene_row *row = &b->row[b->n++];

		row->name = copy(name, strlen(name) - strlen(".scene"));
		row->path = copy(found.gl_pathv[i], strlen(found.gl_pathv[i]));
	}
	globfree(&found);
}

static void add_made(struct bench *b)
{
	for (int i = 0; i < MADE_SCENES; i++) {
		struct scene_row *row = &b->row[b->n++];

		made_scene_begin(&row->made, i);
		row->name = copy(row->made.name, strlen(row->made.name));
		row->path = row->made.scene.path;
	}
}

/* ---- measuring ---- */

static void open_row(struct scene_row *row)
{
	struct scene_saving *saving = &row->saving;

	if (row->path)
		scene_saving_begin(saving, row->path, row->made.kept);
	else
		snprintf(saving->failed, sizeof(saving->failed),
			 "there is no file %s, and no scene of that name", row->name);
	if (*saving->failed) {
		snprintf(row->failed, sizeof(row->failed), "%s", saving->failed);
		return;
	}
	/* The loop has no way to keep what its scene does not need. */
	row->own_process = !row->made.kept;
}

static void look_at_processes(struct bench *b)
{
	struct loop_process *started[BENCH_SCENES_MOST];
	int n = 0;

	for (int i = 0; i < b->n; i++)
		if (b->row[i].own_process) {
			loop_process_begin(&b->row[i].process, b->row[i].path);
			started[n++] = &b->row[i].process;
		}
	loop_process_watch(started, n);
	for (int i = 0; i < b->n; i++)
		if (*b->row[i].process.failed)
			snprintf(b->row[i].failed, sizeof(b->row[i].failed), "%s",
				 b->row[i].process.failed);
}

static void measure(struct bench *b, bool quick)
{
	struct scene_saving *savings[BENCH_SCENES_MOST];

	for (int i = 0; i < b->n; i++) {
		open_row(&b->row[i]);
		savings[i] = &b->row[i].saving;
	}
	look_at_processes(b);
	for (int i = 0; i < b->n && !cli_stop; i++) {
		cli_progress("%s: forces", b->row[i].name);
		scene_saving_compare(savings[i]);
	}
	b->counted_by = scene_savings_count(savings, b->n, quick, &b->not_counted);
	scene_savings_time(savings, b->n, quick);
}

/* ---- report ---- */

static bool measured(const struct scene_row *row)
{
	return !*row->saving.failed;
}

static double times_cheaper(const struct scene_row *row)
{
	return row->saving.full.time.ns.median / row->saving.few.time.ns.median;
}

/* Texts with ", " between them, to be freed; NULL of no list. */
static char *joined(const json_t *list)
{
	size_t size = 1;
	char *text;

	if (!list)
		return NULL;
	for (size_t i = 0; i < json_array_size(list); i++)
		size += strlen(json_string_value(json_array_get(list, i))) + 2;
	text = calloc(size, 1);
	if (!text)
		cli_fail("no memory");
	for (size_t i = 0; i < json_array_size(list); i++) {
		strcat(text, i ? ", " : "");
		strcat(text, json_string_value(json_array_get(list, i)));
	}
	return text;
}

/* The same as JSON; takes the list. */
static json_t *joined_json(json_t *list)
{
	char *text = joined(list);
	json_t *value = text ? json_string(text) : json_null();

	free(text);
	json_decref(list);
	return value;
}

static json_t *stages_of(const struct incise_plan *plan)
{
	json_t *list = plan ? json_array() : NULL;
	const char *name;

	for (int i = 0; plan && (name = incise_plan_stage(plan, i)); i++)
		json_array_append_new(list, json_string(name));
	return list;
}

static json_t *left_out_of(const struct incise_plan *plan)
{
	json_t *list = plan ? json_array() : NULL;
	const char *name;

	for (int i = 0; plan && (name = incise_plan_left_out(plan, i, NULL)); i++)
		json_array_append_new(list, json_string(name));
	return list;
}

/* What a stage takes that does nothing, in the full pipeline; NaN where it is not there. */
static double neutral_ns(const struct scene_way *full, const char *stage)
{
	const char *name;

	for (int i = 0; (name = incise_plan_stage(full->plan, i)); i++)
		if (!strcmp(name, stage))
			return full->stage_ns[i];
	return NAN;
}

static json_t *kib(const struct scene_way *way)
{
	return way->plan ? json_real((double)incise_plan_memory(way->plan) / 1024)
			 : json_null();
}

static json_t *row_json(const struct scene_row *row)
{
	const struct scene_way *few = &row->saving.few, *full = &row->saving.full;
	const struct loop_process *process = &row->process;
	bool seen = process->libraries;
	json_t *object = json_object();

	json_object_set_new(object, "name", json_text(row->name));
	json_object_set_new(object, "stages", joined_json(stages_of(few->plan)));
	json_object_set_new(object, "left_out", joined_json(left_out_of(few->plan)));
	json_object_set_new(object, "libraries",
			    joined_json(json_incref(process->libraries)));
	json_object_set_new(
		object, "libraries_mapped",
		seen ? json_integer((json_int_t)json_array_size(process->libraries))
		     : json_null());
	json_object_set_new(object, "libraries_not_mapped",
			    joined_json(seen ? unmapped_libraries(process->libraries)
					     : NULL));
	json_object_set_new(object, "devices",
			    joined_json(json_incref(process->devices)));
	json_object_set_new(object, "files_open",
			    joined_json(json_incref(process->files)));
	json_object_set_new(object, "plan_memory_KiB", kib(few));
	json_object_set_new(object, "full_memory_KiB", kib(full));
	json_object_set_new(object, "process_memory_KiB",
			    seen ? json_integer(process->peak_KiB) : json_null());
	json_object_set_new(object, "process_own_KiB",
			    seen ? json_integer(process->own_KiB) : json_null());
	json_object_set_new(object, "tick_ns", json_number(few->time.ns.median));
	json_object_set_new(object, "tick_ns_p99",
			    json_number(measured(row) ? few->p99_ns : NAN));
	json_object_set_new(object, "instructions", json_number(few->instructions));
	json_object_set_new(object, "full_ns", json_number(full->time.ns.median));
	json_object_set_new(object, "full_instructions", json_number(full->instructions));
	json_object_set_new(object, "times_cheaper", json_number(times_cheaper(row)));
	json_object_set_new(object, "ticks_compared",
			    json_integer(row->saving.ticks_compared));
	json_object_set_new(object, "ticks_in_contact",
			    json_integer(row->saving.ticks_in_contact));
	json_object_set_new(object, "first_difference",
			    row->saving.first_difference < 0
				    ? json_null()
				    : json_integer(row->saving.first_difference));
	json_object_set_new(object, "identical",
			    measured(row) ? json_boolean(row->saving.first_difference < 0)
					  : json_null());
	json_object_set_new(object, "failed",
			    *row->failed ? json_text(row->failed) : json_null());
	return object;
}

static void add_left_out(json_t *list, const struct scene_row *row)
{
	const struct incise_plan *plan = row->saving.few.plan;
	const char *name, *why;

	for (int i = 0; (name = incise_plan_left_out(plan, i, &why)); i++)
		json_array_append_new(
			list,
			json_pack("{so ss ss so}", "scene", json_text(row->name), "stage",
				  name, "why", why, "ns",
				  json_number(neutral_ns(&row->saving.full, name))));
}

static void add_figures(json_t *figures, const struct scene_row *row)
{
	const struct scene_way *few = &row->saving.few, *full = &row->saving.full;

	metrics_time(figures, &few->time, "ns", "%s tick", row->name);
	metrics_time(figures, &full->time, "ns", "%s full tick", row->name);
	metrics_exact(figures, round(few->instructions), "instructions",
		      "%s instructions", row->name);
	metrics_exact(figures, round(full->instructions), "instructions",
		      "%s full instructions", row->name);
}

static void print_json(const struct bench *b, bool quick)
{
	json_t *rows = json_array(), *left = json_array(), *figures = json_array();

	for (int i = 0; i < b->n; i++) {
		json_array_append_new(rows, row_json(&b->row[i]));
		if (!measured(&b->row[i]))
			continue;
		add_left_out(left, &b->row[i]);
		add_figures(figures, &b->row[i]);
	}
	json_print(json_pack("{so sb ss? ss? so so so}", "machine",
			     machine_json(&b->machine), "quick", quick, "instructions_by",
			     b->counted_by, "instructions_failed", b->not_counted, "rows",
			     rows, "left_out", left, "figures", figures));
}

static void print_number(int width, int digits, double value)
{
	if (isfinite(value))
		printf(" %*.*f", width, digits, value);
	else
		printf(" %*s", width, "-");
}

static void print_row(const struct scene_row *row)
{
	const struct scene_way *few = &row->saving.few, *full = &row->saving.full;
	bool seen = row->process.libraries;

	printf("%-18s", row->name);
	print_number(7, 1, few->time.ns.median);
	print_number(7, 0, measured(row) ? few->p99_ns : NAN);
	print_number(7, 1, full->time.ns.median);
	print_number(7, 2, times_cheaper(row));
	print_number(7, 0, few->instructions);
	print_number(7, 0, full->instructions);
	print_number(9, 1,
		     few->plan ? (double)incise_plan_memory(few->plan) / 1024 : NAN);
	print_number(9, 0, seen ? (double)row->process.peak_KiB : NAN);
	print_number(6, 0, seen ? (double)json_array_size(row->process.libraries) : NAN);
	printf("  %s\n", !measured(row)			    ? "-"
			 : row->saving.first_difference < 0 ? "same"
							    : "DIFFER");
}

static void print_list(const char *title, json_t *list)
{
	char *text = joined(list);

	printf("  %-9s %s\n", title, text && *text ? text : "none");
	free(text);
	json_decref(list);
}

/* What it has, what it leaves out, and what that costs a plan that keeps it. */
static void print_details(const struct scene_row *row)
{
	const struct incise_plan *plan = row->saving.few.plan;
	const char *name, *why;

	printf("\n%s\n", row->name);
	print_list("stages", stages_of(plan));
	for (int i = 0; (name = incise_plan_left_out(plan, i, &why)); i++) {
		double ns = neutral_ns(&row->saving.full, name);

		printf("  %-9s %-10s", i ? "" : "left out", name);
		print_number(4, 0, ns);
		printf("%s  %s\n", isfinite(ns) ? " ns" : "   ", why);
	}
	if (!row->process.libraries)
		return;
	print_list("devices", json_incref(row->process.devices));
	print_list("opened", json_incref(row->process.files));
	print_list("libraries", json_incref(row->process.libraries));
	print_list("not these", unmapped_libraries(row->process.libraries));
}

/* The 95 % intervals of the medians meet. */
static bool saves_nothing(const struct scene_row *row)
{
	return measured(row) &&
	       row->saving.full.time.ns.low <= row->saving.few.time.ns.high;
}

static void print_text(const struct bench *b)
{
	long compared = 0;

	printf("a tick of each scene, and of the full pipeline: the same with every stage "
	       "kept\n%s; %s; %s\n\n"
	       "%-18s %7s %7s %7s %7s %7s %7s %9s %9s %6s  %s\n",
	       b->machine.cpu, b->machine.kernel, b->machine.compiler, "scene", "ns",
	       "99 %", "full ns", "times", "instr.", "full", "plan KiB", "proc. KiB",
	       "libs", "forces");
	for (int i = 0; i < b->n; i++) {
		print_row(&b->row[i]);
		compared += b->row[i].saving.ticks_compared;
	}
	printf("\nforces of %ld ticks compared bit by bit; instructions %s%s\n", compared,
	       b->counted_by ? "by " : "not counted: ",
	       b->counted_by ? b->counted_by : b->not_counted);
	for (int i = 0; i < b->n; i++)
		if (*b->row[i].failed)
			printf("%s: %s\n", b->row[i].name, b->row[i].failed);
		else if (saves_nothing(&b->row[i]))
			printf("%s: the full pipeline costs no more that could be told\n",
			       b->row[i].name);
	for (int i = 0; i < b->n; i++)
		if (measured(&b->row[i]))
			print_details(&b->row[i]);
}

/* After the report: what of it is a fault. */
static void judge(const struct bench *b, bool given)
{
	for (int i = 0; i < b->n; i++)
		if (measured(&b->row[i]) && b->row[i].saving.first_difference >= 0)
			cli_fail(
				"%s: leaving out changes the force, first in tick %ld: a "
				"fault of incise, please report it with the scene",
				b->row[i].name, b->row[i].saving.first_difference);
	for (int i = 0; i < b->n && given; i++)
		if (*b->row[i].failed)
			cli_fail("%s: not measured: %s", b->row[i].name,
				 b->row[i].failed);
}

static void end_row(struct scene_row *row)
{
	scene_saving_end(&row->saving);
	loop_process_free(&row->process);
	if (row->made.name)
		made_scene_end(&row->made);
	free(row->name);
}

void bench_scenes_profile(const char *scene, bool full)
{
	struct scene_argument argument = {0};

	if (!scene_argument_find(&argument, scene))
		cli_fail("there is no file %s, and no scene of that name", scene);
	scene_profile(argument.path, full);
}

void bench_scenes(char *const *scenes, int n, bool json, bool quick, const char *plot)
{
	struct bench *b = calloc(1, sizeof(*b));
	const char *folder, *name;

	if (!b)
		cli_fail("no memory");
	if (plot)
		plot_place("plot", plot, &folder, &name);
	machine_init(&b->machine);
	for (int i = 0; i < n; i++)
		add_given(b, scenes[i]);
	if (!n) {
		add_shipped(b);
		add_made(b);
	}
	measure(b, quick);
	if (json)
		print_json(b, quick);
	else
		print_text(b);
	cli_finish();
	if (plot)
		scenes_picture(b->row, b->n, &b->machine, folder, name);
	judge(b, n > 0);
	for (int i = 0; i < b->n; i++)
		end_row(&b->row[i]);
	free(b);
}
