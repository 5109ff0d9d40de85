// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The group actuator.can, lib/rig/actuator.c: each key in its unit, each refusal with its
 * line, and that the gain that csv may have is half of what a loop with that delay holds.
 */
#include "../unit.h"
#include "../../../lib/rig/actuator.h"
#include "actuator_text.h"

TEST(defaults_are_those_of_the_manual)
{
	/* A rig.conf of before there was the group; an empty one; one of other wires. */
	static const char *const cases[] = {
		"",
		"can = { };",
		"lines = { step = 1; dir = 2; }; can = { };",
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_actuator a = actuator_good(NEEDED, cases[i]);

		assert_int_equal(a.can.mode, INCISE_ACTUATOR_CSP);
		assert_int_equal(a.can.bitrate, 0);
		assert_int_equal(a.can.cycle_ns, 1000000);
		assert_true(!a.can.counts_per_turn && !a.can.velocity_per_turn_s &&
			    !a.can.acceleration_per_turn_s2);
		assert_true(a.can.following_mm == 1 && a.can.following_s == 0.05);
		assert_int_equal(a.can.homing_method, 0);
		assert_false(a.can.absolute);
		assert_true(a.can.position_gain_1_s == 20);
		assert_true(!a.can.stiffness_permille_mm && !a.can.damping_permille_s_mm);
		assert_true(!a.can.torque_max_permille);
		assert_int_equal(a.can.master, 127);
		assert_true(a.has_lines == !!strstr(cases[i], "lines"));
		assert_int_equal(a.line[INCISE_LINE_STEP], a.has_lines ? 1 : -1);
	}
}

TEST(following_is_a_tenth_of_the_travel_up_to_a_millimetre)
{
	static const struct {
		double travel_mm, following_mm;
	} cases[] = {{0.1, 0.01}, {5, 0.5}, {10, 1}, {1000, 1}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_actuator a;
		char needed[80];

		snprintf(needed, sizeof(needed),
			 "spring_N_mm = 2; travel_mm = %g; lead_mm = 0.1; ",
			 cases[i].travel_mm);
		a = actuator_good(needed, "microsteps = 1;");
		/* A rounding of the division. */
		assert_true(fabs(a.can.following_mm - cases[i].following_mm) < 1e-12);
	}
}

TEST(every_key_is_taken_in_its_unit)
{
	struct incise_actuator a = actuator_good(
		NEEDED,
		"can = { mode = \"csv\"; bitrate = 500000; cycle_us = 1250;\n"
		"counts_per_turn = 51200; velocity_per_turn_s = 60.0;\n"
		"acceleration_per_turn_s2 = 3600; following_mm = 0.25; following_ms = 20;\n"
		"homing_method = -17; absolute = true; position_gain_1_s = 12.5;\n"
		"stiffness_permille_mm = 40; damping_permille_s_mm = 0.75;\n"
		"torque_max_permille = 300; master = 5; };");

	assert_int_equal(a.can.mode, INCISE_ACTUATOR_CSV);
	assert_int_equal(a.can.bitrate, 500000);
	assert_int_equal(a.can.cycle_ns, 1250000);
	assert_true(a.can.counts_per_turn == 51200 && a.can.velocity_per_turn_s == 60);
	assert_true(a.can.acceleration_per_turn_s2 == 3600);
	assert_true(a.can.following_mm == 0.25 && a.can.following_s == 0.02);
	assert_int_equal(a.can.homing_method, -17);
	assert_true(a.can.absolute && a.can.position_gain_1_s == 12.5);
	assert_true(a.can.stiffness_permille_mm == 40);
	assert_true(a.can.damping_permille_s_mm == 0.75);
	assert_true(a.can.torque_max_permille == 300);
	assert_int_equal(a.can.master, 5);
	a = actuator_good(NEEDED, "can = { mode = \"cst\"; stiffness_permille_mm = 40;\n"
				  "torque_max_permille = 300; };");
	assert_int_equal(a.can.mode, INCISE_ACTUATOR_CST);
	assert_true(a.can.damping_permille_s_mm == 0);
}

TEST(bit_rates_are_those_of_adapters)
{
	static const int good[] = {10000,  20000,  50000,  100000, 125000,
				   250000, 500000, 800000, 1000000};
	static const int bad[] = {1, 9999, 83333, 400000, 999999};
	struct incise_actuator actuator;
	char text[100];

	for (size_t i = 0; i < sizeof(good) / sizeof(*good); i++) {
		snprintf(text, sizeof(text), "can = { bitrate = %d; };", good[i]);
		assert_int_equal(actuator_good(NEEDED, text).can.bitrate, good[i]);
	}
	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		snprintf(text, sizeof(text), "can = { bitrate = %d; };", bad[i]);
		assert_error(actuator_read(&actuator, NEEDED, text, &err), EINVAL, &err,
			     "125000, 250000, 500000");
	}
}

/* Whether a byte times a power of ten of a second is just so many µs. */
static bool fits_60C2(int us)
{
	for (int byte = 1; byte <= 255; byte++)
		for (int unit_us = 1; unit_us <= 1000; unit_us *= 10)
			if (byte * unit_us == us)
				return true;
	return false;
}

TEST(cycles_are_those_that_a_drive_can_keep)
{
	for (int us = 500; us <= 2000; us++) {
		struct incise_actuator actuator;
		char text[100];

		snprintf(text, sizeof(text), "can = { cycle_us = %d; };", us);
		assert_int_equal(actuator_read(&actuator, NEEDED, text, &err),
				 fits_60C2(us) ? 0 : -EINVAL);
	}
}

TEST(what_does_not_fit_is_refused_with_its_line)
{
	static const struct {
		const char *inside, *says;
	} cases[] = {
		{"can = 3;", "r:2: actuator.can:"},
		{"can = {\nspeed = 3; };", "r:3: actuator.can.speed:"},
		{"can = {\nfollowing_um = 3; };", "actuator.can.following_um:"},
		{"can = {\nmode = \"CSP\"; };", "r:3: actuator.can.mode:"},
		{"can = {\nmode = 8; };", "r:3: actuator.can.mode:"},
		{"can = {\nabsolute = 1; };", "r:3: actuator.can.absolute:"},
		{"can = {\ncycle_us = 1005; };", "r:3: actuator.can.cycle_us:"},
		{"can = {\ncycle_us = 1000.5; };", "r:3: actuator.can.cycle_us:"},
		{"can = {\nmode = \"cst\"; };", "r:3: actuator.can.mode:"},
		{"can = { stiffness_permille_mm = 3;\nmode = \"cst\"; };",
		 "torque_max_permille"},
		{"can = { mode = \"csv\";\nposition_gain_1_s = 223; };", "222.5 1/s"},
		/* Twice the cycle, half the gain. */
		{"can = { mode = \"csv\"; cycle_us = 2000;\nposition_gain_1_s = 112; };",
		 "111.2 1/s"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_actuator actuator;

		assert_error(actuator_read(&actuator, NEEDED, cases[i].inside, &err),
			     EINVAL, &err, cases[i].says);
	}
	actuator_good(NEEDED, "can = { mode = \"csv\"; position_gain_1_s = 222.5; };");
	/* It is of csv alone. */
	actuator_good(NEEDED, "can = { position_gain_1_s = 223; };");
}

/*
 * The loop itself, from 1 mm off: x[n+1] = x[n] - k x[n-3]. The largest deviation within
 * the last hundred of @cycles.
 */
static double left_over(double k, int cycles)
{
	double x[4] = {1, 1, 1, 1}, largest = 0; /* x[n] … x[n-3] */

	for (int n = 0; n < cycles; n++) {
		double next = x[0] - k * x[3];

		if (fabs(next) > 1e6)
			return INFINITY;
		memmove(x + 1, x, 3 * sizeof(*x));
		x[0] = next;
		if (n >= cycles - 100)
			largest = fmax(largest, fabs(next));
	}
	return largest;
}

TEST(half_of_the_gain_that_is_stable_is_taken)
{
	static const double cycles_s[] = {0.0005, 0.001, 0.002};
	double low = 0, high = 2;

	/* Where a deviation starts to grow, found by trying. */
	while (high - low > 1e-6) {
		double k = (low + high) / 2;

		if (left_over(k, 200000) < 1)
			low = k;
		else
			high = k;
	}
	for (size_t i = 0; i < sizeof(cycles_s) / sizeof(*cycles_s); i++) {
		double k = incise_actuator_can_gain_1_s(cycles_s[i]) * cycles_s[i];

		/* What grows by less than a factor of 2 in 200 000 cycles is not seen: 4e-6. */
		assert_true(fabs(2 * k - low) < 1e-5);
		/* With half of it a deviation is gone, to a millionth, in 200 cycles. */
		assert_true(left_over(k, 300) < 1e-6);
	}
}
