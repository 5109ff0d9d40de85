// SPDX-License-Identifier: GPL-2.0-or-later
/* Tests of lib/record/schema.c, and of the tables that lib/record/old knows. */
#include "../unit.h"
#include "recorded.h"
#include "../../../lib/record/old/old.h"
#include "../../../lib/record/schema.h"

/* What TO_FORM_4 takes the rows from. */
#define OLDER                                                                             \
	"CREATE TEMP TABLE force(seq, t_ns, code); CREATE TEMP TABLE tracker(seq, t_ns, " \
	"arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status, station, button); "        \
	"CREATE TEMP TABLE depth(seq, t_ns, depth_mm, velocity_mm_s); CREATE TEMP TABLE " \
	"frames(seq, t_ns, arrival_ns, pts, bytes, crc, length_px, sd_px, depth_mm, "     \
	"quality, sha256); CREATE TEMP TABLE wall(seq, t_ns, tai_ns, uncertainty_ns, "    \
	"rate_ppb, rate_uncertainty_ppb, utc_offset_s, held, source, reference, leap, "   \
	"restart); "

static int check_form(sqlite3 *db, int *form)
{
	struct incise_recording recording = {.db = db, .path = "x.rec"};
	int rc = incise_schema_form(db, "x.rec", form, &err);

	recording.form = *form;
	return rc ? rc
	       : *form == INCISE_SCHEMA_VERSION
		       ? incise_schema_check(db, "x.rec", incise_schema_tables, &err)
		       : incise_old_adopt(&recording, true, &err);
}

/* A new schema, changed by some SQL, is checked. */
static void check(const char *sql, int code, const char *text)
{
	sqlite3 *db;
	int form = 0;

	assert_int_equal(sqlite3_open(":memory:", &db), SQLITE_OK);
	assert_int_equal(incise_schema_create(db), SQLITE_OK);
	assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL), SQLITE_OK);
	/* OLDER's are in the way of views. */
	assert_int_equal(
		sqlite3_exec(db,
			     "DROP TABLE IF EXISTS temp.tracker; DROP TABLE IF "
			     "EXISTS temp.frames; DROP TABLE IF EXISTS temp.wall",
			     NULL, NULL, NULL),
		SQLITE_OK);
	if (code)
		assert_error(check_form(db, &form), code, &err, "x.rec", text);
	else if (check_form(db, &form))
		fail_msg("%s", err.text);
	else
		assert_int_equal(form, !strcmp(sql, OLDER TO_FORM_1)   ? 1
				       : !strcmp(sql, OLDER TO_FORM_2) ? 2
				       : !strcmp(sql, OLDER TO_FORM_3) ? 3
				       : !strcmp(sql, OLDER TO_FORM_4) ? 4
								       : 5);
	sqlite3_close(db);
}

TEST(only_the_own_form_is_taken)
{
	static const struct {
		const char *sql;
		int code;
		const char *text;
	} cases[] = {
		{"", 0, NULL},
		/* what others add does not hurt */
		{"CREATE TABLE mine(a); CREATE INDEX i ON blocks(first_ns)", 0, NULL},
		{OLDER TO_FORM_1, 0, NULL},
		{OLDER TO_FORM_2, 0, NULL},
		{OLDER TO_FORM_3, 0, NULL},
		{OLDER TO_FORM_4, 0, NULL},
		{"DROP TABLE seal", EINVAL, "'seal'"},
		{"PRAGMA user_version=3", EINVAL, "'force'"},
		{OLDER TO_FORM_4 "; DROP TABLE main.wall", EINVAL, "'wall'"},
		{OLDER TO_FORM_4 "; PRAGMA user_version=1", EINVAL, "'tracker'"},
		{"DROP TABLE ledger", EINVAL, "'ledger'"},
		{"PRAGMA application_id=1", EINVAL, NULL},
		{"PRAGMA user_version=6", EINVAL, NULL},
		{"PRAGMA user_version=0", EINVAL, NULL},
		{"PRAGMA user_version=-1", EINVAL, NULL},
		{"DROP TABLE blocks", EINVAL, "'blocks'"},
		{"ALTER TABLE blocks ADD COLUMN x", EINVAL, "'blocks'"},
		{"DROP TABLE blocks; CREATE VIEW blocks AS SELECT 1 AS stream, 2 AS block",
		 EINVAL, "'blocks'"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		check(cases[i].sql, cases[i].code, cases[i].text);
}

TEST(errors_have_their_errno)
{
	sqlite3_stmt *stmt;
	sqlite3 *db;

	assert_int_equal(incise_schema_errno(NULL), ENOMEM);

	/* SQLite's own limit of pages gives SQLITE_FULL, as a full disk does. */
	assert_int_equal(sqlite3_open(":memory:", &db), SQLITE_OK);
	sqlite3_exec(db, "PRAGMA max_page_count=4; CREATE TABLE t(x)", NULL, NULL, NULL);
	assert_int_equal(sqlite3_exec(db, "INSERT INTO t VALUES(zeroblob(1000000))", NULL,
				      NULL, NULL),
			 SQLITE_FULL);
	assert_int_equal(incise_schema_errno(db), ENOSPC);
	assert_int_equal(sqlite3_prepare_v2(db, "SELECT nothing FROM t", -1, &stmt, NULL),
			 SQLITE_ERROR);
	assert_int_equal(incise_schema_errno(db), EINVAL);
	sqlite3_close(db);

	assert_int_equal(sqlite3_open_v2("/nowhere/at/all", &db, SQLITE_OPEN_READONLY,
					 NULL),
			 SQLITE_CANTOPEN);
	assert_int_equal(incise_schema_errno(db), ENOENT);
	sqlite3_close(db);
}
