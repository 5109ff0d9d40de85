// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The common part of all incise calibrate commands; see calibrate.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../cli/calibration.h"
#include "../cli/file_kind.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/uncertainty.h"
#include "calibrate.h"

/* Note the files of --report before anything is measured. */
static void reserve_report(const char *folder)
{
	static const char *const files[] = {"report.txt", "report.json"};

	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++) {
		char *path = cli_text("%s/%s", folder, files[i]);

		cli_output(path);
		free(path);
	}
	plot_reserve(folder, "fit");
	plot_reserve(folder, "residuals");
}

void calibrate_find(struct calibrate_options *options)
{
	struct incise_error err = {0};
	int rc;

	if (!options->calibration)
		options->calibration = calibration_default();
	if (!options->calibration)
		options->calibration = "calibration.conf";
	/* It is written again if it is there, and else made. */
	if (!access(options->calibration, F_OK))
		cli_input(options->calibration);
	else if (!options->dry_run)
		cli_output_part(options->calibration); /* calibrate_result() names it */
	if (options->report)
		reserve_report(options->report);
	rc = incise_calibration_load(options->calibration, &options->found, &err);
	if (rc == -ENOENT)
		incise_calibration_nominal(&options->found);
	else if (rc)
		cli_fail_with(&err);
	if (!rc)
		options->n_history = incise_calibration_history(options->calibration,
								&options->history, &err);
	if (options->n_history < 0)
		cli_fail_with(&err);
}

void calibrate_begin(struct calibrate_options *options)
{
	if (options->from && options->rig)
		cli_usage("--from and --rig exclude each other; give one of them");
	if (options->from && options->keep)
		cli_usage("--keep does not go with --from: the data are in that file "
			  "already");
	calibrate_find(options);
	if (options->report && mkdir(options->report, 0777) && errno != EEXIST)
		cli_fail("%s: %s", options->report, strerror(errno));
}

void calibrate_value(struct incise_calibration_record *record, const char *key,
		     const char *unit, double found, double left, double u)
{
	struct incise_calibration_value *value = &record->values[record->n++];

	*value = (struct incise_calibration_value){.found = found, .left = left, .u = u};
	snprintf(value->key, sizeof(value->key), "%s", key);
	snprintf(value->unit, sizeof(value->unit), "%s", unit);
}

void calibrate_stated(const struct calibrate_options *options,
		      struct incise_calibration_record *record, double given,
		      const char *key, const char *unit, const char *question)
{
	double found = incise_calibration_get(&options->found, key);
	char line[100], *end;

	if (isnan(given) && isnan(found) && !options->json && isatty(STDIN_FILENO) &&
	    isatty(STDERR_FILENO)) {
		fprintf(stderr, "%s, in %s [not stated] ", question, unit);
		*line = '\n';
		/* The end of the input leaves it out, too. */
		if (!fgets(line, sizeof(line), stdin) && cli_stop)
			cli_fail("stopped; the previous calibration stays active");
		if (*line != '\n') {
			given = incise_decimal(line, &end);
			if (end == line || *end != '\n' || !(given >= 0 && given <= 1000))
				cli_fail("expected a number of %s from 0 to 1000; the "
					 "previous calibration stays active",
					 unit);
		}
	}
	if (isnan(given))
		return;
	for (int i = 0; i <= record->n && record->n_covariance; i++)
		record->covariance[record->n_covariance++] = 0;
	calibrate_value(record, key, unit, found, given, 0);
}

static FILE *begin_file(const char *folder, const char *name,
			struct incise_outfile **file)
{
	char *path = cli_text("%s/%s", folder, name);
	FILE *out = whole_file_begin(path, file);

	free(path);
	return out;
}

FILE *calibrate_report_text(const char *folder, struct incise_outfile **file)
{
	*file = NULL;
	return folder ? begin_file(folder, "report.txt", file) : NULL;
}

void calibrate_report_json(const char *folder, json_t *object)
{
	struct incise_outfile *file;
	FILE *out = begin_file(folder, "report.json", &file);

	if (json_write(out, object, JSON_INDENT(2)))
		cli_fail("%s/report.json: no memory", folder);
	whole_file_end(file);
	json_decref(object);
}

bool calibrate_can_plot(const char *folder)
{
	if (plot_possible()) {
		plot_folder(folder);
		return true;
	}
	cli_warn("gnuplot is not installed, so there are no plots; apt-get install "
		 "gnuplot-nox");
	return false;
}

static json_t *values_json(const struct incise_calibration_record *record)
{
	json_t *list = json_array();

	for (int i = 0; i < record->n; i++) {
		const struct incise_calibration_value *value = &record->values[i];

		json_array_append_new(list, json_pack("{ss ss so so so so}", "key",
						      value->key, "unit", value->unit,
						      "found", json_number(value->found),
						      "left", json_number(value->left),
						      "u", json_number(value->u), "U",
						      json_number(2 * value->u)));
	}
	return list;
}

/* --- the block at the end ---------------------------------------------------------------- */

enum { KEY, VALUE, PREVIOUS, CHANGE, COLUMNS };

struct row {
	char text[COLUMNS][UNCERTAINTY_TEXT];
};

/* Date of the calibration that gave the previous value; NULL: none did. */
static const char *previous_date(const struct calibrate_options *options,
				 const struct incise_calibration_value *value)
{
	const char *date = NULL;
	double left = NAN;

	for (int i = 0; i < options->n_history; i++) {
		const struct incise_calibration_record *r = &options->history[i];

		for (int k = 0; r->pass && k < r->n; k++)
			if (!strcmp(r->values[k].key, value->key)) {
				left = r->values[k].left;
				date = r->date;
			}
	}
	return left == value->found ? date : NULL;
}

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

static void fill_row(const struct calibrate_options *options,
		     const struct incise_calibration_value *value, struct row *row)
{
	const char *date = previous_date(options, value);
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
	if (!date)
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
static int width_of(const char *text)
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

void calibrate_result_text(const struct calibrate_options *options,
			   const struct incise_calibration_record *record, FILE *out)
{
	struct row rows[INCISE_CALIBRATION_VALUES + 1] = {
		{{"result", "value ± U (k = 2)", "previous", "change"}}};
	int width[COLUMNS] = {0}, n = 1;

	for (int i = 0; i < record->n; i++)
		if (!is_of_another(&record->values[i]))
			fill_row(options, &record->values[i], &rows[n++]);
	for (int i = 0; i < n; i++)
		for (int c = 0; c < COLUMNS; c++)
			width[c] = (int)fmax(width[c], width_of(rows[i].text[c]));
	fputc('\n', out);
	for (int i = 0; i < n; i++) {
		for (int c = 0; c < CHANGE; c++)
			fprintf(out, "%s%*s", rows[i].text[c],
				width[c] - width_of(rows[i].text[c]) + 2, "");
		fprintf(out, "%s\n", rows[i].text[CHANGE]);
	}
	fprintf(out, "%s%s%s: %s\n", cli_colour(out, record->pass ? CLI_GREEN : CLI_RED),
		record->pass ? "pass" : "FAIL", cli_colour(out, CLI_PLAIN),
		record->verdict);
}

void calibrate_result(const struct calibrate_options *options,
		      const struct incise_calibration_record *record)
{
	calibrate_result_text(options, record, stdout);
	if (options->dry_run)
		printf("%s: not written (--dry-run)\n", options->calibration);
	else if (record->pass)
		printf("wrote %s: active from now on\n", options->calibration);
	else
		printf("wrote %s: in its history only, the previous values stay active\n",
		       options->calibration);
	cli_written();
}

void calibrate_append(const struct calibrate_options *options,
		      const struct incise_calibration_record *record)
{
	struct incise_error err = {0};

	if (cli_stop)
		cli_fail("stopped; %s is not written, the previous calibration stays "
			 "active",
			 options->calibration);
	if (!options->dry_run &&
	    incise_calibration_append(options->calibration, record, &err))
		cli_fail_with(&err);
}

void calibrate_require_pass(const struct incise_calibration_record *record)
{
	cli_finish();
	if (!record->pass)
		cli_fail("refused, the previous calibration stays active: %s",
			 record->verdict);
}

void calibrate_end(const struct calibrate_options *options,
		   const struct incise_calibration_record *record, json_t *details)
{
	json_t *all = json_pack("{ss ss sb sb so so}", "kind", record->kind, "method",
				record->method, "pass", record->pass, "written",
				!options->dry_run, "values", values_json(record),
				"details", details);

	/* The report first: a calibration in force must have one. */
	if (options->report)
		calibrate_report_json(options->report, json_incref(all));
	calibrate_append(options, record);
	if (options->json) {
		json_print(all);
		return;
	}
	calibrate_result(options, record);
	json_decref(all);
	cli_finish();
}

struct incise_infile *calibrate_open(const char *path)
{
	static const struct incise_infile_kind csv = {
		.name = "a CSV file of a calibration",
		.advice = "give a CSV file with a line of column names",
		.size_max = 1 << 30,
	};
	struct incise_error err = {0};

	file_expect(path, FILE_TABLE);
	return cli_require(incise_infile_open(path, &csv, &err), &err);
}

bool calibrate_line(struct incise_infile *file, char **line)
{
	struct incise_error err = {0};
	int rc = incise_infile_line(file, line, &err);

	if (rc < 0)
		cli_fail_with(&err);
	return rc;
}

int calibrate_cut(const char *path, int number, char *line, char **fields, int max,
		  const char *before, const char *after)
{
	int n = 0;

	line[strcspn(line, "\r\n")] = 0;
	for (char *field; (field = strsep(&line, ","));) {
		char *end;

		if (n == max)
			cli_fail("%s:%d: more than %d columns; leave out those that are "
				 "not needed",
				 path, number, max);
		field += strspn(field, before);
		for (end = field + strlen(field); end > field && strchr(after, end[-1]);)
			*--end = 0;
		fields[n++] = field;
	}
	return n;
}

int calibrate_column(const char *path, int line, char **fields, int n, const char *name)
{
	int at = -1;

	for (int i = 0; i < n; i++) {
		if (strcmp(fields[i], name))
			continue;
		if (at >= 0)
			cli_fail("%s:%d: two columns are called %s; rename one", path,
				 line, name);
		at = i;
	}
	return at;
}

void calibrate_width(const char *path, int line, int n, int columns)
{
	if (n != columns)
		cli_fail("%s:%d: %d fields, but the first line names %d columns; "
			 "correct the line, or remove it",
			 path, line, n, columns);
}
