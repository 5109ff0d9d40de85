// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording as messages for viewers; see writers.h.
 *
 *     force ──┐
 *     tracker ├──► the earliest ──► JSON ──► MCAP
 *     depth ──┤
 *     events ─┘
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>
#include <incise/version.h>
#include "../../base/c_locale.h"
#include "../../base/utf8.h"
#include "../read/recording.h"
#include "../read/rows.h"
#include "decimal.h"
#include "writers.h"

/*
 * --- MCAP, the log format of viewers such as Foxglove; https://mcap.dev/spec ----------------
 *
 *     magic │ Header │ Schema, Channel … Metadata │ Chunk, MessageIndex … … │ DataEnd │
 *           │ summary: Schema, Channel …, Statistics, ChunkIndex …, MetadataIndex │
 *           │ SummaryOffset … │ Footer │ magic
 *
 * Names of records and fields are those of the specification; numbers are little-endian, times
 * in ns. Chunks are not compressed, and indexed by time. Memory is that of a chunk and of 100
 * bytes for each one before. Failures are kept until mcap_finish().
 */

#define CHUNK_SIZE (1 << 20)
#define STREAMS 4

enum opcode {
	HEADER = 1,
	FOOTER,
	SCHEMA,
	CHANNEL,
	MESSAGE,
	CHUNK,
	MESSAGE_INDEX,
	CHUNK_INDEX,
	STATISTICS = 0x0b,
	METADATA,
	METADATA_INDEX,
	SUMMARY_OFFSET,
	DATA_END,
};

static const unsigned char magic[8] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

/* A growing buffer. */
struct bytes {
	unsigned char *data;
	size_t n, capacity;
	bool failed; /* no memory */
};

struct channel {
	const char *topic, *schema_name, *schema;
	uint64_t messages;
	struct bytes index; /* of the chunk: log_time, offset; 8 bytes each */
};

struct mcap {
	FILE *out;
	int rc;	      /* first failure */
	uint32_t crc; /* of the present section */
	uint64_t at;  /* bytes written */
	struct channel channels[STREAMS];
	int n_channels;
	struct bytes record; /* the present one */
	struct bytes chunk;  /* its records */
	uint64_t first_ns, last_ns, chunk_first_ns, chunk_last_ns;
	struct bytes chunk_indexes, metadata_index; /* whole records, for the summary */
	uint64_t chunks, metadata;
};

static unsigned char *grow(struct bytes *bytes, size_t n)
{
	unsigned char *at;

	if (bytes->n + n > bytes->capacity) {
		size_t capacity = 2 * (bytes->n + n);
		unsigned char *data = realloc(bytes->data, capacity);

		if (!data) {
			bytes->failed = true;
			return NULL;
		}
		bytes->data = data;
		bytes->capacity = capacity;
	}
	at = bytes->data + bytes->n;
	bytes->n += n;
	return at;
}

static void put(struct bytes *bytes, const void *data, size_t n)
{
	unsigned char *at = n ? grow(bytes, n) : NULL;

	if (at)
		memcpy(at, data, n);
}

static void put_number(struct bytes *bytes, uint64_t value, int size)
{
	unsigned char *at = grow(bytes, size);

	for (int i = 0; at && i < size; i++)
		at[i] = value >> (8 * i);
}

static void put_text(struct bytes *bytes, const char *text)
{
	put_number(bytes, strlen(text), 4);
	put(bytes, text, strlen(text));
}

/* Fill in a length, now that its end is written. */
static void close_length(struct bytes *bytes, size_t at, int size)
{
	uint64_t length = bytes->n - at - size;

	for (int i = 0; !bytes->failed && i < size; i++)
		bytes->data[at + i] = length >> (8 * i);
}

static void put_pairs(struct bytes *bytes, const struct incise_provenance *provenance)
{
	size_t at = bytes->n;

	put_number(bytes, 0, 4);
	for (int i = 0; i < provenance->n; i++) {
		put_text(bytes, provenance->items[i].key);
		put_text(bytes, provenance->items[i].value);
	}
	close_length(bytes, at, 4);
}

static void write_bytes(struct mcap *mcap, const void *data, size_t n)
{
	if (mcap->rc || !n)
		return;
	errno = 0;
	if (fwrite(data, 1, n, mcap->out) != n)
		mcap->rc = errno ? -errno : -EIO;
	mcap->crc = (uint32_t)crc32_z(mcap->crc, data, n);
	mcap->at += n;
}

static struct bytes *begin(struct mcap *mcap, enum opcode opcode)
{
	mcap->record.n = 0;
	put_number(&mcap->record, opcode, 1);
	put_number(&mcap->record, 0, 8);
	return &mcap->record;
}

/* Write the record, or add it to @summary if that is not NULL. */
static void end(struct mcap *mcap, struct bytes *summary)
{
	close_length(&mcap->record, 1, 8);
	if (mcap->record.failed && !mcap->rc)
		mcap->rc = -ENOMEM;
	if (!summary)
		write_bytes(mcap, mcap->record.data, mcap->record.n);
	else
		put(summary, mcap->record.data, mcap->record.n);
	if (summary && summary->failed && !mcap->rc)
		mcap->rc = -ENOMEM;
}

static void write_schema(struct mcap *mcap, int i)
{
	struct bytes *to = begin(mcap, SCHEMA);

	put_number(to, i + 1, 2); /* 0 would be none */
	put_text(to, mcap->channels[i].schema_name);
	put_text(to, "jsonschema");
	put_text(to, mcap->channels[i].schema);
	end(mcap, NULL);
}

static void write_channel(struct mcap *mcap, int i)
{
	struct bytes *to = begin(mcap, CHANNEL);

	put_number(to, i, 2);
	put_number(to, i + 1, 2);
	put_text(to, mcap->channels[i].topic);
	put_text(to, "json");
	put_number(to, 0, 4); /* no metadata */
	end(mcap, NULL);
}

/* Write the chunk, and its indexes behind it. */
static void write_chunk(struct mcap *mcap)
{
	uint64_t start = mcap->at, length, indexes;
	uint64_t offsets[STREAMS];
	struct bytes *to = begin(mcap, CHUNK);
	size_t at;

	put_number(to, mcap->chunk_first_ns, 8);
	put_number(to, mcap->chunk_last_ns, 8);
	put_number(to, mcap->chunk.n, 8);
	put_number(to, (uint32_t)crc32_z(0, mcap->chunk.data, mcap->chunk.n), 4);
	put_text(to, ""); /* not compressed */
	put_number(to, mcap->chunk.n, 8);
	put(to, mcap->chunk.data, mcap->chunk.n);
	end(mcap, NULL);
	length = mcap->at - start;
	indexes = mcap->at;
	for (int i = 0; i < mcap->n_channels; i++) {
		struct bytes *index = &mcap->channels[i].index;

		offsets[i] = index->n ? mcap->at : 0;
		if (!index->n)
			continue;
		to = begin(mcap, MESSAGE_INDEX);
		put_number(to, i, 2);
		put_number(to, index->n, 4);
		put(to, index->data, index->n);
		end(mcap, NULL);
		index->n = 0;
	}
	to = begin(mcap, CHUNK_INDEX);
	put_number(to, mcap->chunk_first_ns, 8);
	put_number(to, mcap->chunk_last_ns, 8);
	put_number(to, start, 8);
	put_number(to, length, 8);
	at = to->n;
	put_number(to, 0, 4);
	for (int i = 0; i < mcap->n_channels; i++)
		if (offsets[i]) {
			put_number(to, i, 2);
			put_number(to, offsets[i], 8);
		}
	close_length(to, at, 4);
	put_number(to, mcap->at - indexes, 8);
	put_text(to, "");
	put_number(to, mcap->chunk.n, 8);
	put_number(to, mcap->chunk.n, 8);
	end(mcap, &mcap->chunk_indexes);
	mcap->chunks++;
	mcap->chunk.n = 0;
}

/* Add a message. Returns 0, or -errno of the writes so far. */
static int mcap_message(struct mcap *mcap, int channel, uint64_t t_ns, const char *json,
			size_t length)
{
	struct channel *of = &mcap->channels[channel];
	struct bytes *to = &mcap->chunk;

	put_number(&of->index, t_ns, 8);
	put_number(&of->index, to->n, 8);
	if (!to->n || t_ns < mcap->chunk_first_ns)
		mcap->chunk_first_ns = t_ns;
	if (!to->n || t_ns > mcap->chunk_last_ns)
		mcap->chunk_last_ns = t_ns;
	if ((!to->n && !mcap->chunks) || t_ns < mcap->first_ns)
		mcap->first_ns = t_ns;
	if ((!to->n && !mcap->chunks) || t_ns > mcap->last_ns)
		mcap->last_ns = t_ns;
	put_number(to, MESSAGE, 1);
	put_number(to, 22 + length, 8);
	put_number(to, channel, 2);
	put_number(to, of->messages++, 4); /* modulo 2^32, which readers accept */
	put_number(to, t_ns, 8);	   /* log_time */
	put_number(to, t_ns, 8);	   /* publish_time */
	put(to, json, length);
	if ((to->failed || of->index.failed) && !mcap->rc)
		mcap->rc = -ENOMEM;
	if (to->n >= CHUNK_SIZE && !mcap->rc)
		write_chunk(mcap);
	return mcap->rc;
}

static void mcap_begin(struct mcap *mcap, FILE *out)
{
	struct bytes *to;

	*mcap = (struct mcap){.out = out};
	write_bytes(mcap, magic, sizeof(magic));
	to = begin(mcap, HEADER);
	put_text(to, ""); /* no profile */
	put_text(to, "incise " INCISE_VERSION);
	end(mcap, NULL);
}

/*
 * Announce a topic with messages in JSON after a JSON Schema, before the first message. Texts
 * must outlive the file.
 */
static void mcap_channel(struct mcap *mcap, const char *topic, const char *schema_name,
			 const char *schema)
{
	int i = mcap->n_channels++;

	mcap->channels[i] = (struct channel){topic, schema_name, schema, 0, {0}};
	write_schema(mcap, i);
	write_channel(mcap, i);
}

static void mcap_metadata(struct mcap *mcap, const char *name,
			  const struct incise_provenance *provenance)
{
	uint64_t start = mcap->at;
	struct bytes *to = begin(mcap, METADATA);

	put_text(to, name);
	put_pairs(to, provenance);
	end(mcap, NULL);
	to = begin(mcap, METADATA_INDEX);
	put_number(to, start, 8);
	put_number(to, mcap->at - start, 8);
	put_text(to, name);
	end(mcap, &mcap->metadata_index);
	mcap->metadata++;
}

static void write_statistics(struct mcap *mcap)
{
	struct bytes *to = begin(mcap, STATISTICS);
	uint64_t messages = 0;
	size_t at;

	for (int i = 0; i < mcap->n_channels; i++)
		messages += mcap->channels[i].messages;
	put_number(to, messages, 8);
	put_number(to, mcap->n_channels, 2);
	put_number(to, mcap->n_channels, 4);
	put_number(to, 0, 4); /* attachments */
	put_number(to, mcap->metadata, 4);
	put_number(to, mcap->chunks, 4);
	put_number(to, mcap->first_ns, 8);
	put_number(to, mcap->last_ns, 8);
	at = to->n;
	put_number(to, 0, 4);
	for (int i = 0; i < mcap->n_channels; i++) {
		put_number(to, i, 2);
		put_number(to, mcap->channels[i].messages, 8);
	}
	close_length(to, at, 4);
	end(mcap, NULL);
}

/* Records of one kind in the summary. */
struct group {
	enum opcode opcode;
	uint64_t start, length;
};

static void write_summary(struct mcap *mcap)
{
	struct group groups[5];
	uint64_t start = mcap->at, offsets, before;
	struct bytes *to;

	mcap->crc = 0;
	for (int k = 0; k < 5; k++) {
		static const enum opcode order[] = {SCHEMA, CHANNEL, STATISTICS,
						    CHUNK_INDEX, METADATA_INDEX};

		before = mcap->at;
		for (int i = 0; i < mcap->n_channels && k < 2; i++)
			(k ? write_channel : write_schema)(mcap, i);
		if (order[k] == STATISTICS)
			write_statistics(mcap);
		else if (order[k] == CHUNK_INDEX)
			write_bytes(mcap, mcap->chunk_indexes.data,
				    mcap->chunk_indexes.n);
		else if (order[k] == METADATA_INDEX)
			write_bytes(mcap, mcap->metadata_index.data,
				    mcap->metadata_index.n);
		groups[k] = (struct group){order[k], before, mcap->at - before};
	}
	offsets = mcap->at;
	for (int k = 0; k < 5; k++) {
		if (!groups[k].length)
			continue;
		to = begin(mcap, SUMMARY_OFFSET);
		put_number(to, groups[k].opcode, 1);
		put_number(to, groups[k].start, 8);
		put_number(to, groups[k].length, 8);
		end(mcap, NULL);
	}
	to = begin(mcap, FOOTER);
	put_number(to, start, 8);
	put_number(to, offsets, 8);
	put_number(to, 0, 4);
	close_length(to, 1, 8);
	if (to->failed)
		return;
	/* The checksum is over the whole summary but itself. */
	mcap->crc = (uint32_t)crc32_z(mcap->crc, to->data, to->n - 4);
	to->n -= 4;
	put_number(to, mcap->crc, 4);
	write_bytes(mcap, to->data, to->n);
}

/* End the file: 0, or the negative errno of the first failure. */
static int mcap_finish(struct mcap *mcap)
{
	struct bytes *to;
	uint32_t crc;

	if (mcap->chunk.n)
		write_chunk(mcap);
	crc = mcap->crc;
	to = begin(mcap, DATA_END);
	put_number(to, crc, 4);
	end(mcap, NULL);
	write_summary(mcap);
	write_bytes(mcap, magic, sizeof(magic));
	errno = 0;
	if (!mcap->rc && fflush(mcap->out))
		mcap->rc = errno ? -errno : -EIO;
	return mcap->rc;
}

static void mcap_free(struct mcap *mcap)
{
	for (int i = 0; i < mcap->n_channels; i++)
		free(mcap->channels[i].index.data);
	free(mcap->record.data);
	free(mcap->chunk.data);
	free(mcap->chunk_indexes.data);
	free(mcap->metadata_index.data);
}

/* --- messages ------------------------------------------------------------------------ */

#define NUMBER(about) "{\"type\":\"number\",\"description\":\"" about "\"}"
#define OBJECT(properties) "{\"type\":\"object\",\"properties\":{" properties "}}"

struct mcap_export {
	const struct incise_recording *recording;
	struct incise_recording_force scale;
	uint64_t clipped;
	char *text; /* of a message */
	size_t capacity;
};

/* Make the message of a row in text; its length, or -errno. */
typedef int (*message)(struct mcap_export *export, const struct incise_rows *rows);

static char *add(char *to, const char *text)
{
	return stpcpy(to, text);
}

static char *add_real(char *to, const char *before, double value, int decimals)
{
	return incise_decimal_real(add(to, before), value, decimals);
}

static int force_message(struct mcap_export *export, const struct incise_rows *rows)
{
	int64_t code = sqlite3_column_int64(rows->stmt, 2);
	bool clipped = code == 0 || code == export->scale.top;
	char *to = export->text;

	if (code < 0 || code > export->scale.top)
		return -EINVAL;
	export->clipped += clipped;
	to = add_real(to, "{\"force_N\":",
		      code * export->scale.n_per_code - export->scale.zero_N, 5);
	to = incise_decimal_integer(add(to, ",\"code\":"), code);
	to = add(to, clipped ? ",\"clipped\":true}" : ",\"clipped\":false}");
	return to - export->text;
}

/* A text in JSON's quotes; bytes that are not UTF-8 become '?'. */
static char *add_text(char *to, const char *before, const char *text)
{
	to = add(to, before);
	*to++ = '"';
	while (*text) {
		int length = utf8_printable(text);

		if (*text == '"' || *text == '\\')
			*to++ = '\\';
		*to++ = length ? *text : '?';
		text++;
		for (int i = 1; i < length; i++)
			*to++ = *text++;
	}
	*to++ = '"';
	return to;
}

/* Make text large enough for a message with this many bytes, each of which may be quoted. */
static int reserve(struct mcap_export *export, size_t bytes)
{
	size_t capacity = 16 * INCISE_DECIMAL_MAX + 2 * bytes;
	char *text;

	if (capacity <= export->capacity)
		return 0;
	text = realloc(export->text, capacity);
	if (!text)
		return -ENOMEM;
	export->text = text;
	export->capacity = capacity;
	return 0;
}

static int tracker_message(struct mcap_export *export, const struct incise_rows *rows)
{
	static const char *const before[] = {"{\"position_mm\":{\"x\":",
					     ",\"y\":",
					     ",\"z\":",
					     "},\"orientation\":{\"w\":",
					     ",\"x\":",
					     ",\"y\":",
					     ",\"z\":"};
	int rc = reserve(export, sqlite3_column_bytes(rows->stmt, 9));
	char *to = export->text;

	if (rc)
		return rc;
	for (int i = 0; i < 7; i++)
		to = add_real(to, before[i], sqlite3_column_double(rows->stmt, 2 + i),
			      i < 3 ? 4 : 6);
	to = add_text(to,
		      "},\"status\":", (const char *)sqlite3_column_text(rows->stmt, 9));
	return add(to, "}") - export->text;
}

static int depth_message(struct mcap_export *export, const struct incise_rows *rows)
{
	char *to = export->text;

	to = add_real(to, "{\"depth_mm\":", sqlite3_column_double(rows->stmt, 2), 4);
	to = add_real(to, ",\"velocity_mm_s\":", sqlite3_column_double(rows->stmt, 3), 3);
	return add(to, "}") - export->text;
}

static int event_message(struct mcap_export *export, const struct incise_rows *rows)
{
	int rc = reserve(export, sqlite3_column_bytes(rows->stmt, 2) +
					 sqlite3_column_bytes(rows->stmt, 3));
	char *to = export->text;

	if (rc)
		return rc;
	to = add_text(to, "{\"kind\":", (const char *)sqlite3_column_text(rows->stmt, 2));
	to = add_text(to, ",\"text\":", (const char *)sqlite3_column_text(rows->stmt, 3));
	return add(to, "}") - export->text;
}

static const struct stream {
	const char *table, *columns, *types;
	message message;
	const char *topic, *schema_name, *schema;
} streams[STREAMS] = {
	{"force", "seq, t_ns, code", "iii", force_message, "/force", "incise.Force",
	 OBJECT("\"force_N\":" NUMBER("N") ",\"code\":{\"type\":\"integer\"},"
					   "\"clipped\":{\"type\":\"boolean\"}")},
	{"tracker", "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status", "iirrrrrrrt",
	 tracker_message, "/tracker", "incise.Pose",
	 OBJECT("\"position_mm\":" OBJECT("\"x\":" NUMBER("mm") ",\"y\":" NUMBER("mm") ",\"z\":" NUMBER("mm")) ",\"orientation\":" OBJECT(
		 "\"w\":" NUMBER("unit quaternion") ",\"x\":" NUMBER("unit quaternion") ",\"y\":" NUMBER(
			 "unit quaternion") ",\"z\":" NUMBER("unit quaternion")) ",\"status\":{\"type\":\"string\"}")},
	{"depth", "seq, t_ns, depth_mm, velocity_mm_s", "iirr", depth_message, "/depth",
	 "incise.Depth",
	 OBJECT("\"depth_mm\":" NUMBER("mm") ",\"velocity_mm_s\":" NUMBER("mm/s"))},
	{"events", "rowid, t_ns, kind, text", "iitt", event_message, "/events",
	 "incise.Event",
	 OBJECT("\"kind\":{\"type\":\"string\"},\"text\":{\"type\":\"string\"}")},
};

static int fail_write(int rc, struct incise_error *err)
{
	return incise_error_set(
		err, -rc,
		"the messages cannot be written: %s; free disk space, or give another "
		"-o",
		strerror(-rc));
}

/* Write all rows, the earliest first. Returns their number, or -errno. */
static int64_t each_row(struct mcap_export *export, struct mcap *mcap,
			struct incise_rows rows[STREAMS],
			const struct incise_export_options *o, uint64_t all,
			struct incise_error *err)
{
	int64_t n = 0;
	int rc = 0;

	for (int i = 0; i < STREAMS && rc >= 0; i++)
		rc = incise_rows_next(&rows[i], err);
	while (rc >= 0) {
		int next = -1;

		for (int i = 0; i < STREAMS; i++)
			if (rows[i].live && (next < 0 || rows[i].t_ns < rows[next].t_ns))
				next = i;
		if (next < 0)
			return n;
		rc = streams[next].message(export, &rows[next]);
		if (rc < 0)
			return incise_error_set(
				err, -rc, "%s: damaged: table %s, row %lld is invalid",
				export->recording->path, streams[next].table,
				(long long)sqlite3_column_int64(rows[next].stmt, 0));
		rc = mcap_message(mcap, next, rows[next].t_ns > 0 ? rows[next].t_ns : 0,
				  export->text, rc);
		if (rc)
			return fail_write(rc, err);
		if ((++n & 0xffff) == 0) {
			rc = incise_export_progress(o, (double)n, (double)all, err);
			if (rc)
				return rc;
		}
		rc = incise_rows_next(&rows[next], err);
	}
	return rc;
}

int incise_export_mcap(struct incise_recording *recording,
		       const struct incise_export_options *options, FILE *out,
		       const struct incise_provenance *provenance,
		       struct incise_export_report *report, struct incise_error *err)
{
	const struct incise_recording_info *meta = &recording->meta;
	const struct incise_calibration *given = options->calibration;
	const uint64_t expected[STREAMS] = {meta->force, meta->tracker, meta->depth,
					    UINT64_MAX};
	struct mcap_export export = {.recording = recording};
	struct incise_c_locale locale = incise_c_locale_begin();
	struct incise_rows rows[STREAMS] = {0};
	struct mcap mcap;
	int64_t n = 0;
	int rc = reserve(&export, 0);

	if (rc)
		rc = incise_error_set(err, ENOMEM, "out of memory");
	mcap_begin(&mcap, out);
	incise_recording_force(recording, given, &export.scale);
	if (!rc)
		rc = incise_recording_need_zero(recording, &export.scale, err);
	for (int i = 0; i < STREAMS && !rc; i++) {
		rc = incise_rows_open(&rows[i], recording, streams[i].table,
				      streams[i].columns, streams[i].types, expected[i],
				      err);
		if (!rc && given)
			incise_row_times_calibrate(&rows[i].times, given);
		mcap_channel(&mcap, streams[i].topic, streams[i].schema_name,
			     streams[i].schema);
	}
	if (!rc) {
		mcap_metadata(&mcap, "incise", provenance);
		n = each_row(&export, &mcap, rows, options,
			     meta->force + meta->tracker + meta->depth, err);
		rc = n < 0 ? (int)n : 0;
	}
	if (!rc && (rc = mcap_finish(&mcap)))
		rc = fail_write(rc, err);
	incise_c_locale_end(locale);
	for (int i = 0; i < STREAMS; i++)
		incise_rows_close(&rows[i]);
	mcap_free(&mcap);
	free(export.text);
	if (!rc && report)
		*report = (struct incise_export_report){.rows = n,
							.clipped = export.clipped};
	return rc;
}
