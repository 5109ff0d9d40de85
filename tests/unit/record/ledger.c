// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/ledger.c: bytes as written down in incise-recording(5), and their CRC.
 */
#include "../unit.h"
#include "recorded.h"
#include <fcntl.h>
#include "../../../lib/base/crc32c.h"
#include "../../../lib/record/ledger.h"
#include "../../../lib/record/schema.h"

TEST(stream_without_rows)
{
	static const int64_t fields[] = {0, 0, -1, 0, 0, 0, 0};
	struct incise_ledger ledger;
	struct incise_ledger_block end;

	incise_ledger_init(&ledger);
	incise_ledger_close(&ledger, 0, &end);
	assert_true(end.block == 0 && end.first_seq == 0 && end.last_seq == -1);
	assert_true(end.count == 0 && end.lost == 0 && end.first_ns == 0);
	assert_int_equal(end.crc, incise_crc32c(0, fields, sizeof(fields)));
}

/* --- seals --------------------------------------------------------------------------- */

static sqlite3 *make(const char *sql)
{
	char *text = NULL;
	sqlite3 *db;

	assert_int_equal(sqlite3_open(":memory:", &db), SQLITE_OK);
	assert_int_equal(incise_schema_create(db), SQLITE_OK);
	if (sqlite3_exec(db, sql, NULL, NULL, &text) != SQLITE_OK)
		fail_msg("%s: %s", sql, text);
	return db;
}

/* The fields of an entry of @count, all others 0. */
static uint32_t with_fields(uint32_t crc, uint8_t count)
{
	uint8_t fields[7 * 8] = {0};

	fields[5 * 8] = count;
	return incise_crc32c(crc, fields, sizeof(fields));
}

TEST(a_seal_is_of_these_bytes)
{
	static const char bytes[] = "t\1\0\0\0\0\0\0\0ai\xfe\xff\xff\xff\xff\xff\xff\xff"
				    "t\1\0\0\0\0\0\0\0br\0\0\0\0\0\0\xe0\x3f"
				    "t\1\0\0\0\0\0\0\0cn"
				    "t\1\0\0\0\0\0\0\0db\2\0\0\0\0\0\0\0\0\x7f"
				    "t\2\0\0\0\0\0\0\0\xc3\xa9t\0\0\0\0\0\0\0\0";
	sqlite3 *db =
		make("INSERT INTO meta VALUES('b', 0.5), ('a', -2), ('\xc3\xa9', ''), "
		     "('d', x'007f'), ('c', NULL)");
	struct incise_ledger_block block;

	assert_int_equal(incise_ledger_seal(db, "meta", &block), SQLITE_OK);
	assert_true(block.count == 5 && !block.block && !block.lost && !block.first_seq &&
		    !block.last_seq && !block.first_ns && !block.last_ns);
	assert_int_equal(block.crc,
			 with_fields(incise_crc32c(0, bytes, sizeof(bytes) - 1), 5));
	assert_int_equal(incise_ledger_seal(db, "events", &block), SQLITE_OK);
	assert_true(!block.count && block.crc == with_fields(0, 0));
	assert_int_equal(incise_ledger_seal(db, "force", &block), SQLITE_ERROR);
	assert_int_equal(incise_ledger_seal(db, "meta; DROP TABLE force", &block),
			 SQLITE_ERROR);
	sqlite3_close(db);
}

/* Each table that is sealed, with two rows; what is done to it, and whether that shows. */
TEST(any_change_shows)
{
	static const char rows[] =
		"INSERT INTO meta VALUES('a', 1), ('b', 'text');"
		"INSERT INTO events VALUES(5, 'start', 'x'), (6, 'end', 'y');"
		"INSERT INTO knots VALUES('tracker', 0, 0, 10, 5.0, 1), "
		"('tracker', 1, 9, 90, 5.0, 0);"
		"INSERT INTO streams(name, device, stamped, delay_ns, grain_ns, rows, lost, "
		"late) VALUES('force', 'f', 1, 0, 0, 7, 0, 0), ('tracker', 't', 0, 0, 0, 7, "
		"0, 0);";
	static const struct {
		const char *table, *sql;
		bool same;
	} cases[] = {
		{"meta", "UPDATE meta SET value = 2 WHERE key = 'a'", false},
		{"meta", "UPDATE meta SET value = 1.0 WHERE key = 'a'", false},
		{"meta", "UPDATE meta SET value = '1' WHERE key = 'a'", false},
		{"meta", "UPDATE meta SET value = NULL WHERE key = 'a'", false},
		{"meta", "UPDATE meta SET value = x'74657874' WHERE key = 'b'", false},
		{"meta", "UPDATE meta SET value = 'text' || x'00' WHERE key = 'b'",
		 false},
		{"meta", "UPDATE meta SET key = 'c' WHERE key = 'a'", false},
		{"meta", "DELETE FROM meta WHERE key = 'a'", false},
		{"meta", "INSERT INTO meta VALUES('c', NULL)", false},
		{"events", "UPDATE events SET t_ns = 7 WHERE kind = 'end'", false},
		{"events", "UPDATE events SET kind = 'End' WHERE kind = 'end'", false},
		{"events", "UPDATE events SET text = 'z' WHERE kind = 'end'", false},
		{"events", "UPDATE events SET rowid = 9 WHERE rowid = 1", false},
		{"events", "DELETE FROM events WHERE kind = 'start'", false},
		/* the order of rows is what readers see, not their numbers */
		{"events", "UPDATE events SET rowid = 9 WHERE rowid = 2", true},
		{"knots", "UPDATE knots SET begins = 1 WHERE knot = 1", false},
		{"knots", "UPDATE knots SET sd_ns = 6 WHERE knot = 1", false},
		{"knots", "UPDATE knots SET stream = 'camera' WHERE knot = 1", false},
		{"streams", "UPDATE streams SET ended = '' WHERE name = 'force'", false},
		{"streams", "UPDATE streams SET jitter_max_ns = 0 WHERE name = 'force'",
		 false},
		{"streams", "UPDATE streams SET delay_ns = 1 WHERE name = 'tracker'",
		 false},
		{"streams", "DELETE FROM streams WHERE name = 'tracker'", false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_ledger_block before, after;
		sqlite3 *db = make(rows);

		assert_int_equal(incise_ledger_seal(db, cases[i].table, &before),
				 SQLITE_OK);
		assert_int_equal(before.count, 2);
		assert_int_equal(sqlite3_exec(db, cases[i].sql, NULL, NULL, NULL),
				 SQLITE_OK);
		assert_int_equal(sqlite3_total_changes(db) > 0, 1);
		assert_int_equal(incise_ledger_seal(db, cases[i].table, &after),
				 SQLITE_OK);
		if (incise_ledger_same(&before, &after) != cases[i].same)
			fail_msg("%s", cases[i].sql);
		sqlite3_close(db);
	}
}

/* Every column of the tables that are sealed is in the seal. */
TEST(no_column_is_left_out)
{
	for (int i = 1; incise_ledger_sealed[i]; i++) { /* depth is of older forms */
		const char *table = incise_ledger_sealed[i];
		char sql[200];
		sqlite3 *db = make("");
		sqlite3_stmt *stmt;

		snprintf(sql, sizeof(sql),
			 "SELECT name, type FROM pragma_table_info('%s')", table);
		assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &stmt, NULL), SQLITE_OK);
		/* a row in which all is 1, '1' in texts, but for keys that take no other */
		sqlite3_exec(
			db,
			"INSERT INTO meta VALUES(1, 1); INSERT INTO events VALUES(1, 1, 1); "
			"INSERT INTO knots "
			"VALUES(1, 1, 1, 1, 1, 1); INSERT INTO streams VALUES(1, 1, 1, 1, "
			"1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1)",
			NULL, NULL, NULL);
		while (sqlite3_step(stmt) == SQLITE_ROW) {
			struct incise_ledger_block before, after;

			assert_int_equal(incise_ledger_seal(db, table, &before),
					 SQLITE_OK);
			assert_int_equal(before.count, 1);
			snprintf(sql, sizeof(sql), "UPDATE %s SET %s = 2", table,
				 sqlite3_column_text(stmt, 0));
			assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL),
					 SQLITE_OK);
			assert_int_equal(incise_ledger_seal(db, table, &after),
					 SQLITE_OK);
			if (incise_ledger_same(&before, &after))
				fail_msg("%s", sql);
		}
		sqlite3_finalize(stmt);
		sqlite3_close(db);
	}
}

TEST(head_of_a_file, IN_FOLDER)
{
	static const char file[] = "head\x1f\x43\xb6\x75 and a cluster";
	struct incise_ledger_block block, other;
	int fd = open("file", O_RDWR | O_CREAT, 0600);

	assert_true(fd >= 0);
	assert_int_equal(incise_ledger_seal_file(fd, 0, &block), 0); /* empty */
	assert_true(!block.count && block.crc == with_fields(0, 0));
	assert_int_equal(write(fd, file, sizeof(file)), sizeof(file));
	assert_int_equal(incise_ledger_seal_file(fd, 0, &block), 0);
	assert_true(block.count == 4);
	assert_int_equal(block.crc, with_fields(incise_crc32c(0, "head", 4), 4));
	assert_int_equal(pwrite(fd, "A", 1, 12), 1); /* in the cluster */
	assert_int_equal(incise_ledger_seal_file(fd, 0, &other), 0);
	assert_true(incise_ledger_same(&block, &other));
	assert_int_equal(pwrite(fd, "H", 1, 0), 1);
	assert_int_equal(incise_ledger_seal_file(fd, 0, &other), 0);
	assert_false(incise_ledger_same(&block, &other));
	assert_int_equal(ftruncate(fd, 3), 0); /* no cluster: all there is */
	assert_int_equal(incise_ledger_seal_file(fd, 0, &other), 0);
	assert_int_equal(other.count, 3);
	close(fd);
	assert_int_equal(incise_ledger_seal_file(fd, 0, &other), -EBADF);
}
