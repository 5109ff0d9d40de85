// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tissue that a blade tears along its edge, in both kinds of numbers: a cut takes the work of fracture for each area,
 * once; what the spring took comes back; and integers stay with double.
 */
#include "../unit.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/tissue/tick.h"
#include "kinds.h"

/* 0.164 N/mm over 0.25 N/mm, as integers have it. */
#define K_N_mm 0.25
#define J_N_mm 0.164
#define GIVES (rint(J_N_mm / K_N_mm / LSB) * LSB)
#define LSB 0x1p-16

/* Of a place, a length and the spring half a bit each, and of the tip as many. */
#define ROUNDING_N (4 * LSB)

/* A cut that ends in a place counts as whole there. */
#define PLACE_MM 0.5

#define PULL(kind, n, d, back)                                                           \
	static struct incise_##kind##_state state_##kind;                                \
                                                                                         \
	static void pull_##kind(const double at_mm[3], const double side[3], bool began, \
				double force[3])                                         \
	{                                                                                \
		const struct incise_##kind##_plan plan = {                               \
			.numbers = {.fracture = n(K_N_mm), .gives = n(GIVES)}};          \
		struct incise_##kind##_tick tick = {.phase = INCISE_PHASE_CUTTING};      \
		struct incise_##kind##_state *state = &state_##kind;                     \
                                                                                         \
		state->proxy.began = began;                                              \
		state->entry[2] = d(1);                                                  \
		state->depth = n(-at_mm[2]);                                             \
		for (int i = 0; i < 3; i++) {                                            \
			tick.tool[i] = n(at_mm[i]);                                      \
			if (began)                                                       \
				state->p0[i] = i < 2 ? tick.tool[i] : 0;                 \
			state->side[i] = d(side[i]);                                     \
			state->force[i] = 0;                                             \
		}                                                                        \
		incise_##kind##_stage_fracture(&plan, state, &tick);                     \
		for (int i = 0; i < 3; i++)                                              \
			force[i] = state->force[i] back;                                 \
	}

#define AS_IS(x) (x)
/* clang-format off */
PULL(double, AS_IS, AS_IS, )
PULL(fixed, q16, q30, / ONE)
/* clang-format on */

/* A blade in the hand: where it was, and the work that it took, mJ, of both kinds. */
static struct {
	double at_mm[3], force[3], fixed[3], side[3], work_mJ, fixed_mJ;
	bool in,
		any; /* any: one kind may break through into an open cut a step before the other */
} blade;

static void begin(void)
{
	memset(&state_double, 0, sizeof(state_double));
	memset(&state_fixed, 0, sizeof(state_fixed));
	memset(&blade, 0, sizeof(blade));
	blade.side[1] = 1;
}

/* To the bits of a length: both kinds are at the same place. */
static void put(double x, double y, double depth)
{
	const double to[3] = {x, y, -depth};
	double at_mm[3], force[3], fixed[3];

	for (int i = 0; i < 3; i++)
		at_mm[i] = rint(to[i] / LSB) * LSB;
	pull_double(at_mm, blade.side, !blade.in, force);
	pull_fixed(at_mm, blade.side, !blade.in, fixed);
	for (int i = 0; i < 3; i++) {
		if (!blade.any && !(fabs(force[i] - fixed[i]) <= ROUNDING_N))
			fail_msg("at %g, %g, %g mm: %.9f N, in integers %.9f", at_mm[0],
				 at_mm[1], at_mm[2], force[i], fixed[i]);
		/* The spring is linear: the mean is its work. */
		if (!blade.in)
			continue;
		blade.work_mJ -=
			(force[i] + blade.force[i]) / 2 * (at_mm[i] - blade.at_mm[i]);
		blade.fixed_mJ -=
			(fixed[i] + blade.fixed[i]) / 2 * (at_mm[i] - blade.at_mm[i]);
	}
	assert_true(v3_length(fixed) <= J_N_mm * fmax(depth, 0) + ROUNDING_N);
	assert_true(v3_length(force) <= J_N_mm * fmax(depth, 0) + ROUNDING_N);
	v3_copy(blade.at_mm, at_mm);
	v3_copy(blade.force, force);
	v3_copy(blade.fixed, fixed);
	blade.in = true;
}

#define STEPS 1000

/* Go straight there; returns the work that it took. */
static double go(double x, double y, double depth)
{
	double from[3], before_mJ = blade.work_mJ;

	v3_copy(from, blade.at_mm);
	for (int i = 1; i <= STEPS; i++)
		put(from[0] + (x - from[0]) * i / STEPS,
		    from[1] + (y - from[1]) * i / STEPS,
		    -from[2] + (depth + from[2]) * i / STEPS);
	return blade.work_mJ - before_mJ;
}

/* Enter elsewhere, straight down: which takes nothing along the cut. */
static void enter(double x, double y, double depth)
{
	blade.in = false;
	put(x, y, 0);
	go(x, y, depth);
}

/* Of 1000 forces that are off by the rounding, over @path_mm; and of J / K. */
static double near_mJ(double path_mm)
{
	return path_mm * (2 * ROUNDING_N + LSB * 10);
}

#define assert_near(got, want, off)                                             \
	do {                                                                    \
		double got_ = (got), want_ = (want), off_ = (off);              \
                                                                                \
		if (!(fabs(got_ - want_) <= off_))                              \
			fail_msg("line %d: %g, not %g", __LINE__, got_, want_); \
	} while (0)

/* At any depth, length and direction: J for each area, when the spring has given back what it took. */
TEST(test_a_cut_takes_the_work_of_fracture)
{
	srand(1);
	for (int run = 0; run < 200; run++) {
		double depth = 1 + rand() % 100 / 10.0, length = 20 + rand() % 100 / 10.0;
		double turn = 2 * M_PI * rand() / RAND_MAX, x = length * cos(turn),
		       y = length * sin(turn), give = depth * J_N_mm / K_N_mm,
		       back = 1 - give / length;

		begin();
		blade.side[0] = -sin(turn);
		blade.side[1] = cos(turn);
		enter(0, 0, depth);
		go(x, y, depth);
		assert_near(v3_length(blade.force), J_N_mm * depth, 2 * ROUNDING_N);
		go(back * x, back * y, depth);
		assert_near(v3_length(blade.force), 0, 2 * ROUNDING_N);
		assert_near(blade.work_mJ, J_N_mm * depth * (length - give),
			    near_mJ(2 * length));
	}
}

/* Before it tears the spring gives back all; beyond it does once the blade is back. */
TEST(test_what_the_spring_took_comes_back)
{
	begin();
	enter(0, 0, 4);
	assert_near(go(2.5, 0, 4), K_N_mm * 2.5 * 2.5 / 2, near_mJ(3));
	assert_near(go(-2.5, 0, 4), 0, near_mJ(5));
	assert_near(go(0, 0, 4), -K_N_mm * 2.5 * 2.5 / 2, near_mJ(3));
	assert_true(v3_length(blade.force) == 0);
	/* Nor does coming out take anything, where the tip was not left. */
	assert_near(go(0, 0, 0), 0, 0);
}

/* In an open cut the blade is free: on its way back, in a later contact, less deep, and turned round. */
TEST(test_an_open_cut_is_free)
{
	double took;

	begin();
	enter(0, 0, 5);
	took = go(30, 0, 5) + go(25, 0, 5);
	assert_near(took, J_N_mm * 5 * (30 - 5 * J_N_mm / K_N_mm), near_mJ(40));
	assert_near(go(0, 0, 5), 0, near_mJ(25));
	assert_near(go(25, 0, 3), 0, near_mJ(25));
	enter(20, 0.6, 5);
	assert_near(go(2, -0.6, 5), 0, near_mJ(20));
	blade.side[1] = -1;
	enter(2, 0, 5);
	assert_near(go(25, 0, 5), 0, near_mJ(25));
	/* … to its end, and no farther: the same force on the same place. */
	go(30, 0, 5);
	assert_near(-blade.force[0], J_N_mm * 5, 2 * ROUNDING_N);
	assert_near(go(40, 0, 5), J_N_mm * 5 * 10, near_mJ(15));
}

/* A second stroke that is deeper takes what is below the first, and the whole depth beyond its ends. */
TEST(test_below_a_cut_tissue_is_uncut)
{
	const double give = 4 * J_N_mm / K_N_mm;

	begin();
	enter(0, 0, 2);
	go(30, 0, 2);
	enter(5, 0, 4);
	assert_near(go(20, 0, 4), J_N_mm * 2 * (15 - give / 2) + K_N_mm * give * give / 8,
		    J_N_mm * 2 * PLACE_MM + near_mJ(15));
	assert_near(go(20 - give / 2, 0, 4), -K_N_mm * give * give / 8, near_mJ(5));
	/* There and back, wherever it turns. */
	assert_near(go(6, 0, 4) + go(20 - give / 2, 0, 4), 0, near_mJ(40));
	go(50, 0, 4);
	assert_near(-blade.force[0], J_N_mm * 4, 2 * ROUNDING_N);
}

/* A cut across opens nothing along; one beside is another; and the first is remembered among eight. */
TEST(test_cuts_that_cross_and_lie_beside)
{
	const double give = 3 * J_N_mm / K_N_mm, whole = J_N_mm * 3 * (20 - give);

	for (int n = 2; n <= 9; n++) {
		begin();
		for (int i = 0; i < n; i++) {
			enter(0, 4 * i, 3);
			assert_near(go(20, 4 * i, 3) + go(20 - give, 4 * i, 3), whole,
				    near_mJ(25));
		}
		/* Of nine the first is forgotten. */
		enter(2, 0, 3);
		assert_near(go(18 - give, 0, 3) + go(16 - 2 * give, 0, 3),
			    n > 8 ? J_N_mm * 3 * (16 - 2 * give) : 0, near_mJ(25));
	}
	begin();
	enter(0, 0, 3);
	go(20, 0, 3);
	blade.side[0] = 1;
	blade.side[1] = 0;
	enter(10, -10, 3);
	assert_near(go(10, 10, 3) + go(10, 10 - give, 3), whole, near_mJ(25));
	/* From where they cross, too. */
	enter(15, 0, 3);
	assert_near(go(15, 20, 3) + go(15, 20 - give, 3), whole, near_mJ(25));
}

/* A blade that wanders aside tears lines side by side: never less force than along one, and it comes back to them. */
TEST(test_aside)
{
	double took;

	begin();
	enter(0, 0, 3);
	took = go(30, 10, 3);
	assert_near(took, J_N_mm * 3 * (30 - 3 * J_N_mm / K_N_mm / 2), near_mJ(35));
	assert_near(-blade.force[0], J_N_mm * 3, 2 * ROUNDING_N);
	assert_true(blade.force[1] == 0);
	/* Sideways nothing is torn; what lies 4 mm aside is not, and within 1 mm it is. */
	assert_near(go(30, 14, 3), 0, near_mJ(5));
	assert_near(go(0, 14, 3), J_N_mm * 3 * (30 - 2 * 3 * J_N_mm / K_N_mm),
		    near_mJ(35));
	go(6, 14, 3);
	assert_near(go(24, 14.4, 3), 0, near_mJ(20));
}

static double any(double most)
{
	return most * (2.0 * rand() / RAND_MAX - 1);
}

/*
 * Random walks, in and out of cuts: at any time no more came back than was put in, but for the steps in which the blade
 * comes to the tip or leaves it, of whose work the mean of two forces is off by K step²/8.
 */
TEST(test_takes_work)
{
	srand(2);
	for (int run = 0; run < 300; run++) {
		double depth = 0, off_mJ = 0;

		begin();
		blade.any = true;
		put(0, 0, 0);
		for (int k = 1; k < 400; k++) {
			double way = k % 7 ? any(1) : 0, step;

			if (k % 50 == 0)
				blade.in = rand() % 2;
			for (int i = 0; i < 10; i++) {
				step = way / 10 + (run % 3 - 1) * 0.02;
				depth = fmin(fmax(depth + any(0.1), 0), 6);
				put(blade.at_mm[0] + step, blade.at_mm[1] + any(0.05),
				    depth);
				off_mJ += K_N_mm * step * step / 8 +
					  2 * ROUNDING_N * fabs(step);
				assert_true(fmin(blade.work_mJ, blade.fixed_mJ) >=
					    -off_mJ);
			}
		}
		/* Out of the tissue nothing pulls. */
		go(blade.at_mm[0], blade.at_mm[1], 0);
		assert_true(v3_length(blade.force) <= ROUNDING_N);
	}
}
