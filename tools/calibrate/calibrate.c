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
		options->calibration = "calibration.conf";
	/* It is written again if it is there, and else made. */
	if (!access(options->calibration, F_OK))
		cli_input(options->calibration);
	else if (!options->dry_run)
		cli_output(options->calibration);
	if (options->report)
		reserve_report(options->report);
	rc = incise_calibration_load(options->calibration, &options->found, &err);
	if (rc == -ENOENT)
		incise_calibration_nominal(&options->found);
	else if (rc)
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

static void print_values(const struct incise_calibration_record *record)
{
	char text[UNCERTAINTY_TEXT];

	for (int i = 0; i < record->n; i++) {
		const struct incise_calibration_value *value = &record->values[i];

		printf("%-20s %s (k = 2)", value->key,
		       uncertainty_text(value->left, 2 * value->u, value->unit, text));
		if (!isnan(value->found))
			printf(", was %.4f", value->found);
		putchar('\n');
	}
}

void calibrate_end(const struct calibrate_options *options,
		   const struct incise_calibration_record *record, json_t *details)
{
	struct incise_error err = {0};
	json_t *all = json_pack("{ss ss sb sb so so}", "kind", record->kind, "method",
				record->method, "pass", record->pass, "written",
				!options->dry_run, "values", values_json(record),
				"details", details);

	/* The report first: a calibration in force must have one. */
	if (options->report)
		calibrate_report_json(options->report, json_incref(all));
	if (!options->dry_run &&
	    incise_calibration_append(options->calibration, record, &err))
		cli_fail_with(&err);
	if (options->json) {
		json_print(all);
		return;
	}
	print_values(record);
	printf("%s: %s\n", options->calibration,
	       options->dry_run ? "not written, as it is a dry run" : "in force");
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

int calibrate_cut(char *line, char **fields, int max, const char *before,
		  const char *after)
{
	int n = 0;

	line[strcspn(line, "\r\n")] = 0;
	for (char *field; n < max && (field = strsep(&line, ","));) {
		char *end;

		field += strspn(field, before);
		for (end = field + strlen(field); end > field && strchr(after, end[-1]);)
			*--end = 0;
		fields[n++] = field;
	}
	return n;
}
