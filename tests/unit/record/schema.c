// SPDX-License-Identifier: GPL-2.0-or-later
/* Tests of lib/record/schema.c. */
#include "../unit.h"
#include "recorded.h"
#include "../../../lib/record/schema.h"

/* A new schema, changed by some SQL, is checked. */
static void check(const char *sql, int code, const char *text)
{
	sqlite3 *db;
	int form = 0;

	assert_int_equal(sqlite3_open(":memory:", &db), SQLITE_OK);
	assert_int_equal(incise_schema_create(db), SQLITE_OK);
	assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL), SQLITE_OK);
	if (code)
		assert_error(incise_schema_check(db, "x.rec", &form, &err), code, &err,
			     "x.rec", text);
	else if (incise_schema_check(db, "x.rec", &form, &err))
		fail_msg("%s", err.text);
	else
		assert_int_equal(form, !strcmp(sql, TO_FORM_1)	 ? 1
				       : !strcmp(sql, TO_FORM_2) ? 2
				       : !strcmp(sql, TO_FORM_3) ? 3
								 : 4);
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
		{"CREATE TABLE mine(a); CREATE INDEX i ON force(t_ns)", 0, NULL},
		{TO_FORM_1, 0, NULL},
		{TO_FORM_2, 0, NULL},
		{TO_FORM_3, 0, NULL},
		{"DROP TABLE seal", EINVAL, "'seal'"},
		{"PRAGMA user_version=3", EINVAL, "'frames'"},
		{"DROP TABLE wall", EINVAL, "'wall'"},
		{"PRAGMA user_version=1", EINVAL, "'tracker'"},
		{"DROP TABLE ledger", EINVAL, "'ledger'"},
		{"PRAGMA application_id=1", EINVAL, NULL},
		{"PRAGMA user_version=5", EINVAL, NULL},
		{"PRAGMA user_version=0", EINVAL, NULL},
		{"PRAGMA user_version=-1", EINVAL, NULL},
		{"DROP TABLE force", EINVAL, "'force'"},
		{"ALTER TABLE force ADD COLUMN x", EINVAL, "'force'"},
		{"DROP TABLE depth; CREATE VIEW depth AS SELECT 1 AS seq, 2 AS t_ns",
		 EINVAL, "'depth'"},
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
