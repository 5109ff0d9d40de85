// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ticks in real time: of another program's loop by its page, or of a loop here on a rig, whose
 * scalpel may be in the hand at the mouse.
 */
#include <incise/sim.h>
#include "../cli/cli.h"
#include "../status/pages.h"
#include "view_job.h"

static void run_live(struct view_job *job, struct view_live *live, struct view_hand *hand)
{
	struct incise_view_status status;
	struct incise_error err = {0};
	int64_t begin = view_wall(), last = begin, due = begin, now;
	int rc = 0;

	while (!rc && view_job_events(job, hand, live)) {
		now = view_wall();
		if (job->duration_s && now - begin > job->duration_s * INCISE_NS_PER_S)
			break;
		if (hand)
			view_hand_move(hand, (double)(now - last) / INCISE_NS_PER_S);
		last = now;
		rc = view_live_take(live, job->view, &status, &err);
		if (rc < 0)
			cli_fail_with(&err);
		view_job_draw(job, &status, (double)(now - begin) / INCISE_NS_PER_S);
		job->lost = status.lost;
		/* A screen that is waited for makes this no wait at all. */
		due += INCISE_NS_PER_S / job->output.fps;
		if (due < view_wall())
			due = view_wall();
		view_pause_until(due);
	}
}

void view_running(struct view_job *job)
{
	struct incise_error err = {0};
	struct state_pages pages;
	struct view_live *live;

	state_pages_open(&pages, job->argument.path);
	job->plan = incise_plan_new(job->scene, NULL, &err);
	if (!job->plan)
		cli_fail_with(&err);
	live = view_live_open(pages.page[0].path, &err);
	if (!live)
		cli_fail_with(&err);
	state_pages_close(&pages);
	view_job_view(job);
	run_live(job, live, NULL);
	view_live_close(live);
}

void view_rig(struct view_job *job)
{
	struct incise_error err = {0};
	struct view_live *live;
	struct view_hand hand;
	struct incise_touch top;
	bool held;

	job->own_rig = incise_rig_open(job->rig, INCISE_RIG_TRACKER, &err);
	if (!job->own_rig)
		cli_fail_with(&err);
	if (!incise_clock_is_real(incise_rig_clock(job->own_rig)))
		cli_fail(
			"--rig: a loop in simulated time runs away from its picture; leave "
			"out clock=simulated, or give --procedure");
	job->plan = incise_plan_new(job->scene, job->own_rig, &err);
	if (!job->plan)
		cli_fail_with(&err);
	incise_plan_top(job->plan, &top);
	view_job_view(job);
	held = incise_rig_sim(job->own_rig) &&
	       incise_sim_config(incise_rig_sim(job->own_rig))->motion == 3;
	if (held) {
		view_hand_begin(&hand, incise_rig_sim(job->own_rig),
				incise_scene_handle_mm(job->scene), &top);
		view_hand_move(&hand, 0.001);
	}
	live = view_live_begin(job->plan, job->own_rig, job->rate_hz, &err);
	if (!live)
		cli_fail_with(&err);
	run_live(job, live, held ? &hand : NULL);
	view_live_close(live);
}
