// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures of files or of the rig's camera, one after the other; see depth_data.h.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "depth_data.h"
#include "depth_picture.h"

#define WAIT_NS 2000000	       /* between two looks at the camera */
#define PATIENCE_NS 5000000000 /* for a picture to come */

static void wait_for(struct incise_clock *clock, int64_t ns)
{
	incise_clock_wait_until(clock, incise_clock_now(clock) + ns);
}

static void next_frame(struct incise_rig *rig, struct incise_camera_frame *frame)
{
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_camera *camera = incise_rig_camera(rig);
	int64_t until = incise_clock_now(clock) + PATIENCE_NS;
	char cause[400];
	int rc;

	while (!(rc = incise_camera_read(camera, frame))) {
		if (cli_stop)
			cli_fail("stopped; the old calibration stays");
		if (incise_clock_now(clock) > until)
			cli_fail("the camera gives no picture");
		wait_for(clock, WAIT_NS);
	}
	if (rc > 0)
		return;
	incise_camera_cause(camera, cause, sizeof(cause));
	cli_fail("camera: %s", *cause ? cause : strerror(-rc));
}

/* What is there is old: the camera has held it while the user was asked. */
static void drop_old(struct incise_rig *rig)
{
	struct incise_camera_frame frame;

	incise_camera_newest(incise_rig_camera(rig), &frame);
}

static void ask(const char *prompt, int n)
{
	char line[100];

	fprintf(stderr, prompt, n);
	fprintf(stderr, " [Enter] ");
	if (!fgets(line, sizeof(line), stdin) || cli_stop)
		cli_fail("stopped; the old calibration stays");
}

static void of_camera(struct depth_source *source, int pictures, const char *prompt,
		      depth_take *take, void *context)
{
	struct incise_error err = {0};
	struct incise_rig *rig =
		incise_rig_open(cli_rig(source->rig), INCISE_RIG_CAMERA, &err);
	struct incise_camera_info info;
	int tries = 0;

	if (!rig)
		cli_fail_with(&err);
	incise_camera_info(incise_rig_camera(rig), &info);
	snprintf(source->device, sizeof(source->device), "%.63s", info.name);
	for (int taken = 0; taken < pictures;) {
		struct incise_camera_frame frame;
		char name[20];

		if (source->guided && (source->each || !taken)) {
			ask(prompt, taken + 1);
			drop_old(rig);
		} else if (taken && source->every_s > 0) {
			wait_for(incise_rig_clock(rig), (int64_t)(source->every_s * 1e9));
			drop_old(rig);
		}
		next_frame(rig, &frame);
		snprintf(name, sizeof(name), "%d", taken + 1);
		/* On a terminal a view that failed is asked for again. */
		if (take(context, &frame, name) || !source->guided || ++tries > 100)
			taken++;
		cli_progress("%d of %d pictures", taken, pictures);
	}
	cli_progress_end();
	incise_rig_close(rig);
}

void depth_pictures(struct depth_source *source, int pictures, const char *prompt,
		    depth_take *take, void *context)
{
	if (!source->n_paths) {
		of_camera(source, pictures, prompt, take, context);
		return;
	}
	snprintf(source->device, sizeof(source->device), "pictures");
	for (int i = 0; i < source->n_paths; i++) {
		struct incise_camera_frame frame;

		if (cli_stop)
			cli_fail("stopped; the old calibration stays");
		depth_picture_read(source->path[i], &frame);
		take(context, &frame, source->path[i]);
		free((void *)frame.data);
	}
}
