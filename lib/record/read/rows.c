// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of a table and their best times; see rows.h. The file is untrusted.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "depth.h"
#include "recalibration.h"
#include "rows.h"
#include "../schema.h"

/* --- the clock of a session -------------------------------------------------------------- */

/* The piece of the line at or before a time, by a member of struct knot. */
static size_t find_piece(const struct incise_session_map *map, int64_t t_ns, bool inverse)
{
	size_t low = 0, high = map->n - 1;

	while (high - low > 1) {
		size_t middle = low + (high - low) / 2;
		const struct incise_session_knot *knot = &map->knots[middle];

		if ((inverse ? knot->to_ns : knot->t_ns) <= t_ns)
			low = middle;
		else
			high = middle;
	}
	return low;
}

static int64_t on_line(int64_t a, int64_t b, int64_t to_a, int64_t to_b, int64_t t)
{
	double slope = (double)(to_b - to_a) / (double)(b - a);
	/* The offset is exact, and only the small rest is rounded. */
	double rest = (double)(t - a) * (slope - 1);

	return to_a + (t - a) + llrint(fmax(fmin(rest, 1e18), -1e18));
}

int64_t incise_session_time(const struct incise_session_map *map, int64_t t_ns)
{
	const struct incise_session_knot *a;

	if (!map)
		return t_ns;
	a = &map->knots[find_piece(map, t_ns, false)];
	return on_line(a[0].t_ns, a[1].t_ns, a[0].to_ns, a[1].to_ns, t_ns);
}

int64_t incise_session_member_time(const struct incise_session_map *map, int64_t t_ns)
{
	const struct incise_session_knot *a;

	if (!map)
		return t_ns;
	a = &map->knots[find_piece(map, t_ns, true)];
	return on_line(a[0].to_ns, a[1].to_ns, a[0].t_ns, a[1].t_ns, t_ns);
}

double incise_session_bound(const struct incise_session_map *map, int64_t t_ns)
{
	const struct incise_session_knot *a;

	if (!map)
		return 0;
	a = &map->knots[find_piece(map, t_ns, false)];
	return fmax(a[0].bound_ns, a[1].bound_ns);
}

/*
 * --- rows of the tracker that are not on its line, see ../time/fit.h -------------------------
 *
 * They are found as they are asked for: from a part of the stream and its surroundings, so that memory does not grow
 * with the recording.
 *
 *     numbers   |◄─────────── rows that are fitted ───────────►|
 *                     |◄───── rows that are answered ────►|
 */

/* Numbers that are answered at once, and those that are fitted on either side. */
#define PART 32768
#define BESIDE 4096
#define ARRIVAL_MAX (INT64_MAX / 2)

struct incise_others {
	struct incise_recording *recording;
	struct incise_fit_setup setup;
	uint64_t first, last; /* numbers of the stream */
	uint64_t part;	      /* that the times are of; UINT64_MAX: none yet */
	struct incise_fit_row *rows;
	struct incise_fit_time *times;
	size_t n;
};

static void free_others(struct incise_others *others)
{
	if (!others)
		return;
	free(others->rows);
	free(others->times);
	free(others);
}

/* NULL: no memory; errors of the rows are their reader's. */
static struct incise_others *new_others(const struct incise_stream_source *source)
{
	struct incise_recording *recording = source->file;
	struct incise_others *others = calloc(1, sizeof(*others));
	int64_t seq = 0, t_ns;

	if (!others)
		return NULL;
	others->rows = malloc((PART + 2 * BESIDE) * sizeof(*others->rows));
	others->recording = recording;
	others->setup = (struct incise_fit_setup){
		.knots = source->knots,
		.n_knots = source->n_knots,
		.period_ns = source->period_ns,
		.delay_ns = llrint(source->delay_ns),
		.delay_sd_ns = isnan(source->delay_sd_ns) ? 0 : source->delay_sd_ns,
		.grain_ns = source->grain_ns,
	};
	others->part = UINT64_MAX;
	if (incise_source_end(recording, "tracker", false, &seq, &t_ns, NULL, NULL) > 0)
		others->first = (uint64_t)(seq > 0 ? seq : 0);
	if (incise_source_end(recording, "tracker", true, &seq, &t_ns, NULL, NULL) > 0)
		others->last = (uint64_t)(seq > 0 ? seq : 0);
	if (others->rows)
		return others;
	free_others(others);
	return NULL;
}

/* Rows of numbers from @from to before @end, up to one that cannot be: its reader reports that. */
static size_t read_rows(struct incise_others *others, uint64_t from, uint64_t end)
{
	struct incise_source source;
	const struct incise_batch *batch = &source.batch;
	size_t n = 0;
	int rc = incise_source_open_at(&source, others->recording, INCISE_LEDGER_TRACKER,
				       (int64_t)from, NULL);

	while (!rc && incise_source_next(&source, NULL) > 0)
		for (size_t i = 0; i < batch->n && !rc; i++) {
			const uint64_t seq = (uint64_t)batch->column[0].i[i];
			const int64_t arrival_ns = batch->column[2].i[i];

			if (seq < from)
				continue;
			rc = seq >= end || arrival_ns < 0 || arrival_ns > ARRIVAL_MAX ||
			     (n && (arrival_ns < others->rows[n - 1].arrival_ns ||
				    seq <= others->rows[n - 1].seq));
			if (!rc)
				others->rows[n++] =
					(struct incise_fit_row){seq, arrival_ns};
		}
	incise_source_close(&source);
	return n;
}

static void load_part(struct incise_others *others, uint64_t part)
{
	const uint64_t begin = others->first + part * PART;
	const uint64_t before = begin - others->first;
	int64_t found;

	free(others->times);
	others->times = NULL;
	others->part = part;
	found = incise_fit(&others->setup, others->rows,
			   read_rows(others, begin - (before < BESIDE ? before : BESIDE),
				     begin + PART + BESIDE),
			   &others->times);
	others->n = found > 0 ? (size_t)found : 0;
}

/* The first of a part from a number on; those beside it are of other parts. */
static const struct incise_fit_time *find_from(const struct incise_others *others,
					       uint64_t seq)
{
	const uint64_t end = others->first + (others->part + 1) * PART;
	size_t low = 0, high = others->n;

	while (low < high) {
		size_t middle = low + (high - low) / 2;

		if (others->times[middle].seq < seq)
			low = middle + 1;
		else
			high = middle;
	}
	return low < others->n && others->times[low].seq < end ? &others->times[low]
							       : NULL;
}

/* The row of this number among them, or NULL. In order it is read once. */
static const struct incise_fit_time *find_in_others(struct incise_others *others,
						    uint64_t seq)
{
	const struct incise_fit_time *found;

	if (seq < others->first || seq > others->last)
		return NULL;
	if ((seq - others->first) / PART != others->part)
		load_part(others, (seq - others->first) / PART);
	found = find_from(others, seq);
	return found && found->seq == seq ? found : NULL;
}

/* The number of the first row from @seq on; UINT64_MAX: there is none. */
static uint64_t row_from(struct incise_others *others, uint64_t seq)
{
	struct incise_source source;
	uint64_t found = UINT64_MAX;

	if (!incise_source_open_at(&source, others->recording, INCISE_LEDGER_TRACKER,
				   (int64_t)seq, NULL) &&
	    incise_source_next(&source, NULL) > 0)
		for (size_t i = 0; i < source.batch.n && found == UINT64_MAX; i++)
			if ((uint64_t)source.batch.column[0].i[i] >= seq)
				found = (uint64_t)source.batch.column[0].i[i];
	incise_source_close(&source);
	return found;
}

const struct incise_fit_time *incise_row_times_other(const struct incise_row_times *times,
						     uint64_t seq)
{
	struct incise_others *others = times->others;

	if (!others)
		return NULL;
	seq = seq < others->first ? others->first : seq;
	while (seq <= others->last) {
		const uint64_t part = (seq - others->first) / PART;
		const struct incise_fit_time *found;

		if (part != others->part)
			load_part(others, part);
		found = find_from(others, seq);
		if (found)
			return found;
		/* Numbers may be far apart. */
		seq = row_from(others, others->first + (part + 1) * PART);
	}
	return NULL;
}

/* --- times ------------------------------------------------------------------------- */

#define TIME_MAX (INT64_MAX / 4) /* 73 years; sums and differences do not overflow */

int incise_row_times_open(struct incise_row_times *times,
			  struct incise_recording *recording, const char *table,
			  struct incise_error *err)
{
	const int stream = incise_source_find(table);
	struct incise_stream_source *source;
	int rc;

	*times = (struct incise_row_times){
		.may_repeat = true,
		.own_ns = -TIME_MAX - 1,
		.last_ns = INCISE_TIME_NONE,
		.map = recording->own->map,
		/* Events of a session are on its clock already. */
		.least_ns = recording->session ? -TIME_MAX : 0,
	};
	if (stream < 0)
		return 0;
	source = incise_source_stream(recording, stream);
	times->may_repeat = false;
	times->map = source->map;
	times->least_ns = 0;
	rc = incise_stream_resolve(source, err);
	if (rc)
		return rc;
	times->source = source;
	times->shift_ns = source->shift_ns;
	times->variance_ns2 = source->variance_ns2;
	if (source->period_ns > 0)
		times->others = new_others(source);
	return source->period_ns > 0 && !times->others
		       ? incise_schema_no_memory(recording->path, err)
		       : 0;
}

void incise_row_times_close(struct incise_row_times *times)
{
	free_others(times->others);
	times->others = NULL;
}

void incise_row_times_calibrate(struct incise_row_times *times,
				const struct incise_calibration *calibration)
{
	if (times->source)
		incise_recalibration_shift(calibration, times->source, &times->shift_ns,
					   &times->variance_ns2);
}

/* The row among the others, or NULL. */
static const struct incise_fit_time *find_other(const struct incise_row_times *times,
						uint64_t seq)
{
	return times->others ? find_in_others(times->others, seq) : NULL;
}

int64_t incise_row_times_line(const struct incise_row_times *times, uint64_t seq,
			      int64_t t_ns)
{
	const struct incise_fit_time *other = find_other(times, seq);
	const int n = times->source ? times->source->n_knots : 0;

	if (other)
		return n ? other->t_ns : t_ns - llrint(other->held_ns);
	return n ? incise_timeline_at(times->source->knots, n, seq) : t_ns;
}

double incise_row_times_line_sd(const struct incise_row_times *times, uint64_t seq)
{
	const struct incise_fit_time *other = find_other(times, seq);
	const int n = times->source ? times->source->n_knots : 0;

	if (other)
		return other->sd_ns;
	return n ? incise_timeline_sd(times->source->knots, n, seq) : NAN;
}

bool incise_row_times_next(struct incise_row_times *times, int64_t seq, int64_t t_ns,
			   int64_t *best_ns)
{
	int64_t best;

	if (t_ns < times->least_ns || t_ns > TIME_MAX || t_ns < times->own_ns ||
	    (t_ns == times->own_ns && !times->may_repeat))
		return false;
	times->own_ns = t_ns;
	best = incise_row_times_line(times, seq, t_ns) + times->shift_ns;
	best = incise_session_time(times->map, best);
	best = best > TIME_MAX ? TIME_MAX : best < -TIME_MAX ? -TIME_MAX : best;
	if (times->last_ns != INCISE_TIME_NONE &&
	    best < times->last_ns + !times->may_repeat)
		best = times->last_ns + !times->may_repeat;
	times->last_ns = *best_ns = best;
	return true;
}

static double known(double value, double otherwise)
{
	return isnan(value) ? otherwise : value;
}

double incise_row_times_sd(const struct incise_row_times *times, int64_t seq)
{
	const struct incise_stream_source *source = times->source;
	double on_line_ns = incise_row_times_line_sd(times, seq);
	double sd_ns =
		source && source->n_knots
			? on_line_ns
			: known(source ? source->offset_sd_ns : 0, known(on_line_ns, 0));
	/* The error is bounded, and as likely anywhere within. */
	double map_ns = times->map ? incise_session_bound(times->map, times->own_ns) : 0;
	double variance = sd_ns * sd_ns + times->variance_ns2 + map_ns * map_ns / 3;

	return variance > 0 ? sqrt(variance) * 1e-9 : 0;
}

double incise_row_share(int64_t a_ns, int64_t b_ns, int64_t t_ns)
{
	if (a_ns == INCISE_TIME_NONE || b_ns == INCISE_TIME_NONE || t_ns < a_ns ||
	    b_ns - a_ns > INCISE_DEPTH_GAP_NS)
		return NAN;
	return (double)(t_ns - a_ns) / (b_ns - a_ns);
}

/* --- rows -------------------------------------------------------------------------- */

#define EVENTS "rowid, t_ns, kind, text"

/* The place of a name in a list with ", " between. */
static int place_of(const char *list, const char *name, size_t length)
{
	int i = 0;

	while (strncmp(list, name, length) || (list[length] != ',' && list[length])) {
		list = strchr(list, ' ') + 1;
		i++;
	}
	return i;
}

int incise_rows_open(struct incise_rows *rows, struct incise_recording *recording,
		     const char *table, const char *columns, uint64_t expected,
		     struct incise_error *err)
{
	const int stream = incise_source_find(table);
	const char *all = stream < 0 ? EVENTS : incise_source_form(stream)->columns;
	int rc, n = 0;

	if (stream >= 0)
		recording = incise_source_stream(recording, stream)->file;
	*rows = (struct incise_rows){
		.recording = recording,
		.table = table,
		/* An interrupted recording has counted fewer depths than its poses give. */
		.expected = stream == INCISE_SOURCE_DEPTH || recording->range.limited ||
					    recording->range.every_ns
				    ? UINT64_MAX
				    : expected,
		.every_ns = recording->range.every_ns,
		.pass_ns = INT64_MIN / 2,
		.begin_ns =
			recording->range.limited ? recording->range.begin_ns : INT64_MIN,
		.end_ns = recording->range.limited ? recording->range.end_ns : INT64_MAX,
		.t_ns = INCISE_TIME_NONE,
	};
	for (const char *name = columns; *name && n < INCISE_ROWS_COLUMNS;) {
		size_t length = strcspn(name, ",");

		rows->column[n++] = place_of(all, name, length);
		name += length + strspn(name + length, ", ");
	}
	if (stream >= 0)
		rc = incise_source_open_at(
			&rows->source, recording, stream,
			recording->range.limited
				? incise_source_seek(recording, table,
						     recording->range.begin_ns)
				: INT64_MIN,
			err);
	else
		rc = sqlite3_prepare_v2(recording->db,
					"SELECT " EVENTS
					" FROM events ORDER BY t_ns, rowid",
					-1, &rows->stmt, NULL) == SQLITE_OK
			     ? 0
			     : incise_schema_fail(recording->db, recording->path, err);
	if (!rc)
		rc = incise_row_times_open(&rows->times, recording, table, err);
	/* An overview does not look for rows off the line, which costs more than it reads. */
	if (rows->every_ns)
		incise_row_times_close(&rows->times);
	return rc;
}

static int64_t own_ns(const struct incise_rows *rows)
{
	return rows->stmt ? sqlite3_column_int64(rows->stmt, 1)
			  : rows->source.batch.column[1].i[rows->at];
}

/* To the next row of the batch, of the next batch, or of events: 1, 0, -errno. */
static int step_rows(struct incise_rows *rows, struct incise_error *err)
{
	int rc;

	if (!rows->stmt) {
		if (rows->live && ++rows->at < rows->source.batch.n)
			return 1;
		if (rows->live && rows->every_ns) {
			rows->pass_ns += rows->every_ns;
			rows->at--; /* at the last row */
			if (rows->pass_ns < own_ns(rows))
				rows->pass_ns = own_ns(rows);
			rc = incise_source_pass(&rows->source, rows->pass_ns, err);
			if (rc)
				return rc;
		}
		rows->at = 0;
		return incise_source_next(&rows->source, err);
	}
	rc = sqlite3_step(rows->stmt);
	if (rc != SQLITE_ROW && rc != SQLITE_DONE)
		return incise_schema_fail(rows->recording->db, rows->recording->path,
					  err);
	return rc == SQLITE_ROW;
}

int incise_rows_first(const struct incise_rows *rows, int64_t *first_ns,
		      struct incise_error *err)
{
	struct incise_row_times times = rows->times; /* as before the first row */
	int64_t seq = 0, t_ns = 0;
	int rc = incise_source_end(rows->recording, rows->table, false, &seq, &t_ns, NULL,
				   err);

	if (rc > 0 && !incise_row_times_next(&times, seq, t_ns, first_ns))
		*first_ns = t_ns; /* reading the row reports the damage */
	return rc < 0 ? rc : 0;
}

/* Take events of these types only; the batch has checked a stream's rows. */
static bool take_rows(struct incise_rows *rows)
{
	if (rows->stmt && (sqlite3_column_type(rows->stmt, 1) != SQLITE_INTEGER ||
			   sqlite3_column_type(rows->stmt, 2) != SQLITE_TEXT ||
			   sqlite3_column_type(rows->stmt, 3) != SQLITE_TEXT))
		return false;
	return incise_row_times_next(&rows->times, incise_rows_seq(rows), own_ns(rows),
				     &rows->t_ns);
}

int incise_rows_next(struct incise_rows *rows, struct incise_error *err)
{
	const char *path = rows->recording->path;
	int rc = 0;

	/* Behind the end another step would begin anew, or go on behind a range. */
	rows->ended |= rows->live && own_ns(rows) > rows->end_ns;
	if (!rows->ended)
		rc = step_rows(rows, err);

	/* Rows of the first block come before, or rows that a filter needs. */
	while (rc > 0 && own_ns(rows) < rows->begin_ns) {
		rows->live = true;
		rc = step_rows(rows, err);
	}
	rows->live = false;
	rows->ended |= !rc;
	if (rc < 0)
		return rc;
	if (!rc) {
		if (rows->expected == UINT64_MAX || rows->n == rows->expected)
			return 0;
		return incise_error_set(err, EINVAL,
					"%s: damaged: table %s has %llu rows of %llu",
					path, rows->table, (unsigned long long)rows->n,
					(unsigned long long)rows->expected);
	}
	/* A row that cannot be is passed, as a block is. */
	rows->live = true;
	if (!take_rows(rows))
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: table %s, row %lld: its time is "
			"impossible; `incise verify %s` lists what is damaged",
			path, rows->table, (long long)incise_rows_seq(rows), path);
	rows->n++;
	return 1;
}

int64_t incise_rows_int(const struct incise_rows *rows, int column)
{
	const int at = rows->column[column];

	return rows->stmt ? sqlite3_column_int64(rows->stmt, at)
			  : rows->source.batch.column[at].i[rows->at];
}

double incise_rows_real(const struct incise_rows *rows, int column)
{
	return rows->source.batch.column[rows->column[column]].r[rows->at];
}

char incise_rows_char(const struct incise_rows *rows, int column)
{
	return rows->source.batch.column[rows->column[column]].c[rows->at];
}

const char *incise_rows_text(const struct incise_rows *rows, int column, size_t *n)
{
	const int at = rows->column[column];

	if (n)
		*n = sqlite3_column_bytes(rows->stmt, at);
	return (const char *)sqlite3_column_text(rows->stmt, at);
}

int64_t incise_rows_seq(const struct incise_rows *rows)
{
	return rows->stmt ? sqlite3_column_int64(rows->stmt, 0)
			  : rows->source.batch.column[0].i[rows->at];
}

void incise_rows_close(struct incise_rows *rows)
{
	incise_source_close(&rows->source);
	incise_row_times_close(&rows->times);
	sqlite3_finalize(rows->stmt);
	rows->stmt = NULL;
}
