// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ticks and views of the scripted procedure; see script.h.
 */
#include <stdlib.h>
#include <incise/loop.h>
#include "../cli/cli.h"
#include "../cli/procedure.h"
#include "script.h"

struct run {
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_plan *plan;
	struct procedure procedure;
};

static int ticked(void *context, const struct incise_tick *tick)
{
	procedure_ticked(context, tick);
	return 0;
}

static void open_run(struct run *run, const char *path)
{
	struct incise_error err = {0};

	*run = (struct run){.scene = incise_scene_load(path, NULL, &err)};
	if (run->scene)
		run->rig = incise_rig_open(PROCEDURE_RIG, INCISE_RIG_TRACKER, &err);
	if (run->rig)
		run->plan = incise_plan_new(run->scene, run->rig, &err);
	if (!run->plan)
		cli_fail_with(&err);
	procedure_begin(&run->procedure, run->rig, run->plan, run->scene);
}

void view_script_begin(struct view_script *script, const char *scene, double seconds)
{
	struct incise_loop_stats *stats = malloc(sizeof(*stats));
	struct incise_loop_options loop = {.ticked = ticked};
	struct incise_error err = {0};
	struct run run;

	open_run(&run, scene);
	loop.context = &run.procedure;
	loop.rate_hz = incise_scene_rate_hz(run.scene);
	loop.duration_ns = (int64_t)(seconds * INCISE_NS_PER_S);
	loop.log_size = (size_t)(seconds * loop.rate_hz) + 2;
	loop.log = calloc(loop.log_size, sizeof(*loop.log));
	if (!stats || !loop.log)
		cli_fail("not enough memory for %.3g s of ticks; give a shorter "
			 "--duration",
			 seconds);
	if (incise_loop_run(run.plan, incise_rig_clock(run.rig), &loop, stats, &err) < 0)
		cli_fail_with(&err);
	*script = (struct view_script){
		.scene = scene, .tick = loop.log, .n = (int)stats->logged};
	free(stats);
	incise_plan_free(run.plan);
	incise_rig_close(run.rig);
	incise_scene_free(run.scene);
}

void view_script_end(struct view_script *script)
{
	free(script->tick);
	*script = (struct view_script){0};
}

void fed_view_open(struct fed_view *fed, const struct view_script *script, int texture_px,
		   int width, int height, bool live)
{
	const struct incise_view_setup setup = {
		.width = width, .height = height, .live = live};
	struct incise_error err = {0};

	*fed = (struct fed_view){.script = script,
				 .scene = incise_scene_load(script->scene, NULL, &err)};
	if (fed->scene && texture_px)
		incise_scene_set_texture(fed->scene, texture_px);
	if (fed->scene)
		fed->plan = incise_plan_new(fed->scene, NULL, &err);
	if (fed->plan)
		fed->view = incise_view_new(fed->scene, fed->plan, &setup, &err);
	if (!fed->view)
		cli_fail_with(&err);
}

void fed_view_until(struct fed_view *fed, double t_s)
{
	const struct view_script *script = fed->script;
	int64_t until_ns = script->tick[0].t_ns + (int64_t)(t_s * INCISE_NS_PER_S);
	int n = fed->fed;

	while (n < script->n && script->tick[n].t_ns <= until_ns)
		n++;
	incise_view_ticks(fed->view, script->tick + fed->fed, n - fed->fed);
	fed->fed = n;
}

void fed_view_frame(struct fed_view *fed)
{
	struct incise_error err = {0};

	if (incise_view_frame(fed->view, NULL, &err))
		cli_fail_with(&err);
}

void fed_view_close(struct fed_view *fed)
{
	incise_view_free(fed->view);
	incise_plan_free(fed->plan);
	incise_scene_free(fed->scene);
}
