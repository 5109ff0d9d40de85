// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The stage of the tool, in both kinds of numbers: the tool that is held, by attitude and by name, and
 * its end.
 */
#include "../unit.h"
#include "../../../lib/tissue/tick.h"
#include "kinds.h"

#define AUTO INCISE_TOOL_AUTO
#define BLADE INCISE_TOOL_BLADE
#define HANDLE INCISE_TOOL_HANDLE
#define TUBE INCISE_TOOL_TUBE

static const double none[4] = {1, 0, 0, 0}, up[3] = {0, 0, 1};

/* A scalpel of 120 mm, and what is done with it. */
struct hand {
	enum incise_tool wanted, held;
	bool in_tissue, pushed, tube_nearer;
	bool waits;    /* set: for another tool, until the force has faded */
	double end[3]; /* set: of what is held; the tip is at (1, 2, 3) */
};

static const struct incise_surface plane = {.kind = INCISE_SURFACE_PLANE,
					    .plane = {{0}, {0, 0, 1}}};
static struct incise_proxy proxy = {.surface = &plane};
static struct incise_double_ends ends;

/* What only double has. */
#define PLAN_double .proxy = &proxy
#define STATE_double .ends = &ends
#define PLAN_fixed .surface = NULL
#define STATE_fixed .held = 0

#define CHOOSE(kind, n, d, back)                                                     \
	static void choose_##kind(struct hand *hand, const double q[4],              \
				  const double above[3])                             \
	{                                                                            \
		const struct incise_##kind##_plan plan = {                           \
			.numbers = {.inserts = true,                                 \
				    .pose_age_ns = 1000000000,                       \
				    .filter = {.alpha = d(1), .period_ns = 1000000}, \
				    .axis = {0, 0, d(1)},                            \
				    .side = {0, d(1), 0},                            \
				    .handle = n(120),                                \
				    .up = {d(above[0]), d(above[1]), d(above[2])}},  \
			PLAN_##kind};                                                \
		const struct incise_##kind##_pose pose = {                           \
			.t_ns = 1000000,                                             \
			.tool = (uint32_t)hand->wanted,                              \
			.position = {n(1), n(2), n(3)},                              \
			.quaternion = {d(q[0]), d(q[1]), d(q[2]), d(q[3])}};         \
		static struct incise_##kind##_state state;                           \
		struct incise_##kind##_tick tick = {.t_ns = 1000000};                \
                                                                                     \
		state = (struct incise_##kind##_state){STATE_##kind};                \
		incise_##kind##_plan_begin(&plan, &state);                           \
		assert_int_equal(incise_##kind##_plan_pose(&plan, &state, &pose,     \
							   1000000),                 \
				 INCISE_FIXED_POSE_TAKEN);                           \
		incise_##kind##_stage_predict(&plan, &state, &tick);                 \
		state.held = (int32_t)hand->held;                                    \
		state.tube_nearer = hand->tube_nearer;                               \
		state.proxy.touching = hand->in_tissue;                              \
		state.last[2] = n(hand->pushed);                                     \
		state.gain = hand->pushed;                                           \
		incise_##kind##_stage_tool(&plan, &state, &tick);                    \
		/* Another tool begins anew. */                                      \
		if (state.held != (int32_t)hand->held)                               \
			assert_true(!(state.gain > 0) && !state.proxy.touching);     \
		assert_int_equal(tick.held, state.held);                             \
		hand->held = (enum incise_tool)state.held;                           \
		hand->waits = state.changing;                                        \
		for (int i = 0; i < 3; i++)                                          \
			hand->end[i] = tick.tool[i] back;                            \
	}

#define AS_IS(x) (x)
/* clang-format off */
CHOOSE(double, AS_IS, AS_IS, )
CHOOSE(fixed, q16, q30, / ONE)
/* clang-format on */

/* rounding: of 120 mm in a few products */
static const struct kind {
	bool is_double;
	double rounding;
	void (*choose)(struct hand *hand, const double q[4], const double above[3]);
} kinds[] = {{true, 1e-12, choose_double}, {false, 4 / ONE, choose_fixed}}, *kind;

/*
 * The axis' share along the normal decides: given by the normal here, with the scalpel as
 * it is, so that it is exact.
 */
TEST_KINDS(test_turn)
{
	static const struct {
		enum incise_tool held;
		double share;
		enum incise_tool want;
	} cases[] = {
		{BLADE, 1, BLADE},
		{BLADE, 0.3, BLADE},
		{BLADE, 0, BLADE},
		{BLADE, -0.1999, BLADE},
		{BLADE, -0.2, BLADE}, /* exactly: not yet */
		{BLADE, -0.2001, HANDLE},
		{BLADE, -1, HANDLE},
		{HANDLE, -1, HANDLE},
		{HANDLE, 0, HANDLE},
		{HANDLE, 0.1999, HANDLE},
		{HANDLE, 0.2, HANDLE},
		{HANDLE, 0.2001, BLADE},
		{HANDLE, 1, BLADE},
		/* A tube that is given back: the scalpel, by its turn, else by its blade. */
		{TUBE, 1, BLADE},
		{TUBE, -1, HANDLE},
		{TUBE, 0, BLADE},
		{TUBE, -0.2, BLADE},
		{TUBE, 0.2, BLADE},
		{BLADE, NAN, BLADE},
		{HANDLE, NAN, HANDLE},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double share = cases[i].share;
		const double above[3] = {sqrt(1 - share * share), 0, share};
		struct hand hand = {.held = cases[i].held, .in_tissue = true};

		if (isnan(share) && !kind->is_double)
			continue;
		kind->choose(&hand, none, above);
		/* In the tissue only a tube is given back. */
		if (cases[i].held != TUBE)
			assert_int_equal(hand.held, cases[i].held);
		hand = (struct hand){.held = cases[i].held};
		kind->choose(&hand, none, above);
		if (hand.held != cases[i].want)
			fail_msg("case %zu gave %d", i, hand.held);
	}
}

/* A tool that is asked for by name is held in any attitude, once its force in the tissue is gone. */
TEST_KINDS(test_by_name)
{
	for (int wanted = BLADE; wanted <= TUBE; wanted++) {
		for (int held = BLADE; held <= TUBE; held++) {
			for (double z = -1; z <= 1; z += 0.5) {
				const double above[3] = {0, sqrt(1 - z * z), z};
				struct hand hand = {.wanted = (enum incise_tool)wanted,
						    .held = (enum incise_tool)held,
						    .in_tissue = true,
						    .pushed = true};

				kind->choose(&hand, none, above);
				assert_int_equal(hand.held, held);
				assert_int_equal(hand.waits, wanted != held);
				hand.pushed = false;
				kind->choose(&hand, none, above);
				assert_int_equal(hand.held, wanted);
				assert_false(hand.waits);
				hand.held = (enum incise_tool)held;
				hand.in_tissue = false;
				kind->choose(&hand, none, above);
				assert_int_equal(hand.held, wanted);
			}
		}
	}
}

/* A tube that has a station is held while it is nearer, whatever the scalpel's turn. */
TEST_KINDS(test_nearer_tube)
{
	for (int held = BLADE; held <= TUBE; held++) {
		for (double z = -1; z <= 1; z++) {
			const double above[3] = {0, sqrt(1 - z * z), z};
			struct hand hand = {.held = (enum incise_tool)held,
					    .tube_nearer = true,
					    .in_tissue = true,
					    .pushed = true};

			kind->choose(&hand, none, above);
			assert_int_equal(hand.waits, held != TUBE);
			assert_int_equal(hand.held, held);
			hand.in_tissue = false;
			kind->choose(&hand, none, above);
			assert_int_equal(hand.held, TUBE);
			hand.in_tissue = true;
			kind->choose(&hand, none, above);
			assert_false(hand.waits);
			hand.tube_nearer = false;
			kind->choose(&hand, none, above);
			assert_true(hand.waits);
			hand.in_tissue = false;
			kind->choose(&hand, none, above);
			assert_int_equal(hand.held, z < 0 ? HANDLE : BLADE);
			/* By name it does not matter. */
			hand = (struct hand){.wanted = (enum incise_tool)held,
					     .held = (enum incise_tool)held,
					     .tube_nearer = true,
					     .in_tissue = true};
			kind->choose(&hand, none, above);
			assert_false(hand.waits);
			assert_int_equal(hand.held, held);
		}
	}
}

/* A hand that trembles by less than the 12° to either side of level changes nothing. */
TEST_KINDS(test_tremor_does_not_switch)
{
	struct hand hand = {.held = BLADE};

	for (int i = 0; i < 1000; i++) {
		double turn = M_PI / 2 + 0.2 * sin(i),
		       q[4] = {cos(turn / 2), sin(turn / 2)};

		/* sin 0.2 rad is 0.1987. */
		kind->choose(&hand, q, up);
		assert_int_equal(hand.held, BLADE);
	}
}

TEST_KINDS(test_end)
{
	const double h = sqrt(0.5);
	const struct {
		enum incise_tool held;
		double q[4], end[3];
	} cases[] = {
		{BLADE, {1, 0, 0, 0}, {1, 2, 3}},
		{TUBE, {0, 1, 0, 0}, {1, 2, 3}},
		{HANDLE, {1, 0, 0, 0}, {1, 2, 123}},
		{HANDLE, {0, 1, 0, 0}, {1, 2, -117}}, /* turned round about x */
		{HANDLE, {0, 0, 1, 0}, {1, 2, -117}}, /* about y */
		{HANDLE, {h, h, 0, 0}, {1, -118, 3}}, /* by 90° about x */
		{HANDLE, {h, 0, h, 0}, {121, 2, 3}},  /* about y */
		{HANDLE, {h, 0, 0, h}, {1, 2, 123}},  /* about its own axis */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct hand hand = {.wanted = cases[i].held};

		kind->choose(&hand, cases[i].q, up);
		for (int k = 0; k < 3; k++)
			if (!(fabs(hand.end[k] - cases[i].end[k]) < kind->rounding))
				fail_msg("case %zu: %.12g, expected %.12g", i,
					 hand.end[k], cases[i].end[k]);
	}
}
