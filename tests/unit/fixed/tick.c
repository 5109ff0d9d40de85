// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The stages of a tick in integers: each force compared with its formula, written out here in double;
 * start, limits and targets; then random plans at work, and numbers at their ends.
 */
#include "../unit.h"
#include "trial_plan.h"

#define CASES 20000
#define ONE 65536.0
#define UNIT 1073741824.0
#define LSB (1 / ONE)

static struct incise_fx_trial trial;
static struct incise_fixed_state tick_state;

static int32_t fixed(double v)
{
	return (int32_t)lrint(v * ONE);
}

static double any(double least, double most)
{
	return least +
	       (most - least) * (incise_fx_trial_next(&trial.seed) >> 11) * 0x1p-53;
}

static void any_place(int32_t p[3], double most)
{
	for (int i = 0; i < 3; i++)
		p[i] = fixed(any(-most, most));
}

static void from_unit(double to[3], const int32_t unit[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = unit[i] / UNIT;
}

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static int begin(void **state)
{
	memset(&tick_state, 0, sizeof(tick_state));
	if (!trial.seed)
		trial.seed = 1;
	return 0;
}

/* Run a stage; the force that it adds, N. */
static void effect(double force[3], const struct incise_fixed_plan *plan,
		   incise_fixed_stage_fn *stage, struct incise_fixed_tick *tick)
{
	int32_t was[3];

	for (int i = 0; i < 3; i++)
		was[i] = tick_state.force[i] = fixed(any(-4, 4));
	stage(plan, &tick_state, tick);
	for (int i = 0; i < 3; i++)
		force[i] = (tick_state.force[i] - was[i]) / ONE;
}

static void assert_force(const double got[3], const double want[3], double most)
{
	for (int i = 0; i < 3; i++)
		if (!(fabs(got[i] - want[i]) <= most))
			fail_msg("part %d is %.9g N, not %.9g: off by %.3g of %.3g N", i,
				 got[i], want[i], got[i] - want[i], most);
}

static struct incise_fixed_tick tick_in(enum incise_phase phase)
{
	return (struct incise_fixed_tick){.phase = phase};
}

/* A state and a place of the tool as any may be. */
static struct incise_fixed_tick any_state(enum incise_phase phase)
{
	struct incise_fixed_tick tick = tick_in(phase);

	any_place(tick.tool, 20);
	any_place(tick_state.p0, 20);
	any_place(tick_state.velocity, 500);
	incise_fx_trial_unit(&trial, tick_state.normal, 3);
	incise_fx_trial_unit(&trial, tick_state.entry, 3);
	incise_fx_trial_unit(&trial, tick_state.side, 3);
	incise_fx_trial_unit(&trial, tick_state.flat, 3);
	incise_fx_trial_unit(&trial, tick_state.opening.along, 3);
	tick_state.held = any(0, 3) < 1 ? INCISE_TOOL_TUBE : INCISE_TOOL_HANDLE;
	tick_state.opening.in = any(0, 2) < 1;
	tick_state.opening.depth_mm = fixed(any(0, 20));
	tick_state.tightness = fixed(any(0, 1));
	tick_state.depth = fixed(any(0, 30));
	return tick;
}

/* Depth of skin that holds up as much: beside the cut all, in it Fort of that as deep as the cut is. */
static double held_up_mm(double aligned, const double flat[3], const double along[3])
{
	double depth = tick_state.depth / ONE, cut = 0, eased;

	if (tick_state.opening.in)
		cut = fmin(depth, tick_state.opening.depth_mm / ONE);
	eased = aligned + (1 - aligned) * (tick_state.tightness / ONE) *
				  (tick_state.held == INCISE_TOOL_TUBE
					   ? 1
					   : fabs(dot(flat, along)));
	return depth - cut + eased * cut;
}

/*
 * Each force within its roundings: of a reaction its product and each part; of the plane the stretch, the
 * product and each part; of a spread the part along n0, the vector across and the product; of an
 * insertion 2 LSB of Fort times 20 mm and 2 N/mm, and the rest by one each.
 */
TEST(test_forces, begin)
{
	for (int k = 0; k < CASES; k++) {
		double K = fixed(any(0, 2)) / ONE, aligned = fixed(any(0, 1)) / ONE;
		double damping = lrint(any(0, 0.01) * 268435456) / 268435456.0;
		double off[3], n[3], e[3], s[3], flat[3], along[3], depth, held,
			want[5][3];
		struct incise_fixed_tick cutting = any_state(INCISE_PHASE_CUTTING),
					 inserting = cutting;
		struct incise_fixed_plan plan = {
			.numbers = {.reaction = fixed(K),
				    .plane = fixed(K),
				    .insertion = fixed(K),
				    .aligned = fixed(aligned),
				    .spread = fixed(K),
				    .damping = (int32_t)lrint(damping * 268435456)}};
		const struct {
			incise_fixed_stage_fn *stage;
			struct incise_fixed_tick *tick;
			double most;
		} forces[] = {
			{incise_fixed_stage_reaction, &cutting, LSB},
			{incise_fixed_stage_plane, &cutting, (K / 2 + 1) * LSB},
			{incise_fixed_stage_damping, &cutting, LSB},
			{incise_fixed_stage_insertion, &inserting,
			 (2 * 20 * K + K + 1.5) * LSB},
			{incise_fixed_stage_spread, &inserting, (K + 0.5) * LSB + 1e-9},
		};

		inserting.phase = INCISE_PHASE_INSERTION;
		from_unit(n, tick_state.normal);
		from_unit(e, tick_state.entry);
		from_unit(s, tick_state.side);
		from_unit(flat, tick_state.flat);
		from_unit(along, tick_state.opening.along);
		for (int i = 0; i < 3; i++)
			off[i] = (cutting.tool[i] - tick_state.p0[i]) / ONE;
		depth = tick_state.depth / ONE;
		held = held_up_mm(aligned, flat, along);
		for (int i = 0; i < 3; i++) {
			want[0][i] = K * depth * n[i];
			want[1][i] = -K * dot(off, s) * s[i];
			want[2][i] = -damping * tick_state.velocity[i] / ONE;
			want[3][i] = K * held * n[i];
			want[4][i] = -K * (off[i] - dot(off, e) * e[i]);
		}
		for (int f = 0; f < 5; f++) {
			double got[3];

			effect(got, &plan, forces[f].stage, forces[f].tick);
			assert_force(got, want[f], forces[f].most);
		}
	}
}

static double length_of(const int32_t v[3])
{
	return sqrt((double)v[0] * v[0] + (double)v[1] * v[1] + (double)v[2] * v[2]);
}

/* The same as in real numbers, but for rounding: towards 0 in each of three steps. */
TEST(test_limit, begin)
{
	for (int k = 0; k < CASES; k++) {
		struct incise_fixed_plan plan = {
			.numbers = {.force = 1 + (int32_t)any(0, 1 << 20),
				    .slew = 1 + (int32_t)any(0, 1 << 18)}};
		double most = plan.numbers.force, slew = plan.numbers.slew, want[3],
		       change[3], length, step[3];
		struct incise_fixed_tick tick = {0};
		int32_t last[3], moved[3];

		for (int i = 0; i < 3; i++) {
			last[i] = tick_state.last[i] = (int32_t)any(-most / 2, most / 2);
			tick.command[i] = (int32_t)any(-2 * most, 2 * most);
		}
		length = length_of(tick.command);
		for (int i = 0; i < 3; i++)
			change[i] = tick.command[i] * fmin(1, most / length) - last[i];
		length = sqrt(dot(change, change));
		for (int i = 0; i < 3; i++)
			want[i] = last[i] + change[i] * fmin(1, slew / length);
		incise_fixed_stage_limit(&plan, &tick_state, &tick);
		for (int i = 0; i < 3; i++) {
			moved[i] = tick.command[i] - last[i];
			step[i] = tick.command[i] - want[i];
			assert_true(fabs(step[i]) <= 4);
			assert_int_equal(tick_state.last[i], tick.command[i]);
		}
		assert_true(length_of(tick.command) <= most);
		assert_true(length_of(moved) <= slew + 2 * sqrt(3));
	}
}

/* The nut goes where the spring pushes with the force along its axis. */
TEST(test_targets, begin)
{
	struct incise_fixed_plan plan = {
		.numbers = {.n_axes = 1,
			    .pose_age_ns = 1000000000,
			    .tick_ns = 1000000,
			    .average_ticks = 1,
			    .force = 8 << 16,
			    .slew = 8 << 16,
			    .reaction = 1 << 15,
			    .small = INT32_MAX,
			    .side = {INCISE_FIXED_UNIT},
			    .shape = {.normal = {0, 0, INCISE_FIXED_UNIT}},
			    .filter = {.alpha = INCISE_FIXED_UNIT, .period_ns = 1000000},
			    .axes = {{.direction = {0, 0, INCISE_FIXED_UNIT},
				      .dual = {0, 0, 1 << 24},
				      .compliance = 2 << 20,
				      .steps_per_mm = 100 << 16,
				      .origin = -(50 << 16),
				      .travel = 60 << 16,
				      .rest = 10 << 16}}}};
	struct incise_fixed_pose pose = {.quaternion = {INCISE_FIXED_UNIT},
					 .position = {0, 0, -(6 << 16)}};
	struct incise_fixed_tick tick;

	incise_fixed_plan_begin(&plan, &tick_state);
	incise_fixed_plan_tick(&plan, &tick_state, 1000000, &tick);
	/* Without a pose it is at rest. */
	assert_int_equal(tick.target[0], 1000);
	assert_true(tick.flags & INCISE_TICK_STALE);
	for (int k = 2; k < 40; k++) {
		pose.t_ns = (int64_t)k * 1000000;
		assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose,
							pose.t_ns),
				 INCISE_FIXED_POSE_TAKEN);
		incise_fixed_plan_tick(&plan, &tick_state, pose.t_ns, &tick);
	}
	/* 6 mm deep are 3 N, which are 6 mm of the spring: 44 + 6 mm from the origin. */
	assert_int_equal(tick.command[2], 3 << 16);
	assert_int_equal(tick.along[0], 3 << 16);
	assert_int_equal(tick.target[0], 5000);
	assert_false(tick.flags & INCISE_TICK_TRAVEL);
	assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose, pose.t_ns),
			 INCISE_FIXED_POSE_OLD);
	pose.t_ns += 1000000;
	pose.position[0] = INT32_MAX;
	assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose, pose.t_ns),
			 INCISE_FIXED_POSE_FAR);
	pose.tool = INCISE_FIXED_POSE_TUBE;
	assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose, pose.t_ns),
			 INCISE_FIXED_POSE_UNKNOWN);
}

/* --- random plans ----------------------------------------------------------------------- */

static uint32_t play(const struct incise_fixed_plan *plan, uint64_t seed, bool hostile,
		     uint32_t *flags)
{
	struct incise_fx_trial_hand hand = {.t.seed = seed, .t_ns = 1000000000};
	uint32_t digest = 0;
	int32_t last[3] = {0};

	memset(&tick_state, (int)seed, sizeof(tick_state));
	incise_fixed_plan_begin(plan, &tick_state);
	for (int k = 0; k < 400; k++) {
		struct incise_fixed_tick tick;
		struct incise_fixed_pose pose;
		int32_t moved[3];

		incise_fx_trial_hand(&hand, plan, &pose);
		if (hostile && !(k % 3))
			for (int i = 0; i < 4; i++) {
				int32_t end = incise_fx_trial_one_in(&hand.t, 2)
						      ? INT32_MAX
						      : INT32_MIN;

				pose.quaternion[i] = end;
				pose.position[i % 3] = k & 1 ? end : pose.position[i % 3];
			}
		incise_fixed_plan_pose(plan, &tick_state, &pose, hand.t_ns);
		incise_fixed_plan_tick(plan, &tick_state, hand.t_ns, &tick);
		for (int i = 0; i < 3; i++)
			moved[i] = tick.command[i] - last[i];
		incise_fx_copy(last, tick.command);
		assert_true(length_of(tick.command) <= plan->numbers.force);
		/* Two roundings of each component. */
		assert_true(length_of(moved) <= plan->numbers.slew + 2 * sqrt(3));
		digest ^=
			incise_fx_crc((const uint8_t *)tick.target, sizeof(tick.target)) +
			incise_fx_crc((const uint8_t *)tick.command,
				      sizeof(tick.command)) *
				(uint32_t)(k + 1);
		*flags |= tick.flags;
	}
	return digest;
}

/* The same again gives the same bits, and what can happen does. */
TEST(test_random_plans, begin)
{
	uint8_t *bytes = calloc(1, INCISE_FX_TRIAL_PLAN_SIZE);
	uint32_t flags = 0;

	assert_non_null(bytes);
	for (uint64_t seed = 1; seed <= 300; seed++) {
		struct incise_fixed_plan plan;
		uint32_t size = incise_fx_trial_plan(seed, bytes), first;

		assert_int_equal(incise_fixed_plan_open(&plan, bytes, size), 0);
		for (int hostile = 0; hostile < 2; hostile++) {
			first = play(&plan, seed, hostile, &flags);
			assert_int_equal(play(&plan, seed, hostile, &flags), first);
		}
	}
	assert_int_equal(
		flags & (INCISE_TICK_CONTACT | INCISE_TICK_EXTRAPOLATED |
			 INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED | INCISE_TICK_TRAVEL |
			 INCISE_TICK_STARTING | INCISE_TICK_STALE | INCISE_TICK_IN_CUT),
		INCISE_TICK_CONTACT | INCISE_TICK_EXTRAPOLATED | INCISE_TICK_CLAMPED |
			INCISE_TICK_SLEWED | INCISE_TICK_TRAVEL | INCISE_TICK_STARTING |
			INCISE_TICK_STALE | INCISE_TICK_IN_CUT);
	free(bytes);
}
