// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * camera.mkv compared with the rows of table frames, both in order and frame by frame; see
 * verify.h.
 *
 *     rows      1 2 3 4 5   7 8 |
 *     frames    1 2   4 5 6 7 8 | 9      9: only in an interrupted recording, whose file is
 *                  └ missing └ extra     ahead of the table
 *
 * A damaged frame may have any number, so a frame is identified by its number and by other
 * columns of its row: the timestamp in the file, or size and CRC. A row has a digest of its frame,
 * which nobody can forge.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../frames.h"
#include "../read/source.h"
#include "verify.h"

struct verify_camera_row {
	int64_t seq, t_ns, pts_ms, bytes, crc;
	const uint8_t *sha256;
};

/* Consecutive frames that are wrong in the same way. */
struct verify_camera_run {
	enum fault { NONE, MISSING, ALTERED, EXTRA } what;
	const char *why; /* of ALTERED */
	int64_t first_seq, last_seq;
	int64_t first_ns, last_ns;
	uint64_t count;
};

struct verify_camera_walk {
	struct incise_verification *verify;
	struct incise_verify_frames *out;
	struct incise_source rows;
	size_t at;		      /* next row of the batch */
	struct verify_camera_row row; /* the same, where has_row */
	bool has_row;
	int64_t last_ns;  /* of the row before */
	bool timestamped; /* rows have the frames' times, less the delay */
	int64_t delay_ns;
	bool ended; /* it died, maybe in mid-frame */
	struct verify_camera_run run;
};

static struct incise_verify_finding finding(enum incise_verify_kind kind)
{
	struct incise_verify_finding found = incise_verify_finding(kind);

	found.stream = "camera";
	return found;
}

/* --- findings --------------------------------------------------------------------- */

static void flush_run(struct verify_camera_walk *walk)
{
	const struct verify_camera_run *run = &walk->run;
	struct incise_verify_finding found = finding(INCISE_VERIFY_FRAMES);
	char where[120];

	if (run->what == NONE)
		return;
	found.count = run->count;
	found.first_seq = run->first_seq;
	found.last_seq = run->last_seq;
	found.first_ns = run->first_ns;
	found.last_ns = run->last_ns;
	if (run->count == 1)
		snprintf(where, sizeof(where), "number %lld, at %.4f s",
			 (long long)run->first_seq,
			 incise_verify_s(walk->verify, run->first_ns));
	else
		snprintf(where, sizeof(where), "numbers %lld to %lld, %.4f to %.4f s",
			 (long long)run->first_seq, (long long)run->last_seq,
			 incise_verify_s(walk->verify, run->first_ns),
			 incise_verify_s(walk->verify, run->last_ns));
	if (run->what == ALTERED)
		incise_verify_found(walk->verify, found,
				    "camera: %llu altered in " INCISE_FRAMES_FILE
				    ", %s: %s not as written",
				    (unsigned long long)run->count, where, run->why);
	else
		incise_verify_found(
			walk->verify, found,
			run->what == MISSING
				? "camera: %llu missing in " INCISE_FRAMES_FILE ", %s"
				: "camera: %llu in " INCISE_FRAMES_FILE
				  " without a row, %s",
			(unsigned long long)run->count, where);
	walk->run.what = NONE;
}

static void add_to_run(struct verify_camera_walk *walk, enum fault what, const char *why,
		       int64_t seq, int64_t t_ns)
{
	struct verify_camera_run *run = &walk->run;

	if (run->what != NONE && (run->what != what || run->why != why))
		flush_run(walk);
	if (run->what == NONE)
		*run = (struct verify_camera_run){what, why, seq, seq, t_ns, t_ns, 0};
	run->last_seq = seq;
	run->last_ns = t_ns;
	run->count++;
}

/* --- rows ------------------------------------------------------------------------- */

static struct verify_camera_row row_of(const struct incise_batch *batch, size_t at)
{
	const union incise_column *column = batch->column;

	return (struct verify_camera_row){column[0].i[at], column[1].i[at],
					  column[3].i[at], column[4].i[at],
					  column[5].i[at], column[10].h[at]};
}

/* Returns 0 or -EIO, which verify_stream.c has reported; a block that it has reported is passed. */
static int next_verify_camera_row(struct verify_camera_walk *walk)
{
	int rc = 1;

	if (walk->has_row && walk->at + 1 < walk->rows.batch.n) {
		walk->at++;
	} else {
		walk->at = 0;
		do
			rc = incise_source_next(&walk->rows, NULL);
		while (rc == -EINVAL);
	}
	walk->has_row = rc > 0;
	if (walk->has_row)
		walk->row = row_of(&walk->rows.batch, walk->at);
	return rc < 0 ? -EIO : 0;
}

static int skip_row(struct verify_camera_walk *walk)
{
	walk->out->missing++;
	add_to_run(walk, MISSING, NULL, walk->row.seq, walk->row.t_ns);
	walk->last_ns = walk->row.t_ns;
	return next_verify_camera_row(walk);
}

/* --- frames ----------------------------------------------------------------------- */

struct frame {
	struct incise_camera_frame head; /* number and time */
	struct incise_frames_stored stored;
	bool good; /* by the reader */
};

static bool is_like(const struct verify_camera_row *row, const struct frame *frame)
{
	return row->pts_ms == frame->stored.pts_ms ||
	       (row->crc == frame->stored.crc && row->bytes == frame->stored.bytes);
}

/* Whether a later row is this frame's: the rows between have no frame. */
static bool is_further_on(struct verify_camera_walk *walk, const struct frame *frame)
{
	const int64_t seq = (int64_t)frame->head.seq;
	struct incise_source source;
	bool is = false;

	if (frame->head.seq > INT64_MAX || seq <= walk->row.seq)
		return false;
	if (!incise_source_open_at(&source, walk->verify->recording, INCISE_LEDGER_CAMERA,
				   seq, NULL) &&
	    incise_source_next(&source, NULL) > 0)
		for (size_t k = 0; k < source.batch.n && !is; k++) {
			struct verify_camera_row row = row_of(&source.batch, k);

			is = row.seq == seq && is_like(&row, frame);
		}
	incise_source_close(&source);
	return is;
}

/* A repeated timestamp was increased by 1 ns; see timeline.h. */
static bool is_time(const struct verify_camera_walk *walk, int64_t t_ns)
{
	int64_t late_ns;

	if (!walk->timestamped)
		return true;
	if (__builtin_sub_overflow(t_ns, walk->row.t_ns, &late_ns))
		return false;
	return late_ns == walk->delay_ns ||
	       (late_ns < walk->delay_ns && walk->row.t_ns == walk->last_ns + 1);
}

/* The part of the frame that differs from walk->row; NULL: none. */
static const char *difference(const struct verify_camera_walk *walk,
			      const struct frame *frame)
{
	const struct verify_camera_row *row = &walk->row;

	if (row->bytes != frame->stored.bytes)
		return "its size is";
	if (row->crc != frame->stored.crc ||
	    memcmp(row->sha256, frame->stored.sha256, INCISE_FRAMES_DIGEST) != 0)
		return "its bytes are";
	if (row->seq < 0 || (uint64_t)row->seq != frame->head.seq)
		return "its number is";
	if (row->pts_ms != frame->stored.pts_ms || !is_time(walk, frame->head.t_ns))
		return "its time is";
	return frame->good ? NULL : "its note or the file's header is";
}

/* Compare a frame with its row, after the rows without a frame. Returns 0 or -EIO. */
static int take_frame(struct verify_camera_walk *walk, const struct frame *frame)
{
	const struct incise_camera_frame *head = &frame->head;
	const char *why;
	int rc = 0;

	if (walk->has_row && head->seq != (uint64_t)walk->row.seq) {
		if (is_further_on(walk, frame)) {
			while (!rc && walk->has_row && walk->row.seq < (int64_t)head->seq)
				rc = skip_row(walk);
			if (rc)
				return rc;
		} else if (!is_like(&walk->row, frame)) {
			walk->out->extra++;
			add_to_run(walk, EXTRA, NULL, head->seq, head->t_ns);
			return 0;
		}
	}
	if (!walk->has_row) {
		/* Frames are in the file before their rows are in the table. */
		if (walk->verify->report->interrupted || (walk->ended && !frame->good)) {
			walk->out->ahead++;
			return 0;
		}
		walk->out->extra++;
		add_to_run(walk, EXTRA, NULL, head->seq, head->t_ns);
		return 0;
	}
	why = difference(walk, frame);
	if (why) {
		walk->out->altered++;
		add_to_run(walk, ALTERED, why, walk->row.seq, walk->row.t_ns);
	} else {
		flush_run(walk);
		walk->out->present++;
	}
	walk->last_ns = walk->row.t_ns;
	return next_verify_camera_row(walk);
}

/* Returns 0, -ECANCELED, -EIO. */
static int walk_through(struct verify_camera_walk *walk,
			struct incise_frames_reader *reader)
{
	struct incise_verification *verify = walk->verify;
	struct incise_error err = {0};
	int rc = next_verify_camera_row(walk), got = 1;

	while (!rc) {
		struct frame frame;

		got = incise_frames_next(reader, &frame.head, &frame.stored, &err);
		if (got != 1 && got != -EBADMSG)
			break;
		frame.good = got == 1;
		/* The first frame proves the file's head; CRCs are enough for the others. */
		reader->undecoded |= frame.good;
		rc = take_frame(walk, &frame);
		verify->rows_done += INCISE_VERIFY_FRAME_ROWS;
		if (!rc)
			rc = incise_verify_progress(verify, false);
	}
	if (!rc && got < 0) {
		flush_run(walk);
		incise_verify_found(verify,
				    finding(got == -ENOMEM ? INCISE_VERIFY_UNVERIFIED
							   : INCISE_VERIFY_DAMAGED),
				    "%s", err.text);
		return 0;
	}
	while (!rc && walk->has_row)
		rc = skip_row(walk);
	flush_run(walk);
	walk->out->checked = !rc;
	return rc;
}

/* Report that no frame could be verified. */
static void report_unopened(struct incise_verification *verify, const char *path,
			    const struct incise_error *err)
{
	struct incise_verify_finding found = finding(INCISE_VERIFY_FRAMES);

	if (access(path, F_OK) && errno == ENOENT) {
		found.count = verify->report->frames.missing = verify->frames;
		incise_verify_found(verify, found,
				    "camera: " INCISE_FRAMES_FILE
				    " is missing, and %llu frames with it",
				    (unsigned long long)verify->frames);
		return;
	}
	found.kind =
		err->code == EINVAL ? INCISE_VERIFY_DAMAGED : INCISE_VERIFY_UNVERIFIED;
	found.count = verify->frames;
	incise_verify_found(verify, found, "camera: the frames are not verified: %s",
			    err->text);
}

static int prepare(struct verify_camera_walk *walk)
{
	struct incise_recording *recording = walk->verify->recording;

	for (int i = 0; i < recording->n_table; i++) {
		const struct incise_stream *stream = &recording->table[i];

		if (strcmp(stream->name, "camera"))
			continue;
		walk->timestamped = stream->timestamped;
		walk->delay_ns = llrint(stream->delay_ms * 1e6);
		walk->ended = *stream->ended;
	}
	return incise_source_open(&walk->rows, recording, INCISE_LEDGER_CAMERA, NULL);
}

int incise_verify_camera(struct incise_verification *verify)
{
	struct verify_camera_walk walk = {.verify = verify,
					  .out = &verify->report->frames};
	struct incise_frames_reader *reader = NULL;
	struct incise_error err = {0};
	char *path = NULL;
	int rc = 0;

	if (asprintf(&path, "%s/" INCISE_FRAMES_FILE, verify->recording->path) < 0) {
		path = NULL;
		incise_error_set(&err, ENOMEM, INCISE_FRAMES_FILE ": out of memory");
	} else if (access(path, F_OK)) {
		/* A camera that died before its first frame has no file. */
		if (verify->frames)
			report_unopened(verify, path, &err);
		goto out;
	} else {
		reader = incise_frames_reader_new(path, &err);
	}
	if (!reader) {
		report_unopened(verify, path ? path : "", &err);
		goto out;
	}
	reader->digests = true;
	rc = prepare(&walk);
	if (!rc)
		rc = walk_through(&walk, reader);
	incise_source_close(&walk.rows);
	incise_frames_reader_close(reader);
out:
	free(path);
	/* verify_stream.c has reported rows that SQLite cannot read. */
	return rc == -ECANCELED ? rc : 0;
}
