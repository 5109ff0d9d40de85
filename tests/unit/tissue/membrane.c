// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The membrane over an airway, in both kinds of numbers: until it yields a spring, then nothing down to
 * the wall behind.
 */
#include "../unit.h"
#include "../../../lib/tissue/tick.h"
#include "kinds.h"

/* 10 mm below the skin, 4 mm thick, with a wall 14 mm behind it; nothing of it was met yet. */
#define BEYOND(kind, n, d, back)                                                        \
	static struct incise_##kind##_state state_##kind;                               \
	static void begin_##kind(void)                                                  \
	{                                                                               \
		memset(&state_##kind, 0, sizeof(state_##kind));                         \
	}                                                                               \
                                                                                        \
	/* A tool so far beyond, and aside; force N, and the depth of the tissue. */    \
	static double beyond_##kind(double stiffness, double beyond, double aside,      \
				    double *depth, uint32_t *flags)                     \
	{                                                                               \
		const struct incise_##kind##_plan plan = {                              \
			.numbers.membrane = {.normal = {0, 0, d(1)},                    \
					     .radius = n(5),                            \
					     .thickness = n(4),                         \
					     .stiffness = n(stiffness),                 \
					     .back_wall = n(14)}};                      \
		struct incise_##kind##_tick tick = {.phase = INCISE_PHASE_CUTTING,      \
						    .tool = {n(aside), 0, n(-beyond)}}; \
                                                                                        \
		state_##kind.sn[2] = d(1);                                              \
		state_##kind.depth = n(10 + beyond);                                    \
		state_##kind.force[2] = 0;                                              \
		incise_##kind##_stage_membrane(&plan, &state_##kind, &tick);            \
		*depth = state_##kind.depth back;                                       \
		*flags = tick.flags;                                                    \
		return state_##kind.force[2] back;                                      \
	}

#define AS_IS(x) (x)
/* clang-format off */
BEYOND(double, AS_IS, AS_IS, )
BEYOND(fixed, q16, q30, / ONE)
/* clang-format on */

static const struct kind {
	void (*begin)(void);
	double (*beyond)(double stiffness, double beyond, double aside, double *depth,
			 uint32_t *flags);
} kinds[] = {{begin_double, beyond_double}, {begin_fixed, beyond_fixed}}, *kind;

TEST_KINDS(test_membrane)
{
	static const struct {
		double beyond, force;
		uint32_t flags;
	} way[] = {
		{-1, 0, 0},
		{1, 0.25, INCISE_TICK_MEMBRANE},
		{3.5, 0.875, INCISE_TICK_MEMBRANE},
		{4, 0, INCISE_TICK_LUMEN},
		{2, 0, INCISE_TICK_LUMEN},
		{14, 0, INCISE_TICK_LUMEN},
		{16, 0.5, INCISE_TICK_LUMEN | INCISE_TICK_BACK_WALL},
	};
	uint32_t flags;
	double depth;

	/* One that does not resist is there, too. */
	for (double stiffness = 0; stiffness < 0.5; stiffness += 0.25) {
		kind->begin();
		for (size_t k = 0; k < sizeof(way) / sizeof(*way); k++) {
			double force =
				kind->beyond(stiffness, way[k].beyond, 0, &depth, &flags);

			/* All numbers are some sixteenths: without rounding. */
			assert_true(force == way[k].force * stiffness / 0.25);
			assert_int_equal(flags, way[k].flags);
			/* The tissue above stays as deep as it was. */
			assert_true(depth == fmin(10 + way[k].beyond, 10));
		}
	}
	/* Who comes beside it meets tissue, also below it later. */
	kind->begin();
	for (double aside = 5.5; aside >= 0; aside -= 5.5) {
		assert_true(kind->beyond(0.25, 2, aside, &depth, &flags) == 0);
		assert_true(depth == 12 && flags == 0);
	}
}
