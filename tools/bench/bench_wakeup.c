// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Wake-up lateness at each rate and under each load; see bench_wakeup.h. How one is measured
 * is in wakeup_run.c.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <incise/loop.h>
#include <incise/scene.h>
#include "bench_tick.h"
#include "bench_wakeup.h"
#include "../cli/cli.h"
#include "cyclictest.h"
#include "metrics.h"
#include "harness.h"
#include "../cli/json.h"

static const double own_rates_hz[] = {1000, 4000};

static void measure(const char *scene, const struct wakeups *wakeups,
		    const struct incise_realtime *realtime, struct wakeup_row *row)
{
	struct memory_file own = {0};
	struct wakeup_setup setup = {
		.scene = scene,
		.rate_hz = row->rate_hz,
		.seconds = wakeups->seconds,
		.realtime = realtime,
		.cpu = wakeups->cpu,
	};
	const char *no_cyclictest = cyclictest_possible(wakeups->realtime);
	struct load_run load;

	if (!scene) {
		own = bench_tick_plane(row->rate_hz);
		setup.scene = own.path;
	}
	setup.beside = !no_cyclictest;
	row->no_load = load_begin(row->load, setup.scene, wakeups->seconds, &load);
	if (!row->no_load) {
		cli_progress("wake-ups at %g Hz, %s, %.3g s", row->rate_hz,
			     load_name(row->load), wakeups->seconds);
		wakeup_run(&setup, &row->got);
		row->frames_hz = load_end(&load);
	}
	if (no_cyclictest)
		row->got.no_cyclictest = no_cyclictest;
	if (own.file)
		fclose(own.file);
}

static double scene_rate(const char *path)
{
	struct incise_error err = {0};
	struct incise_scene *scene = incise_scene_load(path, NULL, &err);
	double rate_hz;

	if (!scene)
		cli_fail_with(&err);
	rate_hz = incise_scene_rate_hz(scene);
	incise_scene_free(scene);
	return rate_hz;
}

struct incise_realtime *wakeup_realtime(int cpu)
{
	const struct incise_realtime_setup setup = {
		.policy = INCISE_REALTIME_FIFO,
		.priority = INCISE_REALTIME_PRIORITY,
		.cpu = cpu,
		.period_ns = 1000000, /* of no account for this policy */
	};
	struct incise_error ignored = {0};

	return incise_realtime_new(&setup, &ignored);
}

/* A load takes seconds to begin and to end. */
static bool of_quick(enum load load, int rate)
{
	return (load == LOAD_IDLE || load == LOAD_CPU) && !rate;
}

void bench_wakeup(const char *scene, enum load only, bool quick, double seconds,
		  struct wakeups *wakeups)
{
	int rates = scene ? 1 : sizeof(own_rates_hz) / sizeof(*own_rates_hz);
	struct incise_realtime *realtime;

	*wakeups = (struct wakeups){.seconds = seconds, .cpu = harness_cpu()};
	wakeups->row = calloc((size_t)rates * LOADS, sizeof(*wakeups->row));
	if (!wakeups->row)
		cli_fail("no memory");
	incise_realtime_prepare();
	realtime = wakeup_realtime(wakeups->cpu);
	wakeups->realtime = realtime;
	cli_catch_signals();
	for (int i = 0; i < rates; i++)
		for (int load = 0; load < LOADS && !cli_stop; load++) {
			struct wakeup_row *row = &wakeups->row[wakeups->n];

			if (only == LOADS ? quick && !of_quick((enum load)load, i)
					  : only != (enum load)load)
				continue;
			row->load = load;
			row->rate_hz = scene ? scene_rate(scene) : own_rates_hz[i];
			row->got.ratio = NAN;
			row->frames_hz = NAN;
			measure(scene, wakeups, realtime, row);
			wakeups->n++;
		}
	cli_progress_end();
	incise_realtime_free(realtime);
	if (cli_stop)
		cli_fail("interrupted");
}

/* ---- report ---- */

json_t *lateness_json(const struct lateness *l)
{
	if (!l->bins)
		return json_null();
	return json_pack("{so so so so so so sI}", "min", json_number(l->min), "median",
			 json_number(l->median), "p99", json_number(l->p99), "p999",
			 json_number(l->p999), "p9999", json_number(l->p9999), "max",
			 json_number(l->max), "ticks", (json_int_t)l->ticks);
}

static json_t *text_or_null(const char *text)
{
	return text ? json_text(text) : json_null();
}

/* NaN where it was not measured. */
static json_t *late_json(const uint64_t *bins, double us)
{
	return json_number(bins ? us : NAN);
}

json_t *wakeups_json(const struct wakeups *wakeups)
{
	json_t *list = json_array();

	for (int i = 0; i < wakeups->n; i++) {
		const struct wakeup_row *row = &wakeups->row[i];
		bool known = !row->no_load && !row->got.no_cyclictest;

		json_array_append_new(
			list,
			json_pack("{ss so so so so so sI so so so so so so so so so so}",
				  "load", load_name(row->load), "rate_hz",
				  json_number(row->rate_hz), "no_load",
				  text_or_null(row->no_load), "no_cyclictest",
				  text_or_null(row->got.no_cyclictest), "lateness_us",
				  lateness_json(&row->got.loop), "cyclictest_us",
				  lateness_json(&row->got.cyclictest), "skipped",
				  (json_int_t)row->got.skipped, "skipped_by_machine",
				  known ? json_integer((json_int_t)row->got.machine)
					: json_null(),
				  "ratio_p999", json_number(row->got.ratio),
				  "tick_max_us",
				  json_number(row->got.loop.bins ? row->got.tick_max_us
								 : NAN),
				  "frames_hz", json_number(row->frames_hz),
				  "late_median_us",
				  late_json(row->got.loop.bins, row->got.loop.median),
				  "late_p99_us",
				  late_json(row->got.loop.bins, row->got.loop.p99),
				  "late_p999_us",
				  late_json(row->got.loop.bins, row->got.loop.p999),
				  "late_max_us",
				  late_json(row->got.loop.bins, row->got.loop.max),
				  "cyclictest_p999_us",
				  late_json(row->got.cyclictest.bins,
					    row->got.cyclictest.p999),
				  "failed", text_or_null(row->no_load)));
	}
	return json_pack("{sf ss so si so}", "seconds", wakeups->seconds, "policy",
			 wakeups->realtime ? "fifo" : "other", "priority",
			 wakeups->realtime ? json_integer(INCISE_REALTIME_PRIORITY)
					   : json_null(),
			 "cpu", wakeups->cpu, "rows", list);
}

/* By ranks, as if a wake-up did not know of the one before: those of one run alone. */
static struct harness_spread quantile_of(const struct lateness *l, double q)
{
	double off = 1.96 * sqrt(q * (1 - q) / fmax((double)l->ticks, 1));

	return (struct harness_spread){
		.median = incise_loop_quantile(l->bins, q),
		.low = incise_loop_quantile(l->bins, fmax(q - off, 0)),
		.high = incise_loop_quantile(l->bins, fmin(q + off, 1)),
	};
}

void wakeups_figures(const struct wakeups *wakeups, json_t *figures)
{
	static const struct {
		const char *name;
		double q;
	} told[] = {{"median", 0.5}, {"99.9 %", 0.999}};

	for (int i = 0; i < wakeups->n; i++) {
		const struct wakeup_row *row = &wakeups->row[i];

		for (size_t k = 0; k < 2 && row->got.loop.bins; k++) {
			struct harness_spread at = quantile_of(&row->got.loop, told[k].q);

			metrics_measured(figures, &at, "us", "late at %g Hz, %s, %s",
					 row->rate_hz, load_name(row->load),
					 told[k].name);
		}
	}
}

static void print_lateness(const char *program, const struct lateness *l)
{
	printf("%-10s %7.0f %7.0f %7.0f %7.0f %7.0f %8.0f", program, l->min, l->median,
	       l->p99, l->p999, l->p9999, l->max);
}

void wakeups_print(const struct wakeups *wakeups)
{
	const char *said = NULL;
	double drawn_hz = NAN;

	printf("\nwake-ups, us late; %.3g s each; %s", wakeups->seconds,
	       wakeups->realtime ? "SCHED_FIFO"
				 : "SCHED_OTHER, as real time is not granted");
	if (wakeups->realtime)
		printf(" %d", INCISE_REALTIME_PRIORITY);
	printf(", CPU %d\n%6s %-7s%-10s %7s %7s %7s %7s %7s %8s %8s %8s %6s\n",
	       wakeups->cpu, "Hz", "load", "program", "min", "median", "99 %", "99.9 %",
	       "99.99 %", "max", "skipped", "not ours", "ratio");
	for (int i = 0; i < wakeups->n; i++) {
		const struct wakeup_row *row = &wakeups->row[i];

		printf("%6g %-7s", row->rate_hz, load_name(row->load));
		if (row->no_load) {
			printf("%s\n", row->no_load);
			continue;
		}
		print_lateness("loop", &row->got.loop);
		printf(" %8llu", (unsigned long long)row->got.skipped);
		if (row->frames_hz > 0)
			drawn_hz = row->frames_hz;
		if (row->got.no_cyclictest) {
			said = row->got.no_cyclictest;
			printf("\n");
			continue;
		}
		printf(" %8llu %6.2f\n%14s", (unsigned long long)row->got.machine,
		       row->got.ratio, "");
		print_lateness("cyclictest", &row->got.cyclictest);
		printf("\n");
	}
	if (drawn_hz > 0)
		printf("view: %.1f pictures a second\n", drawn_hz);
	if (said)
		printf("%s\n", said);
}
