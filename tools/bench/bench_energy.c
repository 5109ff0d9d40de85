// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Energy of a sampled wall, simulated and computed; see bench_energy.h.
 */
#include <math.h>
#include <stddef.h>
#include "../../lib/control/plant.h"
#include "../../lib/control/stability.h"
#include "bench_device.h"
#include "bench_energy.h"
#include "../cli/cli.h"

#define N(array) (sizeof(array) / sizeof(*(array)))

/* ---- Coulomb friction: the amplitude that neither grows nor dies ---- */

/* Whether an oscillation at a sampled spring grows. It begins at rest, some part of a
 * period before the next sample. */
static bool swing_grows(const struct incise_haptic_device *d, double K, double start,
			double phase)
{
	struct incise_plant plant = {.mass_kg = d->mass_kg,
				     .damping_N_s_mm = d->damping_N_s_mm,
				     .coulomb_N = d->coulomb_N,
				     .position_mm = start};
	double omega = sqrt(K / DEVICE);

	incise_plant_step(&plant, -K * start, phase * d->period_s);
	/* By then the slowest case below has grown or died e^20 times. */
	for (int k = 0; k < 2000000; k++) {
		double x = plant.position_mm, v = plant.velocity_mm_s / omega;
		double norm = x * x + v * v;

		if (norm > 4 * start * start)
			return true;
		if (norm < start * start / 4)
			return false;
		incise_plant_step(&plant, -K * x, d->period_s);
	}
	return false;
}

static double swing_limit(const struct incise_haptic_device *d, double K, double phase)
{
	double lo = 1e-3, hi = 1e-3;

	while (!swing_grows(d, K, hi, phase)) {
		lo = hi;
		hi *= 2;
		if (hi > 1e9)
			return INFINITY;
	}
	while (hi > lo * 1.001) {
		double mid = sqrt(lo * hi);

		if (swing_grows(d, K, mid, phase))
			hi = mid;
		else
			lo = mid;
	}
	return sqrt(lo * hi);
}

void bench_amplitude(struct ratios *ratios, bool quick)
{
	static const double angles[] = {0.1, 0.2, 0.32, 0.02, 0.05, 0.14, 0.26};
	static const double parts[] = {0, 0.5}; /* of K T/2 that viscous friction takes */
	const int phases = quick ? 2 : 4;

	for (size_t b = 0; b < (quick ? 1 : N(parts)); b++)
		for (size_t i = 0; i < (quick ? 3 : N(angles)); i++) {
			double omega = angles[i] / PERIOD_S, K = omega * omega * DEVICE;
			struct incise_haptic_device d = {.mass_kg = DEVICE_KG,
							 .damping_N_s_mm = parts[b] * K *
									   PERIOD_S / 2,
							 .coulomb_N = 0.05,
							 .period_s = PERIOD_S};
			double sum = 0;

			for (int p = 0; p < phases; p++) {
				cli_progress("amplitude: wT %g", angles[i]);
				sum += swing_limit(&d, K, (double)p / phases);
			}
			ratios_add(ratios,
				   (struct ratio){{angles[i], parts[b]},
						  sum / phases,
						  incise_stability_amplitude(&d, K),
						  false});
		}
}

/* ---- an encoder's steps ---- */

/* The stiffness at which a hand that goes to and fro by @way in each tick, about @centre,
 * gets as much energy as friction takes. */
static double shaken(const struct incise_haptic_device *d, double way, double centre)
{
	const int ticks = 1000;
	double made = 0, taken = 0;

	for (int k = 0; k < ticks; k++) {
		double side = k % 2 ? 0.5 : -0.5, x = centre + side * way;
		double next = centre - side * way;
		/* For a stiffness of 1: all is proportional to it. */
		double force = -floor(x / d->encoder_mm) * d->encoder_mm;

		made += force * (next - x);
		taken += d->coulomb_N * fabs(next - x) +
			 d->damping_N_s_mm * (next - x) * (next - x) / d->period_s;
	}
	return made > 0 ? taken / made : INFINITY;
}

void bench_quantisation(struct ratios *ratios, bool quick)
{
	/* Coulomb friction decides, then viscous friction, then both alike. */
	static const struct {
		double b_N_s_mm, c_N, encoder_mm;
	} cases[] = {{0.05, 0.05, 0.01},
		     {0.005, 0.2, 0.01},
		     {0.01, 0.1, 0.01},
		     {0.05, 0.01, 0.03},
		     {0.001, 0.1, 0.001}};
	const int centres = quick ? 9 : 33;

	for (size_t i = 0; i < N(cases); i++) {
		struct incise_haptic_device d = {.mass_kg = DEVICE_KG,
						 .damping_N_s_mm = cases[i].b_N_s_mm,
						 .coulomb_N = cases[i].c_N,
						 .encoder_mm = cases[i].encoder_mm,
						 .period_s = PERIOD_S};
		double lowest = INFINITY, at = 0;

		cli_progress("quantisation: %zu", i + 1);
		for (double steps = 1e-6; steps < 1e5; steps *= 1.2)
			for (int c = 0; c < centres; c++) {
				double way = steps * d.encoder_mm;
				double K =
					shaken(&d, way, c * d.encoder_mm / (centres - 1));

				if (K < lowest) {
					lowest = K;
					at = way;
				}
			}
		ratios_add(ratios, (struct ratio){{cases[i].b_N_s_mm, cases[i].c_N,
						   cases[i].encoder_mm, at},
						  lowest,
						  incise_stability_quantisation(&d),
						  false});
	}
}

/* ---- the leak of a press ---- */

/* Energy given to a hand that goes in to @depth at one speed and out again; contact comes
 * @phase of a period before a sample. */
static double pressed(double K, double speed, double depth, double phase)
{
	double turn = depth / speed, made = 0, force = 0, was = 0, t = phase * PERIOD_S;

	/* Until the last held force was taken back outside. */
	for (bool out = false; !out; t += PERIOD_S) {
		double x = t < turn ? -speed * t : -2 * depth + speed * t;

		made += force * (x - was);
		out = x >= 0 && t > turn;
		force = x < 0 ? -K * x : 0;
		was = x;
	}
	return made;
}

void bench_leak(struct ratios *ratios, bool quick)
{
	static const struct {
		double K_N_mm, u_mm_s, X_mm;
	} cases[] = {{1, 20, 2}, {10, 50, 3}, {5, 200, 10}, {50, 10, 1}};
	const int phases = quick ? 32 : 256;

	for (size_t i = 0; i < N(cases); i++) {
		double K = cases[i].K_N_mm, u = cases[i].u_mm_s, X = cases[i].X_mm,
		       sum = 0;
		struct incise_haptic_device d = {.mass_kg = DEVICE_KG,
						 .period_s = PERIOD_S};

		for (int p = 0; p < phases; p++)
			sum += pressed(K, u, X, (p + 0.5) / phases);
		ratios_add(ratios, (struct ratio){{K, u, X},
						  sum / phases,
						  incise_stability_leak(&d, K, u, X),
						  false});
	}
}

/* ---- break-even of a bounce ---- */

/* Speed after a bounce, squared, as part of that before; mean over where between two
 * samples the contact begins. */
static double bounced(double K, double damping, int phases)
{
	double sum = 0;

	for (int p = 0; p < phases; p++) {
		struct incise_plant plant = {.mass_kg = DEVICE_KG,
					     .damping_N_s_mm = damping,
					     .velocity_mm_s = -100};

		/* Damping acts within the contact: before it there is none, and the last
		 * step outside is a part of what sampling does. */
		incise_plant_step(&plant, 0, (p + 0.5) / phases * PERIOD_S);
		for (int k = 0; k < 1000000 && plant.position_mm < 0; k++)
			incise_plant_step(&plant, -K * plant.position_mm, PERIOD_S);
		sum += plant.velocity_mm_s * plant.velocity_mm_s / 1e4;
	}
	return sum / phases;
}

void bench_break_even(struct ratios *ratios, bool quick)
{
	static const double angles[] = {0.05, 0.02, 0.01};
	const int phases = quick ? 16 : 64;

	for (size_t i = 0; i < N(angles); i++) {
		double omega = angles[i] / PERIOD_S, K = omega * omega * DEVICE;
		double lo = 0, hi = 10 * K * PERIOD_S;

		cli_progress("break-even: wT %g", angles[i]);
		while (hi - lo > 1e-4 * hi) {
			double mid = (lo + hi) / 2;

			if (bounced(K, mid, phases) > 1)
				lo = mid;
			else
				hi = mid;
		}
		ratios_add(ratios, (struct ratio){{angles[i], K},
						  (lo + hi) / 2,
						  K * PERIOD_S / 2,
						  false});
	}
}
