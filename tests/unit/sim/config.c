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
	assert_int_equal(incise_sim_config_check(&c, NULL), 0);
}

TEST(set_reaches_its_field)
{
	struct incise_sim_config c;

	incise_sim_config_init(&c);
	assert_int_equal(incise_sim_config_set(&c, "seed", 2147483647.0, NULL), 0);
	assert_int_equal(c.seed, 2147483647u);
	assert_int_equal(incise_sim_config_set(&c, "steps_per_turn", 400, NULL), 0);
	assert_int_equal(c.steps_per_turn, 400);
	assert_int_equal(incise_sim_config_set(&c, "hand_N_s_mm", 0.5, NULL), 0);
	assert_true(c.hand_N_s_mm == 0.5);
	assert_int_equal(incise_sim_config_set(&c, "depth_mm[4]", 3.5, NULL), 0);
	assert_true(c.depth_mm[4] == 3.5);
	assert_int_equal(c.n_depths, 5);
	assert_int_equal(incise_sim_config_set(&c, "depth_mm", 7, NULL), 0);
	assert_int_equal(incise_sim_config_set(&c, "times", 2, NULL), 0);
	assert_true(c.depth_mm[0] == 7);
	assert_int_equal(c.times[0], 2);
	assert_int_equal(c.n_depths, 1);
}

TEST(set_refuses)
{
	static const struct {
		const char *key;
		double value;
		int code;
	} row[] = {
		{"sede", 1, ENOENT},	     {"", 1, ENOENT},
		{"n_depths", 1, ENOENT},     {"depth_mm[8]", 5, ENOENT},
		{"depth_mm[-1]", 5, ENOENT}, {"depth_mm[1", 5, ENOENT},
		{"cut_s[0]", 5, ENOENT},     {"cut_s", 0.1, EINVAL},
		{"cut_s", NAN, EINVAL},	     {"cut_s", INFINITY, EINVAL},
		{"times", 1.5, EINVAL},	     {"seed", -1, EINVAL},
	};
	struct incise_sim_config c;

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		char key[40];

		snprintf(key, sizeof(key), "sim.%s:", row[i].key);
		incise_sim_config_init(&c);
		assert_error(incise_sim_config_set(&c, row[i].key, row[i].value, &err),
			     row[i].code, &err, key);
		assert_int_equal(c.n_depths, 4);
		assert_int_equal(incise_sim_config_check(&c, NULL), 0);
	}
}

TEST(words)
{
	struct incise_sim_config c;

	incise_sim_config_init(&c);
	assert_true(incise_sim_config_has_words("withdrawal"));
	assert_false(incise_sim_config_has_words("seed"));
	assert_false(incise_sim_config_has_words("withdrawals"));
	assert_int_equal(c.withdrawal, 0);
	assert_int_equal(incise_sim_config_set_word(&c, "withdrawal", "paper", NULL), 0);
	assert_int_equal(c.withdrawal, 1);
	assert_error(incise_sim_config_set_word(&c, "withdrawal", "pap", &err), EINVAL,
		     &err, "sim.withdrawal:", "pap");
	assert_int_equal(c.withdrawal, 1);
	assert_int_equal(incise_sim_config_set_word(&c, "withdrawal", "", NULL), -EINVAL);
	assert_int_equal(
		incise_sim_config_set_word(&c, "withdrawal", "dissipative", NULL), 0);
	assert_int_equal(c.withdrawal, 0);
}

TEST(check_finds_what_was_put_past_set)
{
	struct incise_sim_config c;

	incise_sim_config_init(&c);
	c.n_depths = 0;
	assert_error(incise_sim_config_check(&c, &err), EINVAL, &err,
		     "sim.depth_mm:", "0");
	c.n_depths = 9;
	assert_int_equal(incise_sim_config_check(&c, &err), -EINVAL);
	incise_sim_config_init(&c);
	c.depth_mm[3] = NAN;
	assert_error(incise_sim_config_check(&c, &err), EINVAL, &err,
		     "sim.depth_mm:", "nan");
	c.n_depths = 3; /* the bad one is no longer in use */
	assert_int_equal(incise_sim_config_check(&c, &err), 0);
}
