// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Metrics of a benchmark, written and read; see metrics.h.
 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "metrics.h"

#define METRICS_MAX 100000

const char *const metric_kind_names[METRIC_KINDS] = {"time", "measured", "exact"};

/* Keys of a time as multiples of each workload; with "_low" and "_high" for its interval. */
static const char *const workload_keys[WORKLOADS] = {"yardsticks", "wide_yardsticks",
						     "memory_yardsticks"};

/* --- written --- */

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

static json_t *append(json_t *metrics, enum metric_kind kind, double value,
		      const char *unit, const char *fmt, va_list args)
{
	char name[METRIC_NAME_BYTES];
	json_t *metric;

	if (!isfinite(value))
		return NULL;
	vsnprintf(name, sizeof(name), fmt, args);
	metric = json_pack("{ss ss sf so}", "kind", metric_kind_names[kind], "unit", unit,
			   "value", value, "name", json_text(name));
	json_array_append_new(metrics, metric);
	return metric;
}

/* "PREFIX", "PREFIX_low" and "PREFIX_high", or "low" and "high" alone. */
static void interval_keys(const char *prefix, char low[40], char high[40])
{
	snprintf(low, 40, "%s%slow", prefix, *prefix ? "_" : "");
	snprintf(high, 40, "%s%shigh", prefix, *prefix ? "_" : "");
}

static void set_interval(json_t *metric, const char *prefix, double k,
			 const struct harness_spread *spread)
{
	char low[40], high[40];

	interval_keys(prefix, low, high);
	json_object_set_new(metric, low, json_number(k * spread->low));
	json_object_set_new(metric, high, json_number(k * spread->high));
}

json_t *metrics_time(json_t *metrics, const struct harness_time *time, const char *unit,
		     const char *fmt, ...)
{
	double k = 1 / unit_ns(unit);
	json_t *metric;
	va_list args;

	va_start(args, fmt);
	metric = append(metrics, METRIC_TIME, k * time->ns.median, unit, fmt, args);
	va_end(args);
	if (!metric)
		return NULL;
	set_interval(metric, "", k, &time->ns);
	for (int w = 0; w < WORKLOADS; w++) {
		json_object_set_new(metric, workload_keys[w],
				    json_number(time->by[w].median));
		set_interval(metric, workload_keys[w], 1, &time->by[w]);
	}
	return metric;
}

json_t *metrics_measured(json_t *metrics, const struct harness_spread *spread,
			 const char *unit, const char *fmt, ...)
{
	json_t *metric;
	va_list args;

	va_start(args, fmt);
	metric = append(metrics, METRIC_MEASURED, spread->median, unit, fmt, args);
	va_end(args);
	if (metric)
		set_interval(metric, "", 1, spread);
	return metric;
}

json_t *metrics_exact(json_t *metrics, double value, const char *unit, const char *fmt,
		      ...)
{
	json_t *metric;
	va_list args;

	va_start(args, fmt);
	metric = append(metrics, METRIC_EXACT, value, unit, fmt, args);
	va_end(args);
	return metric;
}

void metrics_more_is_better(json_t *metric)
{
	if (metric)
		json_object_set_new(metric, "better", json_string("more"));
}

/* --- read again --- */

/* Fit for a terminal: UTF-8 it is, as jansson reads no other. */
static bool plain(const char *text)
{
	size_t n = strlen(text);

	if (!n || n > METRIC_NAME_BYTES)
		return false;
	for (const unsigned char *c = (const unsigned char *)text; *c; c++)
		if (*c < ' ' || *c == 0x7f || (*c == 0xc2 && c[1] < 0xa0))
			return false;
	return true;
}

static int number(const json_t *object, const char *key, double *value, const char *where,
		  struct incise_error *err)
{
	const json_t *is = json_object_get(object, key);

	if (!json_is_number(is))
		return incise_error_set(err, EINVAL, "%s: '%s' is %s", where, key,
					is ? "no number" : "missing");
	*value = json_number_value(is);
	return 0;
}

static int text(const json_t *object, const char *key, const char **value,
		const char *where, struct incise_error *err)
{
	const json_t *is = json_object_get(object, key);

	if (!json_is_string(is))
		return incise_error_set(err, EINVAL, "%s: '%s' is %s", where, key,
					is ? "no text" : "missing");
	*value = json_string_value(is);
	if (strlen(*value) != json_string_length(is) || !plain(*value))
		return incise_error_set(err, EINVAL,
					"%s: '%s' is empty, too long, or holds control "
					"characters",
					where, key);
	return 0;
}

static int read_kind(const json_t *from, struct metric *m, const char *where,
		     struct incise_error *err)
{
	const char *name;
	int rc = text(from, "kind", &name, where, err), kind = 0;

	if (rc)
		return rc;
	while (kind < METRIC_KINDS && strcmp(name, metric_kind_names[kind]))
		kind++;
	if (kind == METRIC_KINDS)
		return incise_error_set(err, EINVAL,
					"%s: '%s' is none of time, measured and exact",
					where, name);
	m->kind = (enum metric_kind)kind;
	return 0;
}

static int read_interval(const json_t *from, const char *key, const char *prefix,
			 struct interval *interval, const char *where,
			 struct incise_error *err)
{
	char low[40], high[40];
	int rc;

	interval_keys(prefix, low, high);
	rc = number(from, key, &interval->middle, where, err);
	if (!rc)
		rc = number(from, low, &interval->low, where, err);
	if (!rc)
		rc = number(from, high, &interval->high, where, err);
	if (!rc &&
	    !(interval->low <= interval->middle && interval->middle <= interval->high))
		rc = incise_error_set(
			err, EINVAL,
			"%s: '%s', %g, is not between %g and %g, its interval", where,
			key, interval->middle, interval->low, interval->high);
	return rc;
}

/* One interval, or one for each workload. */
static int read_intervals(const json_t *from, struct metric *m, const char *where,
			  struct incise_error *err)
{
	int rc = 0;

	m->scales = m->kind == METRIC_TIME ? WORKLOADS : 1;
	m->by[0] = (struct interval){m->value, m->value, m->value};
	if (m->kind == METRIC_MEASURED)
		return read_interval(from, "value", "", &m->by[0], where, err);
	for (int w = 0; m->kind == METRIC_TIME && !rc && w < WORKLOADS; w++)
		rc = read_interval(from, workload_keys[w], workload_keys[w], &m->by[w],
				   where, err);
	return rc;
}

static int read_metric(const json_t *from, struct metric *m, const char *where,
		       struct incise_error *err)
{
	const char *better = "less";
	int rc;

	if (!json_is_object(from))
		return incise_error_set(err, EINVAL, "%s is no object", where);
	rc = text(from, "name", &m->name, where, err);
	if (!rc)
		rc = text(from, "unit", &m->unit, where, err);
	if (!rc)
		rc = read_kind(from, m, where, err);
	if (!rc)
		rc = number(from, "value", &m->value, where, err);
	if (!rc && json_object_get(from, "better"))
		rc = text(from, "better", &better, where, err);
	m->more_is_better = !strcmp(better, "more");
	return rc ? rc : read_intervals(from, m, where, err);
}

#define KEY_BYTES (2 * METRIC_NAME_BYTES + 2)

/* Of a metric, or with an empty name of a benchmark: no metric's name is empty. */
static const char *key_of(const char *bench, const char *name, char key[KEY_BYTES])
{
	snprintf(key, KEY_BYTES, "%s\n%s", bench ? bench : "", name);
	return key;
}

static int add(struct metrics *all, const char *bench, const json_t *from, size_t i,
	       struct incise_error *err)
{
	struct metric *m = &all->metric[all->n];
	char where[600], key[KEY_BYTES];
	int rc;

	*m = (struct metric){.bench = bench};
	snprintf(where, sizeof(where), "%.200s: %s%sfigures[%zu]", all->report,
		 bench ? bench : "", bench ? "." : "", i);
	rc = read_metric(from, m, where, err);
	if (rc)
		return rc;
	if (json_object_get(all->index, key_of(bench, m->name, key)))
		return incise_error_set(err, EINVAL, "%s: '%s' stands twice", where,
					m->name);
	if (json_object_set_new(all->index, key, json_integer(all->n++)))
		return incise_error_set(err, ENOMEM, "%s: no memory", all->report);
	return 0;
}

static int add_all(struct metrics *all, const char *bench, const json_t *list,
		   struct incise_error *err)
{
	size_t n = json_array_size(list);
	struct metric *grown;
	char key[KEY_BYTES];
	int rc = 0;

	if (bench && !plain(bench))
		return incise_error_set(err, EINVAL,
					"%s: a word's name is empty, too long, or holds "
					"control characters",
					all->report);
	if (!json_is_array(list))
		return incise_error_set(err, EINVAL, "%s: %s%s'figures' is no list",
					all->report, bench ? bench : "",
					bench ? ": " : "");
	if (all->n + n > METRICS_MAX)
		return incise_error_set(err, E2BIG, "%s: more than %d figures",
					all->report, METRICS_MAX);
	grown = realloc(all->metric, (all->n + n + 1) * sizeof(*grown));
	if (grown)
		all->metric = grown;
	if (!grown || (bench && n &&
		       json_object_set_new(all->index, key_of(bench, "", key),
					   json_integer(all->n))))
		return incise_error_set(err, ENOMEM, "%s: no memory", all->report);
	for (size_t i = 0; i < n && !rc; i++)
		rc = add(all, bench, json_array_get(list, i), i, err);
	return rc;
}

int metrics_read(const json_t *report, const char *name, struct metrics *all,
		 struct incise_error *err)
{
	const json_t *list = json_object_get(report, "figures"), *member;
	const char *bench;
	int rc = 0;

	*all = (struct metrics){.report = name, .index = json_object()};
	if (!all->index)
		return incise_error_set(err, ENOMEM, "%s: no memory", name);
	if (list)
		return add_all(all, NULL, list, err);
	json_object_foreach((json_t *)report, bench, member)
	{
		list = json_object_get(member, "figures");
		if (list && !rc)
			rc = add_all(all, bench, list, err);
	}
	if (!rc && !all->n)
		rc = incise_error_set(err, EINVAL,
				      "%s: holds no figures; expected what 'incise bench "
				      "WORD --json' wrote",
				      name);
	return rc;
}

void metrics_free(struct metrics *all)
{
	free(all->metric);
	json_decref(all->index);
}

const struct metric *metrics_find(const struct metrics *all, const struct metric *like)
{
	char key[KEY_BYTES];
	const json_t *place =
		json_object_get(all->index, key_of(like->bench, like->name, key));
	const struct metric *found =
		place ? &all->metric[json_integer_value(place)] : NULL;

	/* In another unit it is another metric. */
	return found && found->kind == like->kind && !strcmp(found->unit, like->unit)
		       ? found
		       : NULL;
}

bool metrics_have(const struct metrics *all, const char *bench)
{
	char key[KEY_BYTES];

	return json_object_get(all->index, key_of(bench, "", key));
}
