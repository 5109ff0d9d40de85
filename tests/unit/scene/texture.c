// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A scene with a texture: its stage, its bits where it is neutral, the share of it that is felt, and a
 * refusal by its largest factor. lib/tissue has its physics, rest_3d.c and work.c its stability.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/scene/plan.h"
#include "../cases.h"
#include "../message.h"
#include "fed.h"

/* Teeth of 2 mm, a knot each 1/32 mm, of this size; all cuts have this factor. */
static struct incise_fixed_texture *teeth(double size, double factor)
{
	struct incise_fixed_texture *to = calloc(1, sizeof(*to));

	assert_non_null(to);
	to->step_shift = 11;
	to->most = (int32_t)lrint(size * INCISE_TEXTURE_ONE);
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++)
		to->knot[i] = (int16_t)((i % 64 - 31.5) / 31.5 * to->most);
	to->factor_most = (int32_t)lrint(factor * INCISE_FIXED_ONE);
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++)
		to->factor[i] = to->factor_most;
	return to;
}

/* A plan that is not checked to be stable; texture NULL: it has none. */
static struct incise_plan *textured(struct incise_scene **scene,
				    struct incise_fixed_texture *texture,
				    const char *arithmetic, double slew_N_s)
{
	struct incise_plan *plan;
	char text[300];

	snprintf(
		text, sizeof(text),
		"model = \"m.%s\"; arithmetic = \"%s\"; tissue = { unloading_N_mm = 2.0; "
		"};\nlimits = { slew_N_s = %.1f; };\n",
		strcmp(arithmetic, "fixed") ? "fis" : "fx", arithmetic, slew_N_s);
	*scene = fed_scene(&folder, text, &err);
	succeeds(*scene);
	(*scene)->unchecked = true;
	(*scene)->texture = texture;
	plan = incise_plan_new_fed(*scene, &tracker, &err);
	succeeds(plan);
	return plan;
}

/* From 1 mm above down to 4 mm in a second, along the skin by 20 mm in two, out again, and once more. */
static void cut(void *own, double t_s, struct incise_tracker_sample *pose)
{
	double s = fmod(fmax(t_s - 0.5, 0), 4.5);

	pose->position_mm[2] = s < 1 ? 1 - 5 * s : s < 3 ? -4 : fmin(-4 + 5 * (s - 3), 1);
	pose->position_mm[0] = 10 * fmax(0, fmin(s - 1, 2)) + (t_s > 5 ? 40 : 0);
}

#define TICKS 9500

/* Every tick's force, and their number with new tissue or not. */
static int run(struct incise_plan *plan, double force_N[TICKS][3])
{
	int in = 0;

	for (int i = 0; i < TICKS; i++) {
		struct incise_tick tick;

		assert_int_equal(fed_tick(plan, (i + 1) * 1000000LL, cut, NULL, &tick),
				 0);
		memcpy(force_N[i], tick.command_N, sizeof(force_N[i]));
		in += tick.phase == INCISE_PHASE_CUTTING;
	}
	return in;
}

static bool is_kept(const struct incise_plan *plan)
{
	for (int i = 0; incise_plan_stage(plan, i); i++)
		if (!strcmp(incise_plan_stage(plan, i), "texture"))
			return true;
	return false;
}

static const char *const arithmetics[] = {"double", "fixed"};

/* No texture runs no stage; one of 0 gives the same bits; one that is left out, too. */
TEST(test_none_is_neutral)
{
	static double force_N[4][TICKS][3];

	for (int k = 0; k < 2; k++) {
		for (int i = 0; i < 4; i++) {
			struct incise_fixed_texture *texture =
				i ? teeth(i == 1 ? 0 : 0.3, i == 1 ? 1 : 1.2) : NULL;
			struct incise_scene *scene;
			struct incise_plan *plan =
				textured(&scene, texture, arithmetics[k], 400);

			assert_int_equal(is_kept(plan), !!i);
			if (i == 3) {
				incise_plan_free(plan);
				incise_scene_leave_texture_out(scene);
				plan = incise_plan_new_fed(scene, &tracker, &err);
				succeeds(plan);
				assert_false(is_kept(plan));
			}
			assert_true(run(plan, force_N[i]) > TICKS / 2);
			assert_int_equal(isnan(incise_plan_texture_felt(plan)), i != 2);
			incise_plan_free(plan);
			incise_scene_free(scene);
		}
		assert_memory_equal(force_N[0], force_N[1], sizeof(force_N[0]));
		assert_memory_equal(force_N[0], force_N[3], sizeof(force_N[0]));
		assert_memory_not_equal(force_N[0], force_N[2], sizeof(force_N[0]));
	}
}

/* Any mean, any texture, and a share of that: it is found, whatever acts on the mean. */
TEST(test_a_share_is_found)
{
	uint64_t seed = cases_seed(51);

	for (int i = 0; i < cases_of(2000, 100); i++) {
		double c[3], share;
		struct incise_felt felt = {.sum = {{0}}};

		for (int k = 0; k < 3; k++)
			c[k] = incise_random_symmetric(&seed);
		for (int k = 0; k < 50; k++) {
			double mean_N = 1 + incise_random_symmetric(&seed);
			double texture_N = incise_random_symmetric(&seed);

			incise_felt_add(&felt, mean_N, texture_N,
					c[0] + c[1] * mean_N + c[2] * texture_N);
		}
		share = incise_felt_share(&felt);
		/* Rounding of 50 sums of numbers below 4. */
		if (!(fabs(share - c[2]) < 1e-12))
			fail_msg("%g is found as %g", c[2], share);
	}
	assert_true(isnan(incise_felt_share(&(struct incise_felt){.sum = {{0}}})));
}

/* Without a limit all of it is felt; the slower the force, the less. */
TEST(test_share_that_is_felt)
{
	static const double slews_N_s[] = {1e5, 10, 3, 1};
	static double force_N[TICKS][3];

	for (int k = 0; k < 2; k++) {
		double last = 1.001;

		for (int i = 0; i < 4; i++) {
			struct incise_scene *scene;
			struct incise_plan *plan = textured(&scene, teeth(0.3, 1.2),
							    arithmetics[k], slews_N_s[i]);
			struct incise_plan_texture texture;
			double felt;

			run(plan, force_N);
			assert_true(incise_plan_texture(plan, &texture));
			felt = incise_plan_texture_felt(plan);
			/* In the first micrometres the front's force is yet below the model's. */
			if (!i && !(fabs(felt - 1) < 1e-3))
				fail_msg("%s: %.9g is felt", arithmetics[k], felt);
			if (!(felt < last))
				fail_msg("%s: %g N/s: %g is felt, %g faster",
					 arithmetics[k], slews_N_s[i], felt, last);
			last = felt;
			assert_true(texture.factor_least == texture.factor_most);
			assert_true(fabs(texture.factor_most - 1.2) < 1e-5);
			assert_true(fabs(texture.most - 0.3) < 1e-4);
			/* Of a saw-tooth: its size / sqrt 3. */
			assert_true(fabs(texture.rms - 0.3 / sqrt(3)) < 0.01);
			incise_plan_free(plan);
			incise_scene_free(scene);
		}
		assert_true(last < 0.5);
	}
}

/* A share that was felt before a reload goes on with a texture, and is not one of a plan without. */
TEST(test_share_of_the_plan_that_takes_over)
{
	static double force_N[TICKS][3];
	struct incise_scene *scene[3];
	struct incise_plan *plan[3];

	for (int i = 0; i < 3; i++)
		plan[i] = textured(&scene[i], i < 2 ? teeth(0.3, 1) : NULL, "fixed", 400);
	run(plan[0], force_N);
	assert_false(isnan(incise_plan_texture_felt(plan[0])));
	for (int i = 1; i < 3; i++) {
		incise_plan_take_over(plan[i], plan[0]);
		assert_int_equal(isnan(incise_plan_texture_felt(plan[i])), i == 2);
	}
	for (int i = 0; i < 3; i++) {
		incise_plan_free(plan[i]);
		incise_scene_free(scene[i]);
	}
}

/* The largest factor counts like a gain, and the refusal says what holds. */
TEST(test_a_scene_is_refused_by_its_largest_factor)
{
	static const char words[] = "set tissue.gain to at most ";
	struct incise_scene *scene = incise_scene_load("scenes/liver.scene", NULL, &err);
	struct incise_plan *plan;

	succeeds(scene);
	incise_scene_leave_texture_out(scene);
	scene->texture = teeth(0.4, 2.5);
	assert_error(incise_plan_new_fed(scene, &tracker, &err), EDOM, &err,
		     "liver.scene", "not stable", words, "leave out its texture");
	scene->tissue.gain = atof(strstr(err.text, words) + strlen(words));
	assert_true(scene->tissue.gain > 0.2 && scene->tissue.gain < 1);
	plan = incise_plan_new_fed(scene, &tracker, &err);
	succeeds(plan);
	incise_plan_free(plan);
	incise_scene_free(scene);
}

GROUP(fed_set_up, fed_tear_down);
