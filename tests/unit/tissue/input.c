// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Inputs of a model in double and in integers: what they are by definition, integers against double, and
 * numbers at their ends.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "stage_kinds.h"

#define CASES 20000
#define HELD (INT32_MAX * 0x1p-16)

static uint64_t seed = 1;

/* Uniform in -1 … 1. */
static double any(void)
{
	incise_random_step(&seed);
	return (double)(seed >> 11) * 0x1p-52 - 1;
}

/* What both kinds say, of the same numbers: those that integers have. */
struct both {
	double exact, integer;
};

static struct both acceleration(const double v[3], const double a[3])
{
	double exact_v[3], exact_a[3];
	int32_t velocity[3];
	int64_t hard[3];

	SET_ALL(velocity, v, 16);
	SET_ALL(hard, a, 16);
	GET_ALL(exact_v, velocity, 16);
	GET_ALL(exact_a, hard, 16);
	return (struct both){incise_double_input_acceleration(exact_v, exact_a),
			     GET(incise_fixed_input_acceleration(velocity, hard), 16)};
}

static struct both tilt(const double u[3], const double n[3])
{
	double exact_u[3], exact_n[3];
	int32_t axis[3], normal[3];

	SET_ALL(axis, u, 30);
	SET_ALL(normal, n, 30);
	GET_ALL(exact_u, axis, 30);
	GET_ALL(exact_n, normal, 30);
	return (struct both){incise_double_input_tilt(exact_u, exact_n),
			     GET(incise_fixed_input_tilt(axis, normal), 16)};
}

static void assert_acceleration(struct both found)
{
	assert_true(fabs(found.integer - found.exact) <=
		    ldexp(1, -INCISE_FIXED_INPUT_ACCELERATION_BITS) +
			    ldexp(fabs(found.exact),
				  -INCISE_FIXED_INPUT_ACCELERATION_SHARE_BITS));
}

/* A unit vector of integers is off by less than 2^-29. */
static void assert_tilt(struct both found)
{
	assert_true(fabs(found.integer - found.exact) <
		    INCISE_FIXED_INPUT_TILT_DEG + ldexp(180 / M_PI, -26));
}

/* d|v|/dt of a motion; below 5 mm/s less, without a leap. */
TEST(acceleration_is_that_of_the_speed)
{
	double last = 0;

	for (int k = -2000; k <= 2000; k++) {
		struct both found =
			acceleration((double[]){0.005 * k, 0, 0}, (double[]){300, 50, 0});

		assert_acceleration(found);
		if (k <= -1000 || k >= 1000)
			assert_true(fabs(found.exact - (k < 0 ? -300 : 300)) < 1e-9);
		assert_true(k == -2000 || fabs(found.exact - last) < 0.31);
		last = found.exact;
	}
	assert_true(acceleration((double[]){3, 4, 0}, (double[]){4, -3, 9}).exact == 0);
	for (int k = 0; k < CASES; k++) {
		double size = pow(10, 2 + 2 * any()), v[3], a[3];

		for (int i = 0; i < 3; i++) {
			v[i] = size * any() / 2;
			a[i] = 9000 * any();
		}
		assert_acceleration(acceleration(v, a));
	}
	/* Beyond what 32 bits hold. */
	assert_true(acceleration((double[]){1e4, 1e4, 1e4}, (double[]){1e5, 1e5, 1e5})
			    .integer == HELD);
	assert_true(
		acceleration((double[]){-1e4, 0, 0}, (double[]){1e5, 1e5, 0}).integer ==
		-HELD);
	assert_true(acceleration((double[3]){0}, (double[3]){0}).integer == 0);
}

static void any_unit(double unit[3])
{
	do
		for (int i = 0; i < 3; i++)
			unit[i] = any();
	while (!v3_unit(unit, unit, 1e-3));
}

TEST(tilt_is_the_angle)
{
	for (int k = 0; k <= 180; k++) {
		double turn = k * M_PI / 180;
		struct both found =
			tilt((double[]){0, sin(turn), cos(turn)}, (double[]){0, 0, 1});

		/* Of axes in Q30. */
		assert_true(fabs(found.exact - k) < 1e-7);
		assert_tilt(found);
	}
	for (int k = 0; k < CASES; k++) {
		double axis[3], normal[3];

		any_unit(axis);
		any_unit(normal);
		/* Also almost along each other, either way. */
		for (int i = 0; k % 4 == 0 && i < 3; i++)
			normal[i] = k % 8 ? axis[i] : -axis[i];
		if (k % 4 == 0)
			normal[k % 3] += ldexp(k % 1000, -30);
		assert_tilt(tilt(axis, normal));
	}
	for (int i = 0; i < 3; i++) {
		double along[3] = {0}, across[3] = {0}, against[3] = {0};

		along[i] = across[(i + 1) % 3] = 1;
		against[i] = -1;
		assert_true(tilt(along, along).integer == 0);
		assert_true(tilt(along, across).integer == 90);
		assert_true(tilt(along, against).integer == 180);
	}
}

TEST(time_is_held)
{
	static const struct {
		int64_t t_ns, from_ns;
		double exact, integer;
	} cases[] = {
		{5, 5, 0, 0},
		{1500000000, 0, 1.5, 1.5},
		{INT64_MAX, INT64_MIN, UINT64_MAX * 1e-9, HELD},
		{INT64_MAX, 0, INT64_MAX * 1e-9, HELD},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int64_t t_ns = cases[i].t_ns, from_ns = cases[i].from_ns;

		assert_true(fabs(incise_double_input_time(t_ns, from_ns) -
				 cases[i].exact) <= 1e-15 * cases[i].exact);
		assert_true(GET(incise_fixed_input_time(t_ns, from_ns), 16) ==
			    cases[i].integer);
	}
	/* No time is below 0. */
	assert_int_equal(incise_fixed_input_time(4, 5), 0);
	assert_int_equal(incise_fixed_input_time(INT64_MIN, INT64_MAX), 0);
}
