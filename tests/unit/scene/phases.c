// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A scene with models of its own for puncture, cut and withdrawal: which of them the force is of, that
 * it does not leap between them, and scenes that cannot be.
 */
#include "../unit.h"
#include "../../../lib/scene/plan.h"
#include "../message.h"
#include "fed.h"

static char path[3][64];

/* a + b × depth, in N and mm, from 0 to 10 mm. */
static void write_line(const char *to, double a, double b)
{
	static const struct incise_variable in = {"depth_mm", 0, 10},
					    out = {"force_N", -1, 4};
	static const int mfs[] = {1};
	struct incise_model *model =
		incise_model_new_grid(1, &in, mfs, INCISE_MF_GAUSS, &out, NULL);

	incise_model_set_consequent(model, 0, (double[]){a, b});
	assert_int_equal(incise_model_save(model, to, NULL), 0);
	incise_model_free(model);
}

#define CUT_N_MM 0.1
#define SKIN_N_MM 0.2
#define DRAG_N 0.1

/* Stiff enough that a blade which comes out is let go of before it is out. */
#define UNLOADS " tissue = { unloading_N_mm = 0.3; };"

static int set_up(void **state)
{
	static const char *const names[] = {"cut", "skin", "out"};

	fed_folder_make(&folder);
	for (int i = 0; i < 3; i++)
		snprintf(path[i], sizeof(path[i]), "%s/%s.fis", folder.dir, names[i]);
	write_line(path[0], 0, CUT_N_MM);
	write_line(path[1], 0, SKIN_N_MM);
	write_line(path[2], -DRAG_N, 0);
	return 0;
}

static int tear_down(void **state)
{
	for (int i = 0; i < 3; i++)
		unlink(path[i]);
	fed_folder_remove(&folder);
	return 0;
}

#define DOUBLE "arithmetic = \"double\"; "

/* From 1 mm above straight down to 3 mm in two seconds, and up again. */
static void stab(void *own, double t_s, struct incise_tracker_sample *pose)
{
	double s = fmax(t_s - 0.5, 0);

	pose->position_mm[2] = s < 2 ? 1 - 2 * s : fmin(-3 + 2 * (s - 2), 1);
}

/* Largest change of the force in a tick, and its least value. */
struct seen {
	double leap_N, least_N;
	int skin, between, cut;
};

static void run(const char *text, bool paper, struct seen *seen)
{
	struct incise_scene *scene;
	struct incise_plan *plan = fed_plan(&folder, &tracker, &scene, text);
	double deepest_mm = 0, last_N = 0;

	*seen = (struct seen){0};
	for (int64_t t_ns = 1000000; t_ns < 4500000000; t_ns += 1000000) {
		struct incise_tick tick;
		double share, want_N, force_N;

		assert_int_equal(fed_tick(plan, t_ns, stab, NULL, &tick), 0);
		force_N = tick.command_N[2];
		deepest_mm = fmax(deepest_mm, tick.depth_mm);
		seen->leap_N = fmax(seen->leap_N, fabs(force_N - last_N));
		seen->least_N = fmin(seen->least_N, force_N);
		last_N = force_N;
		if (!paper || !(tick.flags & INCISE_TICK_CONTACT))
			continue;
		/* 0.5 mm of tissue.cut_from_mm, and as much to go over. */
		share = fmax(0, fmin((deepest_mm - 0.5) / INCISE_PUNCTURE_MM, 1));
		want_N = (share * CUT_N_MM + (1 - share) * SKIN_N_MM) * tick.depth_mm;
		assert_true(fabs(force_N - want_N) < 1e-9);
		seen->skin += share == 0;
		seen->between += share > 0 && share < 1;
		seen->cut += share == 1;
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

TEST(skin_gives_way_to_the_cut)
{
	struct seen seen;

	run(DOUBLE "model = { cut = \"cut.fis\"; puncture = \"skin.fis\"; }; tissue = { "
		   "withdrawal = \"paper\"; };",
	    true, &seen);
	assert_true(seen.skin > 100 && seen.between > 100 && seen.cut > 1000);
	/* 2 mm/s of up to 0.2 N/mm, and of 0.1 N/mm that are let go of over 0.5 mm. */
	assert_true(seen.leap_N < 2e-3 * (SKIN_N_MM + 2 * CUT_N_MM) + 2e-4);
}

/* Drag is what the model says, where that is no more than what the blade would need to cut. */
TEST(withdrawal_drags)
{
	struct seen seen, plain, both;

	run(DOUBLE "model = { cut = \"cut.fis\"; withdraw = \"out.fis\"; };" UNLOADS,
	    false, &seen);
	run(DOUBLE "model = \"cut.fis\";" UNLOADS, false, &plain);
	run(DOUBLE "model = { cut = \"cut.fis\"; puncture = \"skin.fis\"; withdraw = "
		   "\"out.fis\"; };" UNLOADS,
	    false, &both);
	assert_true(seen.least_N < -0.9 * DRAG_N && seen.least_N > -1.01 * DRAG_N);
	assert_true(both.least_N < -0.9 * DRAG_N && both.least_N > -1.01 * DRAG_N);
	/* tissue.friction is 0.1. */
	assert_true(plain.least_N < 0 && plain.least_N > -0.04);
	assert_true(seen.leap_N < 5e-3 && both.leap_N < 5e-3);
}

static struct incise_plan *checked_plan(struct incise_scene **scene, const char *text)
{
	struct incise_plan *plan;

	*scene = fed_scene(&folder, text, &err);
	succeeds(*scene);
	plan = incise_plan_new_fed(*scene, &tracker, &err);
	succeeds(plan);
	return plan;
}

TEST(stability_counts_each_model)
{
	struct incise_plan_stability s;
	struct incise_plan_model model;
	struct incise_scene *scene;
	struct incise_plan *plan =
		checked_plan(&scene, DOUBLE
			     "model = { cut = \"cut.fis\"; puncture = \"skin.fis\"; };");

	incise_plan_stability(plan, &s);
	assert_true(s.slope_N_mm > 0.99 * SKIN_N_MM && s.slope_N_mm < 1.02 * SKIN_N_MM);
	incise_plan_model(plan, INCISE_PUNCTURE, &model);
	assert_int_equal(model.n_inputs, 1);
	assert_string_equal(model.input[0], "depth_mm");
	assert_true(fabs(incise_plan_model_force(plan, INCISE_PUNCTURE, (double[]){2}) -
			 2 * SKIN_N_MM) < 1e-12);
	incise_plan_model(plan, INCISE_WITHDRAW, &model);
	assert_int_equal(model.n_inputs, 0);
	incise_plan_free(plan);
	incise_scene_free(scene);
	/* The other way round the force rises by 0.1 mm × 0.1 N/mm … over 0.5 mm, besides its slope. */
	plan = checked_plan(
		&scene, DOUBLE
		"model = { cut = \"skin.fis\"; puncture = \"cut.fis\"; }; tissue = "
		"{ gain = 0.5; };");
	incise_plan_stability(plan, &s);
	assert_true(fabs(s.slope_N_mm -
			 0.5 * (SKIN_N_MM + (SKIN_N_MM - CUT_N_MM) / 0.5)) < 0.01);
	incise_plan_free(plan);
	incise_scene_free(scene);
}

TEST(refusals)
{
	static const struct {
		const char *text;
		int code;
		const char *says;
	} cases[] = {
		{"model = { cut = \"cut.fis\"; puncture = \"skin.fis\"; };", ENOTSUP,
		 "model.puncture"},
		{DOUBLE "model = { puncture = \"skin.fis\"; };", EINVAL, "cut"},
		{DOUBLE "model = { cut = \"cut.fis\"; withdrawal = \"out.fis\"; };",
		 EINVAL, "withdrawal"},
		{DOUBLE
		 "model = { cut = \"cut.fis\"; withdraw = \"out.fis\"; }; tissue = "
		 "{ withdrawal = \"paper\"; };",
		 EINVAL, "model.withdraw:"},
		{DOUBLE "model = { cut = \"cut.fis\"; puncture = \"none.fis\"; };",
		 ENOENT, "none.fis"},
		{DOUBLE "model = { cut = \"cut.fis\"; puncture = 3; };", EINVAL,
		 "puncture"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct incise_scene *scene = fed_scene(&folder, cases[i].text, &err);

		if (scene)
			assert_null(incise_plan_new_fed(scene, &tracker, &err));
		assert_int_equal(err.code, cases[i].code);
		assert_says(err.text, cases[i].says);
		incise_scene_free(scene);
	}
}

GROUP(set_up, tear_down);
