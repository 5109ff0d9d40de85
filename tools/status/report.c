// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The state of a loop as text and JSON; see report.h.
 */
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <time.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/loop_report.h"
#include "report.h"

static const double shares[] = {0.5, 0.99, 0.999, 0.9999};

static bool should_tick(const struct incise_state_now *now)
{
	return now->alive &&
	       (now->run == INCISE_RUN_RUNNING || now->run == INCISE_RUN_RELOADING);
}

double state_patience_s(const struct incise_state_now *now)
{
	return fmin(fmax(0.2, 2.5 / now->rate_hz), 3);
}

void state_look_since(struct state_look *look, const struct incise_state_now *before,
		      double gap_s)
{
	const struct incise_state_now *now = look->now;
	double ticks = (double)now->ticks - (double)before->ticks;
	double gone_s = ((double)now->tick.t_ns - (double)before->tick.t_ns) * 1e-9;

	look->measured_hz =
		before->ticks && ticks > 0 && gone_s > 0 ? ticks / gone_s : NAN;
	look->still_s = ticks > 0 || !should_tick(before) ? 0 : look->still_s + gap_s;
	look->stalled = should_tick(now) && look->still_s >= state_patience_s(now);
}

const char *state_word(const struct incise_state_now *now)
{
	if (!now->alive && now->run != INCISE_RUN_STOPPED && now->run != INCISE_RUN_FAULT)
		return "dead";
	return incise_run_name(now->run);
}

bool state_is_well(const struct state_look *look)
{
	const char *word = state_word(look->now);

	return strcmp(word, "dead") && strcmp(word, "fault") && !look->stalled;
}

double state_unix_s(const struct incise_state_now *now, int64_t t_ns)
{
	return ((double)now->start_realtime_ns + ((double)t_ns - (double)now->start_ns)) *
	       1e-9;
}

/* "2026-11-21 17:35:22", by the local clock. */
static const char *put_time(char *text, size_t size, double unix_s)
{
	struct tm tm;
	time_t t;

	/* A damaged page may have any value. */
	t = (time_t)fmax(0, fmin(unix_s, 1e11));
	if (!localtime_r(&t, &tm) || !strftime(text, size, "%Y-%m-%d %H:%M:%S", &tm))
		snprintf(text, size, "-");
	return text;
}

static const char *put_span(char *text, size_t size, double s)
{
	if (s < 120)
		snprintf(text, size, "%.0f s", fmax(0, s));
	else if (s < 7200)
		snprintf(text, size, "%.0f min", s / 60);
	else if (s < 172800)
		snprintf(text, size, "%.1f h", s / 3600);
	else
		snprintf(text, size, "%.1f days", s / 86400);
	return text;
}

static double mean_hz(const struct incise_state_now *now)
{
	double gone_s = ((double)now->tick.t_ns - (double)now->first_ns) * 1e-9;

	return now->ticks > 1 && gone_s > 0 ? (double)(now->ticks - 1) / gone_s : NAN;
}

/* The maximum is exact, and limits a quantile of buckets. */
static double quantile_us(const struct incise_state_histogram *histogram, double share,
			  int64_t max_ns)
{
	return fmin(incise_state_quantile(histogram, share), (double)max_ns) * 1e-3;
}

static void headline(FILE *out, const struct state_look *look)
{
	const struct incise_state_now *now = look->now;
	char when[40], span[32];
	const char *word = state_word(now);

	put_time(when, sizeof(when), state_unix_s(now, now->since_ns));
	if (!strcmp(word, "dead"))
		fprintf(out,
			"%s: dead: process %" PRId64 " exited without cleanup; it was "
			"%s since %s\n",
			look->name, now->pid, incise_run_name(now->run), when);
	else if (now->alive)
		fprintf(out, "%s: %s%s since %s (%s), process %" PRId64 "\n", look->name,
			word, look->stalled ? ", but it does not tick," : "", when,
			put_span(span, sizeof(span),
				 (double)(cli_now_ns() - now->since_ns) * 1e-9),
			now->pid);
	else
		fprintf(out, "%s: %s since %s\n", look->name, word, when);
	if (*now->reason)
		fprintf(out, "reason     %s\n", now->reason);
	if (now->torn)
		fputs("torn       it ended while it wrote its state: some values are "
		      "older\n",
		      out);
}

/* Others may name files: no control characters. */
static void put_page(FILE *out, const struct state_look *look)
{
	fputs("page       ", out);
	for (const char *c = look->path; *c; c++)
		fputc((unsigned char)*c < ' ' || *c == 0x7f ? '?' : *c, out);
	fprintf(out, ", of user %s\n", look->user);
}

static void setup(FILE *out, const struct incise_state_now *now)
{
	if (*now->scene)
		fprintf(out, "scene      %s\n", now->scene);
	if (now->n_stages) {
		fputs("stages    ", out);
		for (int i = 0; i < now->n_stages; i++)
			fprintf(out, " %s", now->stage[i]);
		fprintf(out, "; %d left out\n", now->left_out);
	}
	if (now->reloads || now->refused)
		fprintf(out, "reloads    %" PRIu64 " done, %" PRIu64 " refused\n",
			now->reloads, now->refused);
	if (*now->rig)
		fprintf(out, "rig        %s\n", now->rig);
	if (*now->policy)
		fprintf(out, "policy     %s\n", now->policy);
}

static void times(FILE *out, const char *what,
		  const struct incise_state_histogram *histogram, int64_t max_ns)
{
	static const char *const names[] = {"median", "99 %", "99.9 %", "99.99 %"};

	fprintf(out, "%-10s", what);
	for (int i = 0; i < 4; i++) {
		double us = quantile_us(histogram, shares[i], max_ns);

		/* Buckets are 3 % wide: three digits. */
		fprintf(out, " %s %.*f,", names[i], us < 9.995 ? 2 : us < 99.95, us);
	}
	fprintf(out, " max %.1f us\n", (double)max_ns * 1e-3);
}

static void flags(FILE *out, const struct incise_state_now *now)
{
	int shown = 0;

	fputs("flags     ", out);
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		if (now->flagged[i] && loop_flag_names[i])
			fprintf(out, "%s %s %" PRIu64, shown++ ? "," : "",
				loop_flag_names[i], now->flagged[i]);
	fputs(shown ? "\n" : " none\n", out);
}

static void ticks(FILE *out, const struct state_look *look)
{
	const struct incise_state_now *now = look->now;

	fprintf(out, "rate       %g Hz requested", now->rate_hz);
	if (isfinite(look->measured_hz))
		fprintf(out, ", %.2f Hz now", look->measured_hz);
	if (isfinite(mean_hz(now)))
		fprintf(out, ", %.2f Hz on average", mean_hz(now));
	fprintf(out, "\nticks      %" PRIu64 ", %" PRIu64 " missed in %s\n", now->ticks,
		now->skipped, cli_count(now->overruns, "overrun"));
	if (!now->ticks)
		return;
	times(out, "lateness", &now->lateness, now->lateness_max_ns);
	times(out, "tick", &now->cost, now->cost_max_ns);
	flags(out, now);
	fprintf(out, "tool       %s\n", loop_tool_names[now->tick.tool]);
	fprintf(out, "force      %.3f N now, %.3f N at most, limited in %s\n",
		now->force_N, now->force_max_N, cli_count(now->limited, "tick"));
	if (look->model) {
		fputs("model      ", out);
		model_force_print(out, look->model);
	}
	fprintf(out, "energy     %.2f mJ into the tissue, %.2f mJ back\n",
		now->absorbed_mJ, now->returned_mJ);
}

void state_report_text(FILE *out, const struct state_look *look)
{
	const struct incise_state_now *now = look->now;

	headline(out, look);
	put_page(out, look);
	setup(out, now);
	ticks(out, look);
	fprintf(out,
		"thread     %" PRIu64 " minor and %" PRIu64 " major page faults, %" PRIu64
		" voluntary, %" PRIu64 " involuntary context switches\n",
		now->minor_faults, now->major_faults, now->voluntary, now->involuntary);
}

void state_report_line(FILE *out, const struct state_look *look)
{
	const struct incise_state_now *now = look->now;
	char letters[INCISE_TICK_FLAGS + 1], when[40];
	struct timespec t;

	clock_gettime(CLOCK_REALTIME, &t);
	put_time(when, sizeof(when), (double)t.tv_sec);
	fprintf(out, "%s %s%s", when, state_word(now),
		look->stalled ? ", but it does not tick" : "");
	if (isfinite(look->measured_hz))
		fprintf(out, ", %.1f Hz", look->measured_hz);
	fprintf(out,
		", %s, %" PRIu64 " skipped, late 99.9 %% %.3g max %.1f us, "
		"%.3f N, %.2f mm, %s, %s",
		cli_count(now->ticks, "tick"), now->skipped,
		quantile_us(&now->lateness, 0.999, now->lateness_max_ns),
		(double)now->lateness_max_ns * 1e-3, now->force_N, now->tick.depth_mm,
		loop_tool_names[now->tick.tool],
		loop_flags_text(now->tick.flags, letters));
	fprintf(out, "%s%s\n", *now->reason ? ": " : "", now->reason);
}

static void set_count(json_t *object, const char *key, uint64_t count)
{
	/* The end of jansson's integers. */
	json_set_integer(object, key, count < INT64_MAX ? (json_int_t)count : INT64_MAX);
}

static json_t *times_json(const struct incise_state_histogram *histogram, uint64_t sum_ns,
			  int64_t max_ns)
{
	uint64_t total = incise_state_total(histogram);

	return json_pack("{so so so so so so}", "median",
			 json_number(quantile_us(histogram, shares[0], max_ns)), "p99",
			 json_number(quantile_us(histogram, shares[1], max_ns)), "p999",
			 json_number(quantile_us(histogram, shares[2], max_ns)), "p9999",
			 json_number(quantile_us(histogram, shares[3], max_ns)), "max",
			 json_number((double)max_ns * 1e-3), "mean",
			 json_number(total ? (double)sum_ns / (double)total * 1e-3 : 0));
}

static void add_run_json(json_t *report, const struct incise_state_now *now)
{
	json_t *stages = json_array();

	for (int i = 0; i < now->n_stages; i++)
		json_array_append_new(stages, json_text(now->stage[i]));
	json_set_integer(report, "pid", now->pid);
	json_set_number(report, "start_unix_s", state_unix_s(now, now->start_ns));
	json_set_number(report, "since_unix_s", state_unix_s(now, now->since_ns));
	json_object_set_new(report, "scene", json_text(now->scene));
	json_object_set_new(report, "stages", stages);
	json_set_integer(report, "left_out", now->left_out);
	set_count(report, "reloads", now->reloads);
	set_count(report, "reloads_refused", now->refused);
	json_object_set_new(report, "rig", json_text(now->rig));
	json_object_set_new(report, "policy", json_text(now->policy));
	set_count(report, "minor_faults", now->minor_faults);
	set_count(report, "major_faults", now->major_faults);
	set_count(report, "voluntary_switches", now->voluntary);
	set_count(report, "involuntary_switches", now->involuntary);
}

static void add_tick_json(json_t *report, const struct incise_state_now *now)
{
	set_count(report, "ticks", now->ticks);
	set_count(report, "skipped", now->skipped);
	set_count(report, "overruns", now->overruns);
	set_count(report, "limited", now->limited);
	json_object_set_new(report, "flags", loop_flags_json(now->flagged));
	json_object_set_new(report, "lateness_us",
			    times_json(&now->lateness, now->lateness_sum_ns,
				       now->lateness_max_ns));
	json_object_set_new(report, "tick_us",
			    times_json(&now->cost, now->cost_sum_ns, now->cost_max_ns));
	json_object_set_new(report, "tool",
			    now->ticks ? json_string(loop_tool_names[now->tick.tool])
				       : json_null());
	json_set_number(report, "force_N", now->force_N);
	json_set_number(report, "force_max_N", now->force_max_N);
	json_set_number(report, "depth_mm", now->tick.depth_mm);
	json_set_number(report, "velocity_mm_s", now->tick.velocity_mm_s);
	json_set_number(report, "absorbed_mJ", now->absorbed_mJ);
	json_set_number(report, "returned_mJ", now->returned_mJ);
}

json_t *state_report_json(const struct state_look *look)
{
	const struct incise_state_now *now = look->now;
	json_t *report = json_object();

	json_object_set_new(report, "name", json_text(look->name));
	json_object_set_new(report, "file", json_text(look->path));
	json_object_set_new(report, "user", json_text(look->user));
	json_object_set_new(report, "state", json_string(state_word(now)));
	json_object_set_new(report, "reason", json_text(now->reason));
	json_object_set_new(report, "alive", json_boolean(now->alive));
	json_object_set_new(report, "torn", json_boolean(now->torn));
	json_object_set_new(report, "stalled", json_boolean(look->stalled));
	json_set_number(report, "rate_hz", now->rate_hz);
	json_set_number(report, "measured_hz", look->measured_hz);
	json_set_number(report, "mean_hz", mean_hz(now));
	add_run_json(report, now);
	add_tick_json(report, now);
	json_object_set_new(report, "model", model_force_json(look->model));
	return report;
}
