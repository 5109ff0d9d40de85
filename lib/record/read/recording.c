// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * One recording: its tables meta, streams and knots, see recording.h. The file is untrusted: it may be
 * truncated, altered or forged.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "database.h"
#include "recalibration.h"
#include "recording.h"
#include "../old/old.h"
#include "../schema.h"

#define COUNT_MAX (1LL << 53)
/* As in calibration.conf. */
#define TIP_MAX_MM 1e6
/* 146 years: times and their differences stay below 2^63. */
#define TIME_MAX (INT64_MAX / 2)
/* Ranges of a tracker's rate, as in incise_timeline_setup, and of an hour. */
#define RATE_MIN 1e-3
#define RATE_MAX 1e7
#define DELAY_MAX_MS 3.6e6

/* --- values of a row ---------------------------------------------------------------- */

static int damaged_recording(struct incise_recording *rec, const char *table,
			     const char *what, struct incise_error *err)
{
	return incise_error_set(err, EINVAL, "%s: damaged: table %s: %s", rec->path,
				table, what);
}

/* A text without control characters, which a terminal would obey. */
static bool take_recording_text(sqlite3_stmt *stmt, int column, bool optional, char *to,
				size_t size)
{
	/* The type first: sqlite3_column_text() converts any value. */
	int type = sqlite3_column_type(stmt, column);
	const char *text = (const char *)sqlite3_column_text(stmt, column);

	if (type == SQLITE_NULL && optional)
		text = "";
	else if (type != SQLITE_TEXT || !text)
		return false;
	snprintf(to, size, "%s", text);
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	return true;
}

static bool take_count(sqlite3_stmt *stmt, int column, uint64_t *to)
{
	int64_t value = sqlite3_column_int64(stmt, column);

	*to = value;
	return sqlite3_column_type(stmt, column) == SQLITE_INTEGER && value >= 0 &&
	       value <= COUNT_MAX;
}

/* A number, or NULL for an unknown one. */
static bool take_known(sqlite3_stmt *stmt, int column, double scale, double *to)
{
	int type = sqlite3_column_type(stmt, column);

	*to = type == SQLITE_NULL ? NAN : sqlite3_column_double(stmt, column) * scale;
	return type == SQLITE_NULL ||
	       ((type == SQLITE_FLOAT || type == SQLITE_INTEGER) && isfinite(*to));
}

/* --- table meta ------------------------------------------------------------------- */

struct item {
	const char *key;
	enum { TEXT, COUNT, REAL, REAL_OR_NULL, REAL_OR_NAN } type;
	void *to;
	size_t size; /* of a text */
	bool optional;
};

static bool take_item(sqlite3_stmt *stmt, const struct item *item)
{
	switch (item->type) {
	case TEXT:
		return take_recording_text(stmt, 0, false, item->to, item->size);
	case COUNT:
		return take_count(stmt, 0, item->to);
	case REAL_OR_NAN:
		if (!take_known(stmt, 0, 1, item->to))
			*(double *)item->to = NAN;
		return true;
	default:
		return take_known(stmt, 0, 1, item->to) &&
		       (sqlite3_column_type(stmt, 0) == SQLITE_FLOAT ||
			(item->type == REAL_OR_NULL &&
			 sqlite3_column_type(stmt, 0) == SQLITE_NULL));
	}
}

static int read_item(struct incise_recording *rec, const struct item *item,
		     struct incise_error *err)
{
	sqlite3_stmt *stmt = NULL;
	int rc = sqlite3_prepare_v2(rec->db, "SELECT value FROM meta WHERE key = ?", -1,
				    &stmt, NULL);

	if (rc == SQLITE_OK) {
		sqlite3_bind_text(stmt, 1, item->key, -1, SQLITE_STATIC);
		rc = sqlite3_step(stmt);
	}
	if ((rc == SQLITE_ROW && take_item(stmt, item)) ||
	    (rc == SQLITE_DONE && item->optional))
		rc = 0;
	else if (rc == SQLITE_ROW || rc == SQLITE_DONE)
		rc = incise_error_set(err, EINVAL,
				      "%s: damaged: '%s' in table meta is %s", rec->path,
				      item->key,
				      rc == SQLITE_ROW ? "out of range" : "missing");
	else
		rc = incise_schema_fail(rec->db, rec->path, err);
	sqlite3_finalize(stmt);
	return rc;
}

/* Older recordings have none: the device's own tip is the blade's. */
static int read_tip(struct incise_recording *rec, struct incise_error *err)
{
	static const char *const keys[] = {"tip_x_mm", "tip_y_mm", "tip_z_mm"};
	int rc = 0;

	for (int i = 0; i < 3 && !rc; i++) {
		const struct item item = {keys[i], REAL, &rec->meta.tip_mm[i], 0, true};

		rc = read_item(rec, &item, err);
		if (!rc && !(fabs(rec->meta.tip_mm[i]) <= TIP_MAX_MM))
			rc = incise_error_set(err, EINVAL,
					      "%s: damaged: '%s' in table meta is %g, "
					      "out of range",
					      rec->path, keys[i], rec->meta.tip_mm[i]);
	}
	return rc;
}

static int read_meta(struct incise_recording *rec, struct incise_error *err)
{
	struct incise_recording_info *info = &rec->meta;
	struct incise_recording_numbers *numbers = &rec->numbers;
	uint64_t complete = 0, bits = 0, newtons = 0;
	const struct item items[] = {
		{"complete", COUNT, &complete, 0, false},
		{"started", TEXT, info->started, sizeof(info->started), false},
		{"rig", TEXT, info->rig, sizeof(info->rig), false},
		{"force_bits", COUNT, &bits, 0, false},
		{"force_full_scale_V", REAL, &info->full_scale_V, 0, false},
		{"force_mV_N", REAL, &info->force_mV_N, 0, false},
		{"force_zero_mV", REAL_OR_NULL, &info->zero_mV, 0, false},
		{"depth_mm_px", REAL, &info->depth_mm_px, 0, false},
		{"surface_point_x_mm", REAL, &info->surface_point_mm[0], 0, false},
		{"surface_point_y_mm", REAL, &info->surface_point_mm[1], 0, false},
		{"surface_point_z_mm", REAL, &info->surface_point_mm[2], 0, false},
		{"surface_normal_x", REAL, &info->surface_normal[0], 0, false},
		{"surface_normal_y", REAL, &info->surface_normal[1], 0, false},
		{"surface_normal_z", REAL, &info->surface_normal[2], 0, false},
		{"force_rows", COUNT, &info->force, 0, false},
		{"tracker_rows", COUNT, &info->tracker, 0, false},
		{"depth_rows", COUNT, &info->depth, 0, false},
		{"force_lost", COUNT, &info->force_lost, 0, false},
		{"tracker_lost", COUNT, &info->tracker_lost, 0, false},
		{"force_clipped", COUNT, &info->force_clipped, 0, false},
		/* Older recordings have none: they start at 0 V, and are in volts. */
		{"force_offset_V", REAL, &info->offset_V, 0, true},
		{"force_newtons", COUNT, &newtons, 0, true},
		{"force_hz", REAL_OR_NAN, &numbers->force_hz, 0, true},
		{"force_zero_sd_mV", REAL_OR_NAN, &numbers->zero_sd_mV, 0, true},
		{"force_zero_samples", REAL_OR_NAN, &numbers->zero_samples, 0, true},
		{"tracker_hz", REAL_OR_NAN, &numbers->tracker_hz, 0, true},
		{"tracker_latency_ns", REAL_OR_NAN, &numbers->tracker_latency_ns, 0,
		 true},
		{"cuts", REAL_OR_NAN, &numbers->cuts, 0, true},
		{"depth_max_mm", REAL_OR_NAN, &numbers->depth_max_mm, 0, true},
		{"force_max_N", REAL_OR_NAN, &numbers->force_max_N, 0, true},
	};
	bool none; /* no force channel */
	int rc = 0;

	*numbers =
		(struct incise_recording_numbers){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
	for (size_t i = 0; i < sizeof(items) / sizeof(*items) && !rc; i++)
		rc = read_item(rec, &items[i], err);
	if (!rc)
		rc = read_tip(rec, err);
	if (rc)
		return rc;
	none = !bits && !info->force && info->full_scale_V == 0;
	/* No converter has more than 31 bits, and none has none; values within 1e±9 keep all results finite. */
	if ((!none && (bits < 1 || bits > 31 ||
		       !(info->full_scale_V > 1e-9 && info->full_scale_V < 1e9))) ||
	    !(fabs(info->offset_V) < 1e9) ||
	    !(fabs(info->force_mV_N) > 1e-9 && fabs(info->force_mV_N) < 1e9) ||
	    fabs(info->zero_mV) > 1e12)
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: the force channel in table meta has %llu bits, "
			"%g V from %g V, %g mV/N, zero %g mV, which is invalid",
			rec->path, (unsigned long long)bits, info->full_scale_V,
			info->offset_V, info->force_mV_N, info->zero_mV);
	info->bits = bits;
	info->complete = complete;
	info->newtons = newtons;
	return 0;
}

/* --- force --------------------------------------------------------------------------- */

void incise_recording_force(const struct incise_recording *rec,
			    const struct incise_calibration *given,
			    struct incise_recording_force *force)
{
	const struct incise_recording_info *meta = &rec->meta;
	double mV_N, zero_mV;

	/* A device in newtons was not calibrated in mV/N. */
	if (meta->newtons)
		given = NULL;
	mV_N = given ? given->force_mV_N : meta->force_mV_N;
	zero_mV = given && !isnan(given->force_zero_mV) ? given->force_zero_mV
							: meta->zero_mV;

	*force = (struct incise_recording_force){
		.n_per_code = meta->full_scale_V * 1e3 / (1LL << meta->bits) / mV_N,
		.zero_N = (zero_mV - meta->offset_V * 1e3) / mV_N,
		.top = (1LL << meta->bits) - 1,
	};
}

bool incise_recording_has_force(const struct incise_recording *rec)
{
	return rec->meta.bits > 0;
}

int incise_recording_need_zero(const struct incise_recording *rec,
			       const struct incise_recording_force *force,
			       struct incise_error *err)
{
	if (!isnan(force->zero_N))
		return 0;
	if (!incise_recording_has_force(rec))
		return incise_error_set(
			err, ENODATA,
			"%s: has no force channel, and this needs one; join it with a "
			"recording of the force (incise join), or export its poses "
			"(--resample --rate HZ, or -o FILE.mcap)",
			rec->path);
	return incise_error_set(err, EINVAL,
				"%s: ended before the zero of the force channel was "
				"known (0.5 s), so there is no force",
				rec->path);
}

/* --- tables streams and knots ---------------------------------------------------------- */

static bool take_stream(sqlite3_stmt *stmt, struct incise_stream *s)
{
	s->timestamped = sqlite3_column_int(stmt, 2);
	return take_recording_text(stmt, 0, true, s->name, sizeof(s->name)) && *s->name &&
	       take_recording_text(stmt, 1, true, s->device, sizeof(s->device)) &&
	       take_known(stmt, 3, 1, &s->nominal_hz) &&
	       take_known(stmt, 4, 1e-6, &s->delay_ms) &&
	       take_known(stmt, 5, 1e-6, &s->delay_sd_ms) &&
	       take_count(stmt, 6, &s->rows) && take_count(stmt, 7, &s->lost) &&
	       take_count(stmt, 8, &s->late) && take_known(stmt, 9, 1, &s->rate_hz) &&
	       take_known(stmt, 10, 1, &s->drift_ppm) &&
	       take_known(stmt, 11, 1, &s->drift_sd_ppm) &&
	       take_known(stmt, 12, 1e-6, &s->jitter_ms) &&
	       take_known(stmt, 13, 1e-6, &s->jitter_max_ms) &&
	       take_known(stmt, 14, 1e-6, &s->offset_ms) &&
	       take_known(stmt, 15, 1e-6, &s->offset_sd_ms) &&
	       take_recording_text(stmt, 16, true, s->ended, sizeof(s->ended)) &&
	       take_recording_text(stmt, 18, true, s->note, sizeof(s->note));
}

/* Table streams, and what the sources need of it. Returns the number of its rows, or -errno. */
static int read_table(struct incise_recording *rec, struct incise_error *err)
{
	sqlite3_stmt *stmt;
	int n = 0, rc;

	if (sqlite3_prepare_v2(
		    rec->db,
		    "SELECT name, device, stamped, nominal_hz, delay_ns, delay_sd_ns, "
		    "rows, lost, late, rate_hz, drift_ppm, drift_sd_ppm, jitter_ns, "
		    "jitter_max_ns, offset_ns, offset_sd_ns, ended, grain_ns, (SELECT "
		    "value FROM meta WHERE key = name || '_note') FROM streams ORDER BY "
		    "rowid",
		    -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(rec->db, rec->path, err);
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW && n < INCISE_STREAMS_MAX) {
		struct incise_stream *s = &rec->table[n++];

		if (!take_stream(stmt, s)) {
			n = damaged_recording(rec, "streams", "a value is out of range",
					      err);
			sqlite3_finalize(stmt);
			return n;
		}
		if (!strcmp(s->name, "tracker"))
			rec->own[INCISE_LEDGER_TRACKER].grain_ns =
				sqlite3_column_double(stmt, 17);
	}
	if (rc == SQLITE_ROW)
		n = damaged_recording(rec, "streams", "more rows than streams", err);
	else if (rc != SQLITE_DONE)
		n = incise_schema_fail(rec->db, rec->path, err);
	sqlite3_finalize(stmt);
	return n;
}

int incise_recording_streams(struct incise_recording *rec,
			     struct incise_stream streams[INCISE_STREAMS_MAX],
			     struct incise_error *err)
{
	int n = 0;

	if (!rec->session && rec->n_table < 0)
		rec->n_table = read_table(rec, err);
	if (!rec->session) {
		memcpy(streams, rec->table, sizeof(rec->table));
		for (int i = 0; i < rec->n_table && rec->recalibrated; i++)
			incise_recalibration_stream(&rec->recalibrated->calibration,
						    &streams[i]);
		return rec->n_table;
	}
	/* The streams of a joined recording: each is one of a member. */
	for (int i = 0; i < INCISE_STREAMS_MAX; i++) {
		struct incise_stream of_member[INCISE_STREAMS_MAX];
		int found =
			incise_recording_streams(rec->streams[i]->file, of_member, err);

		if (found < 0)
			return found;
		for (int k = 0; k < found; k++)
			if (!strcmp(of_member[k].name, incise_ledger_forms[i].stream))
				streams[n++] = of_member[k];
	}
	return n;
}

static bool take_knot(sqlite3_stmt *stmt, const struct incise_timeline_knot *last,
		      struct incise_timeline_knot *knot)
{
	int64_t seq = sqlite3_column_int64(stmt, 0);

	knot->seq = seq;
	knot->t_ns = sqlite3_column_int64(stmt, 1);
	knot->sd_ns = sqlite3_column_double(stmt, 2);
	knot->starts = sqlite3_column_int(stmt, 3);
	return sqlite3_column_type(stmt, 0) == SQLITE_INTEGER && seq >= 0 &&
	       sqlite3_column_type(stmt, 1) == SQLITE_INTEGER &&
	       knot->t_ns >= -TIME_MAX && knot->t_ns <= TIME_MAX &&
	       sqlite3_column_type(stmt, 2) == SQLITE_FLOAT && knot->sd_ns >= 0 &&
	       knot->sd_ns < 1e18 &&
	       (!last || (knot->seq > last->seq && knot->t_ns > last->t_ns));
}

static int read_knots(struct incise_stream_source *to, const char *stream,
		      struct incise_error *err)
{
	struct incise_recording *rec = to->file;
	sqlite3_stmt *stmt;
	int rc, n = 0;

	if (!to->knots)
		to->knots = calloc(INCISE_TIMELINE_KNOTS_MAX, sizeof(*to->knots));
	if (!to->knots)
		return incise_schema_no_memory(rec->path, err);
	if (sqlite3_prepare_v2(rec->db,
			       "SELECT seq, t_ns, sd_ns, begins FROM knots WHERE stream "
			       "= ? ORDER BY knot",
			       -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(rec->db, rec->path, err);
	sqlite3_bind_text(stmt, 1, stream, -1, SQLITE_STATIC);
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW) {
		if (n == INCISE_TIMELINE_KNOTS_MAX ||
		    !take_knot(stmt, n ? &to->knots[n - 1] : NULL, &to->knots[n])) {
			sqlite3_finalize(stmt);
			return damaged_recording(rec, "knots", "a row is invalid", err);
		}
		n++;
	}
	rc = rc == SQLITE_DONE ? 0 : incise_schema_fail(rec->db, rec->path, err);
	sqlite3_finalize(stmt);
	to->n_knots = n < 2 ? 0 : n;
	return rc;
}

/* Whether rows of the tracker can be off its line: then its rate is known, and they have no times of their own. */
static bool may_be_off(const struct incise_stream_source *source,
		       const struct incise_stream *row)
{
	const double hz = source->file->numbers.tracker_hz;

	return source->stream == INCISE_LEDGER_TRACKER && hz >= RATE_MIN &&
	       hz <= RATE_MAX && !row->timestamped &&
	       fabs(row->delay_ms) < DELAY_MAX_MS &&
	       (source->n_knots || !(row->nominal_hz > 0));
}

int incise_stream_resolve(struct incise_stream_source *source, struct incise_error *err)
{
	struct incise_recording *rec = source->file;
	const char *name = incise_ledger_forms[source->stream].stream;
	int rc;

	if (source->known)
		return 0;
	if (rec->n_table < 0)
		rec->n_table = read_table(rec, err);
	if (rec->n_table < 0)
		return rec->n_table;
	rc = read_knots(source, name, err);
	/* For a stream that is not in the table. */
	source->delay_ns = source->stream == INCISE_LEDGER_TRACKER
				   ? rec->numbers.tracker_latency_ns
				   : NAN;
	for (int i = 0; i < rec->n_table; i++) {
		const struct incise_stream *row = &rec->table[i];

		if (strcmp(row->name, name))
			continue;
		source->delay_ns = row->delay_ms * 1e6;
		source->delay_sd_ns = row->delay_sd_ms * 1e6;
		source->offset_sd_ns = row->offset_sd_ms * 1e6;
		if (may_be_off(source, row))
			source->period_ns = 1e9 / rec->numbers.tracker_hz;
	}
	if (!(source->grain_ns > 0 && source->grain_ns < DELAY_MAX_MS * 1e6))
		source->grain_ns = 0;
	if (rec->recalibrated)
		incise_recalibration_shift(&rec->recalibrated->calibration, source,
					   &source->shift_ns, &source->variance_ns2);
	source->known = !rc;
	return rc;
}

/* --- the recording ---------------------------------------------------------------------- */

static char *find_name(const char *folder)
{
	static const char *const ends[] = {".part", ".rec"};
	const char *slash = strrchr(folder, '/');
	const char *last = slash && slash[1] ? slash + 1 : folder;
	bool dots = !strcmp(last, ".") || !strcmp(last, "..");
	char *real = dots ? realpath(folder, NULL) : NULL, *name;

	last = real ? strrchr(real, '/') + 1 : last;
	name = strdup(last);
	free(real);
	for (int i = 0; i < 2 && name; i++) {
		size_t n = strlen(name), end = strlen(ends[i]);

		if (n > end && !strcmp(name + n - end, ends[i]))
			name[n - end] = 0;
	}
	return name;
}

struct incise_recording *incise_recording_new(char *folder)
{
	struct incise_recording *rec = calloc(1, sizeof(*rec));

	if (rec)
		rec->name = find_name(folder);
	if (!rec || !rec->name) {
		free(rec);
		free(folder);
		return NULL;
	}
	rec->path = folder;
	rec->n_table = -1;
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		rec->own[i].stream = i;
		rec->own[i].file = rec;
		rec->streams[i] = &rec->own[i];
	}
	return rec;
}

int incise_recording_read(struct incise_recording *rec, enum incise_recording_how how,
			  struct incise_error *err)
{
	int rc = incise_database_open(rec->path, &rec->db, err);

	/* SQLite checks pages as it reads them. */
	if (!rc &&
	    sqlite3_exec(rec->db, "PRAGMA cell_size_check=ON; BEGIN", NULL, NULL, NULL))
		rc = incise_schema_fail(rec->db, rec->path, err);
	if (!rc && incise_schema_is_joined(rec->db))
		return 1;
	if (!rc)
		rc = incise_schema_form(rec->db, rec->path, &rec->form, err);
	if (!rc)
		rc = rec->form == INCISE_SCHEMA_VERSION
			     ? incise_schema_check(rec->db, rec->path,
						   incise_schema_tables, err)
			     : incise_old_adopt(rec, how == INCISE_RECORDING_OLDER, err);
	if (!rc)
		rc = read_meta(rec, err);
	if (!rc && how == INCISE_RECORDING_ACTIVE)
		rc = incise_recalibration_apply(rec, err);
	if (!rc && rec->recalibrated)
		rc = read_meta(rec, err);
	/* Readers of a stream report what is damaged. */
	for (int i = 0; i < INCISE_LEDGER_FORMS && !rc; i++)
		incise_stream_resolve(&rec->own[i], NULL);
	return rc;
}

void incise_recording_free(struct incise_recording *rec)
{
	if (!rec)
		return;
	sqlite3_close(rec->db);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		free(rec->own[i].knots);
	free(rec->recalibrated);
	free(rec->path);
	free(rec->name);
	free(rec);
}
