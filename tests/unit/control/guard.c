// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Guard: exact energy, damping with a cap, bounded credit and debt, nothing but numbers.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <float.h>
#include <math.h>
#include <string.h>
#include "../../../lib/control/guard.h"

#define MASS_KG 0.05
#define PERIOD_S 1e-3
#define CAP_N_S_MM (INCISE_GUARD_SHARE * MASS_KG / 1000 / PERIOD_S)

/* Some roundings of numbers around 1. */
#define ROUNDING 1e-14

static struct incise_guard made(double reserve_N_mm)
{
	struct incise_guard guard;

	incise_guard_init(&guard, MASS_KG, PERIOD_S, reserve_N_mm);
	return guard;
}

/* One tick along an axis; returns the force after the guard, which is what is sent. */
static double tick(struct incise_guard *guard, double x_mm, double v_mm_s, double f_N)
{
	double x[3] = {0, x_mm, 0}, v[3] = {0, v_mm_s, 0}, f[3] = {0, f_N, 0};
	bool damped = incise_guard_apply(guard, x, v, f);

	assert_int_equal(damped, f[1] != f_N);
	assert_int_equal(damped, guard->damping_N_s_mm > 0);
	incise_guard_sent(guard, f);
	return f[1];
}

static void test_energy_of_the_held_force(void **state)
{
	struct incise_guard guard = made(10);

	/* The position of the first tick is the begin, not a way. */
	assert_true(tick(&guard, 5, 0, -2) == -2);
	assert_true(guard.energy_N_mm == 0);
	/* Against the force: energy goes in. */
	assert_true(tick(&guard, 5.5, 400, -3) == -3);
	assert_true(fabs(guard.energy_N_mm - 1) < ROUNDING);
	/* Across the force: none. */
	{
		double x[3] = {7, 5.5, -3}, v[3] = {1, 1, 1}, f[3] = {0, -3, 0};

		assert_false(incise_guard_apply(&guard, x, v, f));
		assert_true(fabs(guard.energy_N_mm - 1) < ROUNDING);
	}
	/* Without a word of what was sent the last force counts on; it comes out again. */
	{
		double x[3] = {7, 5.3, -3}, v[3] = {0}, f[3] = {0};

		incise_guard_apply(&guard, x, v, f);
		assert_true(fabs(guard.energy_N_mm - 0.4) < ROUNDING);
	}
	incise_guard_reset(&guard);
	assert_true(guard.energy_N_mm == 0);
	assert_true(tick(&guard, 9, 10, 1) == 1);
	assert_true(guard.energy_N_mm == 0);
}

static void test_damping_takes_what_came_out(void **state)
{
	static const struct {
		double energy_N_mm, v_mm_s, damping_N_s_mm;
	} cases[] = {
		{-0.5, 200, 0.5 / (1e-3 * 200 * 200)}, /* α = -W/(v² T) */
		{-0.5, -200, 0.5 / (1e-3 * 200 * 200)},
		{-0.5, 10, CAP_N_S_MM},
		{-0.5, 1e-300, CAP_N_S_MM},
		{-0.5, 0, 0},
		{0, 200, 0},
		{0.5, 200, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_guard guard = made(2);
		double x[3] = {0}, v[3] = {cases[i].v_mm_s, 0, 0}, f[3] = {1, 2, 3};
		double want = 1 - cases[i].damping_N_s_mm * cases[i].v_mm_s;

		guard.energy_N_mm = cases[i].energy_N_mm;
		incise_guard_apply(&guard, x, v, f);
		assert_true(fabs(f[0] - want) < ROUNDING);
		assert_true(f[1] == 2 && f[2] == 3);
	}
}

static void test_credit_is_bounded_and_debt_is_not(void **state)
{
	struct incise_guard guard = made(2);

	tick(&guard, 0, 0, -1);
	for (int i = 1; i <= 10; i++)
		tick(&guard, i, 0, -1);
	assert_true(guard.energy_N_mm == 2);
	for (int i = 9; i >= 0; i--)
		tick(&guard, i, 0, -1);
	assert_true(guard.energy_N_mm == -8);
	/* Back in by the same way: the debt is paid first. */
	tick(&guard, 9, 0, -1);
	assert_true(fabs(guard.energy_N_mm - 1) < ROUNDING);
}

/* Same motion along another direction: same energy, same damping. */
static void test_no_direction_is_special(void **state)
{
	static const double n[3] = {0.48, -0.6, 0.64};
	struct incise_guard along = made(3), skew = made(3);

	for (int i = 0; i < 200; i++) {
		double s = 3 * sin(0.3 * i), u = 900 * cos(0.3 * i),
		       force = -1.5 * s + 0.2 * i;
		double x[3], v[3], f[3], f_along;

		for (int k = 0; k < 3; k++) {
			x[k] = s * n[k];
			v[k] = u * n[k];
			f[k] = force * n[k];
		}
		f_along = tick(&along, s, u, force);
		incise_guard_apply(&skew, x, v, f);
		incise_guard_sent(&skew, f);
		/* 200 sums of some roundings of up to 100 N mm. */
		assert_true(fabs(along.energy_N_mm - skew.energy_N_mm) < 1e-10);
		for (int k = 0; k < 3; k++)
			assert_true(fabs(f[k] - f_along * n[k]) < 1e-9);
	}
}

/*
 * A sampled wall on a bare mass makes energy at every stiffness; the motion between ticks
 * is exact. It pulls as well as pushes: past K T²/m = 0.686, 34 N/mm here, no damper
 * whatever can hold such a wall.
 */
static double largest_swing(double reserve_N_mm, double K_N_mm)
{
	struct incise_guard guard = made(reserve_N_mm);
	double x = 0, v = 100, m = MASS_KG / 1000, T = PERIOD_S, largest = 0;

	for (int i = 0; i < 20000 && fabs(x) < 1e6; i++) {
		double f = tick(&guard, x, v, -K_N_mm * x);

		x += (v + f / m * T / 2) * T;
		v += f / m * T;
		if (i >= 10000 || fabs(x) > 1e5)
			largest = fmax(largest, fabs(x));
	}
	return largest;
}

static void test_a_sampled_wall_stays_bounded(void **state)
{
	static const double K_N_mm[] = {1, 10, 30};

	for (size_t i = 0; i < sizeof(K_N_mm) / sizeof(*K_N_mm); i++) {
		assert_true(largest_swing(0, K_N_mm[i]) > 1e5);
		/* The start alone swings v √(m/K) = 0.71 mm at 1 N/mm. */
		assert_true(largest_swing(1, K_N_mm[i]) < 0.8);
	}
}

/* The guard observes all the energy that a bounce brings; f·v T observes none of it. */
static void test_a_bounce(void **state)
{
	struct incise_guard guard = made(1e6);
	double x = 0, v = -100, m = MASS_KG / 1000, T = PERIOD_S, naive = 0, gain;

	/* It only watches: what it adds is not sent. */
	for (int i = 0; i < 1000 && (x < 0 || v < 0); i++) {
		double at[3] = {x}, u[3] = {v}, f = x < 0 ? -1 * x : 0, force[3] = {f};

		incise_guard_apply(&guard, at, u, force);
		incise_guard_sent(&guard, (const double[3]){f});
		naive += f * v * T;
		x += (v + f / m * T / 2) * T;
		v += f / m * T;
	}
	incise_guard_apply(&guard, (const double[3]){x}, (const double[3]){0},
			   (double[3]){0});
	gain = m / 2 * (v * v - 1e4);
	assert_true(gain > 0.01);
	assert_true(fabs(guard.energy_N_mm + gain) < 1e-13);
	assert_true(naive < 0.1 * gain);
}

static void test_off_leaves_every_bit(void **state)
{
	static const struct {
		double mass_kg, period_s, reserve_N_mm;
	} off[] = {{0.05, 1e-3, 0},	   {0, 1e-3, 1},      {0.05, 0, 1},
		   {-1, 1e-3, 1},	   {0.05, -1, 1},     {NAN, 1e-3, 1},
		   {0.05, NAN, 1},	   {0.05, 1e-3, NAN}, {1e300, 1e-300, 1},
		   {0.05, 1e-3, INFINITY}, {0.05, 1e-3, -1}};

	for (size_t i = 0; i < sizeof(off) / sizeof(*off); i++) {
		struct incise_guard guard;

		incise_guard_init(&guard, off[i].mass_kg, off[i].period_s,
				  off[i].reserve_N_mm);
		for (int k = 0; k < 10; k++) {
			double x[3] = {-k, 0, 0}, v[3] = {-100, 0, 0},
			       f[3] = {-0.0, 1e-320, NAN};
			double same[3];

			memcpy(same, f, sizeof(f));
			assert_false(incise_guard_apply(&guard, x, v, f));
			assert_memory_equal(f, same, sizeof(f));
			f[2] = 1;
			incise_guard_sent(&guard, f);
		}
	}
}

/* Where the watched point was put elsewhere there was no way, and so no work. */
static void test_a_discontinuity_is_no_way(void **state)
{
	struct incise_guard guard = made(10);

	tick(&guard, 5, 0, -2);
	tick(&guard, 6, 0, -2);
	assert_true(fabs(guard.energy_N_mm - 2) < ROUNDING);
	incise_guard_discontinuity(&guard);
	tick(&guard, -1000, 0, -2);
	assert_true(fabs(guard.energy_N_mm - 2) < ROUNDING);
	/* From there on it counts again, and a debt stays over a discontinuity as well. */
	tick(&guard, -1002, 0, -2);
	assert_true(fabs(guard.energy_N_mm + 2) < ROUNDING);
	incise_guard_discontinuity(&guard);
	tick(&guard, 70, 0, -2);
	assert_true(fabs(guard.energy_N_mm + 2) < ROUNDING);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_energy_of_the_held_force),
		cmocka_unit_test(test_damping_takes_what_came_out),
		cmocka_unit_test(test_credit_is_bounded_and_debt_is_not),
		cmocka_unit_test(test_no_direction_is_special),
		cmocka_unit_test(test_a_sampled_wall_stays_bounded),
		cmocka_unit_test(test_a_bounce),
		cmocka_unit_test(test_off_leaves_every_bit),
		cmocka_unit_test(test_a_discontinuity_is_no_way),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
