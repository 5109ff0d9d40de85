// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/ledger.c: bytes as written down in incise-recording(5), and a CRC that
 * is divided bit by bit.
 */
#include "../unit.h"
#include "recorded.h"
#include <fcntl.h>
#include "../../../lib/base/crc32c.h"
#include "../../../lib/record/ledger.h"
#include "../../../lib/record/schema.h"

/* CRC32C by division, one bit after the other. */
static uint32_t divide(uint32_t crc, const uint8_t *bytes, size_t n)
{
	crc = ~crc;
	for (size_t i = 0; i < n; i++)
		for (int bit = 0; bit < 8; bit++) {
			uint32_t out = (crc ^ bytes[i] >> bit) & 1;

			crc = crc >> 1 ^ (out ? 0x82f63b78 : 0);
		}
	return ~crc;
}

static const struct incise_tracker_sample sample = {
	.t_ns = 0x0102030405060708,
	.seq = 7,
	.position_mm = {1, -2, -0.0},
	.quaternion = {0.5, 0, 0, 0},
	.status = 'j',
	.station = 3,
	.button = true,
};

/* 1, -2, 0 and 0.5 of IEEE 754: 3ff0…, c000…, 0, 3fe0… */
static const uint8_t tracker_bytes[] = {
	7, 0, 0, 0,    0,    0,	   0, 0, 254, 255, 255, 255, 255, 255,	255,  255, 8,
	7, 6, 5, 4,    3,    2,	   1, 0, 0,   0,   0,	0,   0,	  0xf0, 0x3f, 0,   0,
	0, 0, 0, 0,    0,    0xc0, 0, 0, 0,   0,   0,	0,   0,	  0,	0,    0,   0,
	0, 0, 0, 0xe0, 0x3f, 0,	   0, 0, 0,   0,   0,	0,   0,	  0,	0,    0,   0,
	0, 0, 0, 0,    0,    0,	   0, 0, 0,   0,   0,	0,   'j', 3,	0,    0,   0,
	0, 0, 0, 0,    1,    0,	   0, 0, 0,   0,   0,	0};

static const struct incise_frame_record frame = {
	.seq = 1,
	.t_ns = 2,
	.arrival_ns = 3,
	.pts_ms = 4,
	.bytes = 5,
	.crc = 6,
	.length_px = 1.5,
	.sd_px = 2.5,
	.depth_mm = NAN,
	.quality = 0.5,
	.sha256 = "01234567890123456789012345678901",
};

/* 1.5, 2.5, NaN and 0.5: 3ff8…, 4004…, 7ff8…, 3fe0… */
static const uint8_t frame_bytes[] = {
	1,    0,    0,	 0,   0,   0,	0,   0,	   2,	 0,    0,   0,	 0,    0,
	0,    0,    3,	 0,   0,   0,	0,   0,	   0,	 0,    4,   0,	 0,    0,
	0,    0,    0,	 0,   5,   0,	0,   0,	   0,	 0,    0,   0,	 6,    0,
	0,    0,    0,	 0,   0,   0,	0,   0,	   0,	 0,    0,   0,	 0xf8, 0x3f,
	0,    0,    0,	 0,   0,   0,	4,   0x40, 0,	 0,    0,   0,	 0,    0,
	0xf8, 0x7f, 0,	 0,   0,   0,	0,   0,	   0xe0, 0x3f, '0', '1', '2',  '3',
	'4',  '5',  '6', '7', '8', '9', '0', '1',  '2',	 '3',  '4', '5', '6',  '7',
	'8',  '9',  '0', '1', '2', '3', '4', '5',  '6',	 '7',  '8', '9', '0',  '1'};

#define DIGEST "x'3031323334353637383930313233343536373839303132333435363738393031'"

TEST(rows_are_these_bytes)
{
	static const uint8_t force[] = {5, 1, 0, 0, 0,	 0,  0, 0, 0, 202, 154, 59,
					0, 0, 0, 0, 255, 15, 0, 0, 0, 0,   0,	0};
	struct incise_ledger_row row;

	incise_ledger_row_force(&row, 261, 1000000000, 4095);
	assert_int_equal(row.n, sizeof(force));
	assert_memory_equal(row.bytes, force, sizeof(force));
	assert_true(row.seq == 261 && row.t_ns == 1000000000);

	incise_ledger_row_tracker(&row, -2, &sample);
	assert_int_equal(row.n, sizeof(tracker_bytes));
	assert_memory_equal(row.bytes, tracker_bytes, sizeof(tracker_bytes));
	assert_true(row.seq == 7 && row.t_ns == -2);

	incise_ledger_row_frame(&row, &frame);
	assert_int_equal(row.n, sizeof(frame_bytes));
	assert_memory_equal(row.bytes, frame_bytes, sizeof(frame_bytes));
	assert_true(row.seq == 1 && row.t_ns == 2);
}

/* A SELECT of these values gives such bytes, or no row. */
TEST(read_from_SQLite)
{
	static const struct {
		int form;
		const char *values;
		size_t n; /* 0: no row */
	} cases[] = {
		{INCISE_LEDGER_TRACKER,
		 "7, -2, 72623859790382856, 1.0, -2.0, -0.0, 0.5, 0.0, 0.0, 0.0, 'j', 3, "
		 "1",
		 sizeof(tracker_bytes)},
		{INCISE_LEDGER_TRACKER,
		 "7, -2, 3, 1.0, 2.0, 3.0, 0.5, 0.0, 0.0, 0.0, 'jj', 3, 1", 0},
		{INCISE_LEDGER_TRACKER,
		 "7, -2, 3, 1.0, 2.0, 3.0, 0.5, 0.0, 0.0, 0.0, '', 3, 1", 0},
		{INCISE_LEDGER_TRACKER,
		 "7, -2, 3, 1.0, 2.0, 3.0, 0.5, 0.0, 0.0, 0.0, 5, 3, 1", 0},
		{INCISE_LEDGER_TRACKER,
		 "7, -2, 3, 'x', 2.0, 3.0, 0.5, 0.0, 0.0, 0.0, ' ', 3, 1", 0},
		{INCISE_LEDGER_FORCE, "1, 2, 3", 24},
		{INCISE_LEDGER_FORCE, "1, 2, 3.5", 0},
		{INCISE_LEDGER_FORCE, "1, 'x', 3", 0},
		{INCISE_LEDGER_FORCE, "1, 2, NULL", 0},
		{INCISE_LEDGER_CAMERA,
		 "1, 2, 3, 4, 5, 6, NULL, NULL, NULL, NULL, " DIGEST, 112},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, 1.5, 2.5, NULL, 0.5, " DIGEST,
		 sizeof(frame_bytes)},
		{INCISE_LEDGER_CAMERA,
		 "1, 2, 3, 4, 5, NULL, 1.5, 2.5, NULL, 0.5, " DIGEST, 0},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, 1.5, 2.5, 'x', 0.5, " DIGEST,
		 0},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, 1.5, 2.5, NULL, 0.5, NULL", 0},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, 1.5, 2.5, NULL, 0.5, x'00'", 0},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, 1.5, 2.5, NULL, 0.5, x''", 0},
		{INCISE_LEDGER_CAMERA,
		 "1, 2, 3, 4, 5, 6, 1.5, 2.5, NULL, 0.5, "
		 "'01234567890123456789012345678901'",
		 0},
	};
	static const uint8_t null[] = {0, 0, 0, 0, 0, 0, 0xf8, 0x7f};
	sqlite3 *db;

	assert_int_equal(sqlite3_open(":memory:", &db), SQLITE_OK);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_ledger_row row;
		sqlite3_stmt *stmt;
		char sql[200];
		bool good;

		snprintf(sql, sizeof(sql), "SELECT %s", cases[i].values);
		assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &stmt, NULL), SQLITE_OK);
		assert_int_equal(sqlite3_step(stmt), SQLITE_ROW);
		good = incise_ledger_row_read(&row, &incise_ledger_forms[cases[i].form],
					      stmt);
		if (good != !!cases[i].n || (good && row.n != cases[i].n))
			fail_msg("%s: %d, %zu bytes", cases[i].values, good, row.n);
		if (i == 0)
			assert_memory_equal(row.bytes, tracker_bytes, row.n);
		if (cases[i].n == sizeof(frame_bytes)) /* depth_mm */
			assert_memory_equal(row.bytes + 64, null, 8);
		if (strstr(cases[i].values, "6, 1.5, 2.5, NULL"))
			assert_memory_equal(row.bytes, frame_bytes, row.n);
		sqlite3_finalize(stmt);
	}
	sqlite3_close(db);
}

/* The CRC of some force rows and of the block's fields, after @crc. */
static uint32_t expected(uint32_t crc, const int64_t *seq, int n,
			 const struct incise_ledger_block *block)
{
	const int64_t fields[] = {block->block,	   block->first_seq, block->last_seq,
				  block->first_ns, block->last_ns,   block->count,
				  block->lost};

	for (int i = 0; i < n; i++) {
		int64_t row[] = {seq[i], 100 * seq[i], 9};

		crc = divide(crc, (uint8_t *)row, sizeof(row)); /* little-endian hosts */
	}
	return divide(crc, (uint8_t *)fields, sizeof(fields));
}

static void add(struct incise_ledger *ledger, const int64_t *seq, int n)
{
	struct incise_ledger_row row;

	for (int i = 0; i < n; i++) {
		incise_ledger_row_force(&row, seq[i], 100 * seq[i], 9);
		incise_ledger_add(ledger, &row);
	}
}

TEST(blocks_are_chained_and_count)
{
	/* gaps: of 1 and 2 in the first block, of 4 before the second */
	static const int64_t first[] = {40, 41, 43, 46}, second[] = {51, 52};
	struct incise_ledger ledger;
	struct incise_ledger_block a, b, end;

	incise_ledger_init(&ledger);
	assert_false(incise_ledger_end(&ledger, &a));
	add(&ledger, first, 4);
	assert_true(incise_ledger_end(&ledger, &a));
	assert_false(incise_ledger_end(&ledger, &b));
	assert_true(a.block == 0 && a.first_seq == 40 && a.last_seq == 46 &&
		    a.first_ns == 4000 && a.last_ns == 4600);
	assert_true(a.count == 4 && a.lost == 3);
	assert_int_equal(a.crc, expected(0, first, 4, &a));

	add(&ledger, second, 2);
	assert_true(incise_ledger_end(&ledger, &b));
	assert_true(b.block == 1 && b.first_seq == 51 && b.last_seq == 52);
	assert_true(b.count == 2 && b.lost == 4 && ledger.lost == 7);
	assert_int_equal(b.crc, expected(a.crc, second, 2, &b));

	incise_ledger_close(&ledger, 3, &end);
	assert_true(end.block == 2 && end.first_seq == 53 && end.last_seq == 55);
	assert_true(end.first_ns == 5200 && end.last_ns == 5200);
	assert_true(end.count == 0 && end.lost == 3 && ledger.lost == 10);
	assert_int_equal(end.crc, expected(b.crc, NULL, 0, &end));
}

TEST(stream_without_rows)
{
	struct incise_ledger ledger;
	struct incise_ledger_block end;

	incise_ledger_init(&ledger);
	incise_ledger_close(&ledger, 0, &end);
	assert_true(end.block == 0 && end.first_seq == 0 && end.last_seq == -1);
	assert_true(end.count == 0 && end.lost == 0 && end.first_ns == 0);
	assert_int_equal(end.crc, expected(0, NULL, 0, &end));
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
