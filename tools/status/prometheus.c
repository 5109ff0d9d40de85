// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The state of loops for Prometheus; see report.h. The format:
 * prometheus.io/docs/instrumenting/exposition_formats, text-based, version 0.0.4.
 */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <string.h>
#include "../cli/loop_report.h"
#include "report.h"

/* Bounds of histograms: 2^FIRST_BIT - 1 ns, 1 us, and on by doubling to 17 s. */
#define FIRST_BIT 10
#define LAST_BIT 34

typedef const struct state_look loop;

/* The value of a label: \, " and the end of a line are escaped. */
static void put_label(FILE *out, const char *label, const char *value)
{
	fprintf(out, "%s=\"", label);
	for (; *value; value++) {
		if (*value == '\\' || *value == '"')
			fputc('\\', out);
		fputs(*value == '\n' ? "\\n" : (char[]){*value, 0}, out);
	}
	fputc('"', out);
}

/* A line up to its value; label may be NULL. */
static void begin_prometheus(FILE *out, loop *l, const char *metric, const char *label,
			     const char *value)
{
	fprintf(out, "%s{", metric);
	put_label(out, "scene", l->name);
	if (label) {
		fputc(',', out);
		put_label(out, label, value);
	}
	fputs("} ", out);
}

static void put_count(FILE *out, loop *l, const char *metric, const char *label,
		      const char *value, uint64_t count)
{
	begin_prometheus(out, l, metric, label, value);
	fprintf(out, "%" PRIu64 "\n", count);
}

static void put_prometheus_number(FILE *out, loop *l, const char *metric, double number)
{
	begin_prometheus(out, l, metric, NULL, NULL);
	/* The spelling of the format. */
	if (isnan(number))
		fputs("NaN\n", out);
	else if (isinf(number))
		fputs(number > 0 ? "+Inf\n" : "-Inf\n", out);
	else
		fprintf(out, "%.12g\n", number);
}

static void put_alive(FILE *out, loop *l, const char *metric)
{
	put_count(out, l, metric, NULL, NULL, l->now->alive);
}

static void put_state(FILE *out, loop *l, const char *metric)
{
	const char *word = state_word(l->now);

	for (int i = 0; i < INCISE_RUNS; i++) {
		const char *name = incise_run_name((enum incise_run)i);

		put_count(out, l, metric, "state", name, !strcmp(word, name));
	}
	put_count(out, l, metric, "state", "dead", !strcmp(word, "dead"));
}

/* Before the first tick no tool is held. */
static void put_tool(FILE *out, loop *l, const char *metric)
{
	for (int i = INCISE_TOOL_BLADE; loop_tool_names[i]; i++)
		put_count(out, l, metric, "tool", loop_tool_names[i],
			  l->now->ticks && (int)l->now->tick.tool == i);
}

static void put_info(FILE *out, loop *l, const char *metric)
{
	fprintf(out, "%s{", metric);
	put_label(out, "scene", l->name);
	fputc(',', out);
	put_label(out, "file", l->now->scene);
	fputc(',', out);
	put_label(out, "rig", l->now->rig);
	fputc(',', out);
	put_label(out, "policy", l->now->policy);
	fputs("} 1\n", out);
}

static void put_start(FILE *out, loop *l, const char *metric)
{
	begin_prometheus(out, l, metric, NULL, NULL);
	/* To the ms, the resolution of a double here. */
	fprintf(out, "%.3f\n", state_unix_s(l->now, l->now->start_ns));
}

static void put_flagged(FILE *out, loop *l, const char *metric)
{
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		if (loop_flag_names[i])
			put_count(out, l, metric, "flag", loop_flag_names[i],
				  l->now->flagged[i]);
}

static void put_faults(FILE *out, loop *l, const char *metric)
{
	put_count(out, l, metric, "kind", "minor", l->now->minor_faults);
	put_count(out, l, metric, "kind", "major", l->now->major_faults);
}

static void put_switches(FILE *out, loop *l, const char *metric)
{
	put_count(out, l, metric, "kind", "voluntary", l->now->voluntary);
	put_count(out, l, metric, "kind", "involuntary", l->now->involuntary);
}

/* Bounds are edges of the page's own buckets: no count is divided. */
static void put_histogram(FILE *out, loop *l, const char *metric,
			  const struct incise_state_histogram *histogram, uint64_t sum_ns)
{
	uint64_t total = incise_state_total(histogram), seen = 0;
	char name[80], bound[32];
	int bucket = 0;

	snprintf(name, sizeof(name), "%s_bucket", metric);
	for (int bit = FIRST_BIT; bit <= LAST_BIT; bit++) {
		double edge_ns = ldexp(1, bit) - 1;

		for (; incise_state_edge(bucket) <= edge_ns; bucket++)
			if (__builtin_add_overflow(seen, histogram->count[bucket], &seen))
				seen = total;
		snprintf(bound, sizeof(bound), "%.11g", edge_ns * 1e-9);
		put_count(out, l, name, "le", bound, seen < total ? seen : total);
	}
	put_count(out, l, name, "le", "+Inf", total);
	snprintf(name, sizeof(name), "%s_sum", metric);
	put_prometheus_number(out, l, name, (double)sum_ns * 1e-9);
	snprintf(name, sizeof(name), "%s_count", metric);
	put_count(out, l, name, NULL, NULL, total);
}

static void put_lateness(FILE *out, loop *l, const char *metric)
{
	put_histogram(out, l, metric, &l->now->lateness, l->now->lateness_sum_ns);
}

static void put_cost(FILE *out, loop *l, const char *metric)
{
	put_histogram(out, l, metric, &l->now->cost, l->now->cost_sum_ns);
}

/* Where a value is in struct incise_state_now, and its factor to the base unit. */
#define AT(field) offsetof(struct incise_state_now, field)

enum kind { OTHER, COUNT, REAL, TIME };

static const struct {
	const char *name, *type, *help;
	enum kind kind;
	size_t at;
	double unit;
	void (*put)(FILE *out, loop *l, const char *metric);
} metrics[] = {
	{"incise_loop_info", "gauge", "Scene, rig and build of the loop.",
	 .put = put_info},
	{"incise_loop_alive", "gauge", "Whether the loop's process lives.",
	 .put = put_alive},
	{"incise_loop_state", "gauge", "1 for the state that the loop is in.",
	 .put = put_state},
	{"incise_loop_tool", "gauge", "1 for the tool that the hand holds.",
	 .put = put_tool},
	{"incise_loop_start_time_seconds", "gauge",
	 "When the loop was started, UNIX time.", .put = put_start},
	{"incise_loop_rate_hertz", "gauge", "Requested rate.", .kind = REAL,
	 .at = AT(rate_hz), .unit = 1},
	{"incise_loop_ticks_total", "counter", "Ticks.", .kind = COUNT, .at = AT(ticks)},
	{"incise_loop_ticks_skipped_total", "counter", "Ticks missed by overruns.",
	 .kind = COUNT, .at = AT(skipped)},
	{"incise_loop_overruns_total", "counter",
	 "Ticks that started a period late, or later.", .kind = COUNT,
	 .at = AT(overruns)},
	{"incise_loop_ticks_flagged_total", "counter", "Ticks with a flag.",
	 .put = put_flagged},
	{"incise_loop_ticks_limited_total", "counter",
	 "Ticks whose force was held at a limit.", .kind = COUNT, .at = AT(limited)},
	{"incise_loop_lateness_seconds", "histogram", "Lateness of the start of ticks.",
	 .put = put_lateness},
	{"incise_loop_lateness_max_seconds", "gauge", "Largest lateness of a tick.",
	 .kind = TIME, .at = AT(lateness_max_ns), .unit = 1e-9},
	{"incise_loop_tick_seconds", "histogram", "Run time of ticks.", .put = put_cost},
	{"incise_loop_tick_max_seconds", "gauge", "The longest tick.", .kind = TIME,
	 .at = AT(cost_max_ns), .unit = 1e-9},
	{"incise_loop_force_newtons", "gauge", "Force commanded at the last tick.",
	 .kind = REAL, .at = AT(force_N), .unit = 1},
	{"incise_loop_force_max_newtons", "gauge", "Largest force commanded.",
	 .kind = REAL, .at = AT(force_max_N), .unit = 1},
	{"incise_loop_work_absorbed_joules_total", "counter",
	 "Work of the hand on the tissue.", .kind = REAL, .at = AT(absorbed_mJ),
	 .unit = 1e-3},
	{"incise_loop_work_returned_joules_total", "counter",
	 "Work of the tissue on the hand.", .kind = REAL, .at = AT(returned_mJ),
	 .unit = 1e-3},
	{"incise_loop_reloads_total", "counter", "Scenes reloaded.", .kind = COUNT,
	 .at = AT(reloads)},
	{"incise_loop_reloads_refused_total", "counter",
	 "Scenes refused on reload: the previous one continued.", .kind = COUNT,
	 .at = AT(refused)},
	{"incise_loop_page_faults_total", "counter", "Page faults of the loop's thread.",
	 .put = put_faults},
	{"incise_loop_context_switches_total", "counter",
	 "Context switches of the loop's thread.", .put = put_switches},
};

static void put_metric(FILE *out, loop *l, size_t i)
{
	const char *name = metrics[i].name;
	const void *value = (const char *)l->now + metrics[i].at;

	switch (metrics[i].kind) {
	case COUNT:
		put_count(out, l, name, NULL, NULL, *(const uint64_t *)value);
		break;
	case REAL:
		put_prometheus_number(out, l, name,
				      *(const double *)value * metrics[i].unit);
		break;
	case TIME:
		put_prometheus_number(out, l, name,
				      (double)*(const int64_t *)value * metrics[i].unit);
		break;
	case OTHER:
		metrics[i].put(out, l, name);
		break;
	}
}

void state_prometheus(FILE *out, const struct state_look *loops, int n)
{
	for (size_t i = 0; i < sizeof(metrics) / sizeof(*metrics); i++) {
		fprintf(out, "# HELP %s %s\n", metrics[i].name, metrics[i].help);
		fprintf(out, "# TYPE %s %s\n", metrics[i].name, metrics[i].type);
		for (int k = 0; k < n; k++)
			put_metric(out, &loops[k], i);
	}
}
