// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise assess NAME.session …: what happened in sessions, against the criteria of their scene and
 * an expert's session; as text, JSON, CSV, and a page with figures.
 */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/file_kind.h"
#include "cli/folder.h"
#include "cli/json.h"
#include "cli/loop_report.h"
#include "cli/plot.h"
#include "cli/report_script.h"
#include "session/session.h"

struct assess_job {
	const char *reference_path, *page, *csv;
	bool json;

	int n;
	struct assessed *session;   /* n, and the reference behind them */
	struct assessed *reference; /* or NULL */
};

/* A session with its judgement. */
struct assessed {
	const char *path;
	struct session *session;
	struct session_verdict verdict[INCISE_CRITERIA];
	int judged, met;
};

static const struct cli_option options[] = {
	{0, "reference", "FILE", "session to compare with, for example of an expert",
	 CLI_INPUT(struct assess_job, reference_path)},
	{'o', "output", "FILE.html",
	 "write a page with figures of the path and the force",
	 CLI_OUTPUT(struct assess_job, page), .extensions = ".html"},
	{'o', "output", "FILE.csv", "write one row per session",
	 CLI_OUTPUT(struct assess_job, csv), .extensions = ".csv"},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct assess_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "assess",
	.synopsis = "NAME.session... [OPTIONS]",
	.summary =
		"Evaluate sessions of incise haptic or incise view against the criteria "
		"of their scene.",
	.options = options,
	.examples = "incise assess p07.session --reference expert.session -o p07.html",
	.success = "reported, with criteria met or not",
};

/* Values beside those of criteria. */
static const struct metric {
	const char *key, *label, *unit;
	int digits;
	size_t offset;
} metrics[] = {
#define METRIC(key, label, unit, digits, member)                           \
	{                                                                  \
		key, label, unit, digits, offsetof(struct session, member) \
	}
	METRIC("enlarging_force_N", "force of the handle", "N", 2, enlarging.force_N),
	METRIC("opening_mm", "opening of the cut", "mm", 1, enlarging.open_mm),
	METRIC("turns", "turns of the handle", "", 0, enlarging.turns),
	METRIC("tube_force_N", "force of the tube", "N", 2, insertion.force_N),
	METRIC("tube_deepest_mm", "largest depth of the tube", "mm", 1,
	       insertion.depth_mm),
	METRIC("off_axis_mm", "distance from the membrane's axis", "mm", 1,
	       target.off_axis_mm),
	METRIC("missed", "strokes that missed the membrane", "", 0, target.missed),
	METRIC("duration_s", "whole session", "s", 1, duration_s),
#undef METRIC
};
#define METRICS (int)(sizeof(metrics) / sizeof(*metrics))

static double metric_of(const struct assessed *a, int i)
{
	return *(const double *)((const char *)a->session + metrics[i].offset);
}

static void number_text(double value, int digits, char *text, size_t size)
{
	snprintf(text, size, isnan(value) ? "-" : "%.*f", digits,
		 session_rounded(value, digits));
}

/* --- reading --------------------------------------------------------------------------- */

static void parse_assess(struct assess_job *job, int argc, char **argv)
{
	cli_parse(&command, argc, argv, job);
	job->n = argc - optind;
	if (job->n < 1)
		cli_usage("missing NAME.session (session to evaluate)");
	if (job->json && ((job->page && !strcmp(job->page, "-")) ||
			  (job->csv && !strcmp(job->csv, "-"))))
		cli_usage("--json and - would both write to standard output; give a "
			  "file name");
	if (job->page && job->csv && !strcmp(job->page, "-") && !strcmp(job->csv, "-"))
		cli_usage("-o - and -o csv:- would both write to standard output; give "
			  "a file name");
}

static void load_assess(struct assessed *a, const char *path)
{
	struct incise_error err = {0};

	file_expect(path, FILE_SESSION);
	a->path = path;
	a->session = cli_require(session_read(path, &err), &err);
	session_judge(a->session, a->verdict);
	for (int i = 0; i < INCISE_CRITERIA; i++) {
		a->judged += a->verdict[i].judged;
		a->met += a->verdict[i].met;
	}
}

static void load_all(struct assess_job *job, char **paths)
{
	job->session = cli_alloc((size_t)job->n + 1, sizeof(*job->session));
	for (int i = 0; i < job->n; i++)
		load_assess(&job->session[i], paths[i]);
	if (!job->reference_path)
		return;
	job->reference = &job->session[job->n];
	load_assess(job->reference, job->reference_path);
	for (int i = 0; i < job->n; i++)
		if (strcmp(job->session[i].session->scene.crc32c,
			   job->reference->session->scene.crc32c))
			cli_warn("%s: its scene differs from that of %s; compare "
				 "sessions of one scene",
				 paths[i], job->reference_path);
}

/* Sessions, and the reference if there is one. */
static int rows(const struct assess_job *job)
{
	return job->n + !!job->reference;
}

/* --- words that all forms share -------------------------------------------------------- */

static const char *yes_no(bool yes)
{
	return yes ? "yes" : "no";
}

static const char *met_text(const struct session_verdict *verdict)
{
	return verdict->judged ? yes_no(verdict->met) : "-";
}

/* Value, asked, met, and of a reference its value and the difference. */
struct assess_line {
	char value[32], asked[48], reference[32], difference[32];
	const char *label, *unit, *met;
};

/* "+1.5" of "1.5", and "0.0" as it is. */
static void sign(char *text, size_t size)
{
	size_t n = strlen(text);

	if (!(strtod(text, NULL) > 0) || n + 2 > size)
		return;
	memmove(text + 1, text, n + 1);
	*text = '+';
}

static struct assess_line criterion_line(const struct assessed *a,
					 const struct assessed *reference, int i)
{
	const struct session_verdict *verdict = &a->verdict[i];
	struct assess_line line = {
		.label = session_criterion_label(i),
		.unit = isnan(verdict->value) ? "" : session_criterion_unit(i),
		.met = met_text(verdict)};
	double difference;

	session_criterion_value(i, verdict->value, line.value, sizeof(line.value));
	session_criterion_asked(i, &a->session->criteria[i], line.asked,
				sizeof(line.asked));
	if (!reference)
		return line;
	session_criterion_value(i, reference->verdict[i].value, line.reference,
				sizeof(line.reference));
	difference = session_criterion_difference(i, verdict->value,
						  reference->verdict[i].value);
	session_criterion_value(i, difference, line.difference, sizeof(line.difference));
	sign(line.difference, sizeof(line.difference));
	return line;
}

static struct assess_line metric_line(const struct assessed *a,
				      const struct assessed *reference, int i)
{
	struct assess_line line = {.label = metrics[i].label,
				   .unit = isnan(metric_of(a, i)) ? "" : metrics[i].unit,
				   .asked = "-",
				   .met = "-"};

	number_text(metric_of(a, i), metrics[i].digits, line.value, sizeof(line.value));
	if (!reference)
		return line;
	number_text(metric_of(reference, i), metrics[i].digits, line.reference,
		    sizeof(line.reference));
	number_text(metric_of(a, i) - metric_of(reference, i), metrics[i].digits,
		    line.difference, sizeof(line.difference));
	sign(line.difference, sizeof(line.difference));
	return line;
}

static struct assess_line line_of(const struct assessed *a,
				  const struct assessed *reference, int i)
{
	return i < INCISE_CRITERIA ? criterion_line(a, reference, i)
				   : metric_line(a, reference, i - INCISE_CRITERIA);
}
#define LINES (INCISE_CRITERIA + METRICS)

/* Reasons why a session may not be all that happened, or has no force. */
static void put_doubts(FILE *out, const struct session *s, const char *before,
		       const char *behind)
{
	if (!strcmp(s->end.kind, "fault"))
		fprintf(out, "%sended by a fault: %s%s", before, s->end.why, behind);
	if (isnan(s->first_s))
		fprintf(out, "%sno tool touched the tissue, so there was no force%s",
			before, behind);
	else if (!(s->force.largest_N > 0))
		fprintf(out,
			"%sno force, although a tool was in the tissue: 'incise haptic' "
			"prints the reason at its end%s",
			before, behind);
	if (s->lost > 0)
		fprintf(out,
			"%s%.0f of %.0f ticks were lost; events in them are not "
			"counted%s",
			before, s->lost, s->lost + s->ticks, behind);
	if (s->unusable > 0)
		fprintf(out, "%s%.0f ticks were not numbers, or out of order%s", before,
			s->unusable, behind);
	if (s->cuts_full)
		fprintf(out, "%sthe blade cut more often than tissue.cuts_most%s", before,
			behind);
	if (s->phases_left_out > 0)
		fprintf(out, "%s%.0f phases are not listed%s", before, s->phases_left_out,
			behind);
}

/* A cut as it is shown. */
struct cut_text {
	char from[64], to[64], length[16], direction[16], depth[16], median[16], open[16],
		off[16];
};

static void place_text(const double at_mm[3], char *text, size_t size)
{
	snprintf(text, size, "%.1f, %.1f, %.1f", session_rounded(at_mm[0], 1),
		 session_rounded(at_mm[1], 1), session_rounded(at_mm[2], 1));
}

static struct cut_text cut_text(const struct session_cut *cut)
{
	struct cut_text text;

	place_text(cut->from_mm, text.from, sizeof(text.from));
	place_text(cut->to_mm, text.to, sizeof(text.to));
	number_text(cut->length_mm, 1, text.length, sizeof(text.length));
	/* The same line. */
	number_text(cut->direction_deg < -89.5 ? 90 : cut->direction_deg, 0,
		    text.direction, sizeof(text.direction));
	number_text(cut->depth_mm, 1, text.depth, sizeof(text.depth));
	number_text(cut->depth_median_mm, 1, text.median, sizeof(text.median));
	number_text(cut->open_mm, 1, text.open, sizeof(text.open));
	number_text(cut->off_target_mm, 1, text.off, sizeof(text.off));
	return text;
}

/* --- as text --------------------------------------------------------------------------- */

static void print_lines(const struct assessed *a, const struct assessed *reference)
{
	printf("\n%-34s %8s %-3s %-12s met", "", "value", "", "required");
	printf(reference ? "  %10s %10s\n" : "\n", "reference", "difference");
	for (int i = 0; i < LINES; i++) {
		struct assess_line line = line_of(a, reference, i);

		printf("%-34s %8s %-3s %-12s %*s", line.label, line.value, line.unit,
		       line.asked, reference ? -3 : 0, line.met);
		printf(reference ? "  %10s %10s\n" : "\n", line.reference,
		       line.difference);
	}
}

static void print_cuts(const struct session *s)
{
	for (int i = 0; i < s->n_cuts; i++) {
		struct cut_text cut = cut_text(&s->cut[i]);

		printf("%scut %d, incision %d: (%s) to (%s), %s mm, direction %s degrees, "
		       "depth %s mm (median %s), open %s mm, off the target %s mm\n",
		       i ? "" : "\n", i + 1, s->cut[i].incision + 1, cut.from, cut.to,
		       cut.length, cut.direction, cut.depth, cut.median, cut.open,
		       cut.off);
	}
}

static void print_phases(const struct session *s)
{
	for (int i = 0; i < s->n_phases; i++) {
		const struct session_phase *phase = &s->phase[i];

		printf("%s%-6s %7.2f to %7.2f s, depth %.1f mm, force %.2f N\n",
		       i ? "" : "\n", loop_tool_names[phase->tool], phase->from_s,
		       phase->to_s, phase->depth_mm, phase->force_N);
	}
}

static void print_one(const struct assessed *a, const struct assessed *reference)
{
	const struct session *s = a->session;

	printf("%s: %s%s%s", a->path, s->scene.path, *s->code ? ", code " : "", s->code);
	put_doubts(stdout, s, "\n  ", "");
	putchar('\n');
	print_lines(a, reference);
	print_cuts(s);
	print_phases(s);
	printf("\n%d of %d criteria met\n", a->met, a->judged);
}

/* "29.6", and with a mark where the criterion is not met. */
static void cell_text(const struct assessed *a, int criterion, char *text, size_t size)
{
	const struct session_verdict *verdict = &a->verdict[criterion];
	size_t n;

	session_criterion_value(criterion, verdict->value, text, size);
	n = strlen(text);
	if (verdict->judged && !verdict->met)
		snprintf(text + n, size - n, "!");
}

/* "3 of 4" sessions that do not meet a criterion, of those that are judged by it; how many. */
static int count_failed(const struct assess_job *job, int criterion, char *text,
			size_t size)
{
	int failed = 0, judged = 0;

	for (int i = 0; i < job->n; i++) {
		const struct session_verdict *verdict =
			&job->session[i].verdict[criterion];

		judged += verdict->judged;
		failed += verdict->judged && !verdict->met;
	}
	snprintf(text, size, judged ? "%d of %d" : "-", failed, judged);
	return failed;
}

static void print_table(const struct assess_job *job)
{
	int width = (int)strlen("not met");
	char text[40];

	for (int i = 0; i < rows(job); i++)
		width = (int)fmax(width, (double)strlen(job->session[i].path));
	printf("%-*s %-16s", width, "session", "code");
	for (int k = 0; k < INCISE_CRITERIA; k++)
		printf(" %9s", session_criterion_head(k));
	puts("    met");
	for (int i = 0; i < rows(job); i++) {
		const struct assessed *a = &job->session[i];

		printf("%-*s %-16s", width, a->path,
		       *a->session->code ? a->session->code : "-");
		for (int k = 0; k < INCISE_CRITERIA; k++) {
			cell_text(a, k, text, sizeof(text));
			printf(" %9s", text);
		}
		printf(" %2d of %d%s\n", a->met, a->judged,
		       a == job->reference ? ", reference" : "");
	}
	printf("%-*s %-16s", width, "not met", "");
	for (int k = 0; k < INCISE_CRITERIA; k++) {
		count_failed(job, k, text, sizeof(text));
		printf(" %9s", text);
	}
	puts("\n'!' marks a criterion that is not met.");
	for (int i = 0; i < rows(job); i++) {
		char before[300];

		snprintf(before, sizeof(before), "%.280s: ", job->session[i].path);
		put_doubts(stdout, job->session[i].session, before, "\n");
	}
}

/* --- as JSON and CSV ------------------------------------------------------------------- */

static json_t *criteria_json(const struct assessed *a)
{
	json_t *object = json_object();

	for (int i = 0; i < INCISE_CRITERIA; i++) {
		const struct incise_scene_criterion *asked = &a->session->criteria[i];
		const struct session_verdict *verdict = &a->verdict[i];

		json_object_set_new(
			object, incise_criterion_name(i),
			json_pack("{so so so so}", "value", json_number(verdict->value),
				  "least",
				  asked->asked ? json_number(asked->min) : json_null(),
				  "largest",
				  asked->asked ? json_number(asked->max) : json_null(),
				  "met",
				  verdict->judged ? json_boolean(verdict->met)
						  : json_null()));
	}
	return object;
}

static json_t *figures_json(const struct assessed *a)
{
	json_t *object = json_object();

	for (int i = 0; i < METRICS; i++)
		json_set_number(object, metrics[i].key, metric_of(a, i));
	return object;
}

static json_t *difference_json(const struct assessed *a, const struct assessed *reference)
{
	json_t *object = json_object();

	for (int i = 0; i < INCISE_CRITERIA; i++)
		json_set_number(
			object, incise_criterion_name(i),
			session_criterion_difference(i, a->verdict[i].value,
						     reference->verdict[i].value));
	for (int i = 0; i < METRICS; i++)
		json_set_number(object, metrics[i].key,
				metric_of(a, i) - metric_of(reference, i));
	return object;
}

static json_t *session_report(const struct assessed *a, const struct assessed *reference)
{
	const struct session *s = a->session;

	return json_pack("{so so so so ss so so si si so so so}", "file",
			 json_text(a->path), "code", json_text(s->code), "scene",
			 json_text(s->scene.path), "scene_crc32c",
			 json_text(s->scene.crc32c), "ended", s->end.kind, "start_unix_s",
			 json_number(s->start_unix_s), "ticks_lost",
			 json_integer((json_int_t)s->lost), "judged", a->judged, "met",
			 a->met, "criteria", criteria_json(a), "figures", figures_json(a),
			 "difference",
			 reference ? difference_json(a, reference) : json_null());
}

static void print_assess_json(const struct assess_job *job)
{
	json_t *list = json_array();

	for (int i = 0; i < job->n; i++)
		json_array_append_new(list,
				      session_report(&job->session[i], job->reference));
	json_print(json_pack("{so so}", "sessions", list, "reference",
			     job->reference ? session_report(job->reference, NULL)
					    : json_null()));
}

/* A text in quotes. */
static void put_quoted(FILE *out, const char *text)
{
	fputc('"', out);
	for (; *text; text++)
		fprintf(out, *text == '"' ? "\"\"" : "%c", *text);
	fputc('"', out);
}

static void put_value(FILE *out, double value)
{
	if (isnan(value))
		fputc(',', out);
	else
		fprintf(out, ",%.4f", value);
}

static void put_csv_row(FILE *out, const struct assessed *a, bool reference)
{
	const struct session *s = a->session;

	put_quoted(out, a->path);
	fprintf(out, ",%s,%s,%s,%s,%.0f,%d,%d", reference ? "reference" : "session",
		s->code, s->scene.crc32c, s->end.kind, s->lost, a->judged, a->met);
	for (int i = 0; i < INCISE_CRITERIA; i++) {
		const struct session_verdict *verdict = &a->verdict[i];

		put_value(out, verdict->value);
		fprintf(out, ",%s", verdict->judged ? yes_no(verdict->met) : "");
	}
	for (int i = 0; i < METRICS; i++)
		put_value(out, metric_of(a, i));
	fputc('\n', out);
}

static void write_csv(const struct assess_job *job)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(job->csv, &file);

	fputs("file,role,code,scene_crc32c,ended,ticks_lost,judged,met", out);
	for (int i = 0; i < INCISE_CRITERIA; i++)
		fprintf(out, ",%s,%s_met", incise_criterion_name(i),
			incise_criterion_name(i));
	for (int i = 0; i < METRICS; i++)
		fprintf(out, ",%s", metrics[i].key);
	fputc('\n', out);
	for (int i = 0; i < rows(job); i++)
		put_csv_row(out, &job->session[i], &job->session[i] == job->reference);
	whole_file_end(file);
}

/* --- figures --------------------------------------------------------------------------- */

static char folder[4096]; /* of figures, for a while */

static void remove_folder(void)
{
	folder_remove(folder);
}

static void draw_path(const struct session *s, const struct session *reference,
		      const char *name)
{
	FILE *script = plot_begin(folder, name, 900, 560);

	session_figure_path(script, s, reference);
	plot_draw_or_fail(script, folder, name);
}

static void draw_force(const struct session *s, const struct session *reference,
		       const char *name)
{
	FILE *script = plot_begin(folder, name, 900, 420);

	session_figure_force(script, s, reference);
	plot_draw_or_fail(script, folder, name);
}

/* --- the page -------------------------------------------------------------------------- */

/* The last row of the class. */
static json_t *failed_json(const struct assess_job *job)
{
	json_t *list = json_array();
	char text[40];

	for (int k = 0; k < INCISE_CRITERIA; k++) {
		bool bad = count_failed(job, k, text, sizeof(text)) > 0;

		json_array_append_new(list,
				      json_pack("{ss sb}", "value", text, "bad", bad));
	}
	return list;
}

/* Values, and what was asked where it is not met. */
static json_t *cells_json(const struct assessed *a)
{
	json_t *list = json_array();
	char text[40], asked[48];

	for (int k = 0; k < INCISE_CRITERIA; k++) {
		const struct session_verdict *verdict = &a->verdict[k];
		bool bad = verdict->judged && !verdict->met;

		session_criterion_value(k, verdict->value, text, sizeof(text));
		session_criterion_asked(k, &a->session->criteria[k], asked,
					sizeof(asked));
		json_array_append_new(
			list,
			json_pack("{so sb}", "value",
				  bad ? json_sprintf("%s (should be %s)", text, asked)
				      : json_string(text),
				  "bad", bad));
	}
	return list;
}

static json_t *lines_json(const struct assessed *a, const struct assessed *reference)
{
	json_t *list = json_array();

	for (int i = 0; i < LINES; i++) {
		struct assess_line line = line_of(a, reference, i);

		json_array_append_new(
			list,
			json_pack("{ss so ss ss ss ss sb}", "label", line.label, "value",
				  json_sprintf("%s%s%s", line.value,
					       *line.unit ? " " : "", line.unit),
				  "asked", line.asked, "met", line.met, "reference",
				  line.reference, "difference", line.difference, "bad",
				  !strcmp(line.met, "no")));
	}
	return list;
}

static json_t *cuts_json(const struct session *s)
{
	json_t *list = json_array();

	for (int i = 0; i < s->n_cuts; i++) {
		struct cut_text cut = cut_text(&s->cut[i]);

		json_array_append_new(list,
				      json_pack("{si si ss ss ss ss ss ss ss ss}", "cut",
						i + 1, "incision", s->cut[i].incision + 1,
						"from", cut.from, "to", cut.to, "length",
						cut.length, "direction", cut.direction,
						"depth", cut.depth, "median", cut.median,
						"open", cut.open, "off", cut.off));
	}
	return list;
}

static json_t *phases_json(const struct session *s)
{
	json_t *list = json_array();

	for (int i = 0; i < s->n_phases; i++) {
		const struct session_phase *phase = &s->phase[i];

		json_array_append_new(
			list, json_pack("{ss so so so so}", "tool",
					loop_tool_names[phase->tool], "from",
					json_sprintf("%.2f", phase->from_s), "to",
					json_sprintf("%.2f", phase->to_s), "depth",
					json_sprintf("%.1f", phase->depth_mm), "force",
					json_sprintf("%.2f", phase->force_N)));
	}
	return list;
}

/* Its scene and code, and what may be wrong. */
static json_t *about_json(const struct session *s)
{
	char *about = NULL;
	size_t size;
	FILE *line = open_memstream(&about, &size);
	json_t *text;

	if (!line)
		cli_fail("no memory");
	fprintf(line, "%s%s%s", s->scene.path, *s->code ? ", code " : "", s->code);
	put_doubts(line, s, "; ", "");
	fputc('.', line);
	fclose(line);
	text = json_text(about);
	free(about);
	return text;
}

/* A session that ended before its first tick has none. */
static void draw_figures(const struct assessed *a, const struct assessed *reference,
			 int number)
{
	const struct session *expert = reference ? reference->session : NULL;
	char name[20];

	if (!a->session->n_trace)
		return;
	snprintf(name, sizeof(name), "path-%d", number);
	draw_path(a->session, expert, name);
	snprintf(name, sizeof(name), "force-%d", number);
	draw_force(a->session, expert, name);
}

static json_t *shown_json(const struct assess_job *job, const struct assessed *a)
{
	const struct session *s = a->session;
	const char *slash = strrchr(a->path, '/');

	return json_pack("{so sb so so so so so sb so so}", "name",
			 json_text(slash ? slash + 1 : a->path), "reference",
			 a == job->reference, "code", json_text(s->code), "met",
			 json_sprintf("%d of %d", a->met, a->judged), "cells",
			 cells_json(a), "about", about_json(s), "lines",
			 lines_json(a, job->reference), "membrane", s->has_membrane,
			 "cuts", cuts_json(s), "phases", phases_json(s));
}

static void write_page(const struct assess_job *job)
{
	json_t *sessions = json_array(), *heads = json_array(), *page;
	struct incise_error err = {0};
	struct incise_outfile *file;
	FILE *out;

	out = whole_file_begin(job->page, &file);
	folder_make(folder, sizeof(folder), "for the figures");
	atexit(remove_folder);
	cli_catch_signals();
	plot_folder(folder);
	for (int i = 0; i < rows(job); i++) {
		if (cli_stop)
			cli_fail("%s: interrupted; %s is unchanged", strsignal(cli_stop),
				 job->page);
		cli_progress("figures %d of %d", i + 1, job->n);
		if (i < job->n)
			draw_figures(&job->session[i], job->reference, i + 1);
		json_array_append_new(sessions, shown_json(job, &job->session[i]));
	}
	for (int k = 0; k < INCISE_CRITERIA; k++)
		json_array_append_new(heads,
				      json_sprintf("%s%s%s", session_criterion_label(k),
						   *session_criterion_unit(k) ? ", " : "",
						   session_criterion_unit(k)));
	cli_progress_end();
	page = json_pack("{ss so so so sb}", "title", "Sessions", "heads", heads,
			 "sessions", sessions, "failed",
			 job->n > 1 ? failed_json(job) : json_null(), "compared",
			 job->reference != NULL);
	if (report_script("page", folder, page, out, &err))
		cli_fail("%s: %s", job->page, err.text);
	json_decref(page);
	whole_file_end(file);
}

int main(int argc, char **argv)
{
	struct assess_job job = {0};
	bool quiet;

	parse_assess(&job, argc, argv);
	load_all(&job, argv + optind);
	if (job.csv)
		write_csv(&job);
	if (job.page)
		write_page(&job);
	quiet = (job.csv && !strcmp(job.csv, "-")) ||
		(job.page && !strcmp(job.page, "-"));
	if (job.json)
		print_assess_json(&job);
	else if (!quiet && job.n == 1)
		print_one(&job.session[0], job.reference);
	else if (!quiet)
		print_table(&job);
	if (!job.json && !quiet)
		cli_written();
	cli_finish();
	for (int i = 0; i < rows(&job); i++)
		free(job.session[i].session);
	free(job.session);
	return 0;
}
