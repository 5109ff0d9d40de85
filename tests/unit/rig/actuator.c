// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/actuator.c: what the group says becomes steps and limits, what does not fit
 * is refused with its line.
 */
#include "../unit.h"
#include "actuator_text.h"
#include "../../../lib/rig/motor.h"

TEST(defaults_are_those_of_the_manual)
{
	struct incise_actuator a = actuator_good("", NEEDED);

	assert_true(a.spring_N_mm == 2 && a.travel_mm == 20 && a.lead_mm == 2);
	assert_true(a.steps_per_turn == 200 && a.microsteps == 16 && !a.invert);
	assert_true(a.velocity_mm_s == 10 && a.acceleration_mm_s2 == 500);
	assert_true(a.jerk_mm_s3 == 0 && a.deadman_s == 0.1 && !a.retract);
	assert_true(a.tick_ns == 250000 && !a.high_ns && !a.low_ns);
	assert_true(a.setup_ns == 5000 && a.hold_ns == 5000 && a.enable_ns == 1000000);
	assert_true(a.home_mm_s == 2 && a.home_mm == 0 && a.origin_mm == 0);
	assert_false(a.has_lines);
	/* Not faster than it goes at all. */
	assert_true(actuator_good("", NEEDED "velocity_mm_s = 0.5;").home_mm_s == 0.5);
}

TEST(every_key_is_taken_in_its_unit)
{
	struct incise_actuator a = actuator_good(
		"",
		"spring_N_mm = 1.5; travel_mm = 12; lead_mm = 4; steps_per_turn = 400;\n"
		"microsteps = 8; invert = true; velocity_mm_s = 7.5;\n"
		"acceleration_mm_s2 = 321.0; jerk_mm_s3 = 1e5; deadman_ms = 50;\n"
		"retract = true; tick_us = 100; high_us = 2.5; low_us = 3.5;\n"
		"setup_us = 20; hold_us = 0; enable_ms = 25; home_mm_s = 1.25;\n"
		"home_mm = -0.5; origin_mm = -33.25;\n"
		"lines = { step = 17; dir = 27; enable = 0; home = 5; estop = 6;\n"
		"active_low = [\"enable\", \"estop\"]; };");

	assert_true(a.spring_N_mm == 1.5 && a.travel_mm == 12 && a.lead_mm == 4);
	assert_true(a.steps_per_turn == 400 && a.microsteps == 8 && a.invert);
	assert_true(a.velocity_mm_s == 7.5 && a.acceleration_mm_s2 == 321);
	assert_true(a.jerk_mm_s3 == 1e5 && a.deadman_s == 0.05 && a.retract);
	assert_true(a.tick_ns == 100000 && a.high_ns == 2500 && a.low_ns == 3500);
	assert_true(a.setup_ns == 20000 && a.hold_ns == 0 && a.enable_ns == 25000000);
	assert_true(a.home_mm_s == 1.25 && a.home_mm == -0.5 && a.origin_mm == -33.25);
	assert_true(a.has_lines && a.line[INCISE_LINE_STEP] == 17);
	assert_true(a.line[INCISE_LINE_DIR] == 27 && a.line[INCISE_LINE_ENABLE] == 0);
	assert_true(a.line[INCISE_LINE_HOME] == 5 && a.line[INCISE_LINE_ESTOP] == 6);
	assert_true(a.line[INCISE_LINE_LIMIT_MIN] == -1 &&
		    a.line[INCISE_LINE_ALARM] == -1);
	assert_int_equal(a.active_low, 1 << INCISE_LINE_ENABLE | 1 << INCISE_LINE_ESTOP);
}

TEST(what_does_not_fit_is_refused_with_its_line)
{
	static const struct {
		const char *inside, *says;
	} cases[] = {
		{"travel_mm = 20.0; lead_mm = 2.0;", "r:1: actuator.spring_N_mm"},
		{"spring_N_mm = 2.0; lead_mm = 2.0;", "actuator.travel_mm"},
		{"spring_N_mm = 2.0; travel_mm = 2.0;", "actuator.lead_mm"},
		/* 200 000 microsteps/s of 0.625 µm. */
		{NEEDED "\nvelocity_mm_s = 126;", "0.000625 to 125 mm/s"},
		{NEEDED "\nencoder = \"counter0/count0\";",
		 "actuator.encoder_counts_per_mm"},
		{NEEDED "\nencoder = \"counter0/count0\"; encoder_counts_per_mm = -400.0;"
			"lost_steps_max = 0;",
		 "actuator.lost_steps_max"},
		{NEEDED "\nacceleration_mm_s2 = 2e6;",
		 "r:3: actuator.acceleration_mm_s2:"},
		/* An average of 256 ticks of 250 µs: 2·500/0.064. */
		{NEEDED "\njerk_mm_s3 = 15000;", "1.578e+04"},
		{NEEDED "\nhome_mm_s = 11;", "r:3: actuator.home_mm_s:"},
		{NEEDED "\nhome_mm = -6;", "-5 to 20"},
		{NEEDED "\nhome_mm = 21;", "-5 to 20"},
		{"spring_N_mm = 2.0; travel_mm = 1000.0; lead_mm = 0.01;\nmicrosteps = 1024;"
		 "steps_per_turn = 100000; velocity_mm_s = 0.001; home_mm_s = 0.001;",
		 "r:2: actuator.travel_mm:"},
		{NEEDED "\nlines = { step = 1; };", "actuator.lines.dir"},
		{NEEDED "\nlines = { step = 1; dir = 1; };", "r:3: actuator.lines.dir:"},
		{NEEDED "\nlines = { step = 1; dir = 2; active_low = [\"home\"]; };",
		 "\"home\""},
		{NEEDED "\nlines = { step = 1; dir = 2; active_low = \"dir\"; };",
		 "active_low"},
		{NEEDED "\nlines = { step = 1; dir = 2; active_low = [1]; };", "\"?\""},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_actuator actuator;

		assert_error(actuator_read(&actuator, "", cases[i].inside, &err), EINVAL,
			     &err, cases[i].says);
	}
	/* One beyond the jerk that is refused is not. */
	actuator_good("", NEEDED "jerk_mm_s3 = 15790.0;");
}

TEST(millimetres_become_steps)
{
	static const struct {
		double mm;
		int32_t steps;
	} cases[] = {
		{0, 0},		{0.000625, 1},	   {10, 16000}, {20, 32000},
		{0.0003124, 0}, {0.0003126, 1},	   {-1, 0},	{1e300, 32000},
		{-INFINITY, 0}, {INFINITY, 32000}, {NAN, 0},
	};
	struct incise_actuator a = actuator_good("", NEEDED "jerk_mm_s3 = 1e5;");
	struct incise_profile_limits limits;

	assert_true(incise_actuator_step_mm(&a) == 0.000625);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(incise_actuator_steps(&a, cases[i].mm), cases[i].steps);
	assert_int_equal(incise_actuator_rate(&a, 5), 8000);
	assert_int_equal(incise_actuator_rate(&a, -1e9), -16000);
	assert_int_equal(incise_actuator_rate(&a, NAN), 0);
	incise_actuator_limits(&a, &limits);
	assert_int_equal(limits.velocity, 16000);
	assert_int_equal(limits.acceleration, 800000);
	assert_int_equal(limits.jerk, 160000000);
	assert_int_equal(limits.position_min, 0);
	assert_int_equal(limits.position_max, 32000);
	assert_int_equal(limits.tick_ns, 250000);
	/* Whole steps that a quotient of decimals would lose: 0.3 mm at 0.1 mm each. */
	a.lead_mm = 0.1;
	a.steps_per_turn = a.microsteps = 1;
	a.travel_mm = 0.3;
	assert_int_equal(incise_actuator_steps(&a, 0.3), 3);
}

TEST(the_machine_must_hold_the_rate)
{
	struct incise_actuator a = actuator_good("", NEEDED);
	struct incise_stepper_config config;

	/* 16 000 steps/s asked, and pulses that are not given become the shortest. */
	assert_int_equal(incise_motor_fit(&a, "m", 16000, 8000, 0, &err), 0);
	assert_true(a.high_ns == 8000 && a.low_ns == 8000);
	incise_motor_config(&a, 3, &config);
	assert_true(config.motor == 3 && config.velocity == 16000 &&
		    config.high_ns == 8000);
	assert_true(config.deadman_ns == 100000000 && config.position_max == 32000);
	/* 0.2 mm of 0.625 µm; with a steep screw four whole steps of 16. */
	assert_int_equal(config.lost_steps_max, 320);
	a = actuator_good("", "spring_N_mm = 2.0; travel_mm = 20.0; lead_mm = 40.0;");
	assert_int_equal(a.lost_steps_max, 64);
	a = actuator_good("", NEEDED);
	assert_int_equal(incise_motor_fit(&a, "m", 20000, 100, 0, &err), 0);
	assert_true(a.high_ns == 5000 && a.low_ns == 5000);
	a = actuator_good("", NEEDED);
	assert_error(incise_motor_fit(&a, "m", 15999, 100, 0, &err), ERANGE, &err,
		     "16000 steps/s", "15999", "9.9993 mm/s");
	/* Pulses so long that the rate does not fit: 2·40 µs are 12 500 steps/s. */
	a = actuator_good("", NEEDED);
	assert_error(incise_motor_fit(&a, "m", 20000, 40000, 0, &err), ERANGE, &err,
		     "12500");
	/* 10 µs of pulse and pause, and 60 of writes: 14285.7 steps/s. */
	a = actuator_good("", NEEDED);
	assert_error(incise_motor_fit(&a, "m", 20000, 100, 60000, &err), ERANGE, &err,
		     "14285", "8.9285 mm/s");
	a = actuator_good("", NEEDED "high_us = 7.0;");
	assert_error(incise_motor_fit(&a, "m", 20000, 8000, 0, &err), ERANGE, &err, "8");
}
