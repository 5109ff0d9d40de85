// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Stability: the limit against LAPACK's eigenvalues and a closed form; the laws of one line against
 * their figures.
 */
#include "../unit.h"
#include <float.h>
#include <lapacke.h>
#include <incise/stability.h>

#define N(array) (sizeof(array) / sizeof(*(array)))

/* Unit mass (N s²/mm) and period: damping is δ, stiffness is K T²/m. */
static struct incise_haptic_device unit(double delta, int delay)
{
	return (struct incise_haptic_device){.mass_kg = 1000,
					     .damping_N_s_mm = delta,
					     .period_s = 1,
					     .delay_ticks = delay};
}

static double limit(double delta, double beta, int delay)
{
	struct incise_haptic_device device = unit(delta, delay);

	return incise_stability_limit(&device, beta);
}

/* The effect of one period on x, v and a held force, in long double. */
struct held {
	long double p, a, c;
};

static struct held held(long double delta)
{
	struct held h = {expl(-delta), 1, 0.5L};

	if (delta > 0) {
		h.a = -expm1l(-delta) / delta;
		/* 64 bits bear the cancellation down to δ = 1e-6: 1e-19/1e-12. */
		h.c = (1 - h.a) / delta;
	}
	return h;
}

#define STATES (INCISE_STABILITY_DELAY_MAX + 3)

/* Largest modulus of an eigenvalue; the state is x, v, then x one tick ago and so on. */
static double radius(double delta, double beta, int delay, double kappa)
{
	static double A[STATES * STATES], re[STATES], im[STATES];
	struct held h = held(delta);
	int n = delay + 3, now = delay ? delay + 1 : 0, ago = delay + 2;
	double largest = 0;

	memset(A, 0, sizeof(A));
	A[0] = 1;
	A[1] = h.a;
	A[n + 1] = h.p;
	A[now] -= h.c * (kappa + beta);
	A[n + now] -= h.a * (kappa + beta);
	A[ago] += h.c * beta;
	A[n + ago] += h.a * beta;
	A[2 * n] = 1;
	for (int i = 3; i < n; i++)
		A[i * n + i - 1] = 1;
	assert_int_equal(LAPACKE_dgeev(LAPACK_ROW_MAJOR, 'N', 'N', n, A, n, re, im, NULL,
				       n, NULL, n),
			 0);
	for (int i = 0; i < n; i++)
		largest = fmax(largest, hypot(re[i], im[i]));
	return largest;
}

TEST(test_eigenvalues)
{
	static const double deltas[] = {1e-6, 1e-3, 0.01, 0.1, 1, 3, 10, 100};
	static const double betas[] = {0, 0.1, 0.3, 0.8, -0.05};
	static const int delays[] = {0, 1, 2, 5, 15};
	int stable = 0;

	for (size_t i = 0; i < N(deltas); i++)
		for (size_t j = 0; j < N(betas); j++)
			for (size_t k = 0; k < N(delays); k++) {
				double d = deltas[i], b = betas[j];
				double K = limit(d, b, delays[k]);
				/* dgeev gives a radius to some 1e-14; it changes by about
				 * the least of δ and 1 per relative change of K. */
				double off = fmax(1e-8, 1e-11 / fmin(1, d + b));

				if (K == 0) {
					/* Even a soft wall is unstable, or the device drifts. */
					assert_true(radius(d, b, delays[k], 1e-3) > 1);
					continue;
				}
				stable++;
				assert_true(radius(d, b, delays[k], K * (1 - off)) < 1);
				assert_true(radius(d, b, delays[k], K * (1 + off)) > 1);
				for (int s = 1; s < 20; s++)
					assert_true(radius(d, b, delays[k], K * s / 20) <
						    1);
			}
	/* Most are stable: the loop above did look at something. */
	assert_true(stable > 150);
}

TEST(test_long_delays)
{
	static const int delays[] = {40, INCISE_STABILITY_DELAY_MAX};

	for (size_t k = 0; k < N(delays); k++) {
		double K = limit(0.5, 0.02, delays[k]);

		assert_true(radius(0.5, 0.02, delays[k], K * (1 - 1e-8)) < 1);
		assert_true(radius(0.5, 0.02, delays[k], K * (1 + 1e-8)) > 1);
	}
}

TEST(test_closed_form)
{
	double largest = 0, at = 0;

	for (double d = 1e-6; d < 120; d *= 1.003) {
		long double p = expl(-d), q = -expm1l(-d), second = 1 + p - 2 * q / d;
		long double K = d * q / (q - p * d);

		if (second > 0)
			K = fminl(K, 2 * (1 + p) / second);
		/* The closed form in 64 bits loses 1e-19/δ² to cancellation. */
		assert_true(fabsl(limit(d, 0, 0) / (K * d) - 1) <
			    1e-12 + 1e-18 / (d * d));
	}
	/* Where the two branches cross. 4.0902 at 3.709, which is also met with, is 0.2 % less
	 * than the closed form itself has there. */
	for (double d = 3.71; d < 3.73; d += 1e-5)
		if (limit(d, 0, 0) / d > largest) {
			largest = limit(d, 0, 0) / d;
			at = d;
		}
	assert_true(fabs(largest - 4.0993) < 0.51e-4);
	assert_true(fabs(at - 3.7208) < 0.51e-4);
	assert_true(fabs(limit(3.709, 0, 0) / 3.709 - 4.0900) < 0.51e-4);
}

/* A device in its own units: 1000 times the mass is 1000 times the stiffness, and so on. */
TEST(test_units)
{
	struct incise_haptic_device device = {.mass_kg = 0.05,
					      .damping_N_s_mm = 0.005,
					      .period_s = 1e-3,
					      .delay_ticks = 1};

	/* δ = 0.1; m/T² = 50 N/mm. */
	assert_true(
		fabs(incise_stability_limit(&device, 0.015) / (50 * limit(0.1, 0.3, 1)) -
		     1) < 1e-12);
	/* (0.005 - 0.001)/(1.5 ms) and (0.005 + 0.001)/(1.5 ms) */
	assert_true(fabs(incise_stability_colgate(&device, 0.001) - 0.004 / 1.5e-3) <
		    1e-12);
	assert_true(fabs(incise_stability_colgate(&device, -0.001) - 0.004 / 1.5e-3) <
		    1e-12);
	assert_true(incise_stability_colgate(&device, 0.006) == 0);
	/* 2b/T = 10, 2c/Δ = 4 N/mm */
	device.coulomb_N = 0.02;
	assert_true(fabs(incise_stability_quantisation(&device) - 10) < 1e-12);
	device.encoder_mm = 0.01;
	assert_true(fabs(incise_stability_quantisation(&device) - 4) < 1e-12);
}

/*
 * Where the exact limit tends to is the linear law, (b + B)/(T/2 + t_d): Gil, Avello, Rubio,
 * Flórez, IEEE Trans. Control Systems Technology 12 (2004); and Colgate is below it.
 */
TEST(test_small_damping)
{
	for (int delay = 0; delay <= 20; delay += 5) {
		struct incise_haptic_device device = unit(1e-5, delay);
		double exact = incise_stability_limit(&device, 1e-5);

		/* The next term is (b + B) T/m times the delay: 2e-5 × 20 at most. */
		assert_true(fabs(exact * (0.5 + delay) / 2e-5 - 1) < 1e-3);
		assert_true(incise_stability_colgate(&device, 0) <=
			    incise_stability_limit(&device, 0));
	}
}

TEST(test_no_such_device)
{
	static const struct incise_haptic_device bad[] = {
		{0, 0.1, 0, 0, 1, 0},	   {-1, 0.1, 0, 0, 1, 0},
		{NAN, 0.1, 0, 0, 1, 0},	   {1, -0.1, 0, 0, 1, 0},
		{1, NAN, 0, 0, 1, 0},	   {1, 0.1, -1, 0, 1, 0},
		{1, 0.1, 0, -1, 1, 0},	   {1, 0.1, 0, 0, 0, 0},
		{1, 0.1, 0, 0, NAN, 0},	   {1, 0.1, 0, 0, 1, -1},
		{1, 0.1, 0, 0, 1, 65},	   {INFINITY, 1, 0, 0, 1, 0},
		{1, INFINITY, 0, 0, 1, 0}, {1, 1e300, 0, 0, 1e300, 0},
	};
	struct incise_haptic_device good = unit(0.1, 0);

	for (size_t i = 0; i < N(bad); i++)
		assert_true(incise_stability_limit(&bad[i], 0) == 0);
	for (size_t i = 0; i + 2 < N(bad); i++) {
		assert_true(incise_stability_colgate(&bad[i], 0) == 0);
		assert_true(incise_stability_quantisation(&bad[i]) == 0);
	}
	assert_true(incise_stability_limit(&good, NAN) == 0);
	assert_true(incise_stability_limit(&good, INFINITY) == 0);
	/* No damping at all: every wall is unstable. */
	assert_true(limit(0, 0, 0) == 0);
	assert_true(limit(0.1, -0.1, 0) == 0);
}
