// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Table wall of a recording; see incise/wall.h. The file is untrusted.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/wall.h>
#include "../ledger.h"
#include "../schema.h"
#include "recording.h"
#include "session.h"

#define POINTS_MAX 10000000 /* one a second for 115 days */

static bool take_text(sqlite3_stmt *stmt, int column, char to[INCISE_LEDGER_TEXT + 1])
{
	int type = sqlite3_column_type(stmt, column);
	const char *text = (const char *)sqlite3_column_text(stmt, column);

	if (type != SQLITE_TEXT || !text || strlen(text) > INCISE_LEDGER_TEXT)
		return false;
	strcpy(to, text);
	/* A terminal would obey control characters. */
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || (unsigned char)*c >= 0x7f)
			*c = '?';
	return true;
}

static bool take_point(sqlite3_stmt *stmt, struct incise_wall_point *point)
{
	static const int integers[] = {0, 1, 2, 6, 7};
	bool unknown = sqlite3_column_type(stmt, 3) == SQLITE_NULL;
	int64_t offset_s = sqlite3_column_int64(stmt, 6);

	for (size_t i = 0; i < sizeof(integers) / sizeof(*integers); i++)
		if (sqlite3_column_type(stmt, integers[i]) != SQLITE_INTEGER)
			return false;
	for (int i = 3; i < 6; i++)
		if (sqlite3_column_type(stmt, i) != SQLITE_FLOAT && !(i == 3 && unknown))
			return false;
	*point = (struct incise_wall_point){
		.t_ns = sqlite3_column_int64(stmt, 1),
		.tai_ns = sqlite3_column_int64(stmt, 2),
		.uncertainty_ns = unknown ? INFINITY : sqlite3_column_double(stmt, 3),
		.rate_ppb = sqlite3_column_double(stmt, 4),
		.rate_uncertainty_ppb = sqlite3_column_double(stmt, 5),
		.utc_offset_s = offset_s > INT32_MAX || offset_s < -INT32_MAX
					? INT32_MAX
					: (int)offset_s,
		.held = sqlite3_column_int(stmt, 7),
	};
	return take_text(stmt, 8, point->source) &&
	       take_text(stmt, 9, point->reference) && take_text(stmt, 10, point->leap) &&
	       take_text(stmt, 11, point->restart);
}

/* *@points is to be freed. Returns 0 or -errno. */
static int read_points(struct incise_recording *rec, sqlite3_stmt *stmt,
		       struct incise_wall_point **points, size_t *n,
		       struct incise_error *err)
{
	size_t capacity = 0;
	int rc;

	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW) {
		if (*n == capacity) {
			struct incise_wall_point *more;

			capacity = capacity ? 2 * capacity : 64;
			more = *n < POINTS_MAX
				       ? realloc(*points, capacity * sizeof(**points))
				       : NULL;
			if (!more)
				return incise_error_set(err, ENOMEM, "%s: out of memory",
							rec->path);
			*points = more;
		}
		if (!take_point(stmt, &(*points)[(*n)++]))
			return incise_error_set(err, EINVAL,
						"%s: damaged: table wall: a value is "
						"of another type",
						rec->path);
	}
	return rc == SQLITE_DONE ? 0 : incise_schema_fail(rec->db, rec->path, err);
}

struct incise_wall *incise_recording_wall(struct incise_recording *rec,
					  struct incise_error *err)
{
	const struct incise_ledger_form *form = &incise_ledger_forms[INCISE_LEDGER_WALL];
	struct incise_wall_point *points = NULL;
	struct incise_wall *wall = NULL;
	sqlite3_stmt *stmt = NULL;
	char *sql = NULL;
	size_t n = 0;
	int rc = 0;

	if (rec->session)
		return incise_session_wall(rec->session, err);
	if (rec->form >= 3) {
		sql = sqlite3_mprintf("SELECT %s FROM %s ORDER BY seq", form->columns,
				      form->table);
		if (!sql ||
		    sqlite3_prepare_v2(rec->db, sql, -1, &stmt, NULL) != SQLITE_OK)
			rc = incise_schema_fail(rec->db, rec->path, err);
		else
			rc = read_points(rec, stmt, &points, &n, err);
		sqlite3_finalize(stmt);
		sqlite3_free(sql);
	}
	if (!rc && !n)
		rc = incise_error_set(
			err, ENODATA, "%s: has no wall time: %s", rec->path,
			rec->form < 3 ? "it was made by an older incise"
				      : "its clock was simulated, or it was recorded "
					"without a clock source");
	if (!rc) {
		wall = incise_wall_new(points, n);
		if (!wall)
			rc = incise_error_set(err, errno,
					      errno == EINVAL
						      ? "%s: damaged: table wall: a "
							"value is out of range or order"
						      : "%s: out of memory",
					      rec->path);
	}
	free(points);
	if (rc)
		errno = -rc;
	return wall;
}
