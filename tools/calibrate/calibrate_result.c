// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Results of calibrations; see calibrate_result.h.
 */
#include <math.h>
#include <stdio.h>
#include "calibrate_report.h"
#include "calibrate_result.h"
#include "../cli/json.h"

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
	json_t *all =
		json_pack("{ss ss sb sb so so}", "kind", record->kind, "method",
			  record->method, "pass", record->pass, "written", !wish->dry_run,
			  "values", values_json(record), "details", details);

	/* The report first: what is in force is to have one. */
	if (wish->report)
		calibrate_report_json(wish->report, all);
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
