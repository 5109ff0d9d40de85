// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The group actuator.can of rig.conf: a drive on a CAN bus.
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
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <string.h>
#include "actuator_can.h"

#define DELAY_CYCLES 3
#define NS_PER_US 1000
/* An object of the interpolation period, 60C2, is a byte times a power of ten: 1.25 ms is
 * 125 of 10 µs. In this range each whole number of 10 µs is one, and nothing else. */
#define CYCLE_UNIT_US 10

double incise_actuator_can_gain_1_s(double cycle_s)
{
	return sin(M_PI / (2 * (2 * DELAY_CYCLES + 1))) / cycle_s;
}

/* A key for a number of the struct, with its unit there. */
struct number {
	const char *key;
	double min, max, unit; /* unit: of the key in that of the field */
	size_t offset;
};

#define NUMBER(key, min, max, unit, field)                                       \
	{                                                                        \
		key, min, max, unit, offsetof(struct incise_actuator_can, field) \
	}

static const struct number numbers[] = {
	NUMBER("counts_per_turn", 1, 1e9, 1, counts_per_turn),
	NUMBER("velocity_per_turn_s", 1, 1e9, 1, velocity_per_turn_s),
	NUMBER("acceleration_per_turn_s2", 1, 1e9, 1, acceleration_per_turn_s2),
	NUMBER("following_ms", 1, 10000, 1e-3, following_s),
	NUMBER("position_gain_1_s", 0.1, 10000, 1, position_gain_1_s),
	NUMBER("stiffness_permille_mm", 0.001, 1e6, 1, stiffness_permille_mm),
	NUMBER("damping_permille_s_mm", 0, 1e6, 1, damping_permille_s_mm),
	NUMBER("torque_max_permille", 1, 1000, 1, torque_max_permille),
};

static int read_numbers(struct incise_actuator_can *can, double travel_mm,
			const config_setting_t *group, const char *path,
			struct incise_error *err)
{
	int rc = incise_conf_number(group, path, "following_mm", 0.001, travel_mm,
				    &can->following_mm, err);

	for (size_t i = 0; i < sizeof(numbers) / sizeof(*numbers) && !rc; i++) {
		double value = NAN;

		rc = incise_conf_number(group, path, numbers[i].key, numbers[i].min,
					numbers[i].max, &value, err);
		if (!isnan(value))
			*(double *)((char *)can + numbers[i].offset) =
				value * numbers[i].unit;
	}
	return rc;
}

static int line_of(const config_setting_t *group, const char *key)
{
	const config_setting_t *setting = config_setting_get_member(group, key);

	return config_setting_source_line(setting ? setting : group);
}

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
		"%.200s:%d: actuator.can.cycle_us: expected a whole number of %d us, as a "
		"drive keeps it in a byte, found %d; give %d or %d",
		path, line_of(group, "cycle_us"), CYCLE_UNIT_US, us,
		us - us % CYCLE_UNIT_US, us - us % CYCLE_UNIT_US + CYCLE_UNIT_US);
}

/* Check keys that a mode requires, and combinations. */
static int check(const struct incise_actuator_can *can, const config_setting_t *group,
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
				"%.200s:%d: actuator.can.%s is missing: in mode \"cst\" the "
				"loop is closed here, and only you know this motor; add it",
				path, line_of(group, "mode"), needed[i]);
	if (can->mode == INCISE_ACTUATOR_CSV && can->position_gain_1_s > most_1_s)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator.can.position_gain_1_s: expected at most %.1f "
			"1/s, half of what is stable over a bus with cycle_us = %u, found "
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
	static const char *const keys[] = {"mode",
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
	rc = incise_conf_known(own, path, keys, err);
	if (!rc)
		rc = read_mode(can, own, path, err);
	if (!rc)
		rc = read_bitrate(can, own, path, err);
	if (!rc)
		rc = read_cycle(can, own, path, err);
	if (!rc)
		rc = read_numbers(can, travel_mm, own, path, err);
	if (!rc)
		rc = incise_conf_integer(own, path, "homing_method", -128, 127,
					 &can->homing_method, err);
	if (!rc)
		rc = incise_conf_bool(own, path, "absolute", &can->absolute, err);
	if (!rc)
		rc = incise_conf_integer(own, path, "master", 1, 127, &can->master, err);
	return rc ? rc : check(can, own, path, err);
}
