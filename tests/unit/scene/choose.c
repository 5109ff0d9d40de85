// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/scene/choose.c: each optional stage left out, compared with the same scene with all
 * stages there and the unneeded ones neutral. The ticks are bit-identical, from fewer stages
 * in no more memory, with a reason for each.
 *
 * The time that leaving out saves cannot be tested: the test counts the stages that run.
 * `incise plan` shows their ns.
 */
#include "../unit.h"
#include "../../../lib/scene/forces.h"
#include "fed.h"
#include "../cases.h"

#define TICKS 2500

static struct fed_folder folder;

static const char *const evaluators[] = {"fixed", "double"};

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

/* All stages that there are, in order; the forces come before the start. */
static const char *all[INCISE_PLAN_STAGES_MAX + 2];
static size_t n_all;

static void list_stages(void)
{
	static const char *const before[] = {"pose",   "predict",  "tool",    "contact",
					     "normal", "incision", "membrane"};
	static const char *const after[] = {"start",   "work",	"limit",
					    "actuate", "wound", "bleeding"};

	for (size_t i = 0; i < sizeof(before) / sizeof(*before); i++)
		all[n_all++] = before[i];
	for (int i = 0; i < incise_n_tissue_forces; i++)
		all[n_all++] = incise_tissue_forces[i].name;
	for (size_t i = 0; i < sizeof(after) / sizeof(*after); i++)
		all[n_all++] = after[i];
}

/* Everything that has a stage, but for these. */
struct lacking {
	const char *force; /* the name of one, or "insertion forces", or "all forces" */
	bool model;	   /* in the place of the reaction */
	bool no_gain, no_average, no_membrane;
};

static bool has(const struct lacking *w, const struct incise_tissue_force *force)
{
	if (w->model && !strcmp(force->name, "reaction"))
		return false;
	if (!w->force)
		return true;
	if (!strcmp(w->force, "insertion forces"))
		return force->phases != 1U << INCISE_PHASE_INSERTION;
	return strcmp(w->force, "all forces") && strcmp(w->force, force->name);
}

/* A device that holds all this; limits that the stroke runs into. */
static struct incise_scene *scene_of(const struct lacking *w,
				     const struct surface *surface,
				     const char *arithmetic)
{
	char text[1600], tissue[800] = "";
	struct incise_scene *scene;

	for (int i = 0; i < incise_n_tissue_forces; i++) {
		const struct incise_force_number *number = incise_tissue_forces[i].number;
		size_t n = strlen(tissue);

		int acts = incise_tissue_forces[i].acts;

		if (acts) {
			snprintf(tissue + n, sizeof(tissue) - n, "  %s = %#.17g;\n",
				 number[acts].key, number[acts].skin);
			n = strlen(tissue);
		}
		/* Twice as stiff as skin, so that limits are met; 0 is what is tested. */
		snprintf(tissue + n, sizeof(tissue) - n, "  %s = %#.17g;\n", number->key,
			 has(w, &incise_tissue_forces[i]) ? 2 * number->skin : 0.0);
	}
	snprintf(text, sizeof(text),
		 "%s arithmetic = \"%s\"; surface = %s;\n"
		 "tissue = { gain = %.1f;\n%s };\n"
		 "effects = { average_ticks = %d; };\n"
		 "device = { delay_ticks = 0; };\n"
		 "limits = { force_N = 1.2; slew_N_s = 200.0; ramp_ms = 50.0; };\n%s",
		 !w->model		       ? ""
		 : strcmp(arithmetic, "fixed") ? "model = \"m.fis\";"
					       : "model = \"m.fx\";",
		 arithmetic, surface->text, w->no_gain ? 0.0 : 1.0, tissue,
		 w->no_average ? 1 : 8,
		 w->no_membrane ? ""
				: "membrane = { point_mm = [0.0, 0.0, -2.5]; "
				  "normal = [0.0, 0.1, 1.0]; radius_mm = 6.0; "
				  "thickness_mm = 1.0; puncture_N = 0.3; "
				  "back_wall_mm = 1.2; };\n");
	scene = fed_scene(&folder, text, &err);
	succeeds(scene);
	return scene;
}

static struct incise_plan *plan_of(const struct incise_scene *scene)
{
	struct incise_plan *plan = incise_plan_new(scene, NULL, &err);

	succeeds(plan);
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

/* Conditions that the stroke met. */
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

	for (size_t i = 0; i < n_all; i++) {
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

/* A scene that lacks something, and the reason that the plan gives. */
struct lack {
	const char *stage, *why;
	struct lacking lacking;
	const char *also; /* another stage that goes with it */
};

/* One for each force comes before these. */
static const struct lack lacks[] = {
	{"tool", "no insertion", {.force = "insertion forces"}, NULL},
	{"normal", "average_ticks is 1", {.no_average = true}, NULL},
	{"membrane", "no membrane", {.no_membrane = true}, NULL},
	{"plane", "plane_N_mm is 0", {.force = "plane", .model = true}, NULL},
	/* One that lacks nearly all: paper 1's. */
	{"normal",
	 "average_ticks is 1",
	 {.force = "all forces", .model = true, .no_average = true},
	 NULL},
	/* Nothing is felt, whatever the constants are. */
	{"reaction", "gain is 0", {.model = true, .no_gain = true}, "plane"},
	{"spread", "gain is 0", {.no_gain = true}, "tool"},
};
#define LACKS (incise_n_tissue_forces + (int)(sizeof(lacks) / sizeof(*lacks)))

static struct lack lack_of(int i)
{
	const struct incise_tissue_force *force = &incise_tissue_forces[i];

	if (i >= incise_n_tissue_forces)
		return lacks[i - incise_n_tissue_forces];
	return (struct lack){.stage = force->name,
			     .why = force->acts ? force->number[0].zero : force->zero,
			     .lacking = {.force = force->name}};
}

/* All stages but actuate, of no rig, and those of pictures. */
static int stages_of_a_loop(void)
{
	return (int)n_all - 3;
}

/* The plan leaves out the stages that the scene lacks; its ticks are those of the whole pipeline. */
static void lean_is_full_to_the_bit(const struct lack *lack,
				    const struct surface *surface, const char *arithmetic,
				    struct seen *seen)
{
	struct incise_scene *scene = scene_of(&lack->lacking, surface, arithmetic);
	struct incise_plan *lean = plan_of(scene), *full;

	incise_scene_set_full(scene, true);
	full = plan_of(scene);
	assert_complete(lean);
	assert_complete(full);
	/* The rest, and the actuator of no rig, cannot be kept. */
	assert_int_equal(stages(full), stages_of_a_loop());
	assert_true(stages(lean) < stages(full));
	/* Memory that only an omitted stage uses is not allocated. */
	assert_true(incise_plan_memory(lean) <= incise_plan_memory(full));
	if (!strcmp(lack->stage, "tool") || !strcmp(lack->stage, "normal"))
		assert_true(incise_plan_memory(lean) < incise_plan_memory(full));
	assert_false(keeps(lean, lack->stage));
	if (!why_not(lean, lack->stage) || !strstr(why_not(lean, lack->stage), lack->why))
		fail_msg("%s left out: %s", lack->stage, why_not(lean, lack->stage));
	if (lack->also)
		assert_non_null(strstr(why_not(lean, lack->also), lack->why));
	assert_non_null(strstr(why_not(full, "actuate"), "no stepper"));
	compare(lean, full, seen);
	incise_plan_free(full);
	incise_plan_free(lean);
	incise_scene_free(scene);
}

/* Of the surfaces and evaluators each lack has one, and with CASES=all each. */
TEST(test_lean_is_full_to_the_bit)
{
	const unsigned int met = INCISE_TICK_CONTACT | INCISE_TICK_STALE |
				 INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED |
				 INCISE_TICK_STARTING | INCISE_TICK_EXTRAPOLATED |
				 INCISE_TICK_IN_CUT | INCISE_TICK_MEMBRANE |
				 INCISE_TICK_LUMEN | INCISE_TICK_BACK_WALL;
	struct seen seen = {0};
	int compared = 0;

	for (int i = 0; i < LACKS; i++)
		for (int way = 0; way < 6; way++) {
			const struct lack lack = lack_of(i);

			if (!cases_are_all() && way != i % 6)
				continue;
			lean_is_full_to_the_bit(&lack, &surfaces[way % 3],
						evaluators[way / 3], &seen);
			compared += TICKS;
		}
	/* It was a varied stroke. */
	assert_int_equal(seen.flags & met, met);
	assert_int_equal(seen.phases, 7);
	assert_int_equal(seen.tools, 1 << INCISE_TOOL_BLADE | 1 << INCISE_TOOL_HANDLE |
					     1 << INCISE_TOOL_TUBE);
	assert_true(seen.ticks_with_force > compared / 4);
}

/* A scene that lacks nothing keeps all, but for what no loop runs and what no rig has. */
TEST(test_everything)
{
	struct incise_scene *scene = scene_of(&(struct lacking){0}, CAPSULE, "fixed");
	struct incise_plan *plan = plan_of(scene);

	assert_complete(plan);
	assert_int_equal(stages(plan), stages_of_a_loop());
	assert_non_null(strstr(why_not(plan, "wound"), "picture.wound is false"));
	assert_non_null(strstr(why_not(plan, "bleeding"), "picture.bleeding is false"));
	incise_plan_free(plan);
	incise_scene_free(scene);
	/* On a plane there is nothing to average. */
	scene = scene_of(&(struct lacking){0}, PLANE, "fixed");
	plan = plan_of(scene);
	assert_int_equal(stages(plan), stages_of_a_loop() - 1);
	assert_non_null(strstr(why_not(plan, "normal"), "is constant"));
	incise_plan_free(plan);
	incise_scene_free(scene);
}

/* Pictures are nobody's force: asked for or not, the loop has no stage for them. */
TEST(test_picture)
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

/*
 * One stage at a time, on a scene that has the reaction or the plane constraint only: scene
 * 0 has it, 1 sets it to its neutral value, 2 never names it.
 */
static void one_effect(const char *stage, const char *const text[3], int way)
{
	struct incise_scene *scene[3];
	struct incise_plan *plan[3];
	struct seen seen = {0};

	for (int k = 0; k < 3; k++) {
		char all_of_it[800];

		snprintf(all_of_it, sizeof(all_of_it),
			 "arithmetic = \"%s\"; surface = %s;\n%s\n"
			 "device = { delay_ticks = 0; };\n",
			 evaluators[way & 1], surfaces[1 + way / 2].text, text[k]);
		scene[k] = fed_scene(&folder, all_of_it, NULL);
		assert_non_null(scene[k]);
		plan[k] = plan_of(scene[k]);
		assert_complete(plan[k]);
		assert_int_equal(keeps(plan[k], stage), !k);
	}
	assert_int_equal(stages(plan[1]), stages(plan[2]));
	assert_true(stages(plan[0]) > stages(plan[1]));
	compare(plan[1], plan[2], &seen);
	assert_true(seen.ticks_with_force > 100);
	for (int k = 0; k < 3; k++) {
		incise_plan_free(plan[k]);
		incise_scene_free(scene[k]);
	}
}

TEST(test_one_force)
{
	for (int i = 0; i < incise_n_tissue_forces; i++) {
		const struct incise_force_number *number =
			incise_tissue_forces[i].number + incise_tissue_forces[i].acts;
		const char *other = i ? "reaction_N_mm = 0.3;" : "plane_N_mm = 0.4;";
		char text[3][120];
		const char *const texts[] = {text[0], text[1], text[2]};

		snprintf(text[0], sizeof(text[0]), "tissue = { %s %s = %#.9g; };", other,
			 number->key, number->skin);
		snprintf(text[1], sizeof(text[1]), "tissue = { %s %s = 0.0; };", other,
			 number->key);
		snprintf(text[2], sizeof(text[2]), "tissue = { %s };", other);
		for (int way = 0; way < 4; way++)
			if (cases_are_all() || way == i % 4)
				one_effect(incise_tissue_forces[i].name, texts, way);
	}
}

TEST(test_one_effect)
{
	static const char tissue[] = "tissue = { reaction_N_mm = 0.3; };";
	static const char *const average[] = {
		"tissue = { reaction_N_mm = 0.3; }; effects = { average_ticks = 16; };",
		"tissue = { reaction_N_mm = 0.3; }; effects = { average_ticks = 1; };",
		tissue};

	for (int way = 0; way < (cases_are_all() ? 4 : 1); way++)
		one_effect("normal", average, way);
}

static int set_up(void **state)
{
	fed_folder_make(&folder);
	list_stages();
	return 0;
}

static int tear_down(void **state)
{
	fed_folder_remove(&folder);
	return 0;
}

GROUP(set_up, tear_down);
