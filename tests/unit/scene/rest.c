// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Where a blade rests at a membrane, in a closed loop that shares no line with the search for swings.
 * rest_3d.c and `incise bench stability` have any scene that is accepted.
 */
#include "../unit.h"
#include <incise/plan.h>
#include "../../../tools/bench/closed_loop.h"
#include "../message.h"

/* A static force is the lean's to the last roundings. */
static struct closed_loop_end rests(struct incise_plan *plan,
				    const struct closed_loop *loop, int run)
{
	struct closed_loop_end end;

	assert_true(closed_loop_run(plan, loop, run, &end));
	if (!(end.moved_mm <= CLOSED_LOOP_SWING_MM) ||
	    !(fabs(end.force_N - loop->lean_N) < 0.01))
		fail_msg("%g N: moves within %g mm, pushes with %g N", loop->lean_N,
			 end.moved_mm, end.force_N);
	return end;
}

#define N(array) ((int)(sizeof(array) / sizeof(*(array))))

/*
 * A wall of 0.14 N/mm with a membrane 2 mm below, which yields at 0.8 N more, and a back wall: a
 * blade rests in front of it, on it, and behind the airway; also at the step where it yields.
 */
TEST(test_membrane)
{
	static const double leans_N[] = {0.1, 0.27, 0.29, 0.6, 1.05, 1.1, 1.5, 2, 3};
	const double front_N = 2 * 0.14, slope_N_mm = 0.8 / 5;
	struct closed_loop loop = {.mass_kg = 0.05,
				   .damping_N_s_mm = 0.01,
				   .tracker_hz = 120,
				   .latency_s = 4.2e-3,
				   .run_s = 8};
	struct incise_tracker_info tracker = closed_loop_tracker(&loop);
	char path[] = "/tmp/incise-rest-XXXXXX";
	struct incise_scene *scene;
	struct incise_plan *plan;
	int fd = mkstemp(path);

	assert_true(fd >= 0);
	dprintf(fd, "tissue = { reaction_N_mm = 0.14; };\n"
		    "membrane = { point_mm = [0.0, 0.0, -2.0]; radius_mm = 1000.0;\n"
		    "thickness_mm = 5.0; puncture_N = 0.8; back_wall_mm = 14.0; };\n");
	close(fd);
	scene = incise_scene_load(path, NULL, &err);
	unlink(path);
	succeeds(scene);
	plan = incise_plan_new_fed(scene, &tracker, &err);
	succeeds(plan);
	for (int i = 0; i < N(leans_N); i++) {
		double over_N = leans_N[i] - front_N, want_mm;
		struct closed_loop_end end;

		loop.lean_N = leans_N[i];
		end = rests(plan, &loop, i);
		/* The first that it yields to opens it for all that follow. */
		want_mm = over_N < 0	 ? leans_N[i] / 0.14
			  : over_N < 0.8 ? 2 + over_N / slope_N_mm
					 : 2 + 14 + over_N / slope_N_mm;
		if (!(fabs(end.depth_mm - want_mm) < CLOSED_LOOP_SWING_MM))
			fail_msg("%g N: rests at %g mm and not at %g", leans_N[i],
				 end.depth_mm, want_mm);
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

TEST(test_wrong_words)
{
	static const char *const wrong[] = {"withdrawal = \"Paper\";", "withdrawal = 1;",
					    "friction = 1.1;", "unloading_N_mm = -1.0;"};

	for (int i = 0; i < N(wrong); i++) {
		char path[] = "/tmp/incise-rest-XXXXXX";
		int fd = mkstemp(path);

		assert_true(fd >= 0);
		dprintf(fd, "tissue = { reaction_N_mm = 0.1; %s };\n", wrong[i]);
		close(fd);
		assert_error(incise_scene_load(path, NULL, &err), EINVAL, &err, path,
			     ":1");
		unlink(path);
	}
}
