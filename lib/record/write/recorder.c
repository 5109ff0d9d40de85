// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Writing a recording; see incise/recorder.h, and recorder.h for the other files.
 *
 *     force ────►┐                         ┌─► tables, ledger ─► a transaction, which ends
 *     tracker ──►┼─► poll ─► times ─► rows ┤                     within 100 ms of the rig's clock
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
#include "../schema.h"
#include "recorder.h"

/* Largest loss after a kill, and the shortest time between commits, whatever they take. */
#define COMMIT_NS 100000000LL
#define COMMIT_LEAST_NS (COMMIT_NS / 2)
/* The knots of a line are many and change little in a second: not with each commit. */
#define KNOTS_EVERY 10
#define BATCH_FORCE 1024
#define BATCH 64
/* A disk that has not answered for this time is given up. */
#define PATIENCE_NS (5 * INCISE_NS_PER_S)
/* A power cut costs little more frames than rows of the database. */
#define SYNC_NS 1000000000LL
/* A camera without a frame for this time and number of periods is silent. */
#define SILENT_NS (2 * INCISE_NS_PER_S)
#define SILENT_PERIODS 10
/* Longest time between two checks that counts as silence: the computer may have slept. */
#define LOOK_NS 100000000LL

/* --- camera -------------------------------------------------------------------------- */

/* Create camera.mkv and set up vision. Returns 0 or -errno. */
static int open_camera(struct incise_recorder *rec,
		       const struct incise_vision_setup *vision, struct incise_error *err)
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
		return incise_schema_no_memory(rec->path, err);
	rec->camera.writer = incise_frames_writer_new(file, &shape, &options, err);
	free(file);
	return rec->camera.writer ? 0 : -errno;
}

/* Frames go into the file from now on. Returns 0 or -errno. */
static int start_camera(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_frame_pump_setup setup = {
		.camera = incise_rig_camera(rec->rig),
		.clock = incise_rig_clock(rec->rig),
		.vision = rec->camera.vision,
		.writer = rec->camera.writer,
	};

	if (!rec->camera.writer)
		return 0;
	rec->camera.writer = NULL; /* the pump closes it */
	rec->camera.began_ns = incise_clock_now(setup.clock);
	rec->camera.pump = incise_frame_pump_new(&setup, err);
	return rec->camera.pump ? 0 : -errno;
}

static int put_records(struct incise_recorder *rec, struct incise_error *err)
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

static void count_recorder(struct incise_recorder *rec,
			   struct incise_frame_pump_stats *stats)
{
	incise_frame_pump_stats(rec->camera.pump, stats);
	incise_camera_info(incise_rig_camera(rec->rig), &rec->camera_info);
	rec->streams[INCISE_LEDGER_CAMERA].device_lost =
		stats->lost + stats->dropped + stats->unwritten + stats->unrecorded;
	rec->stats.frames_unlooked = stats->unlooked;
}

/* Check whether frames arrive. Returns 0 or a disk error. */
static int check_silence(struct incise_recorder *rec, uint64_t read,
			 struct incise_error *err)
{
	struct incise_recorder_camera *camera = &rec->camera;
	int64_t now_ns = incise_clock_now(incise_rig_clock(rec->rig));
	int64_t since_ns = camera->looked_ns ? now_ns - camera->looked_ns : 0;
	double period_ns = 1e9 / rec->camera_info.rate_hz; /* infinite for rate 0 */
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
		rc = incise_recorder_note(rec, "silent", "camera: no frame for %.1f s",
					  (double)camera->silent_ns * 1e-9);
	else if (was && !camera->silent)
		rc = incise_recorder_note(rec, "silent", "camera: frames arrive again");
	return incise_recorder_check(rec, rc, err);
}

/* Write rows of frames that are in the file. Returns 0 or a disk error. */
static int read_camera(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_CAMERA];
	struct incise_frame_pump_stats stats;
	int rc;

	if (!rec->camera.pump)
		return 0;
	/* On a real clock this does nothing: the pump has a thread. */
	while (!*stream->ended && incise_frame_pump_step(rec->camera.pump) > 0)
		;
	rc = put_records(rec, err);
	count_recorder(rec, &stats);
	if (!rc && !*stream->ended && (stats.camera.code || stats.file.code))
		rc = incise_recorder_end_stream(
			rec, INCISE_LEDGER_CAMERA,
			stats.camera.code ? stats.camera.text : stats.file.text, err);
	else if (!rc && !*stream->ended)
		rc = check_silence(rec, stats.read, err);
	return rc;
}

/* End the file and write its last rows. Returns 0 or a disk error. */
static int end_camera(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_CAMERA];
	struct incise_frame_pump_stats stats;
	struct incise_error why = {0};
	int rc = 0, stopped;

	if (!rec->camera.pump) { /* never triggered: a file without frames */
		incise_frames_writer_close(rec->camera.writer, NULL);
		rec->camera.writer = NULL;
		return 0;
	}
	stopped = incise_frame_pump_stop(rec->camera.pump, PATIENCE_NS, &why);
	rc = put_records(rec, err);
	count_recorder(rec, &stats);
	/* Frames that hang on a disk that does not answer are never reported: they have no row. */
	rec->camera.given_up = stopped == -ETIMEDOUT;
	if (rec->camera.given_up)
		stream->device_lost = stats.lost + stats.read - stream->rows;
	if (!rc && stopped && !*stream->ended)
		rc = incise_recorder_end_stream(rec, INCISE_LEDGER_CAMERA, why.text, err);
	if (!rc && rec->camera.silent && !*stream->ended) {
		incise_error_set(&why, ENODATA,
				 "%s: sent no frame for the last %.1f s; check its cable",
				 stream->device, (double)rec->camera.silent_ns * 1e-9);
		rc = incise_recorder_end_stream(rec, INCISE_LEDGER_CAMERA, why.text, err);
	}
	return rc;
}

static void close_camera(struct incise_recorder *rec)
{
	incise_frame_pump_free(rec->camera.pump);
	rec->camera.pump = NULL;
	incise_frames_writer_close(rec->camera.writer, NULL);
	rec->camera.writer = NULL;
	incise_vision_free(rec->camera.vision);
	rec->camera.vision = NULL;
}

/* --- counts and commits ------------------------------------------------------------------------- */

static void fill_counts(const struct incise_recorder *rec,
			struct incise_recorder_stats *stats)
{
	*stats = rec->stats;
	stats->force = rec->streams[INCISE_LEDGER_FORCE].rows;
	stats->tracker = rec->streams[INCISE_LEDGER_TRACKER].rows;
	stats->frames = rec->streams[INCISE_LEDGER_CAMERA].rows;
	stats->force_lost = incise_recorder_lost(rec, INCISE_LEDGER_FORCE);
	stats->tracker_lost = incise_recorder_lost(rec, INCISE_LEDGER_TRACKER);
	stats->frames_lost = incise_recorder_lost(rec, INCISE_LEDGER_CAMERA);
	/* Closing writes the rows whose window is still open. */
	stats->depth += rec->depth.n - rec->depth.done;
}

void incise_recorder_stats(const struct incise_recorder *rec,
			   struct incise_recorder_stats *stats)
{
	fill_counts(rec, stats);
	stats->n_streams = incise_recorder_describe_streams(rec, stats->streams);
}

/* Counts are committed with their rows: an interrupted recording has its losses. */
static int write_counts(struct incise_recorder *rec)
{
	struct incise_recorder_stats stats;
	bool camera = rec->streams[INCISE_LEDGER_CAMERA].exists;
	int bad = SQLITE_OK;

	fill_counts(rec, &stats);
	const struct {
		const char *key;
		uint64_t value;
	} counts[] = {
		{"force_rows", stats.force},
		{"tracker_rows", stats.tracker},
		{"depth_rows", rec->stats.depth}, /* without the open windows */
		{"force_lost", stats.force_lost},
		{"tracker_lost", stats.tracker_lost},
		{"force_clipped", stats.force_clipped},
		{"wall_rows", rec->wall.rows},
		{"frames_rows", stats.frames},
		{"frames_lost", stats.frames_lost},
		{"frames_unlooked", stats.frames_unlooked},
	};

	if (*rec->camera_info.note)
		bad |= incise_recorder_set_text(rec, "camera_note",
						rec->camera_info.note);
	for (size_t i = 0; i < sizeof(counts) / sizeof(*counts) - (camera ? 0 : 3); i++)
		bad |= incise_recorder_set_integer(rec, counts[i].key, counts[i].value);
	return bad;
}

/*
 * COMMIT, if the files have all that was committed before: written on from there, a log that was
 * cut off would look whole. Returns 0 or -errno.
 */
static int commit_files(struct incise_recorder *rec, struct incise_error *err)
{
	int rc = incise_recorder_check_files(rec, err);

	if (rc)
		return rc;
	if (sqlite3_exec(rec->db, "COMMIT", NULL, NULL, NULL) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	/* A disk may take long for it. */
	rc = incise_recorder_check_files(rec, err);
	if (!rc)
		incise_recorder_see_files(rec);
	return rc;
}

/*
 * Commit the rows so far, those read at @now_ns, with their counts and their ledger. Returns 0
 * or -errno.
 */
static int commit(struct incise_recorder *rec, int64_t now_ns, bool last,
		  struct incise_error *err)
{
	bool knots = last || rec->commits++ % KNOTS_EVERY == 0;
	int64_t took_ns;
	int rc;

	if (write_counts(rec) != SQLITE_OK ||
	    incise_recorder_write_streams(rec, knots) != SQLITE_OK ||
	    incise_recorder_write_ledger(rec, now_ns, last) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rc = commit_files(rec, err);
	if (rc)
		return rc;
	rec->commit_ns = now_ns;
	/* A disk that was slow once may be so again: that is forgotten in some 3 s. */
	took_ns = incise_clock_now(incise_rig_clock(rec->rig)) - now_ns;
	rec->takes_ns -= rec->takes_ns / 16;
	if (took_ns > rec->takes_ns)
		rec->takes_ns = took_ns;
	return incise_recorder_check(
		rec, sqlite3_exec(rec->db, "BEGIN", NULL, NULL, NULL), err);
}

/* --- beginning ------------------------------------------------------------------- */

static void recorder_free(struct incise_recorder *rec)
{
	close_camera(rec);
	incise_wall_sampler_free(rec->wall.sampler);
	incise_recorder_close_database(rec);
	incise_recorder_disarm(rec);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		incise_batch_free(&rec->batches[i]);
	free(rec->summary.waiting);
	free(rec->summary.ends_ns);
	if (rec->folder >= 0)
		close(rec->folder);
	if (rec->parent >= 0)
		close(rec->parent);
	free(rec->path);
	free(rec->part);
	free(rec);
}

static int check_rig(const char *path, struct incise_rig *rig,
		     const struct incise_recorder_setup *setup, struct incise_error *err)
{
	struct incise_tracker_info tracker;

	if (!incise_rig_tracker(rig) && !incise_rig_force(rig))
		return incise_error_set(
			err, ENODEV,
			"%s: a recording needs a tracker or a force channel, but the "
			"rig %s was opened without them",
			path, incise_rig_spec(rig));
	if (setup->trigger_force_N > 0 && !incise_rig_force(rig))
		return incise_error_set(err, ENODEV,
					"%s: a force triggers, but the rig %s has no "
					"force channel; choose another trigger",
					path, incise_rig_spec(rig));
	if (!incise_rig_tracker(rig))
		return 0;
	incise_tracker_info(incise_rig_tracker(rig), &tracker);
	/* The tables have no column that separates two sensors. */
	if (tracker.stations > 1)
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: a recording has one sensor, but the tracker of %s reads "
			"%d; name only the scalpel's in tracker_setup.stations",
			path, incise_rig_spec(rig), tracker.stations);
	return 0;
}

/*
 * Devices may have lost samples while the files were made. These are from before the recording
 * and do not count. The virtual rig counts losses when it is read.
 */
static void start_counts(struct incise_recorder *rec)
{
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_force *force = incise_rig_force(rec->rig);
	struct incise_tracker_sample record;
	struct incise_force_sample sample;

	if (force)
		incise_force_read(force, &sample, 0);
	if (tracker)
		incise_tracker_read(tracker, &record, 0);
	incise_recorder_count_losses(rec);
}

/* Make the files, and do all that may fail before the first sample is read. */
static int start_recorder(struct incise_recorder *rec,
			  const struct incise_recorder_setup *setup,
			  struct incise_error *err)
{
	int rc = incise_recorder_check_space(rec, setup->planned_s, err);

	rec->worthless = true;
	if (!rc && incise_seal_init(&rec->blocks.seal))
		rc = incise_error_set(err, ENOMEM,
				      "%s: libcrypto gives no SHA-256; check its "
				      "openssl.cnf",
				      rec->path);
	if (!rc)
		rc = incise_recorder_open_database(rec, setup->calibration_path, err);
	if (!rc)
		rc = commit(rec, incise_clock_now(incise_rig_clock(rec->rig)), false,
			    err);
	if (!rc && rec->streams[INCISE_LEDGER_CAMERA].exists)
		rc = open_camera(rec, setup->vision, err);
	if (!rc)
		rc = incise_wall_sampler_new(
			&rec->wall.sampler, setup->clock_source,
			incise_clock_is_real(incise_rig_clock(rec->rig)), err);
	if (!rc && setup->armed && incise_recorder_arm(rec))
		rc = incise_schema_no_memory(rec->path, err);
	if (!rc && !setup->armed)
		rc = start_camera(rec, err);
	if (!rc)
		start_counts(rec);
	rec->worthless = rc;
	if (rc) {
		close_camera(rec);
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

	if (check_rig(path, rig, setup, err))
		return NULL;
	rec = calloc(1, sizeof(*rec));
	if (!rec) {
		incise_schema_no_memory(path, err);
		return NULL;
	}
	rec->parent = rec->folder = -1;
	rec->rig = rig;
	rec->calibration = *setup->calibration;
	rec->cuts = setup->cuts;
	rec->pretrigger.force_N = setup->trigger_force_N;
	rec->pretrigger.button = setup->trigger_button;
	rec->stats.camera_depth_mm = NAN;
	rec->zero.depth_max_mm = -INFINITY;
	if (incise_rig_force(rig))
		incise_force_info(incise_rig_force(rig), &rec->force_info);
	incise_force_calibration(&rec->force_info, &rec->calibration);
	rec->stats.full_scale_N =
		rec->force_info.full_scale_V * 1e3 / rec->calibration.force_mV_N;
	rec->stats.zero_mV = rec->calibration.force_zero_mV;
	incise_rig_haptic_place(rig, &rec->calibration);
	if (incise_rig_tracker(rig))
		incise_tracker_info(incise_rig_tracker(rig), &rec->tracker_info);
	if (incise_rig_camera(rig))
		incise_camera_info(incise_rig_camera(rig), &rec->camera_info);
	incise_rig_surface(rig, point_mm, normal);
	incise_depth_init(&rec->depth, point_mm, normal);
	incise_recorder_start_streams(rec);
	incise_recorder_start_summary(&rec->summary);
	incise_ledger_init(&rec->wall.ledger);
	rc = incise_recorder_split_path(rec, path, err);
	if (!rc)
		rc = incise_recorder_make_folder(rec, err);
	if (!rc)
		rc = start_recorder(rec, setup, err);
	if (rc) {
		recorder_free(rec);
		errno = -rc;
		return NULL;
	}
	/* A power cut must not lose the folder's name; a failure changes nothing. */
	if (incise_clock_is_real(incise_rig_clock(rig)) && !fsync(rec->folder))
		incise_recorder_sync_parent(rec);
	return rec;
}

/* --- samples --------------------------------------------------------------------- */

/*
 * A device that fails ends its stream alone. @cause is its message, or empty. Returns 0 or a
 * disk error.
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

static int read_force(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_FORCE];
	struct incise_force *force = incise_rig_force(rec->rig);
	struct incise_force_sample samples[BATCH_FORCE];
	char cause[200];
	int n = force ? BATCH_FORCE : 0, rc = 0;

	while (n == BATCH_FORCE && !*stream->ended) {
		n = incise_force_read(force, samples, BATCH_FORCE);
		if (n < 0) {
			incise_force_cause(force, cause, sizeof(cause));
			rc = fail_device(rec, INCISE_LEDGER_FORCE, cause, n, err);
		}
		for (int i = 0; i < n && !rc && !*stream->ended; i++)
			rc = incise_recorder_put_force(rec, &samples[i], err);
		if (rc)
			return rc;
	}
	if (force)
		stream->device_lost = incise_force_lost(force) - stream->lost_at_start;
	return 0;
}

static int read_tracker(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_TRACKER];
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_tracker_sample samples[BATCH];
	char cause[200];
	int n = tracker ? BATCH : 0, rc = 0;

	while (n == BATCH && !*stream->ended) {
		n = incise_tracker_read(tracker, samples, BATCH);
		if (n < 0) {
			incise_tracker_cause(tracker, cause, sizeof(cause));
			rc = fail_device(rec, INCISE_LEDGER_TRACKER, cause, n, err);
		}
		for (int i = 0; i < n && !rc && !*stream->ended; i++)
			rc = incise_recorder_put_tracker(rec, &samples[i], err);
		if (rc)
			return rc;
	}
	if (tracker)
		stream->device_lost = incise_tracker_lost(tracker) -
				      stream->lost_at_start + rec->not_finite;
	return 0;
}

static bool all_ended(const struct incise_recorder *rec)
{
	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++)
		if (rec->streams[i].exists && !*rec->streams[i].ended)
			return false;
	return true;
}

/* 1 with *err if the recording must end, though it is good so far. */
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
				 "recording was ended in time; free disk space before "
				 "the next",
				 rec->path, rec->disk.free_bytes / 1e6);
		return 1;
	}
	return 0;
}

/* The trigger has come. */
static int release(struct incise_recorder *rec, struct incise_error *err)
{
	int rc = incise_recorder_release(rec, err);

	return rc ? rc : start_camera(rec, err);
}

/*
 * Whether the commit must be now, as one at the next poll would end too late:
 *
 *     commit_ns      polled_ns     now     next poll   it ends
 *     |◄───────────────── COMMIT_NS at most ─────────────────►|
 */
static bool is_due(const struct incise_recorder *rec, int64_t now)
{
	int64_t since_ns = now - rec->commit_ns, apart_ns = now - rec->polled_ns;

	return since_ns >= COMMIT_NS || (since_ns >= COMMIT_LEAST_NS &&
					 since_ns + apart_ns + rec->takes_ns > COMMIT_NS);
}

int incise_recorder_poll(struct incise_recorder *rec, struct incise_error *err)
{
	int64_t now = incise_clock_now(incise_rig_clock(rec->rig));
	int rc;

	if (rec->failed)
		return incise_error_set(err, -rec->failed, "%s: has failed before",
					rec->path);
	if (!rec->began_ns)
		rec->began_ns = now;
	rc = read_force(rec, err);
	if (!rc)
		rc = read_tracker(rec, err);
	if (!rc)
		rc = read_camera(rec, err);
	if (!rc)
		rc = incise_recorder_put_wall(rec, err);
	if (!rc && incise_recorder_zero_due(rec))
		rc = incise_recorder_settle_zero(rec, err);
	if (!rc && rec->stats.armed && rec->pretrigger.triggered)
		rc = release(rec, err);
	if (!rc && is_due(rec, now))
		rc = commit(rec, now, false, err);
	rec->polled_ns = now;
	rec->failed = rc;
	return rc ? rc : check_end(rec, err);
}

void incise_recorder_trigger(struct incise_recorder *rec)
{
	rec->pretrigger.triggered = true;
}

int incise_recorder_mark(struct incise_recorder *rec, const char *kind, const char *text,
			 struct incise_error *err)
{
	if (!rec->failed && incise_recorder_note(rec, kind, "%s", text) != SQLITE_OK)
		rec->failed = incise_recorder_fail(rec, err);
	return rec->failed;
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
	rc = end_camera(rec, err);
	if (!rc && !rec->stats.armed)
		rc = incise_recorder_find_silence(rec, err);
	/* A recording that is too short for the zero uses the samples that it has. */
	if (!rc && isnan(rec->stats.zero_mV) && rec->streams[INCISE_LEDGER_FORCE].started)
		rc = incise_recorder_settle_zero(rec, err);
	if (!rc)
		rc = incise_recorder_flush_depth(rec, err);
	incise_wall_sampler_stop(rec->wall.sampler,
				 incise_clock_now(incise_rig_clock(rec->rig)));
	if (!rc)
		rc = incise_recorder_put_wall(rec, err);
	rec->failed = rc;
	return rc;
}

/*
 * Whether the database has the rows that were written. What happened to its files in the midst of
 * a commit is found here.
 */
static int check_rows(struct incise_recorder *rec, struct incise_error *err)
{
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		const char *name = incise_ledger_forms[i].stream;
		uint64_t written =
			i == INCISE_LEDGER_WALL ? rec->wall.rows : rec->streams[i].rows;
		sqlite3_stmt *stmt = NULL;
		uint64_t rows = 0;
		char text[80];

		snprintf(text, sizeof(text),
			 "SELECT sum(count) FROM blocks WHERE stream = '%s'", name);
		if (sqlite3_prepare_v2(rec->db, text, -1, &stmt, NULL) == SQLITE_OK &&
		    sqlite3_step(stmt) == SQLITE_ROW)
			rows = (uint64_t)sqlite3_column_int64(stmt, 0);
		if (sqlite3_finalize(stmt) != SQLITE_OK)
			return incise_recorder_fail(rec, err);
		if (rows != written)
			return incise_error_set(
				err, EIO,
				"%s: another program changed its files during the "
				"recording: stream %s has %llu rows of %llu; `incise "
				"verify %s` lists the remaining data",
				rec->part, name, (unsigned long long)rows,
				(unsigned long long)written, rec->part);
	}
	return 0;
}

/* Write the last rows, the end of the ledger and the seals. */
static int complete_recorder(struct incise_recorder *rec, struct incise_error *err)
{
	int rc = incise_recorder_end(rec, err);

	if (!rc && incise_recorder_note(rec, "end", "recording ended") != SQLITE_OK)
		rc = incise_recorder_fail(rec, err);
	if (!rc)
		rc = commit(rec, rec->commit_ns, true, err);
	/* The seals are over all rows, those of this commit included. */
	if (!rc &&
	    (incise_recorder_write_summary(rec) != SQLITE_OK ||
	     incise_recorder_set_integer(rec, "complete", 1) != SQLITE_OK ||
	     /* A disk that hangs may yet write what its writer was left with. */
	     incise_block_writer_seal(&rec->blocks, rec->folder, !rec->camera.given_up,
				      rec->commit_ns) != SQLITE_OK))
		rc = incise_recorder_fail(rec, err);
	if (!rc)
		rc = commit_files(rec, err);
	if (!rc)
		rc = incise_recorder_check_files(rec, err);
	if (rc)
		return rc;
	/* Make it a single file: fold the log in. */
	if (sqlite3_exec(rec->db, "PRAGMA synchronous=FULL; PRAGMA journal_mode=DELETE",
			 NULL, NULL, NULL) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	return check_rows(rec, err);
}

int incise_recorder_close(struct incise_recorder *rec, struct incise_error *err)
{
	int rc;

	if (!rec)
		return 0;
	rc = rec->failed;
	if (rc)
		incise_error_set(err, -rc, "%s: not completed: %s; %s%s", rec->path,
				 strerror(-rc),
				 rec->worthless ? "no data were kept"
						: "the committed data are "
						  "in ",
				 rec->worthless ? "" : rec->part);
	else
		rc = complete_recorder(rec, err);
	close_camera(rec);
	incise_recorder_close_database(rec);
	if (!rc)
		rc = incise_recorder_rename_folder(rec, err);
	if (rec->worthless)
		incise_recorder_remove_folder(rec);
	recorder_free(rec);
	if (rc)
		errno = -rc;
	return rc;
}

void incise_recorder_discard(struct incise_recorder *rec)
{
	if (!rec->failed) {
		rec->failed = -ECANCELED;
		rec->worthless = true;
	}
	incise_recorder_close(rec, NULL);
}
