// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The stages of forces on a plan made by hand: which phase each belongs to, and fixed point
 * beside double. The formulas are in tests/unit/tissue/effects.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/stages.h"
#include "felt.h"

typedef int stage_fn(struct incise_plan *plan, struct incise_tick *tick);

static const struct incise_scene scene = {.tissue = {.aligned = 0.2}};

/* 2 mm deep, 1 mm to both sides of where the contact began, at 10 mm/s along x. */
static struct incise_plan plan_in_tissue(void)
{
	return (struct incise_plan){
		.scene = &scene,
		.normal = {0, 0, 1},
		.depth_mm = 2,
		.gain = 1,
		.reaction_N_mm = 0.5,
		.plane_N_mm = 0.25,
		.damping_N_s_mm = 0.01,
		.insertion_N_mm = 0.75,
		.spread_N_mm = 0.125,
		.velocity_mm_s = {10, 0, 0},
		.attitude = {1},
		.instrument = {.side = {0, 1, 0}},
		.incision = {.side = {0, 1, 0}, .along = {1, 0, 0}, .there = true},
		.proxy = {.began = true},
	};
}

static struct incise_tick tick_in(enum incise_phase phase)
{
	return (struct incise_tick){
		.phase = phase,
		.tool = phase == INCISE_PHASE_INSERTION ? INCISE_TOOL_HANDLE
							: INCISE_TOOL_BLADE,
		.tool_mm = {1, 1, -2},
	};
}

static void test_each_stage_has_its_phases(void **state)
{
	static const struct {
		const char *name;
		stage_fn *run;
		double cutting_N[3], insertion_N[3];
	} cases[] = {
		{"reaction", incise_stage_reaction, {0, 0, 1}, {0}},
		{"reaction fixed", incise_stage_reaction_fixed, {0, 0, 1}, {0}},
		{"plane", incise_stage_plane, {0, -0.25, 0}, {0}},
		{"plane fixed", incise_stage_plane_fixed, {0, -0.25, 0}, {0}},
		{"damping", incise_stage_damping, {-0.1, 0, 0}, {-0.1, 0, 0}},
		/* The flat side along the cut: aligned. */
		{"insertion", incise_stage_insertion, {0}, {0, 0, 0.3}},
		{"spread", incise_stage_spread, {0}, {-0.125, -0.125, 0}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		for (int phase = 0; phase < 3; phase++) {
			const double none[3] = {0};
			const double *want =
				phase == INCISE_PHASE_CUTTING	  ? cases[i].cutting_N
				: phase == INCISE_PHASE_INSERTION ? cases[i].insertion_N
								  : none;
			struct incise_plan plan = plan_in_tissue();
			struct incise_tick tick = tick_in(phase);
			/* Added to what is there. */
			const double before[3] = {1, 2, 3};

			v3_copy(plan.force_N, before);
			assert_int_equal(cases[i].run(&plan, &tick), 0);
			for (int k = 0; k < 3; k++)
				/* Numbers that fixed point holds; sums of ulps of 3. */
				if (!(fabs(plan.force_N[k] - before[k] - want[k]) <
				      1e-15))
					fail_msg("%s in phase %d: part %d is %.17g",
						 cases[i].name, phase, k,
						 plan.force_N[k] - before[k]);
		}
}

static void test_insertion_by_turn_and_place(void **state)
{
	/* A quarter turn about z lays the flat across the cut. */
	static const struct {
		double attitude[4], at_mm[3];
		enum incise_tool tool;
		double want_N;
	} cases[] = {
		{{1, 0, 0, 0}, {0, 0, 0}, INCISE_TOOL_HANDLE, 0.3},
		{{M_SQRT1_2, 0, 0, M_SQRT1_2}, {0, 0, 0}, INCISE_TOOL_HANDLE, 1.5},
		{{M_SQRT1_2, 0, 0, M_SQRT1_2}, {0, 0, 0}, INCISE_TOOL_TUBE, 0.3},
		{{1, 0, 0, 0}, {0, 4.9, 0}, INCISE_TOOL_HANDLE, 0.3},
		{{1, 0, 0, 0}, {0, 5.1, 0}, INCISE_TOOL_HANDLE, 1.5},
		{{1, 0, 0, 0}, {0, 5.1, 0}, INCISE_TOOL_TUBE, 1.5},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_plan plan = plan_in_tissue();
		struct incise_tick tick = tick_in(INCISE_PHASE_INSERTION);

		tick.tool = cases[i].tool;
		memcpy(plan.attitude, cases[i].attitude, sizeof(plan.attitude));
		v3_copy(plan.proxy.first.point_mm, cases[i].at_mm);
		assert_int_equal(incise_stage_insertion(&plan, &tick), 0);
		if (!(fabs(plan.force_N[2] - cases[i].want_N) < 1e-15))
			fail_msg("case %zu: %.17g N", i, plan.force_N[2]);
		/* What the begin decided holds for the contact, wherever it goes. */
		plan.proxy.began = false;
		plan.proxy.first.point_mm[1] = 100;
		plan.force_N[2] = 0;
		incise_stage_insertion(&plan, &tick);
		assert_true(fabs(plan.force_N[2] - cases[i].want_N) < 1e-15);
	}
}

static double some(unsigned int *seed, double size)
{
	return size * (2.0 * rand_r(seed) / RAND_MAX - 1);
}

/* Springs in integers beside the same in double, within what is certified for them. */
static void test_fixed_is_within_its_bound(void **state)
{
	unsigned int seed = 3;
	int apart = 0;

	for (int i = 0; i < 100000; i++) {
		struct incise_plan plan = plan_in_tissue(), fixed;
		struct incise_tick tick = tick_in(INCISE_PHASE_CUTTING);
		double n[3] = {some(&seed, 1), some(&seed, 1), some(&seed, 1)};
		double off[3], bound_N;

		if (!v3_unit(plan.normal, n, 0.1))
			continue;
		v3_unit(plan.incision.side, n, 0.1);
		for (int k = 0; k < 3; k++) {
			/* Far away, too: only the difference has to fit. */
			plan.p0_mm[k] = some(&seed, 1e5);
			tick.tool_mm[k] = plan.p0_mm[k] + some(&seed, 10);
		}
		plan.depth_mm = fabs(some(&seed, 20));
		plan.reaction_N_mm = fabs(some(&seed, 2));
		plan.plane_N_mm = fabs(some(&seed, 2));
		fixed = plan;
		incise_stage_reaction(&plan, &tick);
		incise_stage_plane(&plan, &tick);
		incise_stage_reaction_fixed(&fixed, &tick);
		incise_stage_plane_fixed(&fixed, &tick);
		v3_sub(off, plan.force_N, fixed.force_N);
		/* 20 mm deep, and 10 mm along each axis. */
		bound_N = incise_fixed_spring_bound(plan.reaction_N_mm, 20) +
			  incise_fixed_spring_bound(plan.plane_N_mm, 10 * sqrt(3));
		/* Rounding of the double beside it: some ulp of 100 N. */
		assert_true(v3_length(off) <= bound_N + 1e-13);
		apart += v3_length(off) > 0;
	}
	/* They are two arithmetics, not one. */
	assert_true(apart > 90000);
}

static void test_tissue_does_not_pull_and_gain_counts(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 0.1);

	for (int sign = -1; sign <= 1; sign += 2) {
		for (int r = 0; r < 20; r++) {
			double p[] = {sign * 0.5, 0, 0};

			incise_model_set_consequent(model, r, p);
		}
		for (int deep = 0; deep < 2; deep++) {
			struct incise_plan plan = plan_in_tissue();
			struct incise_tick tick = tick_in(INCISE_PHASE_CUTTING);

			plan.model = model;
			plan.gain = 3;
			plan.depth_mm = deep;
			assert_int_equal(incise_stage_fuzzy(&plan, &tick), 0);
			/* Weights that add up to 1 within some ulp. */
			assert_true(fabs(plan.force_N[2] - (sign > 0 && deep ? 1.5 : 0)) <
				    1e-14);
		}
	}
	incise_model_free(model);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_each_stage_has_its_phases),
		cmocka_unit_test(test_insertion_by_turn_and_place),
		cmocka_unit_test(test_fixed_is_within_its_bound),
		cmocka_unit_test(test_tissue_does_not_pull_and_gain_counts),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
