// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The camera of a recording: its pictures go through the pump into camera.mkv, and their rows
 * come back from it; see recorder.h and frame_pump.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include "recorder.h"

#define BATCH 64
/* A disk that has not answered for so long is given up. */
#define PATIENCE_NS (5 * INCISE_NS_PER_S)
/* A power cut costs no more pictures than the database loses rows, and a little. */
#define SYNC_NS 1000000000LL
/* A camera that shoots nothing for so long, and so many periods, is silent. */
#define SILENT_NS (2 * INCISE_NS_PER_S)
#define SILENT_PERIODS 10
/* A computer that stood still for longer did not look. */
#define LOOK_NS 100000000LL

int incise_recorder_open_camera(struct incise_recorder *rec,
				const struct incise_vision_setup *vision,
				struct incise_error *err)
{
	bool real = incise_clock_is_real(incise_rig_clock(rec->rig));
	const struct incise_frames_options options = {.sync_ns = real ? SYNC_NS : 0};
	const struct incise_frames_shape shape = {
		.width = rec->camera_info.width,
		.height = rec->camera_info.height,
		.pixels = rec->camera_info.pixels,
		.rate_hz = rec->camera_info.rate_hz,
	};
	struct incise_vision_setup scaled;
	char *file;

	if (vision) {
		scaled = *vision;
		if (scaled.full_px > 0)
			scaled.depth_mm_px = rec->calibration.depth_mm_px;
		rec->camera.vision = incise_vision_new(&scaled, err);
		if (!rec->camera.vision)
			return -errno;
	}
	if (asprintf(&file, "%s/%s", rec->part, INCISE_FRAMES_FILE) < 0)
		return incise_error_set(err, ENOMEM, "%s: out of memory", rec->path);
	rec->camera.writer = incise_frames_writer_new(file, &shape, &options, err);
	free(file);
	return rec->camera.writer ? 0 : -errno;
}

int incise_recorder_start_camera(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_frame_pump_setup setup = {
		.camera = incise_rig_camera(rec->rig),
		.clock = incise_rig_clock(rec->rig),
		.vision = rec->camera.vision,
		.writer = rec->camera.writer,
	};

	if (!rec->camera.writer)
		return 0;
	rec->camera.writer = NULL; /* the pump's, which closes it */
	rec->camera.pump = incise_frame_pump_new(&setup, err);
	return rec->camera.pump ? 0 : -errno;
}

static int take_records(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_frame_record records[BATCH];
	int n = BATCH, rc = 0;

	while (n == BATCH) {
		n = incise_frame_pump_take(rec->camera.pump, records, BATCH);
		for (int i = 0; i < n && !rc; i++)
			rc = incise_recorder_put_frame(rec, &records[i], err);
		if (rc)
			return rc;
	}
	return 0;
}

static void count(struct incise_recorder *rec, struct incise_frame_pump_stats *stats)
{
	incise_frame_pump_stats(rec->camera.pump, stats);
	rec->streams[INCISE_LEDGER_CAMERA].device_lost =
		stats->lost + stats->dropped + stats->unwritten + stats->unrecorded;
	rec->stats.frames_unlooked = stats->unlooked;
}

/* Whether pictures come. Returns 0 or of the disk. */
static int listen(struct incise_recorder *rec, uint64_t read, struct incise_error *err)
{
	struct incise_recorder_camera *camera = &rec->camera;
	int64_t now_ns = incise_clock_now(incise_rig_clock(rec->rig));
	int64_t since_ns = camera->looked_ns ? now_ns - camera->looked_ns : 0;
	double period_ns = 1e9 / rec->camera_info.rate_hz; /* of none: infinite */
	bool was = camera->silent;
	int rc = SQLITE_OK;

	camera->looked_ns = now_ns;
	camera->silent_ns += since_ns < LOOK_NS ? since_ns : LOOK_NS;
	if (read != camera->seen)
		camera->silent_ns = 0;
	camera->seen = read;
	camera->silent = camera->silent_ns >= SILENT_NS &&
			 ((double)camera->silent_ns >= SILENT_PERIODS * period_ns ||
			  !(rec->camera_info.rate_hz > 0));
	if (camera->silent && !was)
		rc = incise_recorder_note(rec, "silent", "camera: no picture for %.1f s",
					  (double)camera->silent_ns * 1e-9);
	else if (was && !camera->silent)
		rc = incise_recorder_note(rec, "silent", "camera: pictures come again");
	return rc == SQLITE_OK ? 0 : incise_recorder_fail(rec, err);
}

int incise_recorder_take_camera(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_CAMERA];
	struct incise_frame_pump_stats stats;
	int rc;

	if (!rec->camera.pump)
		return 0;
	/* On a clock that runs the pump has a thread for it, and this does nothing. */
	while (!*stream->ended && incise_frame_pump_step(rec->camera.pump) > 0)
		;
	rc = take_records(rec, err);
	count(rec, &stats);
	if (!rc && !*stream->ended && (stats.camera.code || stats.file.code))
		rc = incise_recorder_end_stream(
			rec, INCISE_LEDGER_CAMERA,
			stats.camera.code ? stats.camera.text : stats.file.text, err);
	else if (!rc && !*stream->ended)
		rc = listen(rec, stats.read, err);
	return rc;
}

int incise_recorder_end_camera(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_CAMERA];
	struct incise_frame_pump_stats stats;
	struct incise_error why = {0};
	int rc = 0, stopped;

	if (!rec->camera.pump) { /* never triggered: a file without pictures */
		incise_frames_writer_close(rec->camera.writer, NULL);
		rec->camera.writer = NULL;
		return 0;
	}
	stopped = incise_frame_pump_stop(rec->camera.pump, PATIENCE_NS, &why);
	rc = take_records(rec, err);
	count(rec, &stats);
	/* What hangs on a disk that does not answer will never be told of: it has no row. */
	if (stopped == -ETIMEDOUT)
		stream->device_lost = stats.lost + stats.read - stream->rows;
	if (!rc && stopped && !*stream->ended)
		rc = incise_recorder_end_stream(rec, INCISE_LEDGER_CAMERA, why.text, err);
	if (!rc && rec->camera.silent && !*stream->ended) {
		incise_error_set(
			&why, ENODATA,
			"%s: gave no picture for the last %.1f s; check its cable",
			stream->device, (double)rec->camera.silent_ns * 1e-9);
		rc = incise_recorder_end_stream(rec, INCISE_LEDGER_CAMERA, why.text, err);
	}
	return rc;
}

void incise_recorder_close_camera(struct incise_recorder *rec)
{
	incise_frame_pump_free(rec->camera.pump);
	rec->camera.pump = NULL;
	incise_frames_writer_close(rec->camera.writer, NULL);
	rec->camera.writer = NULL;
	incise_vision_free(rec->camera.vision);
	rec->camera.vision = NULL;
}
