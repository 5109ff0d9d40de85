// SPDX-License-Identifier: GPL-2.0-or-later
/* Inputs of a model in integers against those in double; and numbers at their ends. */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/control/model_input.h"
#include "../../../lib/fixed/input.h"
#include "../../../lib/fixed/vector.h"

#define CASES 20000
#define ONE 65536.0
#define UNIT 1073741824.0

static uint64_t seed = 1;

/* Uniform in -1 … 1. */
static double any(void)
{
	incise_random_step(&seed);
	return (double)(seed >> 11) * 0x1p-52 - 1;
}

TEST(acceleration_is_that_in_double)
{
	for (int k = 0; k < CASES; k++) {
		double size = pow(10, 2 + 2 * any()), v[3], a[3];
		int32_t velocity[3];
		int64_t hard[3];

		for (int i = 0; i < 3; i++) {
			velocity[i] = (int32_t)lrint(size * any() / 2 * ONE);
			hard[i] = llrint(9000 * any() * ONE);
			v[i] = velocity[i] / ONE;
			a[i] = (double)hard[i] / ONE;
		}
		assert_true(fabs(incise_fixed_input_acceleration(velocity, hard) / ONE -
				 incise_double_input_acceleration(v, a)) <=
			    ldexp(1, -INCISE_FIXED_INPUT_ACCELERATION_BITS) +
				    ldexp(fabs(incise_double_input_acceleration(v, a)),
					  -INCISE_FIXED_INPUT_ACCELERATION_SHARE_BITS));
	}
	/* Beyond what 32 bits hold. */
	assert_int_equal(incise_fixed_input_acceleration(
				 (int32_t[]){655360000, 655360000, 655360000},
				 (int64_t[]){6553600000, 6553600000, 6553600000}),
			 INT32_MAX);
	assert_int_equal(
		incise_fixed_input_acceleration((int32_t[]){-655360000, 0, 0},
						(int64_t[]){6553600000, 6553600000, 0}),
		-INT32_MAX);
	assert_int_equal(
		incise_fixed_input_acceleration((int32_t[3]){0}, (int64_t[3]){0}), 0);
}

static void any_unit(int32_t to[3], double unit[3])
{
	int64_t wide[3];

	for (int i = 0; i < 3; i++)
		wide[i] = llrint(any() * UNIT);
	if (!incise_fx_unit(to, wide, 3, 1 << 20))
		to[0] = INCISE_FIXED_UNIT, to[1] = to[2] = 0;
	for (int i = 0; i < 3; i++)
		unit[i] = to[i] / UNIT;
}

TEST(tilt_is_that_in_double)
{
	const double as_it_is[] = {1, 0, 0, 0};

	for (int k = 0; k < CASES; k++) {
		int32_t axis[3], normal[3];
		double u[3], n[3];

		any_unit(axis, u);
		any_unit(normal, n);
		/* Also almost along each other, either way. */
		for (int i = 0; k % 4 == 0 && i < 3; i++)
			normal[i] = k % 8 ? axis[i] : -axis[i];
		if (k % 4 == 0) {
			normal[k % 3] += k % 1000;
			for (int i = 0; i < 3; i++)
				n[i] = normal[i] / UNIT;
		}
		assert_true(fabs(incise_fixed_input_tilt(axis, normal) / ONE -
				 incise_input_tilt_deg(as_it_is, u, n)) <
			    INCISE_FIXED_INPUT_TILT_DEG + ldexp(180 / M_PI, -26));
	}
	for (int i = 0; i < 3; i++) {
		int32_t along[3] = {0}, across[3] = {0}, against[3] = {0};

		along[i] = INCISE_FIXED_UNIT;
		against[i] = -INCISE_FIXED_UNIT;
		across[(i + 1) % 3] = INCISE_FIXED_UNIT;
		assert_int_equal(incise_fixed_input_tilt(along, along), 0);
		assert_int_equal(incise_fixed_input_tilt(along, across), 90 * 65536);
		assert_int_equal(incise_fixed_input_tilt(along, against), 180 * 65536);
	}
}

TEST(time_is_held)
{
	assert_int_equal(incise_fixed_input_time(5, 5), 0);
	assert_int_equal(incise_fixed_input_time(4, 5), 0);
	assert_int_equal(incise_fixed_input_time(INT64_MIN, INT64_MAX), 0);
	assert_int_equal(incise_fixed_input_time(1500000000, 0), 98304);
	assert_int_equal(incise_fixed_input_time(INT64_MAX, INT64_MIN), INT32_MAX);
	assert_int_equal(incise_fixed_input_time(INT64_MAX, 0), INT32_MAX);
}
