// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/tissue/instrument.c: the tool that is held, by attitude and by name, and its end.
 */
#include "../unit.h"
#include "../../../lib/tissue/instrument.h"

#define AUTO INCISE_TOOL_AUTO
#define BLADE INCISE_TOOL_BLADE
#define HANDLE INCISE_TOOL_HANDLE
#define TUBE INCISE_TOOL_TUBE

static const double none[4] = {1, 0, 0, 0}, up[3] = {0, 0, 1};

static struct incise_instrument scalpel(enum incise_tool wanted, enum incise_tool held)
{
	return (struct incise_instrument){
		.axis = {0, 0, 1},
		.side = {0, 1, 0},
		.handle_mm = 120,
		.wanted = wanted,
		.held = held,
	};
}

/*
 * The axis' share along the normal decides: given by the normal here, with the scalpel as
 * it is, so that it is exact.
 */
TEST(test_turn)
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
		const double normal[3] = {sqrt(1 - share * share), 0, share};
		struct incise_instrument s = scalpel(AUTO, cases[i].held);
		bool other;

		/* Not in the tissue. */
		other = incise_instrument_choose(&s, none, normal, true);
		assert_true(!other && s.held == cases[i].held);
		other = incise_instrument_choose(&s, none, normal, false);
		if (s.held != cases[i].want || other != (s.held != cases[i].held))
			fail_msg("case %zu gave %d", i, s.held);
	}
}

/* A tool that is asked for by name is held in any attitude, once out of the tissue. */
TEST(test_by_name)
{
	static const enum incise_tool tools[] = {BLADE, HANDLE, TUBE};

	for (int wanted = 0; wanted < 3; wanted++) {
		for (int held = 0; held < 3; held++) {
			for (double z = -1; z <= 1; z += 0.5) {
				struct incise_instrument s =
					scalpel(tools[wanted], tools[held]);
				const double normal[3] = {0, sqrt(1 - z * z), z};

				assert_false(
					incise_instrument_choose(&s, none, normal, true));
				assert_int_equal(s.held, tools[held]);
				assert_int_equal(incise_instrument_choose(&s, none,
									  normal, false),
						 wanted != held);
				assert_int_equal(s.held, tools[wanted]);
			}
		}
	}
}

/* A tube that has a station is held while it is nearer, whatever the scalpel's turn. */
TEST(test_nearer_tube)
{
	static const enum incise_tool tools[] = {BLADE, HANDLE, TUBE};

	for (int held = 0; held < 3; held++) {
		for (double z = -1; z <= 1; z++) {
			struct incise_instrument s = scalpel(AUTO, tools[held]);
			const double normal[3] = {0, sqrt(1 - z * z), z};

			s.tube_nearer = true;
			assert_int_equal(incise_instrument_waits(&s),
					 tools[held] != TUBE);
			incise_instrument_choose(&s, none, normal, false);
			assert_int_equal(s.held, TUBE);
			assert_false(incise_instrument_waits(&s));
			s.tube_nearer = false;
			assert_true(incise_instrument_waits(&s));
			incise_instrument_choose(&s, none, normal, false);
			assert_int_equal(s.held, z < 0 ? HANDLE : BLADE);
			/* By name it does not matter. */
			s.wanted = tools[held];
			s.tube_nearer = true;
			incise_instrument_choose(&s, none, normal, false);
			assert_int_equal(s.held, tools[held]);
			assert_false(incise_instrument_waits(&s));
		}
	}
}

/* A hand that trembles by less than the 12° to either side of level changes nothing. */
TEST(test_tremor_does_not_switch)
{
	struct incise_instrument s = scalpel(AUTO, BLADE);
	int changes = 0;

	for (int i = 0; i < 1000; i++) {
		double turn = M_PI / 2 + 0.2 * sin(i),
		       q[4] = {cos(turn / 2), sin(turn / 2)};

		/* sin 0.2 rad is 0.1987. */
		changes += incise_instrument_choose(&s, q, up, false);
	}
	assert_int_equal(changes, 0);
}

TEST(test_end)
{
	static const double tip[3] = {1, 2, 3};
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
		struct incise_instrument s = scalpel(AUTO, cases[i].held);
		double end[3];

		incise_instrument_end(&s, tip, cases[i].q, end);
		/* A few roundings of 120. */
		for (int k = 0; k < 3; k++)
			assert_true(fabs(end[k] - cases[i].end[k]) < 1e-12);
	}
}
