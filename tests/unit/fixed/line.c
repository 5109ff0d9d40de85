// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Lines and cuts in the surface, in integers, compared with lib/tissue: a blade that goes to and fro
 * over a skin, turns and leaves it, and the handle and tube that open its cuts.
 */
#include "../unit.h"
#include <incise/scene.h>
#include "../../../lib/fixed/incision.h"
#include "../../../lib/fixed/line.h"
#include "trial_plan.h"
#include "../../../lib/tissue/front.h"
#include "../../../lib/tissue/incision.h"

#define ONE 65536.0
#define UNIT 1073741824.0
#define RUNS 200
#define TICKS 400

static struct incise_fx_trial trial;

static double any(double least, double most)
{
	return least + (most - least) *
			       (double)(incise_fx_trial_next(&trial.seed) >> 11) *
			       0x1p-53;
}

/* A blade on the plane z = 0: its place, and its side by the angle of its way. */
struct blade {
	double x, y, angle, depth;
	int32_t at[3], side[3];
	double at_mm[3], side_d[3];
};

static const int32_t normal[3] = {0, 0, INCISE_FIXED_UNIT};
static const double normal_d[3] = {0, 0, 1};

static void step(struct blade *b, double far)
{
	double speed = any(0, far);

	b->angle += any(-0.05, 0.05);
	if (incise_fx_trial_one_in(&trial, 60))
		b->angle += any(-2, 2);
	b->x += speed * cos(b->angle);
	b->y += speed * sin(b->angle);
	b->depth = fmin(fmax(b->depth + any(-0.3, 0.3), -1), 12);
	b->at[0] = (int32_t)lrint(b->x * ONE);
	b->at[1] = (int32_t)lrint(b->y * ONE);
	b->at[2] = 0;
	b->side[0] = (int32_t)lrint(-sin(b->angle) * UNIT);
	b->side[1] = (int32_t)lrint(cos(b->angle) * UNIT);
	b->side[2] = 0;
	for (int i = 0; i < 3; i++) {
		b->at_mm[i] = b->at[i] / ONE;
		b->side_d[i] = b->side[i] / UNIT;
	}
}

/* New tissue, tick for tick: the along of a line is off by some 2^-30, a product by 2^-17. */
TEST(test_new_tissue)
{
	int apart = 0;

	trial.seed = 1;
	for (int run = 0; run < RUNS; run++) {
		struct incise_fixed_line got = {0};
		struct incise_double_front want = {0};
		struct blade blade = {.depth = 5};

		step(&blade, 1);
		incise_fixed_line_begin(&got, blade.at, normal, blade.side);
		incise_double_front_enter(&want, blade.at_mm, normal_d, blade.side_d);
		for (int t = 0; t < TICKS; t++) {
			double fresh;
			int32_t advance;

			step(&blade, 0.4);
			fresh = incise_double_front_advance(&want, blade.at_mm, normal_d,
						     blade.side_d);
			advance = incise_fixed_line_advance(&got, blade.at, normal,
							    blade.side);
			/* Where the edge of a line lies within rounding both begin anew. */
			if (!(fabs(advance / ONE - fresh) <= 2 / ONE)) {
				apart++;
				break;
			}
		}
	}
	assert_int_equal(apart, 0);
}

TEST(test_along)
{
	trial.seed = 2;
	for (int k = 0; k < 100000; k++) {
		int32_t n[3], side[3], along[3];

		incise_fx_trial_unit(&trial, n, 3);
		incise_fx_trial_unit(&trial, side, 3);
		if (k % 10 == 0)
			incise_fx_copy(side, n);
		incise_fixed_line_along(along, n, side);
		assert_true(incise_fx_is_unit(along, 3));
		/* Across the normal: both are rounded, and a cross product of 1/1000 is scaled up. */
		assert_true(abs(incise_fx_dot(along, n)) <= 4000);
	}
}

static void set_up(struct incise_fixed_incision_setup *fixed,
		   struct incise_incision_setup *setup)
{
	*fixed = (struct incise_fixed_incision_setup){
		.cuts_most = 1 + incise_fx_trial_in(&trial, 0, INCISE_FIXED_CUTS_MAX - 1),
		.cut_from = incise_fx_trial_in(&trial, 0, 2 << 16),
		.stretch = incise_fx_trial_in(&trial, 0, 3 << 16),
		.handle_width = incise_fx_trial_in(&trial, 6 << 16, 14 << 16),
		.handle_thickness = incise_fx_trial_in(&trial, 1 << 16, 5 << 16),
		.tube = incise_fx_trial_in(&trial, 4 << 16, 9 << 16),
	};
	*setup = (struct incise_incision_setup){
		.cuts_most = fixed->cuts_most,
		.cut_from_mm = fixed->cut_from / ONE,
		.stretch_mm = fixed->stretch / ONE,
		.handle_width_mm = fixed->handle_width / ONE,
		.handle_thickness_mm = fixed->handle_thickness / ONE,
		.tube_mm = fixed->tube / ONE,
		.side = {0, 1, 0},
	};
	assert_true(incise_fixed_incision_good(fixed));
}

/* The place of a blade as a tick shows it: turned about the normal. */
static struct incise_tick tick_of(const struct blade *b, enum incise_phase phase,
				  enum incise_tool tool)
{
	return (struct incise_tick){
		.phase = phase,
		.tool = tool,
		.depth_mm = fmax(b->depth, 0),
		.proxy_mm = {b->at_mm[0], b->at_mm[1], 0},
		.normal = {0, 0, 1},
		.quaternion = {cos(b->angle / 2), 0, 0, sin(b->angle / 2)},
	};
}

/* Of cuts that go along a way as short as 0.05 mm, 32 mm away; and of depths between two ticks. */
#define ENDS_MM (32 / ONE / 0.05)
#define DEPTH_MM 1e-3

static bool is_same(const struct incise_fixed_cut *got, const struct incise_cut *want)
{
	if (got->incision != want->incision ||
	    fabs(got->from / ONE - want->from_mm) > ENDS_MM ||
	    fabs(got->to / ONE - want->to_mm) > ENDS_MM)
		return false;
	for (int k = 0; k < INCISE_CUT_PLACES; k++)
		if (fabs(got->place[k].depth / ONE - (double)want->place[k].depth_mm) >
			    DEPTH_MM ||
		    fabs(got->place[k].open / ONE - (double)want->place[k].open_mm) >
			    DEPTH_MM)
			return false;
	return true;
}

/* Number of cuts that are not the same. */
static int compare_cuts(const struct incise_fixed_incision *got,
			const struct incise_incision *want)
{
	int apart = 0;

	assert_int_equal(got->n, incise_incision_cuts(want));
	for (int i = 0; i < got->n; i++)
		apart += !is_same(&got->cut[i], incise_incision_cut(want, i));
	return apart;
}

static struct incise_fixed_incision cuts;

/* The same cuts, joined in the same way; the same openings, as tight. */
TEST(test_cuts)
{
	int most = 0, met = 0, full = 0, apart = 0, all = 0;

	trial.seed = 3;
	for (int run = 0; run < RUNS; run++) {
		struct incise_fixed_incision_setup fixed;
		struct incise_incision_setup setup;
		struct incise_incision *want;
		struct blade blade = {.depth = 3};

		set_up(&fixed, &setup);
		want = incise_incision_make(&setup, NULL);
		assert_non_null(want);
		cuts = (struct incise_fixed_incision){0};
		for (int t = 0; t < TICKS; t++) {
			enum incise_tool tool = t / 100 % 3 == 2
							? (run & 1 ? INCISE_TOOL_TUBE
								   : INCISE_TOOL_HANDLE)
							: INCISE_TOOL_BLADE;
			enum incise_phase phase = tool == INCISE_TOOL_BLADE
							  ? INCISE_PHASE_CUTTING
							  : INCISE_PHASE_INSERTION;
			struct incise_tick tick;
			const struct incise_opening *opening;
			int32_t depth;
			bool left = true, leaves;

			step(&blade, 0.4);
			if (blade.depth < 0)
				phase = INCISE_PHASE_FREE;
			depth = (int32_t)lrint(fmax(blade.depth, 0) * ONE);
			blade.depth = depth ? depth / ONE : blade.depth;
			tick = tick_of(&blade, phase, tool);
			leaves = incise_incision_tick(want, &tick);
			if (phase == INCISE_PHASE_FREE)
				incise_fixed_incision_leave(&cuts);
			else if (phase == INCISE_PHASE_CUTTING)
				left = incise_fixed_incision_cut(&cuts, &fixed, blade.at,
								 normal, blade.side,
								 depth);
			else
				incise_fixed_incision_open(&cuts, &fixed, tool, blade.at,
							   blade.side, depth);
			assert_int_equal(left, leaves);
			full += !left;
			opening = incise_incision_met(want);
			assert_int_equal(cuts.met.in, opening->in);
			if (!opening->in)
				continue;
			met++;
			assert_int_equal(cuts.met.cut, opening->cut);
			assert_true(fabs(cuts.met.depth / ONE - opening->depth_mm) <=
				    1e-3);
			assert_true(fabs(incise_fixed_incision_tightness(
						 &fixed, &cuts.met, tool) /
						 ONE -
					 incise_incision_tightness(want, opening,
								   tool)) <= 1e-3);
		}
		apart += compare_cuts(&cuts, want);
		all += cuts.n;
		most = cuts.n > most ? cuts.n : most;
		incise_incision_free(want);
	}
	assert_true(most > 3);
	assert_true(met > 100);
	assert_true(full > 100);
	/*
	 * Where a tick lies on the edge of a place, or 1 mm beside a cut, rounding decides whether that is
	 * deepened, or left a tick later: of 400 ticks with edges 0.5 mm apart, an LSB each.
	 */
	if (apart * 100 > all)
		fail_msg("%d of %d cuts are apart", apart, all);
}
