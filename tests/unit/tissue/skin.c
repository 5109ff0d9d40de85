// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Friction along the skin, in both kinds of numbers: never more than its share of the force along the normal, no
 * work given back, no creep while a hand rests; and integers stay with double while a tool creeps along the skin
 * by less than their last bit.
 */
#include "../unit.h"
#include "../../../lib/tissue/tick.h"

#define K_N_mm 0.3
#define SHARE 0.4
#define LSB 0x1p-16
/* Of a contact: a stretch and a product to half a bit, a direction to 2^-30, the anchor to 2^-33 a tick. */
#define ROUNDING_N (8 * LSB)

struct both {
	struct incise_double_plan plan;
	struct incise_double_state state;
	struct incise_fixed_plan fixed;
	struct incise_fixed_state fixed_state;
	double apart_N; /* as far as that they may be */
};

static void begin(struct both *b)
{
	memset(b, 0, sizeof(*b));
	b->plan.numbers.skin = lrint(K_N_mm / LSB) * LSB;
	b->plan.numbers.skin_friction = lrint(SHARE / LSB) * LSB;
	b->fixed.numbers.skin = (int32_t)lrint(K_N_mm / LSB);
	b->fixed.numbers.skin_friction = (int32_t)lrint(SHARE / LSB);
	b->apart_N = ROUNDING_N;
	b->state.normal[2] = 1;
	b->fixed_state.normal[2] = 1 << 30;
	b->state.proxy.began = b->fixed_state.proxy.began = true;
}

/* The drag of both with the tool at x, y, on a plane that pushes with @normal_N. */
static void drag(struct both *b, const double at_mm[2], double normal_N, double force[2],
		 double fixed[2])
{
	struct incise_double_tick tick = {.phase = INCISE_PHASE_CUTTING, .tool[2] = -1};
	struct incise_fixed_tick fixed_tick = {.phase = INCISE_PHASE_CUTTING,
					       .tool[2] = -65536};
	double push = lrint(normal_N / LSB) * LSB;

	for (int i = 0; i < 3; i++)
		b->state.force[i] = b->fixed_state.force[i] = 0;
	b->state.force[2] = push;
	b->fixed_state.force[2] = (int32_t)lrint(push / LSB);
	for (int i = 0; i < 2; i++) {
		fixed_tick.tool[i] = (int32_t)lrint(at_mm[i] / LSB);
		tick.tool[i] = fixed_tick.tool[i] * LSB;
	}
	incise_double_stage_skin(&b->plan, &b->state, &tick);
	incise_fixed_stage_skin(&b->fixed, &b->fixed_state, &fixed_tick);
	b->state.proxy.began = b->fixed_state.proxy.began = false;
	for (int i = 0; i < 2; i++) {
		force[i] = b->state.force[i];
		fixed[i] = b->fixed_state.force[i] * LSB;
	}
	/* It acts along the skin only, and within its share. */
	assert_true(b->state.force[2] == push);
	assert_true(hypot(force[0], force[1]) <= SHARE * push + 2 * LSB);
	assert_true(hypot(fixed[0], fixed[1]) <= SHARE * push + 4 * LSB);
	for (int i = 0; i < 2; i++)
		if (!(fabs(force[i] - fixed[i]) <= b->apart_N))
			fail_msg("at %.6f, %.6f mm: %.9f N, in integers %.9f", at_mm[0],
				 at_mm[1], force[i], fixed[i]);
}

static double any(double most)
{
	return most * (2.0 * rand() / RAND_MAX - 1);
}

/* Closed walks of random steps and stops, at a constant force: what is put in is at least what comes back. */
TEST(test_takes_work)
{
	srand(1);
	for (int run = 0; run < 200; run++) {
		double way[200][2] = {{0}}, force[2], last[2] = {0}, fixed[2];
		double normal_N = fabs(any(5)), in_N_mm = 0, fixed_N_mm = 0,
		       fixed_last[2] = {0};
		struct both b;

		begin(&b);
		for (int k = 1; k < 199; k++)
			for (int i = 0; i < 2; i++)
				way[k][i] =
					lrint((way[k - 1][i] + (k % 7 ? any(0.4) : 0)) /
					      LSB) *
					LSB;
		for (int k = 0; k < 200; k++) {
			drag(&b, way[k], normal_N, force, fixed);
			for (int i = 0; i < 2 && k; i++) {
				double step = way[k][i] - way[k - 1][i];

				/* Trapezium: the force is linear while it sticks. */
				in_N_mm -= (force[i] + last[i]) / 2 * step;
				fixed_N_mm -= (fixed[i] + fixed_last[i]) / 2 * step;
			}
			memcpy(last, force, sizeof(last));
			memcpy(fixed_last, fixed, sizeof(last));
		}
		/* The spring may hold its own energy still: F²/2K. */
		assert_true(in_N_mm >= -1e-12);
		assert_true(fixed_N_mm >= -200 * 0.8 * ROUNDING_N);
	}
}

/* A hand that rests where it slipped: after the next tick nothing moves to the bit. */
TEST(test_rests_where_it_slipped)
{
	srand(2);
	for (int run = 0; run < 1000; run++) {
		double at_mm[2], normal_N = fabs(any(5)), first[2], force[2], fixed[2];
		double fixed_first[2];
		struct both b;

		begin(&b);
		for (int k = 0; k < 10; k++) {
			at_mm[0] = any(8);
			at_mm[1] = any(8);
			drag(&b, at_mm, normal_N, force, fixed);
		}
		drag(&b, at_mm, normal_N, first, fixed_first);
		assert_true(hypot(first[0] - force[0], first[1] - force[1]) < 1e-11);
		assert_true(hypot(fixed_first[0] - fixed[0], fixed_first[1] - fixed[1]) <=
			    4 * LSB);
		for (int k = 0; k < 20; k++) {
			drag(&b, at_mm, normal_N, force, fixed);
			for (int i = 0; i < 2; i++) {
				assert_true(force[i] == first[i]);
				assert_true(fixed[i] == fixed_first[i]);
			}
		}
	}
}

/* So slowly that each step is less than a bit; round, so that rounding would pull the anchor aside. */
TEST(test_creeps_with_double)
{
	double force[2], fixed[2], at_mm[2];
	struct both b;

	begin(&b);
	for (int k = 0; k < 300000; k++) {
		at_mm[0] = 2 * cos(k * 3e-6);
		at_mm[1] = 2 * sin(k * 3e-6);
		drag(&b, at_mm, 1 + 0.5 * sin(k * 1e-4), force, fixed);
	}
	/* It slipped, and drags against the way. */
	assert_true(hypot(force[0], force[1]) > 0.1);
}

/*
 * A hand that circles at little more than the slip draws the anchor round with it, and magnifies what integers
 * are off: to √(2 R δ) at most, of which the plan's bound knows.
 */
TEST(test_circles_within_the_bound)
{
	/* Of a place, a length and a slip of the integers half a bit each, of a direction two halves; twice that. */
	const double slip_mm = SHARE * 2 / K_N_mm, off_mm = 5 * LSB;
	const double most_N =
		K_N_mm * (2 * off_mm + sqrt(2 * slip_mm * off_mm)) + ROUNDING_N;

	for (int run = 0; run < 40; run++) {
		double radius_mm = slip_mm * (1 + run * run * 1e-4), force[2], fixed[2];
		struct both b;

		begin(&b);
		b.apart_N = most_N;
		for (int k = 0; k < 20000; k++) {
			const double at_mm[2] = {radius_mm * cos(k * 0.01),
						 radius_mm * sin(k * 0.01)};

			drag(&b, at_mm, 2, force, fixed);
		}
	}
}
