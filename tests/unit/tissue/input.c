// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Inputs of a model in double and in integers: what they are by definition, integers against double, and
 * numbers at their ends.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/tissue/tick.h"
#include "kinds.h"

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

	q16_all(velocity, v);
	from_q16(exact_v, velocity);
	for (int i = 0; i < 3; i++) {
		hard[i] = llrint(a[i] * ONE);
		exact_a[i] = (double)hard[i] / ONE;
	}
	return (struct both){incise_double_input_acceleration(exact_v, exact_a),
			     incise_fixed_input_acceleration(velocity, hard) / ONE};
}

static struct both tilt(const double u[3], const double n[3])
{
	double exact_u[3], exact_n[3];
	int32_t axis[3], normal[3];

	q30_all(axis, u);
	q30_all(normal, n);
	from_q30(exact_u, axis);
	from_q30(exact_n, normal);
	return (struct both){incise_double_input_tilt(exact_u, exact_n),
			     incise_fixed_input_tilt(axis, normal) / ONE};
}

static void assert_acceleration(struct both found)
{
	assert_true(fabs(found.integer - found.exact) <=
		    ldexp(1, -INCISE_FIXED_INPUT_ACCELERATION_BITS) +
			    ldexp(fabs(found.exact),
				  -INCISE_FIXED_INPUT_ACCELERATION_SHARE_BITS));
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

/* In double it is the angle: see lib/tissue/predict.c. */
TEST(tilt_is_that_in_double)
{
	for (int k = 0; k < CASES; k++) {
		double axis[3], normal[3];
		struct both found;

		any_unit(axis);
		any_unit(normal);
		/* Also almost along each other, either way. */
		for (int i = 0; k % 4 == 0 && i < 3; i++)
			normal[i] = k % 8 ? axis[i] : -axis[i];
		if (k % 4 == 0)
			normal[k % 3] += ldexp(k % 1000, -30);
		found = tilt(axis, normal);
		assert_true(fabs(found.integer - found.exact) <
			    INCISE_FIXED_INPUT_TILT_DEG + ldexp(180 / M_PI, -26));
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
	assert_true(incise_double_input_time(1500000000, 0) == 1.5);
	assert_true(incise_double_input_time(INT64_MAX, INT64_MIN) > 1.8e10);
	assert_int_equal(incise_fixed_input_time(5, 5), 0);
	assert_int_equal(incise_fixed_input_time(4, 5), 0);
	assert_int_equal(incise_fixed_input_time(INT64_MIN, INT64_MAX), 0);
	assert_int_equal(incise_fixed_input_time(1500000000, 0), 98304);
	assert_int_equal(incise_fixed_input_time(INT64_MAX, INT64_MIN), INT32_MAX);
	assert_int_equal(incise_fixed_input_time(INT64_MAX, 0), INT32_MAX);
}

static double mean_both(const double *speeds, const int64_t *steps_ns, int n,
			double *integer)
{
	double path = 0, exact = 0;
	int64_t fixed_path = 0, t_ns = -7;

	for (int i = 0; i < n; i++) {
		int32_t speed = (int32_t)lrint(speeds[i] * ONE);

		path = incise_double_input_path(path, speed / ONE, t_ns,
						t_ns + steps_ns[i]);
		fixed_path = incise_fixed_input_path(fixed_path, speed, t_ns,
						     t_ns + steps_ns[i]);
		t_ns += steps_ns[i];
		exact = incise_double_input_mean_speed(path, speed / ONE, -7, t_ns);
		*integer =
			incise_fixed_input_mean_speed(fixed_path, speed, -7, t_ns) / ONE;
	}
	return exact;
}

/* Evenly at any speed it is that speed; else the integers are within their rounding of double. */
TEST(mean_speed_is_path_over_time)
{
	double speeds[40], integer;
	int64_t steps_ns[40];

	for (int k = 0; k < CASES; k++) {
		double size = pow(10, 4 * fabs(any())), exact;
		int64_t step_ns = (int64_t)pow(10, 4.8 + 4.7 * fabs(any()));
		bool even = k % 4 == 0;

		for (int i = 0; i < 40; i++) {
			speeds[i] = even && i ? speeds[0] : size * fabs(any());
			steps_ns[i] = even ? 3000000 : step_ns + k * i;
		}
		exact = mean_both(speeds, steps_ns, 1 + k % 40, &integer);
		assert_true(!even || fabs(exact - speeds[0]) < 1e-4);
		assert_true(
			fabs(integer - exact) <=
			ldexp(1, -16) +
				ldexp(exact, -INCISE_FIXED_INPUT_MEAN_SPEED_SHARE_BITS));
	}
	/* No time; time that goes back; more time and speed than there are. */
	assert_int_equal(incise_fixed_input_mean_speed(0, 99, 5, 5), 99);
	assert_true(incise_double_input_mean_speed(0, 99, 5, 4) == 99);
	assert_true(incise_double_input_path(3, 99, 5, 4) == 3);
	assert_int_equal(incise_fixed_input_path(3, 99, INT64_MAX, INT64_MIN), 3);
	assert_true(incise_fixed_input_path(INT64_MAX / 4, INT32_MAX, INT64_MIN,
					    INT64_MAX) <= (int64_t)1 << 61);
	assert_true(incise_fixed_input_mean_speed((int64_t)1 << 61, 1, INT64_MIN,
						  INT64_MAX) >= 0);
}
