// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From samples to rows: the time of acquisition, the place in the ledger; see recorder.h.
 *
 *     force ────► timeline ─┬─────────────────► table force
 *       └► zero: 0.5 s      ├─► CRC, chained ─► table ledger
 *     tracker ──► timeline ─┼─────────────────► table tracker
 *       └► depth, speed ────┼─────────────────► table depth
 *     camera ───► timeline ─┴─────────────────► table frames
 *
 * Armed, rows go into the hold (recorder_hold.c) instead.
 */
#include <errno.h>
#include <math.h>
#include "../../base/vector.h"
#include "recorder.h"

/*
 * A sample's number, and its time. Counts those missing before it. A number that was there
 * before is a fault of the backend. Returns 0 or -EIO.
 */
static int take_number(struct incise_recorder_stream *stream, uint64_t seq,
		       int64_t arrival_ns, int64_t *t_ns, struct incise_error *err)
{
	if (seq > INT64_MAX || (stream->begun && seq < stream->next))
		return incise_error_set(err, EIO,
					"%s: sample %llu came after %llu; the driver of "
					"this device is at fault",
					stream->device, (unsigned long long)seq,
					(unsigned long long)stream->next - 1);
	*t_ns = incise_timeline_sample(&stream->timeline, seq, arrival_ns);
	if (!stream->begun)
		stream->first_ns = *t_ns;
	stream->begun = true;
	stream->next = seq + 1;
	return 0;
}

/* The row goes into the ledger; what is missing before it is an event. */
static int enter(struct incise_recorder *rec, struct incise_recorder_stream *stream,
		 const struct incise_ledger_row *row, struct incise_error *err)
{
	struct incise_ledger *ledger = &stream->ledger;
	uint64_t missing =
		stream->rows ? (uint64_t)row->seq - (uint64_t)ledger->last_seq - 1 : 0;

	incise_ledger_add(ledger, row);
	stream->rows++;
	if (!missing)
		return 0;
	stream->gaps += missing;
	return incise_recorder_note_at(rec, row->t_ns, "lost",
				       "%s: %llu samples before number %llu",
				       stream->device, (unsigned long long)missing,
				       (unsigned long long)row->seq) == SQLITE_OK
		       ? 0
		       : incise_recorder_fail(rec, err);
}

/* --- force --------------------------------------------------------------------------- */

int incise_recorder_write_force(struct incise_recorder *rec,
				const struct incise_recorder_force_row *row,
				struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_FORCE];
	int64_t top = (1LL << rec->force_info.bits) - 1;
	struct incise_ledger_row entry;

	sqlite3_bind_int64(stmt, 1, row->seq);
	sqlite3_bind_int64(stmt, 2, row->t_ns);
	sqlite3_bind_int(stmt, 3, row->code);
	if (incise_recorder_run(stmt) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rec->stats.force_clipped += row->code == 0 || row->code == top;
	incise_ledger_row_force(&entry, row->seq, row->t_ns, row->code);
	return enter(rec, &rec->streams[INCISE_LEDGER_FORCE], &entry, err);
}

int incise_recorder_put_force(struct incise_recorder *rec,
			      const struct incise_force_sample *sample,
			      struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_FORCE];
	struct incise_recorder_force_row row = {.seq = sample->seq, .code = sample->code};
	int64_t top = (1LL << rec->force_info.bits) - 1;
	struct incise_error why = {0};
	int rc = 0;

	if (sample->code < 0 || sample->code > top)
		rc = incise_error_set(&why, EIO,
				      "%s: code %d is not within 0 to %lld; the driver "
				      "of this device is at fault",
				      stream->device, sample->code, (long long)top);
	if (rc || take_number(stream, sample->seq, sample->t_ns, &row.t_ns, &why))
		return incise_recorder_end_stream(rec, INCISE_LEDGER_FORCE, why.text,
						  err);
	if (rec->stats.armed)
		incise_recorder_hold_force(rec, &row);
	else
		rc = incise_recorder_write_force(rec, &row, err);
	if (!isnan(rec->stats.zero_mV)) {
		rec->stats.force_N = (incise_recorder_code_mV(rec, sample->code) -
				      rec->stats.zero_mV) /
				     rec->calibration.force_mV_N;
		rec->hold.triggered |= rec->hold.force_N > 0 &&
				       fabs(rec->stats.force_N) >= rec->hold.force_N;
	} else {
		incise_recorder_zero_force(rec, row.t_ns, sample->code,
					   sample->code == 0 || sample->code == top);
	}
	return rc;
}

/* --- tracker and depth --------------------------------------------------------------- */

static int write_depth(struct incise_recorder *rec, const struct incise_depth_row *row,
		       struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_DEPTH];
	bool before = rec->cut.inside;

	sqlite3_bind_int64(stmt, 1, row->seq);
	sqlite3_bind_int64(stmt, 2, row->t_ns);
	sqlite3_bind_double(stmt, 3, row->depth_mm);
	sqlite3_bind_double(stmt, 4, row->velocity_mm_s);
	if (incise_recorder_run(stmt) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rec->stats.depth++;
	if (incise_cut_step(&rec->cut, row->depth_mm) == before || !rec->cuts)
		return 0;
	return incise_recorder_note_at(rec, row->t_ns, "cut", "cut %d %s", rec->cut.count,
				       rec->cut.inside ? "begins" : "ends") == SQLITE_OK
		       ? 0
		       : incise_recorder_fail(rec, err);
}

int incise_recorder_flush_depth(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_depth_row row;
	int rc = 0;

	while (!rc && incise_depth_flush(&rec->depth, &row))
		rc = write_depth(rec, &row, err);
	return rc;
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

/* Where the tip of the blade is: rows keep what the device gave, depth is the tip's. */
static void tip_of(const struct incise_recorder *rec,
		   const struct incise_tracker_sample *sample, double tip_mm[3])
{
	double arm_mm[3];

	v3_rotate(arm_mm, sample->quaternion, rec->calibration.tip_mm);
	v3_add(tip_mm, sample->position_mm, 1, arm_mm);
}

int incise_recorder_write_tracker(struct incise_recorder *rec,
				  const struct incise_recorder_tracker_row *row,
				  struct incise_error *err)
{
	const struct incise_tracker_sample *sample = &row->sample;
	sqlite3_stmt *stmt = rec->stmt[INSERT_TRACKER];
	struct incise_ledger_row entry;
	struct incise_depth_row depth;
	double tip_mm[3];
	int rc;

	tip_of(rec, sample, tip_mm);
	sqlite3_bind_int64(stmt, 1, sample->seq);
	sqlite3_bind_int64(stmt, 2, row->t_ns);
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
	incise_ledger_row_tracker(&entry, row->t_ns, sample);
	rc = enter(rec, &rec->streams[INCISE_LEDGER_TRACKER], &entry, err);
	/* A record that the tracker itself doubts is kept, but not believed. */
	if (!rc && sample->status == ' ' &&
	    incise_depth_push(&rec->depth, sample->seq, row->t_ns, tip_mm, &depth))
		rc = write_depth(rec, &depth, err);
	return rc;
}

int incise_recorder_put_tracker(struct incise_recorder *rec,
				const struct incise_tracker_sample *sample,
				struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_TRACKER];
	struct incise_recorder_tracker_row row = {.sample = *sample};
	struct incise_error why = {0};
	double tip_mm[3];
	int rc = 0;

	/* A line through both would bend, and bend the times of either. */
	if (sample->begins)
		incise_timeline_replug(&stream->timeline);
	if (take_number(stream, sample->seq, sample->t_ns, &row.t_ns, &why))
		return incise_recorder_end_stream(rec, INCISE_LEDGER_TRACKER, why.text,
						  err);
	rec->zero.tracker_ns = row.t_ns;
	if (!finite_record(sample)) { /* no place in the table: as good as lost */
		rec->not_finite++;
		return incise_recorder_note(rec, "lost", "%s: record %llu is not finite",
					    stream->device,
					    (unsigned long long)sample->seq) == SQLITE_OK
			       ? 0
			       : incise_recorder_fail(rec, err);
	}
	if (sample->status == ' ') {
		tip_of(rec, sample, tip_mm);
		rec->stats.depth_mm = incise_depth_of(&rec->depth, tip_mm);
		incise_recorder_zero_depth(rec, row.t_ns, rec->stats.depth_mm);
	}
	if (sample->button != rec->stats.button) {
		rec->stats.button = sample->button;
		rec->hold.triggered |= rec->hold.button && sample->button;
		if (incise_recorder_note_at(rec, row.t_ns, "button", "%s",
					    sample->button ? "pressed" : "released") !=
		    SQLITE_OK)
			return incise_recorder_fail(rec, err);
	}
	if (rec->stats.armed)
		incise_recorder_hold_tracker(rec, &row);
	else
		rc = incise_recorder_write_tracker(rec, &row, err);
	return rc;
}

/* --- camera -------------------------------------------------------------------------- */

/* SQLite keeps NaN as NULL: not known. */
int incise_recorder_put_frame(struct incise_recorder *rec,
			      const struct incise_frame_record *frame,
			      struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_CAMERA];
	sqlite3_stmt *stmt = rec->stmt[INSERT_FRAME];
	struct incise_frame_record row = *frame;
	struct incise_ledger_row entry;
	const double seen[] = {row.length_px, row.sd_px, row.depth_mm, row.quality};
	struct incise_error why = {0};

	if (take_number(stream, frame->seq, frame->t_ns, &row.t_ns, &why))
		return incise_recorder_end_stream(rec, INCISE_LEDGER_CAMERA, why.text,
						  err);
	sqlite3_bind_int64(stmt, 1, row.seq);
	sqlite3_bind_int64(stmt, 2, row.t_ns);
	sqlite3_bind_int64(stmt, 3, row.arrival_ns);
	sqlite3_bind_int64(stmt, 4, row.pts_ms);
	sqlite3_bind_int64(stmt, 5, row.bytes);
	sqlite3_bind_int64(stmt, 6, row.crc);
	for (int i = 0; i < 4; i++)
		sqlite3_bind_double(stmt, 7 + i, seen[i]);
	if (incise_recorder_run(stmt) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rec->stats.camera_depth_mm = row.depth_mm;
	incise_ledger_row_frame(&entry, &row);
	return enter(rec, stream, &entry, err);
}
