// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Power, faults, mode and homing of a drive at rest, by SDO. Nothing here leads towards
 * operation enabled. Positions and speeds are in the drive's units.
 *
 *   homing mode, statusword   bit 13  12  10
 *                                  0   1   1   its position is the machine's
 *                                  1   .   .   it failed
 */
#include <errno.h>
#include "cia402.h"

#define MS_NS 1000000LL
#define STOP_NS (500 * MS_NS)	/* for a quick stop */
#define RAMP_NS (2000 * MS_NS)	/* for a fault reaction, a brake */
#define RESET_NS (500 * MS_NS)	/* for a fault reset */
#define CHANGE_NS (500 * MS_NS) /* for a change of mode */
#define POLL_NS (2 * MS_NS)

static const struct cia402_object controlword = {0x6040, 0, 2, "controlword"};
static const struct cia402_object operation = {0x6060, 0, 1, "mode of operation"};
static const struct cia402_object operation_now = {0x6061, 0, 1,
						   "mode of operation display"};
static const struct cia402_object error_code = {0x603f, 0, 2, "error code"};
static const struct cia402_object homing_method = {0x6098, 0, 1, "homing method"};
static const struct cia402_object homing_offset = {0x607c, 0, 4, "home offset"};
static const struct cia402_object homing_speed = {0x6099, 1, 4,
						  "homing speed to the switch"};
static const struct cia402_object homing_slow = {0x6099, 2, 4, "homing speed to zero"};
static const struct cia402_object homing_ramp = {0x609a, 0, 4, "homing acceleration"};

static bool without_power(enum cia402_state state)
{
	return !cia402_powered(state);
}

static bool out_of_fault(enum cia402_state state)
{
	return state == CIA402_DISABLED || state == CIA402_READY;
}

int cia402_power_off(const struct cia402_client *client)
{
	enum cia402_state state = CIA402_UNKNOWN;
	int rc = cia402_read_state(client, &state);

	/* A drive that moves stops on its ramp, unless it stays in its quick stop. */
	if (!rc && state == CIA402_ENABLED) {
		rc = cia402_write(client, &controlword, CIA402_QUICK_STOP_COMMAND);
		if (!rc)
			rc = cia402_await_state(client, without_power, STOP_NS, &state);
		if (rc == -ETIME)
			rc = 0;
	}
	if (!rc)
		rc = cia402_write(client, &controlword, CIA402_DISABLE_VOLTAGE);
	if (!rc)
		rc = cia402_await_state(client, without_power, RAMP_NS, &state);
	if (rc == -ETIME)
		return cia402_error(client, ETIMEDOUT,
				    "the drive is still on (%s) after it was commanded "
				    "off; switch its supply off",
				    cia402_state_name(state));
	return rc;
}

/* Report why the drive stays in its fault. */
static int refuse_fault(const struct cia402_client *client)
{
	uint16_t code = client->master->emcy.code;
	uint32_t value = 0;
	bool has = false;
	char text[100];
	int rc = cia402_read_optional(client, &error_code, &value, &has);

	if (rc)
		return rc;
	if (has && value)
		code = (uint16_t)value;
	return cia402_error(client, EBUSY,
			    "the drive remains in its fault: %s; remove the cause, "
			    "then clear again",
			    canopen_emcy_text(code, text, sizeof(text)));
}

int cia402_clear(const struct cia402_client *client)
{
	enum cia402_state state = CIA402_UNKNOWN;
	/* 0 first, so that the reset is a rising edge and finds no "enable". */
	int rc = cia402_power_off(client);

	if (!rc)
		rc = cia402_await_state(client, without_power, RAMP_NS, &state);
	if (rc || state != CIA402_FAULT)
		return rc == -ETIME ? refuse_fault(client) : rc;
	rc = cia402_write(client, &controlword, CIA402_FAULT_RESET);
	if (!rc)
		rc = cia402_await_state(client, out_of_fault, RESET_NS, &state);
	if (rc && rc != -ETIME)
		return rc;
	if (rc == -ETIME)
		return refuse_fault(client);
	return cia402_write(client, &controlword, CIA402_DISABLE_VOLTAGE);
}

int cia402_set_mode(const struct cia402_client *client, enum cia402_mode mode)
{
	struct can_bus *bus = client->master->bus;
	int rc = cia402_write(client, &operation, (uint32_t)mode);
	int64_t until_ns = bus->ops->now(bus) + CHANGE_NS;
	uint32_t is = 0, kept;

	while (!rc) {
		rc = cia402_read(client, &operation_now, &is);
		if (rc || is == (uint32_t)mode)
			break;
		if (bus->ops->now(bus) >= until_ns) {
			rc = cia402_read(client, &operation, &kept);
			if (rc || kept == (uint32_t)mode)
				return rc ? rc : 1;
			return cia402_error(client, ETIMEDOUT,
					    "the drive does not accept the mode %s and "
					    "remains in %s; see its manual",
					    cia402_mode_name(mode),
					    cia402_mode_name((int8_t)is));
		}
		rc = cia402_pause(client, POLL_NS);
	}
	return rc;
}

int cia402_set_homing(const struct cia402_client *client, int method, uint32_t speed,
		      uint32_t slow, uint32_t acceleration)
{
	bool has;
	int rc;

	if (method < INT8_MIN || method > INT8_MAX)
		return cia402_error(client, EINVAL,
				    "homing method %d is invalid; give -128 … 127",
				    method);
	rc = cia402_write_verified(client, &homing_method, (uint32_t)method);
	/* A drive without the object has no offset. */
	if (!rc)
		rc = cia402_write_optional(client, &homing_offset, 0, &has);
	if (!rc)
		rc = cia402_write_verified(client, &homing_speed, speed);
	if (!rc)
		rc = cia402_write_verified(client, &homing_slow, slow);
	if (!rc)
		rc = cia402_write_optional(client, &homing_ramp, acceleration, &has);
	return rc;
}

int cia402_read_homed(const struct cia402_client *client, enum cia402_mode mode,
		      bool *homed)
{
	struct cia402_client after = *client;
	enum cia402_state state;
	uint32_t word = 0;
	int rc = cia402_read_state(client, &state), back;

	*homed = false;
	if (rc)
		return rc;
	if (cia402_powered(state))
		return cia402_error(client, EBUSY,
				    "the drive is on (%s); disable it before reading "
				    "whether it is homed",
				    cia402_state_name(state));
	rc = cia402_set_mode(client, CIA402_HOMING);
	if (!rc)
		rc = cia402_read(client, &cia402_statusword, &word);
	if (!rc)
		*homed = word & CIA402_HOMED && word & CIA402_TARGET_REACHED &&
			 !(word & CIA402_FOLLOWING_ERROR);
	/* In any case return to @mode, with the message of the first error. */
	after.err = rc < 0 ? NULL : client->err;
	back = cia402_set_mode(&after, mode);
	return rc < 0 ? rc : back < 0 ? back : 0;
}
