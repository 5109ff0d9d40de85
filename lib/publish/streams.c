// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The streams of a recording as rows; see streams.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../record/read/session.h"
#include "streams.h"

#define FIELD(kind, decimals, ...) \
	INCISE_COLUMN(struct incise_stream_rows, cells, kind, decimals, __VA_ARGS__)
#define SEQ FIELD(INTEGER, 0, "seq", "1", "number of the sample, from the device")
#define TIME FIELD(INTEGER, 0, "t_ns", "ns", "best time of acquisition, CLOCK_MONOTONIC")
#define ARRIVAL FIELD(INTEGER, 0, "arrival_ns", "ns", "time of receipt, CLOCK_MONOTONIC")
#define POSITION "mm", "position as received, without the calibrated tip"
#define ORIENTATION "1", "orientation, unit quaternion"

static void find_force(struct incise_stream_rows *stream)
{
	const struct incise_recording_force *scale = &stream->scale;
	union incise_cell *cells = stream->cells;
	int64_t code = cells[INCISE_CELL_CODE].integer;

	cells[INCISE_CELL_FORCE].real = code * scale->n_per_code - scale->zero_N;
	cells[INCISE_CELL_CLIPPED].flag = code <= 0 || code >= scale->top;
}

/* From the clock of a member to that of its session. */
static void map_arrival(struct incise_stream_rows *stream)
{
	stream->cells[2].integer =
		incise_session_time(stream->rows.times.map, stream->cells[2].integer);
}

/* By the calibration in use, of a depth by vision. */
static void scale_depth(struct incise_stream_rows *stream)
{
	map_arrival(stream);
	stream->cells[7].real *= stream->depth_scale;
}

/* A stream, and what is read of its table, as of rows.h: columns of it, from that on which is cell 0. */
static const struct incise_stream_kind {
	const char *name, *columns;
	int from, n;
	/* Compute the cells that the table does not have; or NULL. */
	void (*finish)(struct incise_stream_rows *stream);
	struct incise_table_column fields[INCISE_STREAM_COLUMNS + 1];
} kinds[] = {
	{"force",
	 "seq, t_ns, code",
	 0,
	 3,
	 find_force,
	 {SEQ, TIME, FIELD(SHORT, 0, "code", "1", "code of the converter"),
	  FIELD(REAL, 5, "force_N", "N", "on the blade"),
	  FIELD(FLAG, 0, "clipped", "1", "the converter was at an end")}},
	{"tracker",
	 "seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status, station, "
	 "button",
	 0,
	 13,
	 map_arrival,
	 {SEQ, TIME, ARRIVAL, FIELD(REAL, 4, "x_mm", POSITION),
	  FIELD(REAL, 4, "y_mm", POSITION), FIELD(REAL, 4, "z_mm", POSITION),
	  FIELD(REAL, 6, "qw", ORIENTATION), FIELD(REAL, 6, "qx", ORIENTATION),
	  FIELD(REAL, 6, "qy", ORIENTATION), FIELD(REAL, 6, "qz", ORIENTATION),
	  FIELD(TEXT, 0, "status", "1", "error letter of the tracker, space: none"),
	  FIELD(SHORT, 0, "station", "1", "sensor of the tracker, from 1"),
	  FIELD(FLAG, 0, "button", "1", "the button of the stylus was pressed")}},
	{"depth",
	 "seq, t_ns, depth_mm, velocity_mm_s",
	 0,
	 4,
	 NULL,
	 {SEQ, TIME, FIELD(REAL, 4, "depth_mm", "mm", "of the tip below the surface"),
	  FIELD(REAL, 3, "velocity_mm_s", "mm/s", "speed of the tip")}},
	{"frames",
	 "seq, t_ns, arrival_ns, pts, bytes, length_px, sd_px, depth_mm, quality",
	 0,
	 9,
	 scale_depth,
	 {SEQ, TIME, ARRIVAL, FIELD(INTEGER, 0, "pts", "ms", "timestamp in camera.mkv"),
	  FIELD(INTEGER, 0, "bytes", "byte", "size of the coded frame"),
	  FIELD(SEEN, 0, "length_px", "pixel", "exposed length of the blade"),
	  FIELD(SEEN, 0, "sd_px", "pixel", "standard deviation of the edge"),
	  FIELD(SEEN, 0, "depth_mm", "mm",
		"depth of the tip below the surface, from vision"),
	  FIELD(SEEN, 0, "quality", "1", "quality of the measurement, 0 to 1")}},
	/* Events have no number. */
	{"events",
	 "rowid, t_ns, kind, text",
	 1,
	 3,
	 NULL,
	 {FIELD(INTEGER, 0, "t_ns", "ns", "CLOCK_MONOTONIC"),
	  FIELD(TEXT, 0, "kind", "1", "kind of the event"),
	  FIELD(TEXT, 0, "text", "1", "its description")}},
};

static const struct incise_stream_kind *find_kind(const char *name)
{
	for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++)
		if (!strcmp(kinds[i].name, name))
			return &kinds[i];
	return NULL;
}

const char *incise_stream_known(const char *name)
{
	const struct incise_stream_kind *kind = find_kind(name);

	return kind ? kind->name : NULL;
}

/* Rows of a table as meta has them; not known of events and frames. */
static uint64_t expect_rows(const struct incise_recording_info *meta, const char *table)
{
	return !strcmp(table, "force")	   ? meta->force
	       : !strcmp(table, "tracker") ? meta->tracker
	       : !strcmp(table, "depth")   ? meta->depth
					   : UINT64_MAX;
}

int incise_stream_rows_open(struct incise_stream_rows *stream,
			    struct incise_recording *recording, const char *name,
			    const struct incise_export_options *options,
			    struct incise_error *err)
{
	const struct incise_calibration *given = options->calibration;
	const struct incise_stream_kind *kind = find_kind(name);
	int rc;

	*stream = (struct incise_stream_rows){
		.kind = kind,
		.depth_scale =
			given ? given->depth_mm_px / recording->meta.depth_mm_px : 1,
	};
	for (; kind->fields[stream->n].name; stream->n++) {
		stream->columns[stream->n] = kind->fields[stream->n];
		stream->columns[stream->n].at +=
			(size_t)stream->n * sizeof(*stream->cells);
	}
	incise_recording_force(recording, given, &stream->scale);
	rc = incise_rows_open(&stream->rows, recording, name, kind->columns,
			      expect_rows(&recording->meta, name), err);
	if (!rc && given)
		incise_row_times_calibrate(&stream->rows.times, given);
	return rc;
}

/* Fill a cell with the column of the row. */
static void fill_cell(struct incise_stream_rows *stream, int i)
{
	const struct incise_rows *rows = &stream->rows;
	union incise_cell *cell = &stream->cells[i];
	int column = stream->kind->from + i;

	switch (stream->columns[i].type) {
	case INCISE_COLUMN_REAL:
	case INCISE_COLUMN_SEEN:
		cell->real = incise_rows_real(rows, column);
		break;
	case INCISE_COLUMN_FLAG:
		cell->flag = incise_rows_int(rows, column) != 0;
		break;
	case INCISE_COLUMN_TEXT: /* of the tracker a letter */
		*stream->status = rows->stmt ? 0 : incise_rows_char(rows, column);
		cell->text = rows->stmt ? incise_rows_text(rows, column, NULL)
					: stream->status;
		break;
	default:
		cell->integer = incise_rows_int(rows, column);
	}
}

/* Go to the next row: 1, 0 at the end, -errno. */
static int next_streams_row(struct incise_stream_rows *stream, struct incise_error *err)
{
	const struct incise_stream_kind *kind = stream->kind;
	int rc = incise_rows_next(&stream->rows, err);

	if (rc <= 0)
		return rc;
	for (int i = 0; i < kind->n; i++)
		fill_cell(stream, i);
	stream->cells[1 - kind->from].integer = stream->rows.t_ns;
	if (kind->finish)
		kind->finish(stream);
	return 1;
}

void incise_stream_rows_close(struct incise_stream_rows *stream)
{
	incise_rows_close(&stream->rows);
}

int incise_export_stream(struct incise_stream_rows *stream,
			 const struct incise_export_pass *pass,
			 const struct incise_table_format *format)
{
	struct incise_error *err = pass->err;
	struct incise_table table = {
		.format = format,
		.columns = stream->columns,
		.n_columns = stream->n,
	};
	int rc = incise_table_open(&table, err);

	if (rc)
		return rc;
	while ((rc = next_streams_row(stream, err)) > 0) {
		rc = incise_range_has(&pass->recordings[0]->range,
				      stream->rows.t_ns - pass->first_ns, 0)
			     ? incise_table_add(&table, stream, err)
			     : 0;
		if (rc)
			break;
	}
	if (!rc)
		rc = incise_table_finish(&table, err);
	incise_table_close(&table);
	return rc;
}

/* --- messages -------------------------------------------------------------------------- */

/* A part's times count from the first sample, by the calibration in use. */
int incise_messages_limit(struct incise_export_pass *pass)
{
	struct incise_recording *recording = pass->recordings[0];
	struct incise_stream_rows stream;
	int rc = incise_recording_limit(recording, pass->options, false, pass->err);

	if (rc || !recording->range.limited)
		return rc;
	rc = incise_stream_rows_open(&stream, recording,
				     incise_recording_has_force(recording) ? "force"
									   : "tracker",
				     pass->options, pass->err);
	if (!rc)
		rc = incise_rows_first(&stream.rows, &pass->first_ns, pass->err);
	incise_stream_rows_close(&stream);
	return rc;
}

/* The stream with the earliest row, or NULL: none has one. */
static struct incise_stream_rows *find_earliest(const struct incise_table *table)
{
	struct incise_stream_rows *earliest = NULL;

	for (int i = 0; i < table->n_streams; i++) {
		struct incise_stream_rows *stream = &table->streams[i];

		if (stream->rows.live &&
		    (!earliest || stream->rows.t_ns < earliest->rows.t_ns))
			earliest = stream;
	}
	return earliest;
}

/* Write all rows, the earliest first. Returns 0 or -errno. */
static int write_messages(struct incise_export_pass *pass, struct incise_table *table)
{
	const struct incise_recording *recording = pass->recordings[0];
	const struct incise_recording_info *meta = &recording->meta;
	uint64_t n = 0;
	int rc = 1;

	for (int i = 0; i < table->n_streams && rc >= 0; i++)
		rc = next_streams_row(&table->streams[i], pass->err);
	while (rc >= 0 && (table->stream = find_earliest(table))) {
		rc = incise_range_has(&recording->range,
				      table->stream->rows.t_ns - pass->first_ns, 0)
			     ? table->format->put(table, pass->err)
			     : 0;
		if (!rc && (++n & 0xffff) == 0)
			rc = incise_export_progress(
				pass, n, meta->force + meta->tracker + meta->depth);
		if (!rc)
			rc = next_streams_row(table->stream, pass->err);
	}
	return rc < 0 ? rc : 0;
}

int incise_export_messages(struct incise_export_pass *pass,
			   const struct incise_table_format *format, FILE *out,
			   const struct incise_provenance *provenance)
{
	struct incise_table table = {
		.format = format,
		.out = out,
		.provenance = provenance,
		.pass = pass,
	};
	int rc = incise_table_open(&table, pass->err);

	if (!rc) {
		rc = write_messages(pass, &table);
		if (!rc)
			rc = incise_table_finish(&table, pass->err);
		incise_table_close(&table);
	}
	if (!rc)
		rc = incise_export_check_part(pass);
	incise_export_close(pass);
	return rc;
}
