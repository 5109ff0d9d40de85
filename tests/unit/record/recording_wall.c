// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Wall time through a recorder, its ledger and a reader: table wall, incise_recording_wall().
 */
#include "../unit.h"
#include "recorded.h"
#include <time.h>
#include <incise/verify.h>
#include <incise/wall.h>

#define S INCISE_NS_PER_S
#define DB "a.rec/recording.db"

static void record_by(const char *spec, const char *source, int64_t duration_ns)
{
	struct incise_rig *rig = open_rig(spec);

	end_recorder(
		start_recorder_by("a.rec", rig,
				  (struct incise_recorder_setup){.clock_source = source}),
		rig, duration_ns);
}

static struct incise_wall *read_wall(int code)
{
	struct incise_error err = {0};
	struct incise_recording *recording = incise_recording_open("a.rec", &err);
	struct incise_wall *wall;

	assert_non_null(recording);
	errno = 0;
	wall = incise_recording_wall(recording, &err);
	if (code) {
		assert_null(wall);
		assert_int_equal(errno, code);
		assert_int_equal(err.code, code);
	} else if (!wall) {
		fail_msg("%s", err.text);
	}
	incise_recording_close(recording);
	return wall;
}

static bool is_intact(void)
{
	struct incise_verify_report report;

	succeeds(!incise_verify("a.rec", NULL, &report, &err));
	return report.intact;
}

TEST(stated_time_of_a_simulated_clock, IN_FOLDER)
{
	const struct incise_wall_point *points;
	struct incise_wall *wall;
	int64_t tai, u, back;

	record_by(SHORT_SCRIPT, "sim:1.5e9,50,2", 5 * S);
	wall = read_wall(0);
	assert_int_equal(incise_wall_points(wall, &points),
			 6); /* each second, and the end */
	for (int64_t t = 0; t < 5 * S; t += S / 3) {
		assert_int_equal(incise_wall_tai(wall, t, &tai, &u), 0);
		/* 2 µs, and what the rounding of a point to 1 ns is worth */
		assert_true(llabs(tai - (1500000000 * S + t + t / 20000)) <= 2);
		assert_in_range(u, 2000, 2010);
		assert_int_equal(incise_wall_monotonic(wall, tai, &back, &u), 0);
		assert_true(llabs(back - t) <= 2);
	}
	assert_int_equal(incise_wall_tai(wall, -61 * S, &tai, &u), -ENODATA);
	assert_int_equal(incise_wall_tai(wall, 67 * S, &tai, &u), -ENODATA);
	assert_int_equal(incise_wall_monotonic(wall, 0, &back, &u), -ENODATA);
	incise_wall_free(wall);
	assert_true(is_intact());
}

TEST(rows_are_protected, IN_FOLDER)
{
	static const char *const changes[] = {
		"UPDATE wall SET tai_ns = tai_ns + 1 WHERE seq = 2",
		"UPDATE wall SET uncertainty_ns = NULL WHERE seq = 1",
		"UPDATE wall SET uncertainty_ns = 1.0 WHERE seq = 1",
		"UPDATE wall SET source = 'ptp' WHERE seq = 0",
		"UPDATE wall SET reference = 'other' WHERE seq = 0",
		"UPDATE wall SET restart = 'step' WHERE seq = 3",
		"DELETE FROM wall WHERE seq = 1",
		"DELETE FROM wall",
		"DELETE FROM blocks WHERE stream = 'wall'",
		"DELETE FROM blocks WHERE stream = 'wall' AND count = 0",
		"INSERT INTO wall SELECT 99, t_ns + 1, tai_ns, uncertainty_ns, rate_ppb, "
		"rate_uncertainty_ppb, utc_offset_s, held, source, reference, leap, "
		"restart FROM wall WHERE seq = 5",
	};

	record_by(SHORT_SCRIPT, "sim", 5 * S);
	assert_int_equal(system("cp -r a.rec good.rec"), 0);
	for (size_t i = 0; i < sizeof(changes) / sizeof(*changes); i++) {
		change(DB, changes[i]);
		if (is_intact())
			fail_msg("not found: %s", changes[i]);
		assert_int_equal(system("rm -r a.rec; cp -r good.rec a.rec"), 0);
	}
}

TEST(damaged_rows_are_refused, IN_FOLDER)
{
	static const char *const changes[] = {
		"UPDATE wall SET tai_ns = 9223372036854775807 WHERE seq = 2",
		"UPDATE wall SET t_ns = 0 WHERE seq = 2",
		"UPDATE wall SET rate_ppb = 1e300 WHERE seq = 2",
		"UPDATE wall SET rate_uncertainty_ppb = -1.0 WHERE seq = 2",
		"UPDATE wall SET uncertainty_ns = -1.0 WHERE seq = 2",
		"UPDATE wall SET utc_offset_s = 4294967296 WHERE seq = 2",
		"UPDATE blocks SET data = substr(data, 1, 7) WHERE stream = 'wall' AND count > 0",
		"UPDATE blocks SET data = 'x' WHERE stream = 'wall'",
	};

	record_by(SHORT_SCRIPT, "sim", 5 * S);
	assert_int_equal(system("cp -r a.rec good.rec"), 0);
	for (size_t i = 0; i < sizeof(changes) / sizeof(*changes); i++) {
		change(DB, changes[i]);
		read_wall(EINVAL);
		assert_int_equal(system("rm -r a.rec; cp -r good.rec a.rec"), 0);
	}
}

TEST(simulated_ones_have_none, IN_FOLDER)
{
	record_by(SHORT_SCRIPT, NULL, 2 * S);
	read_wall(ENODATA);
	assert_true(is_intact());
}

static int64_t clock_ns(clockid_t clock)
{
	struct timespec now;

	clock_gettime(clock, &now);
	return now.tv_sec * S + now.tv_nsec;
}

/* The clock of this machine, whatever sets it: TAI is CLOCK_REALTIME plus the leap seconds. */
TEST(time_of_a_real_clock, IN_FOLDER)
{
	const struct incise_wall_point *points;
	int64_t before_ns, after_ns, set_ns, tai;
	struct incise_wall *wall;
	size_t n;

	/* Again, if the clock was set meanwhile. */
	do {
		set_ns = clock_ns(CLOCK_REALTIME) - clock_ns(CLOCK_MONOTONIC);
		before_ns = clock_ns(CLOCK_REALTIME);
		record_by("sim:clock=real", NULL, S / 10);
		after_ns = clock_ns(CLOCK_REALTIME);
		set_ns -= clock_ns(CLOCK_REALTIME) - clock_ns(CLOCK_MONOTONIC);
	} while (llabs(set_ns) > S / 2);
	wall = read_wall(0);
	n = incise_wall_points(wall, &points);
	/* the start, each second, and the end */
	assert_in_range(n, 2, 5 + (after_ns - before_ns) / S);
	for (size_t i = 0; i < n; i++) {
		assert_int_equal(incise_wall_tai(wall, points[i].t_ns, &tai, NULL), 0);
		tai -= points[i].utc_offset_s * S;
		/* the source may correct the clock by its bound */
		assert_in_range(tai, before_ns - S, after_ns + S);
		assert_in_range(points[i].utc_offset_s, 37, 40);
	}
	assert_string_equal(points[0].reference, "TAI");
	incise_wall_free(wall);
	assert_true(is_intact());
	assert_true(ask(DB, "SELECT count(*) FROM events WHERE kind = 'clock'") >= 1);
}

TEST(sources_of_another_clock_are_refused, IN_FOLDER)
{
	static const struct {
		const char *rig, *source, *text;
	} cases[] = {
		{SHORT_SCRIPT, "kernel", "kernel"},
		{SHORT_SCRIPT, "sim:x", "sim:TAI_S"},
		{SHORT_SCRIPT, "sim:1,2,3,4", "sim:TAI_S"},
		{SHORT_SCRIPT, "sim:1,2,-3", "sim:TAI_S"},
		{SHORT_SCRIPT, "sim:nan", "sim:TAI_S"},
		{"sim:clock=real", "sim", "sim"},
		{"sim:clock=real", "sundial", "sundial"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = open_rig(cases[i].rig);
		struct incise_calibration calibration;

		incise_calibration_nominal(&calibration);
		assert_error(incise_recorder_new("a.rec", rig,
						 &(struct incise_recorder_setup){
							 .calibration = &calibration,
							 .clock_source = cases[i].source},
						 &err),
			     EINVAL, &err, cases[i].text);
		assert_int_equal(access("a.rec.part", F_OK), -1);
		incise_rig_close(rig);
	}
}
