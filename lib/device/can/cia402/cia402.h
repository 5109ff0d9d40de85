/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A drive by CiA 402 (IEC 61800-7-201): its state machine, units, limits and PDOs. Values are
 * the drive's own units, "counts" for positions; who uses this makes mm of them.
 *
 *   not ready ─▶ switch-on disabled ─▶ ready ─▶ switched on ─▶ operation enabled
 *                   ▲        ▲        shutdown  switch on      enable
 *        fault reset│        ╰──────── quick stop active ◀───── quick stop
 *                 fault ◀─ fault reaction ◀─ (any)
 *
 *   RPDO1, with SYNC:  6040 controlword (16)  target (32; 16 for torque)
 *   TPDO1, at SYNC:    6041 statusword (16)   6064 position (32)
 *   TPDO2, at change:  60FD digital inputs (32), where it has them
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
	CIA402_UNKNOWN, /* a statusword of no state */
};

/* 6060 */
enum cia402_mode {
	CIA402_NO_MODE = 0,
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

/* Bits of the statusword beside the state. */
#define CIA402_WARNING 0x0080
#define CIA402_REMOTE 0x0200
#define CIA402_TARGET_REACHED 0x0400
#define CIA402_LIMIT_ACTIVE 0x0800
#define CIA402_HOMED 0x1000 /* in homing mode; in cyclic ones: it follows its targets */
#define CIA402_FOLLOWING_ERROR 0x2000 /* in cyclic modes; in homing: homing failed */

/* Bits of 60FD. */
#define CIA402_AT_MIN 0x1 /* negative limit switch */
#define CIA402_AT_MAX 0x2
#define CIA402_AT_HOME 0x4
#define CIA402_INTERLOCK 0x8

enum cia402_state cia402_state(uint16_t statusword);
const char *cia402_state_name(enum cia402_state state); /* "operation enabled" … */

/* Whether it may have power on its motor, as far as its state tells. */
bool cia402_powered(enum cia402_state state);

/* "CSP (8)"; any number, as 6061 has it. */
const char *cia402_mode_name(int mode);

/*
 * The controlword of the next step from a state to operation enabled; one to stay there. 0
 * (disable voltage) in a fault: only a person's clear resets that.
 */
uint16_t cia402_up(enum cia402_state state);

/* What it is. What it does not tell is 0 or empty. */
struct cia402_identity {
	uint32_t type;	 /* 1000: low half 402 of a drive */
	uint32_t vendor; /* 1018 */
	uint32_t product, revision, serial;
	char name[64];	/* 1008 */
	uint32_t modes; /* 6502: bit mode - 1 */
};

/*
 * Who answers at this node, and that it is a drive. @where begins the message. 0;
 * -ENODEV (nobody answers), -EPROTO (no CiA 402 drive).
 */
int cia402_identify(struct canopen *master, struct cia402_identity *identity,
		    const char *where, struct incise_error *err);

/* How many of its units make a turn of the screw. */
struct cia402_units {
	double counts_per_turn;
	double velocity_per_turn_s;
	double acceleration_per_turn_s2;
};

/*
 * By the drive's own factors: positions by 6092 (feed constant), else 608F and 6091 (encoder
 * resolution, gear ratio), or by 60A8 (SI unit) where that names an angle or increments;
 * velocity and acceleration by 60A9 and 60AA (SI units) where it has them, else counts/s and
 * counts/s². A field that is not 0 before is kept: rig.conf's.
 * 0; -EPROTO (it does not say, or says what makes no sense: rig.conf must).
 */
int cia402_units(struct canopen *master, struct cia402_units *units, const char *where,
		 struct incise_error *err);

/* What a drive is told before it may move; in its units. */
struct cia402_setup {
	enum cia402_mode mode;
	uint32_t cycle_ns; /* 60C2; a digit times a power of ten, as it holds them */
	uint32_t
		deadman_ms; /* silence of this side after which it quick-stops by itself */
	uint8_t master;	    /* node id of this side's heartbeat */
	uint32_t heartbeat_ms; /* its own heartbeat: 1017 */
	bool limited;	       /* the range of positions is that of the machine */
	int32_t position_min, position_max; /* 607D */
	uint32_t velocity;		    /* 607F: largest */
	uint32_t acceleration;	  /* 60C5, 60C6: largest; 6085: of a quick stop */
	uint32_t following;	  /* 6065 */
	uint16_t following_ms;	  /* 6066 */
	uint16_t torque_permille; /* 6072; 0: as it is */
};

#define CIA402_INPUTS_MS 100

/* What it took of it; what it does not have it cannot watch over. */
struct cia402_taken {
	bool inputs;	   /* 60FD comes in TPDO2 … */
	bool inputs_timed; /* … also when nothing changed, each CIA402_INPUTS_MS */
	bool position_limit, velocity_limit, acceleration_limit, following_limit;
};

/*
 * Set a drive up that has no power: to pre-operational, PDOs, heartbeats, EMCY, what it does
 * when this side is silent (6007: quick stop) and how it does (605A: ramp, then without
 * power), limits, mode, interpolation period; then to operational. All that matters is read
 * back. Also after it rebooted. @master sends heartbeats from then on (own, heartbeat_ns): they are
 * what keeps the drive's deadman off. About 100 SDOs; in vain, it ends within seconds.
 *
 * 0; -EINVAL (setup that cannot be), -EBUSY (it has power), -EOPNOTSUPP (it lacks what is
 * needed: heartbeat consumer, abort connection option, the mode …; the line says which object
 * and why), -ETIMEDOUT, -EPROTO (it did not keep what was written), -EINTR, of the bus.
 */
int cia402_configure(struct canopen *master, const struct cia402_setup *setup,
		     struct cia402_taken *taken, const char *where,
		     struct incise_error *err);

/* 6060, and until 6061 says so. 0, -ETIMEDOUT, … */
int cia402_set_mode(struct canopen *master, enum cia402_mode mode, const char *where,
		    struct incise_error *err);

/* 607D alone, after homing. */
int cia402_set_range(struct canopen *master, int32_t position_min, int32_t position_max,
		     const char *where, struct incise_error *err);

/* How the drive homes: method 6098, speeds 6099, acceleration 609A, offset 607C = 0. */
int cia402_set_homing(struct canopen *master, int method, uint32_t speed, uint32_t slow,
		      uint32_t acceleration, const char *where, struct incise_error *err);

/*
 * Whether its position is that of the machine: homing mode is entered without power and its
 * statusword asked (bits 10, 12), then @mode is entered again.
 */
int cia402_homed(struct canopen *master, enum cia402_mode mode, bool *homed,
		 const char *where, struct incise_error *err);

/*
 * Take a drive out of its fault, without power afterwards. 0; -EBUSY (the cause is still
 * there), -ETIMEDOUT.
 */
int cia402_clear(struct canopen *master, const char *where, struct incise_error *err);

/* Take its power away, by SDO; and wait until it has none. 0; -ETIMEDOUT, … */
int cia402_power_off(struct canopen *master, const char *where, struct incise_error *err);

/* RPDO1. @target of the mode's size: 32 bits, 16 in CST. */
void cia402_put(struct can_frame *frame, uint8_t node, enum cia402_mode mode,
		uint16_t controlword, int32_t target);

/* TPDO1 and TPDO2. False: too short, or not one. */
bool cia402_get(const struct can_frame *frame, uint16_t *statusword, int32_t *position);
bool cia402_get_inputs(const struct can_frame *frame, uint32_t *inputs);

#endif
