// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/scene/choose.c: which stages a scene leaves out, in no more memory, with a reason for each; lean.c
 * has that the ticks are those of the whole pipeline.
 *
 * The time that leaving out saves cannot be tested: the test counts the stages that run.
 * `incise plan` shows their ns.
 */
#include "../unit.h"
#include "../../../lib/scene/forces.h"
#include "fed.h"

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
	static const char *const before[] = {"pose",   "predict",  "tool",     "contact",
					     "normal", "incision", "membrane", "texture"};
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
	/* Stages are chosen before the search whether the scene is stable, which takes longer. */
	scene->unchecked = true;
	return scene;
}

static struct incise_plan *plan_of(const struct incise_scene *scene)
{
	struct incise_plan *plan = incise_plan_new(scene, NULL, &err);

	succeeds(plan);
	return plan;
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
	{"texture", "no texture", {.no_membrane = true}, NULL},
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

static void leaves_out_what_lacks(const struct lack *lack, const struct surface *surface,
				  const char *arithmetic)
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
	incise_plan_free(full);
	incise_plan_free(lean);
	incise_scene_free(scene);
}

/* Each lack has one of the surfaces and evaluators. */
TEST(test_each_lack_leaves_out_its_stage)
{
	for (int i = 0; i < LACKS; i++) {
		const struct lack lack = lack_of(i);

		leaves_out_what_lacks(&lack, &surfaces[i % 3], evaluators[i % 6 / 3]);
	}
}

/* A scene that lacks nothing keeps all, but for what no loop runs and what no rig has. */
TEST(test_everything)
{
	struct incise_scene *scene = scene_of(&(struct lacking){0}, CAPSULE, "fixed");
	struct incise_plan *plan = plan_of(scene);

	assert_complete(plan);
	/* All but the texture. */
	assert_int_equal(stages(plan), stages_of_a_loop() - 1);
	assert_false(keeps(plan, "texture"));
	assert_non_null(strstr(why_not(plan, "wound"), "picture.wound is false"));
	assert_non_null(strstr(why_not(plan, "bleeding"), "picture.bleeding is false"));
	incise_plan_free(plan);
	incise_scene_free(scene);
	/* On a plane there is nothing to average. */
	scene = scene_of(&(struct lacking){0}, PLANE, "fixed");
	plan = plan_of(scene);
	assert_int_equal(stages(plan), stages_of_a_loop() - 2);
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

static int set_up(void **state)
{
	fed_folder_make(&folder);
	list_stages();
	return 0;
}

GROUP(set_up, fed_tear_down);
