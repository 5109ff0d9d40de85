// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ticks for incise view; see view.h. In real time: of another program's loop by its page, or
 * of a loop here on a rig. In simulated time: of the scripted procedure, or of the loop on a
 * recording; a frame is drawn when it is due.
 */
#include <errno.h>
#include <incise/loop.h>
#include <incise/recording.h>
#include <incise/replay.h>
#include <incise/sim.h>
#include "../cli/cli.h"
#include "../cli/recording.h"
#include "../session/procedure.h"
#include "../status/pages.h"
#include "view.h"

/* The plan of the job's scene, on its rig if there is one. */
static void make_plan(struct view_job *job)
{
	struct incise_error err = {0};

	job->plan = cli_require(incise_plan_new(job->scene, job->own_rig, &err), &err);
}

/* End in a failure, of a file if @path is not NULL, with the session up to here. */
static _Noreturn void fail_sources(struct view_job *job, const char *path,
				   const struct incise_error *err)
{
	struct incise_error session_err = {0};

	if (session_log_end(job->log, "fault", err->text, &session_err))
		cli_warn("%s", session_err.text);
	if (path)
		cli_fail("%s: %s", path, err->text);
	cli_fail_with(err);
}

/* Nothing more is to be drawn, and no session to be written. */
static bool is_over(const struct view_job *job)
{
	return view_output_complete(&job->output) && !job->log;
}

/* --- in real time ---------------------------------------------------------------------- */

static void run_live(struct view_job *job, struct view_live *live, struct view_hand *hand)
{
	struct incise_view_status status;
	char state[60];
	struct incise_error err = {0};
	int64_t begin = cli_now_ns(), last = begin, due = begin, now;
	int rc = 0;

	job->total_s = job->duration_s;
	while (!rc && !is_over(job) && view_job_events(job, hand, live)) {
		now = cli_now_ns();
		if (job->duration_s && now - begin > job->duration_s * INCISE_NS_PER_S)
			break;
		if (hand)
			view_hand_move(hand, (double)(now - last) / INCISE_NS_PER_S);
		last = now;
		rc = view_live_take(live, job->view, job->log, &status, &err);
		if (hand) {
			snprintf(state, sizeof(state), "%s, + and -: press %.1f mm",
				 status.state, hand->depth_mm);
			status.state = state;
		}
		if (rc < 0)
			fail_sources(job, NULL, &err);
		view_job_draw(job, &status, (double)(now - begin) / INCISE_NS_PER_S);
		job->lost = status.lost;
		/* With vertical synchronization this does not wait. */
		due += INCISE_NS_PER_S / job->output.fps;
		if (due < cli_now_ns())
			due = cli_now_ns();
		view_pause_until(due);
	}
}

void view_running(struct view_job *job)
{
	struct incise_error err = {0};
	struct state_pages pages;
	struct view_live *live;
	const char *name;

	state_pages_open(&pages, job->argument.path);
	name = pages.page[0].name;
	if (incise_state_alive(pages.page[0].state) != 1)
		cli_fail("%s: its loop has ended, see 'incise status %s'; start one "
			 "with 'incise haptic %s', or run one here with --rig",
			 name, name, name);
	make_plan(job);
	live = cli_require(view_live_open(pages.page[0].path, &err), &err);
	state_pages_close(&pages);
	view_job_view(job);
	run_live(job, live, NULL);
	if (view_live_fault(live))
		snprintf(job->fault, sizeof(job->fault), "%s", view_live_fault(live));
	view_live_close(live);
}

void view_rig(struct view_job *job)
{
	struct incise_error err = {0};
	struct view_live *live;
	struct view_hand hand;
	struct incise_touch top;
	bool held;

	job->own_rig = cli_open_rig(job->rig, INCISE_RIG_TRACKER);
	if (!incise_clock_is_real(incise_rig_clock(job->own_rig)))
		cli_fail("--rig: a loop in simulated time outruns its image; leave out "
			 "clock=simulated, or give --procedure");
	make_plan(job);
	incise_plan_top(job->plan, &top);
	view_job_view(job);
	held = incise_rig_sim(job->own_rig) &&
	       incise_sim_config(incise_rig_sim(job->own_rig))->motion == 3;
	if (held) {
		view_hand_begin(&hand, incise_rig_sim(job->own_rig),
				incise_scene_handle_mm(job->scene), &top);
		view_hand_move(&hand, 0.001);
	}
	live = cli_require(
		view_live_begin(job->plan, job->own_rig, job->rate_hz, NULL, &err), &err);
	run_live(job, live, held ? &hand : NULL);
	view_live_close(live);
}

/* --- in simulated time ----------------------------------------------------------------- */

struct sources_run {
	struct view_job *job;
	int64_t first_ns, next_ns,
		period_ns; /* of the simulated clock; first 0: no tick yet */
	int64_t wall_ns;   /* CLOCK_MONOTONIC of first_ns, for a window */
	bool ended;
	struct procedure procedure; /* with --procedure */
};

static struct sources_run run_of(struct view_job *job)
{
	return (struct sources_run){.job = job,
				    .period_ns = INCISE_NS_PER_S / job->output.fps};
}

/* Feed a tick, and draw the frame that is due. Returns not 0 to end. */
static int show_tick(struct sources_run *run, const struct incise_tick *tick)
{
	struct view_job *job = run->job;
	double t_s;

	if (!run->first_ns) {
		run->first_ns = run->next_ns = tick->t_ns;
		run->wall_ns = cli_now_ns();
	}
	incise_view_ticks(job->view, tick, 1);
	session_log_tick(job->log, tick);
	if (tick->t_ns < run->next_ns)
		return 0;
	t_s = (double)(tick->t_ns - run->first_ns) / INCISE_NS_PER_S;
	run->next_ns += run->period_ns;
	if (job->duration_s && t_s > job->duration_s)
		return 1;
	if (!view_output_wanted(&job->output)) {
		/* In a window in real time; a late view skips frames. */
		int64_t due = run->wall_ns + (tick->t_ns - run->first_ns);

		if (cli_now_ns() > due + run->period_ns)
			return !view_job_events(job, NULL, NULL);
		view_pause_until(due);
	}
	view_job_draw(job, NULL, t_s);
	return !view_job_events(job, NULL, NULL) || is_over(job);
}

static int procedure_tick(void *context, const struct incise_tick *tick)
{
	struct sources_run *run = context;
	int rc = show_tick(run, tick);

	procedure_ticked(&run->procedure, tick);
	return rc;
}

void view_procedure(struct view_job *job)
{
	struct sources_run run = run_of(job);
	struct incise_loop_options loop = {
		.rate_hz = job->rate_hz, .ticked = procedure_tick, .context = &run};
	static struct incise_loop_stats stats;
	struct incise_error err = {0};
	double end_s = job->duration_s ? job->duration_s : PROCEDURE_S;

	job->total_s = end_s;
	job->own_rig = cli_open_rig(PROCEDURE_RIG, INCISE_RIG_TRACKER);
	make_plan(job);
	view_job_view(job);
	procedure_begin(&run.procedure, job->own_rig, job->plan, job->scene);
	loop.duration_ns = (int64_t)(end_s * INCISE_NS_PER_S);
	if (incise_loop_run(job->plan, incise_rig_clock(job->own_rig), &loop, &stats,
			    &err) < 0)
		fail_sources(job, NULL, &err);
}

static int replay_tick(void *context, const struct incise_replay_tick *tick,
		       struct incise_error *err)
{
	struct sources_run *run = context;

	if (!show_tick(run, tick->tick))
		return 0;
	run->ended = true;
	return incise_error_set(err, ECANCELED, "ended");
}

/* The part of a recording that is shown; 0: not known. */
static double recorded_s(const struct view_job *job, struct incise_recording *recording)
{
	static struct incise_recording_info info;
	double s;

	if (incise_recording_info(recording, &info, NULL))
		return job->duration_s;
	s = (double)(info.end_ns - info.start_ns) / INCISE_NS_PER_S;
	return job->duration_s && job->duration_s < s ? job->duration_s : s;
}

void view_recording(struct view_job *job)
{
	struct sources_run run = run_of(job);
	struct incise_replay_options replay = {.ticked = replay_tick, .context = &run};
	static struct incise_loop_stats stats;
	struct incise_replay_report report;
	struct incise_recording *recording;
	struct incise_error err = {0};

	recording = recording_open(job->from);
	job->total_s = recorded_s(job, recording);
	make_plan(job);
	view_job_view(job);
	if (incise_replay(recording, job->scene, &replay, &stats, &report, &err) &&
	    !run.ended)
		fail_sources(job, job->from, &err);
	incise_recording_close(recording);
}
