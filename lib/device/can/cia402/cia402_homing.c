// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * How a drive homes by itself, and whether it has. Positions and speeds are its own units.
 *
 *   homing mode, statusword   bit 13  12  10
 *                                  0   1   1   its position is that of the machine
 *                                  1   .   .   it failed
 */
#include <errno.h>
#include "cia402_object.h"

static const struct cia402_object homing_method = {0x6098, 0, 1, "homing method"};
static const struct cia402_object homing_offset = {0x607c, 0, 4, "home offset"};
static const struct cia402_object homing_speed = {0x6099, 1, 4,
						  "homing speed to the switch"};
static const struct cia402_object homing_slow = {0x6099, 2, 4, "homing speed to zero"};
static const struct cia402_object homing_ramp = {0x609a, 0, 4, "homing acceleration"};

int cia402_set_homing(struct canopen *master, int method, uint32_t speed, uint32_t slow,
		      uint32_t acceleration, const char *where, struct incise_error *err)
{
	const struct cia402_talk talk = {master, where, err};
	bool has;
	int rc;

	if (method < INT8_MIN || method > INT8_MAX)
		return incise_error_set(err, EINVAL,
					"%s: homing method %d is none; give -128 … 127",
					where, method);
	rc = cia402_keep(&talk, &homing_method, (uint32_t)method);
	/* Without an offset object it has no offset. */
	if (!rc)
		rc = cia402_keep_if(&talk, &homing_offset, 0, &has);
	if (!rc)
		rc = cia402_keep(&talk, &homing_speed, speed);
	if (!rc)
		rc = cia402_keep(&talk, &homing_slow, slow);
	if (!rc)
		rc = cia402_keep_if(&talk, &homing_ramp, acceleration, &has);
	return rc;
}

int cia402_homed(struct canopen *master, enum cia402_mode mode, bool *homed,
		 const char *where, struct incise_error *err)
{
	const struct cia402_talk talk = {master, where, err};
	uint32_t word = 0;
	int rc = cia402_ask(&talk, &cia402_statusword, &word), back;

	*homed = false;
	if (rc)
		return rc;
	if (cia402_powered(cia402_state((uint16_t)word)))
		return incise_error_set(err, EBUSY,
					"%s: the drive has power (%s); disable it before "
					"it is asked whether it is homed",
					where,
					cia402_state_name(cia402_state((uint16_t)word)));
	rc = cia402_set_mode(master, CIA402_HOMING, where, err);
	if (!rc)
		rc = cia402_ask(&talk, &cia402_statusword, &word);
	if (!rc)
		*homed = word & CIA402_HOMED && word & CIA402_TARGET_REACHED &&
			 !(word & CIA402_FOLLOWING_ERROR);
	/* Whatever it said; what went wrong first is what is told. */
	back = cia402_set_mode(master, mode, where, rc ? NULL : err);
	return rc ? rc : back;
}
