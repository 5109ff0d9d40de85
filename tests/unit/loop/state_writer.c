// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/state_writer.c: a reader gets back every value, text that is too long is cut; the work
 * of a spring and of friction.
 */
#include "../unit.h"
#include <time.h>
#include "../scene/felt.h"
#include "state_made.h"
#include "../cases.h"

static struct incise_state_now now;
static struct incise_tick ticks[INCISE_STATE_TICKS];

static void look(void)
{
	struct incise_state *state;

	if (made.writer)
		incise_state_mirror(made.writer);
	state = incise_state_open(made.path, NULL);
	assert_non_null(state);
	assert_int_equal(incise_state_read(state, &now), 0);
	incise_state_close(state);
}

static int64_t clock_ns(clockid_t clock)
{
	struct timespec t;

	clock_gettime(clock, &t);
	return t.tv_sec * 1000000000LL + t.tv_nsec;
}

TEST(test_before_the_first_tick, made_folder, made_end)
{
	int64_t mono = clock_ns(CLOCK_MONOTONIC), real = clock_ns(CLOCK_REALTIME);

	made.writer = incise_state_new(made.path, &made_setup, NULL);
	look();
	assert_true(now.alive && !now.torn);
	assert_int_equal(now.pid, getpid());
	assert_true(now.start_ns >= mono && now.start_ns <= clock_ns(CLOCK_MONOTONIC));
	assert_true(now.start_realtime_ns >= real);
	assert_true(now.since_ns >= now.start_ns);
	assert_true(now.rate_hz == 1000);
	assert_string_equal(now.rig, "sim:");
	assert_string_equal(now.policy, "SCHED_FIFO 80, CPU 1");
	assert_int_equal(now.run, INCISE_RUN_STARTING);
	assert_string_equal(now.reason, "");
	assert_string_equal(now.scene, "");
	assert_int_equal(now.ticks, 0);
	assert_int_equal(incise_state_total(&now.lateness), 0);
}

TEST(test_ticks, made_page, made_end)
{
	struct incise_tick tick = {.t_ns = 1000, .tool = INCISE_TOOL_BLADE};

	tick.command_N[0] = 3;
	tick.command_N[1] = 4;
	tick.flags = INCISE_TICK_CONTACT | INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED;
	incise_state_tick(made.writer, &tick, 12000, 5000, 0);
	tick.t_ns = 4000;
	tick.command_N[0] = 0;
	tick.flags = INCISE_TICK_CONTACT;
	tick.tool_mm[0] = -2; /* against the 3 N of before */
	incise_state_tick(made.writer, &tick, -5, 700, 2);
	look();
	assert_int_equal(now.ticks, 2);
	assert_int_equal(now.skipped, 2);
	assert_int_equal(now.overruns, 1);
	assert_int_equal(now.limited, 1);
	for (int i = 0; i < INCISE_TICK_FLAGS; i++) {
		unsigned int flag = 1u << i;

		assert_int_equal(now.flagged[i], flag == INCISE_TICK_CONTACT   ? 2
						 : flag == INCISE_TICK_CLAMPED ? 1
						 : flag == INCISE_TICK_SLEWED  ? 1
									       : 0);
	}
	assert_true(now.force_N == 4 && now.force_max_N == 5);
	assert_int_equal(now.lateness_ns, 0);
	assert_int_equal(now.lateness_max_ns, 12000);
	assert_int_equal(now.cost_ns, 700);
	assert_int_equal(now.cost_max_ns, 5000);
	assert_int_equal(now.lateness_sum_ns, 12000);
	assert_int_equal(now.cost_sum_ns, 5700);
	assert_int_equal(now.first_ns, 1000);
	assert_true(now.absorbed_mJ == 6 && now.returned_mJ == 0);
	assert_true(made_same(&now.tick, &tick));
	assert_int_equal(incise_state_total(&now.lateness), 2);
	assert_int_equal(now.lateness.count[incise_state_bucket(12000)], 1);
	assert_int_equal(now.cost.count[incise_state_bucket(700)], 1);
}

/* Much longer than the ring: counts are exact, and the ring goes round. */
TEST(test_many_ticks, made_page, made_end)
{
	const int64_t n = 5 * INCISE_STATE_TICKS + 7;
	struct incise_tick last = made_tick(n - 1);

	made_ticks(made.writer, 0, n);
	look();
	assert_int_equal(now.ticks, n);
	assert_int_equal(incise_state_total(&now.lateness), n);
	assert_int_equal(incise_state_total(&now.cost), n);
	assert_int_equal(now.lateness_max_ns, n - 1);
	assert_int_equal(now.cost_max_ns, 2 * (n - 1));
	assert_true(made_same(&now.tick, &last));
}

TEST(test_states, made_page, made_end)
{
	int64_t since;

	incise_state_run(made.writer, INCISE_RUN_RUNNING, "as asked");
	look();
	assert_int_equal(now.run, INCISE_RUN_RUNNING);
	assert_string_equal(now.reason, "as asked");
	since = now.since_ns;
	/* Another reason does not change the time of the state. */
	incise_state_run(made.writer, INCISE_RUN_RUNNING, NULL);
	look();
	assert_int_equal(now.since_ns, since);
	assert_string_equal(now.reason, "");
	/* A reload does not change that. */
	incise_state_run(made.writer, INCISE_RUN_RELOADING, NULL);
	look();
	assert_true(now.since_ns > since);
	incise_state_run(made.writer, INCISE_RUN_RUNNING, NULL);
	look();
	assert_int_equal(now.since_ns, since);
	incise_state_refused(made.writer, "neck.scene:3: syntax error");
	look();
	assert_int_equal(now.run, INCISE_RUN_RUNNING);
	assert_int_equal(now.refused, 1);
	assert_string_equal(now.reason, "neck.scene:3: syntax error");
	incise_state_run(made.writer, INCISE_RUN_FAULT, "e-stop\nwas\x1b[2J pressed");
	look();
	assert_true(now.since_ns > since);
	assert_string_equal(now.reason, "e-stop?was?[2J pressed");
	/* The state stays after the writer has closed the page. */
	made_close();
	look();
	assert_false(now.alive);
	assert_false(now.torn);
	assert_int_equal(now.run, INCISE_RUN_FAULT);
}

TEST(test_scene, made_page, made_end)
{
	struct felt f;
	const char *why;
	int n = 0, out = 0;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	incise_state_scene(made.writer, "/etc/incise/scenes/neck.scene", f.plan);
	look();
	assert_string_equal(now.scene, "/etc/incise/scenes/neck.scene");
	while (incise_plan_stage(f.plan, n)) {
		assert_string_equal(now.stage[n], incise_plan_stage(f.plan, n));
		n++;
	}
	while (incise_plan_left_out(f.plan, out, &why))
		out++;
	assert_true(n > 3 && out > 0);
	assert_int_equal(now.n_stages, n);
	assert_int_equal(now.left_out, out);
	/* The first scene is no reload. */
	assert_int_equal(now.reloads, 0);
	incise_state_scene(made.writer, "b.scene", NULL);
	look();
	assert_int_equal(now.reloads, 1);
	assert_int_equal(now.n_stages, 0);
	assert_string_equal(now.scene, "b.scene");
	felt_end(&f);
}

TEST(test_counts, made_page, made_end)
{
	struct incise_realtime_counts counts = {1, 2, 3, 4};

	incise_state_counts(made.writer, &counts);
	look();
	assert_int_equal(now.minor_faults, 1);
	assert_int_equal(now.major_faults, 2);
	assert_int_equal(now.voluntary, 3);
	assert_int_equal(now.involuntary, 4);
}

TEST(test_what_is_too_long, made_page, made_end)
{
	char text[2001], *end;

	/* A character of two bytes that would be cut in the middle is left out. */
	memset(text, 'a', 2000);
	text[2000] = 0;
	memcpy(text + 298, "\xc3\xa4", 2);
	incise_state_run(made.writer, INCISE_RUN_RUNNING, text);
	look();
	assert_int_equal(strlen(now.reason), 298);
	memset(text, 'a', 2000);
	memcpy(text + 1990, "neck.scene", 10);
	incise_state_scene(made.writer, text, NULL);
	look();
	assert_int_equal(strlen(now.scene), 511);
	end = now.scene + 511 - 10;
	assert_string_equal(end, "neck.scene");
	assert_memory_equal(now.scene, "...a", 4);
	/* 511 bytes just fit. */
	text[511] = 0;
	incise_state_scene(made.writer, text, NULL);
	look();
	assert_string_equal(now.scene, text);
}

/* The file may be cut off by anybody who may write it: the loop goes on, and the page is mended. */
TEST(test_cut_off, made_page, made_end)
{
	static const off_t sizes[] = {0,    1,	     sizeof(struct state_head),
				      4096, 1000000, sizeof(struct state_page) - 1};
	const int64_t n = INCISE_STATE_TICKS + 100;
	struct incise_state *reader = incise_state_open(made.path, NULL);

	incise_state_run(made.writer, INCISE_RUN_RUNNING, "as asked");
	made_ticks(made.writer, 0, n);
	for (size_t i = 0; i < sizeof(sizes) / sizeof(*sizes); i++) {
		int64_t all = n + 10 * ((int64_t)i + 1);
		struct incise_tick last = made_tick(all - 1);
		uint64_t cursor = 0, lost = 0;
		int got;

		assert_int_equal(truncate(made.path, sizes[i]), 0);
		made_ticks(made.writer, all - 10, all);
		look();
		assert_int_equal(now.run, INCISE_RUN_RUNNING);
		assert_string_equal(now.reason, "as asked");
		assert_int_equal(now.ticks, all);
		assert_int_equal(incise_state_total(&now.lateness), all);
		assert_true(made_same(&now.tick, &last));
		got = incise_state_ticks(reader, &cursor, ticks, INCISE_STATE_TICKS,
					 &lost);
		assert_int_equal(cursor, all);
		assert_int_equal(got, INCISE_STATE_TICKS - 1);
		assert_true(made_same(&ticks[got - 1], &last));
	}
	incise_state_close(reader);
}

/* A loop without a page makes the same calls with NULL. */
TEST(test_without_a_page)
{
	struct incise_tick tick = made_tick(1);
	struct incise_realtime_counts counts = {0};

	incise_state_tick(NULL, &tick, 1, 1, 1);
	incise_state_run(NULL, INCISE_RUN_RUNNING, "x");
	incise_state_scene(NULL, "x", NULL);
	incise_state_refused(NULL, "x");
	incise_state_counts(NULL, &counts);
	incise_state_free(NULL);
	incise_state_close(NULL);
}

TEST(test_names)
{
	assert_string_equal(incise_run_name(INCISE_RUN_STARTING), "starting");
	assert_string_equal(incise_run_name(INCISE_RUN_FAULT), "fault");
	assert_string_equal(incise_run_name((enum incise_run)INCISE_RUNS), "unknown");
	assert_string_equal(incise_run_name((enum incise_run) - 1), "unknown");
}

static struct incise_tick at(double x_mm, double force_N)
{
	return (struct incise_tick){.tool_mm = {0, 0, x_mm},
				    .command_N = {0, 0, force_N},
				    .tool = INCISE_TOOL_BLADE};
}

/* In and out of a spring of 0.5 N/mm, along -z: k x²/2 each way. */
TEST(test_work_of_a_spring, made_page, made_end)
{
	const int n = 10000;
	const double k = 0.5, depth_mm = 10, exact = k * depth_mm * depth_mm / 2;

	for (int i = 0; i <= 2 * n; i++) {
		double x = -depth_mm * (n - fabs((double)i - n)) / n;
		struct incise_tick tick = at(x, -k * x);

		incise_state_tick(made.writer, &tick, 0, 0, 0);
	}
	look();
	/* The force is held over a way of depth/n: less on the way in, more out. */
	assert_true(fabs(now.absorbed_mJ - exact) <= exact / n * 1.01);
	assert_true(fabs(now.returned_mJ - exact) <= exact / n * 1.01);
	assert_true(now.returned_mJ > now.absorbed_mJ);
}

/* Friction returns no work. */
TEST(test_work_of_friction, made_page, made_end)
{
	for (int i = 0; i <= 2000; i++) {
		struct incise_tick tick = at(i < 1000 ? i : 2000 - i, i < 1000 ? -2 : 2);

		incise_state_tick(made.writer, &tick, 0, 0, 0);
	}
	look();
	/* 1000 mm there and 1000 mm back against 2 N; whole numbers are exact. */
	assert_true(now.absorbed_mJ == 4000);
	assert_true(now.returned_mJ == 0);
}

TEST(test_changes_that_are_no_motion, made_page, made_end)
{
	static const struct {
		unsigned int flags[2];
		enum incise_tool tool[2];
		double work_mJ;
	} cases[] = {
		{{0, 0}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 20},
		{{INCISE_TICK_CONTACT, INCISE_TICK_CLAMPED},
		 {INCISE_TOOL_TUBE, INCISE_TOOL_TUBE},
		 20},
		{{0, 0}, {INCISE_TOOL_BLADE, INCISE_TOOL_HANDLE}, 0},
		{{INCISE_TICK_STALE, 0}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 0},
		{{0, INCISE_TICK_STALE}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 0},
		{{0, INCISE_TICK_FAULT}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		for (int k = 0; k < 2; k++) {
			struct incise_tick tick = at(-10 * k, 2);

			tick.flags = cases[i].flags[k];
			tick.tool = cases[i].tool[k];
			incise_state_tick(made.writer, &tick, 0, 0, 0);
		}
		look();
		assert_true(now.absorbed_mJ == cases[i].work_mJ);
		assert_true(now.returned_mJ == 0);
		made_end(NULL);
		made_page(NULL);
	}
}

TEST(test_work_without_numbers, made_page, made_end)
{
	static const double ways[] = {NAN, INFINITY, -INFINITY, 1e300};

	for (size_t i = 0; i < sizeof(ways) / sizeof(*ways); i++) {
		struct incise_tick bad = at(ways[i], 1e300), good = at(0, -1);

		incise_state_tick(made.writer, &bad, 0, 0, 0);
		incise_state_tick(made.writer, &good, 0, 0, 0);
	}
	look();
	assert_true(isfinite(now.absorbed_mJ) && isfinite(now.returned_mJ));
}

/*
 * As after years: each addition lies below the last bit of the sum, and would be lost without
 * the correction. Ten million times 5e-11 are 5e-4.
 */
TEST(test_long_sum_of_work, made_page, made_end)
{
	struct incise_tick tick = at(0, 2);
	const int n = cases_of(10000000, 500000);
	double naive = 1e6;

	incise_state_tick(made.writer, &tick, 0, 0, 0);
	/* 1e6 mJ at once; another tool, and short ways to and fro, each against the force. */
	tick = at(-5e5, 2);
	incise_state_tick(made.writer, &tick, 0, 0, 0);
	for (int i = 0; i <= n; i++) {
		tick = i % 2 ? at(-2.5e-11, -2) : at(0, 2);
		tick.tool = INCISE_TOOL_HANDLE;
		incise_state_tick(made.writer, &tick, 0, 0, 0);
		naive += i ? 5e-11 : 0;
	}
	look();
	assert_true(naive == 1e6);
	/* The last bit of 1e6. */
	assert_true(fabs(now.absorbed_mJ - 1e6 - 5e-11 * n) <= 0x1p-33);
}
