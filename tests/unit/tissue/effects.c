// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Paper 2's forces: each against its own statement of the formula, written out here by
 * components, and against what the paper's words ask for. Where the print cannot be meant,
 * its formula stands here and shows why.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/tissue/effects.h"

#define CASES 2000
/* Products of three numbers up to 50 and some sums: a dozen roundings of 1e5 · 2^-53. */
#define ROUNDING 1e-9

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double any(double most)
{
	return most * (2.0 * rand() / RAND_MAX - 1);
}

static void any_vector(double v[3], double most)
{
	for (int i = 0; i < 3; i++)
		v[i] = any(most);
}

static void any_unit(double v[3])
{
	double length;

	do {
		any_vector(v, 1);
		length = sqrt(dot(v, v));
	} while (length < 0.1 || length > 1);
	for (int i = 0; i < 3; i++)
		v[i] /= length;
}

static void assert_vector(const double got[3], const double want[3])
{
	for (int i = 0; i < 3; i++)
		assert_true(fabs(got[i] - want[i]) < ROUNDING);
}

/* What the paper prints, with the signs that it prints. */
static void printed_fn(double f[3], double k, const double p[3], const double p0[3],
		       const double sn[3])
{
	double along =
		(p[0] - p0[0]) * sn[0] + (p[1] - p0[1]) * sn[1] + (p[2] - p0[2]) * sn[2];

	for (int i = 0; i < 3; i++)
		f[i] = -k * along * sn[i];
}

/* Fxz = Kxz {[(Q - P) - (Q0 - P0)]·(Q - P)} (Q0 - P0) */
static void printed_fxz(double f[3], double k, const double p[3], const double q[3],
			const double p0[3], const double q0[3])
{
	double brace = 0;

	for (int i = 0; i < 3; i++)
		brace += ((q[i] - p[i]) - (q0[i] - p0[i])) * (q[i] - p[i]);
	for (int i = 0; i < 3; i++)
		f[i] = k * brace * (q0[i] - p0[i]);
}

/* Each adds to what is there already. */
static void test_formulas(void **state)
{
	srand(1);
	for (int c = 0; c < CASES; c++) {
		double was[3], n[3], p[3], p0[3], v[3], got[3], want[3];
		double k = 5 + any(5), size = 5 + any(5), off;

		any_vector(was, 4);
		any_unit(n);
		any_vector(p, 50);
		any_vector(p0, 50);
		any_vector(v, 200);

		memcpy(got, was, sizeof(got));
		incise_effect_reaction(got, size, n);
		for (int i = 0; i < 3; i++)
			want[i] = was[i] + size * n[i];
		assert_vector(got, want);

		/* Fx is printed as it is meant: the same formula as Fn, along Sx(0). */
		memcpy(got, was, sizeof(got));
		incise_effect_plane(got, k, p, p0, n);
		printed_fn(want, k, p, p0, n);
		for (int i = 0; i < 3; i++)
			want[i] += was[i];
		assert_vector(got, want);

		memcpy(got, was, sizeof(got));
		incise_effect_damping(got, k, v);
		for (int i = 0; i < 3; i++)
			want[i] = was[i] - k * v[i];
		assert_vector(got, want);

		/* The matrix I - n nᵀ in full. */
		memcpy(got, was, sizeof(got));
		incise_effect_spread(got, k, p, p0, n);
		for (int i = 0; i < 3; i++) {
			off = 0;
			for (int j = 0; j < 3; j++)
				off += ((i == j) - n[i] * n[j]) * (p[j] - p0[j]);
			want[i] = was[i] - k * off;
		}
		assert_vector(got, want);
	}
}

/* "The user feels greater resistance as the scalpel is penetrated deeper into the skin." */
static void test_reaction_is_outward_and_grows(void **state)
{
	srand(2);
	for (int c = 0; c < CASES; c++) {
		double n[3], last = 0;

		any_unit(n);
		for (double depth = 0; depth < 8; depth += 0.5) {
			double f[3] = {0};

			incise_effect_reaction(f, 0.25 * depth, n);
			assert_true(depth > 0 ? dot(f, n) > last : dot(f, n) == 0);
			last = dot(f, n);
		}
	}
}

/* "A correction force is applied whenever the scalpel drifts from the plane." */
static void test_plane_is_free_within_and_opposes_leaving(void **state)
{
	srand(3);
	for (int c = 0; c < CASES; c++) {
		double side[3], p0[3], way[3], p[3], off = any(5);
		double within[3] = {0}, beside[3] = {0};

		any_unit(side);
		any_vector(p0, 50);
		any_vector(way, 20);
		/* Any way within the plane of the cut. */
		for (int i = 0; i < 3; i++)
			p[i] = p0[i] + way[i] - dot(way, side) * side[i];
		incise_effect_plane(within, 0.3, p, p0, side);
		for (int i = 0; i < 3; i++) {
			assert_true(fabs(within[i]) < ROUNDING);
			p[i] += off * side[i];
		}
		incise_effect_plane(beside, 0.3, p, p0, side);
		assert_true(fabs(dot(beside, side) + 0.3 * off) < ROUNDING);
	}
}

/* As printed, +Kd V, it would drive the blade on: F·v = Kd v² > 0. */
static void test_damping_takes_power(void **state)
{
	srand(4);
	for (int c = 0; c < CASES; c++) {
		double v[3], f[3] = {0};

		any_vector(v, 500);
		incise_effect_damping(f, 0.001 * c, v);
		assert_true(dot(f, v) <= 0);
	}
}

/*
 * "Easily inserted if it is oriented along the cut direction": the flat's normal is then
 * across the cut. Turned by t about the normal of the surface it is aligned +
 * (1 - aligned) |sin t|.
 */
static void test_orientation(void **state)
{
	static const double along[3] = {1, 0, 0};

	for (int a = 0; a <= 10; a++) {
		double aligned = a / 10.0;

		for (int t = -180; t <= 180; t += 5) {
			double flat[3] = {-sin(t * M_PI / 180), cos(t * M_PI / 180), 0};
			double fort = incise_orientation_factor(flat, along, aligned);
			double want = aligned + (1 - aligned) * fabs(sin(t * M_PI / 180));

			assert_true(fort >= aligned && fort <= 1);
			assert_true(fabs(fort - want) < 1e-15);
		}
	}
	/* A product that rounding makes larger than 1 does not. */
	assert_true(incise_orientation_factor((double[]){1 + 1e-12, 0, 0}, along, 0.2) ==
		    1);
}

/* "Proportional to the distance of the instrument from its initial contact position." */
static void test_spread_is_proportional(void **state)
{
	static const double n[3] = {0, 0, 1}, p0[3] = {3, -2, 0};

	for (int i = -50; i <= 50; i++) {
		double p[3] = {3 + 0.06 * i, -2 + 0.08 * i, -4}, f[3] = {0};

		incise_effect_spread(f, 0.4, p, p0, n);
		assert_true(fabs(f[0] + 0.4 * 0.06 * i) < ROUNDING);
		assert_true(fabs(f[1] + 0.4 * 0.08 * i) < ROUNDING);
		/* How deep it is does not count: that is Fy's. */
		assert_true(f[2] == 0);
	}
}

/*
 * The print of Fxz: contact starts on the surface, Q(0) = P(0), so its last factor is 0
 * and the force is zero for ever, wherever the instrument goes. Ours is not.
 */
static void test_printed_spread_is_zero_for_ever(void **state)
{
	static const double n[3] = {0, 0, 1}, p0[3] = {3, -2, 0};
	double f[3], ours[3] = {0}, late[3] = {3, -2, -0.1};

	srand(5);
	for (int c = 0; c < CASES; c++) {
		double p[3] = {any(10), any(10), -fabs(any(10))}, q[3] = {p[0], p[1], 0};

		printed_fxz(f, 0.4, p, q, p0, p0);
		assert_true(f[0] == 0 && f[1] == 0 && f[2] == 0);
	}
	incise_effect_spread(ours, 0.4, (double[]){4, -2, -3}, p0, n);
	assert_true(fabs(ours[0] + 0.4) < ROUNDING);
	/*
	 * Nor would a contact that is seen late save it: 0.1 mm deep at first, 3 mm now, a
	 * force of (3 - 0.1) · 3 · 0.1 along the normal, and none sideways however far it
	 * is pushed.
	 */
	printed_fxz(f, 0.4, (double[]){13, -2, -3}, (double[]){13, -2, 0}, late, p0);
	assert_true(f[0] == 0 && f[1] == 0);
	assert_true(fabs(f[2] - 0.4 * 2.9 * 3 * 0.1) < ROUNDING);
}

/* On a plane the printed depth is ours: P(0) lies in it, whatever the way. */
static void test_printed_depth_on_a_plane(void **state)
{
	srand(6);
	for (int c = 0; c < CASES; c++) {
		double n[3], p0[3], way[3], p[3], depth = 4 + any(4);
		double ours[3] = {0}, printed[3];

		any_unit(n);
		any_vector(p0, 50);
		any_vector(way, 20);
		for (int i = 0; i < 3; i++)
			p[i] = p0[i] + way[i] - dot(way, n) * n[i] - depth * n[i];
		incise_effect_reaction(ours, 0.25 * depth, n);
		printed_fn(printed, 0.25, p, p0, n);
		assert_vector(ours, printed);
	}
}

/*
 * On a neck of 55 mm radius a blade glides 20 mm around without pressing at all. The
 * print takes R (1 - cos(20/55)) = 3.60 mm for its depth, to the outside: it pulls the
 * blade in with 0.90 N. Pressed in by 3 mm there, it still pulls, with 0.15 N, where skin
 * pushes with 0.75 N.
 */
static void test_printed_depth_on_a_sphere_pulls_in(void **state)
{
	static const struct {
		double depth_mm, printed_N, ours_N;
	} cases[] = {{0, -0.899, 0}, {3, -0.149, 0.75}};
	const double r = 55, k = 0.25, turn = 20 / r;
	const double n[3] = {sin(turn), 0, cos(turn)}, p0[3] = {0, 0, r};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		double d = cases[c].depth_mm, printed[3], ours[3] = {0};
		double p[3] = {(r - d) * n[0], 0, (r - d) * n[2]};

		printed_fn(printed, k, p, p0, n);
		incise_effect_reaction(ours, k * d, n);
		print_message("glided 20 mm, %g mm deep: printed %.3f N, ours %.3f N\n",
			      d, dot(printed, n), dot(ours, n));
		/* Half a unit of the last digit written here. */
		assert_true(fabs(dot(printed, n) - cases[c].printed_N) < 5e-4);
		assert_true(fabs(dot(ours, n) - cases[c].ours_N) < ROUNDING);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_formulas),
		cmocka_unit_test(test_reaction_is_outward_and_grows),
		cmocka_unit_test(test_plane_is_free_within_and_opposes_leaving),
		cmocka_unit_test(test_damping_takes_power),
		cmocka_unit_test(test_orientation),
		cmocka_unit_test(test_spread_is_proportional),
		cmocka_unit_test(test_printed_spread_is_zero_for_ever),
		cmocka_unit_test(test_printed_depth_on_a_plane),
		cmocka_unit_test(test_printed_depth_on_a_sphere_pulls_in),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
