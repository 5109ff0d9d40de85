// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Leaving stages out: each optional stage against the same scene with all stages there and
 * the unneeded ones neutral. To the bit the same ticks, from fewer stages in no more
 * memory, and a reason for each.
 *
 * What leaving out costs or saves cannot be timed in a test: it counts the stages that run.
 * `incise plan` shows their ns.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include "fed.h"

#define TICKS 2500

static struct fed_folder folder;

static const char *const arithmetics[] = {"fixed", "double"};

static const struct surface {
	const char *name, *text;
} surfaces[] = {
	{"plane", "{ kind = \"plane\"; }"},
	{"capsule", "{ kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0];"
		    " to_mm = [60.0, 0.0, -55.0]; radius_mm = 55.0; }"},
	{"mesh", "{ kind = \"mesh\"; file = \"hill.obj\"; }"},
};
#define PLANE (&surfaces[0])
#define CAPSULE (&surfaces[1])

/* All stages that there are, in order. */
static const char *const all[] = {
	"pose",	 "predict", "tool",	 "contact",  "normal", "reaction",
	"plane", "damping", "insertion", "spread",   "guard",  "start",
	"limit", "actuate", "wound",	 "bleeding",
};
#define ALL (sizeof(all) / sizeof(*all))

/* Everything that has a stage. */
struct wishes {
	bool model;
	double gain, reaction, plane, damping, insertion, spread;
	int average;
	bool guard;
};
static const struct wishes everything = {false, 1, 0.3, 0.4, 0.002, 0.5, 0.4, 8, true};

/* A device that holds all this; limits that the stroke runs into. */
static struct incise_scene *scene_of(const struct wishes *w,
				     const struct surface *surface,
				     const char *arithmetic)
{
	char text[1200];
	struct incise_error err = {0};
	struct incise_scene *scene;

	snprintf(text, sizeof(text),
		 "%s arithmetic = \"%s\"; surface = %s;\n"
		 "tissue = { gain = %.17g; reaction_N_mm = %.17g; plane_N_mm = %.17g;\n"
		 "  damping_N_s_mm = %.17g; insertion_N_mm = %.17g;\n"
		 "  spread_N_mm = %.17g; };\n"
		 "effects = { average_ticks = %d; guard = %s; };\n"
		 "device = { delay_ticks = 0; };\n"
		 "limits = { force_N = 1.2; slew_N_s = 200.0; ramp_ms = 50.0; };\n",
		 w->model ? "model = \"m.fis\";" : "", arithmetic, surface->text, w->gain,
		 w->reaction, w->plane, w->damping, w->insertion, w->spread, w->average,
		 w->guard ? "true" : "false");
	scene = fed_scene(&folder, text, &err);
	if (!scene)
		fail_msg("%s", err.text);
	return scene;
}

static struct incise_plan *plan_of(const struct incise_scene *scene)
{
	struct incise_error err = {0};
	struct incise_plan *plan = incise_plan_new(scene, NULL, &err);

	if (!plan)
		fail_msg("%s", err.text);
	return plan;
}

/*
 * In and out of the tissue some five times, sideways and turning all the while, with the
 * blade down and, between 1.0 and 1.9 s, with the handle.
 */
static void stroke(void *own, double t, struct incise_tracker_sample *pose)
{
	bool round = t > 1.0 && t < 1.9;
	double tilt = 0.3 * sin(5 * t), turn = 1.5 * sin(3 * t);
	double end[3] = {15 * sin(5.7 * t), 8 * sin(8.2 * t),
			 0.5 - 5 * sin(2 * M_PI * 2 * t)};

	fed_attitude(pose->quaternion, round ? M_PI + tilt : tilt, turn);
	memcpy(pose->position_mm, end, sizeof(end));
	if (round) {
		/* The tip is at the other end of the axis, which the turns carry along. */
		pose->position_mm[0] -= 120 * -sin(turn) * sin(tilt);
		pose->position_mm[1] -= 120 * cos(turn) * sin(tilt);
		pose->position_mm[2] += 120 * cos(tilt);
	}
}

/* Poses fail for 120 ms each 0.7 s, in the tissue and out of it. */
static bool silent(int i)
{
	return i % 700 >= 580;
}

static bool same(const struct incise_tick *a, const struct incise_tick *b)
{
#define SAME(field) !memcmp(&a->field, &b->field, sizeof(a->field))
	return SAME(t_ns) && SAME(position_mm) && SAME(tool_mm) && SAME(proxy_mm) &&
	       SAME(normal) && SAME(depth_mm) && SAME(velocity_mm_s) && SAME(command_N) &&
	       SAME(rendered_N) && SAME(flags) && SAME(phase) && SAME(tool);
#undef SAME
}

/* What the stroke went through. */
struct seen {
	unsigned int flags, phases, tools;
	int ticks_with_force;
};

static void compare(struct incise_plan *a, struct incise_plan *b, struct seen *seen)
{
	for (int i = 0; i < TICKS; i++) {
		int64_t t_ns = (int64_t)(i + 10) * 1000000;
		struct incise_tick x, y;

		if (i == 2000 || i == 2300) {
			enum incise_tool tool =
				i == 2000 ? INCISE_TOOL_TUBE : INCISE_TOOL_AUTO;

			assert_int_equal(incise_plan_set_tool(a, tool), 0);
			assert_int_equal(incise_plan_set_tool(b, tool), 0);
		}
		fed_tick(a, t_ns, silent(i) ? NULL : stroke, NULL, &x);
		fed_tick(b, t_ns, silent(i) ? NULL : stroke, NULL, &y);
		if (!same(&x, &y))
			fail_msg("tick %d: %.17g %.17g %.17g N, flags %x, or %.17g %.17g "
				 "%.17g N, flags %x",
				 i, x.command_N[0], x.command_N[1], x.command_N[2],
				 x.flags, y.command_N[0], y.command_N[1], y.command_N[2],
				 y.flags);
		seen->flags |= x.flags;
		seen->phases |= 1U << x.phase;
		seen->tools |= 1U << x.tool;
		seen->ticks_with_force +=
			x.command_N[0] != 0 || x.command_N[1] != 0 || x.command_N[2] != 0;
	}
}

static int stages(const struct incise_plan *plan)
{
	int n = 0;

	while (incise_plan_stage(plan, n))
		n++;
	return n;
}

static bool keeps(const struct incise_plan *plan, const char *name)
{
	for (int i = 0; incise_plan_stage(plan, i); i++)
		if (!strcmp(incise_plan_stage(plan, i), name))
			return true;
	return false;
}

/* Why a stage is left out; NULL when it is not. */
static const char *why_not(const struct incise_plan *plan, const char *name)
{
	const char *why = NULL;

	for (int i = 0; incise_plan_left_out(plan, i, NULL); i++)
		if (!strcmp(incise_plan_left_out(plan, i, &why), name))
			return why;
	return NULL;
}

/* Each stage is kept or left out with a reason, in order, none of them twice. */
static void assert_complete(const struct incise_plan *plan)
{
	int kept = 0, out = 0;

	for (size_t i = 0; i < ALL; i++) {
		const char *stage = incise_plan_stage(plan, kept), *why = NULL;
		const char *left = incise_plan_left_out(plan, out, &why);

		if (stage && !strcmp(stage, all[i])) {
			kept++;
		} else {
			if (!left || strcmp(left, all[i]))
				fail_msg("%s is lost", all[i]);
			assert_true(strlen(why) > 10);
			out++;
		}
	}
	assert_null(incise_plan_stage(plan, kept));
	assert_null(incise_plan_left_out(plan, out, NULL));
	assert_null(incise_plan_left_out(plan, -1, NULL));
}

/* A scene that lacks something, and how it says so. */
struct lack {
	const char *stage, *why;
	struct wishes wishes;
	const char *also; /* another stage that goes with it */
};

static const struct lack lacks[] = {
	{"tool", "nothing is inserted", {false, 1, 0.3, 0.4, 0.002, 0, 0, 8, true}, NULL},
	{"normal",
	 "average_ticks is 1",
	 {false, 1, 0.3, 0.4, 0.002, 0.5, 0.4, 1, true},
	 NULL},
	{"reaction",
	 "reaction_N_mm is 0",
	 {false, 1, 0, 0.4, 0.002, 0.5, 0.4, 8, true},
	 NULL},
	{"plane", "plane_N_mm is 0", {false, 1, 0.3, 0, 0.002, 0.5, 0.4, 8, true}, NULL},
	{"plane", "plane_N_mm is 0", {true, 1, 0, 0, 0.002, 0.5, 0.4, 8, true}, NULL},
	{"damping",
	 "damping_N_s_mm is 0",
	 {false, 1, 0.3, 0.4, 0, 0.5, 0.4, 8, true},
	 NULL},
	{"insertion",
	 "insertion_N_mm is 0",
	 {false, 1, 0.3, 0.4, 0.002, 0, 0.4, 8, true},
	 NULL},
	{"spread",
	 "spread_N_mm is 0",
	 {false, 1, 0.3, 0.4, 0.002, 0.5, 0, 8, true},
	 NULL},
	{"guard",
	 "guard is false",
	 {false, 1, 0.3, 0.4, 0.002, 0.5, 0.4, 8, false},
	 NULL},
	/* One that lacks nearly all: paper 1's. */
	{"guard", "guard is false", {true, 1, 0, 0, 0, 0, 0, 1, false}, NULL},
	/* Nothing is felt, whatever the constants are. */
	{"reaction", "gain is 0", {true, 0, 0, 0.4, 0.002, 0.5, 0.4, 8, true}, "plane"},
	{"spread", "gain is 0", {false, 0, 0.3, 0.4, 0.002, 0.5, 0.4, 8, true}, "tool"},
};
#define LACKS (sizeof(lacks) / sizeof(*lacks))

static void test_lean_is_full_to_the_bit(const struct surface *surface,
					 const char *arithmetic)
{
	struct seen seen = {0};
	const unsigned int met = INCISE_TICK_CONTACT | INCISE_TICK_STALE |
				 INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED |
				 INCISE_TICK_STARTING | INCISE_TICK_GUARDED |
				 INCISE_TICK_EXTRAPOLATED;

	for (size_t i = 0; i < LACKS; i++) {
		const struct lack *lack = &lacks[i];
		struct incise_scene *scene = scene_of(&lack->wishes, surface, arithmetic);
		struct incise_plan *lean = plan_of(scene), *full;

		incise_scene_set_full(scene, true);
		full = plan_of(scene);
		assert_complete(lean);
		assert_complete(full);
		/* The rest, and the actuator of no rig, cannot be kept. */
		assert_int_equal(stages(full), 13);
		assert_true(stages(lean) < stages(full));
		/* What only a stage that is left out needs is not there. */
		assert_true(incise_plan_memory(lean) <= incise_plan_memory(full));
		if (!strcmp(lack->stage, "tool") || !strcmp(lack->stage, "normal") ||
		    !strcmp(lack->stage, "guard"))
			assert_true(incise_plan_memory(lean) < incise_plan_memory(full));
		assert_false(keeps(lean, lack->stage));
		if (!why_not(lean, lack->stage) ||
		    !strstr(why_not(lean, lack->stage), lack->why))
			fail_msg("case %zu: %s left out: %s", i, lack->stage,
				 why_not(lean, lack->stage));
		if (lack->also)
			assert_non_null(strstr(why_not(lean, lack->also), lack->why));
		assert_non_null(strstr(why_not(full, "actuate"), "no stepper"));
		compare(lean, full, &seen);
		incise_plan_free(full);
		incise_plan_free(lean);
		incise_scene_free(scene);
	}
	/* It was a varied stroke. */
	assert_int_equal(seen.flags & met, met);
	assert_int_equal(seen.phases, 7);
	assert_int_equal(seen.tools, 1 << INCISE_TOOL_BLADE | 1 << INCISE_TOOL_HANDLE |
					     1 << INCISE_TOOL_TUBE);
	assert_true(seen.ticks_with_force > TICKS * (int)LACKS / 4);
}

static void test_plane(void **state)
{
	test_lean_is_full_to_the_bit(&surfaces[0], arithmetics[0]);
	test_lean_is_full_to_the_bit(&surfaces[0], arithmetics[1]);
}

static void test_capsule(void **state)
{
	test_lean_is_full_to_the_bit(&surfaces[1], arithmetics[0]);
	test_lean_is_full_to_the_bit(&surfaces[1], arithmetics[1]);
}

static void test_mesh(void **state)
{
	test_lean_is_full_to_the_bit(&surfaces[2], arithmetics[0]);
	test_lean_is_full_to_the_bit(&surfaces[2], arithmetics[1]);
}

/* All wishes: all is kept, but for what no loop runs and what no rig has. */
static void test_everything(void **state)
{
	struct incise_scene *scene = scene_of(&everything, CAPSULE, "fixed");
	struct incise_plan *plan = plan_of(scene);

	assert_complete(plan);
	assert_int_equal(stages(plan), 13);
	assert_non_null(strstr(why_not(plan, "wound"), "picture.wound is false"));
	assert_non_null(strstr(why_not(plan, "bleeding"), "picture.bleeding is false"));
	incise_plan_free(plan);
	incise_scene_free(scene);
	/* On a plane there is nothing to average. */
	scene = scene_of(&everything, PLANE, "fixed");
	plan = plan_of(scene);
	assert_int_equal(stages(plan), 12);
	assert_non_null(strstr(why_not(plan, "normal"), "one normal"));
	incise_plan_free(plan);
	incise_scene_free(scene);
}

/* Pictures are nobody's force: asked for or not, the loop has no stage for them. */
static void test_picture(void **state)
{
	struct incise_scene *scene = fed_scene(&folder,
					       "tissue = { reaction_N_mm = 0.3; };\n"
					       "picture = { wound = true; };",
					       NULL);
	struct incise_plan *plan = plan_of(scene);

	assert_complete(plan);
	assert_non_null(strstr(why_not(plan, "wound"), "incise view"));
	assert_non_null(strstr(why_not(plan, "bleeding"), "picture.bleeding is false"));
	incise_plan_free(plan);
	incise_scene_free(scene);
}

/* One effect at a time, on a scene that has the reaction or the plane constraint only. */
static const struct {
	const char *stage, *with, *neutral;
} effects[] = {
	{"reaction", "tissue = { plane_N_mm = 0.4; reaction_N_mm = 0.3; };",
	 "tissue = { plane_N_mm = 0.4; reaction_N_mm = 0.0; };"},
	{"plane", "tissue = { plane_N_mm = 0.4; reaction_N_mm = 0.3; };",
	 "tissue = { reaction_N_mm = 0.3; plane_N_mm = 0.0; };"},
	{"damping", "tissue = { reaction_N_mm = 0.3; damping_N_s_mm = 0.002; };",
	 "tissue = { reaction_N_mm = 0.3; damping_N_s_mm = 0.0; };"},
	{"insertion", "tissue = { reaction_N_mm = 0.3; insertion_N_mm = 0.5; };",
	 "tissue = { reaction_N_mm = 0.3; insertion_N_mm = 0.0; };"},
	{"spread", "tissue = { reaction_N_mm = 0.3; spread_N_mm = 0.4; };",
	 "tissue = { reaction_N_mm = 0.3; spread_N_mm = 0.0; };"},
	{"normal",
	 "tissue = { reaction_N_mm = 0.3; }; effects = { average_ticks = 16; };",
	 "tissue = { reaction_N_mm = 0.3; }; effects = { average_ticks = 1; };"},
	{"guard", "tissue = { reaction_N_mm = 0.3; }; effects = { guard = true; };",
	 "tissue = { reaction_N_mm = 0.3; }; effects = { guard = false; };"},
};

static void test_one_effect(void **state)
{
	for (size_t i = 0; i < sizeof(effects) / sizeof(*effects); i++) {
		for (int a = 0; a < 4; a++) {
			const char *text[3] = {effects[i].with, effects[i].neutral,
					       i ? "tissue = { reaction_N_mm = 0.3; };"
						 : "tissue = { plane_N_mm = 0.4; };"};
			struct incise_scene *scene[3];
			struct incise_plan *plan[3];
			struct seen seen = {0};

			for (int k = 0; k < 3; k++) {
				char all_of_it[800];

				snprintf(all_of_it, sizeof(all_of_it),
					 "arithmetic = \"%s\"; surface = %s;\n%s\n"
					 "device = { delay_ticks = 0; };\n",
					 arithmetics[a & 1], surfaces[1 + a / 2].text,
					 text[k]);
				scene[k] = fed_scene(&folder, all_of_it, NULL);
				assert_non_null(scene[k]);
				plan[k] = plan_of(scene[k]);
				assert_complete(plan[k]);
				assert_int_equal(keeps(plan[k], effects[i].stage), !k);
			}
			/* Set to its neutral value it is as if it were never named. */
			assert_int_equal(stages(plan[1]), stages(plan[2]));
			assert_true(stages(plan[0]) > stages(plan[1]));
			compare(plan[1], plan[2], &seen);
			assert_true(seen.ticks_with_force > 100);
			for (int k = 0; k < 3; k++) {
				incise_plan_free(plan[k]);
				incise_scene_free(scene[k]);
			}
		}
	}
}

static int set_up(void **state)
{
	fed_folder_make(&folder);
	return 0;
}

static int tear_down(void **state)
{
	fed_folder_remove(&folder);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_plane),	cmocka_unit_test(test_capsule),
		cmocka_unit_test(test_mesh),	cmocka_unit_test(test_everything),
		cmocka_unit_test(test_picture), cmocka_unit_test(test_one_effect),
	};

	return cmocka_run_group_tests(tests, set_up, tear_down);
}
