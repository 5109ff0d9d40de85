// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Options and results of calibrations; see calibrate_result.h.
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "calibrate_result.h"
#include "json.h"

bool calibrate_option(struct calibrate_wish *wish, int id)
{
	switch (id) {
	case 'r':
		wish->rig = optarg;
		return true;
	case 'c':
		wish->calibration = optarg;
		return true;
	case CALIBRATE_FROM:
		wish->from = optarg;
		return true;
	case CALIBRATE_KEEP:
		wish->keep = optarg;
		return true;
	case CALIBRATE_REPORT:
		wish->report = optarg;
		return true;
	case CALIBRATE_DRY_RUN:
		wish->dry_run = true;
		return true;
	case CALIBRATE_JSON:
		wish->json = true;
		return true;
	default:
		return false;
	}
}

void calibrate_begin(struct calibrate_wish *wish)
{
	struct incise_error err = {0};

	if (wish->from && wish->rig)
		cli_usage("--from and --rig: one source at a time");
	if (wish->from && wish->keep)
		cli_usage("--keep: what comes --from a file is kept there already");
	if (!wish->calibration)
		wish->calibration = "calibration.conf";
	incise_calibration_nominal(&wish->found);
	if (!access(wish->calibration, F_OK) &&
	    incise_calibration_load(wish->calibration, &wish->found, &err))
		cli_fail_with(&err);
	if (wish->report && mkdir(wish->report, 0777) && errno != EEXIST)
		cli_fail("%s: %s", wish->report, strerror(errno));
}

FILE *calibrate_report_file(const struct calibrate_wish *wish, const char *name)
{
	char *path;
	FILE *file;

	if (!wish->report)
		return NULL;
	if (asprintf(&path, "%s/%s", wish->report, name) < 0)
		cli_fail("no memory");
	file = fopen(path, "we");
	if (!file)
		cli_fail("%s: %s", path, strerror(errno));
	free(path);
	return file;
}

void calibrate_report_end(const struct calibrate_wish *wish, FILE *file)
{
	bool failed;

	if (!file)
		return;
	failed = ferror(file);
	errno = 0;
	if (fclose(file) || failed)
		cli_fail("%s: %s; make room and run it again", wish->report,
			 strerror(errno ? errno : EIO));
}

void calibrate_value(struct incise_calibration_record *record, const char *key,
		     const char *unit, double found, double left, double u)
{
	struct incise_calibration_value *value = &record->values[record->n++];

	*value = (struct incise_calibration_value){.found = found, .left = left, .u = u};
	snprintf(value->key, sizeof(value->key), "%s", key);
	snprintf(value->unit, sizeof(value->unit), "%s", unit);
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

void calibrate_end(const struct calibrate_wish *wish,
		   const struct incise_calibration_record *record, json_t *details)
{
	struct incise_error err = {0};
	FILE *file = calibrate_report_file(wish, "report.json");
	json_t *all =
		json_pack("{ss ss sb sb so so}", "kind", record->kind, "method",
			  record->method, "pass", record->pass, "written", !wish->dry_run,
			  "values", values_json(record), "details", details);

	/* The report first: what is in force is to have one. */
	if (file) {
		json_dumpf(all, file, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
		putc('\n', file);
		calibrate_report_end(wish, file);
	}
	if (!wish->dry_run && incise_calibration_append(wish->calibration, record, &err))
		cli_fail_with(&err);
	if (wish->json) {
		json_print(all);
	} else {
		for (int i = 0; i < record->n; i++) {
			const struct incise_calibration_value *value = &record->values[i];

			printf("%-20s %.4f %s, U = %.4f (k = 2)", value->key, value->left,
			       value->unit, 2 * value->u);
			if (!isnan(value->found))
				printf(", was %.4f", value->found);
			putchar('\n');
		}
		printf("%s: %s\n", wish->calibration,
		       wish->dry_run ? "not written, as it is a dry run" : "in force");
		json_decref(all);
	}
	cli_finish();
}
