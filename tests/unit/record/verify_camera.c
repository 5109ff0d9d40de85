// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/verify/verify_camera.c: pictures that are missing, altered or too many are
 * found in camera.mkv, and where; a file that is ahead of an interrupted recording is right.
 */
#include "verified.h"
#include <fcntl.h>
#include "../../../lib/record/frames.h"
#include "../../../lib/record/ledger_seal.h"

#define DB "a.rec/recording.db"
#define FILE_NAME "a.rec/" INCISE_FRAMES_FILE
#define PICTURES 30
#define FIRST 5 /* number of the first picture */
#define BLOCK 10
#define PERIOD_NS 16666667LL
#define DELAY_NS 3000000LL
#define SIZE(i) (200 + 7 * (size_t)(i))

/* How one picture of the file is not as its row says. */
struct change {
	int at;		/* picture, from 0; -1: none is */
	bool left_out;	/* not in the file */
	bool twice;	/* once more behind it, with the number 1000 */
	int byte;	/* of its data, changed; 0: none */
	int shorter;	/* bytes */
	int64_t t_ns;	/* later */
	uint64_t seq;	/* higher */
	int left_out_n; /* pictures, where it is left out; 0: 1 */
};

static int64_t stamp(int i)
{
	return 1000000000 + i * PERIOD_NS;
}

/* camera.mkv of @n pictures; @rows may be NULL. */
static void write_pictures(int n, const struct change *change,
			   struct incise_frame_record *rows)
{
	static const struct incise_frames_shape shape = {32, 16, INCISE_PIXELS_MJPEG, 60};
	struct incise_frames_stored stored;
	struct incise_frames_writer *writer;
	struct incise_error err = {0};

	unlink(FILE_NAME);
	writer = incise_frames_writer_new(FILE_NAME, &shape, NULL, &err);
	if (!writer)
		fail_msg("%s", err.text);
	for (int i = 0; i < n; i++) {
		bool here = i == change->at;
		uint8_t bytes[SIZE(PICTURES)];
		struct incise_camera_frame frame = {
			.t_ns = stamp(i) + (here ? change->t_ns : 0),
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
	char sql[300];

	snprintf(sql, sizeof(sql),
		 "INSERT INTO ledger VALUES('%s', %lld, %lld, %lld, %lld, %lld, %lld, "
		 "%lld, %lld)",
		 stream, (long long)block->block, (long long)block->first_seq,
		 (long long)block->last_seq, (long long)block->first_ns,
		 (long long)block->last_ns, (long long)block->count,
		 (long long)block->lost, (long long)block->crc);
	change(DB, sql);
}

/* A row whose columns of vision are reals or NULL. */
static void put_row(const struct incise_frame_record *row)
{
	char sql[300], length[40] = "NULL";

	if (!isnan(row->length_px))
		snprintf(length, sizeof(length), "%.1f", row->length_px);
	snprintf(
		sql, sizeof(sql),
		"INSERT INTO frames VALUES(%lld, %lld, %lld, %lld, %u, %u, %s, NULL, NULL, "
		"%.2f)",
		(long long)row->seq, (long long)row->t_ns, (long long)row->arrival_ns,
		(long long)row->pts_ms, row->bytes, row->crc, length, row->quality);
	change(DB, sql);
}

/* a.rec gets a camera of @n rows. */
static void add_camera(const struct incise_frame_record *rows, int n, bool end)
{
	struct incise_ledger_block block;
	struct incise_ledger_row row;
	struct incise_ledger ledger;
	char sql[300];

	incise_ledger_init(&ledger);
	for (int i = 0; i < n; i++) {
		put_row(&rows[i]);
		incise_ledger_row_frame(&row, &rows[i]);
		incise_ledger_add(&ledger, &row);
		if (i % BLOCK == BLOCK - 1 && incise_ledger_end(&ledger, &block))
			put_block("camera", &block);
	}
	if (incise_ledger_end(&ledger, &block))
		put_block("camera", &block);
	incise_ledger_close(&ledger, 0, &block);
	if (end)
		put_block("camera", &block);
	snprintf(
		sql, sizeof(sql),
		"INSERT INTO streams(name, device, stamped, delay_ns, grain_ns, rows, lost, "
		"late) VALUES('camera', 'test', 1, %lld, 0, %d, 0, 0); INSERT INTO meta "
		"VALUES('frames_rows', %d), ('frames_lost', 0)",
		DELAY_NS, n, n);
	change(DB, sql);
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
	assert_int_equal(incise_ledger_seal_head(fd, &block), 0);
	close(fd);
	if (!whole)
		return;
	put_block(INCISE_LEDGER_HEAD, &block);
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

static const struct change none = {.at = -1};

/* A recording with all pictures, and rows of the first @n; @closed, or cut off. */
static void record_pictures(int n, bool closed)
{
	struct incise_frame_record rows[PICTURES];

	record("a.rec", "sim:clock=simulated", 600 * MS);
	write_pictures(PICTURES, &none, rows);
	add_camera(rows, n, closed);
	seal(closed);
}

static void pictures_are_held_against_their_rows(void **state)
{
	static const struct {
		struct change change;
		const char *text;
		int64_t seq, last_seq; /* 0: of one picture */
		uint64_t missing, altered, extra;
	} cases[] = {
		{.change = {.at = 7, .left_out = true},
		 .text = "camera: 1 missing in camera.mkv, number 12, at ",
		 .seq = 12,
		 .missing = 1},
		{.change = {.at = 7, .left_out = true, .left_out_n = 4},
		 .text = "camera: 4 missing in camera.mkv, numbers 12 to 15, ",
		 .seq = 12,
		 .last_seq = 15,
		 .missing = 4},
		/* pts are of the first picture in the file: all that follow seem moved */
		{.change = {.at = 28, .left_out = true, .left_out_n = 2},
		 .text = "camera: 2 missing in camera.mkv, numbers 33 to 34, ",
		 .seq = 33,
		 .last_seq = 34,
		 .missing = 2},
		{.change = {.at = 7, .byte = 100},
		 .text = "camera: 1 altered in camera.mkv, number 12, at 0.1167 s: its bytes are",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 0, .byte = 100},
		 .text = "altered in camera.mkv, number 5",
		 .seq = 5,
		 .altered = 1},
		{.change = {.at = 29, .byte = 100},
		 .text = "altered in camera.mkv, number 34",
		 .seq = 34,
		 .altered = 1},
		{.change = {.at = 7, .shorter = 1},
		 .text = "number 12, at 0.1167 s: its size is",
		 .seq = 12,
		 .altered = 1},
		/* too little for the ms of Matroska */
		{.change = {.at = 7, .t_ns = 1},
		 .text = "number 12, at 0.1167 s: its time is",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 7, .t_ns = 2000000},
		 .text = "number 12, at 0.1167 s: its time is",
		 .seq = 12,
		 .altered = 1},
		/* a number that is another's, and one that nobody has */
		{.change = {.at = 7, .seq = 3},
		 .text = "number 12, at 0.1167 s: its number is",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 7, .seq = 1ULL << 63},
		 .text = "number 12, at 0.1167 s: its number is",
		 .seq = 12,
		 .altered = 1},
		{.change = {.at = 7, .twice = true},
		 .text = "camera: 1 in camera.mkv that no row has, number 1000, at ",
		 .seq = 1000,
		 .extra = 1},
		{.change = {.at = 29, .twice = true},
		 .text = "camera: 1 in camera.mkv that no row has, number 1000, at ",
		 .seq = 1000,
		 .extra = 1},
	};
	struct incise_verify_report report;
	struct findings findings;

	if (!has_frames())
		skip();
	record_pictures(PICTURES, true);
	verify("a.rec", &report, &findings);
	if (!report.complete || !report.intact)
		fail_msg("%s", findings.text);
	assert_int_equal(report.n_streams, 3);
	assert_string_equal(report.streams[2].name, "camera");
	assert_int_equal(report.streams[2].expected, PICTURES);
	assert_int_equal(report.streams[2].present, PICTURES);
	assert_true(report.pictures.checked);
	assert_int_equal(report.pictures.present, PICTURES);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		write_pictures(PICTURES, &cases[i].change, NULL);
		seal(true); /* a file's head has a random number of its own */
		verify("a.rec", &report, &findings);
		if (report.complete || report.intact || report.findings != 1 ||
		    !strstr(findings.text, cases[i].text))
			fail_msg("%zu: %d: %s", i, report.complete, findings.text);
		assert_int_equal(findings.first.kind, INCISE_VERIFY_PICTURES);
		assert_int_equal(findings.first.first_seq, cases[i].seq);
		assert_int_equal(findings.first.last_seq,
				 cases[i].last_seq ? cases[i].last_seq : cases[i].seq);
		assert_int_equal(report.pictures.present,
				 PICTURES - cases[i].missing - cases[i].altered);
		assert_int_equal(report.pictures.missing, cases[i].missing);
		assert_int_equal(report.pictures.altered, cases[i].altered);
		assert_int_equal(report.pictures.extra, cases[i].extra);
	}
}

static void rows_of_pictures_are_in_the_ledger(void **state)
{
	static const struct {
		const char *sql, *text;
	} cases[] = {
		{"DELETE FROM frames WHERE seq = 12",
		 "camera: 1 missing, number 12, before"},
		{"DELETE FROM frames WHERE seq = 12", "1 in camera.mkv that no row has"},
		{"UPDATE frames SET crc = crc + 1 WHERE seq = 12", "camera: block 0 is"},
		{"UPDATE frames SET crc = crc + 1 WHERE seq = 12", "its bytes are not"},
		{"UPDATE frames SET length_px = 3.5 WHERE seq = 12",
		 "camera: block 0 is"},
		{"UPDATE frames SET length_px = NULL WHERE seq = 15",
		 "camera: block 1 is"},
		{"UPDATE meta SET value = 29 WHERE key = 'frames_rows'",
		 "camera: 29 rows were written, and the ledger has 30"},
		{"UPDATE meta SET value = 2 WHERE key = 'frames_lost'",
		 "camera: 2 were lost when it was captured, and the ledger has 0"},
		{"DELETE FROM frames; DELETE FROM streams WHERE name = 'camera'",
		 "camera: 30 missing at the end, numbers 5 to 34"},
		{"DELETE FROM frames; DELETE FROM streams WHERE name = 'camera'; DELETE "
		 "FROM ledger WHERE stream = 'camera'",
		 "camera: 30 rows were written, and the ledger has 0"},
	};
	struct incise_verify_report report;
	struct findings findings;

	if (!has_frames())
		skip();
	record_pictures(PICTURES, true);
	assert_int_equal(system("cp -r a.rec good.rec"), 0);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_int_equal(system("rm -rf a.rec; cp -r good.rec a.rec"), 0);
		change(DB, cases[i].sql);
		verify("a.rec", &report, &findings);
		if (report.complete || report.intact ||
		    !strstr(findings.text, cases[i].text))
			fail_msg("%s: %s", cases[i].sql, findings.text);
	}
}

/* Any byte of the pictures is some picture's, or of the form of the file. */
static void damaged_file(void **state)
{
	struct incise_verify_report report;
	struct findings findings;
	uint8_t first[64];
	struct stat st;
	FILE *file;

	if (!has_frames())
		skip();
	record_pictures(PICTURES, true);
	assert_int_equal(stat(FILE_NAME, &st), 0);
	assert_int_equal(system("cp " FILE_NAME " good.mkv"), 0);

	/* data of picture 7 */
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
	verify("a.rec", &report, &findings);
	if (report.intact ||
	    !strstr(findings.text, "1 altered in camera.mkv, number 12, "))
		fail_msg("%s", findings.text);

	/* its head is no picture's */
	for (long at = 8; at < 250; at += 8) {
		assert_int_equal(system("cp good.mkv " FILE_NAME), 0);
		file = fopen(FILE_NAME, "r+");
		fseek(file, at, SEEK_SET);
		fputc(0x55, file); /* no byte there is */
		fclose(file);
		verify("a.rec", &report, &findings);
		if (report.intact)
			fail_msg("byte %ld", at);
	}

	/* cut short, in a picture and between two; and with nothing but its head */
	for (off_t size = st.st_size - 1; size > 0; size -= 397) {
		assert_int_equal(system("cp good.mkv " FILE_NAME), 0);
		assert_int_equal(truncate(FILE_NAME, size), 0);
		verify("a.rec", &report, &findings);
		if (report.intact ||
		    report.pictures.present + report.pictures.missing +
				    report.pictures.altered !=
			    PICTURES ||
		    !report.pictures.missing)
			fail_msg("%ld bytes: %s", (long)size, findings.text);
	}
	assert_int_equal(system("echo nothing >" FILE_NAME), 0);
	verify("a.rec", &report, &findings);
	assert_false(report.intact);
	assert_non_null(strstr(findings.text, "the pictures are not verified"));
	assert_int_equal(findings.first.kind, INCISE_VERIFY_DAMAGED);
	unlink(FILE_NAME);
	verify("a.rec", &report, &findings);
	assert_false(report.intact);
	assert_non_null(
		strstr(findings.text, "camera.mkv is missing, and 30 pictures with it"));
	assert_int_equal(report.pictures.missing, PICTURES);
}

/* A kill comes after a picture and before its row. */
static void file_is_ahead_of_an_interrupted_recording(void **state)
{
	struct incise_verify_report report;
	struct findings findings;

	if (!has_frames())
		skip();
	record_pictures(PICTURES - 4, false);
	verify("a.rec", &report, &findings);
	if (!report.interrupted || !report.intact || report.findings != 1)
		fail_msg("%s", findings.text);
	assert_int_equal(report.pictures.present, PICTURES - 4);
	assert_int_equal(report.pictures.ahead, 4);

	seal(true);
	verify("a.rec", &report, &findings);
	assert_false(report.intact);
	assert_non_null(strstr(findings.text,
			       "4 in camera.mkv that no row has, numbers 31 to 34"));
	assert_int_equal(report.pictures.extra, 4);
}

static void without_the_module_it_is_said(void **state)
{
	struct incise_verify_report report;
	struct findings findings;

	if (!has_frames())
		skip();
	record_pictures(PICTURES, true);
	setenv("INCISE_MODULE_PATH", "/nonexistent", 1);
	verify("a.rec", &report, &findings);
	assert_false(report.complete);
	assert_false(report.intact);
	assert_true(report.unverified);
	assert_int_equal(report.findings, 1);
	assert_int_equal(findings.first.kind, INCISE_VERIFY_UNVERIFIED);
	assert_non_null(strstr(findings.text, "the pictures are not verified: "));
	assert_non_null(strstr(findings.text, "no module frames_mkv.so"));
	assert_false(report.pictures.checked);
}

/* What a recorder makes, with a delay that was calibrated. */
static void recorder_and_verification_agree(void **state)
{
	struct incise_error err = {0};
	struct incise_calibration calibration;
	struct incise_verify_report report;
	struct incise_recorder *recorder;
	struct findings findings;
	struct incise_rig *rig;

	if (!has_frames())
		skip();
	rig = incise_rig_open("sim:clock=simulated", BOTH | INCISE_RIG_CAMERA, &err);
	if (!rig)
		fail_msg("%s", err.text);
	incise_calibration_nominal(&calibration);
	calibration.camera_delay_ms = 2.5;
	recorder = incise_recorder_new(
		"a.rec", rig,
		&(struct incise_recorder_setup){.calibration = &calibration}, &err);
	if (!recorder)
		fail_msg("%s", err.text);
	assert_int_equal(poll_for(recorder, rig, 550 * MS, &err), 0);
	verify("a.rec", &report, &findings); /* as it is written */
	if (!report.interrupted || !report.intact || report.findings != 1)
		fail_msg("%s", findings.text);
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);
	verify("a.rec", &report, &findings);
	if (!report.complete || !report.intact)
		fail_msg("%s", findings.text);
	assert_int_equal(report.n_streams, 3);
	assert_true(report.pictures.checked);
	assert_int_equal(report.pictures.present, report.streams[2].present);
	assert_true(report.pictures.present > 10);
	assert_int_equal(ask(DB, "SELECT delay_ns FROM streams WHERE name = 'camera'"),
			 2500000);
	change(DB, "UPDATE streams SET delay_ns = 0 WHERE name = 'camera'");
	verify("a.rec", &report, &findings);
	assert_false(report.intact);
	assert_non_null(strstr(findings.text, "its time is not as written"));
	assert_non_null(strstr(findings.text, "table streams is altered"));
}

#define IN_FOLDER(test) \
	cmocka_unit_test_setup_teardown(test, enter_with_modules, leave_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
		IN_FOLDER(pictures_are_held_against_their_rows),
		IN_FOLDER(rows_of_pictures_are_in_the_ledger),
		IN_FOLDER(damaged_file),
		IN_FOLDER(file_is_ahead_of_an_interrupted_recording),
		IN_FOLDER(recorder_and_verification_agree),
		IN_FOLDER(without_the_module_it_is_said),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
