// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Writing a recording; see incise/recorder.h, and recorder.h for its parts.
 *
 *     force ────►┐                         ┌─► tables, ledger ─► one transaction per 100 ms
 *     tracker ──►┼─► poll ─► times ─► rows ┤                     of the rig's clock
 *     camera ─► pump (threads of its own) ─┴─► camera.mkv
 *
 * On a real clock each commit is synced, so a power cut costs no more than a kill: the
 * last 100 ms. A device's own buffer bridges the time that syncing takes.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "recorder.h"

#define BATCH 1024

/* --- beginning ------------------------------------------------------------------- */

static void recorder_free(struct incise_recorder *rec)
{
	incise_recorder_close_camera(rec);
	incise_recorder_close_database(rec);
	incise_recorder_hold_free(rec);
	if (rec->folder >= 0)
		close(rec->folder);
	if (rec->parent >= 0)
		close(rec->parent);
	free(rec->path);
	free(rec->part);
	free(rec);
}

static int check_rig(const char *path, struct incise_rig *rig, struct incise_error *err)
{
	struct incise_tracker_info tracker;

	if (!incise_rig_tracker(rig) || !incise_rig_force(rig))
		return incise_error_set(
			err, ENODEV,
			"%s: a recording needs a tracker and a force channel; the rig "
			"%s was opened without",
			path, incise_rig_spec(rig));
	incise_tracker_info(incise_rig_tracker(rig), &tracker);
	/* Rows of two sensors in one table would be one that jumps to and fro. */
	if (tracker.stations > 1)
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: a recording holds one sensor, and the tracker of %s "
			"reads %d; name the scalpel's alone in "
			"tracker_setup.stations",
			path, incise_rig_spec(rig), tracker.stations);
	return 0;
}

/*
 * Where making files took long, devices have lost some of what came meanwhile. That is of
 * before the recording, and no loss to it. The virtual rig loses when it is asked.
 */
static void begin_counts(struct incise_recorder *rec)
{
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_force *force = incise_rig_force(rec->rig);
	struct incise_tracker_sample record;
	struct incise_force_sample sample;

	incise_force_read(force, &sample, 0);
	incise_tracker_read(tracker, &record, 0);
	rec->streams[INCISE_LEDGER_FORCE].lost_at_start = incise_force_lost(force);
	rec->streams[INCISE_LEDGER_TRACKER].lost_at_start = incise_tracker_lost(tracker);
}

/* Files in the folder, and all that may fail before the first sample is taken. */
static int begin(struct incise_recorder *rec, const struct incise_recorder_setup *setup,
		 struct incise_error *err)
{
	int rc = incise_recorder_preflight(rec, setup->planned_s, err);

	if (!rc)
		rc = incise_recorder_open_database(rec, setup->calibration_path, err);
	if (!rc && rec->streams[INCISE_LEDGER_CAMERA].there)
		rc = incise_recorder_open_camera(rec, setup->vision, err);
	if (!rc && setup->armed && incise_recorder_hold(rec))
		rc = incise_error_set(err, ENOMEM, "%s: out of memory", rec->path);
	if (!rc && !setup->armed)
		rc = incise_recorder_start_camera(rec, err);
	if (!rc)
		begin_counts(rec);
	if (rc) {
		incise_recorder_close_camera(rec);
		incise_recorder_close_database(rec);
		incise_recorder_remove_folder(rec);
	}
	return rc;
}

struct incise_recorder *incise_recorder_new(const char *path, struct incise_rig *rig,
					    const struct incise_recorder_setup *setup,
					    struct incise_error *err)
{
	struct incise_recorder *rec;
	double point_mm[3], normal[3];
	int rc;

	if (check_rig(path, rig, err))
		return NULL;
	rec = calloc(1, sizeof(*rec));
	if (!rec) {
		incise_error_set(err, ENOMEM, "%s: out of memory", path);
		return NULL;
	}
	rec->parent = rec->folder = -1;
	rec->rig = rig;
	rec->calibration = *setup->calibration;
	rec->cuts = setup->cuts;
	rec->hold.force_N = setup->trigger_force_N;
	rec->hold.button = setup->trigger_button;
	rec->stats.zero_mV = rec->calibration.force_zero_mV;
	rec->stats.camera_depth_mm = NAN;
	rec->zero.depth_max_mm = -INFINITY;
	incise_force_info(incise_rig_force(rig), &rec->force_info);
	incise_tracker_info(incise_rig_tracker(rig), &rec->tracker_info);
	if (incise_rig_camera(rig))
		incise_camera_info(incise_rig_camera(rig), &rec->camera_info);
	incise_rig_surface(rig, point_mm, normal);
	incise_depth_init(&rec->depth, point_mm, normal);
	incise_recorder_begin_streams(rec);
	rc = incise_recorder_take_path(rec, path, err);
	if (!rc)
		rc = incise_recorder_make_folder(rec, err);
	if (!rc)
		rc = begin(rec, setup, err);
	if (rc) {
		recorder_free(rec);
		errno = -rc;
		return NULL;
	}
	/* A power cut must not take the folder's name; where this fails, nothing is worse. */
	if (incise_clock_is_real(incise_rig_clock(rig)) && !fsync(rec->folder))
		incise_recorder_sync_parent(rec);
	return rec;
}

/* --- samples --------------------------------------------------------------------- */

/*
 * A device that fails ends its stream alone. @cause: what it tells of it, if anything.
 * Returns 0 or of the disk.
 */
static int fail_device(struct incise_recorder *rec, int stream, const char *cause, int rc,
		       struct incise_error *err)
{
	char why[200];

	if (!*cause)
		snprintf(why, sizeof(why), "%s: %s; check its cable and power",
			 rec->streams[stream].device,
			 rc == -ENODEV ? "is gone" : strerror(-rc));
	return incise_recorder_end_stream(rec, stream, *cause ? cause : why, err);
}

static int take_force(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_FORCE];
	struct incise_force *force = incise_rig_force(rec->rig);
	struct incise_force_sample samples[BATCH];
	char cause[200];
	int n = BATCH, rc = 0;

	while (n == BATCH && !*stream->ended) {
		n = incise_force_read(force, samples, BATCH);
		if (n < 0) {
			incise_force_cause(force, cause, sizeof(cause));
			rc = fail_device(rec, INCISE_LEDGER_FORCE, cause, n, err);
		}
		for (int i = 0; i < n && !rc && !*stream->ended; i++)
			rc = incise_recorder_put_force(rec, &samples[i], err);
		if (rc)
			return rc;
	}
	stream->device_lost = incise_force_lost(force) - stream->lost_at_start;
	return 0;
}

static int take_tracker(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_TRACKER];
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_tracker_sample samples[BATCH / 16];
	char cause[200];
	int n = BATCH / 16, rc = 0;

	while (n == BATCH / 16 && !*stream->ended) {
		n = incise_tracker_read(tracker, samples, BATCH / 16);
		if (n < 0) {
			incise_tracker_cause(tracker, cause, sizeof(cause));
			rc = fail_device(rec, INCISE_LEDGER_TRACKER, cause, n, err);
		}
		for (int i = 0; i < n && !rc && !*stream->ended; i++)
			rc = incise_recorder_put_tracker(rec, &samples[i], err);
		if (rc)
			return rc;
	}
	stream->device_lost =
		incise_tracker_lost(tracker) - stream->lost_at_start + rec->not_finite;
	return 0;
}

static bool all_ended(const struct incise_recorder *rec)
{
	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++)
		if (rec->streams[i].there && !*rec->streams[i].ended)
			return false;
	return true;
}

/* 1 with *err where it is to end, though nothing is wrong with what there is. */
static int check_end(struct incise_recorder *rec, struct incise_error *err)
{
	if (all_ended(rec)) {
		incise_error_set(err, ENODEV, "%s: no device is left: %s", rec->path,
				 rec->streams[INCISE_LEDGER_FORCE].ended);
		return 1;
	}
	if (incise_recorder_disk_full(rec)) {
		incise_error_set(err, ENOSPC,
				 "%s: the disk is nearly full (%.0f MB free); the "
				 "recording was ended while there is room to; make room "
				 "before the next",
				 rec->path, rec->disk.free_bytes / 1e6);
		return 1;
	}
	return 0;
}

int incise_recorder_poll(struct incise_recorder *rec, struct incise_error *err)
{
	int64_t now = incise_clock_now(incise_rig_clock(rec->rig));
	int rc;

	if (rec->failed)
		return incise_error_set(err, -rec->failed, "%s: has failed before",
					rec->path);
	rc = take_force(rec, err);
	if (!rc)
		rc = take_tracker(rec, err);
	if (!rc)
		rc = incise_recorder_take_camera(rec, err);
	if (!rc && incise_recorder_zero_due(rec))
		rc = incise_recorder_settle_zero(rec, err);
	if (!rc && rec->stats.armed && rec->hold.triggered)
		rc = incise_recorder_release(rec, err);
	if (!rc && now - rec->commit_ns >= INCISE_RECORDER_COMMIT_NS)
		rc = incise_recorder_commit(rec, now, false, err);
	rec->failed = rc;
	return rc ? rc : check_end(rec, err);
}

void incise_recorder_trigger(struct incise_recorder *rec)
{
	rec->hold.triggered = true;
}

int incise_recorder_mark(struct incise_recorder *rec, const char *kind, const char *text,
			 struct incise_error *err)
{
	if (!rec->failed && incise_recorder_note(rec, kind, "%s", text) != SQLITE_OK)
		rec->failed = incise_recorder_fail(rec, err);
	return rec->failed;
}

void incise_recorder_stats(const struct incise_recorder *rec,
			   struct incise_recorder_stats *stats)
{
	*stats = rec->stats;
	stats->force = rec->streams[INCISE_LEDGER_FORCE].rows;
	stats->tracker = rec->streams[INCISE_LEDGER_TRACKER].rows;
	stats->frames = rec->streams[INCISE_LEDGER_CAMERA].rows;
	stats->force_lost = incise_recorder_lost(rec, INCISE_LEDGER_FORCE);
	stats->tracker_lost = incise_recorder_lost(rec, INCISE_LEDGER_TRACKER);
	stats->frames_lost = incise_recorder_lost(rec, INCISE_LEDGER_CAMERA);
	/* Rows whose window is still open are as good as written: closing writes them. */
	stats->depth += rec->depth.n - rec->depth.done;
}

/* --- end -------------------------------------------------------------------------- */

int incise_recorder_end(struct incise_recorder *rec, struct incise_error *err)
{
	int rc = rec->failed;

	if (rc)
		return incise_error_set(err, -rc, "%s: has failed before", rec->path);
	if (rec->ended)
		return 0;
	rec->ended = true;
	rc = incise_recorder_end_camera(rec, err);
	/* A recording shorter than the time for the zero makes do with what it has. */
	if (!rc && isnan(rec->stats.zero_mV) && rec->streams[INCISE_LEDGER_FORCE].begun)
		rc = incise_recorder_settle_zero(rec, err);
	if (!rc)
		rc = incise_recorder_flush_depth(rec, err);
	rec->failed = rc;
	return rc;
}

/* Write what is still held back, and that nothing is missing. */
static int complete(struct incise_recorder *rec, struct incise_error *err)
{
	int rc = incise_recorder_end(rec, err);

	if (!rc && (incise_recorder_ledger_close(rec) != SQLITE_OK ||
		    incise_recorder_note(rec, "end", "recording ended") != SQLITE_OK))
		rc = incise_recorder_fail(rec, err);
	if (!rc)
		rc = incise_recorder_commit(rec, rec->commit_ns, true, err);
	/* With it all is written that is to be sealed. */
	if (!rc && (incise_recorder_set_integer(rec, "complete", 1) != SQLITE_OK ||
		    incise_recorder_seal(rec) != SQLITE_OK ||
		    sqlite3_exec(rec->db, "COMMIT", NULL, NULL, NULL) != SQLITE_OK))
		rc = incise_recorder_fail(rec, err);
	if (rc)
		return rc;
	/*
	 * One file that stands alone. Someone who is reading it now keeps SQLite from
	 * folding the log in; then the log stays beside it, which is as good.
	 */
	if (sqlite3_exec(rec->db, "PRAGMA synchronous=FULL; PRAGMA journal_mode=DELETE",
			 NULL, NULL, NULL) != SQLITE_OK &&
	    sqlite3_errcode(rec->db) != SQLITE_BUSY &&
	    sqlite3_errcode(rec->db) != SQLITE_LOCKED)
		return incise_recorder_fail(rec, err);
	return 0;
}

int incise_recorder_close(struct incise_recorder *rec, struct incise_error *err)
{
	int rc;

	if (!rec)
		return 0;
	rc = rec->failed;
	if (rc)
		incise_error_set(
			err, -rc, "%s: not completed: %s; %s%s", rec->path, strerror(-rc),
			rec->worthless ? "nothing was kept" : "what was committed is in ",
			rec->worthless ? "" : rec->part);
	else
		rc = complete(rec, err);
	incise_recorder_close_camera(rec);
	incise_recorder_close_database(rec);
	if (!rc)
		rc = incise_recorder_give_name(rec, err);
	if (rec->worthless)
		incise_recorder_remove_folder(rec);
	recorder_free(rec);
	if (rc)
		errno = -rc;
	return rc;
}
