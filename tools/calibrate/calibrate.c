// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The driver of the incise calibrate commands; see calibrate.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/infile.h>
#include "../cli/calibration.h"
#include "../cli/features.h"
#include "../cli/file.h"
#include "../cli/folder.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/uncertainty.h"
#include "calibrate.h"

/* --- the record ---------------------------------------------------------------------- */

void calibrate_value(struct calibrate *c, const char *key, const char *unit, double left,
		     double u)
{
	struct incise_calibration_value *value = &c->record.values[c->record.n++];

	*value = (struct incise_calibration_value){
		.found = incise_calibration_get(&c->found, key), .left = left, .u = u};
	calibrate_words(value->key, "%s", key);
	calibrate_words(value->unit, "%s", unit);
}

void calibrate_covariance(struct incise_calibration_record *record, const double *all,
			  int n)
{
	for (int i = 0; i < n; i++)
		for (int k = 0; k <= i; k++)
			record->covariance[record->n_covariance++] = all[n * i + k];
}

void calibrate_stated(struct calibrate *c, double given, const char *key,
		      const char *unit, const char *question)
{
	struct incise_calibration_record *record = &c->record;
	double found = incise_calibration_get(&c->found, key);
	char line[100] = "", *end;

	if (isnan(given) && isnan(found) && !c->json && isatty(STDIN_FILENO) &&
	    isatty(STDERR_FILENO)) {
		char *text = cli_text("%s, in %s [not stated] ", question, unit);

		/* The end of the input leaves it out, too. */
		if (!cli_ask(text, line, sizeof(line)))
			calibrate_check_stop();
		free(text);
		if (*line) {
			given = incise_decimal(line, &end);
			if (end == line || *end || !(given >= 0 && given <= 1000))
				cli_fail("expected a number of %s from 0 to 1000; the "
					 "previous calibration stays active",
					 unit);
		}
	}
	if (isnan(given))
		return;
	for (int i = 0; i <= record->n && record->n_covariance; i++)
		record->covariance[record->n_covariance++] = 0;
	calibrate_value(c, key, unit, given, 0);
}

/* --- the block at the end ---------------------------------------------------------------- */

enum { KEY, VALUE, PREVIOUS, CHANGE, COLUMNS };

struct calibrate_row {
	char text[COLUMNS][UNCERTAINTY_TEXT];
};

/* A value with the digits of @U, which is not printed. */
static void round_to(double value, double U, const char *unit,
		     char text[UNCERTAINTY_TEXT])
{
	char *end;

	uncertainty_text(value, U, unit, text);
	end = strstr(text, " ±");
	if (end)
		snprintf(end, UNCERTAINTY_TEXT - (end - text), "%s%s", *unit ? " " : "",
			 unit);
}

static void fill_row(const struct calibrate *c,
		     const struct incise_calibration_value *value,
		     struct calibrate_row *row)
{
	const struct incise_calibration_record *last;
	const struct incise_calibration_value *previous =
		incise_calibration_last(c->history, c->n_history, value->key, &last);
	const char *date;
	double change = value->left - value->found, U = 2 * value->u;
	double percent = 100 * change / fabs(value->found);
	char text[UNCERTAINTY_TEXT];
	struct incise_calibration nominal;
	int n;

	incise_calibration_nominal(&nominal);
	snprintf(row->text[KEY], UNCERTAINTY_TEXT, "%s", value->key);
	uncertainty_text(value->left, U, value->unit, row->text[VALUE]);
	if (isnan(value->found)) {
		strcpy(row->text[PREVIOUS], "none");
		strcpy(row->text[CHANGE], "-");
		return;
	}
	if (previous && previous->left == value->found)
		date = last->date;
	else
		date = value->found == incise_calibration_get(&nominal, value->key)
			       ? "nominal"
			       : "by hand";
	round_to(value->found, U, "", text);
	snprintf(row->text[PREVIOUS], UNCERTAINTY_TEXT, "%.40s (%.10s)", text, date);
	round_to(change, U, value->unit, text);
	n = snprintf(row->text[CHANGE], UNCERTAINTY_TEXT, "%s%.40s",
		     *text == '-' ? "" : "+", text);
	/* A percentage of nearly nothing says nothing; no "-0.00 %". */
	if (fabs(percent) < 1000)
		snprintf(row->text[CHANGE] + n, UNCERTAINTY_TEXT - n, " (%+.2f %%)",
			 fabs(percent) < 0.005 ? 0 : percent);
}

/* Columns on the screen of UTF-8. */
static int width_of_calibrate(const char *text)
{
	int width = 0;

	for (; *text; text++)
		width += ((unsigned char)*text & 0xc0) != 0x80;
	return width;
}

static bool is_of_another(const struct incise_calibration_value *value)
{
	return cli_ends_with(value->key, "_delay_sd_ms"); /* U of that delay, halved */
}

static void print_result(const struct calibrate *c, FILE *out)
{
	const struct incise_calibration_record *record = &c->record;
	struct calibrate_row rows[INCISE_CALIBRATION_VALUES + 1] = {
		{{"result", "value ± U (k = 2)", "previous", "change"}}};
	int width[COLUMNS] = {0}, n = 1;

	for (int i = 0; i < record->n; i++)
		if (!is_of_another(&record->values[i]))
			fill_row(c, &record->values[i], &rows[n++]);
	for (int i = 0; i < n; i++)
		for (int k = 0; k < COLUMNS; k++)
			width[k] =
				(int)fmax(width[k], width_of_calibrate(rows[i].text[k]));
	fputc('\n', out);
	for (int i = 0; i < n; i++) {
		for (int k = 0; k < CHANGE; k++)
			fprintf(out, "%s%*s", rows[i].text[k],
				width[k] - width_of_calibrate(rows[i].text[k]) + 2, "");
		fprintf(out, "%s\n", rows[i].text[CHANGE]);
	}
	fprintf(out, "%s%s%s: %s\n", cli_colour(out, record->pass ? CLI_GREEN : CLI_RED),
		record->pass ? "pass" : "FAIL", cli_colour(out, CLI_PLAIN),
		record->verdict);
}

static void print_written(const struct calibrate *c)
{
	if (c->dry_run)
		printf("%s: not written (--dry-run)\n", c->calibration);
	else if (c->record.pass)
		printf("wrote %s: active from now on\n", c->calibration);
	else
		printf("wrote %s: in its history only, the previous values stay active\n",
		       c->calibration);
	cli_written();
}

json_t *calibrate_budget(const struct incise_calibration_budget *budget,
			 bool sensitivities, const char *contribution)
{
	json_t *list = json_array();

	for (int i = 0; i < budget->n; i++) {
		const struct incise_calibration_part *part = &budget->part[i];
		json_t *line = json_pack("{ss ss# so ss}", "source", part->source, "type",
					 &part->type, 1, "u", json_number(part->u),
					 "unit", part->unit);

		if (sensitivities)
			json_set_number(line, "sensitivity", part->sensitivity);
		json_set_number(line, contribution, part->contribution);
		json_array_append_new(list, line);
	}
	return list;
}

json_t *calibrate_json(const struct calibrate *c, json_t *details)
{
	json_t *list = json_array();

	for (int i = 0; i < c->record.n; i++) {
		const struct incise_calibration_value *value = &c->record.values[i];

		json_array_append_new(list, json_pack("{ss ss so so so so}", "key",
						      value->key, "unit", value->unit,
						      "found", json_number(value->found),
						      "left", json_number(value->left),
						      "u", json_number(value->u), "U",
						      json_number(2 * value->u)));
	}
	return json_pack("{ss ss sb sb so so}", "kind", c->record.kind, "method",
			 c->record.method, "pass", c->record.pass, "written", !c->dry_run,
			 "values", list, "details", details);
}

/* --- the report's folder ------------------------------------------------------------- */

static const char *const report_files[] = {"report.txt", "report.json"};

/* Note the files before anything is measured. */
static void reserve_report(const char *folder)
{
	for (int i = 0; i < 2; i++) {
		char *path = cli_text("%s/%s", folder, report_files[i]);

		cli_output(path);
		free(path);
	}
	plot_reserve(folder, "fit");
	plot_reserve(folder, "residuals");
}

/* Each file appears whole. */
static FILE *begin_report(const char *folder, int i, struct incise_outfile **file)
{
	char *path = cli_text("%s/%s", folder, report_files[i]);
	FILE *out = whole_file_begin(path, file);

	free(path);
	return out;
}

void calibrate_draw(FILE *script, const char *folder, const char *name)
{
	if (!plot_draw(script, folder, name))
		cli_warn("%s.png: could not be drawn; see whether gnuplot works", name);
}

static void write_report(const struct calibrate_kind *kind, const struct calibrate *c)
{
	struct incise_outfile *file;
	json_t *object = kind->json(c);
	FILE *out;

	folder_make_all(c->report);
	if (!plot_possible()) {
		cli_warn("gnuplot is not installed, so there are no plots; %s",
			 features_remedy("gnuplot"));
	} else {
		plot_folder(c->report);
		if (!c->refused && kind->draw)
			kind->draw(c, c->report);
	}
	out = begin_report(c->report, 0, &file);
	kind->text(c, out);
	if (!c->refused)
		print_result(c, out);
	whole_file_end(file);
	out = begin_report(c->report, 1, &file);
	if (json_write(out, object, JSON_INDENT(2)))
		cli_fail("%s/report.json: no memory", c->report);
	whole_file_end(file);
	json_decref(object);
}

/* --- the whole ----------------------------------------------------------------------- */

void calibrate_check_source(const struct calibrate *c, double time_s, const char *source)
{
	if (c->from && time_s > 0)
		cli_usage("--duration does not go with --from: %s has its own", source);
	if (!c->from && !(time_s > 0) && !isatty(STDIN_FILENO))
		cli_usage("missing --duration or --from (needed without a terminal)");
	if (c->from && c->rig)
		cli_usage("--from and --rig exclude each other; give one of them");
	if (c->from && c->keep)
		cli_usage(
			"-o %s does not go with --from: the data are in that file already",
			c->keep);
}

void calibrate_check_stop(void)
{
	if (cli_stop)
		cli_fail("stopped; the previous calibration stays active");
}

void calibrate_await_enter(void)
{
	int c;

	while ((c = getchar()) != '\n')
		if (c == EOF || cli_stop)
			cli_fail("stopped; the previous calibration stays active");
}

void calibrate_find(struct calibrate *c, bool required)
{
	struct incise_error err = {0};
	int rc;

	if (!c->calibration)
		c->calibration = calibration_default();
	if (!c->calibration)
		c->calibration = "calibration.conf";
	/* It is written again if it is there, and else made. */
	if (!access(c->calibration, F_OK))
		cli_input(c->calibration);
	else if (!c->dry_run)
		cli_output_part(c->calibration); /* print_written() names it */
	if (c->report)
		reserve_report(c->report);
	rc = incise_calibration_load(c->calibration, &c->found, &err);
	if (rc == -ENOENT && !required)
		incise_calibration_nominal(&c->found);
	else if (rc)
		cli_fail_with(&err);
	if (!rc)
		c->n_history =
			incise_calibration_history(c->calibration, &c->history, &err);
	if (c->n_history < 0)
		cli_fail_with(&err);
}

static void gather_data(const struct calibrate_kind *kind, struct calibrate *c)
{
	struct incise_outfile *file;
	FILE *out;

	c->raw = c->keep ? c->keep : c->from;
	if (c->from) {
		kind->read(c, c->from);
	} else {
		/* A folder that cannot be made is found out before the measurement. */
		if (c->report)
			folder_make_all(c->report);
		kind->measure(c);
	}
	if (c->keep && kind->write) {
		out = whole_file_begin(c->keep, &file);
		kind->write(c, out);
		whole_file_end(file);
	}
}

static void begin_record(const struct calibrate_kind *kind, struct calibrate *c)
{
	const time_t now = time(NULL);
	struct tm utc;

	c->record.low = c->record.high = NAN;
	c->record.pass = true;
	calibrate_words(c->record.kind, "%s", kind->name);
	strftime(c->record.date, sizeof(c->record.date), "%Y-%m-%dT%H:%M:%SZ",
		 gmtime_r(&now, &utc));
	/* A recording is a folder, and has its own checksums. */
	if (c->raw && incise_calibration_raw(&c->record, c->raw, NULL))
		calibrate_words(c->record.raw, "%s", c->raw);
}

static void append_record(const struct calibrate *c)
{
	struct incise_error err = {0};

	if (cli_stop)
		cli_fail("stopped; %s is not written, the previous calibration stays "
			 "active",
			 c->calibration);
	if (!c->dry_run && incise_calibration_append(c->calibration, &c->record, &err))
		cli_fail_with(&err);
}

int calibrate_run(const struct calibrate_kind *kind, int argc, char **argv, void *run)
{
	struct incise_error err = {0};
	struct calibrate *c = run;

	cli_parse(kind->command, argc, argv, run);
	kind->check(run, argc, argv);
	calibrate_find(c, false);
	gather_data(kind, c);
	begin_record(kind, c);
	if (kind->fit(run, &err)) {
		if (!kind->reports_refusal)
			cli_fail_with(&err);
		c->refused = err.text;
	}
	/* Everything that can fail comes before the calibration changes. */
	if (c->report)
		write_report(kind, c);
	if (!c->refused)
		append_record(c);
	if (c->json) {
		json_print(kind->json(run));
	} else if (!c->refused) {
		if (kind->summary)
			kind->summary(run, stdout);
		print_result(c, stdout);
		print_written(c);
	}
	if (c->refused)
		cli_fail("refused: %s; %s stays as it was", c->refused, c->calibration);
	cli_finish();
	if (!c->record.pass)
		cli_fail("refused, the previous calibration stays active: %s",
			 c->record.verdict);
	return 0;
}
