// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/ledger.c: bytes as written down in incise-recording(5), and a CRC that
 * is divided bit by bit.
 */
#include "recorded.h"
#include "../../../lib/record/ledger.h"

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

static const struct incise_frame_record picture = {
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
};

/* 1.5, 2.5, NaN and 0.5: 3ff8…, 4004…, 7ff8…, 3fe0… */
static const uint8_t frame_bytes[] = {
	1, 0, 0, 0,    0, 0, 0, 0, 2, 0, 0,    0,    0, 0, 0,	 0,    3, 0, 0,	   0,
	0, 0, 0, 0,    4, 0, 0, 0, 0, 0, 0,    0,    5, 0, 0,	 0,    0, 0, 0,	   0,
	6, 0, 0, 0,    0, 0, 0, 0, 0, 0, 0,    0,    0, 0, 0xf8, 0x3f, 0, 0, 0,	   0,
	0, 0, 4, 0x40, 0, 0, 0, 0, 0, 0, 0xf8, 0x7f, 0, 0, 0,	 0,    0, 0, 0xe0, 0x3f};

static void rows_are_these_bytes(void **state)
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

	incise_ledger_row_frame(&row, &picture);
	assert_int_equal(row.n, sizeof(frame_bytes));
	assert_memory_equal(row.bytes, frame_bytes, sizeof(frame_bytes));
	assert_true(row.seq == 1 && row.t_ns == 2);
}

/* What a SELECT of this gives is such bytes, or no row. */
static void read_from_SQLite(void **state)
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
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, NULL, NULL, NULL, NULL", 80},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, 1.5, 2.5, NULL, 0.5",
		 sizeof(frame_bytes)},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, NULL, 1.5, 2.5, NULL, 0.5", 0},
		{INCISE_LEDGER_CAMERA, "1, 2, 3, 4, 5, 6, 1.5, 2.5, 'x', 0.5", 0},
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

static void blocks_are_chained_and_count(void **state)
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

static void stream_without_rows(void **state)
{
	struct incise_ledger ledger;
	struct incise_ledger_block end;

	incise_ledger_init(&ledger);
	incise_ledger_close(&ledger, 0, &end);
	assert_true(end.block == 0 && end.first_seq == 0 && end.last_seq == -1);
	assert_true(end.count == 0 && end.lost == 0 && end.first_ns == 0);
	assert_int_equal(end.crc, expected(0, NULL, 0, &end));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(rows_are_these_bytes),
		cmocka_unit_test(read_from_SQLite),
		cmocka_unit_test(blocks_are_chained_and_count),
		cmocka_unit_test(stream_without_rows),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
