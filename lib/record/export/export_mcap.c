// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording as messages for viewers; see export_mcap.h.
 *
 *     force ──┐
 *     tracker ├──► the earliest ──► JSON ──► mcap_writer
 *     depth ──┤
 *     events ─┘
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/c_locale.h"
#include "decimal.h"
#include "export_mcap.h"
#include "mcap_writer.h"
#include "../read/recording.h"
#include "../read/rows.h"

#define NUMBER(about) "{\"type\":\"number\",\"description\":\"" about "\"}"
#define OBJECT(properties) "{\"type\":\"object\",\"properties\":{" properties "}}"
#define STREAMS 4

struct mcap_export {
	const struct incise_recording *recording;
	struct incise_recording_force scale;
	uint64_t clipped;
	char *text; /* of a message */
	size_t room;
};

/* The message of a row, into text; its length, or -errno. */
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

/* A text in JSON's quotes; what is no UTF-8 in it, SQLite has from outside: '?'. */
static char *add_text(char *to, const char *before, const unsigned char *text)
{
	to = add(to, before);
	*to++ = '"';
	for (; *text; text++) {
		int more = *text < 0x80	  ? 0
			   : *text < 0xc2 ? -1
			   : *text < 0xe0 ? 1
			   : *text < 0xf0 ? 2
			   : *text < 0xf5 ? 3
					  : -1;

		for (int i = 1; i <= more; i++)
			if ((text[i] & 0xc0) != 0x80)
				more = -1;
		if (more >= 2 && ((*text == 0xe0 && text[1] < 0xa0) ||
				  (*text == 0xed && text[1] > 0x9f) ||
				  (*text == 0xf0 && text[1] < 0x90) ||
				  (*text == 0xf4 && text[1] > 0x8f)))
			more = -1;
		if (*text == '"' || *text == '\\')
			*to++ = '\\';
		*to++ = *text < ' ' || *text == 0x7f || more < 0 ? '?' : *text;
		for (; more > 0; more--)
			*to++ = *++text;
	}
	*to++ = '"';
	return to;
}

/* Room for a message with a text of so many bytes, each of which may be quoted. */
static int make_room(struct mcap_export *export, size_t bytes)
{
	size_t room = 16 * INCISE_DECIMAL_MAX + 2 * bytes;
	char *text;

	if (room <= export->room)
		return 0;
	text = realloc(export->text, room);
	if (!text)
		return -ENOMEM;
	export->text = text;
	export->room = room;
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
	int rc = make_room(export, sqlite3_column_bytes(rows->stmt, 9));
	char *to = export->text;

	if (rc)
		return rc;
	for (int i = 0; i < 7; i++)
		to = add_real(to, before[i], sqlite3_column_double(rows->stmt, 2 + i),
			      i < 3 ? 4 : 6);
	to = add_text(to, "},\"status\":", sqlite3_column_text(rows->stmt, 9));
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
	int rc = make_room(export, sqlite3_column_bytes(rows->stmt, 2) +
					   sqlite3_column_bytes(rows->stmt, 3));
	char *to = export->text;

	if (rc)
		return rc;
	to = add_text(to, "{\"kind\":", sqlite3_column_text(rows->stmt, 2));
	to = add_text(to, ",\"text\":", sqlite3_column_text(rows->stmt, 3));
	return add(to, "}") - export->text;
}

/* Where each stream comes from, and what becomes of it. */
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
		"the messages cannot be written: %s; make room, or give another -o",
		strerror(-rc));
}

/* All rows, the earliest first. Returns how many, or -errno. */
static int64_t each_row(struct mcap_export *export, struct incise_mcap *mcap,
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
				err, -rc, "%s: damaged: table %s, row %lld cannot be",
				export->recording->path, streams[next].table,
				(long long)sqlite3_column_int64(rows[next].stmt, 0));
		rc = incise_mcap_message(mcap, next,
					 rows[next].t_ns > 0 ? rows[next].t_ns : 0,
					 export->text, rc);
		if (rc)
			return fail_write(rc, err);
		if ((++n & 0xffff) == 0 && o->progress &&
		    o->progress(o->context, fmin(1, n / fmax(1, all))))
			return incise_error_set(err, EINTR, "interrupted");
		rc = incise_rows_next(&rows[next], err);
	}
	return rc;
}

int incise_export_mcap(struct incise_recording *recording,
		       const struct incise_export_options *options, FILE *out,
		       const struct incise_lineage *lineage,
		       struct incise_export_report *report, struct incise_error *err)
{
	const struct incise_recording_info *meta = &recording->meta;
	const struct incise_calibration *given = options->calibration;
	const uint64_t expected[STREAMS] = {meta->force, meta->tracker,
					    recording->meta.depth, UINT64_MAX};
	struct mcap_export export = {.recording = recording};
	struct incise_c_locale locale = incise_c_locale_begin();
	struct incise_rows rows[STREAMS] = {0};
	struct incise_mcap *mcap = incise_mcap_new(out);
	int64_t n = 0;
	int rc = mcap ? make_room(&export, 0) : -ENOMEM;

	if (rc)
		rc = incise_error_set(err, ENOMEM, "out of memory");
	incise_recording_force(recording, given, &export.scale);
	if (!rc)
		rc = incise_recording_need_zero(recording, &export.scale, err);
	for (int i = 0; i < STREAMS && !rc; i++) {
		rc = incise_rows_open(&rows[i], recording, streams[i].table,
				      streams[i].columns, streams[i].types, expected[i],
				      err);
		if (!rc && given)
			incise_rows_calibrate(&rows[i], given);
		if (!rc &&
		    incise_mcap_channel(mcap, streams[i].topic, streams[i].schema_name,
					streams[i].schema) < 0)
			rc = fail_write(incise_mcap_finish(mcap), err);
	}
	if (!rc) {
		incise_mcap_metadata(mcap, "incise", lineage);
		n = each_row(&export, mcap, rows, options,
			     meta->force + meta->tracker + recording->meta.depth, err);
		rc = n < 0 ? (int)n : 0;
	}
	if (!rc && (rc = incise_mcap_finish(mcap)))
		rc = fail_write(rc, err);
	incise_c_locale_end(locale);
	for (int i = 0; i < STREAMS; i++)
		incise_rows_close(&rows[i]);
	incise_mcap_free(mcap);
	free(export.text);
	if (!rc && report)
		*report = (struct incise_export_report){.rows = n,
							.clipped = export.clipped};
	return rc;
}
