// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Opening a session; see session.h. Its database is untrusted, like those of its members.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/seal.h>
#include "../../base/crc32c.h"
#include "../../base/grow.h"
#include "../ledger.h"
#include "../old/old.h"
#include "../schema.h"
#include "database.h"
#include "rows.h"
#include "session.h"

#define TIME_MAX (INT64_MAX / 4) /* of rows.c */
#define BOUND_MAX 1e18
#define SLEWS 0.25

const char *const incise_session_tables[] = {
	"CREATE TABLE session(key TEXT PRIMARY KEY NOT NULL, value)",
	"CREATE TABLE members(member INTEGER PRIMARY KEY, name TEXT NOT NULL, "
	"host TEXT NOT NULL, method TEXT NOT NULL, ledger TEXT NOT NULL, "
	"matches INTEGER NOT NULL, agreement_ns REAL, agreement_bound_ns REAL)",
	"CREATE TABLE maps(member INTEGER NOT NULL, knot INTEGER NOT NULL, "
	"t_ns INTEGER NOT NULL, session_ns INTEGER NOT NULL, bound_ns REAL NOT NULL, "
	"PRIMARY KEY(member, knot)) WITHOUT ROWID",
	NULL,
};

/* --- identity ------------------------------------------------------------------------ */

char *incise_session_identity(struct incise_recording *recording)
{
	struct incise_seal_head head;
	char identity[33], *text;

	if (recording->old)
		return recording->old->identity(recording);
	if (incise_seal_head(recording, identity, &head, NULL) ||
	    asprintf(&text, "%s:%lld:%s", identity, (long long)head.commit, head.head) <
		    0)
		return NULL;
	return text;
}

static void add_value(uint32_t *crc, sqlite3_stmt *stmt, int column)
{
	const unsigned char *text = sqlite3_column_text(stmt, column);
	int n = sqlite3_column_bytes(stmt, column);

	*crc = incise_crc32c(*crc, text ? text : (const unsigned char *)"",
			     text ? (size_t)n + 1 : 1);
}

int incise_session_seal(sqlite3 *db, uint32_t *crc)
{
	static const char *const all[] = {
		"SELECT key, value FROM session WHERE key <> 'seal' ORDER BY key",
		"SELECT member, name, host, method, ledger, matches, agreement_ns, "
		"agreement_bound_ns FROM members ORDER BY member",
		"SELECT member, knot, t_ns, session_ns, bound_ns FROM maps ORDER BY "
		"member, knot",
	};
	int rc = SQLITE_OK;

	*crc = 0;
	for (size_t i = 0; i < sizeof(all) / sizeof(*all) && rc == SQLITE_OK; i++) {
		sqlite3_stmt *stmt;

		rc = sqlite3_prepare_v2(db, all[i], -1, &stmt, NULL);
		while (rc == SQLITE_OK && sqlite3_step(stmt) == SQLITE_ROW)
			for (int k = 0; k < sqlite3_column_count(stmt); k++)
				add_value(crc, stmt, k);
		if (rc == SQLITE_OK)
			rc = sqlite3_finalize(stmt);
	}
	return rc;
}

/* --- members ------------------------------------------------------------------------- */

static int damaged_session(const char *folder, const char *what, struct incise_error *err)
{
	return incise_error_set(
		err, EINVAL, "%s: damaged joined recording: %s; join its members again",
		folder, what);
}

/* A text of a row; false: it has none, or it is too long. */
static bool take(sqlite3_stmt *stmt, int column, char *to, size_t size)
{
	const char *text = (const char *)sqlite3_column_text(stmt, column);

	if (!text || strlen(text) >= size)
		return false;
	for (const char *c = text; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f ||
		    ((unsigned char)*c == 0xc2 && (c[1] & 0xe0) == 0x80)) /* of Latin-1 */
			return false;
	strcpy(to, text);
	return true;
}

/* The name of a member is that of a folder in the session, and stands behind ':' and '='. */
static bool is_name(const char *name)
{
	return *name && *name != '.' && !strpbrk(name, "/:=,");
}

static double real_or_nan(sqlite3_stmt *stmt, int column)
{
	return sqlite3_column_type(stmt, column) == SQLITE_FLOAT
		       ? sqlite3_column_double(stmt, column)
		       : NAN;
}

/* Version, tables and checksum. */
static int check_session(sqlite3 *db, const char *folder, struct incise_error *err)
{
	const int64_t version = incise_schema_ask(db, 0, "PRAGMA user_version");
	uint32_t crc = 0;

	if (version > INCISE_SESSION_VERSION)
		return incise_error_set(
			err, EINVAL,
			"%s: made by a newer incise (joined recording of version "
			"%lld, this one reads up to %d); use that version",
			folder, (long long)version, INCISE_SESSION_VERSION);
	for (int i = 0; incise_session_tables[i]; i++)
		if (!incise_schema_ask(db, 0,
				       "SELECT 1 FROM sqlite_master WHERE type = 'table' "
				       "AND sql = %Q",
				       incise_session_tables[i]))
			return damaged_session(folder, "a table is missing or altered",
					       err);
	if (incise_session_seal(db, &crc) != SQLITE_OK)
		return incise_schema_fail(db, folder, err);
	return incise_schema_ask(db, -1,
				 "SELECT value FROM session WHERE key = 'seal'") == crc
		       ? 0
		       : damaged_session(folder,
					 "its tables are not as they were written", err);
}

/* Open a member, and see that it is the one that was joined. */
static int open_member(struct incise_session *session, const char *folder,
		       const char *ledger, struct incise_error *err)
{
	int at = session->n;
	const char *name = session->info[at].name;
	char *path = NULL, *own, *identity = NULL;
	int rc = 0;

	if (asprintf(&path, "%s/%s", folder, name) < 0)
		return incise_schema_no_memory(folder, err);
	own = incise_recording_folder(path, NULL);
	session->members[at] = own ? incise_recording_new(own) : NULL;
	session->n += session->members[at] != NULL;
	if (!session->members[at])
		rc = errno == ENOENT
			     ? incise_error_set(err, ENOENT,
						"%s: member %s is missing in its folder; "
						"join again",
						folder, name)
			     : incise_schema_no_memory(folder, err);
	if (!rc)
		rc = incise_recording_read(session->members[at], INCISE_RECORDING_ACTIVE,
					   err);
	if (rc == 1)
		rc = damaged_session(folder, "a member is a joined recording itself",
				     err);
	if (!rc) {
		identity = incise_session_identity(session->members[at]);
		if (!identity || strcmp(identity, ledger))
			rc = incise_error_set(
				err, EINVAL,
				"%s: member %s is not the recording that was joined, or "
				"was altered since; join again",
				folder, name);
	}
	free(identity);
	free(path);
	return rc;
}

static int read_members(struct incise_session *session, sqlite3 *db, const char *folder,
			struct incise_error *err)
{
	sqlite3_stmt *stmt;
	int rc = 0, step;

	if (sqlite3_prepare_v2(
		    db,
		    "SELECT name, host, method, ledger, matches, agreement_ns, "
		    "agreement_bound_ns FROM members ORDER BY member",
		    -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(db, folder, err);
	while (!rc && (step = sqlite3_step(stmt)) == SQLITE_ROW) {
		struct incise_session_info *info = &session->info[session->n];
		const char *ledger = (const char *)sqlite3_column_text(stmt, 3);

		if (session->n == INCISE_SESSION_MEMBERS_MAX ||
		    !take(stmt, 0, info->name, sizeof(info->name)) ||
		    !is_name(info->name) ||
		    !take(stmt, 1, info->host, sizeof(info->host)) ||
		    !take(stmt, 2, info->method, sizeof(info->method)) || !ledger) {
			rc = damaged_session(folder, "a row of table members is invalid",
					     err);
			break;
		}
		info->matches = sqlite3_column_int(stmt, 4);
		info->agreement_ns = real_or_nan(stmt, 5);
		info->agreement_bound_ns = real_or_nan(stmt, 6);
		rc = open_member(session, folder, ledger, err);
	}
	sqlite3_finalize(stmt);
	if (!rc && session->n < 2)
		rc = damaged_session(folder, "it has less than two members", err);
	return rc;
}

static bool good_knot(const struct incise_session_knot *knot, size_t n)
{
	double apart_ns, span_ns = 0, bound_ns = 0;

	/* Two clocks that are slewed are within 20 % of each other, and a knot within its bound. */
	if (n) {
		span_ns = (double)knot->t_ns - (double)knot[-1].t_ns;
		bound_ns = knot[-1].bound_ns + knot->bound_ns + 1;
	}
	apart_ns = n ? (double)knot->to_ns - (double)knot[-1].to_ns - span_ns : 0;
	return knot->t_ns >= 0 && knot->t_ns <= TIME_MAX && knot->to_ns >= -TIME_MAX &&
	       knot->to_ns <= TIME_MAX && knot->bound_ns >= 0 &&
	       knot->bound_ns <= BOUND_MAX &&
	       (!n || (knot->t_ns > knot[-1].t_ns && knot->to_ns > knot[-1].to_ns &&
		       fabs(apart_ns) <= SLEWS * span_ns + bound_ns));
}

static int read_map(struct incise_session *session, int member, sqlite3 *db,
		    const char *folder, struct incise_error *err)
{
	struct incise_session_map *map = &session->maps[member];
	sqlite3_stmt *stmt;
	size_t capacity = 0;
	int rc = 0;

	if (sqlite3_prepare_v2(db,
			       "SELECT t_ns, session_ns, bound_ns FROM maps WHERE member "
			       "= ? ORDER BY knot",
			       -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(db, folder, err);
	sqlite3_bind_int(stmt, 1, member);
	while (!rc && sqlite3_step(stmt) == SQLITE_ROW) {
		if (!grow_array(&map->knots, map->n, &capacity, 16,
				sizeof(*map->knots))) {
			rc = incise_schema_no_memory(folder, err);
			break;
		}
		map->knots[map->n] = (struct incise_session_knot){
			sqlite3_column_int64(stmt, 0),
			sqlite3_column_int64(stmt, 1),
			sqlite3_column_double(stmt, 2),
		};
		if (map->n == INCISE_SESSION_KNOTS_MAX ||
		    !good_knot(&map->knots[map->n], map->n))
			rc = damaged_session(folder, "a row of table maps is invalid",
					     err);
		map->n++;
	}
	sqlite3_finalize(stmt);
	if (!rc && map->n < 2)
		rc = damaged_session(folder, "the map of a clock is missing", err);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		session->members[member]->own[i].map = map;
	return rc;
}

/* --- what they have ------------------------------------------------------------------ */

/* Describe a member; the ones before it are described. */
static void describe_session(struct incise_session *session, int at)
{
	struct incise_session_info *info = &session->info[at];
	struct incise_recording *member = session->members[at];
	const struct incise_session_map *map = &session->maps[at];
	int64_t first_ns = INT64_MAX, last_ns = -1, others_first = INT64_MAX,
		others_last = INT64_MIN;

	for (int i = 0; i < INCISE_STREAMS_MAX; i++) {
		int64_t first, last;

		if (!incise_source_span(member, incise_ledger_forms[i].table, &first,
					&last))
			continue;
		first_ns = first < first_ns ? first : first_ns;
		last_ns = last > last_ns ? last : last_ns;
		if (*info->streams)
			strcat(info->streams, ", ");
		strcat(info->streams, incise_ledger_forms[i].stream);
	}
	info->complete = member->meta.complete;
	info->first_ns = info->last_ns = -1;
	for (size_t i = 0; i < map->n; i++)
		info->uncertainty_ns = fmax(info->uncertainty_ns, map->knots[i].bound_ns);
	info->offset_ns = map->knots[0].to_ns - map->knots[0].t_ns;
	if (last_ns < 0)
		return;
	info->first_ns = incise_session_time(map, first_ns);
	info->last_ns = incise_session_time(map, last_ns);
	info->offset_ns = info->first_ns - first_ns;
	if (last_ns > first_ns)
		info->rate_ppm = 1e6 * ((double)(info->last_ns - info->first_ns) /
						(double)(last_ns - first_ns) -
					1);
	for (int i = 0; i < at; i++) {
		const struct incise_session_info *other = &session->info[i];

		if (other->last_ns < 0)
			continue;
		others_first =
			other->first_ns < others_first ? other->first_ns : others_first;
		others_last = other->last_ns > others_last ? other->last_ns : others_last;
	}
	if (others_first > others_last)
		return;
	info->overlap_ns =
		(info->last_ns < others_last ? info->last_ns : others_last) -
		(info->first_ns > others_first ? info->first_ns : others_first);
}

static bool has_session_stream(const struct incise_session_info *info, int stream)
{
	return strstr(info->streams, incise_ledger_forms[stream].stream) != NULL;
}

/* --- the choice ---------------------------------------------------------------------- */

static int find_member(const struct incise_session *session, const char *name,
		       size_t length)
{
	for (int i = 0; i < session->n; i++)
		if (strlen(session->info[i].name) == length &&
		    !strncmp(session->info[i].name, name, length))
			return i;
	return -1;
}

static int find_stream(const char *name, size_t length)
{
	for (int i = 0; i < INCISE_STREAMS_MAX; i++)
		if (strlen(incise_ledger_forms[i].stream) == length &&
		    !strncmp(incise_ledger_forms[i].stream, name, length))
			return i;
	return -1;
}

/* "a, b": the members with a stream, or all with -1; to be freed. */
static char *list_session(const struct incise_session *session, int stream,
			  const char *between)
{
	char *text = strdup("");

	for (int i = 0; i < session->n && text; i++) {
		char *before = text;

		if (stream >= 0 && !has_session_stream(&session->info[i], stream))
			continue;
		if (asprintf(&text, "%s%s%s", before, *before ? between : "",
			     session->info[i].name) < 0)
			text = NULL;
		free(before);
	}
	return text;
}

/* One part of a choice: "b", or "force=a". */
static int take_part(struct incise_session *session, const char *part, size_t length,
		     const char *folder, struct incise_error *err)
{
	const char *equals = memchr(part, '=', length);
	const char *name = equals ? equals + 1 : part;
	size_t n = length - (size_t)(name - part);
	int member = find_member(session, name, n);
	int stream = equals ? find_stream(part, (size_t)(equals - part)) : -1;
	char *names;

	if (member >= 0 && equals && stream < 0)
		return incise_error_set(
			err, EINVAL,
			"%s: no stream '%.*s'; there are: force, tracker, "
			"camera",
			folder, (int)(equals - part), part);
	if (member >= 0 && equals && !has_session_stream(&session->info[member], stream))
		return incise_error_set(err, EINVAL,
					"%s: member %.*s has no %s; it has: %s", folder,
					(int)n, name, incise_ledger_forms[stream].stream,
					session->info[member].streams);
	if (member < 0) {
		names = list_session(session, -1, ", ");
		incise_error_set(err, EINVAL, "%s: no member '%.*s'; there are: %s",
				 folder, (int)n, name, names ? names : "");
		free(names);
		return -EINVAL;
	}
	for (int i = 0; i < INCISE_STREAMS_MAX; i++)
		if ((i == stream || (stream < 0 && session->of[i] < 0)) &&
		    has_session_stream(&session->info[member], i))
			session->of[i] = member;
	return 0;
}

/* Choose the member of each stream: by the choice, else the only one that has it. */
static int choose_session(struct incise_session *session, const char *folder,
			  const char *choice, struct incise_error *err)
{
	bool any = false;
	int rc = 0;

	for (int i = 0; i < INCISE_STREAMS_MAX; i++)
		session->of[i] = -1;
	while (!rc && *choice) {
		size_t n = strcspn(choice, ",");

		if (n == 1 && *choice == '*')
			any = true;
		else
			rc = take_part(session, choice, n, folder, err);
		choice += n + (choice[n] == ',');
	}
	for (int i = 0; i < INCISE_STREAMS_MAX && !rc; i++) {
		int n = 0, first = 0;
		char *names;

		for (int k = session->n - 1; k >= 0; k--)
			if (has_session_stream(&session->info[k], i)) {
				n++;
				first = k;
			}
		if (session->of[i] < 0 && n > 1 && !any) {
			names = list_session(session, i, " and ");
			rc = incise_error_set(
				err, EINVAL,
				"%s: %s was recorded by %s; choose one: %s:%s for all "
				"that it has, or %s:%s=%s",
				folder, incise_ledger_forms[i].stream, names ? names : "",
				folder, session->info[first].name, folder,
				incise_ledger_forms[i].stream, session->info[first].name);
			free(names);
		} else if (session->of[i] < 0) {
			session->of[i] = first;
		}
	}
	return rc;
}

/* --- a recording of them ------------------------------------------------------------- */

/* Whether a stream is read from a member. */
static bool is_chosen(const struct incise_session *session, int member)
{
	for (int i = 0; i < INCISE_STREAMS_MAX; i++)
		if (session->of[i] == member &&
		    has_session_stream(&session->info[member], i))
			return true;
	return false;
}

/* The rig that the streams are of; of several, each behind the name of its member. */
static void merge_rigs(const struct incise_session *session,
		       struct incise_recording_info *to)
{
	int64_t first_ns = INT64_MAX;
	int n = 0;
	size_t length = 0;

	for (int i = 0; i < session->n; i++)
		n += is_chosen(session, i);
	for (int i = 0; i < session->n; i++) {
		const struct incise_recording_info *meta = &session->members[i]->meta;

		if (!is_chosen(session, i))
			continue;
		if (session->info[i].first_ns < first_ns) {
			first_ns = session->info[i].first_ns;
			memcpy(to->started, meta->started, sizeof(to->started));
		}
		if (length < sizeof(to->rig))
			length += (size_t)snprintf(to->rig + length,
						   sizeof(to->rig) - length, "%s%s%s%s",
						   length ? "; " : "",
						   n > 1 ? session->info[i].name : "",
						   n > 1 ? ": " : "", meta->rig);
	}
}

static void merge_meta(struct incise_recording *rec)
{
	const struct incise_session *session = rec->session;
	const struct incise_recording *of_force = rec->streams[INCISE_LEDGER_FORCE]->file;
	const struct incise_recording *of_tracker =
		rec->streams[INCISE_LEDGER_TRACKER]->file;
	const struct incise_recording_info *tracker = &of_tracker->meta;
	struct incise_recording_info *to = &rec->meta;

	rec->numbers = of_force->numbers;
	rec->numbers.tracker_hz = of_tracker->numbers.tracker_hz;
	rec->numbers.tracker_latency_ns = of_tracker->numbers.tracker_latency_ns;
	*to = of_force->meta;
	merge_rigs(session, to);
	to->tracker = tracker->tracker;
	to->tracker_lost = tracker->tracker_lost;
	to->depth = tracker->depth;
	memcpy(to->surface_normal, tracker->surface_normal, sizeof(to->surface_normal));
	memcpy(to->surface_point_mm, tracker->surface_point_mm,
	       sizeof(to->surface_point_mm));
	memcpy(to->tip_mm, tracker->tip_mm, sizeof(to->tip_mm));
	to->depth_mm_px = rec->streams[INCISE_LEDGER_CAMERA]->file->meta.depth_mm_px;
	for (int i = 0; i < session->n; i++)
		to->complete = to->complete && session->members[i]->meta.complete;
}

/* The events of a member, with its name in front, on the session's clock. */
static int copy_events(struct incise_session *session, int at, sqlite3_stmt *insert,
		       struct incise_error *err)
{
	struct incise_recording *member = session->members[at];
	struct incise_rows rows;
	int rc = incise_rows_open(&rows, member, "events", "rowid, t_ns, kind, text",
				  UINT64_MAX, err);

	while (!rc && (rc = incise_rows_next(&rows, err)) > 0) {
		size_t n;
		const char *kind = incise_rows_text(&rows, 2, &n);
		char *text;

		rc = 0;
		if (asprintf(&text, "%s: %s", session->info[at].name,
			     incise_rows_text(&rows, 3, NULL)) < 0) {
			rc = incise_schema_no_memory(member->path, err);
			break;
		}
		sqlite3_reset(insert);
		sqlite3_bind_int64(insert, 1, rows.t_ns); /* mapped */
		sqlite3_bind_text(insert, 2, kind, (int)n, SQLITE_TRANSIENT);
		sqlite3_bind_text(insert, 3, text, -1, SQLITE_TRANSIENT);
		if (sqlite3_step(insert) != SQLITE_DONE)
			rc = incise_schema_no_memory(member->path, err);
		free(text);
	}
	incise_rows_close(&rows);
	return rc;
}

/*
 * The session's own database is replaced by one in memory, with the events of the members that
 * streams are read from.
 */
static int merge_events(struct incise_recording *rec, bool all, struct incise_error *err)
{
	sqlite3_stmt *insert = NULL;
	int rc = 0;

	sqlite3_close(rec->db);
	rec->db = NULL;
	if (sqlite3_open_v2(":memory:", &rec->db,
			    SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX,
			    NULL) != SQLITE_OK ||
	    sqlite3_exec(rec->db,
			 "CREATE TABLE events(t_ns INTEGER NOT NULL, kind TEXT NOT NULL, "
			 "text TEXT NOT NULL)",
			 NULL, NULL, NULL) != SQLITE_OK ||
	    sqlite3_prepare_v2(rec->db, "INSERT INTO events VALUES(?, ?, ?)", -1, &insert,
			       NULL) != SQLITE_OK)
		rc = incise_schema_no_memory(rec->path, err);
	for (int i = 0; i < rec->session->n && !rc; i++)
		if (all || is_chosen(rec->session, i))
			rc = copy_events(rec->session, i, insert, err);
	sqlite3_finalize(insert);
	return rc;
}

int incise_session_open(struct incise_recording *rec, const char *folder,
			const char *choice, struct incise_error *err)
{
	struct incise_session *session = calloc(1, sizeof(*session));
	int rc = check_session(rec->db, folder, err);

	rec->session = session;
	if (session) {
		session->info =
			calloc(INCISE_SESSION_MEMBERS_MAX, sizeof(*session->info));
		session->members =
			calloc(INCISE_SESSION_MEMBERS_MAX, sizeof(*session->members));
		session->maps =
			calloc(INCISE_SESSION_MEMBERS_MAX, sizeof(*session->maps));
	}
	if (!session || !session->info || !session->members || !session->maps)
		return incise_schema_no_memory(folder, err);
	if (!rc)
		rc = read_members(session, rec->db, folder, err);
	for (int i = 0; i < session->n && !rc; i++) {
		rc = read_map(session, i, rec->db, folder, err);
		if (!rc)
			describe_session(session, i);
	}
	if (!rc)
		rc = choose_session(session, folder, choice, err);
	if (!rc)
		rc = merge_events(rec, strchr(choice, '*') != NULL, err);
	if (rc)
		return rc;
	for (int i = 0; i < INCISE_STREAMS_MAX; i++)
		rec->streams[i] = &session->members[session->of[i]]->own[i];
	rec->streams[INCISE_LEDGER_WALL] = &session->members[0]->own[INCISE_LEDGER_WALL];
	merge_meta(rec);
	return 0;
}

/*
 * The points where the session's clock goes over to TAI's rate: two, 1 ns apart, with the rates of
 * both sides, because a change of rate between two points counts as a slew of unknown time. False:
 * it is not known there.
 */
static bool far_points(const struct incise_wall *wall,
		       const struct incise_wall_point *end, int64_t t_ns,
		       struct incise_wall_point *near, struct incise_wall_point *far)
{
	int64_t bound_ns;

	*near = *end;
	near->t_ns = t_ns;
	near->rate_uncertainty_ppb = 0;
	*near->restart = 0;
	if (incise_wall_tai(wall, t_ns, &near->tai_ns, &bound_ns))
		return false;
	near->uncertainty_ns =
		bound_ns == INCISE_WALL_UNKNOWN ? INFINITY : (double)bound_ns;
	*far = *near;
	far->rate_ppb = 0;
	far->t_ns += t_ns < end->t_ns ? -1 : 1;
	far->tai_ns += t_ns < end->t_ns ? -1 : 1;
	return true;
}

/*
 * Points beyond those of the first member, before and behind, up to the session's ends. The bounds are
 * those of rows of any member: wider by the error of their times on the first one's clock.
 */
static struct incise_wall *extend(const struct incise_wall *wall, int64_t first_ns,
				  int64_t last_ns, double wider_ns)
{
	const struct incise_wall_point *points;
	size_t n = incise_wall_points(wall, &points), at = 0;
	struct incise_wall_point *all = calloc(n + 6, sizeof(*all));
	struct incise_wall *extended;
	int64_t from_ns = points[0].t_ns - INCISE_SESSION_FAR_NS;
	int64_t to_ns = points[n - 1].t_ns + INCISE_SESSION_FAR_NS;

	if (!all)
		return NULL;
	if (first_ns < from_ns - 1 &&
	    far_points(wall, &points[0], from_ns, &all[2], &all[1])) {
		all[0] = all[1];
		all[0].t_ns = first_ns;
		all[0].tai_ns -= all[1].t_ns - first_ns;
		at = 3;
	}
	memcpy(all + at, points, n * sizeof(*all));
	at += n;
	if (last_ns > to_ns + 1 &&
	    far_points(wall, &points[n - 1], to_ns, &all[at], &all[at + 1])) {
		all[at + 2] = all[at + 1];
		all[at + 2].t_ns = last_ns;
		all[at + 2].tai_ns += last_ns - all[at + 1].t_ns;
		at += 3;
	}
	for (size_t i = 0; i < at; i++)
		all[i].uncertainty_ns += wider_ns;
	extended = incise_wall_new(all, at);
	free(all);
	return extended;
}

struct incise_wall *incise_session_extend(const struct incise_session *session,
					  struct incise_wall *wall)
{
	struct incise_wall *extended;
	int64_t first_ns = INT64_MAX, last_ns = INT64_MIN;
	double wider_ns = 0;

	/* By a signal the others' clocks are those of the first one, not of TAI. */
	for (int i = 0; i < session->n; i++) {
		const struct incise_session_info *info = &session->info[i];

		wider_ns = fmax(wider_ns, info->uncertainty_ns);
		if (info->last_ns < info->first_ns ||
		    (i && strcmp(info->method, "clocks")))
			continue;
		first_ns = info->first_ns < first_ns ? info->first_ns : first_ns;
		last_ns = info->last_ns > last_ns ? info->last_ns : last_ns;
	}
	if (first_ns > last_ns)
		return wall;
	extended = extend(wall, first_ns, last_ns, wider_ns);
	incise_wall_free(wall);
	return extended;
}

void incise_session_close(struct incise_session *session)
{
	if (!session)
		return;
	for (int i = 0; i < session->n; i++) {
		incise_recording_free(session->members[i]);
		free(session->maps[i].knots);
	}
	free(session->info);
	free(session->members);
	free(session->maps);
	free(session);
}

int incise_session_members(const struct incise_recording *recording,
			   const struct incise_session_info **members)
{
	if (!recording->session)
		return 0;
	*members = recording->session->info;
	return recording->session->n;
}
