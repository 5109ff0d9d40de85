// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise view SCENE: a scene in a window or in files.
 *
 *     a loop that runs (its page) ──────╮
 *     a loop here: --rig (mouse …) ─────┤ ticks ──▶ frames ──▶ window
 *     --procedure, in simulated time ───┤                ╰────▶ PNG files, film, strip
 *     --from NAME.rec ──────────────────╯
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <incise/clock.h>
#include "cli/cli.h"
#include "cli/json.h"
#include "view/view.h"

static void parse_size(void *whole, char *text)
{
	struct view_job *job = whole;
	int used = 0;

	if (sscanf(text, "%dx%d%n", &job->output.width, &job->output.height, &used) !=
		    2 ||
	    text[used] || job->output.width < 16 || job->output.height < 16 ||
	    job->output.width > INCISE_VIEW_SIDE_MAX ||
	    job->output.height > INCISE_VIEW_SIDE_MAX)
		cli_usage("--size: expected a size such as 1280x720, sides from 16 to "
			  "%d, found '%s'",
			  INCISE_VIEW_SIDE_MAX, text);
}

static void parse_camera(void *whole, char *text)
{
	struct view_job *job = whole;
	char *items[3];

	if (cli_list("viewpoint", text, items, 3) != 3)
		cli_usage("--viewpoint: expected azimuth, elevation and distance, for "
			  "example 20,35,220");
	job->camera[0] = cli_number("viewpoint", items[0], -360, 360);
	job->camera[1] = cli_number("viewpoint", items[1], -89, 89);
	job->camera[2] = cli_number("viewpoint", items[2], 1, 1e5);
	job->has_camera = true;
}

static void parse_times(void *whole, char *text)
{
	struct view_job *job = whole;
	char *items[VIEW_STRIP_MAX];

	job->output.n_strip = cli_list("at", text, items, VIEW_STRIP_MAX);
	for (int i = 0; i < job->output.n_strip; i++) {
		job->output.strip_s[i] = cli_duration("at", items[i], 0, 86400);
		if (i && !(job->output.strip_s[i] > job->output.strip_s[i - 1]))
			cli_usage("--at: expected times in ascending order, for "
				  "example 2s,6s,12s");
	}
}

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "run a loop here on this rig's tracker; sim:mouse follows the mouse",
	 CLI_INPUT(struct view_job, rig)},
	{0, "from", "NAME.rec", "run the loop on this recording",
	 CLI_INPUT(struct view_job, from)},
	{0, "procedure", NULL,
	 "show a scripted procedure: cut, bleeding, enlarging, tube",
	 CLI_FLAG(struct view_job, procedure)},
	{'o', "output", "DIR",
	 "no window: write a PNG file for each frame into this folder; none: write "
	 "nothing, draw in real time and report the frame rate",
	 CLI_OUTPUTS(struct view_job, output.folder)},
	{'o', "output", "FILE.mp4|FILE.mkv", "no window: write a film (MP4 or Matroska)",
	 CLI_OUTPUT(struct view_job, output.film_path), .extensions = ".mp4 .mkv"},
	{'o', "output", "FILE.png",
	 "no window: write a few frames in rows of up to four, with their times, by --at",
	 CLI_OUTPUT(struct view_job, output.strip_path), .extensions = ".png"},
	SESSION_OPTIONS(struct view_job, session),
	{0, "at", "TIMES", "times of the frames of FILE.png, for example 2s,6s,12s,20s",
	 CLI_PARSED_BY(parse_times)},
	{0, "size", "WxH", "width and height in pixels (default: 1280x720)",
	 CLI_PARSED_BY(parse_size)},
	{0, "rate", "HZ", "frames per second of files, 1 to 240 (default: 60)",
	 CLI_INTEGER(struct view_job, output.fps, 1, 240)},
	{0, "duration", "TIME", "end after this time",
	 CLI_DURATION(struct view_job, duration_s, 0.01, 86400)},
	{0, "viewpoint", "A,E,D", "azimuth and elevation in degrees, distance in mm",
	 CLI_PARSED_BY(parse_camera)},
	{0, "no-panel", NULL, "draw the tissue without graphs",
	 CLI_FLAG(struct view_job, no_panel)},
	SCENE_ARGUMENT_OPTIONS(struct view_job, argument),
	{0, "json", NULL, "report the frames drawn as JSON, at the end",
	 CLI_FLAG(struct view_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "view",
	.synopsis = "SCENE [OPTIONS]",
	.summary =
		"Show a scene: the tissue, its wound and blood, and the instrument; next "
		"to it force, depth and the state of the loop. The default is the loop of "
		"this scene that runs on this machine.",
	.options = options,
	.notes = "Keys: h lists all; left button presses, right button turns the camera, "
		 "the wheel zooms; b blade, n handle, t tube, + and - the depth of a "
		 "press, s saves the image, q ends.",
	.more = scene_argument_installed,
	.examples = "incise view neck --rig sim:mouse\n"
		    "incise view neck --procedure -o neck.mp4",
};

static void parse(struct view_job *job, int argc, char **argv)
{
	*job = (struct view_job){.output = {.width = 1280, .height = 720, .fps = 60}};
	cli_parse(&command, argc, argv, job);
	scene_argument_operand(&job->argument, argc, argv, optind);
	session_options_check(&job->session);
	if (!!job->rig + !!job->from + job->procedure > 1)
		cli_usage("--rig, --from and --procedure exclude each other; give one of "
			  "them");
	if (job->output.strip_path && !job->output.n_strip)
		cli_usage("-o %s needs --at (times of its frames)",
			  job->output.strip_path);
	if (job->output.n_strip && !job->output.strip_path)
		cli_usage("--at needs -o FILE.png (file to write)");
	job->no_output = job->output.folder && !strcmp(job->output.folder, "none");
	if (job->no_output)
		job->output.folder = NULL;
	if (job->no_output && view_output_wanted(&job->output))
		cli_usage("-o none does not go with files to write");
	if (job->output.film_path && (job->output.width % 2 || job->output.height % 2))
		cli_usage("-o %s needs an even width and height; change --size",
			  job->output.film_path);
	if (view_output_wanted(&job->output) && !job->from && !job->procedure &&
	    !job->duration_s)
		cli_usage("missing --duration (a running loop has no end, but a file "
			  "has)");
}

static void report(const struct view_job *job)
{
	json_t *files = json_array();
	struct incise_view_report did;
	double seconds = (double)(job->end_ns - job->begin_ns) / INCISE_NS_PER_S;

	incise_view_report(job->view, &did);
	view_output_json(&job->output, files);
	if (job->session.path)
		json_array_append_new(files, json_text(job->session.path));
	json_print(json_pack(
		"{sI so sI sf sI sf sf sf sf si sI ss so}", "frames",
		(json_int_t)job->frames, "frames_per_s",
		json_number(job->frames > 1 ? (double)(job->frames - 1) / seconds : NAN),
		"ticks_lost", (json_int_t)job->lost, "cut_mm", did.cut_mm, "stamps",
		(json_int_t)did.stamps, "blood_ul", did.blood_ul_emitted,
		"blood_in_drops_ul", did.blood_ul_drops, "blood_in_trails_ul",
		did.blood_ul_trails, "blood_off_ul", did.blood_ul_off, "drops", did.drops,
		"texels_uploaded", (json_int_t)did.uploaded_texels, "renderer",
		did.renderer ? did.renderer : "", "files", files));
}

static void print_rate(const struct view_job *job)
{
	double s = (double)(cli_now_ns() - job->made_ns) / INCISE_NS_PER_S;
	struct incise_view_report report;

	incise_view_report(job->view, &report);
	printf("%.1f frames per second: %llu in %.1f s, %dx%d, %d texels, %s\n",
	       (double)report.frames / s, (unsigned long long)report.frames, s,
	       job->output.width, job->output.height, report.texture_px, report.renderer);
}

static void print_files(const struct view_job *job)
{
	view_output_print(&job->output);
	if (job->session.path)
		printf("wrote %s\n", job->session.path);
}

static void begin_session(struct view_job *job)
{
	const struct session_start start = {
		.program = "view",
		.source = job->rig	   ? job->rig
			  : job->procedure ? "procedure"
			  : job->from	   ? job->from
					   : "running loop",
		.scene = job->scene,
		.scene_path = job->argument.path,
		.real = !job->procedure && !job->from,
	};

	job->log = session_log_begin(&job->session, &start);
}

/* A session that cannot be written takes no picture with it, nor the other way round. */
static void end_files(struct view_job *job)
{
	const char *kind = cli_stop ? "signal" : *job->fault ? "fault" : "asked";
	struct incise_error err = {0};
	int rc = session_log_end(job->log, kind,
				 cli_stop ? strsignal(cli_stop) : job->fault, &err);

	view_output_end(&job->output);
	cli_check(rc, &err);
}

int main(int argc, char **argv)
{
	struct view_job job;

	parse(&job, argc, argv);
	job.scene = scene_argument_load(&job.argument);
	job.rate_hz = incise_scene_rate_hz(job.scene);
	view_output_begin(&job.output);
	begin_session(&job);
	cli_catch_signals();
	if (job.rig)
		view_rig(&job);
	else if (job.procedure)
		view_procedure(&job);
	else if (job.from)
		view_recording(&job);
	else
		view_running(&job);
	cli_progress_end();
	end_files(&job);
	if (job.json)
		report(&job);
	else if (job.no_output)
		print_rate(&job);
	if (!job.json)
		print_files(&job);
	incise_view_free(job.view);
	incise_plan_free(job.plan);
	incise_rig_close(job.own_rig);
	incise_scene_free(job.scene);
	cli_finish();
	return 0;
}
