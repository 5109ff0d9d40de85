// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A scene against its full pipeline; see scene_saving.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "instructions.h"
#include "scene_saving.h"
#include "../cli/stopwatch.h"

/* Blade, handle and tube once each: what is timed and counted. */
#define TIMED_STROKES 3
#define TURNS 101
#define QUICK_TURNS 9

/* Of which single ticks and their stages are timed. */
#define COURSES 10

#define COMPARED_TICKS 120000
#define COMPARED_STROKES_MOST 1000 /* of a scene with few ticks a second */

static bool runs(const struct incise_plan *plan, const char *stage)
{
	const char *name;

	for (int i = 0; (name = incise_plan_stage(plan, i)); i++)
		if (!strcmp(name, stage))
			return true;
	return false;
}

static bool open_way(struct scene_way *way, const char *path, bool full,
		     struct incise_error *err)
{
	way->scene = incise_scene_load(path, NULL, err);
	if (!way->scene)
		return false;
	incise_scene_set_full(way->scene, full);
	way->plan = incise_plan_new(way->scene, NULL, err);
	return way->plan;
}

/* Kept, the stage of the tool changes nothing: there is only the blade. */
static bool inserts(const struct scene_saving *saving)
{
	return !saving->kept && runs(saving->few.plan, "tool");
}

/* Both at the beginning of the course that is timed and counted. */
static void start(struct scene_saving *saving)
{
	struct course_walk walk = {.course = &saving->course};

	course_begin(&saving->course, saving->few.scene, saving->few.plan, TIMED_STROKES,
		     inserts(saving), false);
	saving->few.walk = saving->full.walk = walk;
	saving->few.walk.plan = saving->few.plan;
	saving->full.walk.plan = saving->full.plan;
}

void scene_saving_begin(struct scene_saving *saving, const char *path, bool kept)
{
	struct incise_error err = {0};

	*saving =
		(struct scene_saving){.path = path, .kept = kept, .first_difference = -1};
	if (!open_way(&saving->few, path, kept, &err) ||
	    !open_way(&saving->full, path, true, &err)) {
		snprintf(saving->failed, sizeof(saving->failed), "%s", err.text);
		return;
	}
	start(saving);
}

/* On to another course, at a later time. */
static void take(struct course_walk *walk, const struct course *course)
{
	walk->begin_ns += walk->tick * walk->course->period_ns;
	walk->course = course;
	walk->tick = walk->pose = 0;
}

void scene_saving_compare(struct scene_saving *saving)
{
	struct course_walk *few = &saving->few.walk, *full = &saving->full.walk;
	const struct course *own = &saving->course;
	struct course course;
	int strokes;

	if (*saving->failed)
		return;
	strokes = COMPARED_TICKS / (own->ticks / own->strokes) + 1;
	if (strokes > COMPARED_STROKES_MOST)
		strokes = COMPARED_STROKES_MOST;
	course_begin(&course, saving->few.scene, few->plan, strokes, inserts(saving),
		     true);
	take(few, &course);
	take(full, &course);
	for (long i = 0; i < course.ticks; i++) {
		struct incise_tick of_few, of_full;

		incise_plan_tick(few->plan, course_feed(few), &of_few);
		incise_plan_tick(full->plan, course_feed(full), &of_full);
		saving->ticks_compared++;
		saving->ticks_in_contact += !!(of_few.flags & INCISE_TICK_CONTACT);
		if (memcmp(of_few.command_N, of_full.command_N,
			   sizeof(of_few.command_N)) &&
		    saving->first_difference < 0)
			saving->first_difference = i;
	}
	take(few, own);
	take(full, own);
	course_end(&course);
}

/* ---- times ---- */

static void run_course(void *context)
{
	struct course_walk *walk = context;
	struct incise_tick tick;

	for (int i = 0; i < walk->course->ticks; i++)
		incise_plan_tick(walk->plan, course_feed(walk), &tick);
}

/* Ticks and then stages one by one, with what reading the clock takes off. */
static void time_single(struct scene_way *way, int courses)
{
	const size_t n = (size_t)courses * way->walk.course->ticks;
	double *times = calloc(n * (INCISE_PLAN_STAGES_MAX + 1), sizeof(*times));
	double own = stopwatch_own_ns();

	if (!times)
		cli_fail("no memory for the times of %zu ticks", n);
	for (size_t i = 0; i < n; i++) {
		int64_t t_ns = course_feed(&way->walk);
		struct incise_tick tick;
		double begin = stopwatch_ns();

		incise_plan_tick(way->plan, t_ns, &tick);
		times[i] = stopwatch_ns() - begin;
	}
	for (size_t i = 0; i < n; i++) {
		int64_t stage_ns[INCISE_PLAN_STAGES_MAX];
		struct incise_tick tick;

		incise_plan_tick_timed(way->plan, course_feed(&way->walk), &tick,
				       stage_ns);
		for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++)
			times[(k + 1) * n + i] = (double)stage_ns[k];
	}
	stopwatch_sort(times, (int)n);
	way->p99_ns = fmax(stopwatch_quantile(times, (int)n, 0.99) - own, 0);
	for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++) {
		stopwatch_sort(times + (k + 1) * n, (int)n);
		way->stage_ns[k] =
			fmax(stopwatch_middle(times + (k + 1) * n, (int)n) - own, 0);
	}
	free(times);
}

void scene_savings_time(struct scene_saving *const *savings, int n, bool quick)
{
	struct harness_variant *ways = calloc(2 * n + 1, sizeof(*ways));
	struct harness_time *times = calloc(2 * n + 1, sizeof(*times));

	if (!ways || !times)
		cli_fail("no memory");
	for (int i = 0; i < n; i++) {
		double ticks = *savings[i]->failed ? 0 : savings[i]->course.ticks;

		ways[2 * i] = (struct harness_variant){.run = run_course,
						       .context = &savings[i]->few.walk,
						       .units = ticks};
		ways[2 * i + 1] =
			(struct harness_variant){.run = run_course,
						 .context = &savings[i]->full.walk,
						 .units = ticks};
	}
	harness_times(ways, 2 * n, quick ? QUICK_TURNS : TURNS, times);
	for (int i = 0; i < n; i++) {
		savings[i]->few.time = times[2 * i];
		savings[i]->full.time = times[2 * i + 1];
		if (*savings[i]->failed)
			continue;
		cli_progress("single ticks of scene %d of %d", i + 1, n);
		time_single(&savings[i]->few, quick ? 1 : COURSES);
		time_single(&savings[i]->full, quick ? 1 : COURSES);
	}
	cli_progress_end();
	free(ways);
	free(times);
}

/* ---- instructions ---- */

static void count(struct scene_way *way, struct instruction_counter *counter)
{
	const struct course *course = way->walk.course;
	struct incise_tick tick;

	for (int i = 0; i < course->ticks; i++) {
		int64_t t_ns = course_feed(&way->walk);

		instructions_begin(counter);
		incise_plan_tick(way->plan, t_ns, &tick);
		instructions_end(counter);
	}
	way->instructions = instructions_close(counter) / course->ticks;
}

/* Both at the same time. */
static void count_by_callgrind(struct scene_saving *saving)
{
	struct scene_way *ways[] = {&saving->few, &saving->full};
	struct callgrind callgrind[2];

	for (int i = 0; i < 2; i++) {
		char program[4096];
		char *argv[] = {program,
				"scenes",
				(char *)saving->path,
				"--profile",
				i || saving->kept ? "full" : "needed",
				NULL};

		snprintf(program, sizeof(program), "%s/incise-bench", cli_folder());
		callgrind_begin(&callgrind[i], "incise_plan_tick", argv);
	}
	for (int i = 0; i < 2; i++)
		ways[i]->instructions =
			callgrind_end(&callgrind[i]) / saving->course.ticks;
}

static const char *count_all(struct scene_saving *const *savings, int n, bool quick,
			     const char **why)
{
	struct instruction_counter counter;
	bool by_counter = false;

	for (int i = 0; i < n && !cli_stop; i++) {
		struct scene_way *ways[] = {&savings[i]->few, &savings[i]->full};

		if (*savings[i]->failed)
			continue;
		cli_progress("instructions of scene %d of %d", i + 1, n);
		for (int k = 0; k < 2; k++) {
			by_counter = instructions_open(&counter);
			if (by_counter)
				count(ways[k], &counter);
		}
		if (by_counter)
			continue;
		if (quick || !child_possible("valgrind")) {
			*why = quick ? "the kernel gives no counter of them "
				       "(perf_event_open(2)), and callgrind takes too long "
				       "for --quick"
				     : "the kernel gives no counter of them "
				       "(perf_event_open(2)), and valgrind is not installed";
			return NULL;
		}
		count_by_callgrind(savings[i]);
	}
	return by_counter ? "counter" : "callgrind";
}

const char *scene_savings_count(struct scene_saving *const *savings, int n, bool quick,
				const char **why)
{
	const char *how;

	*why = NULL;
	for (int i = 0; i < n; i++)
		savings[i]->few.instructions = savings[i]->full.instructions = NAN;
	how = count_all(savings, n, quick, why);
	cli_progress_end();
	for (int i = 0; i < n && how; i++)
		if (!*savings[i]->failed && isnan(savings[i]->few.instructions))
			*why = "callgrind does not run this program";
	return *why ? NULL : how;
}

void scene_profile(const char *path, bool full)
{
	struct scene_saving saving;

	/* Both are made, as the course of the one depends on what the other needs. */
	scene_saving_begin(&saving, path, false);
	if (*saving.failed)
		cli_fail("%s", saving.failed);
	callgrind_here();
	run_course(full ? &saving.full.walk : &saving.few.walk);
	scene_saving_end(&saving);
}

void scene_saving_end(struct scene_saving *saving)
{
	course_end(&saving->course);
	incise_plan_free(saving->few.plan);
	incise_plan_free(saving->full.plan);
	incise_scene_free(saving->few.scene);
	incise_scene_free(saving->full.scene);
}
