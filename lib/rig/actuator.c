// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The group `actuator` of rig.conf; see incise/backend.h.
 */
#include <math.h>
#include <string.h>
#include "actuator.h"
#include "motor.h"

#define US 1000.0    /* ns */
#define MS 1000000.0 /* ns */
#define SECOND_NS 1e9
/* A motor loses steps in fours; a switch is found again within less. */
#define LOST_WHOLE_STEPS 4
#define LOST_MM 0.2
#define SETTINGS_OF struct incise_actuator

const struct incise_setting incise_actuator_settings[] = {
	SETTING_NUMBER(spring_N_mm, spring_N_mm, "N/mm", 0.001, 1000, "(required)",
		       "spring between nut and handle"),
	SETTING_NUMBER(travel_mm, travel_mm, "mm", 0.1, 1000, "(required)",
		       "travel of the nut from 0; no target leaves it"),
	SETTING_NUMBER(lead_mm, lead_mm, "mm", 0.01, 100, "(required)",
		       "travel per turn of the screw"),
	SETTING_WHOLE(steps_per_turn, steps_per_turn, "", 1, 100000, "200",
		      "whole steps of the motor per turn"),
	SETTING_WHOLE(microsteps, microsteps, "", 1, 1024, "16",
		      "microsteps per whole step, as set on the power stage"),
	SETTING_NUMBER(velocity_mm_s, velocity_mm_s, "mm/s", 0.001, 10000, "10",
		       "largest speed; at most 200000 microsteps/s"),
	SETTING_NUMBER(acceleration_mm_s2, acceleration_mm_s2, "mm/s²", 0.1, 1e7, "500",
		       "largest acceleration"),
	SETTING_NUMBER(jerk_mm_s3, jerk_mm_s3, "mm/s³", 0, 1e12, "0",
		       "largest jerk; 0: no limit"),
	SETTING_NUMBER(deadman_ms, deadman_s, "ms", 1, 10000, "100",
		       "without a new target for this long, the nut stops and the "
		       "motor is switched off",
		       .scale = 1e-3),
	SETTING_TRUTH(retract, retract, "false",
		      "after the deadman, move to rest_mm before power goes off, if "
		      "the position is known"),
	SETTING_TRUTH(volatile_home, volatile_home, "false",
		      "without power the nut does not keep its place: home again"),
	SETTING_WHOLE(
		lost_steps_max, lost_steps_max, "", 0, 1000000,
		"(0.2 mm, at least 4 whole steps)",
		"microsteps that may be missing where the home edge is passed, or by "
		"the encoder; 0: any number"),
	SETTING_TEXT(encoder, encoder, "(none)",
		     "count of a Linux counter device that counts the nut's way, as "
		     "counter0/count0"),
	SETTING_NUMBER(
		encoder_counts_per_mm, encoder_counts_per_mm, "1/mm", -1e6, 1e6, "0",
		"its counts per mm of the nut; negative if it counts down as the nut "
		"goes up"),
	SETTING_NUMBER(tick_us, tick_ns, "µs", 50, 2000, "250",
		       "period in which the driver reads targets", .scale = US),
	SETTING_NUMBER(high_us, high_ns, "µs", 0.5, 1000, "(5 or more)",
		       "shortest active time of the step line", .scale = US),
	SETTING_NUMBER(low_us, low_ns, "µs", 0.5, 1000, "(5 or more)",
		       "shortest inactive time of the step line", .scale = US),
	SETTING_NUMBER(setup_us, setup_ns, "µs", 0, 1000, "5",
		       "from a change of direction to a step", .scale = US),
	SETTING_NUMBER(hold_us, hold_ns, "µs", 0, 1000, "5",
		       "from a step to a change of direction", .scale = US),
	SETTING_NUMBER(enable_ms, enable_ns, "ms", 0, 1000, "1",
		       "from power on to the first step", .scale = MS),
	SETTING_NUMBER(home_mm_s, home_mm_s, "mm/s", 0.001, 10000,
		       "(2, or velocity_mm_s)", "speed of homing; at most velocity_mm_s"),
	SETTING_NUMBER(home_mm, home_mm, "mm", -1000, 1000,
		       "(0; -0.5 with the limit switch at 0 as home)",
		       "position of the edge of the home input, from a quarter of the "
		       "travel below 0 to its end; where the lower limit is the home, 0 "
		       "stands for -0.5, so that the motor does not rest on it"),
	SETTING_NUMBER(origin_mm, origin_mm, "mm", -1e6, 1e6, "0",
		       "the handle's 0 along direction, in the frame of the tracker"),
	SETTING_NUMBER(rest_mm, rest_mm, "mm", 0, 1000, "0",
		       "where the spring exerts no force on a released handle; at most "
		       "travel_mm"),
	SETTING_NUMBER(late_ms, late_s, "ms", 0, 1000, "0",
		       "time from a target to its force; 0: unknown", .scale = 1e-3),
	SETTING_DIRECTION(direction, direction, "(see below)",
			  "in which the nut pushes the handle, in the frame of the "
			  "tracker"),
	SETTING_TRUTH(invert, invert, "false",
		      "true if a step up needs the line dir inactive"),
	SETTING_GROUP(lines, incise_actuator_line_settings, "lines of the backend gpio"),
	SETTING_TEXT(driver, driver, "(none)",
		     "driver chip with a line of its own, as BACKEND:ARGUMENTS"),
	SETTING_GROUP(tmc, incise_actuator_tmc_settings,
		      "settings of the drivers tmc2209 and tmc5160"),
	SETTING_GROUP(can, incise_actuator_can_settings,
		      "settings of the backends can and slcan"),
	{0},
};

/* Check values against each other. */
static int check_actuator(const struct incise_actuator *actuator,
			  const config_setting_t *group, const char *path,
			  struct incise_error *err)
{
	double step_mm = incise_actuator_step_mm(actuator);
	double rate = actuator->velocity_mm_s / step_mm, jerk;
	struct incise_profile_limits limits;

	if (actuator->travel_mm / step_mm > INCISE_PROFILE_POSITION_MAX ||
	    actuator->travel_mm < step_mm)
		return incise_conf_error(group, "travel_mm", path, err,
					 "1 to %d microsteps of %g mm",
					 INCISE_PROFILE_POSITION_MAX, step_mm);
	if (!(rate >= 1 && rate <= INCISE_PROFILE_VELOCITY_MAX))
		return incise_conf_error(group, "velocity_mm_s", path, err,
					 "1 to %d microsteps/s, that is %g to %g mm/s",
					 INCISE_PROFILE_VELOCITY_MAX, step_mm,
					 step_mm * INCISE_PROFILE_VELOCITY_MAX);
	if (!(actuator->acceleration_mm_s2 / step_mm >= 1 &&
	      actuator->acceleration_mm_s2 / step_mm <= INCISE_MOTOR_STEPS_MAX))
		return incise_conf_error(
			group, "acceleration_mm_s2", path, err,
			"1 to %.0f microsteps/s^2, that is %g to %g mm/s^2",
			INCISE_MOTOR_STEPS_MAX, step_mm,
			step_mm * INCISE_MOTOR_STEPS_MAX);
	incise_actuator_limits(actuator, &limits);
	/*
	 * The average over 2a/(jT) ticks has at most INCISE_PROFILE_AVERAGE_MAX of them.
	 */
	jerk = 2 * actuator->acceleration_mm_s2 /
	       (INCISE_PROFILE_AVERAGE_MAX * (actuator->tick_ns / SECOND_NS));
	if (actuator->jerk_mm_s3 &&
	    (limits.jerk < 1 || incise_profile_stopping_ns(&limits, 1) == UINT64_MAX))
		return incise_conf_error(
			group, "jerk_mm_s3", path, err,
			"0 or at least %.4g for this acceleration and tick_us",
			jerk * 1.01);
	if (actuator->home_mm_s > actuator->velocity_mm_s)
		return incise_conf_error(group, "home_mm_s", path, err,
					 "at most velocity_mm_s, %g",
					 actuator->velocity_mm_s);
	if (actuator->home_mm < -actuator->travel_mm / 4 ||
	    actuator->home_mm > actuator->travel_mm)
		return incise_conf_error(
			group, "home_mm", path, err,
			"%g to %g, from a quarter of the travel below 0 to its end",
			-actuator->travel_mm / 4, actuator->travel_mm);
	if (actuator->rest_mm > actuator->travel_mm)
		return incise_conf_error(group, "rest_mm", path, err,
					 "at most travel_mm, %g", actuator->travel_mm);
	if (*actuator->encoder && !actuator->encoder_counts_per_mm)
		return incise_conf_error(group, "encoder_counts_per_mm", path, err,
					 "counts per mm of the encoder");
	if (*actuator->encoder && !actuator->lost_steps_max)
		return incise_conf_error(group, "lost_steps_max", path, err,
					 "1 or more with an encoder");
	return 0;
}

int incise_actuator_read(struct incise_actuator *actuator, const config_setting_t *group,
			 const char *path, struct incise_error *err)
{
	const config_setting_t *can;
	int rc;

	*actuator = (struct incise_actuator){0};
	for (int i = 0; i < INCISE_LINES; i++)
		actuator->line[i] = -1;
	incise_settings_init(incise_actuator_settings, actuator);
	rc = incise_settings_read(incise_actuator_settings, group, path, actuator, err);
	if (rc)
		return rc;
	actuator->has_lines = config_setting_get_member(group, "lines");
	if (!config_setting_get_member(group, "lost_steps_max"))
		actuator->lost_steps_max = (int)fmax(
			LOST_WHOLE_STEPS * (double)actuator->microsteps,
			ceil(fmin(LOST_MM / incise_actuator_step_mm(actuator), 1e6)));
	actuator->has_home = config_setting_get_member(group, "home_mm");
	if (!actuator->home_mm_s)
		actuator->home_mm_s = fmin(2, actuator->velocity_mm_s);
	if (!actuator->can.following_mm)
		actuator->can.following_mm = fmin(1, actuator->travel_mm / 10);
	can = config_setting_get_member(group, "can");
	rc = incise_actuator_lines_check(actuator, group, path, err);
	if (!rc && can)
		rc = incise_actuator_can_check(actuator, can, path, err);
	if (!rc)
		rc = incise_actuator_tmc_check(actuator, group, path, err);
	return rc ? rc : check_actuator(actuator, group, path, err);
}
