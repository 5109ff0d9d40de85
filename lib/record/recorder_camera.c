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
