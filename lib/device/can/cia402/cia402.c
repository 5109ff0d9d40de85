// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The words of a CiA 402 drive, its PDOs, and its objects by SDO; see cia402.h.
 *
 *   statusword   bit 6 5 . 3 2 1 0
 *                    │ │   │ ╰─┴─┴── operation enabled, switched on, ready
 *                    │ │   ╰── fault
 *                    │ ╰── no quick stop
 *                    ╰── switch-on disabled
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "cia402.h"

#define RPDO1_LENGTH 6
#define RPDO1_LENGTH_CST 4
#define TPDO1_LENGTH 6
#define TPDO2_LENGTH 4
#define NODE 0x7fu

#define ABORT_NO_OBJECT 0x06020000
#define ABORT_NO_SUB 0x06090011
#define POLL_NS 2000000

const struct cia402_object cia402_statusword = {0x6041, 0, 2, "statusword"};

enum cia402_state cia402_state(uint16_t statusword)
{
	switch (statusword & 0x4f) {
	case 0x00:
		return CIA402_NOT_READY;
	case 0x40:
		return CIA402_DISABLED;
	case 0x0f:
		return CIA402_FAULT_REACTION;
	case 0x08:
		return CIA402_FAULT;
	}
	switch (statusword & 0x6f) {
	case 0x21:
		return CIA402_READY;
	case 0x23:
		return CIA402_SWITCHED_ON;
	case 0x27:
		return CIA402_ENABLED;
	case 0x07:
		return CIA402_QUICK_STOP;
	}
	return CIA402_UNKNOWN;
}

const char *cia402_state_name(enum cia402_state state)
{
	static const char *const names[] = {
		[CIA402_NOT_READY] = "not ready to switch on",
		[CIA402_DISABLED] = "switch-on disabled",
		[CIA402_READY] = "ready to switch on",
		[CIA402_SWITCHED_ON] = "switched on",
		[CIA402_ENABLED] = "operation enabled",
		[CIA402_QUICK_STOP] = "quick stop active",
		[CIA402_FAULT_REACTION] = "fault reaction active",
		[CIA402_FAULT] = "fault",
	};

	return (unsigned int)state < CIA402_UNKNOWN ? names[state] : "unknown";
}

bool cia402_powered(enum cia402_state state)
{
	switch (state) {
	case CIA402_NOT_READY:
	case CIA402_DISABLED:
	case CIA402_READY:
	case CIA402_FAULT:
		return false;
	case CIA402_SWITCHED_ON:
	case CIA402_ENABLED:
	case CIA402_QUICK_STOP:
	case CIA402_FAULT_REACTION:
	case CIA402_UNKNOWN:
		break;
	}
	return true;
}

const char *cia402_mode_name(int mode)
{
	static const char *const names[] = {
		"none (0)",
		"profile position (1)",
		"velocity (2)",
		"profile velocity (3)",
		"profile torque (4)",
		"reserved (5)",
		"homing (6)",
		"interpolated position (7)",
		"CSP (8)",
		"CSV (9)",
		"CST (10)",
		"CST with commutation angle (11)",
	};

	if (mode < 0)
		return "manufacturer's own";
	return mode < (int)(sizeof(names) / sizeof(names[0])) ? names[mode] : "unknown";
}

uint16_t cia402_next_controlword(enum cia402_state state)
{
	switch (state) {
	case CIA402_DISABLED:
		return CIA402_SHUTDOWN;
	case CIA402_READY:
		return CIA402_SWITCH_ON;
	case CIA402_SWITCHED_ON:
	case CIA402_ENABLED:
		return CIA402_ENABLE;
	case CIA402_NOT_READY:
	case CIA402_QUICK_STOP:
	case CIA402_FAULT_REACTION:
	case CIA402_FAULT:
	case CIA402_UNKNOWN:
		break;
	}
	return CIA402_DISABLE_VOLTAGE;
}

void cia402_pack_rpdo(struct can_frame *frame, uint8_t node, enum cia402_mode mode,
		      uint16_t controlword, int32_t target)
{
	memset(frame, 0, sizeof(*frame));
	frame->can_id = CANOPEN_RPDO1 + (node & NODE);
	canopen_pack(frame->data, 2, controlword);
	if (mode == CIA402_CST) {
		frame->can_dlc = RPDO1_LENGTH_CST;
		target = target > INT16_MAX ? INT16_MAX : target;
		target = target < INT16_MIN ? INT16_MIN : target;
		canopen_pack(frame->data + 2, 2, (uint32_t)target);
	} else {
		frame->can_dlc = RPDO1_LENGTH;
		canopen_pack(frame->data + 2, 4, (uint32_t)target);
	}
}

/* Returns whether it is a data frame of that function, long enough. */
static bool is_pdo(const struct can_frame *frame, uint32_t function, unsigned int length)
{
	return !(frame->can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) &&
	       (frame->can_id & CAN_SFF_MASK & ~NODE) == function &&
	       frame->can_dlc >= length && frame->can_dlc <= CAN_MAX_DLEN;
}

bool cia402_parse_status(const struct can_frame *frame, uint16_t *statusword,
			 int32_t *position, int *mode)
{
	if (!is_pdo(frame, CANOPEN_TPDO1, TPDO1_LENGTH))
		return false;
	*statusword = (uint16_t)canopen_unpack(frame->data, 2);
	*position = (int32_t)canopen_unpack(frame->data + 2, 4);
	if (frame->can_dlc > TPDO1_LENGTH)
		*mode = (int8_t)frame->data[TPDO1_LENGTH];
	return true;
}

bool cia402_parse_inputs(const struct can_frame *frame, uint32_t *inputs)
{
	if (!is_pdo(frame, CANOPEN_TPDO2, TPDO2_LENGTH))
		return false;
	*inputs = canopen_unpack(frame->data, 4);
	return true;
}

/* --- objects by SDO --- */

/* Returns whether the failed SDO was about an object that the drive does not have. */
static bool is_absent(const struct canopen *master, int rc)
{
	return rc == -EREMOTEIO &&
	       (master->abort == ABORT_NO_OBJECT || master->abort == ABORT_NO_SUB);
}

int cia402_error(const struct cia402_client *client, int code, const char *format, ...)
{
	char text[sizeof(client->err->text)];
	va_list args;

	va_start(args, format);
	vsnprintf(text, sizeof(text), format, args);
	va_end(args);
	return incise_error_set(client->err, code, "%s: %s", client->where, text);
}

int cia402_fail(const struct cia402_client *client, const struct cia402_object *object,
		const char *action, int rc)
{
	char what[80], why[100];

	snprintf(what, sizeof(what), "%s (%04X:%u)", object->name, object->index,
		 object->sub);
	switch (rc) {
	case -EREMOTEIO:
		return cia402_error(client, EOPNOTSUPP,
				    "the drive does not allow its %s to be %s: %s; "
				    "check its manual and its firmware",
				    what, action,
				    canopen_abort_text(client->master->abort, why,
						       sizeof(why)));
	case -ETIMEDOUT:
		if (client->master->late_ns)
			return cia402_error(
				client, ETIMEDOUT,
				"an answer came late, after %d ms, when %s was "
				"to be %s; give a larger actuator.can.answer_ms "
				"in rig.conf",
				(int)(client->master->late_ns / 1000000), what, action);
		return cia402_error(client, ETIMEDOUT,
				    "no answer when %s was to be %s; check the drive's "
				    "power, its wiring, node id and bit rate",
				    what, action);
	case -EPROTO:
		return cia402_error(client, EPROTO,
				    "invalid answer when %s was to be %s; check that "
				    "no other node has this id and that it is a CiA "
				    "402 drive",
				    what, action);
	case -EINTR:
		return cia402_error(client, EINTR, "stopped when %s was to be %s", what,
				    action);
	default:
		return cia402_error(client, -rc,
				    "the bus %s failed when %s was to be %s: %s; check "
				    "`ip -details link`, cables and termination",
				    client->master->bus->name, what, action,
				    strerror(-rc));
	}
}

static int read_object(const struct cia402_client *client,
		       const struct cia402_object *object, uint32_t *value)
{
	return canopen_read(client->master, object->index, object->sub, object->size,
			    value);
}

static int write_object(const struct cia402_client *client,
			const struct cia402_object *object, uint32_t value)
{
	return canopen_write(client->master, object->index, object->sub, object->size,
			     value);
}

static uint32_t truncate(const struct cia402_object *object, uint32_t value)
{
	return object->size < 4 ? value & ((1u << 8 * object->size) - 1) : value;
}

int cia402_read(const struct cia402_client *client, const struct cia402_object *object,
		uint32_t *value)
{
	int rc = read_object(client, object, value);

	return rc ? cia402_fail(client, object, "read", rc) : 0;
}

int cia402_write(const struct cia402_client *client, const struct cia402_object *object,
		 uint32_t value)
{
	int rc = write_object(client, object, value);

	return rc ? cia402_fail(client, object, "written", rc) : 0;
}

static int verify(const struct cia402_client *client, const struct cia402_object *object,
		  uint32_t value)
{
	uint32_t kept;
	int rc = cia402_read(client, object, &kept);

	if (rc || kept == truncate(object, value))
		return rc;
	return cia402_error(client, EPROTO,
			    "the drive did not keep %s (%04X:%u): %lld was written, "
			    "%lld is read (%Xh); check the range in its manual",
			    object->name, object->index, object->sub,
			    (long long)truncate(object, value), (long long)kept, kept);
}

int cia402_write_verified(const struct cia402_client *client,
			  const struct cia402_object *object, uint32_t value)
{
	int rc = cia402_write(client, object, value);

	return rc ? rc : verify(client, object, value);
}

int cia402_read_optional(const struct cia402_client *client,
			 const struct cia402_object *object, uint32_t *value, bool *has)
{
	int rc = read_object(client, object, value);

	*has = !rc;
	if (!rc || is_absent(client->master, rc))
		return 0;
	return cia402_fail(client, object, "read", rc);
}

int cia402_write_optional(const struct cia402_client *client,
			  const struct cia402_object *object, uint32_t value, bool *has)
{
	int rc = write_object(client, object, value);

	*has = !rc;
	if (is_absent(client->master, rc))
		return 0;
	return rc ? cia402_fail(client, object, "written", rc)
		  : verify(client, object, value);
}

int cia402_ensure(const struct cia402_client *client, const struct cia402_object *object,
		  uint32_t value)
{
	uint32_t is;
	int rc = cia402_read(client, object, &is);

	if (rc || is == truncate(object, value))
		return rc;
	return cia402_write_verified(client, object, value);
}

int cia402_pause(const struct cia402_client *client, int64_t ns)
{
	struct can_bus *bus = client->master->bus;
	int rc = canopen_await(client->master, NULL, bus->ops->now(bus) + ns);

	return rc ? cia402_fail(client, &cia402_statusword, "read", rc) : 0;
}

int cia402_read_state(const struct cia402_client *client, enum cia402_state *state)
{
	uint32_t word;
	int rc = cia402_read(client, &cia402_statusword, &word);

	if (!rc)
		*state = cia402_state((uint16_t)word);
	return rc;
}

int cia402_await_state(const struct cia402_client *client,
		       bool (*done)(enum cia402_state state), int64_t timeout_ns,
		       enum cia402_state *state)
{
	struct can_bus *bus = client->master->bus;
	int64_t until_ns = bus->ops->now(bus) + timeout_ns;
	int rc;

	for (;;) {
		rc = cia402_read_state(client, state);
		if (rc)
			return rc;
		if (done(*state))
			return 0;
		if (bus->ops->now(bus) >= until_ns)
			return -ETIME;
		rc = cia402_pause(client, POLL_NS);
		if (rc)
			return rc;
	}
}
