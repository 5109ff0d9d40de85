// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The group `actuator` of rig.conf; see incise/backend.h.
 */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <string.h>
#include "actuator.h"
#include "motor.h"

#define US 1000.0    /* ns */
#define MS 1000000.0 /* ns */
#define SECOND_NS 1e9
#define NS_PER_US 1000
#define SETTINGS_OF struct incise_actuator

/* The rates of serial adapters, which are also usual for can0. */
#define BITRATES                                                                  \
	"10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000 " \
	"bit/s"

static bool is_bitrate(const double *rate, int n, const char *text)
{
	static const int rates[] = {0,	    10000,  20000,  50000,  100000,
				    125000, 250000, 500000, 800000, 1000000};

	(void)n;
	(void)text;
	for (size_t i = 0; i < sizeof(rates) / sizeof(*rates); i++)
		if (*rate == rates[i])
			return true;
	return false;
}

/*
 * An object of the interpolation period, 60C2, is a byte times a power of ten: 1.25 ms is
 * 125 of 10 µs. In this range each whole number of 10 µs is one, and nothing else.
 */
static bool is_cycle(const double *us, int n, const char *text)
{
	(void)n;
	(void)text;
	return fmod(*us, 10) == 0;
}

static int read_active_low(void *to, const config_setting_t *names, const char *path,
			   struct incise_error *err);

/* In the order of enum incise_actuator_line. */
const struct incise_setting incise_actuator_line_settings[] = {
	SETTING_WHOLE(step, line[INCISE_LINE_STEP], "", 0, 1023, "(required)",
		      "step pulses"),
	SETTING_WHOLE(dir, line[INCISE_LINE_DIR], "", 0, 1023, "(required)", "direction"),
	SETTING_WHOLE(enable, line[INCISE_LINE_ENABLE], "", 0, 1023, "(none)",
		      "power of the motor"),
	SETTING_WHOLE(limit_min, line[INCISE_LINE_LIMIT_MIN], "", 0, 1023, "(none)",
		      "limit switch at 0"),
	SETTING_WHOLE(limit_max, line[INCISE_LINE_LIMIT_MAX], "", 0, 1023, "(none)",
		      "limit switch at the end of the travel"),
	SETTING_WHOLE(home, line[INCISE_LINE_HOME], "", 0, 1023, "(none)", "home switch"),
	SETTING_WHOLE(estop, line[INCISE_LINE_ESTOP], "", 0, 1023, "(none)",
		      "emergency stop"),
	SETTING_WHOLE(alarm, line[INCISE_LINE_ALARM], "", 0, 1023, "(none)",
		      "fault output of the power stage"),
	SETTING_OWN(
		active_low, "", "(none)",
		"array of the lines that are active when low, for example [\"enable\", \"estop\"]",
		.read = read_active_low),
	{0},
};

static const char *const modes[] = {
	[INCISE_ACTUATOR_CSP] = "csp",
	[INCISE_ACTUATOR_CSV] = "csv",
	[INCISE_ACTUATOR_CST] = "cst",
	NULL,
};

const struct incise_setting incise_actuator_can_settings[] = {
	SETTING_WORD(mode, can.mode, modes, "csp",
		     "kind of the setpoint: csp, csv or cst, see below"),
	SETTING_WHOLE(bitrate, can.bitrate, "bit/s", 0, 1000000, "0",
		      "bit rate of the bus, see below", .fits = is_bitrate,
		      .expected = BITRATES),
	SETTING_WHOLE(cycle_us, can.cycle_ns, "µs", 500, 2000, "1000",
		      "time between two SYNCs, a multiple of 10", .scale = US,
		      .fits = is_cycle,
		      .expected = "a multiple of 10 us from 500 to 2000"),
	SETTING_NUMBER(counts_per_turn, can.counts_per_turn, "1/turn", 1, 1e9,
		       "(from drive)", "units of position per turn of the screw"),
	SETTING_NUMBER(velocity_per_turn_s, can.velocity_per_turn_s, "s/turn", 1, 1e9,
		       "(from drive)", "units of velocity per turn/s, e.g. 60 for rpm"),
	SETTING_NUMBER(acceleration_per_turn_s2, can.acceleration_per_turn_s2, "s²/turn",
		       1, 1e9, "(from drive)", "units of acceleration per turn/s²"),
	SETTING_NUMBER(following_mm, can.following_mm, "mm", 0.001, 1000,
		       "(1, or travel_mm/10)",
		       "largest distance from the target; at most travel_mm"),
	SETTING_NUMBER(following_ms, can.following_s, "ms", 1, 10000, "50",
		       "longest time beyond following_mm", .scale = 1e-3),
	SETTING_WHOLE(homing_method, can.homing_method, "", -128, 127, "0",
		      "number of the homing method in the drive's manual"),
	SETTING_TRUTH(absolute, can.absolute, "false",
		      "true if the encoder keeps its position without power"),
	SETTING_NUMBER(position_gain_1_s, can.position_gain_1_s, "1/s", 0.1, 10000, "20",
		       "csv: velocity per distance from the target"),
	SETTING_NUMBER(stiffness_permille_mm, can.stiffness_permille_mm, "‰/mm", 0.001,
		       1e6, "(cst: required)",
		       "cst: thousandths of the rated torque per mm from the target"),
	SETTING_NUMBER(damping_permille_s_mm, can.damping_permille_s_mm, "‰ s/mm", 0, 1e6,
		       "0",
		       "cst: thousandths of the rated torque per mm/s from the target "
		       "speed"),
	SETTING_NUMBER(torque_max_permille, can.torque_max_permille, "‰", 1, 1000,
		       "(cst: required)",
		       "cst: largest torque, in thousandths of the rated torque"),
	SETTING_WHOLE(master, can.master, "", 1, 127, "127",
		      "node id of this program's heartbeat; no other node may have it"),
	{0},
};

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
	SETTING_NUMBER(home_mm, home_mm, "mm", -1000, 1000, "0",
		       "position of the edge of the home input, from a quarter of the "
		       "travel below 0 to its end"),
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
	SETTING_GROUP(can, incise_actuator_can_settings,
		      "settings of the backends can and slcan"),
	{0},
};

/* --- the group actuator.lines --- */

/* Names in active_low = ["enable", "estop"]; behind those of the lines. */
static int read_active_low(void *to, const config_setting_t *names, const char *path,
			   struct incise_error *err)
{
	struct incise_actuator *actuator = to;
	bool list = config_setting_is_aggregate(names) && !config_setting_is_group(names);

	for (int i = 0; list && i < config_setting_length(names); i++) {
		const char *name = config_setting_get_string_elem(names, i);
		const struct incise_setting *row =
			name ? incise_setting_of(incise_actuator_line_settings, name)
			     : NULL;
		int k = row ? (int)(row - incise_actuator_line_settings) : INCISE_LINES;

		if (k >= INCISE_LINES || actuator->line[k] < 0)
			return incise_conf_error(names, NULL, path, err,
						 "names of lines of this group, not "
						 "\"%.40s\"",
						 name ? name : "?");
		actuator->active_low |= 1u << k;
	}
	return list ? 0
		    : incise_conf_error(names, NULL, path, err,
					"names such as [\"enable\"]");
}

static int check_lines(const struct incise_actuator *actuator,
		       const config_setting_t *group, const char *path,
		       struct incise_error *err)
{
	const config_setting_t *lines = config_setting_get_member(group, "lines");

	for (int i = 0; i < INCISE_LINES; i++)
		for (int k = 0; k < i; k++)
			if (actuator->line[i] >= 0 &&
			    actuator->line[k] == actuator->line[i])
				return incise_conf_error(
					lines, incise_actuator_line_settings[i].key, path,
					err, "another line than that of %s",
					incise_actuator_line_settings[k].key);
	return 0;
}

/*
 * --- the group actuator.can: a drive on a CAN bus ---
 *
 * In csv the loop of position is closed here, once per cycle T, which limits its gain:
 *
 *   SYNC n      position x[n] is sampled, and comes in a TPDO
 *   SYNC n + 1  brings the speed K (target - x[n])
 *   SYNC n + 2  the drive runs at it, until
 *   SYNC n + 3
 *
 * that is x[n+1] = x[n] + T K (target - x[n-d]) with d = 2; another cycle is left for what
 * drive and bus add. Its roots, those of z^(d+1) - z^d + T K, lie within the unit circle for
 *
 *   0 < T K < 2 sin(π / (2 (2d + 1)))
 *
 * (S. A. Levin and R. M. May, A note on difference-delay equations, Theor. Popul. Biol. 9,
 * 1976, who write 2 cos(d π / (2d + 1)), which is the same). Half of that is taken.
 */

#define DELAY_CYCLES 3

double incise_actuator_can_gain_1_s(double cycle_s)
{
	return sin(M_PI / (2 * (2 * DELAY_CYCLES + 1))) / cycle_s;
}

/* Keys that a mode requires, and combinations. */
static int check_can(const struct incise_actuator *actuator, const config_setting_t *can,
		     const char *path, struct incise_error *err)
{
	const struct incise_actuator_can *is = &actuator->can;
	double most_1_s = incise_actuator_can_gain_1_s(is->cycle_ns * 1e-9);

	if (is->mode == INCISE_ACTUATOR_CST &&
	    !(is->stiffness_permille_mm && is->torque_max_permille))
		return incise_conf_error(can, "mode", path, err,
					 "a mode in which the drive closes the control "
					 "loops, or with it the keys "
					 "stiffness_permille_mm and torque_max_permille");
	if (is->following_mm > actuator->travel_mm)
		return incise_conf_error(can, "following_mm", path, err,
					 "at most travel_mm, %g", actuator->travel_mm);
	if (is->mode == INCISE_ACTUATOR_CSV && is->position_gain_1_s > most_1_s)
		return incise_conf_error(
			can, "position_gain_1_s", path, err,
			"at most %.1f 1/s, half of the stable limit with cycle_us = %u",
			floor(most_1_s * 10) / 10, is->cycle_ns / NS_PER_US);
	return 0;
}

/* Check values against each other. */
static int check(const struct incise_actuator *actuator, const config_setting_t *group,
		 const char *path, struct incise_error *err)
{
	double step_mm = incise_actuator_step_mm(actuator);
	double rate = actuator->velocity_mm_s / step_mm, pulse_ns, jerk;
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
	pulse_ns = (double)actuator->high_ns + actuator->low_ns;
	if (pulse_ns * rate > SECOND_NS * (1 + 1e-9))
		return incise_conf_error(
			group, "velocity_mm_s", path, err,
			"at most %g mm/s, at which a step takes the %.3f us of high_us and low_us",
			floor(SECOND_NS / pulse_ns * step_mm * 1e4) / 1e4, pulse_ns / US);
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
	if (!actuator->home_mm_s)
		actuator->home_mm_s = fmin(2, actuator->velocity_mm_s);
	if (!actuator->can.following_mm)
		actuator->can.following_mm = fmin(1, actuator->travel_mm / 10);
	can = config_setting_get_member(group, "can");
	rc = check_lines(actuator, group, path, err);
	if (!rc && can)
		rc = check_can(actuator, can, path, err);
	return rc ? rc : check(actuator, group, path, err);
}
