// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plant: closed forms, energy, a matrix exponential in long double, and one step against many.
 */
#include "../unit.h"
#include <float.h>
#include "../../../lib/control/plant.h"

#define N(array) (sizeof(array) / sizeof(*(array)))
#define G 1e-3 /* N s²/mm of a kg */

static void near(double got, double want, double within)
{
	if (!(fabs(got - want) <= within))
		print_error("%.17g, not %.17g\n", got, want);
	assert_true(fabs(got - want) <= within);
}

TEST(test_closed_forms)
{
	struct incise_plant p = {.mass_kg = 0.05, .velocity_mm_s = 100};
	double m = 0.05 * G, omega;

	/* Free. */
	incise_plant_step(&p, 0.5, 1e-3);
	near(p.velocity_mm_s, 100 + 0.5 / m * 1e-3, 1e-12);
	near(p.position_mm, 0.1 + 0.5 / m * 5e-7, 1e-15);
	/* Coulomb: stops after v m/c and v² m/(2c), and stays. */
	p = (struct incise_plant){
		.mass_kg = 0.05, .coulomb_N = 0.2, .velocity_mm_s = -100};
	incise_plant_step(&p, 0, 1);
	assert_true(p.velocity_mm_s == 0);
	near(p.position_mm, -1e4 * m / 0.4, 1e-14);
	incise_plant_step(&p, 0.2, 1);
	near(p.position_mm, -1e4 * m / 0.4, 1e-14);
	incise_plant_step(&p, 0.3, 1e-3);
	near(p.velocity_mm_s, 0.1 / m * 1e-3, 1e-13);
	/* Viscous, to the end. */
	p = (struct incise_plant){
		.mass_kg = 0.05, .damping_N_s_mm = 0.01, .velocity_mm_s = 100};
	incise_plant_step(&p, 0, 1000);
	near(p.position_mm, 100 * m / 0.01, 1e-14);
	near(p.velocity_mm_s, 0, 1e-300);
	/* An elastic wall gives back what it got, after half a period. */
	omega = sqrt(20 / m);
	p = (struct incise_plant){.mass_kg = 0.05,
				  .wall_N_mm = 20,
				  .position_mm = 1,
				  .velocity_mm_s = -100};
	incise_plant_step(&p, 0, 0.01 + M_PI / omega / 2);
	near(p.position_mm, -100 / omega, 1e-14);
	near(p.velocity_mm_s, 0, 1e-10);
	incise_plant_step(&p, 0, M_PI / omega / 2 + 0.03);
	near(p.position_mm, 3, 1e-13);
	near(p.velocity_mm_s, 100, 1e-12);
	/* Coulomb at a spring: each half swing is 2c/K shorter, until it sticks. */
	p = (struct incise_plant){.mass_kg = 0.05,
				  .coulomb_N = 0.5,
				  .wall_N_mm = 20,
				  .tied = true,
				  .position_mm = 1.01};
	for (int i = 1; i <= 20; i++) {
		incise_plant_step(&p, 0, M_PI / omega);
		near(fabs(p.position_mm), 1.01 - 0.05 * i, 1e-13);
		assert_int_equal(p.position_mm < 0, i % 2);
		incise_plant_step(&p, 0, 0);
	}
	incise_plant_step(&p, 0, 1);
	near(p.position_mm, 0.01, 1e-13);
	/* All of them at once. */
	p.position_mm = 1.01;
	incise_plant_step(&p, 0, 1);
	near(p.position_mm, 0.01, 1e-13);
}

/* x, v and 1 through exp(At), by a series of a small part and squaring, in long double. */
static void exponential(long double a2, long double omega2, long double push,
			long double t, long double *x, long double *v)
{
	long double A[3][3] = {{0, 1, 0}, {-omega2, -a2, push}, {0}}, E[3][3], P[3][3];
	long double x0 = *x, v0 = *v;
	int squarings = 0;

	while (ldexpl((a2 + sqrtl(omega2) + 1) * t, -squarings) > 0.01L)
		squarings++;
	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++) {
			A[i][j] *= ldexpl(t, -squarings);
			E[i][j] = P[i][j] = i == j;
		}
	for (int n = 1; n < 20; n++) {
		long double Q[3][3] = {0};

		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++) {
				for (int k = 0; k < 3; k++)
					Q[i][j] += P[i][k] * A[k][j] / n;
				E[i][j] += Q[i][j];
			}
		for (int i = 0; i < 9; i++)
			P[i / 3][i % 3] = Q[i / 3][i % 3];
	}
	for (int s = 0; s < squarings; s++) {
		long double Q[3][3] = {0};

		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++)
				for (int k = 0; k < 3; k++)
					Q[i][j] += E[i][k] * E[k][j];
		for (int i = 0; i < 9; i++)
			E[i / 3][i % 3] = Q[i / 3][i % 3];
	}
	*x = E[0][0] * x0 + E[0][1] * v0 + E[0][2];
	*v = E[1][0] * x0 + E[1][1] * v0 + E[1][2];
}

TEST(test_any_rate)
{
	/* Of a period: damping b T/m and angle ωT, from nothing to far beyond one. */
	static const double damping[] = {0, 1e-9, 1e-6, 1e-3, 0.1, 0.5, 0.99,
					 1, 1.01, 2,	6,    20,  60,	1e3};
	static const double angle[] = {0,	  1e-9, 1e-5, 1e-2, 0.3, 0.5,
				       0.5000001, 0.9,	1,    3,    10,	 30};

	for (size_t i = 0; i < N(damping); i++)
		for (size_t j = 0; j < N(angle); j++) {
			double omega2 = angle[j] * angle[j];
			struct incise_plant p = {.mass_kg = 1000,
						 .tied = true,
						 .damping_N_s_mm = damping[i],
						 .wall_N_mm = omega2,
						 .position_mm = 0.3,
						 .velocity_mm_s = -0.7};
			long double x = 0.3L, v = -0.7L;
			double size = 1 + angle[j] + damping[i];

			exponential(damping[i], omega2, 0.4, 1, &x, &v);
			incise_plant_step(&p, 0.4, 1);
			/* Roundings of the motion's size, and of the angle. */
			near(p.position_mm, x, 4e-16 * size);
			near(p.velocity_mm_s, v, 4e-16 * size * size);
		}
}

static const struct incise_plant kinds[] = {
	{.mass_kg = 0.05,
	 .damping_N_s_mm = 1e-3,
	 .coulomb_N = 0.1,
	 .wall_N_mm = 20,
	 .wall_N_s_mm = 2e-3},
	{.mass_kg = 0.05, .coulomb_N = 0.3, .wall_N_mm = 1000},
	{.mass_kg = 0.05,
	 .damping_N_s_mm = 0.5,
	 .coulomb_N = 0.05,
	 .wall_N_mm = 3,
	 .wall_N_s_mm = 0.4},
	{.mass_kg = 0.05, .wall_N_mm = 200, .wall_mm = -0.3},
	{.mass_kg = 0.05, .coulomb_N = 0.2, .wall_N_mm = 50, .tied = true},
};

/* A force that presses, lets go and pulls. */
static double force(int tick)
{
	return 2 * sin(0.37 * tick) - 1.2 + 0.8 * sin(0.011 * tick);
}

/* A period in one go or in many is the same motion, events and all. */
TEST(test_one_step_is_many)
{
	for (size_t i = 0; i < N(kinds); i++) {
		struct incise_plant one = kinds[i], many = kinds[i];
		int meets = 0;

		for (int tick = 0; tick < 300; tick++) {
			double was = one.position_mm;

			incise_plant_step(&one, force(tick), 1e-3);
			meets += (was < one.wall_mm) != (one.position_mm < one.wall_mm);
			for (int k = 0; k < 7; k++)
				incise_plant_step(&many, force(tick), 1e-3 / 7);
			/* Roundings, which the stiffest wall of a frictionless bounce
			 * multiplies from bounce to bounce. */
			near(one.position_mm, many.position_mm, 1e-10);
			near(one.velocity_mm_s, many.velocity_mm_s, 1e-6);
			many.position_mm = one.position_mm;
			many.velocity_mm_s = one.velocity_mm_s;
		}
		assert_true(meets >= 3);
	}
}

/* Friction never gives energy back: without a force the energy only falls. */
TEST(test_energy_falls)
{
	for (size_t i = 0; i < N(kinds); i++) {
		struct incise_plant p = kinds[i];
		double m = p.mass_kg * G, before = INFINITY, first = 0;

		p.position_mm = 0.5;
		p.velocity_mm_s = -300;
		for (int k = 0; k < 5000; k++) {
			double x = p.position_mm, v = p.velocity_mm_s, E = m * v * v / 2;

			if (p.tied || x < p.wall_mm)
				E += p.wall_N_mm * (x - p.wall_mm) * (x - p.wall_mm) / 2;
			/* 5000 steps of some roundings. */
			assert_true(E <= before * (1 + 1e-14));
			before = E;
			first = k ? first : E;
			incise_plant_step(&p, 0, 1e-4);
		}
		if (p.coulomb_N == 0 && p.damping_N_s_mm == 0)
			near(before, first, 1e-12 * first);
		else
			assert_true(before < 0.2 * first);
	}
}

TEST(test_no_such_plant)
{
	struct incise_plant p = {.mass_kg = 0};

	incise_plant_step(&p, 0, 1);
	assert_true(isnan(p.position_mm) && isnan(p.velocity_mm_s));
	/* Friction without end made an infinite velocity. */
	p = (struct incise_plant){
		.mass_kg = 1, .coulomb_N = INFINITY, .velocity_mm_s = -9};
	incise_plant_step(&p, 1, 1);
	assert_true(isnan(p.position_mm) && isnan(p.velocity_mm_s));
	p = (struct incise_plant){.mass_kg = 1};
	incise_plant_step(&p, NAN, 1);
	assert_true(isnan(p.position_mm));
	p = (struct incise_plant){.mass_kg = 1, .position_mm = 3};
	incise_plant_step(&p, 1, 0);
	assert_true(p.position_mm == 3 && p.velocity_mm_s == 0);
}
