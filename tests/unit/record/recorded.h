/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A recording of the virtual rig in a folder of its own, for the tests of lib/record. */
#ifndef TEST_RECORDED_H
#define TEST_RECORDED_H

#include <ftw.h>
#include <limits.h>
#include <sys/stat.h>
#include <sqlite3.h>
#include <incise/calibration.h>
#include <incise/recorder.h>
#include <incise/recording.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "../../rows_sql.h"
#include "../unit.h"

/* All 14 cuts of the paper, but short: 43 s. */
#define SHORT_SCRIPT "sim:clock=simulated,cut_s=2,pause_s=1"
#define BOTH (INCISE_RIG_TRACKER | INCISE_RIG_FORCE)
#define POLL_NS 10000000LL
#define MS 1000000LL

__attribute__((unused)) static int remove_entry(const char *path, const struct stat *st,
						int type, struct FTW *walk)
{
	return remove(path);
}

#define FRAMES_4                                                                      \
	"CREATE TABLE main.frames(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "   \
	"arrival_ns INTEGER NOT NULL, pts INTEGER NOT NULL, bytes INTEGER NOT NULL, " \
	"crc INTEGER NOT NULL, length_px REAL, sd_px REAL, depth_mm REAL, quality REAL"

/* Makes a recording of form 4, with a row a sample, of one of today; the ledger has no CRCs of rows. */
#define TO_FORM_4                                                                    \
	"CREATE TABLE main.force(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "   \
	"code INTEGER NOT NULL); INSERT INTO main.force SELECT * FROM temp.force; "  \
	"CREATE TABLE main.tracker(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, " \
	"arrival_ns INTEGER NOT NULL, x_mm REAL NOT NULL, y_mm REAL NOT NULL, "      \
	"z_mm REAL NOT NULL, qw REAL NOT NULL, qx REAL NOT NULL, "                   \
	"qy REAL NOT NULL, qz REAL NOT NULL, status TEXT NOT NULL, "                 \
	"station INTEGER NOT NULL, button INTEGER NOT NULL); "                       \
	"INSERT INTO main.tracker SELECT * FROM temp.tracker; "                      \
	"CREATE TABLE main.depth(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "   \
	"depth_mm REAL NOT NULL, velocity_mm_s REAL NOT NULL); "                     \
	"INSERT INTO main.depth SELECT seq, t_ns, depth_mm, velocity_mm_s FROM "     \
	"temp.depth; " FRAMES_4 ", sha256 BLOB NOT NULL); "                          \
	"INSERT INTO main.frames SELECT * FROM temp.frames; "                        \
	"CREATE TABLE main.wall(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "    \
	"tai_ns INTEGER NOT NULL, uncertainty_ns REAL, rate_ppb REAL NOT NULL, "     \
	"rate_uncertainty_ppb REAL NOT NULL, utc_offset_s INTEGER NOT NULL, "        \
	"held INTEGER NOT NULL, source TEXT NOT NULL, reference TEXT NOT NULL, "     \
	"leap TEXT NOT NULL, restart TEXT NOT NULL); "                               \
	"INSERT INTO main.wall SELECT * FROM temp.wall; "                            \
	"INSERT INTO ledger SELECT stream, block, first_seq, last_seq, first_ns, "   \
	"last_ns, count, lost, crc FROM blocks; DROP TABLE blocks; PRAGMA user_version=4"

/* Makes one of form 3, from before the seal. */
#define TO_FORM_3                                                                   \
	TO_FORM_4 "; DROP TABLE seal; ALTER TABLE main.frames DROP COLUMN sha256; " \
		  "PRAGMA user_version=3"

/* Makes one of form 2, from before there was wall time. */
#define TO_FORM_2 TO_FORM_3 "; DROP TABLE main.wall; PRAGMA user_version=2"

/* Makes one of form 1, from before the ledger. */
#define TO_FORM_1                                                                       \
	TO_FORM_2                                                                       \
	"; DROP TABLE main.tracker; "                                                   \
	"CREATE TABLE main.tracker(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "    \
	"arrival_ns INTEGER NOT NULL, x_mm REAL NOT NULL, y_mm REAL NOT NULL, "         \
	"z_mm REAL NOT NULL, qw REAL NOT NULL, qx REAL NOT NULL, "                      \
	"qy REAL NOT NULL, qz REAL NOT NULL, status TEXT NOT NULL); "                   \
	"INSERT INTO main.tracker SELECT seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, " \
	"qx, qy, qz, status FROM temp.tracker; DROP TABLE main.frames; "                \
	"DROP TABLE streams; DROP TABLE knots; DROP TABLE ledger; PRAGMA user_version=1"

/* For setup and teardown: a folder as the working folder, so that paths are short. */
__attribute__((unused)) static int enter_folder(void **state)
{
	char path[] = "/tmp/incise-record-XXXXXX";

	if (!mkdtemp(path) || chdir(path))
		return -1;
	*state = strdup(path);
	return 0;
}

#define IN_FOLDER enter_folder, leave_folder
#define WITH_MODULES enter_with_modules, leave_folder

/* And with the modules that are in O/lib/incise, beside O/tests/unit/record/. */
__attribute__((unused)) static int enter_with_modules(void **state)
{
	char own[PATH_MAX] = "", path[PATH_MAX + 40];

	/* qemu-user follows this link for readlink() alone. */
	if (readlink("/proc/self/exe", own, sizeof(own) - 1) < 0)
		return -1;
	for (int i = 0; i < 4; i++)
		*strrchr(own, '/') = '\0';
	snprintf(path, sizeof(path), "%s/lib/incise", own);
	setenv("INCISE_MODULE_PATH", path, 1);
	return enter_folder(state);
}

/* Whether the module that writes and reads frames was built. */
__attribute__((unused)) static bool has_frames(void)
{
	char path[PATH_MAX];

	snprintf(path, sizeof(path), "%s/frames_mkv.so", getenv("INCISE_MODULE_PATH"));
	return !access(path, R_OK);
}

__attribute__((unused)) static int leave_folder(void **state)
{
	int rc = chdir("/") || nftw(*state, remove_entry, 8, FTW_DEPTH | FTW_PHYS);

	free(*state);
	return rc;
}

__attribute__((unused)) static struct incise_rig *open_rig(const char *spec)
{
	struct incise_rig *rig = incise_rig_open(spec, BOTH, &err);

	succeeds(rig);
	return rig;
}

/* Poll until the rig's clock has gone on by so much; stops at a failure. */
__attribute__((unused)) static int poll_for(struct incise_recorder *recorder,
					    struct incise_rig *rig, int64_t duration_ns,
					    struct incise_error *err)
{
	struct incise_clock *clock = incise_rig_clock(rig);
	int64_t end = incise_clock_now(clock) + duration_ns;
	int rc = 0;

	while (!rc && incise_clock_now(clock) < end) {
		incise_clock_wait_until(clock, incise_clock_now(clock) + POLL_NS);
		rc = incise_recorder_poll(recorder, err);
	}
	return rc;
}

/* @setup without a calibration: with the nominal one */
__attribute__((unused)) static struct incise_recorder *start_recorder_by(
	const char *path, struct incise_rig *rig, struct incise_recorder_setup setup)
{
	struct incise_calibration calibration;
	struct incise_recorder *recorder;

	incise_calibration_nominal(&calibration);
	if (!setup.calibration)
		setup.calibration = &calibration;
	recorder = incise_recorder_new(path, rig, &setup, &err);
	succeeds(recorder);
	return recorder;
}

__attribute__((unused)) static struct incise_recorder *start_recorder(
	const char *path, struct incise_rig *rig)
{
	return start_recorder_by(path, rig, (struct incise_recorder_setup){0});
}

/* Poll for so long, and close both. */
__attribute__((unused)) static void end_recorder(struct incise_recorder *recorder,
						 struct incise_rig *rig,
						 int64_t duration_ns)
{
	succeeds(!poll_for(recorder, rig, duration_ns, &err) &&
		 !incise_recorder_close(recorder, &err));
	incise_rig_close(rig);
}

/* Record a whole script, or the first duration_ns of it. */
__attribute__((unused)) static void record(const char *path, const char *spec,
					   int64_t duration_ns)
{
	struct incise_rig *rig = open_rig(spec);

	end_recorder(start_recorder(path, rig), rig,
		     duration_ns ? duration_ns
				 : incise_sim_duration(incise_rig_sim(rig)));
}

__attribute__((unused)) static struct incise_recording *open_recording(const char *path)
{
	struct incise_recording *recording = incise_recording_open(path, &err);

	succeeds(recording);
	return recording;
}

/* A whole file as a text, to be freed. */
__attribute__((unused)) static char *text_of(const char *path)
{
	FILE *file = fopen(path, "r");
	size_t size = 0;
	char *text = NULL;

	assert_non_null(file);
	if (getdelim(&text, &size, EOF, file) < 0)
		*text = 0;
	fclose(file);
	return text;
}

/* Run SQL on a database, as a stranger would. */
__attribute__((unused)) static void change(const char *file, const char *sql)
{
	char *text;

	if (rows_sql(file, false, sql, NULL, NULL, &text))
		fail_msg("%s: %s", sql, text);
}

/* The same, with a format. */
__attribute__((unused, format(printf, 2, 3))) static void change_by(const char *file,
								    const char *format,
								    ...)
{
	va_list arguments;
	char *sql;

	va_start(arguments, format);
	assert_true(vasprintf(&sql, format, arguments) > 0);
	va_end(arguments);
	change(file, sql);
	free(sql);
}

static void take_number(void *user, sqlite3_stmt *stmt)
{
	double *value = user;

	if (isnan(*value))
		*value = sqlite3_column_double(stmt, 0);
}

/* One number by SQL. */
__attribute__((unused)) static double ask(const char *file, const char *sql)
{
	double value = NAN;
	char *text;

	if (rows_sql(file, true, sql, take_number, &value, &text) || isnan(value))
		fail_msg("%s: %s", sql, text ? text : "no row");
	return value;
}

#endif
