// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Streams for incise calibrate delay; see delay_streams.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/recorder.h>
#include <incise/recording.h>
#include <incise/rig.h>
#include "../cli/cli.h"
#include "delay_streams.h"

#define POLL_NS 10000000LL

const char *const delay_stream_names[DELAY_STREAMS] = {"force", "tracker", "camera"};

static void take(struct delay_stream *stream, struct incise_recording *recording,
		 const char *values_of)
{
	struct incise_recording_value *values;
	struct incise_error err = {0};
	int n = incise_recording_values(recording, values_of, &values, &err);

	if (n < 0)
		cli_fail_with(&err);
	stream->points = calloc((size_t)n + 1, sizeof(*stream->points));
	if (!stream->points)
		cli_fail("no memory");
	for (int i = 0; i < n; i++)
		stream->points[i] = (struct incise_delay_point){.t_ns = values[i].t_ns,
								.value = values[i].value};
	stream->n = n;
	free(values);
}

void delay_streams_read(struct delay_stream streams[DELAY_STREAMS], const char *path)
{
	static const char *const values[] = {"force", "depth", "camera"};
	struct incise_recording_info info;
	struct incise_error err = {0};
	struct incise_recording *recording = incise_recording_open(path, &err);

	if (!recording || incise_recording_info(recording, &info, &err))
		cli_fail_with(&err);
	if (!info.n_streams)
		cli_fail("%s: is of an older incise, and does not say which delays its "
			 "times have; record anew",
			 path);
	for (int i = 0; i < DELAY_STREAMS; i++) {
		streams[i] = (struct delay_stream){0};
		for (int k = 0; k < info.n_streams; k++)
			if (!strcmp(info.streams[k].name, delay_stream_names[i]))
				streams[i].about = info.streams[k];
		take(&streams[i], recording, values[i]);
	}
	incise_recording_close(recording);
}

/* Poll until the time is over, a signal comes or it fails: 0 or not. */
static int record(struct incise_recorder *recorder, struct incise_clock *clock,
		  double time_s, struct incise_error *err)
{
	int64_t start = incise_clock_now(clock), now = start;
	struct incise_recorder_stats stats;
	int rc = 0;

	while (!rc && !cli_stop && (now - start) * 1e-9 < time_s) {
		incise_clock_wait_until(clock, now + POLL_NS);
		now = incise_clock_now(clock);
		rc = incise_recorder_poll(recorder, err);
		incise_recorder_stats(recorder, &stats);
		cli_progress("%s  %.0f s left, depth %.1f mm, force %.2f N",
			     (now - start) * 1e-9 < 1 ? "hold the tool free  "
						      : "tap or press, unevenly",
			     time_s - (now - start) * 1e-9, stats.depth_mm,
			     stats.force_N);
	}
	cli_progress_end();
	return rc;
}

int delay_streams_record(const char *spec, const struct incise_calibration *calibration,
			 double time_s, bool camera, const char *path,
			 struct incise_error *err)
{
	unsigned int devices = INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA |
			       (camera ? 0 : INCISE_RIG_IF_NAMED);
	struct incise_recorder_setup setup = {.calibration = calibration,
					      .planned_s = time_s};
	struct incise_rig *rig = incise_rig_open(cli_rig(spec), devices, err);
	struct incise_error second = {0};
	struct incise_recorder *recorder;
	struct incise_vision_setup vision;
	int rc;

	if (!rig)
		return -1;
	if (incise_rig_camera(rig) && !incise_rig_vision(rig, &vision))
		setup.vision = &vision;
	recorder = incise_recorder_new(path, rig, &setup, err);
	rc = recorder ? record(recorder, incise_rig_clock(rig), time_s, err) : -1;
	if (recorder && incise_recorder_close(recorder, rc ? &second : err))
		rc = -1;
	incise_rig_close(rig);
	if (!rc && cli_stop) {
		incise_error_set(err, EINTR, "stopped; the old calibration stays");
		rc = -1;
	}
	return rc ? -1 : 0;
}
