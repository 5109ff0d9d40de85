// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Thresholds to the ulp and to the ns: where a contact starts and ends, and when a pose is too
 * old; and jumps, which are no way.
 */
#include "../unit.h"
#include <float.h>
#include "../../extremes/fed_run.h"

/* A plan whose force has been let through, far above a plane. */
static void begin(struct fed_run *run)
{
	static struct extremes_row row;
	const struct ground *plane = ground_of("plane");

	row = (struct extremes_row){.name = "thresholds"};
	fed_run_begin(run, &row, plane, ground_scene(plane, false, false), 1000000000);
	fed_run_hold(run, (const double[3]){0, 0, 80}, (const double[4]){1}, 200);
}

static void end(struct fed_run *run)
{
	struct incise_scene *scene = (struct incise_scene *)run->plan->scene;

	fed_run_end(run);
	incise_scene_free(scene);
	if (run->row->wrong)
		fail_msg("%s", run->row->failed);
}

/* Go there in one jump, which no filter changes. */
static bool touches_at(struct fed_run *run, double z)
{
	for (int i = 0; i < 8; i++)
		fed_run_step(run, MS);
	fed_run_feed(run, run->t_ns, (const double[3]){0, 0, z}, (const double[4]){1});
	fed_run_tick(run, run->t_ns);
	assert_true(run->tick.position_mm[2] == z);
	return run->tick.flags & INCISE_TICK_CONTACT;
}

TEST(test_thresholds_of_contact)
{
	const double leave = GROUND_LEAVE_MM;
	struct fed_run run;

	begin(&run);
	/* A contact starts on the surface, and not the least above it. */
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
	end(&run);
}

TEST(test_threshold_of_age)
{
	struct fed_run run;

	for (int late = -1; late <= 1; late++) {
		begin(&run);
		fed_run_tick(&run,
			     run.plan->doubles.state.scalpel.t_ns + GROUND_AGE_NS + late);
		assert_int_equal(!!(run.tick.flags & INCISE_TICK_STALE), late > 0);
		end(&run);
	}
}

/* From blade to handle, and by a jump of the tracker's, the end of the tool goes no way. */
TEST(test_no_debt_without_a_way)
{
	struct fed_run run;

	for (int turn = 0; turn < 2; turn++) {
		begin(&run);
		fed_run_hold(&run, (const double[3]){0, 0, -8}, (const double[4]){1},
			     100);
		/* Of the 1.12 N of skin, 8 mm at 0.14 N/mm, half has to be there. */
		assert_true(run.tick.command_N[2] > 0.56);
		/* Out at once: the slew takes 0.4 N in a tick. */
		fed_run_feed(&run, run.t_ns, (const double[3]){0, 0, 500},
			     (const double[4]){1});
		fed_run_step(&run, MS);
		assert_true(run.tick.command_N[2] > 0.56 - GROUND_SLEW_N);
		if (turn) {
			incise_plan_set_tool(run.plan, INCISE_TOOL_HANDLE);
			fed_run_step(&run, MS);
			assert_int_equal(run.tick.tool, INCISE_TOOL_HANDLE);
		}
		end(&run);
	}
}
