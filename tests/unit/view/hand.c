// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The hand at a window: however few frames there are, a press goes no deeper than is asked, and a
 * scalpel that is turned over touches nothing.
 */
#include "../unit.h"
#include "../cases.h"
#include "../../../lib/base/random.h"
#include "../../../tools/view/view.h"

#define HANDLE_MM 120.0

static double tip_mm[3], velocity_mm_s[3], attitude[4];

int __wrap_incise_sim_hold(struct incise_sim *sim, const double position_mm[3],
			   const double velocity[3], const double quaternion[4])
{
	memcpy(tip_mm, position_mm, sizeof(tip_mm));
	memcpy(velocity_mm_s, velocity, sizeof(velocity_mm_s));
	memcpy(attitude, quaternion, sizeof(attitude));
	return 0;
}

/* A hand of random depth for a case, and the time between its frames. */
static struct view_hand begin_hand(uint64_t seed, int i, double *dt_s)
{
	static const struct incise_touch top = {.normal = {0, 0, 1}};
	struct view_hand hand;

	view_hand_begin(&hand, NULL, HANDLE_MM, &top);
	*dt_s = 0.005 + 0.095 * incise_random_uniform(seed, 2 * (uint64_t)i);
	hand.depth_mm = 0.5 + 14.5 * incise_random_uniform(seed, 2 * (uint64_t)i + 1);
	return hand;
}

/* Height of the tip after so long, as the simulated tracker moves it on. */
static double height_after(double t_s)
{
	return tip_mm[2] + t_s * velocity_mm_s[2];
}

TEST(test_a_press_goes_no_deeper)
{
	uint64_t seed = cases_seed(1);

	for (int i = 0; i < cases_of(2000, 100); i++) {
		double dt_s;
		struct view_hand hand = begin_hand(seed, i, &dt_s);

		hand.press = 1;
		for (int n = 0; n < 2 / dt_s; n++) {
			view_hand_move(&hand, dt_s);
			/* Until the next frame, and there by the step that it gave. */
			assert_true(height_after(dt_s) > -hand.depth_mm - 1e-9);
		}
		assert_true(fabs(tip_mm[2] + hand.depth_mm) < 0.01);
	}
}

TEST(test_a_scalpel_that_turns_touches_nothing)
{
	uint64_t seed = cases_seed(2);

	for (int i = 0; i < cases_of(2000, 100); i++) {
		double dt_s;
		struct view_hand hand = begin_hand(seed, i, &dt_s);

		for (int n = 0; n < 6 / dt_s; n++) {
			double end_mm, z;

			/* Pressed all the time: it is turned first. */
			hand.press = 1;
			hand.tool = n < 2 / dt_s || n > 4 / dt_s ? INCISE_TOOL_BLADE
								 : INCISE_TOOL_HANDLE;
			view_hand_move(&hand, dt_s);
			z = 1 -
			    2 * (attitude[1] * attitude[1] + attitude[2] * attitude[2]);
			end_mm = tip_mm[2] + HANDLE_MM * z;
			if (hand.round > 0 && hand.round < 1)
				assert_true(fmin(tip_mm[2], end_mm) > 0);
		}
		assert_true(hand.round == 0);
	}
}

GROUP(NULL, NULL);
