/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The streams of a recording as rows of a table, with their best times, by the calibration of an export; and
 * the rows of several streams, as messages in order of time.
 *
 *     force ──┐                                ┌─► a stream: rows ──► blocks ──► Arrow
 *     tracker ├──► rows.h ──► cells of a row ──┤
 *     …      ─┘                                └─► all: the earliest row ──► a message ──► MCAP
 */
#ifndef INCISE_STREAMS_H
#define INCISE_STREAMS_H

#include "../record/read/recording.h"
#include "../record/read/rows.h"
#include "writers.h"

#define INCISE_STREAM_COLUMNS 13

struct incise_stream_rows {
	const struct incise_stream_kind *kind;
	struct incise_rows rows;
	struct incise_recording_force scale;
	double depth_scale; /* of another calibration, of depths by vision */
	int n;
	struct incise_table_column columns[INCISE_STREAM_COLUMNS];
	union incise_cell cells[INCISE_STREAM_COLUMNS]; /* the present row */
	char status[2];
};

/* The places of cells. */
enum {
	INCISE_CELL_CODE = 2,
	INCISE_CELL_FORCE,
	INCISE_CELL_CLIPPED,
	INCISE_CELL_DEPTH = 2,
	INCISE_CELL_VELOCITY,
	INCISE_CELL_POSITION = 3,
	INCISE_CELL_QUATERNION = 6,
	INCISE_CELL_STATUS = 10,
	INCISE_CELL_KIND = 1,
	INCISE_CELL_TEXT,
};

/* The name of a stream, static; NULL: there is none. */
const char *incise_stream_known(const char *name);

/* Open a stream. Returns 0 or -errno; to be closed in any case. */
int incise_stream_rows_open(struct incise_stream_rows *stream,
			    struct incise_recording *recording, const char *name,
			    const struct incise_export_options *options,
			    struct incise_error *err);

void incise_stream_rows_close(struct incise_stream_rows *stream);

/* Write the rows of a stream in this format, of the part that the pass is limited to. Returns 0 or -errno. */
int incise_export_stream(struct incise_stream_rows *stream,
			 const struct incise_export_pass *pass,
			 const struct incise_table_format *format);

/*
 * Write the rows of the streams that the format's open() opens, in order of time, as incise_export_rows()
 * does.
 */
int incise_export_messages(struct incise_export_pass *pass,
			   const struct incise_table_format *format, FILE *out,
			   const struct incise_provenance *provenance);

/* For open(): limit the recording to the part that is asked for. Returns 0 or -errno. */
int incise_messages_limit(struct incise_export_pass *pass);

#endif
