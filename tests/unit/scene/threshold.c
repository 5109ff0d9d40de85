// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Thresholds, to the ulp and to the ns: where a contact begins and ends, when
 * a pose is too old; and what is no way at all.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include "fed_run.h"

/* A plan whose force has been let through, far above a plane. */
static void begin(struct run *run, struct ground_folder *folder,
		  struct incise_scene **scene)
{
	ground_folder_make(folder);
	*scene = ground_scene(folder, &grounds[0], "double", false);
	*run = (struct run){.ground = &grounds[0], .t_ns = 1000000000};
	snprintf(run->what, sizeof(run->what), "thresholds");
	run->plan = ground_plan(*scene);
	incise_plan_top(run->plan, &run->top);
	hold(run, (const double[3]){0, 0, 80}, (const double[4]){1}, 200);
}

static void end(struct run *run, struct ground_folder *folder, struct incise_scene *scene)
{
	incise_plan_free(run->plan);
	incise_scene_free(scene);
	ground_folder_remove(folder);
}

/* Go there in one leap, which no filter changes. */
static bool touches_at(struct run *run, double z)
{
	for (int i = 0; i < 8; i++)
		step(run, MS);
	feed(run, run->t_ns, (const double[3]){0, 0, z}, (const double[4]){1});
	tick_at(run, run->t_ns);
	assert_true(run->tick.position_mm[2] == z);
	return run->tick.flags & INCISE_TICK_CONTACT;
}

static void test_thresholds_of_contact(void **state)
{
	const double leave = GROUND_LEAVE_MM;
	struct ground_folder folder;
	struct incise_scene *scene;
	struct run run;

	begin(&run, &folder, &scene);
	/* A contact begins on the surface, and not the least above it. */
	assert_false(touches_at(&run, 50));
	assert_false(touches_at(&run, DBL_TRUE_MIN));
	assert_false(touches_at(&run, 50));
	assert_true(touches_at(&run, 0));
	assert_false(touches_at(&run, 50));
	assert_true(touches_at(&run, -0.0));
	assert_false(touches_at(&run, 50));
	assert_true(touches_at(&run, -DBL_TRUE_MIN));
	/* It ends beyond leave_mm, and not there. */
	assert_true(touches_at(&run, -50));
	assert_true(touches_at(&run, nextafter(leave, 0)));
	assert_true(touches_at(&run, -50));
	assert_true(touches_at(&run, leave));
	assert_true(touches_at(&run, -50));
	assert_false(touches_at(&run, nextafter(leave, 1)));
	end(&run, &folder, scene);
}

static void test_threshold_of_age(void **state)
{
	struct ground_folder folder;
	struct incise_scene *scene;
	struct run run;

	for (int late = -1; late <= 1; late++) {
		begin(&run, &folder, &scene);
		tick_at(&run, run.plan->predict.t_ns + GROUND_AGE_NS + late);
		assert_int_equal(!!(run.tick.flags & INCISE_TICK_STALE), late > 0);
		end(&run, &folder, scene);
	}
}

/* From blade to handle, and by a tracker's leap, the end of the tool goes no way. */
static void test_no_debt_without_a_way(void **state)
{
	struct ground_folder folder;
	struct incise_scene *scene;
	struct run run;

	for (int turn = 0; turn < 2; turn++) {
		begin(&run, &folder, &scene);
		hold(&run, (const double[3]){0, 0, -8}, (const double[4]){1}, 100);
		assert_true(run.tick.command_N[2] > 1);
		/* Out at once: for some ticks there is still a force, held by the slew. */
		feed(&run, run.t_ns, (const double[3]){0, 0, 500}, (const double[4]){1});
		step(&run, MS);
		assert_true(run.tick.command_N[2] > 1);
		if (turn) {
			incise_plan_set_tool(run.plan, INCISE_TOOL_HANDLE);
			step(&run, MS);
			assert_int_equal(run.tick.tool, INCISE_TOOL_HANDLE);
		}
		assert_false(run.plan->guard->energy_N_mm < 0);
		end(&run, &folder, scene);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_thresholds_of_contact),
		cmocka_unit_test(test_threshold_of_age),
		cmocka_unit_test(test_no_debt_without_a_way),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
