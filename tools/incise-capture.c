// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise capture: records the streams of a rig in sync: tracker, force, camera.
 */
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <incise/calibration.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "capture/capture_report.h"
#include "capture/capture_view.h"
#include "capture/capture_wish.h"
#include "cli/cli.h"
#include "capture/keyboard.h"
#include "cli/recording.h"

#define POLL_NS 10000000LL

struct run {
	const struct capture_wish *wish;
	struct incise_rig *rig;
	struct incise_recorder *recorder;
	struct capture_view view;
	int64_t start_ns, end_ns; /* of the recording; end_ns INT64_MAX: not known */
	int64_t held_ns;	  /* recorded before the trigger */
	bool armed;
	int markers;
	struct capture_result result;
};

/* What was committed stays. */
_Noreturn static void give_up(struct run *run, const struct incise_error *why)
{
	struct incise_error second = {0};

	incise_recorder_close(run->recorder, &second);
	capture_view_end();
	cli_fail_with(why);
}

static void mark(struct run *run, const char *text)
{
	struct incise_error err = {0};

	if (incise_recorder_mark(run->recorder, "marker", text, &err))
		give_up(run, &err);
	snprintf(run->view.last, sizeof(run->view.last), "marked: %s", text);
	run->view.shown_ns = 0;
}

static void take_keys(struct run *run)
{
	char text[40];
	int key;

	while ((key = keyboard_next())) {
		if (key == 'm' || key == ' ') {
			snprintf(text, sizeof(text), "marker %d", ++run->markers);
			mark(run, text);
		} else if (key >= '1' && key <= '9') {
			snprintf(text, sizeof(text), "%c", key);
			mark(run, text);
		} else if (key == 't' && run->armed) {
			incise_recorder_trigger(run->recorder);
		} else if (key == 'q') {
			cli_stop = SIGINT;
		}
	}
}

/* The recording begins, maybe at its trigger; its end is known from then on. */
static void begin(struct run *run, int64_t now_ns)
{
	struct incise_sim *sim = incise_rig_sim(run->rig);
	double duration_s = run->wish->duration_s;

	run->armed = false;
	run->start_ns = now_ns;
	if (duration_s > 0)
		run->end_ns = now_ns + (int64_t)(duration_s * INCISE_NS_PER_S);
	else if (!sim)
		run->end_ns = INT64_MAX;
	else if (!run->end_ns) /* a trigger does not begin the virtual cuts anew */
		run->end_ns = now_ns + incise_sim_duration(sim);
	if (run->end_ns < INT64_MAX)
		run->view.planned_s = (run->end_ns - now_ns) / (double)INCISE_NS_PER_S;
}

/* Record until the end, a signal or a failure. */
static void record(struct run *run)
{
	struct incise_clock *clock = incise_rig_clock(run->rig);
	struct incise_recorder_stats stats;
	struct incise_error err = {0};
	int64_t now = incise_clock_now(clock), next = now, armed_ns = now;
	int rc = 0;

	begin(run, now);
	if (run->wish->trigger_button || run->wish->trigger_force_N > 0) {
		/* A virtual surgeon who has put the scalpel down triggers nothing. */
		run->armed = true;
		run->end_ns =
			incise_rig_sim(run->rig)
				? now + incise_sim_duration(incise_rig_sim(run->rig))
				: INT64_MAX;
		run->view.planned_s = 0;
	}
	while (!cli_stop && now < run->end_ns && !rc) {
		next = now > next + POLL_NS ? now : next + POLL_NS;
		if (next > run->end_ns)
			next = run->end_ns;
		incise_clock_wait_until(clock, next);
		now = incise_clock_now(clock);
		rc = incise_recorder_poll(run->recorder, &err);
		if (rc < 0)
			give_up(run, &err);
		if (run->armed) {
			incise_recorder_stats(run->recorder, &stats);
			if (!stats.armed) {
				begin(run, now);
				run->held_ns = now - armed_ns < INCISE_NS_PER_S
						       ? now - armed_ns
						       : INCISE_NS_PER_S;
			}
		}
		take_keys(run);
		if (keyboard_resumed())
			cli_progress_forget();
		capture_view_show(&run->view, run->recorder,
				  (now - run->start_ns) / (double)INCISE_NS_PER_S);
	}
	if (rc)
		run->result.early = err;
	if (!run->armed)
		run->result.seconds =
			(now - run->start_ns + run->held_ns) / (double)INCISE_NS_PER_S;
}

/*
 * What was never triggered leaves nothing behind; and with --force, what has not a sample does
 * not replace a recording that may have some.
 */
static void keep_old(const struct run *run, const char *new)
{
	const struct incise_recorder_stats *stats = &run->result.stats;

	if (stats->force || stats->tracker || stats->frames ||
	    (!stats->armed && !run->wish->force))
		return;
	recording_remove(new);
	if (run->result.early.code)
		cli_fail_with(&run->result.early);
	cli_fail("%s: %s; nothing was recorded%s", run->wish->output,
		 stats->armed ? "was never triggered" : "no device gave a sample",
		 run->wish->force ? ", and nothing is replaced" : "");
}

static struct incise_rig *open_rig(const struct capture_wish *wish)
{
	static const unsigned int camera[] = {
		[CAMERA_AUTO] = INCISE_RIG_CAMERA | INCISE_RIG_IF_NAMED,
		[CAMERA_PICTURES] = INCISE_RIG_CAMERA,
		[CAMERA_DEPTH] = INCISE_RIG_CAMERA,
	};
	struct incise_error err = {0};
	struct incise_rig *rig = incise_rig_open(
		cli_rig(wish->rig),
		INCISE_RIG_TRACKER | INCISE_RIG_FORCE | camera[wish->camera], &err);

	if (!rig)
		cli_fail_with(&err);
	return rig;
}

/* Whether pictures are looked at. */
static bool take_vision(const struct capture_wish *wish, struct incise_rig *rig,
			struct incise_vision_setup *vision)
{
	bool has = incise_rig_camera(rig) && !incise_rig_vision(rig, vision);

	if (wish->camera == CAMERA_DEPTH && !has)
		cli_fail(
			"%s: --camera depth needs its group `vision`, which says what the "
			"handle looks like; see rig.conf(5)",
			incise_rig_spec(rig));
	return has && wish->camera != CAMERA_PICTURES;
}

/* With --force the new one grows beside the old one. */
static void clear(const struct capture_wish *wish, const char *target)
{
	char part[PATH_MAX + 8];

	recording_check(wish->output);
	snprintf(part, sizeof(part), "%s.part", wish->output);
	recording_remove(part);
	snprintf(part, sizeof(part), "%s.part", target);
	recording_remove(part);
	recording_remove(target);
}

static double planned_s(const struct capture_wish *wish, struct incise_rig *rig)
{
	struct incise_sim *sim = incise_rig_sim(rig);

	if (wish->duration_s > 0 || !sim)
		return wish->duration_s;
	return incise_sim_duration(sim) / (double)INCISE_NS_PER_S;
}

int main(int argc, char **argv)
{
	struct incise_calibration calibration;
	struct incise_recorder_setup setup = {.calibration = &calibration};
	struct incise_vision_setup vision;
	struct incise_force_info force;
	struct incise_error err = {0};
	struct capture_wish wish = {0};
	struct run run = {.wish = &wish};
	char target[PATH_MAX];

	capture_wish_take(&wish, argc, argv);
	run.result.path = wish.output;
	incise_calibration_nominal(&calibration);
	if (wish.calibration &&
	    incise_calibration_load(wish.calibration, &calibration, &err))
		cli_fail_with(&err);
	setup.calibration_path = wish.calibration;
	run.rig = open_rig(&wish);
	setup.planned_s = planned_s(&wish, run.rig);
	setup.vision = take_vision(&wish, run.rig, &vision) ? &vision : NULL;
	setup.cuts = wish.cuts;
	setup.trigger_force_N = wish.trigger_force_N;
	setup.trigger_button = wish.trigger_button;
	setup.armed = wish.trigger_button || wish.trigger_force_N > 0;
	incise_force_info(incise_rig_force(run.rig), &force);
	run.view.full_scale_N = force.full_scale_V * 1e3 / calibration.force_mV_N;
	run.view.depth = setup.vision;

	snprintf(target, sizeof(target), "%s%s", wish.output, wish.force ? ".new" : "");
	if (wish.force)
		clear(&wish, target);
	cli_catch_signals();
	run.recorder = incise_recorder_new(target, run.rig, &setup, &err);
	if (!run.recorder)
		cli_fail_with(&err);
	keyboard_begin();
	capture_view_begin();
	record(&run);
	keyboard_end();
	if (incise_recorder_end(run.recorder, &err))
		give_up(&run, &err);
	incise_recorder_stats(run.recorder, &run.result.stats);
	if (incise_recorder_close(run.recorder, &err))
		cli_fail_with(&err);
	/* Whole by now, should the terminal be held. */
	capture_view_end();
	incise_rig_close(run.rig);
	keep_old(&run, target);
	if (wish.force)
		recording_replace(target, wish.output);
	capture_report(&run.result, wish.json);
	capture_judge(&run.result);
	return 0;
}
