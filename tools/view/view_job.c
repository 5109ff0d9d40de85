// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Frames of incise view, and who sits before them; see view_job.h.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/clock.h>
#include "../cli/cli.h"
#include "../cli/image.h"
#include "view_job.h"

int64_t view_wall(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * INCISE_NS_PER_S + now.tv_nsec;
}

void view_pause_until(int64_t t_ns)
{
	struct timespec at = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

/* The picture into NAME-1.png, NAME-2.png …, the first that is not there. */
static void keep_picture(struct view_job *job)
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
	if (image_write_png(path, rgb, width, height, &err))
		cli_warn("%s", err.text);
	free(rgb);
}

void view_job_draw(struct view_job *job, const struct incise_view_status *status,
		   double t_s)
{
	struct incise_error err = {0};

	if (!job->frames++)
		job->begin_ns = view_wall();
	if (incise_view_frame(job->view, status, &err))
		cli_fail_with(&err);
	job->end_ns = view_wall();
	if (job->keep)
		keep_picture(job);
	view_output_frame(&job->output, job->view, t_s);
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

static bool windowed(const struct view_job *job)
{
	return !job->no_output && !view_output_wanted(&job->output);
}

void view_job_view(struct view_job *job)
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
	job->made_ns = view_wall();
	if (!job->has_camera)
		return;
	incise_view_camera(job->view, &camera);
	camera.azimuth_deg = job->camera[0];
	camera.elevation_deg = job->camera[1];
	camera.distance_mm = job->camera[2];
	incise_view_set_camera(job->view, &camera);
}
