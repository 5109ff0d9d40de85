// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Tracker, force channel and camera, each in front of its backend; see incise/tracker.h,
 * incise/force.h and incise/camera.h.
 */
#include <math.h>
#include <stdio.h>
#include <incise/backend.h>

int incise_tracker_read(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	return tracker->ops->read(tracker, samples, n);
}

void incise_tracker_info(const struct incise_tracker *tracker,
			 struct incise_tracker_info *info)
{
	tracker->ops->info(tracker, info);
}

double incise_tracker_station_hz(const struct incise_tracker_info *info)
{
	return info->stations > 1 ? info->rate_hz / info->stations : info->rate_hz;
}

uint64_t incise_tracker_lost(const struct incise_tracker *tracker)
{
	return tracker->ops->lost(tracker);
}

int incise_tracker_cause(struct incise_tracker *tracker, char *text, size_t size)
{
	return tracker->ops->cause ? tracker->ops->cause(tracker, text, size)
				   : snprintf(text, size, "%s", "");
}

int incise_force_read(struct incise_force *force, struct incise_force_sample *samples,
		      int n)
{
	return force->ops->read(force, samples, n);
}

void incise_force_info(const struct incise_force *force, struct incise_force_info *info)
{
	force->ops->info(force, info);
}

#define NEWTONS_MV_N 1000 /* its volts are newtons */

void incise_force_calibration(const struct incise_force_info *info,
			      struct incise_calibration *calibration)
{
	if (!info->newtons)
		return;
	/* Another sensitivity shows that the zero is of another device. */
	if (calibration->force_mV_N != NEWTONS_MV_N)
		calibration->force_zero_mV = NAN;
	calibration->force_mV_N = NEWTONS_MV_N;
}

uint64_t incise_force_lost(const struct incise_force *force)
{
	return force->ops->lost(force);
}

int incise_force_cause(struct incise_force *force, char *text, size_t size)
{
	return force->ops->cause ? force->ops->cause(force, text, size)
				 : snprintf(text, size, "%s", "");
}

/* No camera queues more frames than this, so a slow reader comes to an end. */
#define FRAMES_MAX 32

int incise_camera_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	return camera->ops->read(camera, frame);
}

int incise_camera_newest(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	struct incise_camera_frame next;
	int found = 0, rc = 1;

	for (int i = 0; i < FRAMES_MAX && rc == 1; i++) {
		rc = incise_camera_read(camera, &next);
		if (rc == 1) {
			*frame = next;
			found = 1;
		}
	}
	/* The next read reports the error again. */
	return found ? found : rc;
}

void incise_camera_info(const struct incise_camera *camera,
			struct incise_camera_info *info)
{
	camera->ops->info(camera, info);
}

uint64_t incise_camera_lost(const struct incise_camera *camera)
{
	return camera->ops->lost(camera);
}

int incise_camera_cause(struct incise_camera *camera, char *text, size_t size)
{
	return camera->ops->cause ? camera->ops->cause(camera, text, size)
				  : snprintf(text, size, "%s", "");
}
