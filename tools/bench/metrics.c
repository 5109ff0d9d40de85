// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Metrics of benchmarks, written, read and compared; see metrics.h.
 */
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/file.h"
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
	json_set_number(metric, low, k * spread->low);
	json_set_number(metric, high, k * spread->high);
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

/* --- read again --- */

#define METRICS_MAX 100000

struct metric {
	const char *bench; /* NULL in a report of one benchmark */
	const char *name, *unit;
	enum metric_kind kind;
	double value;
	/* Compared is a time by each workload, else the value. */
	struct interval {
		double middle, low, high;
	} by[WORKLOADS];
	int scales;
	bool more_is_better;
};

struct metrics {
	const char *report; /* as messages name it */
	struct metric *metric;
	int n;
	size_t capacity; /* of metric */
	json_t *index; /* place by benchmark and name; of a benchmark alone it is there, too */
};

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

static int read_number(const json_t *object, const char *key, double *value,
		       const char *where, struct incise_error *err)
{
	const json_t *is = json_object_get(object, key);

	if (!json_is_number(is))
		return incise_error_set(err, EINVAL, "%s: '%s' is %s", where, key,
					is ? "no number" : "missing");
	*value = json_number_value(is);
	return 0;
}

static int read_text(const json_t *object, const char *key, const char **value,
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
	int rc = read_text(from, "kind", &name, where, err), kind = 0;

	if (rc)
		return rc;
	while (kind < METRIC_KINDS && strcmp(name, kind_names[kind]))
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
	rc = read_number(from, key, &interval->middle, where, err);
	if (!rc)
		rc = read_number(from, low, &interval->low, where, err);
	if (!rc)
		rc = read_number(from, high, &interval->high, where, err);
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
	rc = read_text(from, "name", &m->name, where, err);
	if (!rc)
		rc = read_text(from, "unit", &m->unit, where, err);
	if (!rc)
		rc = read_kind(from, m, where, err);
	if (!rc)
		rc = read_number(from, "value", &m->value, where, err);
	if (!rc && json_object_get(from, "better"))
		rc = read_text(from, "better", &better, where, err);
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
		return incise_error_set(err, EINVAL, "%s: '%s' occurs twice", where,
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
		return incise_error_set(
			err, EINVAL,
			"%s: a benchmark's name is empty, too long, or holds "
			"control characters",
			all->report);
	if (!json_is_array(list))
		return incise_error_set(err, EINVAL, "%s: %s%s'figures' is no list",
					all->report, bench ? bench : "",
					bench ? ": " : "");
	if (all->n + n > METRICS_MAX)
		return incise_error_set(err, E2BIG, "%s: more than %d figures",
					all->report, METRICS_MAX);
	if (all->n + n > all->capacity) {
		all->capacity = 2 * (all->n + n);
		grown = realloc(all->metric, all->capacity * sizeof(*grown));
		if (!grown)
			return incise_error_set(err, ENOMEM, "%s: no memory",
						all->report);
		all->metric = grown;
	}
	if (bench && n &&
	    json_object_set_new(all->index, key_of(bench, "", key), json_integer(all->n)))
		return incise_error_set(err, ENOMEM, "%s: no memory", all->report);
	for (size_t i = 0; i < n && !rc; i++)
		rc = add(all, bench, json_array_get(list, i), i, err);
	return rc;
}

/* Read those of a report, in which they live. A file may have been written by anyone: each type is
 * checked, and names are fit for a terminal. Returns 0 or a negative errno, and the reason; free
 * them in either case. */
static int metrics_read(const json_t *report, const char *name, struct metrics *all,
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
		rc = incise_error_set(
			err, EINVAL,
			"%s: no metrics; expected the output of 'incise bench "
			"NAME --json'",
			name);
	return rc;
}

static void metrics_free(struct metrics *all)
{
	free(all->metric);
	json_decref(all->index);
}

/* The one of that benchmark, name, kind and unit, or NULL. */
static const struct metric *metrics_find(const struct metrics *all,
					 const struct metric *like)
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

/* Whether any is of that benchmark. */
static bool metrics_have(const struct metrics *all, const char *bench)
{
	char key[KEY_BYTES];

	return json_object_get(all->index, key_of(bench, "", key));
}

/* --- comparison --- */

/* Gaps between the intervals of the same build's runs, as part of the value; measured, see
 * incise-bench(1). */
#define TIME_NOISE 0.05
#define MEASURED_NOISE 0.5
/* A report's numbers have 12 digits. */
#define EXACT_NOISE 1e-9

/* By how much the workloads disagree about a time, as part of it: one of the machines, or
 * of its hours, was slower at some work than at other, and at which this is, is not known. */
static double disagreement(const struct metric *was, const struct metric *is)
{
	double least = INFINITY, most = 0;

	for (int i = 0; i < is->scales; i++) {
		double ratio = fabs(is->by[i].middle / was->by[i].middle);

		least = fmin(least, ratio);
		most = fmax(most, ratio);
	}
	return is->scales > 1 && isfinite(most / least) ? most / least - 1 : 0;
}

/* Beyond noise: 1 more, -1 less, else 0. A time changed if it did by each workload. */
static int changed(const struct metric *was, const struct metric *is)
{
	static const double noises[METRIC_KINDS] = {TIME_NOISE, MEASURED_NOISE,
						    EXACT_NOISE};
	double noise = noises[is->kind] + disagreement(was, is);
	int more = 0, less = 0;

	for (int i = 0; i < is->scales; i++) {
		const struct interval *a = &was->by[i], *b = &is->by[i];
		double least = noise * fmax(fabs(a->middle), fabs(b->middle));

		more += b->low - a->high > least;
		less += a->low - b->high > least;
	}
	return (more == is->scales) - (less == is->scales);
}

/* New by old; of a time the one that is nearest to 1, by which it is judged. */
static double ratio(const struct metric *was, const struct metric *is)
{
	double nearest = is->by[0].middle / was->by[0].middle;

	for (int i = 1; i < is->scales; i++) {
		double other = is->by[i].middle / was->by[i].middle;

		if (fabs(log(other)) < fabs(log(nearest)))
			nearest = other;
	}
	return nearest;
}

static json_t *metric_json(const struct metric *m)
{
	return json_pack("{ss? ss ss ss}", "benchmark", m->bench, "name", m->name, "kind",
			 kind_names[m->kind], "unit", m->unit);
}

static json_t *change_json(const struct metric *was, const struct metric *is, bool worse)
{
	json_t *change = metric_json(is);

	json_object_set_new(change, "old", json_number(was->value));
	json_object_set_new(change, "new", json_number(is->value));
	json_object_set_new(change, "ratio", json_number(ratio(was, is)));
	json_object_set_new(change, "worse", json_boolean(worse));
	return change;
}

/* Metrics of @from that @to lacks. A benchmark that is not there at all is one line. */
static json_t *missing(const struct metrics *from, const struct metrics *to)
{
	const char *bench = NULL;
	bool known = true;
	json_t *list = json_array();

	for (int i = 0; i < from->n; i++) {
		const struct metric *m = &from->metric[i];

		/* Metrics of a benchmark are together. */
		if (m->bench && m->bench != bench) {
			bench = m->bench;
			known = metrics_have(to, bench);
			if (!known)
				json_array_append_new(list,
						      json_pack("{ss sn}", "benchmark",
								bench, "name"));
		}
		if (known && !metrics_find(to, m))
			json_array_append_new(list, metric_json(m));
	}
	return list;
}

static const json_t *part_of(const json_t *report, const char *key)
{
	const json_t *is = json_object_get(report, key), *member;
	const char *bench;

	if (is)
		return is;
	json_object_foreach((json_t *)report, bench, member)
	{
		is = json_object_get(member, key);
		if (is && json_object_get(member, "figures"))
			return is;
	}
	return NULL;
}

/* Keys of machine and build that differ. */
static json_t *differing(const json_t *old_report, const json_t *new_report)
{
	static const char *const keys[] = {"version",	 "cpu",	       "compiler",
					   "flags",	 "kernel",     "vectors",
					   "preempt_rt", "hypervisor", "processors",
					   "governor"};
	const json_t *was = part_of(old_report, "machine"),
		     *is = part_of(new_report, "machine");
	json_t *list = json_array();

	for (size_t i = 0; i < sizeof(keys) / sizeof(*keys); i++) {
		const json_t *a = json_object_get(was, keys[i]),
			     *b = json_object_get(is, keys[i]);

		if ((a || b) && !json_equal(a, b))
			json_array_append_new(list, json_string(keys[i]));
	}
	return list;
}

static json_t *compare_all(const struct metrics *was, const struct metrics *is,
			   const json_t *differs)
{
	json_t *list = json_array();
	int same = 0, better = 0, worse = 0;

	for (int i = 0; i < is->n; i++) {
		const struct metric *m = &is->metric[i], *before = metrics_find(was, m);
		int way = before ? changed(before, m) : 0;
		bool bad = way > 0 ? !m->more_is_better : m->more_is_better;

		if (!way) {
			same += before != NULL;
			continue;
		}
		worse += bad;
		better += !bad;
		json_array_append_new(list, change_json(before, m, bad));
	}
	return json_pack("{sO so so so si si si}", "differs", differs, "changed", list,
			 "gone", missing(was, is), "new", missing(is, was), "same", same,
			 "better", better, "worse", worse);
}

static int comparable(const struct metrics *was, const struct metrics *is,
		      const json_t *old_report, const json_t *new_report,
		      struct incise_error *err)
{
	const json_t *old_quick = part_of(old_report, "quick"),
		     *new_quick = part_of(new_report, "quick");

	if (json_is_boolean(old_quick) && json_is_boolean(new_quick) &&
	    json_is_true(old_quick) != json_is_true(new_quick))
		return incise_error_set(
			err, EINVAL,
			"%s was made with --quick and %s was not: compare "
			"reports of the same kind",
			json_is_true(old_quick) ? was->report : is->report,
			json_is_true(old_quick) ? is->report : was->report);
	for (int i = 0; i < is->n; i++)
		if (metrics_find(was, &is->metric[i]))
			return 0;
	return incise_error_set(
		err, EINVAL,
		"%s and %s have no metric in common: compare two reports of "
		"one benchmark, or two of incise bench all",
		was->report, is->report);
}

json_t *compare_reports(const json_t *old_report, const char *old_name,
			const json_t *new_report, const char *new_name,
			struct incise_error *err)
{
	json_t *comparison = NULL, *differs = NULL;
	struct metrics was, is = {0};
	int rc = metrics_read(old_report, old_name, &was, err);

	if (!rc)
		rc = metrics_read(new_report, new_name, &is, err);
	if (!rc)
		rc = comparable(&was, &is, old_report, new_report, err);
	if (!rc) {
		differs = differing(old_report, new_report);
		comparison = compare_all(&was, &is, differs);
		json_decref(differs);
		if (!comparison)
			incise_error_set(err, ENOMEM, "no memory for a comparison");
	}
	metrics_free(&was);
	metrics_free(&is);
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

/* --- printed --- */

static const char *text_of(const json_t *object, const char *key)
{
	return json_string_value(json_object_get(object, key));
}

static void name_of(const json_t *metric, char *name, size_t size)
{
	const char *bench = text_of(metric, "benchmark"), *is = text_of(metric, "name");

	snprintf(name, size, "%s%s%s", bench ? bench : "", bench && is ? ": " : "",
		 is ? is : "");
}

static void print_names(const json_t *comparison, const char *key)
{
	const json_t *metric;
	char name[2 * METRIC_NAME_BYTES];
	size_t i;

	json_array_foreach(json_object_get(comparison, key), i, metric)
	{
		name_of(metric, name, sizeof(name));
		printf("%s: %s\n", key, name);
	}
}

static void print(const json_t *comparison)
{
	const json_t *differs = json_object_get(comparison, "differs"),
		     *list = json_object_get(comparison, "changed"), *change;
	char name[2 * METRIC_NAME_BYTES];
	size_t i;

	for (i = 0; i < json_array_size(differs); i++)
		printf("%s%s", i ? ", " : "machine or build differs: ",
		       json_string_value(json_array_get(differs, i)));
	if (i)
		printf("\n");
	if (json_array_size(list))
		printf("%-52s %12s %12s %8s\n", "significant changes", "old", "new",
		       "ratio");
	json_array_foreach((json_t *)list, i, change)
	{
		name_of(change, name, sizeof(name));
		printf("%-52s %12.5g %12.5g", name,
		       json_number_value(json_object_get(change, "old")),
		       json_number_value(json_object_get(change, "new")));
		/* From 0 there is none. */
		if (json_is_null(json_object_get(change, "ratio")))
			printf(" %8s", "-");
		else
			printf(" %8.3f",
			       json_number_value(json_object_get(change, "ratio")));
		printf(" %s, %s\n", text_of(change, "unit"),
		       json_is_true(json_object_get(change, "worse")) ? "worse"
								      : "better");
	}
	print_names(comparison, "gone");
	print_names(comparison, "new");
	printf("%lld same, %lld better, %lld worse, %zu gone, %zu new\n",
	       (long long)json_integer_value(json_object_get(comparison, "same")),
	       (long long)json_integer_value(json_object_get(comparison, "better")),
	       (long long)json_integer_value(json_object_get(comparison, "worse")),
	       json_array_size(json_object_get(comparison, "gone")),
	       json_array_size(json_object_get(comparison, "new")));
}

void compare_finish(json_t *comparison, bool json)
{
	int worse = compare_worse(comparison);

	if (json) {
		json_print(json_with_schema(comparison, "bench compare"));
	} else {
		print(comparison);
		json_decref(comparison);
		cli_finish();
	}
	if (worse)
		cli_fail("%d metric%s worse or gone, see above", worse,
			 worse > 1 ? "s are" : " is");
}

/* --- --against --- */

/* In the first process: compare what the other one reported, and end as it did. */
static _Noreturn void wait_and_compare(pid_t pid, const struct memory_file *said,
				       const char *path, json_t *old_report, bool json)
{
	struct incise_error err = {0};
	json_t *report, *comparison;
	int status, worse;

	/* A Ctrl-C is for the process that measures. */
	signal(SIGINT, SIG_IGN);
	while (waitpid(pid, &status, 0) < 0)
		if (errno != EINTR)
			cli_fail("the measuring process is lost: %s", strerror(errno));
	rewind(said->file);
	/* One that failed before it had a report has said why. */
	report = json_read_from(said->file, "the report", &err);
	if (!report && status)
		_exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
	cli_require(report, &err);
	comparison = cli_require(
		compare_reports(old_report, path, report, "this run", &err), &err);
	if (json) {
		worse = compare_worse(comparison);
		json_object_set_new(report, "against", comparison);
		json_print(report);
		if (worse)
			cli_fail("%d metrics are worse or gone compared with %s", worse,
				 path);
	} else {
		compare_finish(comparison, false);
	}
	exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
}

void compare_against(const char *path, bool json)
{
	struct memory_file said = memory_file_begin("report");
	json_t *old_report = compare_load(path);
	pid_t parent = getpid(), pid;

	fflush(stdout);
	pid = fork();
	if (pid < 0)
		cli_fail("no process to measure in: %s", strerror(errno));
	if (pid)
		wait_and_compare(pid, &said, path, old_report, json);
	prctl(PR_SET_PDEATHSIG, SIGTERM);
	if (getppid() != parent)
		_exit(1);
	if (dup2(fileno(said.file), STDOUT_FILENO) < 0)
		cli_fail("no output to report to: %s", strerror(errno));
	fclose(said.file);
	json_decref(old_report);
}
