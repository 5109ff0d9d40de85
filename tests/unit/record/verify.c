// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/verify: a good recording is proved, and each kind of tampering is reported
 * with its place.
 */
#include "../unit.h"
#include "recorded.h"
#include <fcntl.h>
#include <incise/verify.h>
#include "../../../lib/record/old/old.h"
#include "../../../lib/record/frames.h"
#include "../../../lib/record/ledger.h"

#define SIM "sim:clock=simulated"
#define DB "a.rec/recording.db"

static struct {
	struct incise_verify_finding first;
	char text[2000]; /* all lines */
} findings;
static struct incise_verify_report report;

static void found(void *user, const struct incise_verify_finding *finding)
{
	size_t n = strlen(findings.text);

	assert_null(strchr(finding->text, '\n'));
	snprintf(findings.text + n, sizeof(findings.text) - n, "%s\n", finding->text);
	if (n == 0)
		findings.first = *finding;
}

static void verify(const char *path)
{
	struct incise_verify_watch watch = {.found = found};

	memset(&findings, 0, sizeof(findings));
	succeeds(!incise_verify(path, &watch, &report, &err));
}

TEST(good_recording_is_complete, WITH_MODULES)
{

	record("a.rec", SIM, 1000 * MS);
	verify("a.rec");
	if (!report.complete)
		fail_msg("%s", findings.text);
	assert_true(report.intact && !report.interrupted && !report.findings);
	assert_int_equal(report.n_streams, 2);
	for (int i = 0; i < 2; i++) {
		const struct incise_verify_stream *stream = &report.streams[i];

		assert_string_equal(stream->name, i ? "tracker" : "force");
		assert_int_equal(stream->present,
				 (int)ask(DB, i ? "SELECT count(*) FROM tracker"
						: "SELECT count(*) FROM force"));
		assert_int_equal(stream->expected, stream->present);
		assert_int_equal(stream->lost + stream->lost_at_capture + stream->altered,
				 0);
		assert_int_equal(stream->blocks, 11); /* 10 commits and the end */
	}
}

/* Force has 1000 rows a block, the tracker 12 or so; 3000 ms, 30 blocks and the end. */
TEST(tampering_is_found, WITH_MODULES)
{
	static const struct {
		const char *sql, *text;
		int64_t first_block, last_block; /* of the first finding; -1: none */
		uint64_t lost, altered;		 /* samples and blocks of all streams */
	} cases[] = {
		{"DELETE FROM force WHERE seq = 2345", "number 2345", -1, -1, 1, 1},
		{"DELETE FROM force WHERE seq BETWEEN 2990 AND 3009",
		 "numbers 2990 to 3009", -1, -1, 20, 2},
		{"DELETE FROM force WHERE seq < 5", "numbers 5 to 999", 0, 0, 5, 1},
		{"DELETE FROM force WHERE seq >= 29990", "numbers 29990 to 29999", 29, 29,
		 10, 1},
		{"DELETE FROM force", "numbers 0 to 29999", 0, 29, 30000, 30},
		{"UPDATE force SET code = code + 1 WHERE seq = 0", "block 0", 0, 0, 0, 1},
		{"UPDATE force SET code = code + 1 WHERE seq = 12345", "block 12", 12, 12,
		 0, 1},
		{"UPDATE force SET code = 'x' WHERE seq = 12345", "block 12", 12, 12, 0,
		 1},
		{"UPDATE force SET code = code + 1 WHERE seq = 29999", "block 29", 29, 29,
		 0, 1},
		{"UPDATE force SET t_ns = t_ns + 1 WHERE seq = 12345", "block 12", 12, 12,
		 0, 1},
		{"UPDATE force SET code = 4095 - code WHERE seq % 1000 = 7",
		 "blocks 0 to 29", 0, 29, 0, 30},
		{"UPDATE tracker SET x_mm = x_mm + 1e-9 WHERE seq = 50",
		 "tracker: block 4", 4, 4, 0, 1},
		{"UPDATE tracker SET button = 1 WHERE seq = 50", "tracker: block 4", 4, 4,
		 0, 1},
		{"UPDATE tracker SET status = 'x' WHERE seq = 50", "tracker: block 4", 4,
		 4, 0, 1},
		/* rows swapped */
		{"UPDATE force SET seq = -1 WHERE seq = 12345; UPDATE force SET seq = 12345 "
		 "WHERE seq = 16001; UPDATE force SET seq = 16001 WHERE seq = -1",
		 "block 16", 12, 12, 0, 2},
		/* a row inserted: before, behind */
		{"INSERT INTO force VALUES(-1, 0, 7)", "block 0", 0, 0, 1001, 1},
		{"INSERT INTO force VALUES(30000, 9000000000, 7)",
		 "numbers 29000 to 30000", 29, 29, 0, 1},
		/* blocks */
		{"DELETE FROM blocks WHERE stream = 'force' AND block = 0", "block 0", 0,
		 0, 1000, 1},
		{"DELETE FROM blocks WHERE stream = 'force' AND block = 5", "block 5", 5,
		 5, 1000, 1},
		{"DELETE FROM blocks WHERE stream = 'force' AND block IN (5, 6)",
		 "blocks 5 to 6", 5, 6, 2000, 2},
		{"DELETE FROM blocks WHERE stream = 'force' AND count = 0", "force:", 30,
		 30, 0, 0},
		{"DELETE FROM blocks", "30000 rows", 0, 0, 30360, 0},
		{"UPDATE blocks SET crc = (crc | 1) - (crc & 1) WHERE stream = 'force' AND block = 5",
		 "block 5", 5, 5, 0, 1},
		{"UPDATE blocks SET first_ns = first_ns + 1 WHERE stream = 'force' AND block "
		 "= 5",
		 "block 5", 5, 5, 1000, 1},
		{"UPDATE blocks SET last_seq = last_seq - 1 WHERE stream = 'force' AND block "
		 "= 5",
		 "block 5", 5, 5, 1000, 1},
		{"UPDATE blocks SET count = 'x' WHERE stream = 'force' AND block = 5",
		 "block 5", -1, -1, 1000, 1},
		{"UPDATE blocks SET lost = 3 WHERE stream = 'force' AND block = 5",
		 "block 5", 5, 5, 3, 1},
		{"UPDATE blocks SET lost = 3 WHERE stream = 'force' AND count = 0",
		 "block 30", 30, 30, 3, 1},
		{"UPDATE blocks SET block = 9223372036854775807 WHERE stream = 'force' AND "
		 "count = 0",
		 "block 30", 30, 30, 0, 1},
		{"INSERT INTO blocks VALUES('odour', 0, 0, 0, 0, 0, 1, 0, 0, x'', x'')",
		 "unknown streams", -1, -1, 0, 0},
		/* blocks 5 and 6 change places */
		{"UPDATE blocks SET block = -block WHERE stream = 'force' AND block IN (5, "
		 "6); UPDATE blocks SET block = 11 + block WHERE block < 0",
		 "blocks 5 to 6", -1, -1, 0, 2},
		/* the tail cut off with its blocks; with the end put back */
		{"DELETE FROM blocks WHERE stream = "
		 "'force' AND block >= 29",
		 "force:", 29, 29, 1000, 0},
		{"DELETE FROM blocks WHERE stream = "
		 "'force' AND block = 29",
		 "block 29", 29, 29, 1000, 1},
		{"UPDATE meta SET value = value + 1 WHERE key = 'force_rows'",
		 "30001 rows", -1, -1, 1, 0},
		{"UPDATE meta SET value = value + 1 WHERE key = 'tracker_lost'",
		 "tracker: 1", -1, -1, 1, 0},
		/* what is sealed */
		{"UPDATE meta SET value = 7.0 WHERE key = 'force_mV_N'", "table meta", -1,
		 -1, 0, 0},
		{"INSERT INTO meta VALUES('odour', 7)", "table meta", -1, -1, 0, 0},
		{"UPDATE events SET text = 'nothing' WHERE kind = 'zero'", "table events",
		 -1, -1, 0, 0},
		{"INSERT INTO events VALUES(7, 'cut', 'one more')", "table events", -1,
		 -1, 0, 0},
		{"UPDATE streams SET delay_ns = delay_ns + 1 WHERE name = 'force'",
		 "table streams", -1, -1, 0, 0},
		{"INSERT INTO knots VALUES('force', 9, 7, 7, 1.0, 1)", "table knots", -1,
		 -1, 0, 0},
		{"DELETE FROM ledger WHERE stream = 'table:meta'", "table meta", -1, -1,
		 0, 0},
		{"UPDATE ledger SET crc = (crc | 1) - (crc & 1) + 2 WHERE stream = "
		 "'table:knots'",
		 "table knots", -1, -1, 0, 0},
		{"UPDATE ledger SET lost = 1 WHERE stream = 'table:knots'", "table knots",
		 -1, -1, 0, 0},
		{"UPDATE ledger SET block = 1 WHERE stream = 'table:knots'",
		 "table knots", -1, -1, 0, 0},
		{"INSERT INTO ledger SELECT stream, 1, 0, 0, 0, 0, count, 0, crc FROM ledger "
		 "WHERE stream = 'table:knots'",
		 "table knots", -1, -1, 0, 0},
	};

	record("good.rec", SIM, 3000 * MS);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		uint64_t lost = 0, altered = 0;

		assert_int_equal(system("rm -rf a.rec; cp -r good.rec a.rec"), 0);
		change(DB, cases[i].sql);
		verify("a.rec");
		for (int j = 0; j < report.n_streams; j++) {
			lost += report.streams[j].lost;
			altered += report.streams[j].altered;
		}
		assert_says(findings.text, cases[i].text);
		if (report.complete || report.intact || report.interrupted ||
		    lost != cases[i].lost || altered != cases[i].altered)
			fail_msg("%s: %d, %llu lost, %llu altered: %s", cases[i].sql,
				 report.complete, (unsigned long long)lost,
				 (unsigned long long)altered, findings.text);
		if (findings.first.first_block != cases[i].first_block ||
		    findings.first.last_block != cases[i].last_block)
			fail_msg("%s: %s", cases[i].sql, findings.text);
	}
}

/* Samples lost before they were written are reported, but are no alteration. */
TEST(losses_are_no_alteration, WITH_MODULES)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_force_sample drop[2000];
	struct incise_recorder *recorder;

	recorder = start_recorder("a.rec", rig);
	assert_int_equal(poll_for(recorder, rig, 700 * MS, &err), 0);
	/* someone else takes what the recorder should have had: 700 to 730 ms */
	incise_clock_wait_until(incise_rig_clock(rig),
				incise_clock_now(incise_rig_clock(rig)) + 30 * MS);
	assert_int_equal(incise_force_read(incise_rig_force(rig), drop, 2000), 300);
	assert_int_equal(poll_for(recorder, rig, 300 * MS, &err), 0);
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);

	verify("a.rec");
	assert_true(!report.complete && report.intact && report.findings == 1);
	assert_int_equal(report.streams[0].lost, 300);
	assert_int_equal(report.streams[0].lost_at_capture, 300);
	assert_int_equal(report.streams[0].altered, 0);
	assert_int_equal(findings.first.kind, INCISE_VERIFY_LOST);
	assert_true(findings.first.last_seq - findings.first.first_seq == 299);
	assert_int_equal(findings.first.count, 300);
	/* the rows around the gap, 0.1 ms apart each */
	assert_int_equal(findings.first.last_ns - findings.first.first_ns,
			 301 * 100000LL);
}

TEST(interrupted_is_intact, WITH_MODULES)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_recorder *recorder;

	recorder = start_recorder("a.rec", rig);
	verify("a.rec"); /* not a row */
	assert_true(report.interrupted && report.intact && report.findings == 1);
	assert_int_equal(poll_for(recorder, rig, 750 * MS, &err), 0);
	verify("a.rec"); /* as it is written */
	assert_true(report.interrupted && report.intact && !report.complete);
	assert_int_equal(report.findings, 1);
	assert_int_equal(findings.first.kind, INCISE_VERIFY_INTERRUPTED);
	assert_int_equal(report.streams[0].expected, report.streams[0].present);
	assert_true(report.streams[0].present >= 6900); /* commits at 700 ms */
	assert_int_equal(system("cp -r a.rec.part b.rec.part"), 0); /* as kill -9 */
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);
	verify("b.rec");
	assert_true(report.interrupted && report.intact);
	assert_says(findings.text, "not verified");
	/* of them no change is found */
	change("b.rec.part/recording.db", "UPDATE events SET text = 'else'");
	verify("b.rec");
	assert_true(report.interrupted && report.intact);
	change("b.rec.part/recording.db", "DELETE FROM force WHERE seq = 77");
	verify("b.rec");
	assert_true(report.interrupted && !report.intact);
	assert_int_equal(report.streams[0].lost, 1);
}

/* Marking a recording as interrupted does not avoid its seals. */
TEST(closed_and_not_complete, WITH_MODULES)
{

	record("a.rec", SIM, 600 * MS);
	change(DB, "UPDATE meta SET value = 0 WHERE key = 'complete'");
	verify("a.rec");
	assert_true(report.interrupted && !report.intact);
	assert_says(findings.text, "unknown streams");
}

TEST(what_cannot_be_verified, WITH_MODULES)
{

	assert_int_equal(incise_verify("none.rec", NULL, &report, &err), -ENOENT);
}

static int stop(void *user, double share)
{
	assert_true((share >= 0 && share <= 1) || share == -1);
	++*(int *)user;
	return 1;
}

TEST(can_be_stopped, WITH_MODULES)
{
	int calls = 0;
	struct incise_verify_watch watch = {.progress = stop, .user = &calls};

	record("a.rec", SIM, 1000 * MS);
	assert_int_equal(incise_verify("a.rec", &watch, &report, &err), -ECANCELED);
	assert_int_equal(calls, 1);
	assert_false(report.complete);
}

/* --- camera -------------------------------------------------------------------------- */

#define FILE_NAME "a.rec/" INCISE_FRAMES_FILE
#define FRAMES 30
#define FIRST 5 /* number of the first frame */
#define BLOCK 10
#define PERIOD_NS 16666667LL
#define DELAY_NS 3000000LL
#define SIZE(i) (200 + 7 * (size_t)(i))

/* A difference between one frame of the file and its row. */
struct change {
	int at;		/* frame, from 0; -1: none is */
	bool left_out;	/* not in the file */
	bool twice;	/* once more behind it, with the number 1000 */
	int byte;	/* of its data, changed; 0: none */
	int shorter;	/* bytes */
	int64_t t_ns;	/* later */
	uint64_t seq;	/* higher */
	int left_out_n; /* frames, where it is left out; 0: 1 */
};

static int64_t timestamp(int i)
{
	return 1000000000 + i * PERIOD_NS;
}

/* camera.mkv of @n frames; @rows may be NULL. */
static void write_frames(int n, const struct change *change,
			 struct incise_frame_record *rows)
{
	static const struct incise_frames_shape shape = {32, 16, INCISE_PIXELS_MJPEG, 60};
	struct incise_frames_stored stored;
	struct incise_frames_writer *writer;

	unlink(FILE_NAME);
	writer = incise_frames_writer_new(FILE_NAME, &shape, NULL, &err);
	succeeds(writer);
	for (int i = 0; i < n; i++) {
		bool here = i == change->at;
		uint8_t bytes[SIZE(FRAMES)];
		struct incise_camera_frame frame = {
			.t_ns = timestamp(i) + (here ? change->t_ns : 0),
			.seq = FIRST + i + (here ? change->seq : 0),
			.width = 32,
			.height = 16,
			.pixels = INCISE_PIXELS_MJPEG,
			.data = bytes,
			.size = SIZE(i) - (here ? change->shorter : 0),
		};

		for (size_t j = 0; j < sizeof(bytes); j++)
			bytes[j] = (uint8_t)(i * 131 + j * j);
		if (here)
			bytes[change->byte] ^= !!change->byte;
		if (change->left_out && i >= change->at &&
		    i < change->at + (change->left_out_n ? change->left_out_n : 1))
			continue;
		assert_int_equal(incise_frames_put(writer, &frame, &stored, &err), 0);
		if (rows)
			rows[i] = (struct incise_frame_record){
				.seq = frame.seq,
				.t_ns = frame.t_ns - DELAY_NS,
				.arrival_ns = frame.t_ns + 20000000,
				.pts_ms = stored.pts_ms,
				.bytes = stored.bytes,
				.crc = stored.crc,
				.length_px = i % 2 ? NAN : 100 + i,
				.sd_px = NAN,
				.depth_mm = NAN,
				.quality = i % 2 ? 0 : 0.75,
			};
		if (here && change->twice) {
			frame.seq = 1000;
			bytes[0] ^= 1;
			frame.t_ns += 5000000;
			assert_int_equal(incise_frames_put(writer, &frame, &stored, &err),
					 0);
		}
	}
	assert_int_equal(incise_frames_writer_close(writer, &err), 0);
}

static void put_block(const char *stream, const struct incise_ledger_block *block)
{

	change_by(DB,
		  "INSERT INTO ledger VALUES('%s', %lld, %lld, %lld, %lld, %lld, %lld, "
		  "%lld, %lld)",
		  stream, (long long)block->block, (long long)block->first_seq,
		  (long long)block->last_seq, (long long)block->first_ns,
		  (long long)block->last_ns, (long long)block->count,
		  (long long)block->lost, (long long)block->crc);
}

/* A row whose columns of vision are reals or NULL. */
static void put_row(const struct incise_frame_record *row)
{
	char length[40] = "NULL";

	if (!isnan(row->length_px))
		snprintf(length, sizeof(length), "%.1f", row->length_px);
	change_by(
		DB,
		"INSERT INTO frames VALUES(%lld, %lld, %lld, %lld, %u, %u, %s, NULL, NULL, "
		"%.2f)",
		(long long)row->seq, (long long)row->t_ns, (long long)row->arrival_ns,
		(long long)row->pts_ms, row->bytes, row->crc, length, row->quality);
}

/* a.rec gets a camera of @n rows. */
static void add_camera(const struct incise_frame_record *rows, int n, bool end)
{
	struct incise_ledger_block block;
	struct incise_ledger ledger;

	incise_ledger_init(&ledger);
	for (int i = 0; i < n; i++) {
		put_row(&rows[i]);
		incise_ledger_count(&ledger, rows[i].seq, rows[i].t_ns);
		if (i % BLOCK == BLOCK - 1 && incise_ledger_end(&ledger, &block))
			put_block("camera", &block);
	}
	if (incise_ledger_end(&ledger, &block))
		put_block("camera", &block);
	incise_ledger_close(&ledger, 0, &block);
	if (end)
		put_block("camera", &block);
	change_by(
		DB,
		"INSERT INTO streams(name, device, stamped, delay_ns, grain_ns, rows, lost, "
		"late) VALUES('camera', 'test', 1, %lld, 0, %d, 0, 0); INSERT INTO meta "
		"VALUES('frames_rows', %d), ('frames_lost', 0)",
		DELAY_NS, n, n);
}

/* As a recorder does at last; not @whole: it did not come to that. */
static void seal(bool whole)
{
	struct incise_ledger_block block;
	int fd = open(FILE_NAME, O_RDONLY);

	change(DB, "DELETE FROM ledger WHERE stream LIKE '%:%'");
	change(DB, whole ? "UPDATE meta SET value = 1 WHERE key = 'complete'"
			 : "UPDATE meta SET value = 0 WHERE key = 'complete'");
	assert_true(fd >= 0);
	assert_int_equal(incise_ledger_seal_file(fd, 0, &block), 0);
	close(fd);
	if (!whole)
		return;
	put_block(INCISE_LEDGER_FILE, &block);
	for (int i = 0; incise_ledger_sealed[i]; i++) {
		char stream[40];
		sqlite3 *db;

		assert_int_equal(sqlite3_open(DB, &db), SQLITE_OK);
		assert_int_equal(incise_ledger_seal(db, incise_ledger_sealed[i], &block),
				 SQLITE_OK);
		sqlite3_close(db);
		snprintf(stream, sizeof(stream), INCISE_LEDGER_TABLE "%s",
			 incise_ledger_sealed[i]);
		put_block(stream, &block);
	}
}

/* The CRCs of rows that the ledger of an older format has. */
static void seal_rows(void)
{
	struct incise_recording *recording =
		incise_recording_open_as("a.rec", INCISE_RECORDING_OLDER, &err);
	size_t size;
	char *sql;
	FILE *out = open_memstream(&sql, &size);

	succeeds(recording);
	for (int i = 0; i <= INCISE_LEDGER_CAMERA; i++) {
		struct incise_ledger_block entry, made;
		struct incise_old_rows rows;
		struct incise_ledger ledger;
		sqlite3_stmt *entries;

		incise_ledger_init(&ledger);
		assert_int_equal(incise_old_rows_open(&rows, recording, i), SQLITE_OK);
		assert_int_equal(incise_old_rows_next(&rows), SQLITE_OK);
		assert_int_equal(incise_ledger_select(recording->db,
						      incise_ledger_forms[i].stream,
						      INT64_MIN, false, &entries),
				 SQLITE_OK);
		while (sqlite3_step(entries) == SQLITE_ROW) {
			incise_ledger_block_read(&entry, entries);
			for (; rows.has_row && rows.seq <= entry.last_seq;
			     incise_old_rows_next(&rows))
				incise_old_ledger_add(&ledger, &rows);
			if (!incise_ledger_end(&ledger, &made))
				incise_ledger_close(&ledger, entry.lost, &made);
			fprintf(out,
				"UPDATE ledger SET crc = %u WHERE stream = '%s' AND "
				"block = %lld;",
				made.crc, incise_ledger_forms[i].stream,
				(long long)made.block);
		}
		sqlite3_finalize(entries);
		incise_old_rows_close(&rows);
	}
	incise_recording_close(recording);
	fclose(out);
	change(DB, sql);
	free(sql);
}

static const struct change none = {.at = -1};

/* A recording with all frames, and rows of the first @n; @closed, or cut off. Of format 3: no seal knows this camera. */
static void record_frames(int n, bool closed)
{
	struct incise_frame_record rows[FRAMES];

	record("a.rec", "sim:clock=simulated", 600 * MS);
	change(DB, TO_FORM_3);
	write_frames(FRAMES, &none, rows);
	add_camera(rows, n, closed);
	seal_rows();
	seal(closed);
}

/* b.rec is what it is converted to. */
static void convert(void)
{
	struct incise_recovered made;

	assert_int_equal(system("rm -rf b.rec"), 0);
	succeeds(!incise_recording_recover("a.rec", "b.rec", true, &made, &err));
}

static void record_frames_of_today(void)
{
	record_frames(FRAMES, true);
	convert();
	assert_int_equal(system("rm -r a.rec; mv b.rec a.rec"), 0);
}

TEST(frames_are_held_against_their_rows, WITH_MODULES)
{
	static const struct {
		struct change change;
		const char *text;
		int64_t seq, last_seq; /* 0: of one frame */
		uint64_t missing, altered, extra;
	} cases[] = {
		{.change = {.at = 7, .left_out = true},
		 .text = "camera.mkv, number 12,",
		 .seq = 12,
		 .missing = 1},
		{.change = {.at = 7, .left_out = true, .left_out_n = 4},
		 .text = "camera.mkv, numbers 12 to 15,",
		 .seq = 12,
		 .last_seq = 15,
		 .missing = 4},
		/* pts are of the first frame in the file: all that follow seem moved */
		{.change = {.at = 28, .left_out = true, .left_out_n = 2},
		 .text = "camera.mkv, numbers 33 to 34,",
		 .seq = 33,
		 .last_seq = 34,
		 .missing = 2},
		{.change = {.at = 7, .byte = 100},
		 .text = "camera.mkv, number 12,",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 0, .byte = 100},
		 .text = "camera.mkv, number 5",
		 .seq = 5,
		 .altered = 1},
		{.change = {.at = 29, .byte = 100},
		 .text = "camera.mkv, number 34",
		 .seq = 34,
		 .altered = 1},
		{.change = {.at = 7, .shorter = 1},
		 .text = "number 12, at 0.1167 s",
		 .seq = 12,
		 .altered = 1},
		/* too little for the ms of Matroska */
		{.change = {.at = 7, .t_ns = 1},
		 .text = "number 12, at 0.1167 s",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 7, .t_ns = 2000000},
		 .text = "number 12, at 0.1167 s",
		 .seq = 12,
		 .altered = 1},
		/* a number that is another's, and one that nobody has */
		{.change = {.at = 7, .seq = 3},
		 .text = "number 12, at 0.1167 s",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 7, .seq = 1ULL << 63},
		 .text = "number 12, at 0.1167 s",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 7, .twice = true},
		 .text = "number 1000,",
		 .seq = 1000,
		 .extra = 1},
		{.change = {.at = 29, .twice = true},
		 .text = "number 1000,",
		 .seq = 1000,
		 .extra = 1},
	};

	if (!has_frames())
		skip();
	record_frames(FRAMES, true);
	convert();
	verify("b.rec");
	if (!report.complete || !report.intact)
		fail_msg("%s", findings.text);
	assert_int_equal(report.n_streams, 3);
	assert_string_equal(report.streams[2].name, "camera");
	assert_int_equal(report.streams[2].expected, FRAMES);
	assert_int_equal(report.streams[2].present, FRAMES);
	assert_true(report.frames.checked);
	assert_int_equal(report.frames.present, FRAMES);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		write_frames(FRAMES, &cases[i].change, NULL);
		seal(true); /* a file's head has a random number of its own */
		convert();
		verify("b.rec");
		assert_true(!report.complete && !report.intact && report.findings == 1);
		assert_says(findings.text, cases[i].text);
		assert_int_equal(findings.first.kind, INCISE_VERIFY_FRAMES);
		assert_int_equal(findings.first.first_seq, cases[i].seq);
		assert_int_equal(findings.first.last_seq,
				 cases[i].last_seq ? cases[i].last_seq : cases[i].seq);
		assert_int_equal(report.frames.present,
				 FRAMES - cases[i].missing - cases[i].altered);
		assert_int_equal(report.frames.missing, cases[i].missing);
		assert_int_equal(report.frames.altered, cases[i].altered);
		assert_int_equal(report.frames.extra, cases[i].extra);
	}
}

TEST(rows_of_frames_are_in_the_ledger, WITH_MODULES)
{
	static const struct {
		const char *sql, *text;
	} cases[] = {
		{"DELETE FROM frames WHERE seq = 12", "camera: 1 missing, number 12,"},
		{"DELETE FROM frames WHERE seq = 12", "camera.mkv"},
		{"UPDATE frames SET crc = crc + 1 WHERE seq = 12", "camera: block 0"},
		{"UPDATE frames SET crc = crc + 1 WHERE seq = 12", "camera.mkv"},
		{"UPDATE frames SET length_px = 3.5 WHERE seq = 12", "camera: block 0"},
		{"UPDATE frames SET length_px = NULL WHERE seq = 15", "camera: block 1"},
		{"UPDATE meta SET value = 29 WHERE key = 'frames_rows'",
		 "camera: 29 rows"},
		{"UPDATE meta SET value = 2 WHERE key = 'frames_lost'", "camera: 2"},
		{"DELETE FROM frames; DELETE FROM streams WHERE name = 'camera'",
		 "numbers 5 to 34"},
		{"DELETE FROM frames; DELETE FROM streams WHERE name = 'camera'; DELETE "
		 "FROM ledger WHERE stream = 'camera'",
		 "camera: 30 rows"},
	};

	if (!has_frames())
		skip();
	record_frames(FRAMES, true);
	assert_int_equal(system("cp -r a.rec good.rec"), 0);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_int_equal(system("rm -rf a.rec; cp -r good.rec a.rec"), 0);
		change(DB, cases[i].sql);
		convert();
		verify("b.rec");
		assert_true(!report.complete && !report.intact);
		assert_says(findings.text, cases[i].text);
	}
}

/* Any byte of the frames is some frame's, or of the form of the file. */
TEST(damaged_file, WITH_MODULES)
{
	uint8_t first[64];
	struct stat st;
	FILE *file;

	if (!has_frames())
		skip();
	record_frames_of_today();
	assert_int_equal(stat(FILE_NAME, &st), 0);
	assert_int_equal(system("cp " FILE_NAME " good.mkv"), 0);

	/* data of frame 7 */
	for (size_t i = 0; i < sizeof(first); i++)
		first[i] = (uint8_t)(7 * 131 + i * i);
	file = fopen(FILE_NAME, "r+");
	assert_non_null(file);
	for (long at = 0; at < st.st_size; at++) {
		uint8_t bytes[sizeof(first)] = {0};

		fseek(file, at, SEEK_SET);
		if (fread(bytes, 1, sizeof(bytes), file) &&
		    !memcmp(bytes, first, sizeof(first))) {
			fseek(file, at + 20, SEEK_SET);
			fputc(first[20] ^ 0x10, file);
			break;
		}
	}
	fclose(file);
	verify("a.rec");
	assert_false(report.intact);
	assert_says(findings.text, "number 12,");

	/* its head is no frame's */
	for (long at = 8; at < 250; at += 8) {
		assert_int_equal(system("cp good.mkv " FILE_NAME), 0);
		file = fopen(FILE_NAME, "r+");
		fseek(file, at, SEEK_SET);
		fputc(0x55, file); /* no byte there is */
		fclose(file);
		verify("a.rec");
		if (report.intact)
			fail_msg("byte %ld", at);
	}

	/* cut short, in a frame and between two; and with nothing but its head */
	for (off_t size = st.st_size - 1; size > 0; size -= 397) {
		assert_int_equal(system("cp good.mkv " FILE_NAME), 0);
		assert_int_equal(truncate(FILE_NAME, size), 0);
		verify("a.rec");
		if (report.intact ||
		    report.frames.present + report.frames.missing +
				    report.frames.altered !=
			    FRAMES ||
		    !report.frames.missing)
			fail_msg("%ld bytes: %s", (long)size, findings.text);
	}
	assert_int_equal(system("echo nothing >" FILE_NAME), 0);
	verify("a.rec");
	assert_false(report.intact);
	assert_says(findings.text, "frames");
	assert_int_equal(findings.first.kind, INCISE_VERIFY_DAMAGED);
	unlink(FILE_NAME);
	verify("a.rec");
	assert_false(report.intact);
	assert_says(findings.text, "camera.mkv", "30 frames");
	assert_int_equal(report.frames.missing, FRAMES);
}

/* A kill comes after a frame and before its row. */
TEST(file_is_ahead_of_an_interrupted_recording, WITH_MODULES)
{

	if (!has_frames())
		skip();
	record_frames(FRAMES - 4, false);
	convert();
	verify("b.rec");
	if (!report.interrupted || !report.intact || report.findings != 1)
		fail_msg("%s", findings.text);
	assert_int_equal(report.frames.present, FRAMES - 4);
	assert_int_equal(report.frames.ahead, 4);

	seal(true);
	convert();
	verify("b.rec");
	assert_false(report.intact);
	assert_says(findings.text, "camera.mkv", "numbers 31 to 34");
	assert_int_equal(report.frames.extra, 4);
}

TEST(without_the_module_it_is_said, WITH_MODULES)
{

	if (!has_frames())
		skip();
	record_frames_of_today();
	setenv("INCISE_MODULE_PATH", "/nonexistent", 1);
	verify("a.rec");
	assert_false(report.complete);
	assert_false(report.intact);
	assert_true(report.unverified);
	assert_int_equal(report.findings, 1);
	assert_int_equal(findings.first.kind, INCISE_VERIFY_UNVERIFIED);
	assert_says(findings.text, "frames", "frames_mkv.so");
	assert_false(report.frames.checked);
}

/* A recording of the recorder, with a calibrated delay. */
TEST(recorder_and_verification_agree, WITH_MODULES)
{
	struct incise_calibration calibration;
	struct incise_recorder *recorder;
	struct incise_rig *rig;

	if (!has_frames())
		skip();
	rig = incise_rig_open("sim:clock=simulated", BOTH | INCISE_RIG_CAMERA, &err);
	succeeds(rig);
	incise_calibration_nominal(&calibration);
	calibration.camera_delay_ms = 2.5;
	recorder = start_recorder_by(
		"a.rec", rig,
		(struct incise_recorder_setup){.calibration = &calibration});
	assert_int_equal(poll_for(recorder, rig, 550 * MS, &err), 0);
	verify("a.rec"); /* as it is written */
	if (!report.interrupted || !report.intact || report.findings != 1)
		fail_msg("%s", findings.text);
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);
	verify("a.rec");
	if (!report.complete || !report.intact)
		fail_msg("%s", findings.text);
	assert_int_equal(report.n_streams, 3);
	assert_true(report.frames.checked);
	assert_int_equal(report.frames.present, report.streams[2].present);
	assert_true(report.frames.present > 10);
	assert_int_equal(ask(DB, "SELECT delay_ns FROM streams WHERE name = 'camera'"),
			 2500000);
	change(DB, "UPDATE streams SET delay_ns = 0 WHERE name = 'camera'");
	verify("a.rec");
	assert_false(report.intact);
	assert_says(findings.text, "time", "table streams");
}
