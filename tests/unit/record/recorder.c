// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/recorder.c: on the virtual rig, whose devices are made to fail by
 * putting other functions before theirs.
 */
#include "../unit.h"
#include <incise/verify.h>
#include "../../../lib/base/random.h"
#include "recorded.h"
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <incise/backend.h>
#include "../../../lib/record/read/cut.h"

#define SIM "sim:clock=simulated"
#define DB "a.rec/recording.db"

static struct incise_rig *rig;
static struct incise_recorder *rec;
static struct incise_recorder_stats stats;
static struct incise_recording *recording;
static struct incise_recording_info info;

static int start(void **state)
{
	int rc = enter_folder(state);

	rig = open_rig(SIM);
	rec = start_recorder("a.rec", rig);
	return rc;
}

static int stop(void **state)
{
	incise_rig_close(rig);
	return leave_folder(state);
}

static void open_info(void)
{
	recording = open_recording("a.rec");
	succeeds(!incise_recording_info(recording, &info, &err));
}

/* --- values ------------------------------------------------------------------------ */

TEST(rows_are_the_samples, IN_FOLDER)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_tracker_info info;
	struct incise_tracker_sample tracker[200];
	struct incise_force_sample force[12000];
	sqlite3_stmt *stmt;
	sqlite3 *db;
	int64_t truth_ns;
	int n_force, n_tracker, n = 0;

	record("a.rec", SIM, 1000 * MS);
	/* The same rig gives the same samples again. */
	incise_clock_wait_until(incise_rig_clock(rig),
				incise_clock_now(incise_rig_clock(rig)) + 1000 * MS);
	n_force = incise_force_read(incise_rig_force(rig), force, 12000);
	n_tracker = incise_tracker_read(incise_rig_tracker(rig), tracker, 200);
	incise_tracker_info(incise_rig_tracker(rig), &info);
	assert_true(n_force >= 10000 &&
		    n_tracker >= 118); /* 10 kHz, 120 Hz less latency */

	db = rows_look(DB);
	sqlite3_prepare_v2(db, "SELECT * FROM force", -1, &stmt, NULL);
	for (; sqlite3_step(stmt) == SQLITE_ROW; n++) {
		assert_int_equal(sqlite3_column_int64(stmt, 0), force[n].seq);
		assert_int_equal(sqlite3_column_int64(stmt, 1), force[n].t_ns);
		assert_int_equal(sqlite3_column_int(stmt, 2), force[n].code);
	}
	sqlite3_finalize(stmt);
	assert_int_equal(n, n_force);
	n = 0;
	sqlite3_prepare_v2(db,
			   "SELECT t.*, depth_mm, velocity_mm_s FROM tracker t "
			   "JOIN depth USING(seq) ORDER BY seq",
			   -1, &stmt, NULL);
	for (; sqlite3_step(stmt) == SQLITE_ROW; n++) {
		assert_int_equal(sqlite3_column_int64(stmt, 0), tracker[n].seq);
		/*
		 * Acquired every 1 / (120 Hz · (1 + 50 ppm)), and 4.2 ms later here at
		 * the earliest: half-normal jitter of 0.2 ms goes in the first second
		 * from its mean, 0.16 ms, to what the line below the arrivals leaves.
		 */
		truth_ns = tracker[0].t_ns - info.latency_ns +
			   llround(n * 1e9 / (info.rate_hz * 1.00005));
		assert_in_range(sqlite3_column_int64(stmt, 1) - truth_ns + 1000000, 0,
				1500000);
		assert_true(sqlite3_column_int64(stmt, 1) <= tracker[n].t_ns - 3200000);
		assert_int_equal(sqlite3_column_int64(stmt, 2), tracker[n].t_ns);
		/* doubles are kept bit by bit */
		for (int i = 0; i < 3; i++)
			assert_true(sqlite3_column_double(stmt, 3 + i) ==
				    tracker[n].position_mm[i]);
		for (int i = 0; i < 4; i++)
			assert_true(sqlite3_column_double(stmt, 6 + i) ==
				    tracker[n].quaternion[i]);
		assert_string_equal((const char *)sqlite3_column_text(stmt, 10), " ");
		assert_int_equal(sqlite3_column_int(stmt, 11), 1); /* station */
		assert_int_equal(sqlite3_column_int(stmt, 12), 0); /* button */
		/* the default surface is z = 0 */
		assert_true(sqlite3_column_double(stmt, 13) ==
			    -tracker[n].position_mm[2]);
		assert_true(sqlite3_column_double(stmt, 14) >= 0);
	}
	sqlite3_finalize(stmt);
	sqlite3_close(db);
	assert_int_equal(n, n_tracker);
	incise_rig_close(rig);
}

TEST(ledger_counts_the_rows, IN_FOLDER)
{
	record("a.rec", SIM, 1000 * MS);
	for (int i = 0; i < 2; i++) {
		const char *stream = i ? "tracker" : "force";
		char sql[400];
		int rows;

		snprintf(sql, sizeof(sql), "SELECT count(*) FROM %s", stream);
		rows = ask(DB, sql);
		assert_true(rows >= (i ? 118 : 10000));
		/* each row in one block, and the blocks one after the other */
		snprintf(sql, sizeof(sql),
			 "SELECT count(*) FROM %s r JOIN blocks l ON l.stream='%s' AND "
			 "r.seq BETWEEN l.first_seq AND l.last_seq AND r.t_ns BETWEEN "
			 "l.first_ns AND l.last_ns",
			 stream, stream);
		assert_int_equal((int)ask(DB, sql), rows);
		snprintf(sql, sizeof(sql),
			 "SELECT sum(count) + 1000000 * sum(lost) FROM blocks WHERE "
			 "stream='%s'",
			 stream);
		assert_int_equal((int)ask(DB, sql), rows);
		/* a block per commit, and the end */
		snprintf(
			sql, sizeof(sql),
			"SELECT count(*) FROM blocks WHERE stream='%s' AND (count > 0) = "
			"(block < 10)",
			stream);
		assert_int_equal((int)ask(DB, sql), 11);
	}
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM streams"), 2);
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM frames"), 0);
}

TEST(closed_recording_is_one_file, IN_FOLDER)
{
	record("a.rec", SIM, 700 * MS);
	assert_int_equal(access("a.rec.part", F_OK), -1);
	assert_int_equal(access(DB "-wal", F_OK), -1);
	assert_int_equal(access(DB "-shm", F_OK), -1);
	assert_int_equal((int)ask(DB, "SELECT value FROM meta WHERE key='complete'"), 1);
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM events WHERE kind IN "
				      "('start', 'zero', 'end')"),
			 3);
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM pragma_integrity_check "
				      "WHERE integrity_check = 'ok'"),
			 1);
}

TEST(zero_is_the_mean_at_rest, IN_FOLDER)
{
	record("a.rec", SIM, 1500 * MS);
	/* Noise of 3 mV over 5000 samples: sd of the mean 0.042 mV; five of them, and the
	 * converter's rounding, which noise of 2.5 LSB spreads out evenly. */
	assert_true(fabs(ask(DB, "SELECT value FROM meta WHERE key='force_zero_mV'") -
			 180) < 0.22);
	assert_int_equal(
		(int)ask(DB, "SELECT value FROM meta WHERE key='force_zero_samples'"),
		5000);
	/* and it is that mean to the last digits */
	assert_true(
		fabs(ask(DB,
			 "SELECT value - (SELECT avg(code) * 5000.0 / 4096 FROM force "
			 "WHERE seq < 5000) FROM meta WHERE key='force_zero_mV'")) <
		1e-9);
}

TEST(given_zero_is_taken, IN_FOLDER)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_calibration calibration = {
		.force_mV_N = 1000, .force_zero_mV = 200, .depth_mm_px = 0.1};
	struct incise_recorder *rec = incise_recorder_new(
		"a.rec", rig,
		&(struct incise_recorder_setup){.calibration = &calibration}, &err);

	assert_non_null(rec);
	incise_recorder_stats(rec, &stats);
	assert_true(stats.zero_mV == 200);
	assert_int_equal(poll_for(rec, rig, 100 * MS, &err), 0);
	incise_recorder_stats(rec, &stats);
	/* 180 mV with noise of 3 mV, rounded to 1.2 mV: five sd and a half LSB */
	assert_true(fabs(stats.force_N - (180 - 200) / 1000.0) < 0.016);
	assert_int_equal(incise_recorder_close(rec, &err), 0);
	assert_int_equal((int)ask(DB, "SELECT value FROM meta WHERE key='force_mV_N'"),
			 1000);
	incise_rig_close(rig);
}

TEST(short_recording_makes_do, IN_FOLDER)
{
	record("a.rec", SIM, 100 * MS);
	/* 1000 samples: sd of the mean 0.095 mV, five of them */
	assert_true(fabs(ask(DB, "SELECT value FROM meta WHERE key='force_zero_mV'") -
			 180) < 0.5);
}

TEST(stats_count_what_is_written, start, stop)
{
	incise_recorder_stats(rec, &stats);
	assert_true(!stats.force && !stats.tracker && isnan(stats.zero_mV));
	assert_int_equal(poll_for(rec, rig, 4000 * MS, &err), 0);
	incise_recorder_stats(rec, &stats);
	assert_true(stats.depth_mm > INCISE_CUT_START_MM); /* a cut is under way */
	assert_true(stats.force_N > 0);
	assert_int_equal(stats.force_lost + stats.tracker_lost, 0);
	assert_int_equal(incise_recorder_close(rec, &err), 0);
	assert_int_equal(stats.force, (int)ask(DB, "SELECT count(*) FROM force"));
	assert_int_equal(stats.tracker, (int)ask(DB, "SELECT count(*) FROM tracker"));
	assert_int_equal(stats.depth, (int)ask(DB, "SELECT count(*) FROM depth"));
}

/* --- names -------------------------------------------------------------------------- */

static void refused(const char *path, struct incise_rig *rig, int code, const char *text)
{
	struct incise_calibration calibration;

	incise_calibration_nominal(&calibration);
	assert_error(incise_recorder_new(
			     path, rig,
			     &(struct incise_recorder_setup){.calibration = &calibration},
			     &err),
		     code, &err, text);
}

TEST(existing_names_are_refused, IN_FOLDER)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_rig *bare = incise_rig_open(SIM, INCISE_RIG_CAMERA, NULL);

	assert_non_null(bare);
	mkdir("there.rec", 0777);
	mkdir("left.rec.part", 0777);
	fclose(fopen("file.rec", "w"));
	symlink("nowhere", "link.rec");
	refused("there.rec", rig, EEXIST, "there.rec: exists; record");
	refused("there.rec///", rig, EEXIST, "there.rec: exists; record");
	refused("file.rec", rig, EEXIST, "exists; record");
	refused("link.rec", rig, EEXIST, "exists; record");
	refused("left.rec", rig, EEXIST,
		"left.rec.part: left by an interrupted recording");
	refused("no/such/a.rec", rig, ENOENT, "no/such/");
	refused("file.rec/a.rec", rig, ENOTDIR, "file.rec/");
	refused("", rig, EINVAL, "not a name");
	refused("..", rig, EINVAL, "not a name");
	refused("a.rec", bare, ENODEV, "needs a tracker");
	assert_int_equal(access("a.rec.part", F_OK), -1);
	assert_int_equal(access("there.rec.part", F_OK), -1);
	incise_rig_close(rig);
	incise_rig_close(bare);
}

TEST(name_taken_meanwhile_is_kept, start, stop)
{
	assert_int_equal(poll_for(rec, rig, 600 * MS, &err), 0);
	mkdir("a.rec", 0777);
	assert_error(incise_recorder_close(rec, &err), EEXIST, &err, "a.rec.part");
	recording = open_recording("a.rec.part");
	incise_recording_close(recording);
}

TEST(interrupted_recording_knows_its_losses, start, stop)
{
	pid_t pid = fork();

	if (!pid) {
		poll_for(rec, rig, 1000 * MS, &err);
		/* The virtual devices hold some seconds; a minute is too much for them. */
		incise_clock_wait_until(incise_rig_clock(rig),
					incise_clock_now(incise_rig_clock(rig)) +
						60000 * MS);
		poll_for(rec, rig, 200 * MS, &err);
		_exit(0);
	}
	waitpid(pid, NULL, 0);
	open_info();
	/* At least half of the 600000 and 7200. */
	assert_true(info.force_lost > 300000 && info.tracker_lost > 3600);
	/* The numbers show the same; the recorder has locked its own. */
	assert_int_equal(system("cp -r a.rec.part b.rec.part"), 0);
	assert_int_equal(info.force_lost,
			 (int)ask("b.rec.part/recording.db",
				  "SELECT max(seq) + 1 - count(*) FROM force"));
	assert_int_equal((int)ask("b.rec.part/recording.db",
				  "SELECT count(*) FROM events WHERE kind = 'lost'"),
			 2);
	incise_recording_close(recording);
	incise_recorder_close(rec, NULL); /* the parent's own, of no further use */
}

/* --- faults of devices --------------------------------------------------------------- */

/* The effect of a fault on the samples of one read; returns their number, or -errno. */
static int (*force_fault)(struct incise_force_sample *samples, int n);
static int (*tracker_fault)(struct incise_tracker_sample *samples, int n);
static struct incise_force_ops force_ops;
static struct incise_tracker_ops tracker_ops;
static const struct incise_force_ops *force_real;
static const struct incise_tracker_ops *tracker_real;

static int faulty_force(struct incise_force *force, struct incise_force_sample *samples,
			int n)
{
	n = force_real->read(force, samples, n);
	return n > 0 && force_fault ? force_fault(samples, n) : n;
}

static int faulty_tracker(struct incise_tracker *tracker,
			  struct incise_tracker_sample *samples, int n)
{
	n = tracker_real->read(tracker, samples, n);
	return n > 0 && tracker_fault ? tracker_fault(samples, n) : n;
}

/* The device's message about its end; empty: none. */
static const char *force_reason;

static int force_cause(struct incise_force *force, char *text, size_t size)
{
	return snprintf(text, size, "%s", force_reason);
}

static struct incise_rig *faulty_rig(void)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_force *force = incise_rig_force(rig);
	struct incise_tracker *tracker = incise_rig_tracker(rig);

	force_real = force->ops;
	tracker_real = tracker->ops;
	force_ops = *force_real;
	tracker_ops = *tracker_real;
	force_ops.read = faulty_force;
	force_ops.cause = force_cause;
	force_reason = "";
	tracker_ops.read = faulty_tracker;
	force->ops = &force_ops;
	tracker->ops = &tracker_ops;
	force_fault = NULL;
	tracker_fault = NULL;
	return rig;
}

static int gone(struct incise_force_sample *samples, int n)
{
	return samples[0].seq > 8000 ? -ENODEV : n;
}

static int repeated(struct incise_force_sample *samples, int n)
{
	if (samples[0].seq > 8000)
		samples[0].seq = 5;
	return n;
}

static int too_large(struct incise_force_sample *samples, int n)
{
	if (samples[0].seq > 8000)
		samples[0].code = 4096;
	return n;
}

static int broken_wire(struct incise_force_sample *samples, int n)
{
	for (int i = 0; i < n; i++)
		samples[i].code = 4095;
	return n;
}

static int shaken(struct incise_force_sample *samples, int n)
{
	/* ±0.1 N at 1240 mV/N are ±102 codes */
	for (int i = 0; i < n; i++)
		samples[i].code += samples[i].seq / 100 % 2 ? 102 : -102;
	return n;
}

static int in_tissue(struct incise_tracker_sample *samples, int n)
{
	for (int i = 0; i < n; i++)
		samples[i].position_mm[2] = -2;
	return n;
}

static void from_minus_2_5_V(const struct incise_force *force,
			     struct incise_force_info *info)
{
	force_real->info(force, info);
	info->offset_V = -2.5;
}

/* A range that does not begin at 0 V moves the zero, not the force. */
TEST(force_is_that_of_the_voltage, IN_FOLDER)
{
	struct incise_recording_info at_0, moved, old;

	record("a.rec", SIM, 4000 * MS);
	for (int i = 0; i < 3; i++) {
		const char *path = i ? "b.rec" : "a.rec";
		struct incise_recording_info *info = i == 0   ? &at_0
						     : i == 1 ? &moved
							      : &old;

		if (i == 1) {
			struct incise_rig *rig = faulty_rig();
			struct incise_recorder *rec;

			force_fault = NULL;
			tracker_fault = NULL;
			force_ops.info = from_minus_2_5_V;
			rec = start_recorder(path, rig);
			assert_int_equal(poll_for(rec, rig, 4000 * MS, &err), 0);
			assert_int_equal(incise_recorder_close(rec, &err), 0);
			incise_rig_close(rig);
		}
		if (i == 2) /* recordings from before know of none */
			change("b.rec/recording.db",
			       "DELETE FROM meta WHERE key = 'force_offset_V'");
		recording = incise_recording_open(path, &err);
		succeeds(recording && !incise_recording_measure(recording, info, &err));
		incise_recording_close(recording);
	}
	assert_true(at_0.force_max_N > 0.1);
	assert_true(at_0.offset_V == 0 && moved.offset_V == -2.5 && old.offset_V == 0);
	assert_true(fabs(moved.zero_mV - at_0.zero_mV + 2500) < 1e-9);
	assert_true(fabs(moved.force_max_N - at_0.force_max_N) < 1e-9);
	/* 2500 mV over 1240 mV/N */
	assert_true(fabs(old.force_max_N - at_0.force_max_N - 2500 / 1240.0) < 1e-9);
}

/* A device that fails ends its stream; the other goes on, and the recording is whole. */
TEST(failures_of_devices, IN_FOLDER)
{
	static const struct {
		const char *what;
		int (*force)(struct incise_force_sample *samples, int n);
		const char *cause, *text;
	} cases[] = {
		{"unplugged", gone, "", "gone"},
		{"it tells why", gone, "the channel: its clock stands still; wind it up",
		 "the channel: its clock stands still; wind it up"},
		{"number twice", repeated, "", "force"},
		{"code out of range", too_large, "", "4096"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = faulty_rig();
		struct incise_recorder *rec = start_recorder("a.rec", rig);
		char sql[300];

		force_fault = cases[i].force;
		force_reason = cases[i].cause;
		if (poll_for(rec, rig, 2000 * MS, &err))
			fail_msg("%s: %s", cases[i].what, err.text);
		incise_recorder_stats(rec, &stats);
		assert_int_equal(stats.n_streams, 2);
		assert_says(stats.streams[0].ended, cases[i].text);
		assert_string_equal(stats.streams[1].ended, "");
		/* 0.8 s of force, in polls of 10 ms; 2 s of the tracker, less its latency */
		assert_in_range(stats.force, 7900, 8101);
		assert_in_range(stats.tracker, 238, 240);
		assert_int_equal(incise_recorder_close(rec, &err), 0);
		snprintf(sql, sizeof(sql),
			 "SELECT count(*) FROM events JOIN streams ON text LIKE "
			 "'force: %%' AND instr(text, ended) AND instr(ended, '%s') "
			 "WHERE kind = 'failed' AND name = 'force'",
			 cases[i].text);
		assert_int_equal((int)ask(DB, sql), 1);
		assert_int_equal((int)ask(DB, "SELECT count(*) FROM streams WHERE ended "
					      "IS NULL AND name = 'tracker'"),
				 1);
		assert_int_equal(system("rm -r a.rec"), 0);
		incise_rig_close(rig);
	}
}

static int tracker_gone(struct incise_tracker_sample *samples, int n)
{
	return samples[0].seq > 100 ? -ENODEV : n;
}

TEST(ends_when_no_device_is_left, IN_FOLDER)
{
	struct incise_rig *rig = faulty_rig();
	struct incise_recorder *rec = start_recorder("a.rec", rig);

	force_fault = gone;
	tracker_fault = tracker_gone;
	assert_int_equal(poll_for(rec, rig, 2000 * MS, &err), 1);
	assert_says(err.text, "a.rec:");
	assert_int_equal(incise_recorder_poll(rec, &err), 1);
	assert_int_equal(incise_recorder_close(rec, &err), 0);
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM events WHERE kind='failed'"),
			 2);
	incise_rig_close(rig);
}

TEST(refuses_a_zero_that_is_none, IN_FOLDER)
{
	static const struct {
		const char *what;
		int (*force)(struct incise_force_sample *samples, int n);
		int (*tracker)(struct incise_tracker_sample *samples, int n);
		const char *text;
	} cases[] = {
		{"clipping at rest", broken_wire, NULL, "end of its range"},
		{"shaken at rest", shaken, NULL, "the force varied by 0.10"},
		{"blade in the tissue", NULL, in_tissue, "2.0 mm deep"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = faulty_rig();
		struct incise_recorder *rec = start_recorder("a.rec", rig);

		force_fault = cases[i].force;
		tracker_fault = cases[i].tracker;
		assert_error(poll_for(rec, rig, 2000 * MS, &err), EBUSY, &err,
			     cases[i].text);
		assert_int_equal(incise_recorder_poll(rec, &err), -EBUSY);
		assert_int_equal(incise_recorder_close(rec, &err), -EBUSY);
		assert_int_equal(access("a.rec", F_OK), -1);
		assert_int_equal(access("a.rec.part", F_OK), -1);
		incise_rig_close(rig);
	}
}

static int lossy(struct incise_force_sample *samples, int n)
{
	memmove(samples + 20, samples + 23, (n - 23) * sizeof(*samples));
	return n - 3;
}

static int doubtful(struct incise_tracker_sample *samples, int n)
{
	for (int i = 0; i < n; i++) {
		if (samples[i].seq == 50)
			samples[i].position_mm[1] = NAN;
		if (samples[i].seq == 60) {
			samples[i].status = 'x';
			samples[i].position_mm[2] = 1e3;
		}
	}
	return n;
}

TEST(losses_are_counted_and_doubts_kept, IN_FOLDER)
{
	struct incise_rig *rig = faulty_rig();
	struct incise_recorder *rec = start_recorder("a.rec", rig);

	force_fault = lossy;
	tracker_fault = doubtful;
	assert_int_equal(poll_for(rec, rig, 1000 * MS, &err), 0);
	incise_recorder_stats(rec, &stats);
	assert_int_equal(incise_recorder_close(rec, &err), 0);
	assert_int_equal(stats.force_lost, 300); /* 3 in each of 100 polls */
	assert_int_equal(stats.tracker_lost, 1);
	assert_int_equal((int)ask(DB, "SELECT value FROM meta WHERE key='force_lost'"),
			 300);
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM tracker WHERE seq = 50"), 0);
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM tracker WHERE status = 'x'"),
			 1);
	assert_int_equal((int)ask(DB, "SELECT count(*) FROM depth WHERE seq IN (50, 60)"),
			 0);
	incise_rig_close(rig);
}

/* Samples before and after these times do not come; of both devices. */
static int64_t comes_ns, goes_ns;

static int for_a_while(struct incise_force_sample *samples, int n)
{
	int kept = 0;

	for (int i = 0; i < n; i++)
		if (samples[i].t_ns >= comes_ns && samples[i].t_ns < goes_ns)
			samples[kept++] = samples[i];
	return kept;
}

static int poses_for_a_while(struct incise_tracker_sample *samples, int n)
{
	int kept = 0;

	for (int i = 0; i < n; i++)
		if (samples[i].t_ns >= comes_ns && samples[i].t_ns < goes_ns)
			samples[kept++] = samples[i];
	return kept;
}

/* Losses without a later sample: a device begins late, or is silent before the end. */
TEST(silence_at_the_ends_is_lost, IN_FOLDER)
{
	uint64_t random = 20261128;

	for (int i = 0; i < 24; i++) {
		struct incise_rig *rig = faulty_rig();
		struct incise_recorder *rec = start_recorder("a.rec", rig);
		int64_t start_ns = incise_clock_now(incise_rig_clock(rig));
		int64_t late_ns = (int64_t)(incise_random_next(&random) % (600 * MS));
		int64_t early_ns = (int64_t)(incise_random_next(&random) % (900 * MS));
		double missing_s = (late_ns > 270 * MS ? late_ns : 0) * 1e-9 +
				   (early_ns > 270 * MS ? early_ns : 0) * 1e-9;
		bool clear = llabs(late_ns - 250 * MS) > 20 * MS &&
			     llabs(early_ns - 250 * MS) > 20 * MS;
		const uint64_t force = (uint64_t)(missing_s * 10000),
			       poses = (uint64_t)(missing_s * 120);

		force_fault = for_a_while;
		tracker_fault = poses_for_a_while;
		comes_ns = start_ns + late_ns;
		goes_ns = start_ns + 2200 * MS - early_ns;
		assert_int_equal(poll_for(rec, rig, 2200 * MS, &err), 0);
		succeeds(!incise_recorder_end(rec, &err));
		incise_recorder_stats(rec, &stats);
		assert_int_equal(incise_recorder_close(rec, &err), 0);
		incise_rig_close(rig);
		/* polls are 10 ms apart, and a pose is underway for 4 */
		if (clear &&
		    (stats.force_lost + 210 < force || stats.force_lost > force + 210 ||
		     stats.tracker_lost + 4 < poses || stats.tracker_lost > poses + 4))
			fail_msg("late %lld, early %lld ms: %llu and %llu lost, not %llu "
				 "and %llu",
				 (long long)(late_ns / MS), (long long)(early_ns / MS),
				 (unsigned long long)stats.force_lost,
				 (unsigned long long)stats.tracker_lost,
				 (unsigned long long)force, (unsigned long long)poses);
		assert_int_equal((int)ask(DB, "SELECT value FROM meta WHERE key = "
					      "'force_lost'"),
				 (int)stats.force_lost);
		assert_int_equal((int)ask(DB, "SELECT sum(lost) FROM blocks WHERE stream "
					      "= 'force'"),
				 (int)stats.force_lost);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
}

/* --- what a kill costs --------------------------------------------------------------- */

int __real_sqlite3_exec(sqlite3 *db, const char *text,
			int (*row)(void *, int, char **, char **), void *user,
			char **error);
int __wrap_sqlite3_exec(sqlite3 *db, const char *text,
			int (*row)(void *, int, char **, char **), void *user,
			char **error);

/* A disk that takes time for each commit, by the rig's clock. */
static struct {
	struct incise_clock *clock;
	int64_t takes_ns;
	int64_t polled_ns; /* when what it commits was read */
	int64_t whole_ns;  /* all that was read until then is committed */
	int64_t worst_ns;
	const char *spoiled; /* command */
} disk;

int __wrap_sqlite3_exec(sqlite3 *db, const char *text,
			int (*row)(void *, int, char **, char **), void *user,
			char **error)
{
	int rc;

	/* Between the check of the files and what SQLite writes. */
	if (disk.spoiled && !strncmp(text, "COMMIT", 6)) {
		system(disk.spoiled);
		disk.spoiled = NULL;
	}
	if (!disk.clock || strncmp(text, "COMMIT", 6))
		return __real_sqlite3_exec(db, text, row, user, error);
	incise_clock_wait_until(disk.clock, incise_clock_now(disk.clock) + disk.takes_ns);
	/* Killed now, it would lose all since the commit before. */
	if (incise_clock_now(disk.clock) - disk.whole_ns > disk.worst_ns)
		disk.worst_ns = incise_clock_now(disk.clock) - disk.whole_ns;
	rc = __real_sqlite3_exec(db, text, row, user, error);
	disk.whole_ns = disk.polled_ns;
	return rc;
}

/* Commits that take this long, polls that far apart: the bound of incise-recording(5) holds. */
TEST(kill_costs_100_ms, IN_FOLDER)
{
	static const struct {
		int64_t takes_ns, apart_ns;
	} cases[] = {{0, 10 * MS},	{2 * MS, 10 * MS}, {12 * MS, 10 * MS},
		     {25 * MS, 7 * MS}, {1 * MS, 30 * MS}, {20 * MS, 20 * MS}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = open_rig(SIM);
		struct incise_clock *clock = incise_rig_clock(rig);
		struct incise_recorder *rec = start_recorder("a.rec", rig);
		int64_t next = incise_clock_now(clock);

		memset(&disk, 0, sizeof(disk));
		disk.takes_ns = cases[i].takes_ns;
		for (int k = 0; k < 400; k++) {
			/* As `incise capture` does it. */
			next += cases[i].apart_ns;
			if (next < incise_clock_now(clock))
				next = incise_clock_now(clock);
			incise_clock_wait_until(clock, next);
			/* The first commits show how long they take. */
			if (k == 50)
				disk.worst_ns = 0;
			disk.polled_ns = incise_clock_now(clock);
			if (!disk.clock)
				disk.whole_ns = disk.polled_ns;
			disk.clock = clock;
			succeeds(!incise_recorder_poll(rec, &err));
		}
		disk.clock = NULL;
		assert_int_equal(incise_recorder_close(rec, &err), 0);
		if (disk.worst_ns > 100 * MS || disk.worst_ns < 50 * MS)
			fail_msg(
				"commits of %.0f ms, polls each %.0f ms: %.1f ms are lost",
				disk.takes_ns * 1e-6, cases[i].apart_ns * 1e-6,
				disk.worst_ns * 1e-6);
		incise_rig_close(rig);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
}

/* What others do to a file of a recording that is written is noticed at the next commit. */
TEST(files_that_others_change, IN_FOLDER)
{
	static const struct {
		const char *command, *text;
	} cases[] = {
		{"truncate -s 0 a.rec.part/recording.db-wal",
		 "a.rec.part/recording.db-wal:"},
		{"truncate -s 50000 a.rec.part/recording.db-wal", "recording.db-wal:"},
		{"rm a.rec.part/recording.db-wal", "recording.db-wal:"},
		{"truncate -s 4096 a.rec.part/recording.db", "recording.db:"},
		{"cd a.rec.part && cp recording.db b && mv b recording.db",
		 "recording.db:"},
		{"rm -r a.rec.part", "was removed"},
	};

	for (size_t i = 0; i < 2 * sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = open_rig(SIM);
		struct incise_recorder *rec = start_recorder("a.rec", rig);
		struct incise_error err = {0}, second = {0};
		bool at_the_end = i % 2;

		/* Longer than SQLite's log before it is folded in: both files have rows. */
		assert_int_equal(poll_for(rec, rig, 20000 * MS, &err), 0);
		assert_int_equal(system(cases[i / 2].command), 0);
		if (!at_the_end)
			assert_int_equal(poll_for(rec, rig, 300 * MS, &err), -EIO);
		assert_int_equal(incise_recorder_close(rec, at_the_end ? &err : &second),
				 -EIO);
		assert_says(err.text, cases[i / 2].text);
		assert_int_equal(access("a.rec", F_OK), -1);
		incise_rig_close(rig);
		system("rm -rf a.rec.part");
	}
}

TEST(files_that_others_change_in_a_commit, IN_FOLDER)
{
	static const char *const commands[] = {
		"truncate -s 0 a.rec.part/recording.db-wal",
		"truncate -s 50000 a.rec.part/recording.db-wal",
	};

	for (size_t i = 0; i < sizeof(commands) / sizeof(*commands); i++) {
		struct incise_rig *rig = open_rig(SIM);
		struct incise_recorder *rec = start_recorder("a.rec", rig);
		struct incise_error err = {0}, second = {0};

		assert_int_equal(poll_for(rec, rig, 2000 * MS, &err), 0);
		disk.spoiled = commands[i];
		assert_error(poll_for(rec, rig, 300 * MS, &err), EIO, &err,
			     "recording.db-wal:");
		assert_int_equal(incise_recorder_close(rec, &second), -EIO);
		assert_int_equal(access("a.rec", F_OK), -1);
		incise_rig_close(rig);
		system("rm -rf a.rec.part");
	}
}

/* SQLite's index of the log is no file, in which a cut would be a SIGBUS. */
TEST(nothing_of_it_is_mapped, start, stop)
{
	assert_int_equal(poll_for(rec, rig, 500 * MS, &err), 0);
	if (!truncate("a.rec.part/recording.db-shm", 0)) {
		assert_int_equal(poll_for(rec, rig, 500 * MS, &err), 0);
		fail_msg("there is an index");
	}
	assert_int_not_equal(system("grep -q a.rec.part /proc/$PPID/maps"), 0);
	assert_int_equal(incise_recorder_close(rec, &err), 0);
}

TEST(reader_does_not_stop_the_end, start, stop)
{
	assert_int_equal(poll_for(rec, rig, 600 * MS, &err), 0);
	open_info();
	assert_false(info.complete);
	assert_int_equal(poll_for(rec, rig, 600 * MS, &err), 0);
	succeeds(!incise_recorder_close(rec, &err));
	incise_recording_close(recording);
	open_info();
	assert_true(info.complete);
	assert_true(info.force >= 12000); /* 1.2 s */
	incise_recording_close(recording);
}

/* Look into a.rec.part again and again, as someone does who waits for a recording. */
static void look_on(void)
{
	for (;;) {
		sqlite3 *db;

		if (sqlite3_open_v2("a.rec.part/recording.db", &db, SQLITE_OPEN_READONLY,
				    NULL) == SQLITE_OK)
			sqlite3_exec(db, "SELECT count(*) FROM force", NULL, NULL, NULL);
		sqlite3_close(db);
	}
}

/*
 * The moments in which SQLite lets no reader and writer be side by side are short: of
 * 40 recordings that did not wait for a reader a third failed.
 */
TEST(reader_does_not_stop_the_start, IN_FOLDER)
{
	pid_t reader = fork();

	assert_true(reader >= 0);
	if (!reader && !prctl(PR_SET_PDEATHSIG, SIGKILL))
		look_on();
	assert_true(reader);
	for (int i = 0; i < 40; i++) {
		struct incise_rig *rig = open_rig(SIM);
		struct incise_recorder *rec = start_recorder("a.rec", rig);

		if (poll_for(rec, rig, 100 * MS, &err) ||
		    incise_recorder_close(rec, &err))
			fail_msg("recording %d: %s", i, err.text);
		incise_rig_close(rig);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
	kill(reader, SIGKILL);
	assert_int_equal(waitpid(reader, NULL, 0), reader);
}

/*
 * Verify a.rec again and again while it is written, and write a byte before each: each copy is
 * whole. Returns the exit code.
 */
static int verify_on(int begins)
{
	for (int i = 0; i < 10; i++) {
		struct incise_verify_report report;
		int rc = write(begins, "", 1) != 1;

		if (!rc)
			rc = incise_verify("a.rec", NULL, &report, &err);
		if (rc || !report.interrupted || !report.intact) {
			print_error("verify %d: %d %s\n", i, rc, err.text);
			return 1;
		}
	}
	return 0;
}

TEST(copies_of_it_are_whole, start, stop)
{
	int status, begins[2];
	pid_t reader;
	char begun;

	assert_int_equal(poll_for(rec, rig, 200 * MS, &err), 0);
	assert_int_equal(pipe(begins), 0);
	reader = fork();
	assert_true(reader >= 0);
	if (!reader) {
		close(begins[0]);
		_exit(prctl(PR_SET_PDEATHSIG, SIGKILL) ? 2 : verify_on(begins[1]));
	}
	close(begins[1]);
	/* Five commits a copy: those of two do not spoil all of its 20 tries. */
	while (read(begins[0], &begun, 1) == 1)
		succeeds(!poll_for(rec, rig, 500 * MS, &err));
	close(begins[0]);
	assert_int_equal(waitpid(reader, &status, 0), reader);
	assert_int_equal(status, 0);
	succeeds(!incise_recorder_close(rec, &err));
}

TEST(closing_nothing)
{
	assert_int_equal(incise_recorder_close(NULL, NULL), 0);
}

/* --- free space ---------------------------------------------------------------------- */

/* A recorder that was stopped for a second has more of a commit than a block takes. */
TEST(a_stall_is_several_blocks, IN_FOLDER)
{
	struct incise_rig *rig = open_rig("sim:clock=simulated,force_hz=200000");
	struct incise_recorder *rec = start_recorder("a.rec", rig);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_verify_report report;

	assert_int_equal(poll_for(rec, rig, 100 * MS, &err), 0);
	incise_clock_wait_until(clock, incise_clock_now(clock) + 700 * MS);
	end_recorder(rec, rig, 200 * MS);
	assert_int_equal((int)ask(DB, "SELECT max(count) FROM blocks"), 65536);
	assert_int_equal((int)ask(DB,
				  "SELECT max(b) FROM (SELECT force - lag(force) OVER "
				  "(ORDER BY number) AS b FROM seal)"),
			 3);
	succeeds(!incise_verify("a.rec", NULL, &report, &err));
	assert_true(report.complete && report.intact && report.sealed);
	assert_int_equal(report.streams[0].present, 200000);
}

/* Not too little, so that the disk is not full before the end; not twice too much. */
TEST(expects_what_it_takes, IN_FOLDER)
{
	static const char *const specs[] = {SIM, SIM ",force_hz=50000",
					    SIM ",force_hz=100,tracker_hz=1000"};

	for (size_t i = 0; i < sizeof(specs) / sizeof(*specs); i++) {
		struct incise_rig *rig = open_rig(specs[i]);
		struct incise_calibration calibration;
		struct incise_recorder_setup setup = {.calibration = &calibration};
		struct incise_recorder *rec;
		double expected_s;
		struct stat st;

		incise_calibration_nominal(&calibration);
		rec = incise_recorder_new("a.rec", rig, &setup, &err);
		succeeds(rec);
		incise_recorder_stats(rec, &stats);
		expected_s = stats.bytes_per_s;
		assert_true(stats.disk_s > 0);
		assert_int_equal(poll_for(rec, rig, 10000 * MS, &err), 0);
		assert_int_equal(incise_recorder_close(rec, &err), 0);
		assert_int_equal(stat("a.rec/recording.db", &st), 0);
		if (st.st_size / 10.0 > expected_s || st.st_size / 10.0 < expected_s / 2)
			fail_msg("%s: %.0f bytes/s, expected %.0f", specs[i],
				 st.st_size / 10.0, expected_s);
		assert_int_equal(system("rm -r a.rec"), 0);
		incise_rig_close(rig);
	}
}

/* The same rate as that of a recorder on this rig. */
TEST(capacity_is_that_of_a_recorder, start, stop)
{
	struct incise_tracker_info tracker;
	struct incise_force_info force;
	struct incise_camera_info camera = {
		.rate_hz = 50, .width = 640, .height = 480, .pixels = INCISE_PIXELS_YUYV};
	double reserved, s;

	incise_tracker_info(incise_rig_tracker(rig), &tracker);
	incise_force_info(incise_rig_force(rig), &force);
	incise_recorder_stats(rec, &stats);
	/* bytes are reserved to end it in: what 0 s leaves */
	s = incise_recorder_capacity_s(1e12, &tracker, &force, NULL);
	reserved = 1e12 - s * stats.bytes_per_s;
	assert_true(reserved > 0 && reserved < 100e6);
	assert_true(incise_recorder_capacity_s(reserved, &tracker, &force, NULL) < 1e-3);
	assert_true(incise_recorder_capacity_s(0, &tracker, &force, NULL) == 0);
	/* frames take more: 85 % of 2 bytes per pixel at most, 10 MB/s at least */
	assert_true(1e12 / incise_recorder_capacity_s(1e12, NULL, NULL, &camera) > 10e6);
	assert_true(1e12 / incise_recorder_capacity_s(1e12, NULL, NULL, &camera) <
		    50.0 * 640 * 480 * 2);
	assert_true(isinf(incise_recorder_capacity_s(1e12, NULL, NULL, NULL)));
	assert_int_equal(incise_recorder_close(rec, NULL), 0);
}

TEST(refuses_what_no_disk_holds, IN_FOLDER)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_calibration calibration;
	/* 31 years of some 200 kB/s: 200 TB */
	struct incise_recorder_setup setup = {.calibration = &calibration,
					      .planned_s = 1e9};

	incise_calibration_nominal(&calibration);
	assert_error(incise_recorder_new("a.rec", rig, &setup, &err), ENOSPC, &err,
		     "a.rec");
	assert_int_equal(access("a.rec.part", F_OK), -1);
	incise_rig_close(rig);
}
