/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A drive by CiA 402 (IEC 61800-7-201): its state machine, units, limits and PDOs. Values are
 * in the drive's own units, "counts" for positions.
 *
 *   not ready ─▶ switch-on disabled ─▶ ready ─▶ switched on ─▶ operation enabled
 *                   ▲        ▲        shutdown  switch on      enable
 *        fault reset│        ╰──────── quick stop active ◀───── quick stop
 *                 fault ◀─ fault reaction ◀─ (any)
 *
 *   RPDO1, with SYNC:  6040 controlword (16)  target (32; 16 for torque)
 *   TPDO1, at SYNC:    6041 statusword (16)   6064 position (32)   [6061 mode (8)]
 *   TPDO2, at change:  60FD digital inputs (32), if it has them
 */
#ifndef INCISE_CIA402_H
#define INCISE_CIA402_H

#include "../canopen/canopen.h"

enum cia402_state {
	CIA402_NOT_READY,
	CIA402_DISABLED, /* switch-on disabled */
	CIA402_READY,
	CIA402_SWITCHED_ON,
	CIA402_ENABLED, /* operation enabled */
	CIA402_QUICK_STOP,
	CIA402_FAULT_REACTION,
	CIA402_FAULT,
	CIA402_UNKNOWN, /* the statusword has no state */
};

/* 6060 */
enum cia402_mode {
	CIA402_HOMING = 6,
	CIA402_CSP = 8,
	CIA402_CSV = 9,
	CIA402_CST = 10,
};

/* Bits of the controlword. */
#define CIA402_SHUTDOWN 0x06
#define CIA402_SWITCH_ON 0x07
#define CIA402_ENABLE 0x0f
#define CIA402_HOME_START 0x1f /* in homing mode */
#define CIA402_QUICK_STOP_COMMAND 0x02
#define CIA402_DISABLE_VOLTAGE 0x00
#define CIA402_FAULT_RESET 0x80 /* at its rising edge */

/* Bits of the statusword next to the state. */
#define CIA402_REMOTE 0x0200
#define CIA402_TARGET_REACHED 0x0400
#define CIA402_LIMIT_ACTIVE 0x0800
#define CIA402_HOMED 0x1000 /* in homing mode; in cyclic ones: follows its targets */
#define CIA402_FOLLOWING_ERROR 0x2000 /* in cyclic modes; in homing: homing failed */

/* Bits of 60FD. */
#define CIA402_AT_MIN 0x1 /* negative limit switch */
#define CIA402_AT_MAX 0x2
#define CIA402_AT_HOME 0x4
#define CIA402_INTERLOCK 0x8

enum cia402_state cia402_state(uint16_t statusword);
const char *cia402_state_name(enum cia402_state state); /* "operation enabled" … */

/* Returns whether the motor may have power in this state. */
bool cia402_powered(enum cia402_state state);

/* Returns "CSP (8)"; for any number that 6061 may have. */
const char *cia402_mode_name(int mode);

/*
 * Returns the controlword for the next step from a state to operation enabled, or to stay
 * there. 0 (disable voltage) in a fault, which only the user's clear resets.
 */
uint16_t cia402_next_controlword(enum cia402_state state);

/* RPDO1; a @target of 32 bits, of 16 in CST. */
void cia402_pack_rpdo(struct can_frame *frame, uint8_t node, enum cia402_mode mode,
		      uint16_t controlword, int32_t target);

/* TPDO1 and TPDO2. Return false for another frame or a short one. *mode stays without 6061. */
bool cia402_parse_status(const struct can_frame *frame, uint16_t *statusword,
			 int32_t *position, int *mode);
bool cia402_parse_inputs(const struct can_frame *frame, uint32_t *inputs);

/* --- by SDO: functions that return 0, or a negative errno with a message --- */

struct cia402_client {
	struct canopen *master;
	const char *where; /* prefix of messages */
	struct incise_error *err;
};

struct cia402_object {
	uint16_t index;
	uint8_t sub, size; /* bytes */
	const char *name;
};

extern const struct cia402_object cia402_statusword;

/*
 * Read; write; write and read back. Errors: -EOPNOTSUPP (aborted), -ETIMEDOUT, -EPROTO (an
 * invalid answer; the drive did not keep the value), or one of the bus.
 */
int cia402_read(const struct cia402_client *client, const struct cia402_object *object,
		uint32_t *value);
int cia402_write(const struct cia402_client *client, const struct cia402_object *object,
		 uint32_t value);
int cia402_write_verified(const struct cia402_client *client,
			  const struct cia402_object *object, uint32_t value);

/* Read, or write and read back, an object that the drive may lack: then *has is false. */
int cia402_read_optional(const struct cia402_client *client,
			 const struct cia402_object *object, uint32_t *value, bool *has);
int cia402_write_optional(const struct cia402_client *client,
			  const struct cia402_object *object, uint32_t value, bool *has);

/* Write only a value that differs: in some drives the object is read-only. */
int cia402_ensure(const struct cia402_client *client, const struct cia402_object *object,
		  uint32_t value);

/* Make a message that starts with client->where. Returns -code. */
int cia402_error(const struct cia402_client *client, int code, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* Make the message for @rc of canopen_read() or canopen_write(). Returns the error. */
int cia402_fail(const struct cia402_client *client, const struct cia402_object *object,
		const char *action, int rc);

/* Read the statusword's state. */
int cia402_read_state(const struct cia402_client *client, enum cia402_state *state);

/* Poll the statusword until @done returns true for *state. -ETIME has no message. */
int cia402_await_state(const struct cia402_client *client,
		       bool (*done)(enum cia402_state state), int64_t timeout_ns,
		       enum cia402_state *state);

/* Wait; received frames are handled meanwhile. */
int cia402_pause(const struct cia402_client *client, int64_t ns);

#define CIA402_PROFILE 402 /* low half of 1000, device type */

/* Check that the node is a drive. -ENODEV (no answer), -EPROTO (no CiA 402 drive). */
int cia402_identify(const struct cia402_client *client);

/* The drive's units per turn of the screw. */
struct cia402_units {
	double counts_per_turn;
	double velocity_per_turn_s;
	double acceleration_per_turn_s2;
};

/*
 * Read the drive's factors: for positions 6092 (feed constant), else 608F and 6091 (encoder
 * resolution, gear ratio), or 60A8 (SI unit) if it is an angle or increments; for velocity and
 * acceleration 60A9 and 60AA (SI units), else counts/s and counts/s². Fields other than 0, from
 * rig.conf, stay. -EPROTO: missing, impossible or contradicting factors, which rig.conf must have.
 */
int cia402_read_units(const struct cia402_client *client, struct cia402_units *units);

/* The setup of a drive before it may move, in its units. */
struct cia402_setup {
	enum cia402_mode mode;
	bool mode_mapped;  /* 6061 in TPDO1, for drives that show it with power only */
	uint32_t cycle_ns; /* 60C2; a digit times a power of ten, as the drive keeps it */
	uint32_t deadman_ms;   /* silence of this side before the drive quick-stops */
	uint8_t master;	       /* node id of this side's heartbeat */
	uint32_t heartbeat_ms; /* 1017: period of the drive's heartbeat */
	int32_t position_min, position_max; /* 607D */
	uint32_t velocity;		    /* 607F: largest */
	uint32_t acceleration;	  /* 60C5, 60C6: largest; 6085: of a quick stop */
	uint32_t following;	  /* 6065 */
	uint16_t following_ms;	  /* 6066 */
	uint16_t torque_permille; /* 6072; 0: unchanged */
};

#define CIA402_INPUTS_MS 100

/* The optional parts that the drive accepted. */
struct cia402_supported {
	bool inputs;	   /* 60FD comes in TPDO2 … */
	bool inputs_timed; /* … each CIA402_INPUTS_MS also without a change */
};

/*
 * Set up a drive without power, also after it rebooted: pre-operational, PDOs, heartbeats,
 * EMCY, reaction to silence of this side (6007: quick stop; 605A: ramp, then without power),
 * limits, mode, interpolation period; then operational. It reads back everything that matters.
 * From then on the master's heartbeats (own, heartbeat_ns) keep the drive's deadman off. About
 * 100 SDOs; a failure ends within seconds.
 *
 * -EINVAL (impossible setup), -EBUSY (it has power), -EOPNOTSUPP (it lacks a required object:
 * heartbeat consumer, abort connection option, the mode …; the message names it), -ETIMEDOUT,
 * -EPROTO (it did not keep a value), -EINTR, or an error of the bus.
 */
int cia402_configure(const struct cia402_client *client, const struct cia402_setup *setup,
		     struct cia402_supported *supported);

/* Write 6060, and wait until 6061 agrees. 1: it keeps 6060, and 6061 may follow with power. */
int cia402_set_mode(const struct cia402_client *client, enum cia402_mode mode);

/* Write 607D alone, if the drive has it; read whether it has it with that range. */
int cia402_set_range(const struct cia402_client *client, int32_t position_min,
		     int32_t position_max);
int cia402_has_range(const struct cia402_client *client, int32_t position_min,
		     int32_t position_max, bool *has);

/* Set how the drive homes: method 6098, speeds 6099, acceleration 609A, offset 607C = 0. */
int cia402_set_homing(const struct cia402_client *client, int method, uint32_t speed,
		      uint32_t slow, uint32_t acceleration);

/*
 * Read whether the drive's position is the machine's: enter homing mode without power,
 * read the statusword (bits 10, 12), and enter @mode again. Where 6061 needs power it is not.
 */
int cia402_read_homed(const struct cia402_client *client, enum cia402_mode mode,
		      bool *homed);

/* Reset a fault; afterwards the drive has no power. -EBUSY: the cause persists. */
int cia402_clear(const struct cia402_client *client);

/* Remove power, and wait until it is off. */
int cia402_power_off(const struct cia402_client *client);

#endif
