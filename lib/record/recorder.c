// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Writing a recording; see incise/recorder.h.
 *
 *     force ────► timeline ─┬─────────────────► table force
 *       └► zero: 0.5 s ─────┼─────────────────► table meta       one transaction
 *                           ├─► CRC, chained ─► table ledger ──► per 100 ms of
 *     tracker ──► timeline ─┴┬────────────────► table tracker    the rig's clock
 *                            └► depth, speed ─► table depth
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
#include "schema.h"

#define COMMIT_NS 100000000LL
#define BATCH 1024

/* --- beginning ------------------------------------------------------------------- */

static void recorder_free(struct incise_recorder *rec)
{
	incise_recorder_close_database(rec);
	if (rec->folder >= 0)
		close(rec->folder);
	if (rec->parent >= 0)
		close(rec->parent);
	free(rec->path);
	free(rec->part);
	free(rec);
}

struct incise_recorder *incise_recorder_new(const char *path, struct incise_rig *rig,
					    const struct incise_recorder_setup *setup,
					    struct incise_error *err)
{
	struct incise_tracker_info tracker;
	struct incise_recorder *rec;
	double point_mm[3], normal[3];
	int rc;

	if (!incise_rig_tracker(rig) || !incise_rig_force(rig)) {
		incise_error_set(
			err, ENODEV,
			"%s: a recording needs a tracker and a force channel; the rig "
			"%s was opened without",
			path, incise_rig_spec(rig));
		return NULL;
	}
	incise_tracker_info(incise_rig_tracker(rig), &tracker);
	/* Rows of two sensors in one table would be one that jumps to and fro. */
	if (tracker.stations > 1) {
		incise_error_set(
			err, EOPNOTSUPP,
			"%s: a recording holds one sensor, and the tracker of %s "
			"reads %d; name the scalpel's alone in "
			"tracker_setup.stations",
			path, incise_rig_spec(rig), tracker.stations);
		return NULL;
	}
	rec = calloc(1, sizeof(*rec));
	if (!rec) {
		incise_error_set(err, ENOMEM, "%s: out of memory", path);
		return NULL;
	}
	rec->parent = rec->folder = -1;
	rec->rig = rig;
	rec->calibration = *setup->calibration;
	rec->stats.zero_mV = rec->calibration.force_zero_mV;
	rec->zero.depth_max_mm = -INFINITY;
	incise_force_info(incise_rig_force(rig), &rec->force_info);
	rec->tracker_info = tracker;
	incise_rig_surface(rig, point_mm, normal);
	incise_depth_init(&rec->depth, point_mm, normal);
	incise_ledger_init(&rec->force.ledger);
	incise_ledger_init(&rec->tracker.ledger);
	incise_timeline_init(&rec->force.timeline, 0); /* stamped at acquisition */
	incise_timeline_init(&rec->tracker.timeline, rec->tracker_info.latency_ns);
	rec->force.lost_at_start = incise_force_lost(incise_rig_force(rig));
	rec->tracker.lost_at_start = incise_tracker_lost(incise_rig_tracker(rig));
	rc = incise_recorder_take_path(rec, path, err);
	if (!rc)
		rc = incise_recorder_make_folder(rec, err);
	if (!rc) {
		rc = incise_recorder_open_database(rec, err);
		if (rc) {
			incise_recorder_close_database(rec);
			incise_recorder_remove_folder(rec);
		}
	}
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
 * Whether a sample is the next of its stream; counts those missing before it. A number
 * that was there before is a fault of the backend.
 */
static int take_number(struct incise_recorder *rec, struct incise_recorder_stream *stream,
		       const char *name, uint64_t seq, struct incise_error *err)
{
	if (seq > INT64_MAX || (stream->begun && seq < stream->next))
		return incise_error_set(err, EIO,
					"%s: sample %llu came after %llu; the driver of "
					"this device is at fault",
					name, (unsigned long long)seq,
					(unsigned long long)stream->next - 1);
	if (stream->begun && seq > stream->next) {
		stream->lost += seq - stream->next;
		if (incise_recorder_note(rec, "lost",
					 "%s: %llu samples before number %llu", name,
					 (unsigned long long)(seq - stream->next),
					 (unsigned long long)seq) != SQLITE_OK)
			return incise_recorder_fail(rec, err);
	}
	stream->next = seq + 1;
	return 0;
}

/* Losses by the numbers, or by the device's own count, which sees the last ones too. */
static uint64_t lost(const struct incise_recorder_stream *stream, uint64_t device)
{
	device -= stream->lost_at_start;
	return stream->lost > device ? stream->lost : device;
}

static int put_force(struct incise_recorder *rec,
		     const struct incise_force_sample *sample, struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_FORCE];
	int64_t t_ns = incise_timeline_acquired(&rec->force.timeline, sample->t_ns);
	int64_t top = (1LL << rec->force_info.bits) - 1;
	struct incise_ledger_row row;
	int rc = take_number(rec, &rec->force, rec->force_info.name, sample->seq, err);

	if (rc)
		return rc;
	if (sample->code < 0 || sample->code > top)
		return incise_error_set(err, EIO,
					"%s: code %d is not within 0 to %lld; the driver "
					"of this device is at fault",
					rec->force_info.name, sample->code,
					(long long)top);
	if (!rec->force.begun) {
		rec->force.begun = true;
		rec->force.first_ns = t_ns;
	}
	sqlite3_bind_int64(stmt, 1, sample->seq);
	sqlite3_bind_int64(stmt, 2, t_ns);
	sqlite3_bind_int(stmt, 3, sample->code);
	if (incise_recorder_run(stmt) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rec->stats.force++;
	incise_ledger_row_force(&row, sample->seq, t_ns, sample->code);
	incise_ledger_add(&rec->force.ledger, &row);
	if (sample->code == 0 || sample->code == top)
		rec->stats.force_clipped++;
	if (!isnan(rec->stats.zero_mV)) {
		rec->stats.force_N = (incise_recorder_code_mV(rec, sample->code) -
				      rec->stats.zero_mV) /
				     rec->calibration.force_mV_N;
	} else {
		incise_recorder_zero_force(rec, t_ns, sample->code,
					   sample->code == 0 || sample->code == top);
	}
	return 0;
}

static int put_depth(struct incise_recorder *rec, const struct incise_depth_row *row,
		     struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_DEPTH];

	sqlite3_bind_int64(stmt, 1, row->seq);
	sqlite3_bind_int64(stmt, 2, row->t_ns);
	sqlite3_bind_double(stmt, 3, row->depth_mm);
	sqlite3_bind_double(stmt, 4, row->velocity_mm_s);
	if (incise_recorder_run(stmt) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rec->stats.depth++;
	return 0;
}

static bool finite_record(const struct incise_tracker_sample *sample)
{
	for (int i = 0; i < 3; i++)
		if (!isfinite(sample->position_mm[i]))
			return false;
	for (int i = 0; i < 4; i++)
		if (!isfinite(sample->quaternion[i]))
			return false;
	return true;
}

static int put_tracker(struct incise_recorder *rec,
		       const struct incise_tracker_sample *sample,
		       struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_TRACKER];
	int64_t t_ns = incise_timeline_acquired(&rec->tracker.timeline, sample->t_ns);
	struct incise_ledger_row entry;
	struct incise_depth_row row;
	int rc =
		take_number(rec, &rec->tracker, rec->tracker_info.name, sample->seq, err);

	if (rc)
		return rc;
	if (!rec->tracker.begun) {
		rec->tracker.begun = true;
		rec->tracker.first_ns = t_ns;
	}
	rec->zero.tracker_ns = t_ns;
	if (!finite_record(sample)) { /* no place in the table: as good as lost */
		rec->tracker.lost++;
		return incise_recorder_note(rec, "lost", "%s: record %llu is not finite",
					    rec->tracker_info.name,
					    (unsigned long long)sample->seq) == SQLITE_OK
			       ? 0
			       : incise_recorder_fail(rec, err);
	}
	sqlite3_bind_int64(stmt, 1, sample->seq);
	sqlite3_bind_int64(stmt, 2, t_ns);
	sqlite3_bind_int64(stmt, 3, sample->t_ns);
	for (int i = 0; i < 3; i++)
		sqlite3_bind_double(stmt, 4 + i, sample->position_mm[i]);
	for (int i = 0; i < 4; i++)
		sqlite3_bind_double(stmt, 7 + i, sample->quaternion[i]);
	sqlite3_bind_text(stmt, 11, &sample->status, 1, SQLITE_TRANSIENT);
	sqlite3_bind_int(stmt, 12, sample->station);
	sqlite3_bind_int(stmt, 13, sample->button);
	if (incise_recorder_run(stmt) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rec->stats.tracker++;
	incise_ledger_row_tracker(&entry, t_ns, sample);
	incise_ledger_add(&rec->tracker.ledger, &entry);
	/* A record that the tracker itself doubts is kept, but not believed. */
	if (sample->status != ' ')
		return 0;
	rec->stats.depth_mm = incise_depth_of(&rec->depth, sample->position_mm);
	incise_recorder_zero_depth(rec, t_ns, rec->stats.depth_mm);
	if (incise_depth_push(&rec->depth, sample->seq, t_ns, sample->position_mm, &row))
		return put_depth(rec, &row, err);
	return 0;
}

/* @cause: what the device itself tells of it, if anything. */
static int fail_device(struct incise_recorder *rec, const char *name, const char *cause,
		       int rc, struct incise_error *err)
{
	struct incise_error ignored = {0};

	if (incise_recorder_note(rec, "failed", "%s: %s", name,
				 *cause ? cause : strerror(-rc)) == SQLITE_OK)
		incise_recorder_commit(rec, rec->commit_ns,
				       &ignored); /* what came before is worth keeping */
	if (*cause)
		return incise_error_set(
			err, -rc,
			"%s; what was recorded before is in %s: `incise info` reads it",
			cause, rec->part);
	return incise_error_set(
		err, -rc,
		"%s: %s; check its cable and power; what was recorded before is "
		"in %s: `incise info` reads it",
		name, rc == -ENODEV ? "is gone" : strerror(-rc), rec->part);
}

static int take_force(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_force *force = incise_rig_force(rec->rig);
	struct incise_force_sample samples[BATCH];
	char cause[200];
	int n = BATCH;

	while (n == BATCH) {
		n = incise_force_read(force, samples, BATCH);
		if (n < 0) {
			incise_force_cause(force, cause, sizeof(cause));
			return fail_device(rec, rec->force_info.name, cause, n, err);
		}
		for (int i = 0; i < n; i++) {
			int rc = put_force(rec, &samples[i], err);

			if (rc)
				return rc;
		}
	}
	rec->stats.force_lost = lost(&rec->force, incise_force_lost(force));
	return 0;
}

static int take_tracker(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_tracker_sample samples[BATCH / 16];
	char cause[200];
	int n = BATCH / 16;

	while (n == BATCH / 16) {
		n = incise_tracker_read(tracker, samples, BATCH / 16);
		if (n < 0) {
			incise_tracker_cause(tracker, cause, sizeof(cause));
			return fail_device(rec, rec->tracker_info.name, cause, n, err);
		}
		for (int i = 0; i < n; i++) {
			int rc = put_tracker(rec, &samples[i], err);

			if (rc)
				return rc;
		}
	}
	rec->stats.tracker_lost = lost(&rec->tracker, incise_tracker_lost(tracker));
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
	if (!rc && incise_recorder_zero_due(rec))
		rc = incise_recorder_settle_zero(rec, err);
	if (!rc && now - rec->commit_ns >= COMMIT_NS)
		rc = incise_recorder_commit(rec, now, err);
	rec->failed = rc;
	return rc;
}

void incise_recorder_stats(const struct incise_recorder *rec,
			   struct incise_recorder_stats *stats)
{
	*stats = rec->stats;
	/* Rows whose window is still open are as good as written: closing writes them. */
	stats->depth += rec->depth.n - rec->depth.done;
}

/* --- end -------------------------------------------------------------------------- */

/* Write what is still held back, and that nothing is missing. */
static int complete(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_depth_row row;
	int rc = 0;

	/* A recording shorter than the time for the zero makes do with what it has. */
	if (isnan(rec->stats.zero_mV) && rec->force.begun)
		rc = incise_recorder_settle_zero(rec, err);
	while (!rc && incise_depth_flush(&rec->depth, &row))
		rc = put_depth(rec, &row, err);
	if (!rc && (incise_recorder_ledger_close(rec) != SQLITE_OK ||
		    incise_recorder_note(rec, "end", "recording ended") != SQLITE_OK ||
		    incise_recorder_set_integer(rec, "complete", 1) != SQLITE_OK))
		rc = incise_recorder_fail(rec, err);
	if (!rc)
		rc = incise_recorder_commit(rec, rec->commit_ns, err);
	if (rc)
		return rc;
	/*
	 * One file that stands alone. Someone who is reading it now keeps SQLite from
	 * folding the log in; then the log stays beside it, which is as good.
	 */
	if (sqlite3_exec(rec->db,
			 "COMMIT; PRAGMA synchronous=FULL; PRAGMA journal_mode=DELETE",
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
