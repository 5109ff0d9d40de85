// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Frames of a recording by their times; see incise/recording.h. The table has the times, the file the
 * frames in the same order; the ones before are read without decoding them.
 *
 *     rows    ──┬────┬────┬────►    nearest to t: number n, and its seq
 *     file    ──┴────┴────┴────►    n frames are skipped, the next one is decoded
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include "../frames.h"
#include "../schema.h"
#include "recording.h"
#include "rows.h"
#include "source.h"

struct incise_frame_reader {
	struct incise_recording *opened;
	struct incise_recording *recording; /* with the frames: that one, or its member */
	const struct incise_session_map *map;
	struct incise_frames_reader *file;
	uint64_t passed; /* frames of the file */
};

static int open_frame_reader_file(struct incise_frame_reader *reader,
				  struct incise_error *err)
{
	char *path;

	if (asprintf(&path, "%s/%s", reader->recording->path, INCISE_FRAMES_FILE) < 0)
		return incise_schema_no_memory(reader->recording->path, err);
	incise_frames_reader_close(reader->file);
	reader->file = incise_frames_reader_new(path, err);
	reader->passed = 0;
	free(path);
	return reader->file ? 0 : -errno;
}

struct incise_frame_reader *incise_frame_reader_new(struct incise_recording *recording,
						    struct incise_error *err)
{
	struct incise_frame_reader *reader = calloc(1, sizeof(*reader));
	int rc = 0;

	if (!reader)
		rc = incise_schema_no_memory(recording->path, err);
	if (!rc) {
		reader->opened = incise_recording_open(recording->path, err);
		if (reader->opened) {
			const struct incise_stream_source *camera =
				reader->opened->streams[INCISE_LEDGER_CAMERA];

			reader->recording = camera->file;
			reader->map = camera->map;
		}
		rc = reader->recording ? open_frame_reader_file(reader, err) : -errno;
	}
	if (!rc)
		return reader;
	incise_frame_reader_free(reader);
	errno = -rc;
	return NULL;
}

void incise_frame_reader_free(struct incise_frame_reader *reader)
{
	if (!reader)
		return;
	incise_frames_reader_close(reader->file);
	incise_recording_close(reader->opened);
	free(reader);
}

const char *incise_frame_reader_codec(const struct incise_frame_reader *reader)
{
	return reader->file->codec;
}

/* The row nearest to a time, the first of two: its own seq, time and number from 0. */
static int find_row(struct incise_recording *recording, int64_t t_ns, uint64_t *seq,
		    int64_t *row_ns, uint64_t *number, struct incise_error *err)
{
	struct incise_source source;
	const struct incise_batch *batch = &source.batch;
	uint64_t n = 0, least = 0;
	int rc = incise_source_open(&source, recording, INCISE_LEDGER_CAMERA, err);

	while (!rc && (rc = incise_source_next(&source, err)) > 0) {
		for (size_t i = 0; i < batch->n; i++, n++) {
			int64_t own_ns = batch->column[1].i[i];
			uint64_t apart = own_ns > t_ns
						 ? (uint64_t)own_ns - (uint64_t)t_ns
						 : (uint64_t)t_ns - (uint64_t)own_ns;

			if (n && apart >= least)
				continue;
			least = apart;
			*seq = (uint64_t)batch->column[0].i[i];
			*row_ns = own_ns;
			*number = n;
		}
		rc = 0;
	}
	incise_source_close(&source);
	if (!rc && !n)
		return incise_error_set(err, ENODATA, "%s: has no frames",
					recording->path);
	return rc;
}

int incise_frame_reader_at(struct incise_frame_reader *reader, int64_t t_ns,
			   struct incise_camera_frame *frame, struct incise_error *err)
{
	struct incise_frames_stored stored;
	uint64_t seq = 0, number = 0;
	int64_t row_ns = 0;
	/* Differences of times stay within 64 bits. */
	int64_t t = t_ns > INT64_MAX / 4    ? INT64_MAX / 4
		    : t_ns < -INT64_MAX / 4 ? -INT64_MAX / 4
					    : t_ns;
	int rc = find_row(reader->recording, incise_session_member_time(reader->map, t),
			  &seq, &row_ns, &number, err);

	if (!rc && number < reader->passed)
		rc = open_frame_reader_file(reader, err);
	if (rc)
		return rc;
	do {
		reader->file->undecoded = reader->passed < number;
		rc = incise_frames_next(reader->file, frame, &stored, err);
		reader->passed += rc != 0;
		if (rc < 0 && (rc != -EBADMSG || reader->passed > number))
			return rc;
	} while (rc && reader->passed <= number);
	if (!rc || frame->seq != seq)
		return incise_error_set(
			err, EBADMSG,
			"%s: frame %llu is not in %s where its row is; `incise verify %s` "
			"has all findings",
			reader->recording->path, (unsigned long long)seq,
			INCISE_FRAMES_FILE, reader->recording->path);
	frame->t_ns = incise_session_time(reader->map, row_ns);
	return 0;
}
