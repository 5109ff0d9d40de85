// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Limits that a drive holds by itself, beside those that are held here; its own units.
 */
#include <errno.h>
#include "cia402_object.h"

static const struct cia402_object ranges[] = {
	{0x607d, 1, 4, "least position"},
	{0x607d, 2, 4, "largest position"},
};
static const struct cia402_object speed = {0x607f, 0, 4, "largest speed"};
static const struct cia402_object acceleration = {0x60c5, 0, 4, "largest acceleration"};
static const struct cia402_object deceleration = {0x60c6, 0, 4, "largest deceleration"};
static const struct cia402_object window = {0x6065, 0, 4, "following error window"};
static const struct cia402_object window_ms = {0x6066, 0, 2, "following error time"};
static const struct cia402_object torque = {0x6072, 0, 2, "largest torque"};
static const struct cia402_object stop_ramp = {0x6085, 0, 4, "quick-stop deceleration"};

/*
 * The range of positions, so that at no moment the least is above the largest: some drives
 * refuse that.
 */
static int keep_range(const struct cia402_talk *talk, int32_t min, int32_t max)
{
	uint32_t end;
	int rc = cia402_ask(talk, &ranges[1], &end);

	if (!rc && min >= (int32_t)end)
		rc = cia402_tell(talk, &ranges[1], (uint32_t)max);
	if (!rc)
		rc = cia402_keep(talk, &ranges[0], (uint32_t)min);
	return rc ? rc : cia402_keep(talk, &ranges[1], (uint32_t)max);
}

int cia402_set_range(struct canopen *master, int32_t position_min, int32_t position_max,
		     const char *where, struct incise_error *err)
{
	const struct cia402_talk talk = {master, where, err};

	if (position_min >= position_max)
		return incise_error_set(
			err, EINVAL,
			"%s: a range from %d to %d is none; see travel_mm "
			"and counts_per_turn in rig.conf",
			where, position_min, position_max);
	return keep_range(&talk, position_min, position_max);
}

/* Before a machine is homed its range is not known: the drive shall not hold an old one. */
static int range(const struct cia402_talk *talk, const struct cia402_setup *setup,
		 bool *taken)
{
	uint32_t end;
	bool has;
	int rc = cia402_ask_if(talk, &ranges[1], &end, &has);

	*taken = has && setup->limited;
	if (rc || !has)
		return rc;
	if (!setup->limited)
		return keep_range(talk, INT32_MIN, INT32_MAX);
	return cia402_set_range(talk->master, setup->position_min, setup->position_max,
				talk->where, talk->err);
}

int cia402_set_limits(const struct cia402_talk *talk, const struct cia402_setup *setup,
		      struct cia402_taken *taken)
{
	bool has, both;
	int rc = range(talk, setup, &taken->position_limit);

	if (!rc && setup->velocity)
		rc = cia402_keep_if(talk, &speed, setup->velocity,
				    &taken->velocity_limit);
	if (!rc && setup->acceleration)
		rc = cia402_keep_if(talk, &acceleration, setup->acceleration,
				    &taken->acceleration_limit);
	/* Without a limit of its own, that of accelerations is that of braking too. */
	if (!rc && setup->acceleration)
		rc = cia402_keep_if(talk, &deceleration, setup->acceleration, &has);
	if (!rc && setup->acceleration)
		rc = cia402_keep_if(talk, &stop_ramp, setup->acceleration, &has);
	if (!rc && setup->following) {
		rc = cia402_keep_if(talk, &window, setup->following, &has);
		if (!rc)
			rc = cia402_keep_if(talk, &window_ms, setup->following_ms, &both);
		taken->following_limit = !rc && has;
	}
	if (!rc && setup->torque_permille)
		rc = cia402_keep_if(talk, &torque, setup->torque_permille, &has);
	return rc;
}
