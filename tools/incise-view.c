// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise view SCENE: the picture of a scene, in a window or to files.
 *
 *     a loop that runs (its page) ──────╮
 *     a loop here: --rig (mouse …) ─────┤ ticks ──▶ picture ──▶ window
 *     --procedure, in simulated time ───┤                ╰────▶ PNG files, film, strip
 *     --from NAME.rec ──────────────────╯
 */
#include <errno.h>
#include <getopt.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/loop.h>
#include <incise/recording.h>
#include <incise/replay.h>
#include <incise/view.h>
#include "cli.h"
#include "json.h"
#include "png_file.h"
#include "procedure.h"
#include "scene_argument.h"
#include "state_pages.h"
#include "view_hand.h"
#include "view_live.h"
#include "view_output.h"

enum {
	OPT_FROM = CLI_LONG,
	OPT_PROCEDURE,
	OPT_FRAMES,
	OPT_VIDEO,
	OPT_STRIP,
	OPT_NO_OUTPUT,
	OPT_AT,
	OPT_SIZE,
	OPT_FPS,
	OPT_DURATION,
	OPT_CAMERA,
	OPT_NO_PANEL,
	OPT_MODEL,
	OPT_ARITH,
	OPT_JSON
};

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "run a loop here on this rig's tracker; sim:mouse is moved by the mouse"},
	{OPT_FROM, "from", "NAME.rec", "show the loop on this recording"},
	{OPT_PROCEDURE, "procedure", NULL,
	 "show a scripted procedure: cut, bleeding, enlarging, tube"},
	{OPT_FRAMES, "frames", "DIR",
	 "no window: a PNG file for each frame into this folder"},
	{OPT_VIDEO, "video", "FILE.mkv", "no window: a film"},
	{OPT_STRIP, "strip", "FILE.png", "no window: a few frames side by side"},
	{OPT_NO_OUTPUT, "no-output", NULL,
	 "no window and no files: draw in real time, say how often"},
	{OPT_AT, "at", "TIMES", "of the strip, e.g. 2s,6s,12s,20s"},
	{OPT_SIZE, "size", "WxH", "pixels (default: 1280x720)"},
	{OPT_FPS, "fps", "N", "frames per second of files, 1 to 240 (default: 60)"},
	{OPT_DURATION, "duration", "TIME", "end after this time"},
	{OPT_CAMERA, "camera", "A,E,D",
	 "azimuth and elevation in degrees, distance in mm"},
	{OPT_NO_PANEL, "no-panel", NULL, "the tissue alone, without graphs"},
	{OPT_MODEL, "model", "FILE", "use this model instead of the scene's"},
	{OPT_ARITH, "arith", "KIND", "fixed or double, instead of the scene's"},
	{OPT_JSON, "json", NULL, "report what was drawn, as JSON, at the end"},
	{0},
};

static const struct cli_verb verb = {
	.name = "view",
	.synopsis = "SCENE [OPTIONS]",
	.summary =
		"Show a scene: the tissue, its wound and blood, the instrument; beside it force,\n"
		"depth and how the loop runs. Without an option the loop of this scene that runs\n"
		"on this machine.",
	.options = options,
	.notes =
		"Keys: h shows all; left button presses, right turns the camera, the wheel comes\n"
		"near; b blade, n handle, t tube, + and - the depth that is pressed, s keeps the\n"
		"picture, q ends.\n\n"
		"Examples:\n"
		"  incise view neck --rig sim:mouse\n"
		"  incise view neck --procedure --video neck.mkv\n\n"
		"Exit: 0 done, 1 failed, 2 bad usage. See incise-view(1).",
};

struct job {
	struct scene_argument argument;
	const char *rig, *from;
	bool procedure, no_panel, no_output, has_camera, json;
	double camera[3];
	double duration_s;
	struct view_output output;

	struct incise_scene *scene;
	double rate_hz;
	struct incise_rig *own_rig;
	struct incise_plan *plan;
	struct incise_view *view;

	/* What is fed by a loop in simulated time. */
	int64_t first_ns, next_ns, period_ns;
	int64_t wall_ns; /* CLOCK_MONOTONIC of first_ns, for a window */
	int64_t made_ns; /* and when the view was made */
	bool ended;
	struct incise_touch top;

	uint64_t frames, lost;
	int64_t begin_ns, end_ns; /* CLOCK_MONOTONIC, of the frames */
	bool keep;		  /* the picture, under a name of its own */
};

static int64_t wall(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * INCISE_NS_PER_S + now.tv_nsec;
}

static void take_size(struct job *job, const char *text)
{
	int used = 0;

	if (sscanf(text, "%dx%d%n", &job->output.width, &job->output.height, &used) !=
		    2 ||
	    text[used] || job->output.width < 16 || job->output.height < 16 ||
	    job->output.width > INCISE_VIEW_SIDE_MAX ||
	    job->output.height > INCISE_VIEW_SIDE_MAX)
		cli_usage(
			"--size: '%s' is not a size such as 1280x720, sides from 16 to %d",
			text, INCISE_VIEW_SIDE_MAX);
}

static void take_camera(struct job *job, char *text)
{
	char *items[3];

	if (cli_list("camera", text, items, 3) != 3)
		cli_usage(
			"--camera: expected azimuth, elevation and distance, as 20,35,220");
	job->camera[0] = cli_number("camera", items[0], -360, 360);
	job->camera[1] = cli_number("camera", items[1], -89, 89);
	job->camera[2] = cli_number("camera", items[2], 1, 1e5);
	job->has_camera = true;
}

static void take_times(struct job *job, char *text)
{
	char *items[VIEW_STRIP_MAX];

	job->output.n_strip = cli_list("at", text, items, VIEW_STRIP_MAX);
	for (int i = 0; i < job->output.n_strip; i++) {
		job->output.strip_s[i] = cli_duration("at", items[i], 0, 86400);
		if (i && !(job->output.strip_s[i] > job->output.strip_s[i - 1]))
			cli_usage("--at: times go up");
	}
}

static void take_option(struct job *job, int opt)
{
	switch (opt) {
	case 'r':
		job->rig = optarg;
		break;
	case OPT_FROM:
		job->from = optarg;
		break;
	case OPT_PROCEDURE:
		job->procedure = true;
		break;
	case OPT_FRAMES:
		job->output.folder = optarg;
		break;
	case OPT_VIDEO:
		job->output.film_path = optarg;
		break;
	case OPT_STRIP:
		job->output.strip_path = optarg;
		break;
	case OPT_NO_OUTPUT:
		job->no_output = true;
		break;
	case OPT_AT:
		take_times(job, optarg);
		break;
	case OPT_SIZE:
		take_size(job, optarg);
		break;
	case OPT_FPS:
		job->output.fps = (int)cli_integer("fps", optarg, 1, 240);
		break;
	case OPT_DURATION:
		job->duration_s = cli_duration("duration", optarg, 0.01, 86400);
		break;
	case OPT_CAMERA:
		take_camera(job, optarg);
		break;
	case OPT_NO_PANEL:
		job->no_panel = true;
		break;
	case OPT_MODEL:
		job->argument.model = optarg;
		break;
	case OPT_ARITH:
		scene_argument_arith(&job->argument, optarg);
		break;
	case OPT_JSON:
		job->json = true;
		break;
	}
}

static void parse(struct job *job, int argc, char **argv)
{
	int opt;

	*job = (struct job){.output = {.width = 1280, .height = 720, .fps = 60}};
	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		take_option(job, opt);
	scene_argument_operand(&job->argument, argc, argv, optind);
	if (!!job->rig + !!job->from + job->procedure > 1)
		cli_usage(
			"--rig, --from and --procedure are three sources: one at a time");
	if (job->output.strip_path && !job->output.n_strip)
		cli_usage("--strip needs --at");
	if (job->output.n_strip && !job->output.strip_path)
		cli_usage("--at needs --strip");
	if (job->no_output && view_output_wanted(&job->output))
		cli_usage("--no-output writes no files");
	if (job->output.film_path && (job->output.width % 2 || job->output.height % 2))
		cli_usage("--video needs even sides");
	if (view_output_wanted(&job->output) && !job->from && !job->procedure &&
	    !job->duration_s)
		cli_usage("a loop that runs has no end: files need --duration");
}

/* ---- window ---- */

/* The picture into NAME-1.png, NAME-2.png …, the first that is not there. */
static void keep_picture(struct job *job)
{
	const char *slash = strrchr(job->argument.path, '/');
	const char *name = slash ? slash + 1 : job->argument.path;
	int length = (int)strcspn(name, "."), width, height;
	struct incise_error err = {0};
	char path[300];
	uint8_t *rgb;

	job->keep = false;
	incise_view_size(job->view, &width, &height);
	rgb = malloc((size_t)width * height * 3);
	if (!rgb || incise_view_pixels(job->view, rgb)) {
		cli_warn("the picture cannot be read");
		free(rgb);
		return;
	}
	for (int i = 1; i < 10000; i++) {
		snprintf(path, sizeof(path), "%.*s-%d.png", length < 200 ? length : 200,
			 name, i);
		if (access(path, F_OK))
			break;
	}
	if (png_file_write(path, rgb, width, height, &err))
		cli_warn("%s", err.text);
	free(rgb);
}

/* One frame: drawn, shown, written. */
static void draw(struct job *job, const struct incise_view_status *status, double t_s)
{
	struct incise_error err = {0};

	if (!job->frames++)
		job->begin_ns = wall();
	if (incise_view_frame(job->view, status, &err))
		cli_fail_with(&err);
	job->end_ns = wall();
	if (job->keep)
		keep_picture(job);
	view_output_frame(&job->output, job->view, t_s);
}

/* Keys and mouse. Whether it goes on. */
static bool take_events(struct job *job, struct view_hand *hand, struct view_live *live)
{
	struct incise_view_event event;

	while (incise_view_event(job->view, &event)) {
		if (event.type == INCISE_VIEW_QUIT ||
		    (event.type == INCISE_VIEW_KEY && event.pressed && event.key == 'q'))
			return false;
		if (event.type == INCISE_VIEW_KEY && event.pressed && event.key == 's')
			job->keep = true;
		if (hand && view_hand_event(hand, &event))
			view_live_tool(live, hand->tool == INCISE_TOOL_TUBE
						     ? INCISE_TOOL_TUBE
						     : INCISE_TOOL_AUTO);
	}
	return !cli_stop;
}

static const char *const keys[] = {
	"left button\tpress the tool in",
	"b  n  t\tblade, handle, tube",
	"+  -\thow deep it is pressed",
	"right button\tturn the camera",
	"wheel\tnear, far",
	"Home\tcamera as it was",
	"g\tgraphs",
	"s\tkeep the picture",
	"h  F1\tthis",
	"q\tend",
};

static bool windowed(const struct job *job)
{
	return !job->no_output && !view_output_wanted(&job->output);
}

static void make_view(struct job *job)
{
	bool window = windowed(job);
	struct incise_view_setup setup = {.width = job->output.width,
					  .height = job->output.height,
					  .window = window,
					  .title = job->argument.path};
	struct incise_view_camera camera;
	struct incise_error err = {0};

	job->view = incise_view_new(job->scene, job->plan, &setup, &err);
	if (!job->view)
		cli_fail("%s%s", err.text,
			 window ? "; without a screen give --frames, --video or --strip"
				: "");
	incise_view_panel(job->view, !job->no_panel, false);
	incise_view_keys(job->view, keys, sizeof(keys) / sizeof(*keys));
	job->made_ns = wall();
	if (!job->has_camera)
		return;
	incise_view_camera(job->view, &camera);
	camera.azimuth_deg = job->camera[0];
	camera.elevation_deg = job->camera[1];
	camera.distance_mm = job->camera[2];
	incise_view_set_camera(job->view, &camera);
}

/* ---- a loop that runs ---- */

static void pause_until(int64_t t_ns)
{
	struct timespec at = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

static void run_live(struct job *job, struct view_live *live, struct view_hand *hand)
{
	struct incise_view_status status;
	struct incise_error err = {0};
	int64_t begin = wall(), last = begin, due = begin, now;
	int rc = 0;

	while (!rc && take_events(job, hand, live)) {
		now = wall();
		if (job->duration_s && now - begin > job->duration_s * INCISE_NS_PER_S)
			break;
		if (hand)
			view_hand_move(hand, (double)(now - last) / INCISE_NS_PER_S);
		last = now;
		rc = view_live_take(live, job->view, &status, &err);
		if (rc < 0)
			cli_fail_with(&err);
		draw(job, &status, (double)(now - begin) / INCISE_NS_PER_S);
		job->lost = status.lost;
		/* A screen that is waited for makes this no wait at all. */
		due += INCISE_NS_PER_S / job->output.fps;
		if (due < wall())
			due = wall();
		pause_until(due);
	}
}

static void show_running(struct job *job)
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
	make_view(job);
	run_live(job, live, NULL);
	view_live_close(live);
}

static void show_rig(struct job *job)
{
	struct incise_error err = {0};
	struct view_live *live;
	struct view_hand hand;
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
	incise_plan_top(job->plan, &job->top);
	make_view(job);
	held = incise_rig_sim(job->own_rig) &&
	       incise_sim_config(incise_rig_sim(job->own_rig))->motion == 3;
	if (held) {
		view_hand_begin(&hand, incise_rig_sim(job->own_rig),
				incise_scene_handle_mm(job->scene), &job->top);
		view_hand_move(&hand, 0.001);
	}
	live = view_live_begin(job->plan, job->own_rig, job->rate_hz, &err);
	if (!live)
		cli_fail_with(&err);
	run_live(job, live, held ? &hand : NULL);
	view_live_close(live);
}

/* ---- a loop in simulated time ---- */

/* A tick of it: frames that are due by then are drawn. Not 0 ends it. */
static int show_tick(struct job *job, const struct incise_tick *tick)
{
	double t_s;

	if (!job->first_ns) {
		job->first_ns = job->next_ns = tick->t_ns;
		job->wall_ns = wall();
	}
	incise_view_ticks(job->view, tick, 1);
	if (tick->t_ns < job->next_ns)
		return 0;
	t_s = (double)(tick->t_ns - job->first_ns) / INCISE_NS_PER_S;
	job->next_ns += job->period_ns;
	if (job->duration_s && t_s > job->duration_s)
		return 1;
	if (!view_output_wanted(&job->output)) {
		/* To be seen, time passes as it is said; who is late leaves frames out. */
		int64_t due = job->wall_ns + (tick->t_ns - job->first_ns);

		if (wall() > due + job->period_ns)
			return !take_events(job, NULL, NULL);
		pause_until(due);
	}
	draw(job, NULL, t_s);
	cli_progress("%.1f s", t_s);
	return !take_events(job, NULL, NULL);
}

static int procedure_tick(void *context, const struct incise_tick *tick)
{
	struct job *job = context;
	struct procedure_pose pose;
	int rc = show_tick(job, tick);
	double t_s = (double)(tick->t_ns - job->first_ns) / INCISE_NS_PER_S;

	procedure_at(&job->top, incise_scene_handle_mm(job->scene), t_s, &pose);
	incise_sim_hold(incise_rig_sim(job->own_rig), pose.position_mm,
			pose.velocity_mm_s, pose.quaternion);
	incise_plan_set_tool(job->plan, pose.tool == INCISE_TOOL_TUBE ? INCISE_TOOL_TUBE
								      : INCISE_TOOL_AUTO);
	return rc;
}

static void show_procedure(struct job *job)
{
	struct incise_loop_options loop = {
		.rate_hz = job->rate_hz, .ticked = procedure_tick, .context = job};
	static struct incise_loop_stats stats;
	struct procedure_pose pose;
	struct incise_error err = {0};
	double end_s = job->duration_s ? job->duration_s : PROCEDURE_S;

	job->own_rig = incise_rig_open("sim:mouse,clock=simulated,tracker_noise_mm=0",
				       INCISE_RIG_TRACKER, &err);
	if (!job->own_rig)
		cli_fail_with(&err);
	job->plan = incise_plan_new(job->scene, job->own_rig, &err);
	if (!job->plan)
		cli_fail_with(&err);
	incise_plan_top(job->plan, &job->top);
	make_view(job);
	procedure_at(&job->top, incise_scene_handle_mm(job->scene), 0, &pose);
	incise_sim_hold(incise_rig_sim(job->own_rig), pose.position_mm,
			pose.velocity_mm_s, pose.quaternion);
	loop.duration_ns = (int64_t)(end_s * INCISE_NS_PER_S);
	if (incise_loop_run(job->plan, incise_rig_clock(job->own_rig), &loop, &stats,
			    &err) < 0)
		cli_fail_with(&err);
}

static int replay_tick(void *context, const struct incise_replay_tick *tick,
		       struct incise_error *err)
{
	struct job *job = context;

	if (!show_tick(job, tick->tick))
		return 0;
	job->ended = true;
	return incise_error_set(err, ECANCELED, "ended");
}

static void show_recording(struct job *job)
{
	struct incise_replay_options replay = {.ticked = replay_tick, .context = job};
	static struct incise_loop_stats stats;
	struct incise_replay_report report;
	struct incise_recording *recording;
	struct incise_error err = {0};

	recording = incise_recording_open(job->from, &err);
	if (!recording)
		cli_fail_with(&err);
	job->plan = incise_plan_new(job->scene, NULL, &err);
	if (!job->plan)
		cli_fail_with(&err);
	make_view(job);
	if (incise_replay(recording, job->scene, &replay, &stats, &report, &err) &&
	    !job->ended)
		cli_fail("%s: %s", job->from, err.text);
	incise_recording_close(recording);
}

static void report(const struct job *job)
{
	struct incise_view_report did;
	double seconds = (double)(job->end_ns - job->begin_ns) / INCISE_NS_PER_S;

	incise_view_report(job->view, &did);
	json_print(json_pack(
		"{sI so sI sf sI sf sf sf sf si sI ss}", "frames",
		(json_int_t)job->frames, "frames_per_s",
		json_number(job->frames > 1 ? (double)(job->frames - 1) / seconds : NAN),
		"ticks_lost", (json_int_t)job->lost, "cut_mm", did.cut_mm, "stamps",
		(json_int_t)did.stamps, "blood_ul", did.blood_ul_emitted,
		"blood_in_drops_ul", did.blood_ul_drops, "blood_in_trails_ul",
		did.blood_ul_trails, "blood_off_ul", did.blood_ul_off, "drops", did.drops,
		"texels_uploaded", (json_int_t)did.uploaded_texels, "renderer",
		did.renderer ? did.renderer : ""));
}

static void say_rate(const struct job *job)
{
	double s = (double)(wall() - job->made_ns) / INCISE_NS_PER_S;
	struct incise_view_report report;

	incise_view_report(job->view, &report);
	printf("%.1f frames per second: %llu in %.1f s, %dx%d, %d texels, %s\n",
	       (double)report.frames / s, (unsigned long long)report.frames, s,
	       job->output.width, job->output.height, report.texture_px, report.renderer);
}

int main(int argc, char **argv)
{
	struct job job;

	parse(&job, argc, argv);
	job.scene = scene_argument_load(&job.argument);
	job.rate_hz = incise_scene_rate_hz(job.scene);
	job.period_ns = INCISE_NS_PER_S / job.output.fps;
	view_output_begin(&job.output);
	cli_catch_signals();
	if (job.rig)
		show_rig(&job);
	else if (job.procedure)
		show_procedure(&job);
	else if (job.from)
		show_recording(&job);
	else
		show_running(&job);
	cli_progress_end();
	view_output_end(&job.output);
	if (job.json)
		report(&job);
	else if (job.no_output)
		say_rate(&job);
	incise_view_free(job.view);
	incise_plan_free(job.plan);
	incise_rig_close(job.own_rig);
	incise_scene_free(job.scene);
	cli_finish();
	return 0;
}
