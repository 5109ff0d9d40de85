// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of joined recordings, lib/record/join and lib/record/read/session.c. Machine a's clock is
 * the true time, less 1000 s of TAI; that of b is 3 s ahead, and 50 ppm slow:
 *
 *     b's reading = (t + 3 s) / (1 + 50e-6)
 *
 * Both record the same motion (the same seed); b's rows are put on b's clock by SQL here, with a
 * formula that the code under test never sees.
 */
#include "../unit.h"
#include "recorded.h"
#include <incise/session.h>
#include <incise/verify.h>
#include "../../../lib/base/random.h"
#include "../../../lib/record/join/align.h"
#include "../../../lib/record/read/session.h"

#define A "a.rec/recording.db"
#define B "b.rec/recording.db"
#define SPEC "sim:clock=simulated,cut_s=2,pause_s=1"
#define S 1000000000LL
#define BOUND_NS 20000.0 /* that each clock states */

/* A time of a, in SQL, on b's clock. */
#define ON_B(t) "CAST(round((" t " + 3000000000) / 1.00005) AS INTEGER)"

/* Put the rows of a recording on b's clock. */
static void move_to_b(const char *file)
{
	change(file, "UPDATE force SET t_ns = " ON_B("t_ns"));
	change(file, "UPDATE tracker SET t_ns = " ON_B("t_ns") ", arrival_ns = " ON_B(
			     "arrival_ns"));
	change(file, "UPDATE knots SET t_ns = " ON_B("t_ns"));
	change(file, "UPDATE events SET t_ns = " ON_B("t_ns"));
}

static uint64_t random_state;

/* Give a recording points of wall time, a second apart, each wrong by less than its bound. */
static void set_wall(const char *file, bool is_b, const char *reference)
{
	char *sql = NULL;
	size_t size;
	FILE *out = open_memstream(&sql, &size);

	fprintf(out, "BEGIN; DELETE FROM wall;");
	for (int i = 0; i < 12; i++) {
		int64_t true_ns = S / 2 + i * S;
		int64_t t_ns =
			is_b ? llround((double)(true_ns + 3 * S) / 1.00005) : true_ns;
		int64_t tai_ns =
			1000 * S + true_ns +
			llround(0.9 * BOUND_NS * incise_random_symmetric(&random_state));

		fprintf(out,
			"INSERT INTO wall(seq, t_ns, tai_ns, uncertainty_ns, rate_ppb, "
			"rate_uncertainty_ppb, utc_offset_s, held, source, reference, "
			"leap, restart) VALUES(%d, %lld, %lld, %.1f, %.1f, 1000.0, 37, 0, "
			"'ptp', '%s', 'ptp', '');",
			i, (long long)t_ns, (long long)tai_ns, BOUND_NS,
			is_b ? 50000.0 : 0.0, reference);
	}
	fprintf(out, "COMMIT");
	fclose(out);
	change(file, sql);
	free(sql);
}

static void set_walls(bool moved)
{
	set_wall(A, false, "TAI");
	set_wall(B, moved, "TAI");
}

static void remove_session(const char *name)
{
	char command[100];

	snprintf(command, sizeof(command), "rm -rf %s", name);
	assert_int_equal(system(command), 0);
}

static void two_machines(int64_t duration_ns)
{
	record("a.rec", SPEC, duration_ns);
	record("b.rec", SPEC ",seed=1", duration_ns);
	move_to_b(B);
}

static const char *const both[] = {"a.rec", "b.rec"};

static int join(const struct incise_session_options *options, struct incise_error *err)
{
	*err = (struct incise_error){0};
	return incise_session_join(both, 2, options, "s.rec", err);
}

/* Compare b's poses and forces, by the session, with a's: largest difference, ns. */
static double largest_error_ns(void)
{
	struct incise_recording *a = open_recording("a.rec"),
				*s = open_recording("s.rec:b");
	struct incise_tracker_sample *expected, *found;
	struct incise_recording_value *force, *force_found;
	int n = incise_recording_poses(a, &expected, NULL);
	int n_force = incise_recording_values(a, "force", &force, NULL);
	double largest = 0;

	assert_true(n > 200 && n_force > 10000);
	assert_int_equal(incise_recording_poses(s, &found, NULL), n);
	assert_int_equal(incise_recording_values(s, "force", &force_found, NULL),
			 n_force);
	for (int i = 0; i < n; i++) {
		assert_true(found[i].position_mm[0] == expected[i].position_mm[0]);
		assert_true(!i || found[i].t_ns > found[i - 1].t_ns);
		largest = fmax(largest, fabs((double)(found[i].t_ns - expected[i].t_ns)));
	}
	for (int i = 0; i < n_force; i++) {
		assert_true(force_found[i].value == force[i].value);
		largest = fmax(largest,
			       fabs((double)(force_found[i].t_ns - force[i].t_ns)));
	}
	free(expected);
	free(found);
	free(force);
	free(force_found);
	incise_recording_close(a);
	incise_recording_close(s);
	return largest;
}

static struct incise_session_info info_of(int at)
{
	struct incise_recording *s = open_recording("s.rec:*");
	const struct incise_session_info *members;
	struct incise_session_info info;

	assert_true(incise_session_members(s, &members) > at);
	info = members[at];
	incise_recording_close(s);
	return info;
}

/* 100 times, with other errors of the clocks: no time is wrong by more than is stated. */
TEST(test_clocks, IN_FOLDER)
{
	double worst = 0;

	two_machines(2 * S);
	for (int run = 0; run < 100; run++) {
		struct incise_session_info b;
		double error_ns;

		set_walls(true);
		if (join(&(struct incise_session_options){.within_s = 400e-6}, &err))
			fail_msg("%s", err.text);
		b = info_of(1);
		error_ns = largest_error_ns();
		worst = fmax(worst, error_ns);
		/* 2 ns: roundings of b's times, here and there. */
		if (error_ns > b.uncertainty_ns + 2)
			fail_msg("run %d: wrong by %g ns, stated %g ns", run, error_ns,
				 b.uncertainty_ns);
		assert_true(b.uncertainty_ns >= 2 * BOUND_NS);
		assert_true(fabs(b.rate_ppm - 50) < 1e6 * 4 * BOUND_NS / 2e9);
		assert_string_equal(b.method, "clocks");
		assert_true(b.overlap_ns > 1900 * MS);
		remove_session("s.rec");
	}
	/* A bound that is never approached would be none. */
	assert_true(worst > 0.5 * BOUND_NS);
}

/* A bound that --tolerance asks for and that is not reached is refused. */
TEST(test_refusals, IN_FOLDER)
{
	const char *const twice[] = {"a.rec", "a.rec"}, *const nested[] = {"s.rec",
									   "b.rec"};
	const struct incise_session_options any = {0}, close = {.within_s = 10e-6};

	two_machines(2 * S);
	/* No wall time at all. */
	assert_error(join(&any, &err), ENODATA, &err, "a.rec:");
	set_wall(A, false, "TAI");
	set_wall(B, true, "ptp:001122");
	assert_error(join(&any, &err), ENODATA, &err, "TAI", "ptp:001122");
	set_wall(B, true, "TAI");
	assert_error(join(&close, &err), ERANGE, &err, "b.rec:");
	/* Not synchronised: whatever it says, its error is not known. */
	change(B, "UPDATE wall SET uncertainty_ns = NULL");
	assert_true(join(&any, &err) < 0);
	assert_says(err.text, "b.rec");
	set_wall(B, true, "TAI");
	/* A clock that went back. */
	change(B, "UPDATE wall SET tai_ns = tai_ns - 2000000000, restart "
		  "= CASE seq WHEN 1 THEN 'step' ELSE '' END WHERE seq > 0");
	assert_true(join(&close, &err) < 0);
	assert_true(access("s.rec", F_OK) && access("s.rec.part", F_OK));
	set_wall(B, true, "TAI");
	assert_int_equal(incise_session_join(twice, 2, &any, "s.rec", &err), -EINVAL);
	assert_int_equal(join(&any, &err), 0);
	assert_int_equal(join(&any, &err), -EEXIST);
	assert_int_equal(incise_session_join(nested, 2, &any, "t.rec", &err), -EINVAL);
	/* A stream that both have needs a choice, which names both. */
	assert_null(incise_recording_open("s.rec", &err));
	assert_says(err.text, "force", "s.rec:a");
	err = (struct incise_error){0};
	assert_null(incise_recording_open("s.rec:c", &err));
	assert_says(err.text, "'c'");
	err = (struct incise_error){0};
	assert_null(incise_recording_open("a.rec:b", &err));
	assert_says(err.text, "a.rec");
}

/* A clock that is stepped meanwhile: refused, or no time is wrong by more than is stated. */
TEST(test_steps, IN_FOLDER)
{
	static const double steps_s[] = {1, -1, 0.01, -0.01, 1e-5, -1e-5};
	int joined = 0;

	two_machines(4 * S);
	for (size_t i = 0; i < sizeof(steps_s) / sizeof(*steps_s); i++) {
		set_walls(true);
		/* The wall clock is wrong from the third point on, and its source notices. */
		change_by(
			B,
			"UPDATE wall SET tai_ns = tai_ns + %.0f, restart = CASE seq WHEN 3 "
			"THEN 'step' ELSE '' END WHERE seq >= 3",
			steps_s[i] * 1e9);
		if (join(&(struct incise_session_options){0}, &err)) {
			assert_says(err.text, "b.rec");
			continue;
		}
		joined++;
		assert_true(largest_error_ns() <= info_of(1).uncertainty_ns + 2);
		remove_session("s.rec");
	}
	assert_true(joined > 0);
}

/* Verification covers the members and the session's own tables. */
TEST(test_verify, IN_FOLDER)
{
	struct incise_verify_report report;

	record("a.rec", SPEC, 2 * S);
	record("b.rec", SPEC ",seed=2", 2 * S);
	set_walls(false);
	assert_int_equal(join(&(struct incise_session_options){0}, &err), 0);
	assert_int_equal(incise_verify("s.rec", NULL, &report, &err), 0);
	assert_int_equal(report.streams[0].present, 40000);
	assert_string_equal(report.streams[0].name, "force");
	change("s.rec/b/recording.db", "UPDATE force SET code = code + 1 WHERE seq = 5");
	assert_int_equal(incise_verify("s.rec", NULL, &report, &err), 0);
	assert_false(report.intact);
	/* Another recording in its place is noticed when it is opened. */
	change("s.rec/b/recording.db", "UPDATE seal SET head = zeroblob(32)");
	assert_null(incise_recording_open("s.rec:a", &err));
	assert_says(err.text, "member b");
	remove_session("s.rec");
	assert_int_equal(join(&(struct incise_session_options){0}, &err), 0);
	change("s.rec/recording.db", "UPDATE maps SET session_ns = session_ns + 1");
	err = (struct incise_error){0};
	assert_null(incise_recording_open("s.rec:a", &err));
	assert_says(err.text, "s.rec");
}

/* Change the tables of a session as a forger would, who knows the seal. */
static void forge(const char *sql)
{
	char *text = NULL;
	sqlite3 *db;
	uint32_t crc;
	char seal[100];

	assert_int_equal(sqlite3_open("s.rec/recording.db", &db), SQLITE_OK);
	if (sqlite3_exec(db, sql, NULL, NULL, &text) != SQLITE_OK)
		fail_msg("%s: %s", sql, text);
	assert_int_equal(incise_session_seal(db, &crc), SQLITE_OK);
	snprintf(seal, sizeof(seal), "UPDATE session SET value = %u WHERE key = 'seal'",
		 crc);
	assert_int_equal(sqlite3_exec(db, seal, NULL, NULL, NULL), SQLITE_OK);
	sqlite3_close(db);
}

/* Whatever is in the tables: an error, or times that increase and stay in range. */
TEST(test_forged, IN_FOLDER)
{
	static const char *const refused[] = {
		"UPDATE members SET name = '../../etc' WHERE member = 1",
		"UPDATE members SET name = '' WHERE member = 1",
		"UPDATE members SET name = '.' WHERE member = 1",
		"UPDATE members SET name = 'a' WHERE member = 1",
		"UPDATE members SET name = char(27) || 'b' WHERE member = 1",
		"UPDATE members SET name = printf('%0100d', 1) WHERE member = 1",
		"UPDATE members SET ledger = '' WHERE member = 1",
		"DELETE FROM members WHERE member = 1",
		"DELETE FROM maps WHERE member = 1",
		"DELETE FROM maps WHERE member = 1 AND knot > 0",
		"UPDATE maps SET session_ns = 5 WHERE member = 1",
		"UPDATE maps SET session_ns = -session_ns",
		"UPDATE maps SET t_ns = 9223372036854775807 WHERE knot = 1",
		"UPDATE maps SET t_ns = -9223372036854775807 WHERE knot = 0",
		"UPDATE maps SET session_ns = 9223372036854775807 WHERE knot = 1",
		"UPDATE maps SET session_ns = 2 * session_ns WHERE member = 1",
		"UPDATE maps SET session_ns = session_ns + knot * 1000000000 WHERE member = 1",
		"UPDATE maps SET bound_ns = -1.0",
		"UPDATE maps SET bound_ns = 9e999",
		"UPDATE maps SET t_ns = 'x', session_ns = x'00'",
		"DROP TABLE maps; CREATE VIEW maps AS SELECT 1 AS member, 1 AS knot, 1 AS t_ns, "
		"1 AS session_ns, 1.0 AS bound_ns",
	};

	record("a.rec", SPEC, S);
	record("b.rec", SPEC ",seed=2", S);
	set_walls(false);
	for (size_t i = 0; i < sizeof(refused) / sizeof(*refused); i++) {
		assert_int_equal(join(&(struct incise_session_options){0}, &err), 0);
		forge(refused[i]);
		err = (struct incise_error){0};
		if (incise_recording_open("s.rec:b", &err) || !err.code)
			fail_msg("opened after: %s", refused[i]);
		remove_session("s.rec");
	}
	/* A map that is possible, but wild. */
	assert_int_equal(join(&(struct incise_session_options){0}, &err), 0);
	for (int i = 0; i < 50; i++) {
		struct incise_recording *recording;
		struct incise_tracker_sample *poses;
		char sql[200];
		int n;

		snprintf(
			sql, sizeof(sql),
			"UPDATE maps SET session_ns = %.0f + CAST(t_ns * %.4f AS INTEGER) "
			"WHERE member = 1",
			2e18 * incise_random_symmetric(&random_state),
			1 + 0.24 * incise_random_symmetric(&random_state));
		forge(sql);
		recording = incise_recording_open("s.rec:b", &err);
		if (!recording)
			fail_msg("%s: %s", sql, err.text);
		n = incise_recording_poses(recording, &poses, &err);
		for (int k = 1; k < n; k++)
			assert_true(poses[k].t_ns > poses[k - 1].t_ns);
		if (n > 0)
			free(poses);
		incise_recording_close(recording);
	}
}

/* The force of one machine with the tracker of the other is as from one machine. */
TEST(test_pairs, IN_FOLDER)
{
	struct incise_export_options options;
	struct incise_recording *recordings[2];
	double largest = 0, stated = 0;
	int rows = 0;
	FILE *files[2];
	char lines[2][500];

	two_machines(10 * S);
	set_walls(true);
	if (join(&(struct incise_session_options){0}, &err))
		fail_msg("%s", err.text);
	recordings[0] = open_recording("a.rec");
	recordings[1] = open_recording("s.rec:force=a,tracker=b");
	incise_export_options_init(&options);
	options.resample = true;
	options.rate_hz = 100;
	assert_int_equal(incise_export(&recordings[0], 1, &options, "a.csv", NULL, &err),
			 0);
	assert_int_equal(incise_export(&recordings[1], 1, &options, "s.csv", NULL, &err),
			 0);
	files[0] = fopen("a.csv", "r");
	files[1] = fopen("s.csv", "r");
	while (fgets(lines[0], sizeof(lines[0]), files[0])) {
		double t[2], x[2], u[2], v[2];

		assert_non_null(fgets(lines[1], sizeof(lines[1]), files[1]));
		if (!rows++)
			continue;
		for (int i = 0; i < 2; i++)
			if (sscanf(lines[i],
				   "%*[^,],%*d,%lf,%lf,%*f,%*f,%lf,%*f,%*f,%*f,%*f,"
				   "%*d,%*d,%*f,%*f,%lf",
				   &t[i], &x[i], &u[i], &v[i]) != 4)
				fail_msg("%s", lines[i]);
		assert_true(t[0] == t[1]);
		if (isnan(x[0]) || isnan(x[1]))
			continue;
		largest = fmax(largest, fabs(x[0] - x[1]));
		/* Twice the bound of the time at the largest speed of the hand, and digits. */
		stated = 2 * 2 * BOUND_NS * 1e-9 * 100 + 1e-4;
		assert_true(fabs(x[0] - x[1]) <= stated);
		/* Noise is propagated from points that are 20 us off, 0.5 % of their distance. */
		assert_true(u[1] >= 0.99 * u[0] - 1e-4);
	}
	assert_true(rows > 900 && largest > 0);
	fclose(files[0]);
	fclose(files[1]);
	incise_recording_close(recordings[0]);
	incise_recording_close(recordings[1]);
}

/* --- signals ------------------------------------------------------------------------- */

/* Taps at these true times, s. */
static const double taps_s[] = {2.0123, 2.6371, 4.1034, 8.5219};
#define TAPS (int)(sizeof(taps_s) / sizeof(*taps_s))

/* Knock: the force rises by half of the range within a sample and falls in 20 ms. */
static void knock_force(const char *file, int taps)
{
	for (int i = 0; i < taps; i++)
		change_by(
			file,
			"UPDATE force SET code = code + CAST(1500 * (1 - (t_ns - %.0f) / 2e7) "
			"AS INTEGER) WHERE t_ns >= %.0f AND t_ns < %.0f",
			taps_s[i] * 1e9, taps_s[i] * 1e9, taps_s[i] * 1e9 + 2e7);
}

/* And the scalpel, which moves at 200 mm/s, bounces: at the times of the tracker's line. */
static void knock_tracker(const char *file, int taps)
{
	struct incise_recording *recording = open_recording("b.rec");
	struct incise_tracker_sample *poses;
	int n = incise_recording_poses(recording, &poses, NULL);

	incise_recording_close(recording);
	for (int i = 0; i < taps; i++)
		for (int k = 0; k < n; k++) {
			double far_s = fabs((double)poses[k].t_ns * 1e-9 - taps_s[i]);

			if (far_s > 0.05)
				continue;
			change_by(
				file,
				"UPDATE tracker SET x_mm = x_mm + %.9f WHERE seq = %llu",
				400 * (0.05 - far_s), (unsigned long long)poses[k].seq);
		}
	free(poses);
}

/* A force and a tracker without any wall time, four taps: offset and rate within the bound. */
TEST(test_taps, IN_FOLDER)
{
	const struct incise_session_options taps = {.align = INCISE_ALIGN_TAP};
	struct incise_session_info b;
	double error_ns;

	record("a.rec", SPEC, 10 * S);
	record("b.rec", SPEC ",seed=1", 10 * S);
	knock_force(A, TAPS);
	knock_tracker(B, TAPS);
	move_to_b(B);
	/* Only the tracker of b is used: its force knows of no tap. */
	change(B, "DELETE FROM force; UPDATE meta SET value = 0 WHERE key "
		  "= 'force_rows'");
	succeeds(!join(&taps, &err));
	b = info_of(1);
	assert_int_equal(b.matches, TAPS);
	assert_string_equal(b.method, "tap");
	assert_true(isnan(b.agreement_ns));
	/* b's first row is that of a time of a that the formula says. */
	error_ns = fabs((double)b.first_ns -
			ask(A, "SELECT t_ns FROM tracker ORDER BY seq"));
	if (error_ns > b.uncertainty_ns)
		fail_msg("wrong by %g ms, stated %g ms", error_ns * 1e-6,
			 b.uncertainty_ns * 1e-6);
	/* 120 Hz: corners are found within the time between two records. */
	assert_true(error_ns < 4 * MS && b.uncertainty_ns < 50 * MS);
}

/* Three taps of two forces, at 10 kHz; and clocks that agree with it, or do not. */
TEST(test_agreement, IN_FOLDER)
{
	const struct incise_session_options taps = {.align = INCISE_ALIGN_TAP};
	struct incise_session_info b;

	record("a.rec", SPEC, 5 * S);
	record("b.rec", SPEC ",seed=2", 5 * S);
	knock_force(A, 3);
	knock_force(B, 3);
	move_to_b(B);
	set_walls(true);
	succeeds(!join(&taps, &err));
	b = info_of(1);
	assert_int_equal(b.matches, 3);
	assert_true(fabs(b.agreement_ns) <= b.agreement_bound_ns);
	assert_true(b.agreement_bound_ns < 1 * MS);
	/* 0.1 ms between samples; 100 ppm over 3 s from the taps: the rate is not known. */
	assert_true(b.uncertainty_ns < 1 * MS);
	remove_session("s.rec");
	change(B, "UPDATE wall SET tai_ns = tai_ns + 50000000");
	assert_error(join(&taps, &err), ERANGE, &err, "b.rec");
	/* And no tap at all. */
	change(B, "DELETE FROM force; DELETE FROM tracker");
	assert_true(join(&taps, &err) < 0);
}

/* Pulses of a line that goes to both machines, among other events; no wall time. */
TEST(test_sync, IN_FOLDER)
{
	const struct incise_session_options sync = {.align = INCISE_ALIGN_EVENTS};
	struct incise_session_info b;
	double error_ns;

	record("a.rec", SPEC, 10 * S);
	record("b.rec", SPEC ",seed=1", 10 * S);
	for (int i = 0; i < TAPS; i++)
		for (int k = 0; k < 2; k++)
			change_by(k ? B : A,
				  "INSERT INTO events VALUES(%.0f, 'sync', 'pulse')",
				  taps_s[i] * 1e9);
	move_to_b(B);
	succeeds(!join(&sync, &err));
	b = info_of(1);
	assert_string_equal(b.method, "sync");
	assert_int_equal(b.matches, TAPS);
	/* 1 us at each pulse, over 8 s: the rate is known to 0.2 ppm. */
	assert_true(fabs(b.rate_ppm - 50) < 0.1 && b.uncertainty_ns < 20000);
	error_ns = largest_error_ns();
	assert_true(error_ns < b.uncertainty_ns);
	/* The other machine sees the line at its force channel. */
	remove_session("s.rec");
	change(B, "DELETE FROM events");
	change(B, "UPDATE force SET t_ns = seq * 100000 + 1000000000");
	knock_force(B, TAPS);
	change(B, "UPDATE force SET t_ns = " ON_B("t_ns"));
	succeeds(!join(&sync, &err));
	b = info_of(1);
	assert_int_equal(b.matches, TAPS);
	/* 0.1 ms between two samples; 4 standard deviations at the ends. */
	assert_true(fabs(b.rate_ppm - 50) < 100 && b.uncertainty_ns < 1 * MS);
	error_ns = fabs((double)(b.first_ns - S));
	assert_true(error_ns < b.uncertainty_ns);
}

#define TAP INCISE_ALIGN_TAP

/* Marks in a steady rhythm match at several offsets; in an irregular one at one. */
TEST(test_marks)
{
	struct incise_mark a[8], b[8];
	struct incise_align_fit fit;
	double bound_ns;

	for (int i = 0; i < 8; i++) {
		a[i] = (struct incise_mark){(10 + i) * S, 1e5};
		b[i] = (struct incise_mark){(110 + i) * S, 1e5};
	}
	assert_error(incise_align_fit(a, 4, b + 2, 3, INCISE_ALIGN_EVENTS, &fit, &err),
		     EDOM, &err, "rhythm");
	assert_int_equal(incise_align_fit(a, 0, b, 3, TAP, &fit, NULL), -ENODATA);
	for (int i = 0; i < 8; i++)
		a[i].t_ns = 10 * S + i * i * S + i * 100 * MS;
	for (int i = 0; i < 5; i++)
		b[i].t_ns = llround((double)(a[i + 2].t_ns + 7 * S) * (1 + 30e-6));
	/* One of them is somebody's cough. */
	b[5].t_ns = b[4].t_ns + 333 * MS;
	assert_int_equal(incise_align_fit(a, 8, b, 6, TAP, &fit, NULL), 0);
	assert_int_equal(fit.matches, 5);
	for (int i = 0; i < 5; i++) {
		double error_ns =
			fabs((double)(incise_align_time(&fit, b[i].t_ns, &bound_ns) -
				      a[i + 2].t_ns));

		assert_true(error_ns < 100 && error_ns < bound_ns);
	}
	/* 30 ppm from marks of 0.1 ms over 40 s. */
	assert_true(fabs(fit.rate + 30e-6) < 1e-8 && fit.rate_sd < 25e-6);
}

/* Marks without anything in common: hands at work, a peak or two, a rhythm that all have. */
TEST(test_chance)
{
	struct incise_mark a[60], b[60];
	struct incise_align_fit fit;
	uint64_t random = 5;
	int64_t t_ns[2] = {S, 70 * S};
	int n;

	for (int round = 0; round < 100; round++) {
		/* Every 0.2 to 0.8 s, to the row of a tracker or of a force. */
		for (int i = 0; i < 60; i++) {
			t_ns[0] += llrint(1e9 *
					  (0.5 + 0.3 * incise_random_symmetric(&random)));
			t_ns[1] += llrint(1e9 *
					  (0.5 + 0.3 * incise_random_symmetric(&random)));
			a[i] = (struct incise_mark){t_ns[0], 1e5};
			b[i] = (struct incise_mark){t_ns[1], round % 2 ? 4e6 : 1e5};
		}
		n = round % 20 ? 3 + round % 20 : 60;
		if (!incise_align_fit(a, n, b, n, TAP, &fit, &err))
			fail_msg("round %d: %d of %d matched by chance", round,
				 fit.matches, n);
	}
	/* One or two are no rhythm, and a steady one is everybody's. */
	assert_int_equal(incise_align_fit(a, 1, a, 1, TAP, &fit, &err), -ENODATA);
	assert_int_equal(incise_align_fit(a, 2, a, 2, TAP, &fit, &err), -ENODATA);
	assert_int_equal(incise_align_fit(a, 5, a, 5, TAP, &fit, &err), 0);
	for (int i = 0; i < 5; i++)
		a[i].t_ns = i * S;
	assert_int_equal(incise_align_fit(a, 5, a, 5, TAP, &fit, &err), -EDOM);
	assert_int_equal(incise_align_fit(a, 5, a, 5, INCISE_ALIGN_EVENTS, &fit, &err),
			 0);
	/* No clocks are 160 ppm apart. */
	for (int i = 0; i < 6; i++) {
		a[i] = (struct incise_mark){10 * S + i * i * 1600 * MS, 3e5};
		b[i] = (struct incise_mark){10 * S + llrint(i * i * 1.6e9 * 1.00016),
					    3e5};
	}
	assert_int_equal(incise_align_fit(a, 6, b, 6, TAP, &fit, &err), -EDOM);
	assert_says(err.text, "-160 ppm");
}
