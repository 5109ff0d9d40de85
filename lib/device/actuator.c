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
#define COUNT(array) (sizeof(array) / sizeof(*(array)))

/* Lines are in the order of enum incise_actuator_line. */
const char *const incise_actuator_line_keys[] = {"step",      "dir",	   "enable",
						 "limit_min", "limit_max", "home",
						 "estop",     "alarm",	   "active_low",
						 NULL};

const char *const incise_actuator_can_keys[] = {"mode",
						"bitrate",
						"cycle_us",
						"counts_per_turn",
						"velocity_per_turn_s",
						"acceleration_per_turn_s2",
						"following_mm",
						"following_ms",
						"homing_method",
						"absolute",
						"position_gain_1_s",
						"stiffness_permille_mm",
						"damping_permille_s_mm",
						"torque_max_permille",
						"master",
						NULL};

const char *const incise_actuator_keys[] = {"spring_N_mm",
					    "travel_mm",
					    "lead_mm",
					    "steps_per_turn",
					    "microsteps",
					    "velocity_mm_s",
					    "acceleration_mm_s2",
					    "jerk_mm_s3",
					    "deadman_ms",
					    "retract",
					    "tick_us",
					    "high_us",
					    "low_us",
					    "setup_us",
					    "hold_us",
					    "enable_ms",
					    "home_mm_s",
					    "home_mm",
					    "origin_mm",
					    "rest_mm",
					    "late_ms",
					    "direction",
					    "invert",
					    "lines",
					    "can",
					    NULL};

/* A key for a number of the struct, which may have another unit. */
struct number {
	const char *key;
	double min, max, unit; /* unit: field = unit · key */
	size_t offset;
	enum { DOUBLE, U32, U64 } type;
};

#define NUMBER(key, min, max, unit, field, type)                                   \
	{                                                                          \
		key, min, max, unit, offsetof(struct incise_actuator, field), type \
	}

static const struct number numbers[] = {
	NUMBER("spring_N_mm", 0.001, 1000, 1, spring_N_mm, DOUBLE),
	NUMBER("travel_mm", 0.1, 1000, 1, travel_mm, DOUBLE),
	NUMBER("lead_mm", 0.01, 100, 1, lead_mm, DOUBLE),
	NUMBER("velocity_mm_s", 0.001, 10000, 1, velocity_mm_s, DOUBLE),
	NUMBER("acceleration_mm_s2", 0.1, 1e7, 1, acceleration_mm_s2, DOUBLE),
	NUMBER("jerk_mm_s3", 0, 1e12, 1, jerk_mm_s3, DOUBLE),
	NUMBER("deadman_ms", 1, 10000, 1e-3, deadman_s, DOUBLE),
	NUMBER("tick_us", 50, 2000, US, tick_ns, U32),
	NUMBER("high_us", 0.5, 1000, US, high_ns, U32),
	NUMBER("low_us", 0.5, 1000, US, low_ns, U32),
	NUMBER("setup_us", 0, 1000, US, setup_ns, U32),
	NUMBER("hold_us", 0, 1000, US, hold_ns, U32),
	NUMBER("enable_ms", 0, 1000, MS, enable_ns, U64),
	NUMBER("home_mm_s", 0.001, 10000, 1, home_mm_s, DOUBLE),
	NUMBER("home_mm", -1000, 1000, 1, home_mm, DOUBLE),
	NUMBER("origin_mm", -1e6, 1e6, 1, origin_mm, DOUBLE),
	NUMBER("rest_mm", 0, 1000, 1, rest_mm, DOUBLE),
	NUMBER("late_ms", 0, 1000, 1e-3, late_s, DOUBLE),
};

static int read_numbers(void *to, const struct number *numbers, size_t n,
			const config_setting_t *group, const char *path,
			struct incise_error *err)
{
	for (size_t i = 0; i < n; i++) {
		void *field = (char *)to + numbers[i].offset;
		double value = NAN;
		int rc = incise_conf_number(group, path, numbers[i].key, numbers[i].min,
					    numbers[i].max, &value, err);

		if (rc)
			return rc;
		if (isnan(value))
			continue;
		value *= numbers[i].unit;
		if (numbers[i].type == DOUBLE)
			*(double *)field = value;
		else if (numbers[i].type == U32)
			*(uint32_t *)field = (uint32_t)lround(value);
		else
			*(uint64_t *)field = (uint64_t)llround(value);
	}
	return 0;
}

static int line_of(const config_setting_t *group, const char *key)
{
	const config_setting_t *setting = config_setting_get_member(group, key);

	return config_setting_source_line(setting ? setting : group);
}

/* --- the group actuator.lines --- */

/* Names in active_low = ["enable", "estop"]; */
static int read_active_low(struct incise_actuator *actuator,
			   const config_setting_t *lines, const char *path,
			   struct incise_error *err)
{
	const config_setting_t *names = config_setting_get_member(lines, "active_low");
	int n = names && config_setting_is_aggregate(names) ? config_setting_length(names)
							    : 0;

	if (names &&
	    (!config_setting_is_aggregate(names) || config_setting_is_group(names)))
		return incise_error_set(err, EINVAL,
					"%.200s:%d: actuator.lines.active_low: expected "
					"names such as [\"enable\"]; correct it",
					path, config_setting_source_line(names));
	for (int i = 0; i < n; i++) {
		const char *name =
			config_setting_get_string(config_setting_get_elem(names, i));
		int k = 0;

		while (k < INCISE_LINES &&
		       (!name || strcmp(name, incise_actuator_line_keys[k])))
			k++;
		if (k == INCISE_LINES || actuator->line[k] < 0)
			return incise_error_set(
				err, EINVAL,
				"%.200s:%d: actuator.lines.active_low: \"%.40s\" is "
				"not a line of this group; correct it",
				path, config_setting_source_line(names),
				name ? name : "?");
		actuator->active_low |= 1u << k;
	}
	return 0;
}

static int read_lines(struct incise_actuator *actuator, const config_setting_t *group,
		      const char *path, struct incise_error *err)
{
	const config_setting_t *lines = config_setting_get_member(group, "lines");
	int rc;

	for (int i = 0; i < INCISE_LINES; i++)
		actuator->line[i] = -1;
	if (!lines)
		return 0;
	actuator->has_lines = true;
	rc = incise_conf_known(lines, path, incise_actuator_line_keys, err);
	for (int i = 0; i < INCISE_LINES && !rc; i++) {
		rc = incise_conf_integer(lines, path, incise_actuator_line_keys[i], 0,
					 1023, &actuator->line[i], err);
		for (int k = 0; k < i && !rc; k++)
			if (actuator->line[i] >= 0 &&
			    actuator->line[k] == actuator->line[i])
				rc = incise_error_set(
					err, EINVAL,
					"%.200s:%d: actuator.lines: %s and %s are both "
					"line %d; correct one",
					path, config_setting_source_line(lines),
					incise_actuator_line_keys[k],
					incise_actuator_line_keys[i], actuator->line[i]);
	}
	if (!rc)
		rc = incise_conf_need(lines, path, "step", err);
	if (!rc)
		rc = incise_conf_need(lines, path, "dir", err);
	return rc ? rc : read_active_low(actuator, lines, path, err);
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
/* An object of the interpolation period, 60C2, is a byte times a power of ten: 1.25 ms is
 * 125 of 10 µs. In this range each whole number of 10 µs is one, and nothing else. */
#define CYCLE_UNIT_US 10

double incise_actuator_can_gain_1_s(double cycle_s)
{
	return sin(M_PI / (2 * (2 * DELAY_CYCLES + 1))) / cycle_s;
}

#define CAN_NUMBER(key, min, max, unit, field)                                           \
	{                                                                                \
		key, min, max, unit, offsetof(struct incise_actuator_can, field), DOUBLE \
	}

static const struct number can_numbers[] = {
	CAN_NUMBER("counts_per_turn", 1, 1e9, 1, counts_per_turn),
	CAN_NUMBER("velocity_per_turn_s", 1, 1e9, 1, velocity_per_turn_s),
	CAN_NUMBER("acceleration_per_turn_s2", 1, 1e9, 1, acceleration_per_turn_s2),
	CAN_NUMBER("following_ms", 1, 10000, 1e-3, following_s),
	CAN_NUMBER("position_gain_1_s", 0.1, 10000, 1, position_gain_1_s),
	CAN_NUMBER("stiffness_permille_mm", 0.001, 1e6, 1, stiffness_permille_mm),
	CAN_NUMBER("damping_permille_s_mm", 0, 1e6, 1, damping_permille_s_mm),
	CAN_NUMBER("torque_max_permille", 1, 1000, 1, torque_max_permille),
};

static int read_mode(struct incise_actuator_can *can, const config_setting_t *group,
		     const char *path, struct incise_error *err)
{
	static const char *const modes[] = {
		[INCISE_ACTUATOR_CSP] = "csp",
		[INCISE_ACTUATOR_CSV] = "csv",
		[INCISE_ACTUATOR_CST] = "cst",
	};
	const char *name = "csp";
	int rc = incise_conf_string(group, path, "mode", &name, err);

	for (int i = INCISE_ACTUATOR_CSP; i <= INCISE_ACTUATOR_CST && !rc; i++)
		if (!strcmp(name, modes[i])) {
			can->mode = (enum incise_actuator_mode)i;
			return 0;
		}
	return rc ? rc
		  : incise_error_set(
			    err, EINVAL,
			    "%.200s:%d: actuator.can.mode: expected \"csp\", \"csv\" or "
			    "\"cst\", found \"%.40s\"; correct it",
			    path, line_of(group, "mode"), name);
}

/* The rates of serial adapters, which are also usual for can0. */
static int read_bitrate(struct incise_actuator_can *can, const config_setting_t *group,
			const char *path, struct incise_error *err)
{
	static const int rates[] = {0,	    10000,  20000,  50000,  100000,
				    125000, 250000, 500000, 800000, 1000000};
	int rate = 0, rc;

	rc = incise_conf_integer(group, path, "bitrate", 0, 1000000, &rate, err);
	can->bitrate = (uint32_t)rate;
	for (size_t i = 0; i < sizeof(rates) / sizeof(*rates) && !rc; i++)
		if (rate == rates[i])
			return 0;
	return rc ? rc
		  : incise_error_set(
			    err, EINVAL,
			    "%.200s:%d: actuator.can.bitrate: expected 10000, 20000, 50000, "
			    "100000, 125000, 250000, 500000, 800000 or 1000000 bit/s, found "
			    "%d; correct it",
			    path, line_of(group, "bitrate"), rate);
}

static int read_cycle(struct incise_actuator_can *can, const config_setting_t *group,
		      const char *path, struct incise_error *err)
{
	int us = (int)(can->cycle_ns / NS_PER_US);
	int rc = incise_conf_integer(group, path, "cycle_us", 500, 2000, &us, err);

	can->cycle_ns = (uint32_t)us * NS_PER_US;
	if (rc || us % CYCLE_UNIT_US == 0)
		return rc;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: actuator.can.cycle_us: expected a multiple of %d us, found "
		"%d; give %d or %d",
		path, line_of(group, "cycle_us"), CYCLE_UNIT_US, us,
		us - us % CYCLE_UNIT_US, us - us % CYCLE_UNIT_US + CYCLE_UNIT_US);
}

/* Check keys that a mode requires, and combinations. */
static int check_can(const struct incise_actuator_can *can, const config_setting_t *group,
		     const char *path, struct incise_error *err)
{
	static const char *const needed[] = {"stiffness_permille_mm",
					     "torque_max_permille"};
	double most_1_s = incise_actuator_can_gain_1_s(can->cycle_ns * 1e-9);

	for (size_t i = 0; i < sizeof(needed) / sizeof(*needed); i++)
		if (can->mode == INCISE_ACTUATOR_CST &&
		    !config_setting_get_member(group, needed[i]))
			return incise_error_set(
				err, EINVAL,
				"%.200s:%d: actuator.can.%s is missing: in mode "
				"\"cst\" incise closes the control loops and needs it; "
				"add it",
				path, line_of(group, "mode"), needed[i]);
	if (can->mode == INCISE_ACTUATOR_CSV && can->position_gain_1_s > most_1_s)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.can.position_gain_1_s: expected at most "
			"%.1f 1/s, half of the stable limit with cycle_us = %u, found "
			"%g; correct it",
			path, line_of(group, "position_gain_1_s"),
			floor(most_1_s * 10) / 10, can->cycle_ns / NS_PER_US,
			can->position_gain_1_s);
	return 0;
}

int incise_actuator_can_read(struct incise_actuator_can *can, double travel_mm,
			     const config_setting_t *group, const char *path,
			     struct incise_error *err)
{
	const config_setting_t *own = config_setting_get_member(group, "can");
	int rc;

	*can = (struct incise_actuator_can){
		.mode = INCISE_ACTUATOR_CSP,
		.cycle_ns = 1000000,
		.following_mm = fmin(1, travel_mm / 10),
		.following_s = 0.05,
		.position_gain_1_s = 20,
		.master = 127,
	};
	if (!own)
		return 0;
	rc = incise_conf_known(own, path, incise_actuator_can_keys, err);
	if (!rc)
		rc = read_mode(can, own, path, err);
	if (!rc)
		rc = read_bitrate(can, own, path, err);
	if (!rc)
		rc = read_cycle(can, own, path, err);
	if (!rc)
		rc = incise_conf_number(own, path, "following_mm", 0.001, travel_mm,
					&can->following_mm, err);
	if (!rc)
		rc = read_numbers(can, can_numbers, COUNT(can_numbers), own, path, err);
	if (!rc)
		rc = incise_conf_integer(own, path, "homing_method", -128, 127,
					 &can->homing_method, err);
	if (!rc)
		rc = incise_conf_bool(own, path, "absolute", &can->absolute, err);
	if (!rc)
		rc = incise_conf_integer(own, path, "master", 1, 127, &can->master, err);
	return rc ? rc : check_can(can, own, path, err);
}

static bool number_of(const void *of, const struct number *numbers, size_t n,
		      const char *key, double *value)
{
	for (size_t i = 0; i < n; i++) {
		const void *field = (const char *)of + numbers[i].offset;

		if (strcmp(numbers[i].key, key))
			continue;
		*value = numbers[i].type == DOUBLE ? *(const double *)field
			 : numbers[i].type == U32  ? *(const uint32_t *)field
						   : *(const uint64_t *)field;
		*value /= numbers[i].unit;
		return true;
	}
	return false;
}

bool incise_actuator_number(const struct incise_actuator *actuator, const char *key,
			    double *value)
{
	if (!strncmp(key, "can.", 4))
		return number_of(&actuator->can, can_numbers, COUNT(can_numbers), key + 4,
				 value);
	return number_of(actuator, numbers, COUNT(numbers), key, value);
}

/* --- the group actuator --- */

/* Check values against each other. */
static int check(const struct incise_actuator *actuator, const config_setting_t *group,
		 const char *path, struct incise_error *err)
{
	double step_mm = incise_actuator_step_mm(actuator);
	double rate = actuator->velocity_mm_s / step_mm, pulse_ns, jerk;
	struct incise_profile_limits limits;

	if (actuator->travel_mm / step_mm > INCISE_PROFILE_POSITION_MAX ||
	    actuator->travel_mm < step_mm)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.travel_mm: expected 1 to %d microsteps of "
			"%g mm, found %.0f; correct lead_mm, steps_per_turn or microsteps",
			path, line_of(group, "travel_mm"), INCISE_PROFILE_POSITION_MAX,
			step_mm, actuator->travel_mm / step_mm);
	if (!(rate >= 1 && rate <= INCISE_PROFILE_VELOCITY_MAX))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.velocity_mm_s: expected 1 to %d microsteps/s, "
			"that is %g to %g mm/s, found %g; correct it, or microsteps",
			path, line_of(group, "velocity_mm_s"),
			INCISE_PROFILE_VELOCITY_MAX, step_mm,
			step_mm * INCISE_PROFILE_VELOCITY_MAX, actuator->velocity_mm_s);
	pulse_ns = (double)actuator->high_ns + actuator->low_ns;
	if (pulse_ns * rate > SECOND_NS * (1 + 1e-9))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.velocity_mm_s: at %g mm/s a step takes "
			"%.3f us, but high_us and low_us take %.3f us; give at most %g "
			"mm/s",
			path, line_of(group, "velocity_mm_s"), actuator->velocity_mm_s,
			SECOND_NS / US / rate, pulse_ns / US,
			floor(SECOND_NS / pulse_ns * step_mm * 1e4) / 1e4);
	if (!(actuator->acceleration_mm_s2 / step_mm >= 1 &&
	      actuator->acceleration_mm_s2 / step_mm <= INCISE_MOTOR_STEPS_MAX))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.acceleration_mm_s2: expected 1 to %.0f "
			"microsteps/s^2, that is %g to %g mm/s^2, found %g; correct it",
			path, line_of(group, "acceleration_mm_s2"),
			INCISE_MOTOR_STEPS_MAX, step_mm, step_mm * INCISE_MOTOR_STEPS_MAX,
			actuator->acceleration_mm_s2);
	incise_actuator_limits(actuator, &limits);
	/*
	 * The average over 2a/(jT) ticks has at most INCISE_PROFILE_AVERAGE_MAX of them.
	 */
	jerk = 2 * actuator->acceleration_mm_s2 /
	       (INCISE_PROFILE_AVERAGE_MAX * (actuator->tick_ns / SECOND_NS));
	if (actuator->jerk_mm_s3 &&
	    (limits.jerk < 1 || incise_profile_stopping_ns(&limits, 1) == UINT64_MAX))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.jerk_mm_s3: expected 0 or at least %.4g for this "
			"acceleration and tick_us, found %g; correct it",
			path, line_of(group, "jerk_mm_s3"), jerk * 1.01,
			actuator->jerk_mm_s3);
	if (actuator->home_mm_s > actuator->velocity_mm_s)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.home_mm_s: expected at most velocity_mm_s, %g, "
			"found %g; correct it",
			path, line_of(group, "home_mm_s"), actuator->velocity_mm_s,
			actuator->home_mm_s);
	if (actuator->home_mm < -actuator->travel_mm / 4 ||
	    actuator->home_mm > actuator->travel_mm)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.home_mm: expected %g to %g, from a quarter of "
			"the travel below 0 to its end, found %g; correct it",
			path, line_of(group, "home_mm"), -actuator->travel_mm / 4,
			actuator->travel_mm, actuator->home_mm);
	if (actuator->rest_mm > actuator->travel_mm)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.rest_mm: expected at most travel_mm, %g, found "
			"%g; correct it",
			path, line_of(group, "rest_mm"), actuator->travel_mm,
			actuator->rest_mm);
	return 0;
}

int incise_actuator_read(struct incise_actuator *actuator, const config_setting_t *group,
			 const char *path, struct incise_error *err)
{
	static const char *const needed[] = {"spring_N_mm", "travel_mm", "lead_mm"};
	int rc;

	*actuator = (struct incise_actuator){
		.steps_per_turn = 200,
		.microsteps = 16,
		.velocity_mm_s = 10,
		.acceleration_mm_s2 = 500,
		.deadman_s = 0.1,
		.tick_ns = 250000,
		.setup_ns = 5000,
		.hold_ns = 5000,
		.enable_ns = 1000000,
		.home_mm_s = NAN,
	};
	rc = incise_conf_known(group, path, incise_actuator_keys, err);
	for (size_t i = 0; i < sizeof(needed) / sizeof(*needed) && !rc; i++)
		rc = incise_conf_need(group, path, needed[i], err);
	if (!rc)
		rc = read_numbers(actuator, numbers, COUNT(numbers), group, path, err);
	if (!rc)
		rc = incise_conf_integer(group, path, "steps_per_turn", 1, 100000,
					 &actuator->steps_per_turn, err);
	if (!rc)
		rc = incise_conf_integer(group, path, "microsteps", 1, 1024,
					 &actuator->microsteps, err);
	if (!rc)
		rc = incise_conf_direction(group, path, "direction", actuator->direction,
					   err);
	if (!rc)
		rc = incise_conf_bool(group, path, "invert", &actuator->invert, err);
	if (!rc)
		rc = incise_conf_bool(group, path, "retract", &actuator->retract, err);
	if (!rc)
		rc = read_lines(actuator, group, path, err);
	if (!rc)
		rc = incise_actuator_can_read(&actuator->can, actuator->travel_mm, group,
					      path, err);
	if (isnan(actuator->home_mm_s))
		actuator->home_mm_s = fmin(2, actuator->velocity_mm_s);
	return rc ? rc : check(actuator, group, path, err);
}
