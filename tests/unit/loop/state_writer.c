// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/state_writer.c: what is told is what is read; what does not fit is cut.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <time.h>
#include "../scene/felt.h"
#include "state_made.h"

static struct incise_state_now now;

static void look(const struct made *made)
{
	struct incise_state *state = incise_state_open(made->path, NULL);

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

static void test_before_the_first_tick(void **state)
{
	int64_t mono = clock_ns(CLOCK_MONOTONIC), real = clock_ns(CLOCK_REALTIME);
	struct made made = made_page();

	look(&made);
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
	made_free(&made);
}

static void test_ticks(void **state)
{
	struct made made = made_page();
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
	look(&made);
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
	made_free(&made);
}

/* Much longer than the ring: counts are exact, and the ring goes round. */
static void test_many_ticks(void **state)
{
	struct made made = made_page();
	const int64_t n = 5 * INCISE_STATE_TICKS + 7;
	struct incise_tick last = made_tick(n - 1);

	made_ticks(made.writer, 0, n);
	look(&made);
	assert_int_equal(now.ticks, n);
	assert_int_equal(incise_state_total(&now.lateness), n);
	assert_int_equal(incise_state_total(&now.cost), n);
	assert_int_equal(now.lateness_max_ns, n - 1);
	assert_int_equal(now.cost_max_ns, 2 * (n - 1));
	assert_true(made_same(&now.tick, &last));
	made_free(&made);
}

static void test_states(void **state)
{
	struct made made = made_page();
	int64_t since;

	incise_state_run(made.writer, INCISE_RUN_RUNNING, "as asked");
	look(&made);
	assert_int_equal(now.run, INCISE_RUN_RUNNING);
	assert_string_equal(now.reason, "as asked");
	since = now.since_ns;
	/* The same state with another reason has been for as long. */
	incise_state_run(made.writer, INCISE_RUN_RUNNING, NULL);
	look(&made);
	assert_int_equal(now.since_ns, since);
	assert_string_equal(now.reason, "");
	/* So it has after a reload. */
	incise_state_run(made.writer, INCISE_RUN_RELOADING, NULL);
	look(&made);
	assert_true(now.since_ns > since);
	incise_state_run(made.writer, INCISE_RUN_RUNNING, NULL);
	look(&made);
	assert_int_equal(now.since_ns, since);
	incise_state_refused(made.writer, "neck.scene:3: syntax error");
	look(&made);
	assert_int_equal(now.run, INCISE_RUN_RUNNING);
	assert_int_equal(now.refused, 1);
	assert_string_equal(now.reason, "neck.scene:3: syntax error");
	incise_state_run(made.writer, INCISE_RUN_FAULT, "e-stop\nwas\x1b[2J pressed");
	look(&made);
	assert_true(now.since_ns > since);
	assert_string_equal(now.reason, "e-stop?was?[2J pressed");
	/* It stays so when the writer has gone. */
	incise_state_free(made.writer);
	made.writer = NULL;
	look(&made);
	assert_false(now.alive);
	assert_false(now.torn);
	assert_int_equal(now.run, INCISE_RUN_FAULT);
	made_free(&made);
}

static void test_scene(void **state)
{
	struct made made = made_page();
	struct felt f;
	const char *why;
	int n = 0, out = 0;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	incise_state_scene(made.writer, "/etc/incise/scenes/neck.scene", f.plan);
	look(&made);
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
	/* The first is no reload. */
	assert_int_equal(now.reloads, 0);
	incise_state_scene(made.writer, "b.scene", NULL);
	look(&made);
	assert_int_equal(now.reloads, 1);
	assert_int_equal(now.n_stages, 0);
	assert_string_equal(now.scene, "b.scene");
	felt_end(&f);
	made_free(&made);
}

static void test_counts(void **state)
{
	struct incise_realtime_counts counts = {1, 2, 3, 4};
	struct made made = made_page();

	incise_state_counts(made.writer, &counts);
	look(&made);
	assert_int_equal(now.minor_faults, 1);
	assert_int_equal(now.major_faults, 2);
	assert_int_equal(now.voluntary, 3);
	assert_int_equal(now.involuntary, 4);
	made_free(&made);
}

static void test_what_is_too_long(void **state)
{
	struct made made = made_page();
	char text[2001], *end;

	/* A character of two bytes that would be cut in the middle is left out. */
	memset(text, 'a', 2000);
	text[2000] = 0;
	memcpy(text + 298, "\xc3\xa4", 2);
	incise_state_run(made.writer, INCISE_RUN_RUNNING, text);
	look(&made);
	assert_int_equal(strlen(now.reason), 298);
	memset(text, 'a', 2000);
	memcpy(text + 1990, "neck.scene", 10);
	incise_state_scene(made.writer, text, NULL);
	look(&made);
	assert_int_equal(strlen(now.scene), 511);
	end = now.scene + 511 - 10;
	assert_string_equal(end, "neck.scene");
	assert_memory_equal(now.scene, "...a", 4);
	/* 511 bytes just fit. */
	text[511] = 0;
	incise_state_scene(made.writer, text, NULL);
	look(&made);
	assert_string_equal(now.scene, text);
	made_free(&made);
}

/* A loop without a page has no branch of its own. */
static void test_without_a_page(void **state)
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

static void test_names(void **state)
{
	assert_string_equal(incise_run_name(INCISE_RUN_STARTING), "starting");
	assert_string_equal(incise_run_name(INCISE_RUN_FAULT), "fault");
	assert_string_equal(incise_run_name((enum incise_run)INCISE_RUNS), "unknown");
	assert_string_equal(incise_run_name((enum incise_run) - 1), "unknown");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_before_the_first_tick),
		cmocka_unit_test(test_ticks),
		cmocka_unit_test(test_many_ticks),
		cmocka_unit_test(test_states),
		cmocka_unit_test(test_scene),
		cmocka_unit_test(test_counts),
		cmocka_unit_test(test_what_is_too_long),
		cmocka_unit_test(test_without_a_page),
		cmocka_unit_test(test_names),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
