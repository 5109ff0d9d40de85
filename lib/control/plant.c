// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A mass with friction in front of a wall, exactly; see incise/plant.h.
 *
 * A piece is the time between two events. In it, with u the way since its begin,
 *
 *   u'' + 2a u' + ω² u = A,   u = v0 s + A q,   u' = v0 s' + A s
 *
 * where s(t) answers a push and q(t) is its integral. s and q have three forms: a series
 * where the time is short, for q is a difference of nearly equal numbers there; sines; and
 * exponentials in which nothing is subtracted that could be equal.
 */
#include <math.h>
#include "plant.h"
#include "../base/units.h"

#define EVENTS_MAX 1000000

struct piece {
	double half_rate; /* a */
	double omega2;
	double v0, push;    /* A */
	double slow, apart; /* rates when overdamped: slow and slow + apart */
	double nu;	    /* angular frequency when underdamped, else 0 */
};

struct answer {
	double ds, s, q; /* s', s, ∫s */
};

static void piece_rates(struct piece *p)
{
	double disc = p->half_rate * p->half_rate - p->omega2;

	p->nu = disc < 0 ? sqrt(-disc) : 0;
	if (disc >= 0) {
		double root = sqrt(disc), fast = p->half_rate + root;

		/* a - √disc without its cancellation. */
		p->slow = fast > 0 ? p->omega2 / fast : 0;
		p->apart = 2 * root;
	}
}

/* (1 - e^-rt)/r */
static double saturating(double rate, double t)
{
	return rate > 0 ? -expm1(-rate * t) / rate : t;
}

static struct answer series(const struct piece *p, double t)
{
	/* Terms of s: derivative n times tⁿ/n!. */
	double term = t, before = 0;
	struct answer r = {1, t, t * t / 2};

	for (int n = 2; n < 40; n++) {
		double next = -(2 * p->half_rate * t * term +
				p->omega2 * t * t * before / (n - 1)) /
			      n;

		r.s += next;
		r.ds += next * n / t;
		r.q += next * t / (n + 1);
		/* Two in a row: without damping every other one is 0. */
		if (fabs(next) + fabs(term) < 1e-19 * t)
			break;
		before = term;
		term = next;
	}
	return r;
}

static struct answer respond(const struct piece *p, double t)
{
	double a = p->half_rate, fade;
	struct answer r;

	if (t == 0)
		return (struct answer){1, 0, 0};
	if ((2 * a + sqrt(p->omega2)) * t < 1)
		return series(p, t);
	if (p->nu > 0) {
		fade = exp(-a * t);
		r.s = fade * sin(p->nu * t) / p->nu;
		r.ds = fade * cos(p->nu * t) - a * r.s;
		r.q = (1 - r.ds - 2 * a * r.s) / p->omega2;
		return r;
	}
	fade = exp(-p->slow * t);
	r.s = fade * saturating(p->apart, t);
	r.ds = fade * exp(-p->apart * t) - p->slow * r.s;
	if (p->slow < p->apart)
		r.q = (saturating(p->slow, t) - saturating(p->slow + p->apart, t)) /
		      p->apart;
	else
		r.q = (1 - r.ds - 2 * a * r.s) / p->omega2;
	return r;
}

/* When the velocity becomes 0, after the begin; infinite when it does not. */
static double turn_plant(const struct piece *p)
{
	if (p->nu > 0) {
		double across = (p->push - p->half_rate * p->v0) / p->nu;

		if (p->v0 == 0)
			return M_PI / p->nu;
		return atan2(fabs(p->v0), p->v0 < 0 ? across : -across) / p->nu;
	} else {
		double fast = p->slow + p->apart, against = fast * p->v0 - p->push;
		double part = p->v0 / against; /* of 1/apart: (1 - e^-apart·t)/apart */

		if (p->v0 == 0 || !(part > 0) || !(part * p->apart < 1))
			return INFINITY;
		return p->apart > 0 ? -log1p(-part * p->apart) / p->apart : part;
	}
}

static double way(const struct piece *p, double t)
{
	struct answer r = respond(p, t);

	return p->v0 * r.s + p->push * r.q;
}

/* When the way is @distance: it is monotone up to @end, and further there. */
static double meeting(const struct piece *p, double distance, double end)
{
	double lo = 0, hi = end, t = end / 2;

	for (int i = 0; i < 200; i++) {
		struct answer r = respond(p, t);
		double off = p->v0 * r.s + p->push * r.q - distance, next;

		/* Beyond it, in the direction of the motion. */
		if ((off < 0) == (distance < 0) || off == 0)
			hi = t;
		else
			lo = t;
		next = t - off / (p->v0 * r.ds + p->push * r.s);
		if (!(next > lo && next < hi))
			next = (lo + hi) / 2;
		if (off == 0 || next == t || next <= lo || next >= hi)
			break;
		t = next;
	}
	return hi;
}

/* Whether the wall is felt from now on. */
static bool touches(const struct incise_plant *plant, double force_N)
{
	double x = plant->position_mm, v = plant->velocity_mm_s;

	if (plant->wall_N_mm == 0 && plant->wall_N_s_mm == 0)
		return false;
	if (plant->tied || x != plant->wall_mm)
		return plant->tied || x < plant->wall_mm;
	return v < 0 || (v == 0 && force_N < 0);
}

/* One piece; returns the time it took, at most @left. */
static double go_plant(struct incise_plant *plant, double force_N, double left)
{
	bool touching = touches(plant, force_N), turns, meets;
	double m = plant->mass_kg * N_S2_PER_MM_KG, x = plant->position_mm;
	double stiffness = touching ? plant->wall_N_mm : 0, t, end, to_wall;
	double damping = plant->damping_N_s_mm + (touching ? plant->wall_N_s_mm : 0);
	double drive = touching ? force_N - stiffness * (x - plant->wall_mm) : force_N;
	double sliding = plant->velocity_mm_s != 0 ? plant->velocity_mm_s : drive;
	struct piece p = {.half_rate = damping / (2 * m), .omega2 = stiffness / m};
	struct answer r;

	/* Held by friction: nothing changes until the force does. */
	if (plant->velocity_mm_s == 0 && fabs(drive) <= plant->coulomb_N)
		return left;
	p.v0 = plant->velocity_mm_s;
	p.push = (drive - copysign(plant->coulomb_N, sliding)) / m;
	piece_rates(&p);
	t = turn_plant(&p);
	turns = t < left;
	end = turns ? t : left;
	/* Without friction that turns and without a wall to meet it is one piece. */
	if (plant->coulomb_N == 0 &&
	    (plant->tied || (plant->wall_N_mm == 0 && plant->wall_N_s_mm == 0))) {
		turns = false;
		end = left;
	}
	to_wall = plant->wall_mm - x;
	meets = !plant->tied && to_wall != 0 && (to_wall < 0) == (sliding < 0) &&
		fabs(way(&p, end)) > fabs(to_wall) &&
		(plant->wall_N_mm > 0 || plant->wall_N_s_mm > 0);
	if (meets) {
		end = meeting(&p, to_wall, end);
		turns = false;
	}
	r = respond(&p, end);
	plant->position_mm = meets ? plant->wall_mm : x + (p.v0 * r.s + p.push * r.q);
	plant->velocity_mm_s = turns ? 0 : p.v0 * r.ds + p.push * r.s;
	return end;
}

static bool valid(const struct incise_plant *p, double force_N, double period_s)
{
	double sum = p->mass_kg + p->damping_N_s_mm + p->coulomb_N + p->wall_N_mm +
		     p->wall_N_s_mm;

	return p->mass_kg > 0 && p->damping_N_s_mm >= 0 && p->coulomb_N >= 0 &&
	       p->wall_N_mm >= 0 && p->wall_N_s_mm >= 0 && isfinite(sum) &&
	       isfinite(force_N) && period_s >= 0 && isfinite(period_s);
}

void incise_plant_step(struct incise_plant *plant, double force_N, double period_s)
{
	double left = period_s;

	if (!valid(plant, force_N, period_s)) {
		plant->position_mm = plant->velocity_mm_s = NAN;
		return;
	}
	for (int i = 0; left > 0 && i < EVENTS_MAX; i++)
		left -= go_plant(plant, force_N, left);
}
