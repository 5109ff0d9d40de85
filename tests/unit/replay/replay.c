// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/replay/replay.c: the forces are those that the live loop had on the same
 * poses, to the bit; the report is the same as by plain sums.
 */
#include "../unit.h"
#include "../record/recorded.h"
#include <incise/replay.h>
#include "../scene/felt.h"

#define SCRIPT "sim:clock=simulated,depth_mm=5,times=1" /* felt.h's rig */
#define QUICK SCRIPT ",pause_s=0.1,cut_s=4"
#define DB "a.rec/recording.db"
#define TICKS 3000

static struct incise_loop_stats stats;
static struct incise_tick live[TICKS];

static int record_once(void **state)
{
	if (enter_folder(state))
		return -1;
	record("a.rec", SCRIPT, TICKS * MS);
	return 0;
}

struct seen {
	int64_t n;
	uint32_t crc;
	double squares_N2, least_N, most_N, max_N, last_t_s, last_done;
	uint64_t compared, spells[INCISE_TICK_FLAGS];
	unsigned int flags;
	bool as_live, in_cut;
	int end_at;
	volatile sig_atomic_t *stop;
};

/* Bit by bit, as the polynomial is defined: not by the library's table. */
static uint32_t slow_crc(uint32_t crc, const void *bytes, size_t n)
{
	const unsigned char *byte = bytes;

	crc = ~crc;
	for (size_t i = 0; i < n; i++) {
		crc ^= byte[i];
		for (int bit = 0; bit < 8; bit++)
			crc = crc >> 1 ^ (crc & 1 ? 0x82f63b78 : 0);
	}
	return ~crc;
}

static int see(void *context, const struct incise_replay_tick *at,
	       struct incise_error *err)
{
	const struct incise_tick *tick = at->tick;
	struct seen *seen = context;

	if (seen->as_live) {
		assert_int_equal(tick->t_ns, live[seen->n].t_ns);
		/* to the bit, so compared as bytes */
		assert_memory_equal(tick->command_N, live[seen->n].command_N,
				    sizeof(tick->command_N));
		assert_memory_equal(tick->position_mm, live[seen->n].position_mm,
				    sizeof(tick->position_mm));
		assert_int_equal(tick->flags, live[seen->n].flags);
	}
	/* a plane with the normal z */
	assert_true(at->predicted_N == tick->command_N[2]);
	assert_true(at->done >= seen->last_done && at->done <= 1);
	assert_true(at->t_s > seen->last_t_s);
	seen->last_done = at->done;
	seen->last_t_s = at->t_s;
	seen->in_cut |= at->cut > 0;
	seen->crc = slow_crc(seen->crc, tick->command_N, sizeof(tick->command_N));
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		if (tick->flags & 1u << i && !(seen->flags & 1u << i))
			seen->spells[i]++;
	seen->flags = tick->flags;
	if (at->cut && !at->clipped && isfinite(at->measured_N)) {
		double error = at->predicted_N - at->measured_N;

		seen->squares_N2 += error * error;
		seen->max_N = fmax(seen->max_N, fabs(error));
		if (!seen->compared++)
			seen->least_N = seen->most_N = at->measured_N;
		seen->least_N = fmin(seen->least_N, at->measured_N);
		seen->most_N = fmax(seen->most_N, at->measured_N);
	}
	seen->n++;
	if (seen->stop && seen->n == seen->end_at)
		*seen->stop = 1;
	else if (seen->n == seen->end_at)
		return incise_error_set(err, ENOSPC, "enough");
	return 0;
}

static int replay(const char *path, const struct felt *f,
		  struct incise_replay_options how, struct seen *seen,
		  struct incise_replay_report *report, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open(path, err);
	int rc;

	if (!recording)
		fail_msg("%s", err->text);
	how.ticked = see;
	how.context = seen;
	seen->last_t_s = -1;
	rc = incise_replay(recording, f->scene, &how, &stats, report, err);
	incise_recording_close(recording);
	return rc;
}

/* The same rig and scene, with teeth of 1 mm. */
static void add_teeth(struct felt *f)
{
	struct incise_fixed_texture *to = calloc(1, sizeof(*to));

	assert_non_null(to);
	to->step_shift = 11;
	to->most = INCISE_TEXTURE_ONE / 16;
	to->factor_most = INCISE_FIXED_ONE;
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++)
		to->knot[i] = (int16_t)((i % 32 - 16) * INCISE_TEXTURE_ONE / 256);
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++)
		to->factor[i] = INCISE_FIXED_ONE;
	/* Stiff enough that the teeth rise as they are. */
	f->scene->tissue.force[0][INCISE_REACTION_UNLOADING] = 1;
	f->scene->texture = to;
	incise_plan_free(f->plan);
	f->plan = incise_plan_new(f->scene, f->rig, &err);
	succeeds(f->plan);
}

TEST(forces_are_those_of_the_live_loop)
{
	static const char *const evaluators[] = {"fixed", "double"};

	for (int k = 0; k < 4; k++) {
		struct incise_loop_options loop = {.rate_hz = 1000,
						   .duration_ns = TICKS * MS,
						   .log = live,
						   .log_size = TICKS};
		struct seen seen = {.as_live = true};
		struct incise_replay_report report;
		struct felt f;

		double felt;

		felt_start(&f, evaluators[k % 2], INCISE_RIG_TRACKER);
		if (k >= 2)
			add_teeth(&f);
		assert_int_equal(incise_loop_run(f.plan, incise_rig_clock(f.rig), &loop,
						 &stats, &err),
				 0);
		felt = stats.texture_felt;
		if (replay("a.rec", &f, (struct incise_replay_options){0}, &seen, &report,
			   &err))
			fail_msg("%s", err.text);
		/* the recording ends within the last millisecond */
		assert_int_equal(seen.n, TICKS - 1);
		assert_int_equal(stats.ticks, TICKS - 1);
		assert_true(seen.in_cut && stats.force_max_N > 0.3);
		assert_true(isnan(felt) ? k < 2
					: k >= 2 && felt > 0.5 &&
						  fabs(stats.texture_felt - felt) < 0.01);
		assert_true(fabs(report.seconds - (TICKS - 2) * 1e-3) < 1e-9);
		assert_int_equal(report.poses,
				 (int)ask(DB, "SELECT count(*) FROM tracker WHERE "
					      "arrival_ns <= 3999000000"));
		assert_int_equal(report.tracker.latency_ns, 4200000);
		felt_end(&f);
	}
}

TEST(the_report_is_that_of_its_ticks)
{
	struct incise_replay_report report;
	struct seen seen = {0};
	struct felt f;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	assert_int_equal(replay("a.rec", &f, (struct incise_replay_options){0}, &seen,
				&report, &err),
			 0);
	assert_int_equal(report.crc, seen.crc);
	assert_int_equal(report.cuts, 1);
	assert_int_equal(report.compared, seen.compared);
	assert_true(seen.compared > 500);
	assert_true(fabs(report.rms_N - sqrt(seen.squares_N2 / seen.compared)) < 1e-12);
	assert_true(report.max_N == seen.max_N);
	assert_true(report.range_N == seen.most_N - seen.least_N);
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		assert_int_equal(report.spells[i], seen.spells[i]);
	assert_true(seen.spells[__builtin_ctz(INCISE_TICK_STARTING)] > 0);
	felt_end(&f);
}

/* Runs that must have the same forces, and some that must not. */
TEST(what_forces_depend_on)
{
	struct incise_calibration calibration;
	const struct {
		const char *sql, *path;
		struct incise_replay_options how;
		bool same;
	} cases[] = {
		{NULL, "b.rec", {0}, true},
		{NULL, "b.rec", {.real_time = true}, true},
		{NULL, "b.rec", {.calibration = &calibration}, true},
		{NULL, "b.rec", {.at = INCISE_REPLAY_ACQUISITION}, false},
		{"UPDATE force SET code = 2000; DELETE FROM depth; UPDATE meta SET value "
		 "= 0 WHERE key = 'depth_rows'",
		 "b.rec",
		 {0},
		 true},
		{"UPDATE meta SET value = 0 WHERE key = 'complete'", "c.rec", {0}, true},
		{"UPDATE tracker SET arrival_ns = arrival_ns + 1000000",
		 "b.rec",
		 {0},
		 false},
		{"UPDATE meta SET value = 60.0 WHERE key = 'tracker_hz'",
		 "b.rec",
		 {0},
		 false},
		{"UPDATE meta SET value = -0.5 WHERE key = 'surface_point_z_mm'",
		 "b.rec",
		 {0},
		 false},
		{"DELETE FROM tracker WHERE seq = 100; UPDATE meta SET value = value - 1 "
		 "WHERE key = 'tracker_rows'",
		 "b.rec",
		 {0},
		 false},
	};
	uint32_t first = 0;
	struct felt f;

	incise_calibration_nominal(&calibration);
	calibration.force_mV_N = 900;
	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	record("b.rec", QUICK, 1100 * MS);
	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_replay_report report;
		struct seen seen = {0};

		if (cases[k].sql) {
			nftw("b.rec", remove_entry, 8, FTW_DEPTH | FTW_PHYS);
			record("b.rec", QUICK, 1100 * MS);
			change("b.rec/recording.db", cases[k].sql);
		}
		/* left by a crash */
		if (!strcmp(cases[k].path, "c.rec"))
			assert_int_equal(rename("b.rec", "c.rec.part"), 0);
		if (replay(cases[k].path, &f, cases[k].how, &seen, &report, &err))
			fail_msg("%s: %s", cases[k].sql, err.text);
		if (!k)
			first = report.crc;
		if ((report.crc == first) != cases[k].same)
			fail_msg("case %zu: %08x, %08x", k, report.crc, first);
		assert_int_equal(stats.skipped, 0);
		if (!cases[k].how.real_time)
			assert_int_equal(report.late, 0);
	}
	felt_end(&f);
}

TEST(who_is_told_ends_it)
{
	volatile sig_atomic_t stop = 0;
	struct incise_replay_options how = {.stop = &stop};
	struct incise_replay_report report;
	struct seen seen = {.end_at = 40}, stopped = {.end_at = 40, .stop = &stop};
	struct felt f;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	assert_int_equal(replay("a.rec", &f, how, &seen, &report, &err), -ENOSPC);
	assert_string_equal(err.text, "enough");
	assert_int_equal(seen.n, 40);
	assert_int_equal(replay("a.rec", &f, how, &stopped, &report, &err), 0);
	assert_int_equal(stopped.n, 40);
	assert_int_equal(report.compared, 0);
	assert_true(isnan(report.rms_N) && isnan(report.range_N));
	felt_end(&f);
}

TEST(what_cannot_be_replayed)
{
	static const struct {
		const char *sql, *message;
		int code;
	} cases[] = {
		{"DELETE FROM tracker; UPDATE meta SET value = 0 WHERE key = "
		 "'tracker_rows'",
		 "no pose", ENODATA},
		{"DELETE FROM force WHERE seq > 1; DELETE FROM tracker WHERE seq > 0; "
		 "UPDATE tracker SET arrival_ns = (SELECT min(t_ns) FROM force); UPDATE "
		 "meta SET value = 1 WHERE key = 'tracker_rows'; UPDATE meta SET value = "
		 "2 WHERE key = 'force_rows'",
		 "shorter than a tick", ENODATA},
		{"UPDATE meta SET value = 0.0 WHERE key = 'surface_normal_z'", "normal",
		 EINVAL},
		/* poses of 1 Hz are always older than 50 ms */
		{"UPDATE meta SET value = 1.0 WHERE key = 'tracker_hz'", "pose_age_ms",
		 EDOM},
		{"DELETE FROM tracker WHERE seq = 30", "rows of", EINVAL},
	};
	struct felt f;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_replay_report report;
		struct incise_error err = {0};
		struct seen seen = {0};
		int rc;

		nftw("b.rec", remove_entry, 8, FTW_DEPTH | FTW_PHYS);
		record("b.rec", QUICK, 700 * MS);
		change("b.rec/recording.db", cases[k].sql);
		rc = replay("b.rec", &f, (struct incise_replay_options){0}, &seen,
			    &report, &err);
		if (rc != -cases[k].code || !strstr(err.text, cases[k].message))
			fail_msg("%s: %d, %s", cases[k].sql, rc, err.text);
	}
	felt_end(&f);
}

/* Without its zero a recording has poses, but no force in newtons. */
TEST(a_recording_without_zero_is_replayed)
{
	struct incise_replay_report report;
	struct seen seen = {0};
	struct felt f;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	nftw("b.rec", remove_entry, 8, FTW_DEPTH | FTW_PHYS);
	record("b.rec", QUICK, 1100 * MS);
	change("b.rec/recording.db",
	       "UPDATE meta SET value = NULL WHERE key = 'force_zero_mV'");
	assert_int_equal(replay("b.rec", &f, (struct incise_replay_options){0}, &seen,
				&report, &err),
			 0);
	assert_true(seen.in_cut);
	assert_int_equal(report.compared, 0);
	assert_true(isnan(report.rms_N));
	felt_end(&f);
}

GROUP(record_once, leave_folder);
