// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/sim/config.c: defaults, setting by name, ranges. */
#include "../unit.h"
#include "../../../lib/sim/sim.h"
#include "../message.h"

TEST(defaults_are_those_of_the_header)
{
	struct incise_sim_config c;

	incise_sim_config_init(&c);
	assert_int_equal(c.seed, 1);
	assert_int_equal(c.n_depths, 4);
	for (int i = 0; i < 4; i++) {
		assert_true(c.depth_mm[i] == 5 * (i + 1));
		assert_int_equal(c.times[i], i == 1 || i == 2 ? 4 : 3);
	}
	assert_true(c.cut_s == 8 && c.pause_s == 1 && c.speed_mm_s == 25);
	assert_true(c.speed_swing == 0.9 && c.elastic1_N_mm == 0.045);
	assert_true(c.elastic2_N_mm2 == 0.0028 && c.viscous == 0.35 &&
		    c.viscous_mm_s == 15);
	assert_true(c.tooth == 0.2 && c.tooth_mm == 1.5 && c.boundary == 0.1);
	assert_true(c.unloading_N_mm == 0.25 && c.friction == 0.1 && c.withdrawal == 0);
	assert_true(c.tracker_hz == 120 && c.tracker_noise_mm == 0.02);
	assert_true(c.tracker_latency_ms == 4.2 && c.tracker_jitter_ms == 0.2);
	assert_true(c.tracker_drift_ppm == 50 && c.force_hz == 10000 &&
		    c.force_mV_N == 1240);
	assert_true(c.force_zero_mV == 180 && c.force_noise_mV == 3 && c.camera_hz == 50);
	assert_true(c.force_delay_ms == 0 && c.force_jitter_ms == 0);
	assert_true(c.camera_mm_px == 0.11875 && c.spring_N_mm == 2 && c.lead_mm == 2);
	assert_int_equal(c.steps_per_turn, 3200);
	assert_true(c.travel_mm == 20 && c.screw_mm_s == 30 && c.screw_mm_s2 == 3000);
	assert_true(c.handle_kg == 0.05 && c.handle_friction_N == 0.01);
	assert_true(c.hand_N_mm == 1 && c.hand_N_s_mm == 0.01);
	assert_true(c.tube_s == 0 && c.tube_x_mm == 20 && c.tube_y_mm == 0);
	assert_true(c.tube_above_mm == 200 && c.tube_below_mm == 10);
	assert_int_equal(incise_settings_check(incise_sim_settings, "sim", &c, NULL), 0);
}

/* The one word, and both of its values. */
TEST(words)
{
	struct incise_sim_config c;

	incise_sim_config_init(&c);
	assert_int_equal(c.withdrawal, 0);
	assert_int_equal(incise_settings_set(incise_sim_settings, "sim", "withdrawal",
					     "paper", &c, NULL),
			 0);
	assert_int_equal(c.withdrawal, 1);
	assert_error(incise_settings_set(incise_sim_settings, "sim", "withdrawal", "pap",
					 &c, &err),
		     EINVAL, &err, "sim.withdrawal:", "pap");
	assert_int_equal(c.withdrawal, 1);
}
