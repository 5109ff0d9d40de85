// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Metrics of benchmarks, written and compared; see metrics.h. The script tools/report/compare.py
 * compares.
 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/file.h"
#include "../cli/report_script.h"
#include "metrics.h"

/* --- written --- */

/* The longest name of a benchmark or a metric. */
#define METRIC_NAME_BYTES 300

static const char *const kind_names[METRIC_KINDS] = {"time", "measured", "exact"};

/* Keys of a time as multiples of each workload. */
static const char *const workload_keys[WORKLOADS] = {"yardsticks", "wide_yardsticks",
						     "memory_yardsticks"};

static double unit_ns(const char *unit)
{
	static const struct {
		const char *name;
		double ns;
	} units[] = {{"ns", 1}, {"us", 1e3}, {"ms", 1e6}, {"s", 1e9}};

	for (size_t i = 0; i < sizeof(units) / sizeof(*units); i++)
		if (!strcmp(unit, units[i].name))
			return units[i].ns;
	cli_fail("'%s' is no unit of time", unit);
}

/* "PREFIX_low" and "PREFIX_high", or "low" and "high" alone. */
static void set_interval(json_t *metric, const char *prefix, double k,
			 const struct harness_spread *spread)
{
	const char *gap = *prefix ? "_" : "";
	char key[40];

	snprintf(key, sizeof(key), "%s%slow", prefix, gap);
	json_set_number(metric, key, k * spread->low);
	snprintf(key, sizeof(key), "%s%shigh", prefix, gap);
	json_set_number(metric, key, k * spread->high);
}

json_t *metrics_add(json_t *metrics, enum metric_kind kind, const void *value,
		    const char *unit, const char *fmt, ...)
{
	const struct harness_time *time = value;
	const struct harness_spread *spread = value; /* of a time it comes first */
	double k = kind == METRIC_TIME ? 1 / unit_ns(unit) : 1;
	double middle =
		kind == METRIC_EXACT ? *(const double *)value : k * spread->median;
	char name[METRIC_NAME_BYTES];
	json_t *metric;
	va_list args;

	if (!isfinite(middle))
		return NULL;
	va_start(args, fmt);
	vsnprintf(name, sizeof(name), fmt, args);
	va_end(args);
	metric = json_pack("{ss ss sf so}", "kind", kind_names[kind], "unit", unit,
			   "value", middle, "name", json_text(name));
	json_array_append_new(metrics, metric);
	if (kind != METRIC_EXACT)
		set_interval(metric, "", k, spread);
	for (int w = 0; kind == METRIC_TIME && w < WORKLOADS; w++) {
		json_set_number(metric, workload_keys[w], time->by[w].median);
		set_interval(metric, workload_keys[w], 1, &time->by[w]);
	}
	return metric;
}

void metrics_more_is_better(json_t *metric)
{
	if (metric)
		json_object_set_new(metric, "better", json_string("more"));
}

/* --- comparison --- */

json_t *compare_reports(const json_t *old_report, const char *old_name,
			const json_t *new_report, const char *new_name,
			struct incise_error *err)
{
	struct memory_file said = memory_file_begin("comparison");
	json_t *pair = json_pack("{sO so sO so}", "old", old_report, "old_name",
				 json_text(old_name), "new", new_report, "new_name",
				 json_text(new_name)),
	       *comparison = NULL;
	const char *failed;

	if (!report_script("compare", NULL, pair, said.file, err)) {
		rewind(said.file);
		comparison = json_loadf(said.file, 0, NULL);
		if (!comparison)
			incise_error_set(err, ENOMEM, "no memory for a comparison");
	}
	failed = json_string_value(json_object_get(comparison, "failed"));
	if (failed) {
		incise_error_set(err, EINVAL, "%s", failed);
		json_decref(comparison);
		comparison = NULL;
	}
	json_decref(pair);
	fclose(said.file);
	return comparison;
}

json_t *compare_load(const char *path)
{
	struct incise_error err = {0};
	json_t *report = cli_require(json_read(path, &err), &err);

	json_decref(cli_require(compare_reports(report, path, report, path, &err), &err));
	return report;
}

int compare_worse(const json_t *comparison)
{
	return (int)json_integer_value(json_object_get(comparison, "worse")) +
	       (int)json_array_size(json_object_get(comparison, "gone"));
}

int compare_print(json_t *comparison, bool json)
{
	int worse = compare_worse(comparison);

	if (json) {
		json_object_del(comparison, "text");
		json_print(json_with_schema(comparison, "bench compare"));
	} else {
		fputs(json_string_value(json_object_get(comparison, "text")), stdout);
		json_decref(comparison);
		cli_finish();
	}
	return worse;
}

void compare_fail(int worse)
{
	cli_fail("%d metric%s worse or gone, see above", worse,
		 worse > 1 ? "s are" : " is");
}
