// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Integrators of a mass on a spring; see integrators.h.
 */
#include <math.h>
#include "integrators.h"

#define MM_PER_M 1000

static const char *const names[INTEGRATORS] = {"explicit_euler",
					       "semi_implicit_euler",
					       "implicit_euler",
					       "trapezoid",
					       "rk4",
					       "exact_zoh",
					       "plant"};

const char *integrator_name(enum integrator kind)
{
	return names[kind];
}

static double acceleration(const struct integration *in, double x, double v, double f)
{
	return in->push * f - in->omega2 * x - in->rate * v;
}

static void explicit_euler(struct integration *in, double f)
{
	double a = acceleration(in, in->x, in->v, f);

	in->x += in->step_s * in->v;
	in->v += in->step_s * a;
}

static void semi_implicit_euler(struct integration *in, double f)
{
	in->v += in->step_s * acceleration(in, in->x, in->v, f);
	in->x += in->step_s * in->v;
}

static void implicit_euler(struct integration *in, double f)
{
	double h = in->step_s;

	in->v = (in->v + h * (in->push * f - in->omega2 * in->x)) /
		(1 + h * in->rate + h * h * in->omega2);
	in->x += h * in->v;
}

static void trapezoid(struct integration *in, double f)
{
	double h = in->step_s, was = in->v;
	double half = h * in->rate / 2 + h * h * in->omega2 / 4;

	in->v = (in->v * (1 - half) + h * (in->push * f - in->omega2 * in->x)) /
		(1 + half);
	in->x += h * (was + in->v) / 2;
}

static void rk4(struct integration *in, double f)
{
	double h = in->step_s, x = in->x, v = in->v;
	double a1 = acceleration(in, x, v, f), v2 = v + h / 2 * a1;
	double a2 = acceleration(in, x + h / 2 * v, v2, f), v3 = v + h / 2 * a2;
	double a3 = acceleration(in, x + h / 2 * v2, v3, f), v4 = v + h * a3;
	double a4 = acceleration(in, x + h * v3, v4, f);

	in->x += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
	in->v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
}

static void exact_zoh(struct integration *in, double f)
{
	double x = in->x, v = in->v;

	in->x = in->zoh[0][0] * x + in->zoh[0][1] * v + in->zoh[0][2] * f;
	in->v = in->zoh[1][0] * x + in->zoh[1][1] * v + in->zoh[1][2] * f;
}

static void plant(struct integration *in, double f)
{
	incise_plant_step(&in->plant, f, in->step_s);
	in->x = in->plant.position_mm;
	in->v = in->plant.velocity_mm_s;
}

void integration_init(struct integration *in, enum integrator kind,
		      const struct spring *spring, double step_s)
{
	static void (*const steps[INTEGRATORS])(struct integration *,
						double) = {explicit_euler,
							   semi_implicit_euler,
							   implicit_euler,
							   trapezoid,
							   rk4,
							   exact_zoh,
							   plant};
	double omega2 = spring->stiffness_N_m / spring->mass_kg;

	*in = (struct integration){.step_s = step_s,
				   .rate = 2 * spring->ratio * sqrt(omega2),
				   .omega2 = omega2,
				   .push = MM_PER_M / spring->mass_kg,
				   .plant = {.mass_kg = spring->mass_kg,
					     .wall_N_mm =
						     spring->stiffness_N_m / MM_PER_M,
					     .tied = true},
				   .step = steps[kind]};
	in->plant.damping_N_s_mm = in->rate * spring->mass_kg / MM_PER_M;
	/* What a unit of place, of speed and of force become in a step. */
	for (int k = 0; k < 3; k++) {
		struct incise_plant unit = in->plant;

		unit.position_mm = k == 0;
		unit.velocity_mm_s = k == 1;
		incise_plant_step(&unit, k == 2, step_s);
		in->zoh[0][k] = unit.position_mm;
		in->zoh[1][k] = unit.velocity_mm_s;
	}
}

void spring_truth(const struct spring *spring, double force_N, long double t,
		  long double *x, long double *v)
{
	long double omega2 = (long double)spring->stiffness_N_m / spring->mass_kg;
	long double fade = spring->ratio * sqrtl(omega2),
		    nu = sqrtl(omega2 - fade * fade);
	long double rest = (long double)force_N / spring->stiffness_N_m * MM_PER_M;
	long double A = *x - rest, B = (*v + fade * A) / nu;
	long double c = expl(-fade * t) * cosl(nu * t),
		    s = expl(-fade * t) * sinl(nu * t);

	*x = rest + A * c + B * s;
	*v = (B * nu - A * fade) * c - (A * nu + B * fade) * s;
}
