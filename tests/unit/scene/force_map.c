// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The forces of a plan about a state of contact, against what geometry says of a ball: a spring K along its normal, at
 * the depth d, is one along the normal, and across pushes off by K d / (R - d); where the normal is averaged that part is
 * as late as it.
 */
#include "../unit.h"
#include <incise/plan.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/rest.h"
#include "fed.h"

#define R_MM 20.0
#define DEPTH_MM 2.0

/* Down on the top of the ball, ever slower, so that no filter shows it deeper than it comes. */
static void stand(void *own, double t_s, struct incise_tracker_sample *pose)
{
	pose->position_mm[2] = R_MM - DEPTH_MM + (1 + DEPTH_MM) * exp(-5 * t_s);
}

static void map_of(const char *tissue, bool against, struct incise_force_map *map)
{
	static const double axis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_tick tick;
	char text[500];
	int64_t t_ns = 0;
	double force_N;

	snprintf(
		text, sizeof(text),
		"surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, 0.0]; radius_mm = %.1f; "
		"}; arithmetic = \"double\"; %s",
		R_MM, tissue);
	plan = fed_plan(&folder, &tracker, &scene, text);
	while (t_ns < 4000000000)
		assert_int_equal(fed_tick(plan, t_ns += 1000000, stand, NULL, &tick), 0);
	assert_true(fabs(tick.depth_mm - DEPTH_MM) < 1e-6);
	force_N = v3_length(tick.command_N);
	incise_plan_force_map(plan, t_ns, axis, against, map);
	/* As it was: the next tick goes on. */
	t_ns += 1000000;
	assert_int_equal(fed_tick(plan, t_ns, stand, NULL, &tick), 0);
	assert_true(fabs(v3_length(tick.command_N) - force_N) < 1e-6);
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static void assert_diagonal(const double m[3][3], double across, double normal)
{
	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 3; k++) {
			double want = i != k ? 0 : i < 2 ? across : normal;

			if (!(fabs(m[i][k] - want) < 1e-5))
				fail_msg("%d %d: %g, not %g", i, k, m[i][k], want);
		}
}

TEST(test_a_ball)
{
	const double off = -0.1 * DEPTH_MM / (R_MM - DEPTH_MM);
	struct incise_force_map map;

	for (int against = 0; against < 2; against++) {
		map_of("tissue = { reaction_N_mm = 0.1; };", against, &map);
		assert_int_equal(map.mean_ticks, 1);
		assert_diagonal(map.now, off, 0.1);
		assert_diagonal(map.damping, 0, 0);
		map_of("tissue = { reaction_N_mm = 0.1; damping_N_s_mm = 5e-4; }; "
		       "effects = { average_ticks = 8; };",
		       against, &map);
		assert_int_equal(map.mean_ticks, 8);
		assert_diagonal(map.now, 0, 0.1);
		assert_diagonal(map.mean, off, 0);
		assert_diagonal(map.damping, 5e-4, 5e-4);
		assert_diagonal(map.mass, 0, 0);
	}
}

/* A model's tissue unloads as a spring, and is cut with the slope of the model, which is less. */
TEST(test_both_sides_of_a_cut)
{
	struct incise_force_map out, in;

	map_of("model = \"m.fis\"; tissue = { unloading_N_mm = 0.3; };", false, &out);
	map_of("model = \"m.fis\"; tissue = { unloading_N_mm = 0.3; };", true, &in);
	assert_true(fabs(out.now[2][2] - 0.3) < 1e-4);
	if (!(in.now[2][2] > 0 && in.now[2][2] < 0.25))
		fail_msg("%g N/mm", in.now[2][2]);
}

GROUP(fed_set_up, fed_tear_down);
