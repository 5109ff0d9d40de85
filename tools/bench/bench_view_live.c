// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The picture beside a loop; see bench_view_live.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <pthread.h>
#include <unistd.h>
#include <incise/loop.h>
#include <incise/sim.h>
#include "bench_view_live.h"
#include "../cli/cli.h"
#include "harness.h"
#include "../cli/json.h"
#include "../cli/stopwatch.h"
#include "../view/live.h"

/* ---- cuts at 5 kHz ---- */

#define CUTS_HZ 5000
#define FPS 60
#define DEEP_MM 3.0

/* A loop in a thread, in real time where that is granted, and who looks at it. */
struct cutting {
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_plan *plan;
	struct incise_view *view;
	struct view_live *live;
	struct incise_touch top;

	struct incise_realtime *realtime; /* or NULL */
	struct incise_state_writer *state;
	struct incise_loop_stats stats;
	struct incise_error err;
	volatile sig_atomic_t stop;
	pthread_t thread;
	int rc;
};

/*
 * To and fro, some 40 mm/s, each time beside the last; where the surface bends down it is a
 * shallower cut.
 */
static void sweep(struct cutting *c, double t_s)
{
	static const double upright[4] = {1, 0, 0, 0};
	double along = 2 * t_s, across = 0.3 * t_s;
	double tip[3] = {c->top.point_mm[0] + 15 * sin(along),
			 c->top.point_mm[1] + 5 * sin(across),
			 c->top.point_mm[2] - DEEP_MM};
	double velocity[3] = {30 * cos(along), 1.5 * cos(across), 0};

	incise_sim_hold(incise_rig_sim(c->rig), tip, velocity, upright);
}

static void *run_loop(void *context)
{
	struct cutting *c = context;
	struct incise_loop_options options = {
		.rate_hz = CUTS_HZ, .stop = &c->stop, .state = c->state};

	if (c->realtime)
		c->rc = incise_realtime_enter(c->realtime, &c->err);
	if (!c->rc)
		c->rc = incise_loop_run(c->plan, incise_rig_clock(c->rig), &options,
					&c->stats, &c->err);
	return NULL;
}

static void begin_loop(struct cutting *c)
{
	const struct incise_state_setup setup = {.rate_hz = CUTS_HZ,
						 .rig = incise_rig_spec(c->rig)};
	struct incise_error err = {0};
	char page[64];
	int rc;

	snprintf(page, sizeof(page), "/dev/shm/incise-bench-%d.state", (int)getpid());
	c->state = incise_state_new(page, &setup, &err);
	if (!c->state)
		cli_fail_with(&err);
	incise_state_run(c->state, INCISE_RUN_RUNNING, "");
	c->live = view_live_open(page, &err);
	/* Nobody else is to find it. */
	unlink(page);
	if (!c->live)
		cli_fail_with(&err);
	rc = pthread_create(&c->thread, NULL, run_loop, c);
	if (rc)
		cli_fail("no thread for the loop: %s", strerror(rc));
}

static struct cutting *open_cutting(const char *path)
{
	const struct incise_view_setup setup = {.width = 1280, .height = 720};
	struct cutting *c = calloc(1, sizeof(*c));
	struct incise_error err = {0};

	if (!c)
		cli_fail("no memory");
	c->scene = incise_scene_load(path, NULL, &err);
	if (c->scene)
		c->rig = incise_rig_open("sim:mouse", INCISE_RIG_TRACKER, &err);
	if (c->rig)
		c->plan = incise_plan_new(c->scene, c->rig, &err);
	if (!c->plan)
		cli_fail_with(&err);
	incise_plan_top(c->plan, &c->top);
	sweep(c, 0);
	c->view = incise_view_new(c->scene, c->plan, &setup, &err);
	if (!c->view)
		cli_fail_with(&err);
	c->realtime = wakeup_realtime(harness_cpu());
	begin_loop(c);
	return c;
}

static void close_cutting(struct cutting *c)
{
	c->stop = 1;
	pthread_join(c->thread, NULL);
	if (c->rc < 0)
		cli_fail_with(&c->err);
	view_live_close(c->live);
	incise_state_free(c->state);
	incise_realtime_free(c->realtime);
	incise_view_free(c->view);
	incise_plan_free(c->plan);
	incise_rig_close(c->rig);
	incise_scene_free(c->scene);
	free(c);
}

void bench_view_absorbed(const char *scene, double seconds, struct absorbed *absorbed)
{
	struct incise_view_report report;
	struct incise_view_status status = {0};
	struct incise_error err = {0};
	struct cutting *c;
	double begin, t_s = 0;
	int frames = 0;

	cli_progress("cuts at %d Hz, %.3g s", CUTS_HZ, seconds);
	c = open_cutting(scene);
	begin = stopwatch_ns();
	while (t_s < seconds && !cli_stop) {
		double due_us;

		sweep(c, t_s);
		if (view_live_take(c->live, c->view, &status, &err) < 0 ||
		    incise_view_frame(c->view, &status, &err))
			cli_fail_with(&err);
		frames++;
		t_s = (stopwatch_ns() - begin) * 1e-9;
		due_us = ((double)frames / FPS - t_s) * 1e6;
		if (due_us > 0)
			usleep((useconds_t)due_us);
		t_s = (stopwatch_ns() - begin) * 1e-9;
	}
	incise_view_report(c->view, &report);
	*absorbed = (struct absorbed){
		.seconds = t_s,
		.cut_mm = report.cut_mm,
		.tick_us = report.ticks_s * 1e6 / (double)report.ticks,
		.frames_hz = frames / t_s,
		.ticks = report.ticks,
		.lost = status.lost,
		.stamps = report.stamps,
	};
	absorbed->realtime = c->realtime;
	close_cutting(c);
	cli_progress_end();
	if (cli_stop)
		cli_fail("interrupted");
}

json_t *absorbed_json(const struct absorbed *a)
{
	return json_pack("{so ss sI sI sI so so so so}", "seconds",
			 json_number(a->seconds), "policy",
			 a->realtime ? "fifo" : "other", "ticks", (json_int_t)a->ticks,
			 "lost", (json_int_t)a->lost, "stamps", (json_int_t)a->stamps,
			 "ticks_hz", json_number((double)a->ticks / a->seconds), "cut_mm",
			 json_number(a->cut_mm), "effects_us_tick",
			 json_number(a->tick_us), "frames_hz", json_number(a->frames_hz));
}

void absorbed_print(const struct absorbed *a)
{
	printf("\ncutting all the time at %d Hz (%s): %llu ticks in %.1f s (%.0f a second), %llu lost; "
	       "%.0f mm cut,\n%llu stamps; %.2f us a tick for wound and blood, %.1f frames a "
	       "second\n",
	       CUTS_HZ, a->realtime ? "SCHED_FIFO" : "SCHED_OTHER",
	       (unsigned long long)a->ticks, a->seconds, (double)a->ticks / a->seconds,
	       (unsigned long long)a->lost, a->cut_mm, (unsigned long long)a->stamps,
	       a->tick_us, a->frames_hz);
}

/* ---- a loop, without and with ---- */

/* Of the lateness of all runs of a kind together. */
static double pooled(const struct beside *beside, bool view, bool cyclictest)
{
	uint64_t *bins = calloc(INCISE_LOOP_BINS, sizeof(*bins));
	double p999;

	if (!bins)
		cli_fail("no memory");
	for (int i = 0; i < beside->n; i++) {
		const struct wakeup *run = &beside->run[i];
		const struct lateness *l = cyclictest ? &run->cyclictest : &run->loop;

		if ((run->load == load_names[LOAD_VIEW]) == view && l->bins)
			for (int k = 0; k < INCISE_LOOP_BINS; k++)
				bins[k] += l->bins[k];
	}
	p999 = incise_loop_quantile(bins, 0.999);
	free(bins);
	return p999 > 0 ? p999 : NAN;
}

void bench_view_beside(const char *scene, double seconds, bool quick,
		       struct beside *beside)
{
	static const enum load order[BESIDE_RUNS] = {LOAD_IDLE, LOAD_VIEW, LOAD_VIEW,
						     LOAD_IDLE};

	*beside = (struct beside){.n = quick ? 2 : BESIDE_RUNS, .seconds = seconds};
	for (int i = 0; i < beside->n; i++) {
		static struct wakeups wakeups;

		wakeups_measure(scene, NULL, order[i], false, seconds, &wakeups);
		beside->run[i] = wakeups.row[0];
		beside->realtime = wakeups.realtime;
		if (wakeups.row[0].no_load)
			cli_fail("the picture beside a loop: %s", wakeups.row[0].no_load);
	}
	for (int view = 0; view < 2; view++) {
		beside->p999_us[view] = pooled(beside, view, false);
		beside->cyclictest_us[view] = pooled(beside, view, true);
	}
}

static json_t *json_of(const struct lateness *l)
{
	return l->json ? json_incref(l->json) : json_null();
}

json_t *beside_json(const struct beside *beside)
{
	json_t *list = json_array();

	for (int i = 0; i < beside->n; i++) {
		const struct wakeup *run = &beside->run[i];

		json_array_append_new(
			list, json_pack("{ss so so so sI}", "load", run->load,
					"lateness_us", json_of(&run->loop),
					"cyclictest_us", json_of(&run->cyclictest),
					"frames_hz", json_number(run->frames_hz),
					"skipped", (json_int_t)run->skipped));
	}
	return json_pack("{sf ss so so so so so so so}", "seconds", beside->seconds,
			 "policy", beside->realtime ? "fifo" : "other", "p999_us",
			 json_number(beside->p999_us[0]), "p999_view_us",
			 json_number(beside->p999_us[1]), "ratio_p999",
			 json_number(beside->p999_us[1] / beside->p999_us[0]),
			 "cyclictest_p999_us", json_number(beside->cyclictest_us[0]),
			 "cyclictest_p999_view_us", json_number(beside->cyclictest_us[1]),
			 "cyclictest_ratio_p999",
			 json_number(beside->cyclictest_us[1] / beside->cyclictest_us[0]),
			 "runs", list);
}

void beside_print(const struct beside *beside)
{
	printf("\nthe loop without and with the picture, us late; %.3g s each, %s\n"
	       "%-6s %7s %7s %7s %7s %8s %8s %12s\n",
	       beside->seconds,
	       beside->realtime ? "SCHED_FIFO"
				: "SCHED_OTHER, as real time is not granted",
	       "load", "median", "99 %", "99.9 %", "99.99 %", "max", "fps", "cyclictest");
	for (int i = 0; i < beside->n; i++) {
		const struct wakeup *run = &beside->run[i];
		const struct lateness *l = &run->loop;

		printf("%-6s %7.0f %7.0f %7.0f %7.0f %8.0f", run->load, l->median, l->p99,
		       l->p999, l->p9999, l->max);
		if (run->frames_hz > 0)
			printf(" %8.1f", run->frames_hz);
		else
			printf(" %8s", "");
		if (run->cyclictest.bins)
			printf(" %12.0f", run->cyclictest.p999);
		printf("\n");
	}
	printf("99.9 %% of all: %.0f without, %.0f with: %.2f times", beside->p999_us[0],
	       beside->p999_us[1], beside->p999_us[1] / beside->p999_us[0]);
	if (beside->cyclictest_us[0] > 0)
		printf("; cyclictest %.0f and %.0f: %.2f times", beside->cyclictest_us[0],
		       beside->cyclictest_us[1],
		       beside->cyclictest_us[1] / beside->cyclictest_us[0]);
	printf("\n");
}

void absorbed_figures(const struct absorbed *a, json_t *figures)
{
	/* However busy the machine: that none is lost is promised. */
	metrics_exact(figures, (double)a->lost, "1", "cuts lost");
}

void beside_figures(const struct beside *beside, json_t *figures)
{
	for (int view = 0; view < 2; view++) {
		double median[BESIDE_RUNS];
		struct harness_spread spread;
		int n = 0;

		for (int i = 0; i < beside->n; i++)
			if ((beside->run[i].load == load_names[LOAD_VIEW]) == view)
				median[n++] = beside->run[i].loop.median;
		harness_spread(median, n, &spread);
		metrics_measured(figures, &spread, "us",
				 "loop late %s the picture, median",
				 view ? "with" : "without");
	}
}
