// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/read/recording.c: the contents of a recording, and errors for a damaged
 * one.
 */
#include "../unit.h"
#include "recorded.h"
#include <endian.h>
#include <fcntl.h>
#include <limits.h>
#include "../../../lib/record/read/cut.h"

#define DB "a.rec/recording.db"

/* Open and read all of it. Returns 0 or the negative errno; err has the line. */
static int read_all(const char *path, struct incise_recording_info *info,
		    struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open(path, err);
	int rc;

	if (!recording) {
		assert_int_equal(errno, err->code);
		return -errno;
	}
	rc = incise_recording_measure(recording, info, err);
	incise_recording_close(recording);
	return rc;
}

TEST(info_tells_what_the_tables_hold, IN_FOLDER)
{
	struct incise_recording_info info;

	record("a.rec", SHORT_SCRIPT, 0);
	succeeds(!read_all("a.rec", &info, &err));
	assert_true(info.complete);
	assert_int_equal(info.force, (int)ask(DB, "SELECT count(*) FROM force"));
	assert_int_equal(info.tracker, (int)ask(DB, "SELECT count(*) FROM tracker"));
	assert_int_equal(info.depth, info.tracker);
	assert_true(info.start_ns == ask(DB, "SELECT min(t_ns) FROM force"));
	assert_true(info.end_ns == ask(DB, "SELECT max(t_ns) FROM force"));
	assert_int_equal(info.force_lost + info.tracker_lost + info.force_clipped, 0);
	assert_string_equal(info.rig, SHORT_SCRIPT);
	assert_int_equal(strlen(info.started), strlen("2026-01-01T00:00:00Z"));
	assert_int_equal(info.bits, 12);
	assert_true(info.full_scale_V == 5 && info.force_mV_N == 1240);
	assert_true(info.depth_mm_px == 0.11875);
	assert_true(info.surface_normal[2] == 1 && info.surface_point_mm[2] == 0);
	assert_int_equal(info.cuts, 14); /* 3 + 4 + 4 + 3 */
	/* A sample lies between two rows, so it is at most as deep as the deepest row. */
	assert_true(info.depth_max_mm <= ask(DB, "SELECT max(depth_mm) FROM depth"));
	assert_true(info.depth_max_mm > 19 && info.depth_max_mm < 22); /* 20 nominal */
	assert_true(info.force_max_N > 1); /* 2.6 N by the model at 20 mm and 25 mm/s */
}

TEST(paths_that_lead_to_a_recording, IN_FOLDER)
{
	struct incise_recording_info info;
	char path[300];

	record("a.rec", "sim:clock=simulated", 100 * MS);
	snprintf(path, sizeof(path), "%s/a.rec//", (char *)*state);
	assert_int_equal(read_all("a.rec/", &info, &err), 0);
	assert_int_equal(read_all("./a.rec", &info, &err), 0);
	assert_int_equal(read_all(path, &info, &err), 0);
	assert_int_equal(rename("a.rec", "a.rec.part"), 0);
	assert_int_equal(read_all("a.rec", &info, &err), 0);
	assert_int_equal(read_all("a.rec/", &info, &err), 0);
	assert_int_equal(read_all("a.rec.part", &info, &err), 0);
}

TEST(no_recording, IN_FOLDER)
{
	static const struct {
		const char *path;
		int code;
		const char *text;
	} cases[] = {
		{"none.rec", ENOENT, "none.rec:"},
		{"", ENOENT, NULL},
		{"file.rec", EINVAL, "file.rec"},
		{"empty.rec", EINVAL, "empty.rec"},
		{"folder.rec", EINVAL, "folder.rec"},
		{"garbage.rec", EINVAL, "garbage.rec"},
		{"nothing.rec", EINVAL, "nothing.rec"},
		{"text\nfile.rec", ENOENT, "text?file.rec"},
	};
	struct incise_recording_info info;
	FILE *file;

	mkdir("empty.rec", 0777);
	mkdir("folder.rec", 0777);
	mkdir("folder.rec/recording.db", 0777);
	mkdir("garbage.rec", 0777);
	mkdir("nothing.rec", 0777);
	fclose(fopen("file.rec", "w"));
	fclose(fopen("nothing.rec/recording.db", "w"));
	file = fopen("garbage.rec/recording.db", "w");
	for (int i = 0; i < 5000; i++)
		fputs("garbage ", file);
	fclose(file);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_error(read_all(cases[i].path, &info, &err), cases[i].code, &err,
			     cases[i].text);
	}
}

/* --- nothing is written where it is read --- */

/* Names, sizes, times of change and contents of all that is in b.rec, and of the folder itself. */
static void keep_state(const char *file)
{
	char command[300];

	snprintf(command, sizeof(command),
		 "{ find b.rec victim -printf '%%p %%y %%s %%m %%T@ %%C@ %%l\\n'; "
		 "find b.rec victim -type f -exec sha256sum {} +; } | sort >%s",
		 file);
	assert_int_equal(system(command), 0);
}

/* b.rec: as a recorder leaves it that was killed while it gave up its log. */
static void make_journal(void)
{
	sqlite3 *db;

	record("a.rec", "sim:clock=simulated", 1000 * MS);
	assert_int_equal(sqlite3_open("a.rec/recording.db", &db), SQLITE_OK);
	/* so little room that changed pages come to the file before the commit */
	assert_int_equal(
		sqlite3_exec(
			db,
			"PRAGMA cache_size=1; BEGIN; UPDATE blocks SET data = zeroblob(9000)",
			NULL, NULL, NULL),
		SQLITE_OK);
	assert_int_equal(system("cp -r a.rec b.rec"), 0);
	sqlite3_close(db);
	assert_int_equal(access("b.rec/recording.db-journal", F_OK), 0);
}

/* The end of a journal that has SQLite remove the file @path once it is played. */
static void add_victim(const char *path)
{
	static const unsigned char magic[] = {0xd9, 0xd5, 0x05, 0xf9,
					      0x20, 0xa1, 0x63, 0xd7};
	uint32_t length = (uint32_t)strlen(path), sum = 0;
	const uint32_t page = 0x40000000 / 4096 + 1;
	FILE *file = fopen("b.rec/recording.db-journal", "ab");

	for (const char *c = path; *c; c++)
		sum += (uint32_t)(signed char)*c;
	assert_non_null(file);
	fwrite(&(uint32_t){htobe32(page)}, 4, 1, file);
	fwrite(path, 1, length, file);
	fwrite(&(uint32_t){htobe32(length)}, 4, 1, file);
	fwrite(&(uint32_t){htobe32(sum)}, 4, 1, file);
	fwrite(magic, sizeof(magic), 1, file);
	assert_int_equal(fclose(file), 0);
}

TEST(journal_is_rolled_back_in_a_copy, IN_FOLDER)
{
	struct incise_recording_info info;

	make_journal();
	assert_int_equal(system("touch victim; mkdir tmp"), 0);
	setenv("TMPDIR", "tmp", 1);
	keep_state("before");
	succeeds(!read_all("b.rec", &info, &err));
	assert_int_equal(info.force, 10000);
	assert_true(info.start_ns > 0);
	keep_state("after");
	assert_int_equal(system("cmp before after"), 0);
	/* The copy is gone. */
	assert_int_equal(system("rmdir tmp"), 0);
	unsetenv("TMPDIR");
}

TEST(journal_that_names_a_file_is_refused, IN_FOLDER)
{
	struct incise_recording_info info;
	char victim[PATH_MAX];

	make_journal();
	assert_int_equal(system("echo precious >victim"), 0);
	assert_non_null(realpath("victim", victim));
	add_victim(victim);
	keep_state("before");
	assert_error(read_all("b.rec", &info, &err), EINVAL, &err, "b.rec", "-journal",
		     "another file");
	keep_state("after");
	assert_int_equal(system("cmp before after"), 0);
}

/* A pipe would be waited for, a link be followed, an index be mapped. */
TEST(what_no_recorder_makes_is_refused, IN_FOLDER)
{
	static const char *const names[] = {"recording.db-journal", "recording.db-wal",
					    "recording.db-shm", "camera.mkv"};
	static const char *const kinds[] = {"mkfifo", "mkdir", "ln -s ../victim",
					    "ln -s ../not-there", "ln -s /dev/zero"};
	char command[200];

	record("b.rec", SHORT_SCRIPT, 0);
	assert_int_equal(system("echo precious >victim"), 0);
	for (size_t n = 0; n < 4; n++)
		for (size_t k = 0; k < 5; k++) {
			struct incise_recording_info info;
			struct incise_error err = {0};

			snprintf(command, sizeof(command), "%s b.rec/%s", kinds[k],
				 names[n]);
			assert_int_equal(system(command), 0);
			keep_state("before");
			assert_error(read_all("b.rec", &info, &err), EINVAL, &err,
				     "b.rec", names[n]);
			keep_state("after");
			assert_int_equal(system("cmp before after"), 0);
			snprintf(command, sizeof(command), "rm -r b.rec/%s", names[n]);
			assert_int_equal(system(command), 0);
		}
}

/* The log has the page that did not come to the file as a whole. */
TEST(half_a_page_beside_a_log, IN_FOLDER)
{
	struct incise_recording_info info;
	struct incise_rig *rig = open_rig("sim:clock=simulated");
	struct incise_recorder *recorder = start_recorder("a.rec", rig);
	struct stat st;

	assert_int_equal(poll_for(recorder, rig, 700 * MS, &err), 0);
	assert_int_equal(system("cp -r a.rec.part b.rec.part"), 0);
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);
	assert_int_equal(stat("b.rec.part/recording.db-wal", &st), 0);
	assert_true(st.st_size > 0);
	assert_int_equal(system("printf half >>b.rec.part/recording.db"), 0);
	/* Its index may be missing, as of a copy to a medium that cannot be written. */
	for (int i = 0; i < 2; i++) {
		assert_int_equal(system("touch victim; mv b.rec.part b.rec"), 0);
		keep_state("before");
		succeeds(!read_all("b.rec", &info, &err));
		assert_true(info.force > 5000 && !info.complete);
		keep_state("after");
		assert_int_equal(system("cmp before after; mv b.rec b.rec.part"), 0);
		assert_int_equal(system("rm -f b.rec.part/recording.db-shm"), 0);
	}
}

/* Those that the recorder noted; as many as it found, or one is not over. */
static void cut_ends_are_those_of_the_depths(struct incise_recording *recording)
{
	struct incise_cut_count cut = {0};
	struct incise_source source;
	sqlite3_stmt *stmt;
	const char *noted; /* int64_t, unaligned */
	int n = 0;

	assert_int_equal(sqlite3_prepare_v2(recording->db,
					    "SELECT value FROM meta WHERE key = "
					    "'cut_ends_ns'",
					    -1, &stmt, NULL),
			 SQLITE_OK);
	assert_int_equal(sqlite3_step(stmt), SQLITE_ROW);
	noted = sqlite3_column_blob(stmt, 0);
	succeeds(!incise_source_open(&source, recording, INCISE_SOURCE_DEPTH, &err));
	while (incise_source_next(&source, &err) > 0)
		for (size_t k = 0; k < source.batch.n; k++) {
			const bool inside = cut.inside;

			if (incise_cut_step(&cut, source.batch.column[2].r[k]) || !inside)
				continue;
			assert_memory_equal(noted + 8 * n, &source.batch.column[1].i[k],
					    8);
			n++;
		}
	incise_source_close(&source);
	assert_int_equal(sqlite3_column_bytes(stmt, 0), 8 * n);
	assert_int_equal(n, cut.count - cut.inside);
	sqlite3_finalize(stmt);
}

/* The recorder's summary is what readers find of all samples, but for the times of the capture. */
TEST(a_summary_is_that_of_the_samples, IN_FOLDER)
{
	static const struct {
		const char *spec;
		int64_t duration_ns;
	} cases[] = {
		{SHORT_SCRIPT, 0},
		{SHORT_SCRIPT ",seed=2,tracker_hz=60,tracker_jitter_ms=5", 0},
		{SHORT_SCRIPT ",seed=3,force_hz=500,tracker_hz=240,depth_mm=5", 0},
		{SHORT_SCRIPT ",seed=4", 4000 * MS},
		{SHORT_SCRIPT ",seed=5",
		 300 * MS}, /* no cut, and a zero of what there is */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_recording_info summary, all;

		struct incise_recording *recording;

		record("a.rec", cases[i].spec, cases[i].duration_ns);
		recording = open_recording("a.rec");
		succeeds(!incise_recording_info(recording, &summary, &err) &&
			 !incise_recording_measure(recording, &all, &err));
		cut_ends_are_those_of_the_depths(recording);
		incise_recording_close(recording);
		assert_true(summary.summary);
		assert_false(all.summary);
		assert_int_equal(summary.cuts, all.cuts);
		assert_int_equal(summary.start_ns, all.start_ns);
		assert_int_equal(summary.end_ns, all.end_ns);
		assert_int_equal(summary.depth, all.depth);
		assert_string_equal(summary.started, all.started);
		if (fabs(summary.depth_max_mm - all.depth_max_mm) > 0.05 ||
		    fabs(summary.force_max_N - all.force_max_N) > 0.01 * all.force_max_N)
			fail_msg("%s: %g mm, %g N; %g mm, %g N", cases[i].spec,
				 summary.depth_max_mm, summary.force_max_N,
				 all.depth_max_mm, all.force_max_N);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
}

/* Each change alone, on a fresh copy of a good recording. */
TEST(damage_is_found, IN_FOLDER)
{
	static const struct {
		const char *sql, *text;
	} cases[] = {
		{"UPDATE force SET code = -1 WHERE seq = 100",
		 "table force, row 100: code"},
		{"UPDATE force SET code = 4096 WHERE seq = 100",
		 "table force, row 100: code"},
		{"UPDATE force SET code = 99999999999 WHERE seq = 100", "row 100: code"},
		{"UPDATE force SET t_ns = -1 WHERE seq = 0", "row 0: its time"},
		{"UPDATE force SET t_ns = 5 WHERE seq = 100", "row 100: its time"},
		{"UPDATE force SET t_ns = (SELECT t_ns FROM force WHERE seq = 99) WHERE seq = 100",
		 "row 100: its time"},
		{"UPDATE force SET t_ns = t_ns - 150000000 WHERE seq > (SELECT last_seq FROM "
		 "blocks WHERE stream = 'force' AND block = 0)",
		 "stream force, block 1: its times are not behind those of the block before"},
		{"DELETE FROM force WHERE seq = 100", "table force"},
		{"DELETE FROM tracker WHERE seq = 10", "table tracker"},
		{"DELETE FROM tracker WHERE seq > 10", "table tracker"},
		{"DELETE FROM tracker", "table tracker"},
		{"UPDATE tracker SET z_mm = 9e999 WHERE seq = 10",
		 "stream tracker, block 0: a column is impossible"},
		{"UPDATE tracker SET qw = 9e999 WHERE seq = 7",
		 "stream tracker, block 0: a column is impossible"},
		{"UPDATE tracker SET z_mm = 1e9 WHERE seq = 7", "table depth"},
		{"UPDATE tracker SET z_mm = -9e14 WHERE seq > 7", "table depth"},
		{"UPDATE tracker SET t_ns = 0 WHERE seq = 10", "row 10: its time"},
		/* the last one, after the last force sample */
		{"UPDATE tracker SET t_ns = 0 WHERE seq = (SELECT max(seq) FROM tracker)",
		 "its time"},
		/* of blocks by somebody who knows nothing of them */
		{"UPDATE blocks SET data = zeroblob(length(data)) WHERE stream = 'force' "
		 "AND block = 1",
		 "stream force, block 1: its checksum differs"},
		{"UPDATE blocks SET data = 'text' WHERE stream = 'tracker' AND block = 1",
		 "stream tracker, block 1: its checksum differs"},
		{"UPDATE blocks SET count = count + 1 WHERE stream = 'force' AND block = 1",
		 "block 1: its checksum differs"},
		{"UPDATE blocks SET count = 0 WHERE stream = 'force' AND block = 1",
		 "block 1: its checksum differs"},
		{"UPDATE blocks SET first_ns = first_ns - 1 WHERE stream = 'force'",
		 "block 0: its checksum differs"},
		{"UPDATE blocks SET crc = 'x' WHERE stream = 'force'",
		 "block 0: a field has another type"},
		{"UPDATE blocks SET block = block + 7 WHERE stream = 'force' AND block = 1",
		 "block 2: blocks before it are missing"},
		{"DELETE FROM blocks WHERE stream = 'force' AND block = 1",
		 "stream force, block 2: blocks before it are missing"},
		{"DELETE FROM meta WHERE key = 'rig'", "'rig'"},
		{"UPDATE meta SET value = 7 WHERE key = 'rig'", "'rig'"},
		{"UPDATE meta SET value = -7 WHERE key = 'force_rows'", "'force_rows'"},
		{"UPDATE meta SET value = 1 WHERE key = 'force_rows'", "table force"},
		{"UPDATE meta SET value = 0 WHERE key = 'force_bits'", "0 bits"},
		{"UPDATE meta SET value = 64 WHERE key = 'force_bits'", "64 bits"},
		{"UPDATE meta SET value = 0.0 WHERE key = 'force_mV_N'", "0 mV/N"},
		{"UPDATE meta SET value = 9e999 WHERE key = 'force_mV_N'",
		 "'force_mV_N'"},
		{"UPDATE meta SET value = -5.0 WHERE key = 'force_full_scale_V'", "-5 V"},
		{"UPDATE meta SET value = 1e10 WHERE key = 'force_offset_V'",
		 "from 1e+10 V"},
		{"UPDATE meta SET value = 'x' WHERE key = 'force_offset_V'",
		 "'force_offset_V'"},
		{"UPDATE meta SET value = 'x' WHERE key = 'force_zero_mV'",
		 "'force_zero_mV'"},
		{"PRAGMA application_id = 7", NULL},
		{"PRAGMA user_version = 99", NULL},
		{"CREATE TABLE other AS SELECT * FROM blocks; DROP TABLE blocks; "
		 "CREATE VIEW blocks AS SELECT * FROM other",
		 "'blocks'"},
		{"DROP TABLE events", "'events'"},
	};
	struct incise_recording_info info;

	record("good.rec", "sim:clock=simulated", 300 * MS);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_int_equal(system("rm -rf a.rec; cp -r good.rec a.rec"), 0);
		change(DB, cases[i].sql);
		if (read_all("a.rec", &info, &err) != -EINVAL)
			fail_msg("not found: %s", cases[i].sql);
		assert_says(err.text, cases[i].text ? cases[i].text : "a.rec");
	}
}

TEST(truncated_file_is_found, IN_FOLDER)
{
	struct incise_recording_info info;
	struct stat st;

	record("a.rec", "sim:clock=simulated", 1000 * MS);
	assert_int_equal(stat(DB, &st), 0);
	/* Any length short of the whole: odd ones, whole pages, the bare header. */
	for (off_t size = st.st_size - 1; size > 0;
	     size = size > 8192 ? size - 8191 : size - 97) {
		int rc;

		assert_int_equal(truncate(DB, size), 0);
		rc = read_all("a.rec", &info, &err);
		if (rc != -EINVAL)
			fail_msg("%ld bytes: %d, %s", (long)size, rc, err.text);
	}
}

TEST(text_of_a_stranger_is_harmless, IN_FOLDER)
{
	struct incise_recording_info info;

	record("a.rec", "sim:clock=simulated", 100 * MS);
	change(DB, "UPDATE meta SET value = 'sim:' || char(27) || '[2J' || char(10) || "
		   "replace(hex(zeroblob(5000)), '0', 'x') WHERE key = 'rig'");
	assert_int_equal(read_all("a.rec", &info, &err), 0);
	assert_int_equal(strncmp(info.rig, "sim:?[2J?xxx", 12), 0);
	assert_int_equal(strlen(info.rig), sizeof(info.rig) - 1);
}

TEST(interrupted_before_the_zero, IN_FOLDER)
{
	struct incise_recording_info info;

	record("a.rec", "sim:clock=simulated", 100 * MS);
	change(DB, "UPDATE meta SET value = NULL WHERE key = 'force_zero_mV'");
	assert_int_equal(read_all("a.rec", &info, &err), 0);
	assert_true(isnan(info.zero_mV) && info.force_max_N == 0);
}

TEST(read_only_medium, IN_FOLDER)
{
	struct incise_recording_info info;
	int rc;

	record("a.rec", "sim:clock=simulated", 100 * MS);
	chmod(DB, 0444);
	chmod("a.rec", 0555);
	rc = read_all("a.rec", &info, &err);
	chmod("a.rec", 0755);
	assert_int_equal(rc, 0);
}

TEST(closing_nothing)
{
	incise_recording_close(NULL);
}

/* --- streams ------------------------------------------------------------------------- */

TEST(line_is_read_and_used, IN_FOLDER)
{
	struct incise_row_times times;
	struct incise_recording *recording;

	record("a.rec", "sim:clock=simulated", 700 * MS);
	/* The arrivals of its rows would show that this is not their line. */
	change(DB, "DELETE FROM tracker; DELETE FROM knots; "
		   "INSERT INTO knots VALUES('tracker', 0, 10, 1000, 5.0, 1), "
		   "('tracker', 1, 20, 3000, 7.0, 0), ('tracker', 2, 30, 6000, 6.0, 0)");
	recording = incise_recording_open("a.rec", &err);
	assert_non_null(recording);
	assert_int_equal(incise_row_times_open(&times, recording, "tracker", &err), 0);
	assert_int_equal(times.source->n_knots, 3);
	assert_int_equal(incise_row_times_line(&times, 15, 77), 2000);
	assert_int_equal(incise_row_times_line(&times, 25, 77), 4500);
	assert_int_equal(incise_row_times_line(&times, 40, 77),
			 9000); /* beyond the last */
	assert_true(incise_row_times_line_sd(&times, 15) == 7);
	assert_true(incise_row_times_line_sd(&times, 29) == 7);
	incise_row_times_close(&times);
	/* what has no line has its own times */
	assert_int_equal(incise_row_times_open(&times, recording, "force", &err), 0);
	assert_int_equal(times.source->n_knots, 0);
	assert_int_equal(incise_row_times_line(&times, 15, 77), 77);
	assert_true(isnan(incise_row_times_line_sd(&times, 15)));
	incise_recording_close(recording);
}

TEST(impossible_streams_are_refused, IN_FOLDER)
{
	static const struct {
		const char *sql;
		bool knots;
	} cases[] = {
		{"INSERT INTO knots VALUES('tracker', 1000, 0, 5, 1.0, 0)", true},
		{"UPDATE knots SET sd_ns = -1.0", true},
		{"UPDATE knots SET sd_ns = 9e999", true},
		{"UPDATE knots SET t_ns = 9223372036854775807", true},
		{"UPDATE knots SET seq = -1", true},
		{"UPDATE knots SET t_ns = 'x'", true},
		{"WITH RECURSIVE n(i) AS (SELECT 1000 UNION ALL SELECT i + 1 FROM n WHERE "
		 "i < 2000) INSERT INTO knots SELECT 'tracker', i, 1000000 + i, "
		 "9000000000000 + i, 1.0, 0 FROM n",
		 true},
		{"UPDATE streams SET drift_ppm = 9e999", false},
		{"UPDATE streams SET jitter_ns = 'much'", false},
		{"UPDATE streams SET lost = -1", false},
		{"UPDATE streams SET name = ''", false},
		{"UPDATE streams SET ended = x'00ff'", false},
		{"INSERT INTO streams SELECT 'more', device, stamped, nominal_hz, "
		 "delay_ns, delay_sd_ns, grain_ns, rows, lost, late, rate_hz, drift_ppm, "
		 "drift_sd_ppm, jitter_ns, jitter_max_ns, offset_ns, offset_sd_ns, ended "
		 "FROM streams; INSERT INTO streams SELECT 'more too', device, stamped, "
		 "nominal_hz, delay_ns, delay_sd_ns, grain_ns, rows, lost, late, rate_hz, "
		 "drift_ppm, drift_sd_ppm, jitter_ns, jitter_max_ns, offset_ns, "
		 "offset_sd_ns, ended FROM streams WHERE name = 'more'",
		 false},
	};

	record("good.rec", "sim:clock=simulated", 2000 * MS);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_row_times times;
		struct incise_stream streams[INCISE_STREAMS_MAX];
		struct incise_recording *recording;

		assert_int_equal(system("rm -rf a.rec && cp -r good.rec a.rec"), 0);
		if (strstr(cases[i].sql, "'more'")) /* one name only */
			change(DB, "DELETE FROM streams WHERE name = 'force'");
		if (strstr(cases[i].sql, "name = ''"))
			change(DB, "DELETE FROM streams WHERE name = 'force'");
		change(DB, cases[i].sql);
		if (strstr(cases[i].sql, "'more'"))
			change(DB, "INSERT INTO streams SELECT 'last', device, stamped, "
				   "nominal_hz, delay_ns, delay_sd_ns, grain_ns, rows, "
				   "lost, late, rate_hz, drift_ppm, drift_sd_ppm, "
				   "jitter_ns, jitter_max_ns, offset_ns, offset_sd_ns, "
				   "ended FROM streams WHERE name = 'more'");
		recording = incise_recording_open("a.rec", &err);
		if (!recording)
			fail_msg("%s: %s", cases[i].sql, err.text);
		assert_error(cases[i].knots
				     ? incise_row_times_open(&times, recording, "tracker",
							     &err)
				     : incise_recording_streams(recording, streams, &err),
			     EINVAL, &err,
			     "a.rec:", cases[i].knots ? "knots" : "streams");
		incise_recording_close(recording);
	}
}
