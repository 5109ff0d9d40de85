// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Stability of a sampled wall; see incise/stability.h.
 *
 * In the units of a period and of the mass a device is δ = b T/m and a wall is
 * κ = K T²/m, β = B T/m. The state matrix has the characteristic polynomial
 *
 *   z^(d+1) (z-1)(z-p) + (κ z + β (z-1)) (c z + a² - c p)
 *
 * For z = e^iθ this is solved for κ: the wall is critical where κ is real. The least such
 * κ > 0 is the limit, if a very soft wall is stable, which is decided in the same way. It
 * is the condition that an eigenvalue has modulus 1, without the rounding of an
 * eigenvalue's modulus, which takes the digits where δ is small.
 */
#include <complex.h>
#include <math.h>
#include <stdbool.h>
#include <incise/stability.h>
#include "../base/units.h"

/* glibc 2.36 has it for gcc alone. */
#ifndef CMPLX
#define CMPLX(re, im) __builtin_complex((double)(re), (double)(im))
#endif

/* The effect of a held force on the device in one period, unit mass and period. */
struct loop {
	double decay; /* 1 - p */
	double a, c;  /* velocity and position for a unit force */
	double beta;
	int delay;
};

/* A function of the angle that is real where an eigenvalue meets the circle. */
typedef double complex locus(const struct loop *loop, double theta);

static bool valid(const struct incise_haptic_device *d)
{
	return d->mass_kg > 0 && isfinite(d->mass_kg) && d->damping_N_s_mm >= 0 &&
	       isfinite(d->damping_N_s_mm) && d->coulomb_N >= 0 && d->encoder_mm >= 0 &&
	       d->period_s > 0 && isfinite(d->period_s) && d->delay_ticks >= 0 &&
	       d->delay_ticks <= INCISE_STABILITY_DELAY_MAX;
}

/* (δ - 1 + e^-δ)/δ², where the difference would lose digits by its series. */
static double held_position(double delta)
{
	double term = 0.5, sum = 0;

	if (delta > 1)
		return (delta + expm1(-delta)) / (delta * delta);
	for (int n = 3; fabs(term) > 1e-18; n++) {
		sum += term;
		term *= -delta / n;
	}
	return sum;
}

static void loop_init(struct loop *loop, double delta, double beta, int delay)
{
	loop->decay = -expm1(-delta);
	loop->a = delta > 0 ? loop->decay / delta : 1;
	loop->c = held_position(delta);
	loop->beta = beta;
	loop->delay = delay;
}

/* z - 1 on the unit circle, to all digits for small angles too. */
static double complex less_one(double theta)
{
	double half = sin(theta / 2);

	return CMPLX(-2 * half * half, sin(theta));
}

/* c z + a² - c p */
static double complex gain(const struct loop *loop, double complex less)
{
	return loop->c * less + loop->c * loop->decay + loop->a * loop->a;
}

/* κ of the angle. */
static double complex stiffness(const struct loop *loop, double theta)
{
	double complex less = less_one(theta);
	double complex late = cexp(CMPLX(0, loop->delay * theta));

	return -late * less * (less + loop->decay) / gain(loop, less) -
	       loop->beta * less / (1 + less);
}

/* β of the angle where there is no stiffness: z^(d+1) (z-p) + β (c z + a² - c p) = 0. */
static double complex damping(const struct loop *loop, double theta)
{
	double complex less = less_one(theta);
	double complex late = cexp(CMPLX(0, (loop->delay + 1) * theta));

	return -late * (less + loop->decay) / gain(loop, less);
}

static double imaginary(locus *f, const struct loop *loop, double theta)
{
	return cimag(f(loop, theta));
}

/* Bisection in the angle, down to neighbouring numbers. */
static double crossing(locus *f, const struct loop *loop, double lo, double hi)
{
	bool below = imaginary(f, loop, lo) < 0;

	for (int i = 0; i < 100; i++) {
		double mid = (lo + hi) / 2;

		if (mid <= lo || mid >= hi)
			break;
		if ((imaginary(f, loop, mid) < 0) == below)
			lo = mid;
		else
			hi = mid;
	}
	return creal(f(loop, hi));
}

/* The angle within where the imaginary part comes nearest to 0; it has one sign at both
 * ends and in the middle. */
static double nearest(locus *f, const struct loop *loop, double lo, double hi)
{
	const double golden = 0.6180339887498949;

	for (int i = 0; i < 40; i++) {
		double l = hi - golden * (hi - lo), r = lo + golden * (hi - lo);

		if (fabs(imaginary(f, loop, l)) < fabs(imaginary(f, loop, r)))
			hi = r;
		else
			lo = l;
	}
	return (lo + hi) / 2;
}

/* Angles: by equal steps, by equal factors towards 0 and towards π. */
#define SMALLEST 1e-9
#define FACTORS 400
#define HALVINGS 24
#define STEPS_PER_TICK 48

static double angle(int i, int steps)
{
	double step = M_PI / steps;

	if (i < FACTORS)
		return SMALLEST * pow(step / SMALLEST, (double)i / FACTORS);
	if (i < FACTORS + steps - 1)
		return step * (i - FACTORS + 1);
	return M_PI - ldexp(step, -(i - FACTORS - steps + 2));
}

/* The lesser of two values, of which those that are not positive do not count. */
static double lesser(double least, double value)
{
	return value > 0 ? fmin(least, value) : least;
}

/* The least positive value of the function where it is real; infinite without any. */
static double least_real(locus *f, const struct loop *loop)
{
	int steps = STEPS_PER_TICK * (loop->delay + 2), n = FACTORS + steps + HALVINGS;
	double at[3] = {0}, im[3] = {0}, least;

	/* At z = -1 it is real, but for rounding: not a change of sign. */
	least = lesser(INFINITY, creal(f(loop, M_PI)));
	for (int i = 0; i < n; i++) {
		at[0] = at[1], im[0] = im[1];
		at[1] = at[2], im[1] = im[2];
		at[2] = angle(i, steps);
		im[2] = imaginary(f, loop, at[2]);
		if (i > 0 && (im[2] < 0) != (im[1] < 0)) {
			least = lesser(least, crossing(f, loop, at[1], at[2]));
		} else if (i > 1 && (im[1] < 0) == (im[0] < 0) &&
			   fabs(im[1]) < fabs(im[0]) && fabs(im[1]) < fabs(im[2])) {
			/* Perhaps it crosses twice between the angles looked at. */
			double middle = nearest(f, loop, at[0], at[2]);

			if ((imaginary(f, loop, middle) < 0) == (im[1] < 0))
				continue;
			least = lesser(least, crossing(f, loop, at[0], middle));
			least = lesser(least, crossing(f, loop, middle, at[2]));
		}
	}
	return least;
}

static double complex against(const struct loop *loop, double theta)
{
	return -damping(loop, theta);
}

/* Whether the softest of walls is stable: b + B takes energy, and B alone does not hum. */
static bool soft_is_stable(const struct loop *loop, double delta)
{
	if (!(delta + loop->beta > 0))
		return false;
	if (loop->beta == 0)
		return true;
	return fabs(loop->beta) < least_real(loop->beta > 0 ? damping : against, loop);
}

double incise_stability_limit(const struct incise_haptic_device *d, double damping_N_s_mm)
{
	double m = d->mass_kg * N_S2_PER_MM_KG, T = d->period_s, delta, beta, kappa;
	struct loop loop;

	if (!valid(d) || !isfinite(damping_N_s_mm))
		return 0;
	delta = d->damping_N_s_mm * T / m;
	beta = damping_N_s_mm * T / m;
	if (!isfinite(delta) || !isfinite(beta))
		return 0;
	loop_init(&loop, delta, beta, d->delay_ticks);
	if (!soft_is_stable(&loop, delta))
		return 0;
	kappa = least_real(stiffness, &loop);
	return isfinite(kappa) ? kappa * m / (T * T) : 0;
}

/* Mean delay of the held force. */
static double lag_s(const struct incise_haptic_device *d)
{
	return d->period_s * (0.5 + d->delay_ticks);
}

double incise_stability_colgate(const struct incise_haptic_device *d,
				double damping_N_s_mm)
{
	return valid(d) ? fmax(0, (d->damping_N_s_mm - fabs(damping_N_s_mm)) / lag_s(d))
			: 0;
}

double incise_stability_quantisation(const struct incise_haptic_device *d)
{
	double sampled;

	if (!valid(d))
		return 0;
	sampled = 2 * d->damping_N_s_mm / d->period_s;
	return d->encoder_mm > 0 ? fmin(sampled, 2 * d->coulomb_N / d->encoder_mm)
				 : sampled;
}
