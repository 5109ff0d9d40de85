// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A drive's power, faults and mode, by SDO: for a drive that does not move. Nothing here
 * leads towards operation enabled.
 */
#include <errno.h>
#include "cia402_object.h"

#define MS_NS 1000000LL
#define RAMP_NS (2000 * MS_NS)	/* for a quick stop, a fault reaction, a brake */
#define RESET_NS (500 * MS_NS)	/* for a fault to go */
#define CHANGE_NS (500 * MS_NS) /* for a mode to be taken */
#define POLL_NS (2 * MS_NS)

static const struct cia402_object error_code = {0x603f, 0, 2, "error code"};

static bool without_power(enum cia402_state state)
{
	return !cia402_powered(state);
}

static bool out_of_fault(enum cia402_state state)
{
	return state == CIA402_DISABLED || state == CIA402_READY;
}

#define STOP_NS 500000000

int cia402_power_off(struct canopen *master, const char *where, struct incise_error *err)
{
	const struct cia402_talk talk = {master, where, err};
	enum cia402_state state = CIA402_UNKNOWN;
	uint32_t word = 0;
	int rc = cia402_ask(&talk, &cia402_statusword, &word);

	/* One that moves is given its ramp; if it stays in its quick stop, no more of that. */
	if (!rc && cia402_state((uint16_t)word) == CIA402_ENABLED) {
		rc = cia402_tell(&talk, &cia402_controlword, CIA402_QUICK_STOP_COMMAND);
		if (!rc)
			rc = cia402_watch(&talk, without_power, STOP_NS, &state);
		if (rc == -ETIME)
			rc = 0;
	}
	if (!rc)
		rc = cia402_tell(&talk, &cia402_controlword, CIA402_DISABLE_VOLTAGE);
	if (!rc)
		rc = cia402_watch(&talk, without_power, RAMP_NS, &state);
	if (rc == -ETIME)
		return incise_error_set(err, ETIMEDOUT,
					"%s: the drive still has power (%s) after it was "
					"told to take it away; switch its supply off",
					where, cia402_state_name(state));
	return rc;
}

/* Why it stays in its fault. */
static int stays(const struct cia402_talk *talk)
{
	uint16_t code = talk->master->emcy.code;
	uint32_t value = 0;
	bool has = false;
	char text[100];
	int rc = cia402_ask_if(talk, &error_code, &value, &has);

	if (rc)
		return rc;
	if (has && value)
		code = (uint16_t)value;
	return incise_error_set(talk->err, EBUSY,
				"%s: the drive stays in its fault: %s; remove the cause, "
				"then clear again",
				talk->where, canopen_emcy_text(code, text, sizeof(text)));
}

int cia402_clear(struct canopen *master, const char *where, struct incise_error *err)
{
	const struct cia402_talk talk = {master, where, err};
	enum cia402_state state = CIA402_UNKNOWN;
	/* Down first: what follows must be a rising edge, and must not find an "enable". */
	int rc = cia402_power_off(master, where, err);

	if (!rc)
		rc = cia402_watch(&talk, without_power, RAMP_NS, &state);
	if (rc || state != CIA402_FAULT)
		return rc == -ETIME ? stays(&talk) : rc;
	rc = cia402_tell(&talk, &cia402_controlword, CIA402_FAULT_RESET);
	if (!rc)
		rc = cia402_watch(&talk, out_of_fault, RESET_NS, &state);
	if (rc && rc != -ETIME)
		return rc;
	if (rc == -ETIME)
		return stays(&talk);
	return cia402_tell(&talk, &cia402_controlword, CIA402_DISABLE_VOLTAGE);
}

int cia402_set_mode(struct canopen *master, enum cia402_mode mode, const char *where,
		    struct incise_error *err)
{
	const struct cia402_talk talk = {master, where, err};
	struct can_bus *bus = master->bus;
	int rc = cia402_tell(&talk, &cia402_operation, (uint32_t)mode);
	int64_t until_ns = bus->ops->now(bus) + CHANGE_NS;
	uint32_t is = 0;

	while (!rc) {
		rc = cia402_ask(&talk, &cia402_operation_now, &is);
		if (rc || is == (uint32_t)mode)
			break;
		if (bus->ops->now(bus) >= until_ns)
			return incise_error_set(
				err, ETIMEDOUT,
				"%s: the drive does not take the mode %s and stays in %s; "
				"see its manual",
				where, cia402_mode_name(mode),
				cia402_mode_name((int8_t)is));
		rc = cia402_pause(&talk, POLL_NS);
	}
	return rc;
}
