// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/old: bytes and CRCs of rows as incise-recording(5) has them of format 4. Older formats are
 * converted in tests/cli/recover.bats.
 */
#include "../unit.h"
#include "recorded.h"
#include "../../../lib/base/crc32c.h"
#include "../../../lib/record/old/old.h"

static const uint8_t force_bytes[] = {5, 1, 0, 0, 0,   0,  0, 0, 0, 202, 154, 59,
				      0, 0, 0, 0, 255, 15, 0, 0, 0, 0,	 0,   0};

/* 1, -2, 0 and 0.5 of IEEE 754: 3ff0…, c000…, 0, 3fe0… */
static const uint8_t tracker_bytes[] = {
	7, 0, 0, 0,    0,    0,	   0, 0, 254, 255, 255, 255, 255, 255,	255,  255, 8,
	7, 6, 5, 4,    3,    2,	   1, 0, 0,   0,   0,	0,   0,	  0xf0, 0x3f, 0,   0,
	0, 0, 0, 0,    0,    0xc0, 0, 0, 0,   0,   0,	0,   0,	  0,	0,    0,   0,
	0, 0, 0, 0xe0, 0x3f, 0,	   0, 0, 0,   0,   0,	0,   0,	  0,	0,    0,   0,
	0, 0, 0, 0,    0,    0,	   0, 0, 0,   0,   0,	0,   'j', 3,	0,    0,   0,
	0, 0, 0, 0,    1,    0,	   0, 0, 0,   0,   0,	0};

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
		{INCISE_LEDGER_FORCE, "261, 1000000000, 4095", sizeof(force_bytes)},
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
		struct incise_old_rows row = {
			.form = &incise_ledger_forms[cases[i].form]};
		char sql[200];

		snprintf(sql, sizeof(sql), "SELECT %s", cases[i].values);
		assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &row.stmt, NULL),
				 SQLITE_OK);
		assert_int_equal(incise_old_rows_next(&row), SQLITE_OK);
		assert_true(row.has_row);
		if (row.good != !!cases[i].n || (row.good && row.n != cases[i].n))
			fail_msg("%s: %d, %zu bytes", cases[i].values, row.good, row.n);
		if (row.n == sizeof(force_bytes) && row.good)
			assert_memory_equal(row.bytes, force_bytes, row.n);
		if (i == 0) {
			assert_memory_equal(row.bytes, tracker_bytes, row.n);
			assert_true(row.seq == 7 && row.t_ns == -2);
		}
		if (cases[i].n == sizeof(frame_bytes)) /* depth_mm */
			assert_memory_equal(row.bytes + 64, null, 8);
		if (strstr(cases[i].values, "6, 1.5, 2.5, NULL"))
			assert_memory_equal(row.bytes, frame_bytes, row.n);
		incise_old_rows_close(&row);
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

		crc = incise_crc32c(crc, (uint8_t *)row,
				    sizeof(row)); /* little-endian hosts */
	}
	return incise_crc32c(crc, (uint8_t *)fields, sizeof(fields));
}

static void add(struct incise_ledger *ledger, const int64_t *seq, int n)
{
	for (int i = 0; i < n; i++) {
		const int64_t values[] = {seq[i], 100 * seq[i], 9};
		struct incise_old_rows row = {
			.seq = seq[i], .t_ns = 100 * seq[i], .n = sizeof(values)};

		memcpy(row.bytes, values, sizeof(values)); /* little-endian hosts */
		incise_old_ledger_add(ledger, &row);
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
