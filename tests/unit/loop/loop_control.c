// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/loop_control.c: an offered plan is taken once or withdrawn once, events keep their order
 * and dropped ones are counted. tests/unit/loop/loop.c tests the loop with it.
 */
#include "../unit.h"
#include <pthread.h>
#include <stdatomic.h>
#include "../../../lib/loop/loop_control.h"

/* Never dereferenced. */
static struct incise_plan *plan(int i)
{
	static char plans[8];

	return (struct incise_plan *)&plans[i];
}

TEST(test_one_place)
{
	struct incise_loop_control *control = incise_loop_control_new();

	assert_false(incise_loop_control_waiting(control));
	assert_null(incise_loop_control_withdraw(control));
	assert_null(incise_loop_control_next(control));
	assert_null(incise_loop_control_retired(control));

	assert_int_equal(incise_loop_control_offer(control, plan(1)), 0);
	assert_int_equal(incise_loop_control_offer(control, plan(2)), -EBUSY);
	assert_true(incise_loop_control_waiting(control));
	assert_ptr_equal(incise_loop_control_withdraw(control), plan(1));
	assert_null(incise_loop_control_next(control));

	assert_int_equal(incise_loop_control_offer(control, plan(1)), 0);
	assert_ptr_equal(incise_loop_control_next(control), plan(1));
	incise_loop_control_retire(control, plan(0));
	/* The place of the old one is not free yet. */
	assert_int_equal(incise_loop_control_offer(control, plan(2)), -EBUSY);
	assert_null(incise_loop_control_withdraw(control));
	assert_ptr_equal(incise_loop_control_retired(control), plan(0));
	assert_null(incise_loop_control_retired(control));
	assert_int_equal(incise_loop_control_offer(control, plan(2)), 0);
	/* One that was offered between taking and retiring waits for that place. */
	assert_ptr_equal(incise_loop_control_next(control), plan(2));
	assert_int_equal(incise_loop_control_offer(control, plan(0)), 0);
	incise_loop_control_retire(control, plan(1));
	assert_false(incise_loop_control_waiting(control));
	assert_ptr_equal(incise_loop_control_retired(control), plan(1));
	assert_true(incise_loop_control_waiting(control));
	incise_loop_control_free(control);
	incise_loop_control_free(NULL);
}

TEST(test_events)
{
	struct incise_loop_control *control = incise_loop_control_new();
	struct incise_loop_event events[100];
	uint64_t seen = 0;
	int n;

	for (uint64_t i = 0; i < 1000; i++)
		incise_loop_control_event(control,
					  &(struct incise_loop_event){.tick = i});
	while ((n = incise_loop_control_events(control, events, 100)) > 0)
		for (int i = 0; i < n; i++)
			assert_int_equal(events[i].tick, seen++);
	/* The oldest events are kept. */
	assert_true(seen > 0);
	assert_int_equal(incise_loop_control_events_lost(control), 1000 - seen);
	incise_loop_control_free(control);
}

TEST(test_ticks)
{
	struct incise_loop_control *control = incise_loop_control_new();
	struct incise_tick ticks[100];
	uint64_t seen = 0, lost = 1;
	int n;

	/* Nobody wants them. */
	incise_loop_control_tick(control, &(struct incise_tick){.t_ns = 1});
	assert_int_equal(incise_loop_control_take(control, ticks, 100, &lost), 0);
	assert_int_equal(lost, 0);
	assert_int_equal(incise_loop_control_keep(control, 0), -EINVAL);
	assert_int_equal(incise_loop_control_keep(control, 256), 0);
	assert_int_equal(incise_loop_control_keep(control, 256), -EEXIST);
	for (int64_t i = 0; i < 1000; i++)
		incise_loop_control_tick(control, &(struct incise_tick){.t_ns = i});
	while ((n = incise_loop_control_take(control, ticks, 100, &lost)) > 0)
		for (int i = 0; i < n; i++)
			assert_int_equal(ticks[i].t_ns, seen++);
	assert_true(seen >= 256);
	assert_int_equal(lost, 1000 - seen);
	/* A loop goes on after a loss. */
	incise_loop_control_tick(control, &(struct incise_tick){.t_ns = 1000});
	assert_int_equal(incise_loop_control_take(control, ticks, 100, NULL), 1);
	assert_int_equal(ticks[0].t_ns, 1000);
	incise_loop_control_free(control);
}

/* The last one that was set counts, for any number of ticks; none that is no tool. */
TEST(test_tool)
{
	struct incise_loop_control *control = incise_loop_control_new();
	enum incise_tool tool = INCISE_TOOL_HANDLE;

	assert_false(incise_loop_control_wanted_tool(control, &tool));
	assert_int_equal(tool, INCISE_TOOL_HANDLE);
	assert_int_equal(incise_loop_control_tool(control), INCISE_TOOL_AUTO);
	for (int i = INCISE_TOOL_AUTO; i <= INCISE_TOOL_TUBE; i++) {
		assert_int_equal(
			incise_loop_control_set_tool(control, (enum incise_tool)i), 0);
		assert_int_equal(incise_loop_control_set_tool(
					 control,
					 (enum incise_tool)(INCISE_TOOL_TUBE + 1 + i)),
				 -EINVAL);
		for (int k = 0; k < 2; k++) {
			assert_true(incise_loop_control_wanted_tool(control, &tool));
			assert_int_equal(tool, i);
		}
	}
	incise_loop_control_ticked(control, 1, INCISE_TOOL_HANDLE);
	assert_int_equal(incise_loop_control_tool(control), INCISE_TOOL_HANDLE);
	incise_loop_control_free(control);
}

/* A loop that only changes plans. */
struct changer {
	struct incise_loop_control *control;
	atomic_bool end;
	long swaps;
};

static void *change(void *argument)
{
	struct changer *changer = argument;
	struct incise_plan *now = plan(0);

	while (!atomic_load(&changer->end)) {
		struct incise_plan *next = NULL;

		if (incise_loop_control_waiting(changer->control))
			next = incise_loop_control_next(changer->control);
		if (next) {
			incise_loop_control_retire(changer->control, now);
			now = next;
			changer->swaps++;
		}
		incise_loop_control_ticked(changer->control, (uint64_t)changer->swaps,
					   INCISE_TOOL_BLADE);
	}
	return now;
}

/* No interleaving of the two threads loses or doubles a plan. */
TEST(test_two_threads)
{
	struct changer changer = {.control = incise_loop_control_new()};
	struct incise_plan *owned = plan(1), *retired;
	long taken = 0, withdrawn = 0;
	pthread_t thread;
	void *last;

	assert_int_equal(pthread_create(&thread, NULL, change, &changer), 0);
	for (long i = 0; i < 20000; i++) {
		assert_int_equal(incise_loop_control_offer(changer.control, owned), 0);
		if (incise_loop_control_withdraw(changer.control)) {
			withdrawn++;
			continue;
		}
		/* The loop took it, or is about to. */
		do
			retired = incise_loop_control_retired(changer.control);
		while (!retired);
		assert_ptr_not_equal(retired, owned);
		owned = retired;
		taken++;
	}
	atomic_store(&changer.end, true);
	pthread_join(thread, &last);
	assert_ptr_not_equal(last, owned);
	assert_int_equal(taken + withdrawn, 20000);
	assert_int_equal(changer.swaps, taken);
	assert_int_equal(incise_loop_control_ticks(changer.control), taken);
	incise_loop_control_free(changer.control);
}
