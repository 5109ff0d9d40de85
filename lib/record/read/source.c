// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A stream of a recording as batches; see source.h. The file is untrusted.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/vector.h"
#include "../schema.h"
#include "recalibration.h"
#include "../old/old.h"
#include "source.h"

#define TIME_MAX (INT64_MAX / 4) /* of rows.c */
#define ROWS_MAX 1024		 /* of a batch, where the file has no blocks */

static const struct incise_ledger_form depth_form = {
	"depth", "depth",
	"seq, t_ns, depth_mm, velocity_mm_s, x_mm, y_mm, z_mm, qw, qx, qy, qz",
	"iirrrrrrrrr"};

int incise_source_find(const char *table)
{
	for (int i = 0; i <= INCISE_SOURCE_DEPTH; i++)
		if (!strcmp(incise_source_form(i)->table, table))
			return i;
	return -1;
}

const struct incise_ledger_form *incise_source_form(int stream)
{
	return stream == INCISE_SOURCE_DEPTH ? &depth_form : &incise_ledger_forms[stream];
}

struct incise_stream_source *incise_source_stream(
	const struct incise_recording *recording, int stream)
{
	return recording
		->streams[stream == INCISE_SOURCE_DEPTH ? INCISE_LEDGER_TRACKER : stream];
}

static int fail_source(struct incise_source *source, struct incise_error *err)
{
	return incise_schema_fail(source->recording->db, source->recording->path, err);
}

static int no_source_memory(struct incise_source *source, struct incise_error *err)
{
	return incise_schema_no_memory(source->recording->path, err);
}

int incise_source_step(struct incise_source *source)
{
	int rc = source->ended ? SQLITE_DONE : sqlite3_step(source->stmt);

	source->ended = rc == SQLITE_DONE;
	return rc;
}

/* --- blocks ----------------------------------------------------------------------------- */

/* Whether a block goes on from the one before: NULL, or what is wrong. */
static const char *does_not_follow(struct incise_source *source,
				   const struct incise_ledger_block *block)
{
	const struct incise_batch *batch = &source->batch;
	const int64_t *seq = batch->column[0].i;
	/* Numbers are not negative, and increase within a batch. */
	uint64_t lost = (uint64_t)seq[batch->n - 1] - (uint64_t)seq[0] + 1 - batch->n;

	if (source->last_seq >= seq[0])
		return "its numbers are not behind those of the block before";
	if (source->last_seq >= 0 && source->last_ns >= batch->column[1].i[0])
		return "its times are not behind those of the block before";
	if (source->last_seq >= 0)
		lost += (uint64_t)(seq[0] - source->last_seq - 1);
	return source->next < 0 || lost == (uint64_t)block->lost
		       ? NULL
		       : "it has not lost as many samples as it says";
}

static const char *take_block(struct incise_source *source,
			      const struct incise_ledger_block *block, const void *data,
			      size_t size)
{
	const char *why = incise_batch_decode(&source->batch, block, data, size);

	if (!why)
		why = does_not_follow(source, block);
	source->next = why || block->block == INT64_MAX ? -1 : block->block + 1;
	source->last_seq = why ? -1 : block->last_seq;
	source->last_ns = block->last_ns;
	return why;
}

static int next_block(struct incise_source *source, struct incise_error *err)
{
	struct incise_ledger_block block;
	const void *data;
	const char *why;
	size_t size;
	int rc;

	/* The end of a stream is a block without rows. */
	do {
		rc = source->held ? SQLITE_ROW : incise_source_step(source);
		source->held = false;
		if (rc == SQLITE_DONE)
			return 0;
		if (rc != SQLITE_ROW)
			return fail_source(source, err);
		why = NULL;
		if (!incise_ledger_block_read(&block, source->stmt))
			why = "a field has another type";
		else if (!incise_ledger_data(source->stmt, &block, &data, &size))
			why = "its checksum differs";
		else if (source->next >= 0 && block.block > source->next)
			why = "blocks before it are missing";
		if (why) {
			/* The block itself comes with the next call. */
			source->held = *why == 'b';
			source->next = source->last_seq = -1;
		} else if (block.count) {
			if (block.count > 0 && block.count <= INCISE_BATCH_ROWS_MAX &&
			    !incise_batch_reserve(&source->batch, (size_t)block.count))
				return no_source_memory(source, err);
			why = take_block(source, &block, data, size);
		} else if (block.block == source->next) {
			source->next++;
		}
	} while (!why && !block.count);
	if (!why)
		return 1;
	return incise_error_set(
		err, EINVAL,
		"%s: damaged: stream %s, block %lld: %s; `incise verify %s` "
		"lists what is damaged",
		source->recording->path, source->batch.form->stream,
		(long long)block.block, why, source->recording->path);
}

/* --- depth, as the recorder finds it --------------------------------------------------- */

struct incise_source_depth {
	struct incise_source tracker;
	struct incise_depth window;
	/* Poses of the records in the window that have no row yet. */
	double pose[INCISE_DEPTH_WINDOW][7];
	int n;
	uint64_t rows; /* of the tracker, so far */
	bool part;     /* not from the first on */
};

static void put_depth(struct incise_source *source, const struct incise_depth_row *row)
{
	struct incise_source_depth *depth = source->depth;
	struct incise_batch *batch = &source->batch;
	const size_t at = batch->n++;

	batch->column[0].i[at] = row->seq;
	batch->column[1].i[at] = row->t_ns;
	batch->column[2].r[at] = row->depth_mm;
	batch->column[3].r[at] = row->velocity_mm_s;
	for (int i = 0; i < 7; i++)
		batch->column[4 + i].r[at] = depth->pose[0][i];
	memmove(depth->pose, depth->pose + 1, --depth->n * sizeof(*depth->pose));
}

/* A record that is no pose gives no depth. */
static void push_record(struct incise_source *source, size_t at)
{
	struct incise_source_depth *depth = source->depth;
	const union incise_column *column = depth->tracker.batch.column;
	double *pose = depth->pose[depth->n], tip_mm[3], arm_mm[3];
	struct incise_depth_row row;

	if (!incise_pose_usable(column[10].c[at]))
		return;
	for (int i = 0; i < 7; i++)
		pose[i] = column[3 + i].r[at];
	depth->n++;
	v3_rotate(arm_mm, pose + 3, source->recording->meta.tip_mm);
	v3_add(tip_mm, pose, 1, arm_mm);
	if (incise_depth_push(&depth->window, column[0].i[at], column[1].i[at], tip_mm,
			      &row))
		put_depth(source, &row);
}

static int next_depth(struct incise_source *source, struct incise_error *err)
{
	struct incise_source_depth *depth = source->depth;
	struct incise_batch *batch = &source->batch;
	struct incise_depth_row row;
	int rc = 1;

	for (batch->n = 0; !batch->n && rc > 0;) {
		rc = incise_source_next(&depth->tracker, err);
		if (rc < 0)
			return rc;
		if (!rc && !depth->part && depth->rows != source->recording->meta.tracker)
			return incise_error_set(
				err, EINVAL,
				"%s: damaged: table tracker has %llu rows of %llu",
				source->recording->path, (unsigned long long)depth->rows,
				(unsigned long long)source->recording->meta.tracker);
		depth->rows += rc ? depth->tracker.batch.n : 0;
		if (!incise_batch_reserve(batch,
					  depth->tracker.batch.n + INCISE_DEPTH_WINDOW))
			return no_source_memory(source, err);
		for (size_t k = 0; rc && k < depth->tracker.batch.n; k++)
			push_record(source, k);
		while (!rc && incise_depth_flush(&depth->window, &row))
			put_depth(source, &row);
	}
	return batch->n > 0;
}

static int open_depth(struct incise_source *source, int64_t from_seq,
		      struct incise_error *err)
{
	const struct incise_recording_info *meta = &source->recording->meta;

	source->depth = calloc(1, sizeof(*source->depth));
	if (!source->depth)
		return no_source_memory(source, err);
	incise_depth_init(&source->depth->window, meta->surface_point_mm,
			  meta->surface_normal);
	source->depth->part = from_seq != INT64_MIN;
	return incise_source_open_at(&source->depth->tracker, source->recording,
				     INCISE_LEDGER_TRACKER, from_seq, err);
}

/* --- any ------------------------------------------------------------------------------- */

/* From a number on, or @from_end: the last rows first. */
static int open_table(struct incise_source *source, int64_t from_seq, bool from_end,
		      struct incise_error *err)
{
	struct incise_recording *recording = source->recording;
	const char *stream = source->batch.form->stream;
	int rc = recording->old
			 ? recording->old->open(source, from_seq, from_end)
			 : incise_ledger_select(
				   recording->db, stream,
				   from_seq == INT64_MIN
					   ? from_seq
					   : incise_ledger_find(recording->db, stream,
								false, from_seq),
				   from_end, &source->stmt);

	return rc == SQLITE_OK ? 0 : fail_source(source, err);
}

int incise_source_open(struct incise_source *source, struct incise_recording *recording,
		       int stream, struct incise_error *err)
{
	return incise_source_open_at(source, recording, stream, INT64_MIN, err);
}

int incise_source_open_at(struct incise_source *source,
			  struct incise_recording *recording, int stream,
			  int64_t from_seq, struct incise_error *err)
{
	const struct incise_ledger_form *form = incise_source_form(stream);

	recording = incise_source_stream(recording, stream)->file;
	*source = (struct incise_source){
		.recording = recording,
		.stream = stream,
		.batch.form = form,
		.rows_max = ROWS_MAX,
		.next = from_seq == INT64_MIN ? 0 : -1,
		.last_seq = -1,
		.scale = recording->recalibrated ? recording->recalibrated->depth_scale
						 : 1,
	};
	return stream == INCISE_SOURCE_DEPTH ? open_depth(source, from_seq, err)
					     : open_table(source, from_seq, false, err);
}

int incise_source_next(struct incise_source *source, struct incise_error *err)
{
	int rc;

	if (source->depth)
		return next_depth(source, err);
	rc = source->recording->old ? source->recording->old->next(source, err)
				    : next_block(source, err);
	if (rc > 0 && source->stream == INCISE_LEDGER_CAMERA && source->scale != 1)
		for (size_t k = 0; k < source->batch.n; k++)
			source->batch.column[8].r[k] *= source->scale;
	return rc;
}

int incise_source_pass(struct incise_source *source, int64_t t_ns,
		       struct incise_error *err)
{
	struct incise_recording *recording = source->recording;
	const char *stream = source->batch.form->stream;
	int64_t block;

	if (source->depth) {
		source->depth->n = 0;
		source->depth->part = true;
		incise_depth_init(&source->depth->window,
				  recording->meta.surface_point_mm,
				  recording->meta.surface_normal);
		return incise_source_pass(&source->depth->tracker, t_ns, err);
	}
	block = incise_ledger_find(recording->db, stream, true, t_ns);
	if (source->ended || block <= source->next)
		return 0;
	sqlite3_finalize(source->stmt);
	source->stmt = NULL;
	source->held = false;
	source->next = source->last_seq = -1;
	return incise_ledger_select(recording->db, stream, block, false, &source->stmt) ==
			       SQLITE_OK
		       ? 0
		       : fail_source(source, err);
}

void incise_source_close(struct incise_source *source)
{
	if (source->depth)
		incise_source_close(&source->depth->tracker);
	free(source->depth);
	source->depth = NULL;
	sqlite3_finalize(source->stmt);
	source->stmt = NULL;
	incise_batch_free(&source->batch);
}

int incise_source_end(struct incise_recording *recording, const char *table, bool last,
		      int64_t *seq, int64_t *t_ns, int64_t *arrival_ns,
		      struct incise_error *err)
{
	int stream = incise_source_find(table), rc;
	struct incise_source source;
	size_t at;

	if (stream == INCISE_SOURCE_DEPTH)
		stream = INCISE_LEDGER_TRACKER;
	source = (struct incise_source){
		.recording = incise_source_stream(recording, stream)->file,
		.stream = stream,
		.batch.form = incise_source_form(stream),
		.rows_max = 1,
		.next = -1,
		.last_seq = -1,
		.scale = 1,
	};
	rc = open_table(&source, INT64_MIN, last, err);
	if (!rc)
		rc = incise_source_next(&source, err);
	if (rc > 0) {
		/* Rows come from the end, but blocks are as they were written. */
		at = last ? source.batch.n - 1 : 0;
		*seq = source.batch.column[0].i[at];
		*t_ns = source.batch.column[1].i[at];
		if (arrival_ns)
			*arrival_ns = stream == INCISE_LEDGER_TRACKER ||
						      stream == INCISE_LEDGER_CAMERA
					      ? source.batch.column[2].i[at]
					      : 0;
	}
	incise_source_close(&source);
	return rc;
}

int64_t incise_source_seek(struct incise_recording *recording, const char *table,
			   int64_t t_ns)
{
	const int stream = incise_source_find(strcmp(table, "depth") ? table : "tracker");
	const char *name = incise_ledger_forms[stream].stream;

	if (t_ns == INT64_MIN)
		return t_ns;
	return recording->old ? recording->old->seek(recording, stream, t_ns)
			      : incise_schema_ask(
					recording->db, INT64_MIN,
					"SELECT first_seq FROM blocks WHERE stream = %Q "
					"AND block = %lld",
					name,
					(long long)incise_ledger_find(recording->db, name,
								      true, t_ns));
}

bool incise_source_span(struct incise_recording *recording, const char *table,
			int64_t *first_ns, int64_t *last_ns)
{
	int64_t seq;

	*first_ns = *last_ns = 0;
	return incise_source_end(recording, table, false, &seq, first_ns, NULL, NULL) >
		       0 &&
	       incise_source_end(recording, table, true, &seq, last_ns, NULL, NULL) > 0 &&
	       *first_ns >= 0 && *last_ns >= *first_ns && *last_ns <= TIME_MAX;
}
