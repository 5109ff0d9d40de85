// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What the words of a CiA 402 drive mean, and its PDOs; nothing here waits or fails.
 *
 *   statusword   bit 6 5 . 3 2 1 0
 *                    │ │   │ ╰─┴─┴── operation enabled, switched on, ready
 *                    │ │   ╰── fault
 *                    │ ╰── no quick stop
 *                    ╰── switch-on disabled
 */
#include <string.h>
#include "cia402.h"

#define RPDO1_LENGTH 6
#define RPDO1_LENGTH_CST 4
#define TPDO1_LENGTH 6
#define TPDO2_LENGTH 4
#define NODE 0x7fu

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

uint16_t cia402_up(enum cia402_state state)
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

void cia402_put(struct can_frame *frame, uint8_t node, enum cia402_mode mode,
		uint16_t controlword, int32_t target)
{
	memset(frame, 0, sizeof(*frame));
	frame->can_id = CANOPEN_RPDO1 + (node & NODE);
	canopen_pack(frame->data, 2, controlword);
	if (mode == CIA402_CST) {
		frame->len = RPDO1_LENGTH_CST;
		target = target > INT16_MAX ? INT16_MAX : target;
		target = target < INT16_MIN ? INT16_MIN : target;
		canopen_pack(frame->data + 2, 2, (uint32_t)target);
	} else {
		frame->len = RPDO1_LENGTH;
		canopen_pack(frame->data + 2, 4, (uint32_t)target);
	}
}

/* A data frame of that function, long enough. */
static bool is_pdo(const struct can_frame *frame, uint32_t function, unsigned int length)
{
	return !(frame->can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) &&
	       (frame->can_id & CAN_SFF_MASK & ~NODE) == function &&
	       frame->len >= length && frame->len <= CAN_MAX_DLEN;
}

bool cia402_get(const struct can_frame *frame, uint16_t *statusword, int32_t *position)
{
	if (!is_pdo(frame, CANOPEN_TPDO1, TPDO1_LENGTH))
		return false;
	*statusword = (uint16_t)canopen_unpack(frame->data, 2);
	*position = (int32_t)canopen_unpack(frame->data + 2, 4);
	return true;
}

bool cia402_get_inputs(const struct can_frame *frame, uint32_t *inputs)
{
	if (!is_pdo(frame, CANOPEN_TPDO2, TPDO2_LENGTH))
		return false;
	*inputs = canopen_unpack(frame->data, 4);
	return true;
}
