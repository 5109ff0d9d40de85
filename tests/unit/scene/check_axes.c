// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Stability of a scene along each actuator of a rig: its own lateness counts, and directions that
 * are not at right angles.
 */
#include "../unit.h"
#include <incise/backend.h>
#include <incise/plan.h>
#include "../message.h"
#include "../base/temp_file.h"

#define DEVICES (INCISE_RIG_TRACKER | INCISE_RIG_STEPPER)
#define SOFT_N_mm 0.1

/* The second actuator, as rig.conf would describe it. */
static double late_s;
static const struct incise_stepper_ops *real_ops;

static void late_info(const struct incise_stepper *stepper,
		      struct incise_stepper_info *info)
{
	real_ops->info(stepper, info);
	info->late_s = late_s;
}

/* Plan a wall on a rig whose second actuator is so late; 0 or -errno. */
static int plan_wall(const char *rig_text, double wall_N_mm, int late_ticks, double late,
		     struct incise_plan_stability *stability, struct incise_error *err)
{
	struct temp_file rig_file = temp_file_new("rig.conf", rig_text), scene_file;
	struct incise_rig *rig = incise_rig_open(rig_file.path, DEVICES, err);
	struct incise_stepper *second = incise_rig_axis(rig, 1, NULL);
	struct incise_stepper_ops ops;
	struct incise_scene *scene;
	struct incise_plan *plan;
	char text[200];
	int rc;

	snprintf(text, sizeof(text),
		 "tissue = { reaction_N_mm = %.12f; }; device = { late_ticks = %d; };",
		 wall_N_mm, late_ticks);
	scene_file = temp_file_new("wall.scene", text);
	scene = incise_scene_load(scene_file.path, NULL, err);
	assert_non_null(scene);
	if (second) {
		late_s = late;
		real_ops = second->ops;
		ops = *real_ops;
		ops.info = late_info;
		second->ops = &ops;
	}
	plan = incise_plan_new(scene, rig, err);
	rc = plan ? 0 : -errno;
	if (plan && stability)
		incise_plan_stability(plan, stability);
	if (second)
		second->ops = real_ops;
	incise_plan_free(plan);
	incise_scene_free(scene);
	incise_rig_close(rig);
	temp_file_free(&scene_file);
	temp_file_free(&rig_file);
	return rc;
}

#define VIRTUAL "clock = \"simulated\"; tracker = \"sim:\"; stepper = \"sim:\"; "
static const char one[] = VIRTUAL, two[] = VIRTUAL "sim = { axes = 2; };";

TEST(each_actuator_has_its_own_limit)
{
	struct incise_plan_stability s, alone;

	assert_int_equal(plan_wall(two, SOFT_N_mm, 0, 0.008, &s, &err), 0);
	assert_int_equal(s.n_axes, 2);
	/* 8 ms at 1 kHz. */
	assert_int_equal(s.axis_late_ticks[0], 0);
	assert_int_equal(s.axis_late_ticks[1], 8);
	assert_int_equal(s.late_ticks, 8);
	/* As of a scene that says so of its only actuator: the worst counts. */
	assert_int_equal(plan_wall(one, SOFT_N_mm, 8, 0, &alone, &err), 0);
	assert_true(alone.n_axes == 1 && s.weakest.margin == alone.weakest.margin);
	assert_int_equal(plan_wall(one, SOFT_N_mm, 0, 0, &alone, &err), 0);
	assert_true(s.weakest.margin < 0.9 * alone.weakest.margin);
	/* The scene's lateness is the least of each. */
	assert_int_equal(plan_wall(two, SOFT_N_mm, 3, 0.002, &s, &err), 0);
	assert_true(s.axis_late_ticks[0] == 3 && s.axis_late_ticks[1] == 3);
}

/* A wall that the first actuator holds, and the second does not. */
TEST(the_worst_actuator_decides)
{
	struct incise_plan_stability s, alone;
	double wall_N_mm;

	assert_int_equal(plan_wall(one, SOFT_N_mm, 0, 0, &alone, &err), 0);
	assert_int_equal(plan_wall(two, SOFT_N_mm, 0, 0.008, &s, &err), 0);
	wall_N_mm = SOFT_N_mm * (alone.weakest.margin + s.weakest.margin) / 2;
	/* Of which 4 % are kept in reserve. */
	assert_true(1.06 * wall_N_mm < SOFT_N_mm * alone.weakest.margin);
	assert_int_equal(plan_wall(one, wall_N_mm, 0, 0, &s, &err), 0);
	assert_int_equal(plan_wall(two, wall_N_mm, 0, 0, &s, &err), 0);
	assert_error(plan_wall(two, wall_N_mm, 0, 0.008, &s, &err), EDOM, &err,
		     "not stable");
	/* Beyond what the theory covers. */
	assert_error(plan_wall(two, SOFT_N_mm, 0, 0.0161, &s, &err), EDOM, &err,
		     "actuator.late_ms", "17");
	assert_int_equal(plan_wall(two, SOFT_N_mm, 0, 0.016, &s, &err), 0);
}

/* At 60 degrees each pushes up to 1 / sin 60° times the force. */
TEST(actuators_that_push_against_each_other)
{
	static const char text[] =
		VIRTUAL "surface = { normal = [0.0, 0.5, 0.8660254037844386]; };"
			"sim = { axes = 2; };";
	struct incise_plan_stability s, alone;
	double more = 2 / sqrt(3), wall_N_mm;

	assert_int_equal(plan_wall(one, SOFT_N_mm, 0, 0, &alone, &err), 0);
	assert_int_equal(plan_wall(text, SOFT_N_mm, 0, 0, &s, &err), 0);
	/* A margin is found within 4 thousandths. */
	assert_true(fabs(alone.weakest.margin / s.weakest.margin - more) < 0.01);
	/* A wall that one actuator holds alone is refused, and its share is not. */
	wall_N_mm = 0.9 * SOFT_N_mm * alone.weakest.margin;
	assert_int_equal(plan_wall(one, wall_N_mm, 0, 0, &s, &err), 0);
	assert_int_equal(plan_wall(text, wall_N_mm, 0, 0, &s, &err), -EDOM);
	assert_int_equal(plan_wall(text, wall_N_mm / more, 0, 0, &s, &err), 0);
}
