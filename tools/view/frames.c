// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Frames of incise view, in a window with its events or into files; see view.h.
 */
#include <errno.h>
#include <glob.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <incise/clock.h>
#include "../cli/cli.h"
#include "../cli/image.h"
#include "../cli/json.h"
#include "view.h"

/* --- files ---------------------------------------------------------------------------- */

bool view_output_wanted(const struct view_output *output)
{
	return output->folder || output->film_path || output->strip_path;
}

/* A strip needs its own frames only; a window, a film or a folder each one. */
static bool is_strip_alone(const struct view_output *output)
{
	return output->strip_path && !output->folder && !output->film_path;
}

bool view_output_complete(const struct view_output *output)
{
	return is_strip_alone(output) && output->stripped == output->n_strip;
}

static bool is_due(const struct view_output *output, double t_s)
{
	return !is_strip_alone(output) || (output->stripped < output->n_strip &&
					   t_s >= output->strip_s[output->stripped]);
}

/* Frames and films that are there already are replaced with --overwrite only. */
static void reserve_files(const struct view_output *output)
{
	char *part = cli_text("%s.part", output->film_path ? output->film_path : "");
	char *frames = cli_text("%s/frame-*.png", output->folder ? output->folder : "");
	glob_t found;

	if (output->film_path)
		cli_output(part);
	if (output->folder) {
		char *first = cli_text("%s/frame-000000.png", output->folder);

		cli_output(first);
		free(first);
	}
	if (output->folder && !glob(frames, 0, NULL, &found)) {
		for (size_t i = 0; i < found.gl_pathc; i++)
			cli_output(found.gl_pathv[i]);
		globfree(&found);
	}
	free(part);
	free(frames);
}

/* Frames of a strip, in rows of four or fewer, each with a line for its time below it. */
static int strip_rows(const struct view_output *output)
{
	return (output->n_strip + 3) / 4;
}

static int strip_columns(const struct view_output *output)
{
	return (output->n_strip + strip_rows(output) - 1) / strip_rows(output);
}

static size_t strip_high(const struct view_output *output)
{
	return (size_t)output->height + 10 + (size_t)output->height / 50;
}

void view_output_begin(struct view_output *output)
{
	size_t row = (size_t)output->width * 3;
	struct incise_error err = {0};

	if (!view_output_wanted(output))
		return;
	reserve_files(output);
	output->rgb = cli_alloc(strip_high(output), row);
	if (output->strip_path) {
		size_t n = (size_t)(strip_rows(output) * strip_columns(output));

		output->strip = cli_alloc(n, strip_high(output) * row);
		memset(output->strip, 255, n * strip_high(output) * row);
	}
	if (output->folder && mkdir(output->folder, 0777) && errno != EEXIST)
		cli_fail("%s: %s", output->folder, strerror(errno));
	if (output->film_path)
		output->film =
			cli_require(incise_film_new(output->film_path, output->width,
						    output->height, output->fps, &err),
				    &err);
}

/* Put the frame, and its time below it, to the right of those before, or below. */
static void add_to_strip(struct view_output *output)
{
	size_t row = (size_t)output->width * 3, columns = (size_t)strip_columns(output),
	       high = strip_high(output),
	       down = (size_t)output->stripped / columns * high,
	       right = (size_t)output->stripped % columns;
	char *time = cli_text("%g s", output->strip_s[output->stripped]);

	incise_view_caption(output->rgb + (size_t)output->height * row, output->width,
			    (int)high - output->height, time);
	free(time);
	for (size_t y = 0; y < high; y++)
		memcpy(output->strip + ((down + y) * columns + right) * row,
		       output->rgb + y * row, row);
	output->stripped++;
}

static void write_frame(struct view_output *output, struct incise_view *view, double t_s)
{
	struct incise_error err = {0};
	char path[4200];
	int rc;

	if (!view_output_wanted(output))
		return;
	rc = incise_view_pixels(view, output->rgb);
	if (rc)
		cli_fail("the image cannot be read back: %s", strerror(-rc));
	if (output->folder) {
		snprintf(path, sizeof(path), "%s/frame-%06llu.png", output->folder,
			 (unsigned long long)output->frames);
		cli_check(image_write_png(path, output->rgb, output->width,
					  output->height, &err),
			  &err);
	}
	if (output->film && incise_film_add(output->film, output->rgb, &err)) {
		incise_film_drop(output->film);
		cli_fail_with(&err);
	}
	if (output->strip_path && output->stripped < output->n_strip &&
	    t_s >= output->strip_s[output->stripped])
		add_to_strip(output);
	output->frames++;
}

void view_output_end(struct view_output *output)
{
	struct incise_error err = {0};

	cli_check(incise_film_close(output->film, &err), &err);
	if (output->strip_path && !output->stripped)
		cli_fail("%s: not written: the run ends before its first frame, at %g "
			 "s; give an earlier --at",
			 output->strip_path, *output->strip_s);
	if (output->strip_path && output->stripped < output->n_strip)
		cli_warn("%s: the run ends before frame %d, at %g s", output->strip_path,
			 output->stripped + 1, output->strip_s[output->stripped]);
	if (output->strip_path &&
	    image_write_png(output->strip_path, output->strip,
			    output->width * strip_columns(output),
			    (int)strip_high(output) * strip_rows(output), &err))
		cli_fail_with(&err);
	free(output->rgb);
	free(output->strip);
}

void view_output_print(const struct view_output *output)
{
	unsigned long long n = output->frames;

	if (output->film_path)
		printf("wrote %s: %s, %.1f s\n", output->film_path, cli_count(n, "frame"),
		       (double)n / output->fps);
	if (output->strip_path)
		printf("wrote %s: %s at", output->strip_path,
		       cli_count(output->stripped, "frame"));
	for (int i = 0; output->strip_path && i < output->stripped; i++)
		printf(" %g%s", output->strip_s[i],
		       i < output->stripped - 1 ? "," : " s\n");
	if (output->folder && n)
		printf("wrote %s/frame-000000.png to frame-%06llu.png\n", output->folder,
		       n - 1);
}

void view_output_json(const struct view_output *output, json_t *files)
{
	if (output->film_path)
		json_array_append_new(files, json_text(output->film_path));
	if (output->strip_path)
		json_array_append_new(files, json_text(output->strip_path));
	for (uint64_t i = 0; output->folder && i < output->frames; i++) {
		char *path = cli_text("%s/frame-%06llu.png", output->folder,
				      (unsigned long long)i);

		json_array_append_new(files, json_text(path));
		free(path);
	}
}

/* --- the hand ------------------------------------------------------------------------- */

#define ABOVE_MM 6.0	 /* over the tissue, when it is not pressed */
#define SINK_MM_S 40.0	 /* how fast it goes in and out: a hand's */
#define FOLLOW_S 0.03	 /* behind the pointer */
#define TURN_S 0.4	 /* to turn the scalpel round */
#define STICK_MM_S 40.0	 /* a joystick at its end */
#define DEPTH_MOST_MM 15 /* that is asked for */

void view_hand_begin(struct view_hand *hand, struct incise_sim *sim, double handle_mm,
		     const struct incise_touch *top)
{
	*hand = (struct view_hand){.sim = sim,
				   .handle_mm = handle_mm,
				   .depth_mm = 3,
				   .tool = INCISE_TOOL_BLADE,
				   .height_mm = 25};
	memcpy(hand->point_mm, top->point_mm, sizeof(hand->point_mm));
	memcpy(hand->normal, top->normal, sizeof(hand->normal));
	memcpy(hand->at_mm, top->point_mm, sizeof(hand->at_mm));
}

static bool key(struct view_hand *hand, int key)
{
	switch (key) {
	case 'b':
		hand->tool = INCISE_TOOL_BLADE;
		return true;
	case 'n':
		hand->tool = INCISE_TOOL_HANDLE;
		return true;
	case 't':
		hand->tool = INCISE_TOOL_TUBE;
		return true;
	case '+':
	case '=':
		hand->depth_mm = fmin(hand->depth_mm + 0.5, DEPTH_MOST_MM);
		return true;
	case '-':
		hand->depth_mm = fmax(hand->depth_mm - 0.5, 0.5);
		return true;
	}
	return false;
}

/* Returns whether the event was for the hand. */
static bool hand_event(struct view_hand *hand, const struct incise_view_event *event)
{
	bool points = event->type == INCISE_VIEW_MOTION ||
		      (event->type == INCISE_VIEW_BUTTON && event->button == 1);

	if (event->used)
		return false;
	if (event->type == INCISE_VIEW_KEY)
		return event->pressed && key(hand, event->key);
	if (event->type == INCISE_VIEW_AXIS && event->axis >= 0 && event->axis < 2) {
		hand->stick[event->axis] = fabs(event->value) > 0.1 ? event->value : 0;
		return true;
	}
	if (event->type == INCISE_VIEW_STICK_BUTTON && event->button == 0) {
		hand->press = event->pressed;
		return true;
	}
	if (!points)
		return false;
	hand->press = event->buttons & 1 ? event->pressure : 0;
	if (event->ray.met) {
		memcpy(hand->point_mm, event->ray.point_mm, sizeof(hand->point_mm));
		memcpy(hand->normal, event->ray.normal, sizeof(hand->normal));
	}
	return true;
}

/* A rotation that takes z to the normal, then the scalpel turned round its own x. */
static void attitude(const double n[3], double round, double q[4])
{
	double c = sqrt(fmax(0, (1 + n[2]) / 2)), a = round * M_PI / 2;
	double p[4] = {1, 0, 0, 0};

	if (c > 1e-6) {
		p[0] = c;
		p[1] = -n[1] / (2 * c);
		p[2] = n[0] / (2 * c);
	}
	q[0] = p[0] * cos(a) - p[1] * sin(a);
	q[1] = p[0] * sin(a) + p[1] * cos(a);
	q[2] = p[2] * cos(a) + p[3] * sin(a);
	q[3] = p[3] * cos(a) - p[2] * sin(a);
}

void view_hand_move(struct view_hand *hand, double dt_s)
{
	double wanted_mm = hand->press > 0 ? -hand->press * hand->depth_mm : ABOVE_MM;
	bool turned = hand->tool == INCISE_TOOL_HANDLE;
	double share = 1 - exp(-fmax(dt_s, 0) / FOLLOW_S), most = SINK_MM_S * dt_s;
	double velocity[3], tip[3], q[4], axis[3], next_mm;

	if (!(dt_s > 0))
		return;
	/* The scalpel is turned over only well above the tissue: an end of it comes down by 0.18 of
	 * its length. */
	if (hand->round != turned) {
		wanted_mm = ABOVE_MM + 0.2 * hand->handle_mm;
		if (hand->height_mm > 0.2 * hand->handle_mm)
			hand->round += fmax(-dt_s / TURN_S,
					    fmin(dt_s / TURN_S, turned - hand->round));
	}
	hand->height_mm += fmax(-most, fmin(most, wanted_mm - hand->height_mm));
	next_mm = hand->height_mm + fmax(-most, fmin(most, wanted_mm - hand->height_mm));
	hand->point_mm[0] += hand->stick[0] * STICK_MM_S * dt_s;
	hand->point_mm[1] -= hand->stick[1] * STICK_MM_S * dt_s;
	attitude(hand->normal, hand->round, q);
	axis[0] = 2 * (q[1] * q[3] + q[0] * q[2]);
	axis[1] = 2 * (q[2] * q[3] - q[0] * q[1]);
	axis[2] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
	for (int i = 0; i < 3; i++) {
		double to = hand->point_mm[i] + hand->height_mm * hand->normal[i];

		hand->at_mm[i] += share * (to - hand->at_mm[i]);
		/* The tool goes on until the next frame: no further than it will be then. */
		velocity[i] =
			share *
			(hand->point_mm[i] + next_mm * hand->normal[i] - hand->at_mm[i]) /
			dt_s;
		tip[i] = hand->at_mm[i] - hand->round * hand->handle_mm * axis[i];
	}
	incise_sim_hold(hand->sim, tip, velocity, q);
}

/* --- frames and events ---------------------------------------------------------------- */

void view_pause_until(int64_t t_ns)
{
	struct timespec at = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

/* Write the frame to the first of NAME-1.png, NAME-2.png … that does not exist. */
static void keep_frame(struct view_job *job)
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
		cli_warn("the image cannot be read back");
		free(rgb);
		return;
	}
	for (int i = 1; i < 10000; i++) {
		snprintf(path, sizeof(path), "%.*s-%d.png", length < 200 ? length : 200,
			 name, i);
		if (access(path, F_OK))
			break;
	}
	if (image_write_png(path, rgb, width, height, &err))
		cli_warn("%s", err.text);
	else if (!job->json)
		printf("wrote %s\n", path);
	free(rgb);
}

/* The frame of so many that will be drawn, or without a known end the time. */
static void show_progress(struct view_job *job, double t_s)
{
	const struct view_output *output = &job->output;
	double all = ceil(job->total_s * output->fps - 1e-6);
	char *name;

	if (!(all >= 1) || !view_output_wanted(output)) {
		cli_progress("%.1f s", t_s);
	} else if (is_strip_alone(output)) {
		double end_s =
			job->log ? job->total_s : output->strip_s[output->n_strip - 1];

		name = cli_text("frame %d of %d", output->stripped, output->n_strip);
		cli_progress_bar(name, end_s > 0 ? fmin(1, t_s / end_s) : 1,
				 &job->progress);
		free(name);
	} else {
		name = cli_text("frame %llu of %.0f", (unsigned long long)output->frames,
				all);
		cli_progress_bar(name, fmin(1, (double)output->frames / all),
				 &job->progress);
		free(name);
	}
}

void view_job_draw(struct view_job *job, const struct incise_view_status *status,
		   double t_s)
{
	struct incise_error err = {0};

	if (is_due(&job->output, t_s)) {
		if (!job->frames++)
			job->begin_ns = cli_now_ns();
		cli_check(incise_view_frame(job->view, status, &err), &err);
		job->end_ns = cli_now_ns();
		if (job->keep)
			keep_frame(job);
		write_frame(&job->output, job->view, t_s);
	}
	show_progress(job, t_s);
}

bool view_job_events(struct view_job *job, struct view_hand *hand, struct view_live *live)
{
	struct incise_view_event event;

	while (incise_view_event(job->view, &event)) {
		if (event.type == INCISE_VIEW_QUIT ||
		    (event.type == INCISE_VIEW_KEY && event.pressed && event.key == 'q'))
			return false;
		if (event.type == INCISE_VIEW_KEY && event.pressed && event.key == 's')
			job->keep = true;
		if (hand && hand_event(hand, &event))
			view_live_tool(live, hand->tool == INCISE_TOOL_TUBE
						     ? INCISE_TOOL_TUBE
						     : INCISE_TOOL_AUTO);
	}
	return !cli_stop;
}

static const char *const keys[] = {
	"left button\tpress the tool in",
	"b  n  t\tblade, handle, tube",
	"+  -\tdepth of a press",
	"s\tsave the image",
	"q\tend",
};

void view_job_view(struct view_job *job)
{
	bool window = !job->no_output && !view_output_wanted(&job->output);
	struct incise_view_setup setup = {.width = job->output.width,
					  .height = job->output.height,
					  .window = window,
					  .live = !view_output_wanted(&job->output),
					  .title = job->argument.path};
	struct incise_view_camera camera;
	struct incise_error err = {0};

	job->view = incise_view_new(job->scene, job->plan, &setup, &err);
	if (!job->view && window && job->rig)
		cli_fail(
			"%s; without a display a hand has nothing to see, but 'incise view "
			"%s --procedure -o FILE.mp4' writes a film",
			err.text, scene_argument_name(job->argument.path));
	if (!job->view)
		cli_fail("%s%s", err.text,
			 window ? "; without a display give -o FILE.mp4, FILE.png "
				  "or DIR"
				: "");
	incise_view_panel(job->view, !job->no_panel, false);
	incise_view_keys(job->view, keys, sizeof(keys) / sizeof(*keys));
	job->made_ns = cli_now_ns();
	if (!job->has_camera)
		return;
	incise_view_camera(job->view, &camera);
	camera.azimuth_deg = job->camera[0];
	camera.elevation_deg = job->camera[1];
	camera.distance_mm = job->camera[2];
	incise_view_set_camera(job->view, &camera);
}
