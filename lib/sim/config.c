// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Configuration of the virtual rig: names, defaults and ranges; see incise/sim.h. The ranges
 * keep every division, buffer and integration of the rig well defined.
 */
#include "sim.h"

#define SETTINGS_OF struct incise_sim_config
#define REAL(name, ...) SETTING_NUMBER(name, name, __VA_ARGS__)
#define WHOLE(name, ...) SETTING_WHOLE(name, name, __VA_ARGS__)
#define COUNTED .count = offsetof(struct incise_sim_config, n_depths)

static const char *const withdrawals[] = {"dissipative", "paper", NULL};

const struct incise_setting incise_sim_settings[] = {
	/* libconfig reads no larger integers without a suffix. */
	WHOLE(seed, "", 0, 2147483647, "1", "seed of all random numbers"),
	WHOLE(motion, "", 0, 3, "0", "motion of the surgeon, see below"),
	/* Song et al. (2006), §3. */
	REAL(depth_mm, "mm", 0.1, 40, "[5, 10, 15, 20]", "nominal depths of the cuts",
	     COUNTED),
	WHOLE(times, "", 1, 1000, "[3, 4, 4, 3]", "number of cuts at each depth",
	      COUNTED),
	REAL(cut_s, "s", 0.5, 3600, "8", "duration of a cut"),
	REAL(pause_s, "s", 0.1, 3600, "1",
	     "time in the air before each cut and after the last"),
	REAL(speed_mm_s, "mm/s", 0.1, 1000, "25", "mean speed of the hand"),
	REAL(speed_swing, "", 0, 0.95, "0.9",
	     "relative amplitude of the variation of speed"),
	REAL(cone_deg, "°", 0, 170, "80", "motion 1: cone that the tool sweeps"),
	REAL(elastic1_N_mm, "N/mm", 0, 100, "0.045", "e1"),
	REAL(elastic2_N_mm2, "N/mm²", 0, 10, "0.0028", "e2"),
	REAL(viscous, "", 0, 10, "0.35", "c"),
	REAL(viscous_mm_s, "mm/s", 0.01, 1000, "15", "v0"),
	REAL(tooth, "", 0, 0.9, "0.2",
	     "relative amplitude of the saw-tooth of stretching and tearing"),
	REAL(tooth_mm, "mm", 0.01, 1000, "1.5", "mean path between two tears"),
	REAL(boundary, "", 0, 0.3, "0.1",
	     "relative standard deviation of the force between cuts, and its "
	     "relative decrease along the slab"),
	REAL(unloading_N_mm, "N/mm", 0.01, 1000, "0.25",
	     "stiffness of unloading, and largest slope of the force over "
	     "depth; if F is steeper, the force stays below F"),
	REAL(friction, "", 0, 1, "0.1",
	     "share of F that resists the blade in its open cut, in both "
	     "directions"),
	SETTING_WORD(withdrawal, withdrawal, withdrawals, "dissipative",
		     "dissipative: as described above; paper: F in both directions, "
		     "which returns more work than was put in"),
	REAL(tracker_hz, "Hz", 1, 1000, "120", "rate of all stations together"),
	REAL(tracker_noise_mm, "mm", 0, 10, "0.02", "standard deviation per axis"),
	REAL(tracker_latency_ms, "ms", 0, 1000, "4.2",
	     "shortest time from acquisition to arrival"),
	REAL(tracker_jitter_ms, "ms", 0, 100, "0.2",
	     "standard deviation of the additional time, which is never "
	     "negative"),
	REAL(tracker_drift_ppm, "ppm", -10000, 10000, "50",
	     "how much its clock runs fast"),
	REAL(tip_x_mm, "mm", -1000, 1000, "0",
	     "position of the tip relative to the tracked point, x in the "
	     "frame of the scalpel"),
	REAL(tip_y_mm, "mm", -1000, 1000, "0", "the same, y"),
	REAL(tip_z_mm, "mm", -1000, 1000, "0", "the same, z"),
	REAL(tube_s, "s", 0, 3600, "0",
	     "time in which the tube moves from one end to the other; 0: no "
	     "tube"),
	REAL(tube_x_mm, "mm", -1000, 1000, "20", "position of the tube, x"),
	REAL(tube_y_mm, "mm", -1000, 1000, "0", "the same, y"),
	REAL(tube_above_mm, "mm", 0, 1000, "200",
	     "highest position of its end above z = 0"),
	REAL(tube_below_mm, "mm", 0, 1000, "10",
	     "lowest position of its end below z = 0"),
	REAL(force_hz, "Hz", 1, 200000, "10000", "samples per second"),
	REAL(force_mV_N, "mV/N", 1, 100000, "1240", "sensitivity"),
	REAL(force_zero_mV, "mV", -10000, 10000, "180", "reading without load"),
	REAL(force_noise_mV, "mV", 0, 1000, "3", "standard deviation"),
	REAL(force_delay_ms, "ms", 0, 1000, "0",
	     "delay of the timestamps after the acquisition"),
	REAL(force_jitter_ms, "ms", 0, 10, "0",
	     "standard deviation of the timestamps; none is before the "
	     "acquisition"),
	REAL(camera_hz, "Hz", 1, 500, "50", "frames per second"),
	/* The lower limit keeps the whole scalpel in the frame; see sim_camera.c. */
	REAL(camera_mm_px, "mm/px", 0.118, 1, "0.11875",
	     "scale; by default the scalpel's 47.5 mm take 400 pixels, less "
	     "the part in the tissue"),
	WHOLE(axes, "", 1, 3, "1", "number of actuators"),
	REAL(spring_N_mm, "N/mm", 0.001, 1000, "2", "spring between nut and handle"),
	REAL(lead_mm, "mm", 0.1, 100, "2", "travel per turn of the screw"),
	WHOLE(steps_per_turn, "", 4, 1000000, "3200", "microsteps per turn"),
	REAL(travel_mm, "mm", 0.1, 1000, "20", "travel of the nut"),
	REAL(screw_mm_s, "mm/s", 0.1, 10000, "30", "largest speed of the nut"),
	REAL(screw_mm_s2, "mm/s²", 1, 1e7, "3000", "largest acceleration of the nut"),
	REAL(handle_kg, "kg", 0.001, 100, "0.05", "mass of the handle"),
	REAL(handle_friction_N, "N", 0, 100, "0.01", "Coulomb friction of the handle"),
	REAL(hand_N_mm, "N/mm", 0, 1000, "1", "stiffness of the hand's grip"),
	/* Some damping is needed to absorb the work of the moving nut. */
	REAL(hand_N_s_mm, "N s/mm", 0.0001, 10, "0.01", "damping of the hand's grip"),
	WHOLE(bench, "", 0, 1, "0",
	      "1: actuator on the bench; incise stepper jog works too"),
	REAL(backlash_mm, "mm", 0, 10, "0",
	     "play between nut and spring, in the coupling of a self-locking "
	     "screw"),
	REAL(hysteresis_N, "N", 0, 10, "0",
	     "difference of the spring force between both directions; "
	     "complete 0.1 mm after a reversal"),
	REAL(stiction_N, "N", 0, 10, "0",
	     "static friction of the handle in addition to handle_friction_N"),
	REAL(stall_mm_s, "mm/s", 0, 10000, "0", "a faster nut loses its steps; 0: never"),
	{0},
};
_Static_assert(sizeof(incise_sim_settings) / sizeof(*incise_sim_settings) <=
		       SETTING_ROWS_MAX + 1,
	       "raise SETTING_ROWS_MAX");

void incise_sim_config_init(struct incise_sim_config *config)
{
	*config = (struct incise_sim_config){0};
	incise_settings_init(incise_sim_settings, config);
}
