/* SPDX-License-Identifier: (GPL-2.0-only WITH Linux-syscall-note) OR LGPL-2.1-or-later */
/*
 * /dev/incise-stepperN: up to eight stepper motors on one controller.
 *
 *   open    O_RDWR makes the owner; there is one (EBUSY). O_RDONLY watches.
 *   mmap    page 0: set-points, written by the owner; page 1: status, read-only. A slot
 *           per motor in each. In the loop nothing else is needed: no system call.
 *   ioctl   what is set up while the motors stand.
 *   read    events, whole structs; poll shows when there is one. Each open file has a
 *           place of its own in the ring of events; a gap in seq shows what it missed.
 *
 * Lengths are microsteps ("steps"), times are nanoseconds of CLOCK_MONOTONIC. Reserved
 * fields are zero, else EINVAL. An ioctl that is not known here gives ENOTTY.
 *
 *              set_up ≥       high ≥  low ≥            hold ≥   set_up ≥
 *   dir   ────╥────────────────────────────────────────────────╥──────────
 *   step  ────╨───────────┐■■■■■■■┐_______┐■■■■■■■┐____________╨─────┐■■■■■
 *                         ╰ a step is counted at its leading edge
 *
 * Enable with a mask of motors starts the deadman: a motor whose set-point slot gets no
 * new even seq for deadman_ns is brought to rest and disabled, and so is one whose owner
 * closes the file or dies. Every fault is latched until CLEAR, and nothing moves by itself
 * after it: CLEAR leaves the motor disabled.
 */
#ifndef _UAPI_INCISE_STEPPER_H
#define _UAPI_INCISE_STEPPER_H

#include <linux/ioctl.h>
#include <linux/types.h>
#include <incise/stepper_state.h>

#define INCISE_STEPPER_MOTORS_MAX 8

/* Offsets for mmap, in pages. */
#define INCISE_STEPPER_PAGE_SETPOINTS 0
#define INCISE_STEPPER_PAGE_STATUS 1

/* incise_stepper_setpoint.mode */
#define INCISE_STEPPER_MODE_POSITION 0 /* target in steps */
#define INCISE_STEPPER_MODE_VELOCITY 1 /* target in steps/s */

/**
 * struct incise_stepper_setpoint - what the owner wants of a motor; one slot, 64 bytes
 * @seq: odd while the slot is being written; each new even value is a set-point and a sign
 *       of life. The writer: seq+1, barrier, fields, barrier, seq+2.
 * @mode: INCISE_STEPPER_MODE_…; another value is the fault SETPOINT
 * @reserved0: zero
 * @target: clamped to the limits in force
 * @t_ns: when the owner made it; only handed back in status
 * @reserved: zero
 *
 * The kernel copies a slot once per tick, and takes the copy when seq was even and the same
 * before and after.
 */
struct incise_stepper_setpoint {
	__u32 seq;
	__u16 mode;
	__u16 reserved0;
	__s64 target;
	__s64 t_ns;
	__u64 reserved[5];
};

/* incise_stepper_motor_status.flags */
/* Position is that of the machine; a stop at once while moving takes it away. */
#define INCISE_STEPPER_FLAG_HOMED (1U << 0)
#define INCISE_STEPPER_FLAG_HELD (1U << 1)	/* the last set-point was clamped */
#define INCISE_STEPPER_FLAG_HOME_SEEN (1U << 2) /* home_position is of this enable */

/**
 * struct incise_stepper_motor_status - where a motor stands; one slot, 128 bytes
 * @seq: odd while the kernel writes; a reader tries again when it changed meanwhile
 * @state: INCISE_STEPPER_STATE_…
 * @faults: INCISE_STEPPER_FAULT_… bits, latched
 * @inputs: INCISE_STEPPER_LINE_… bits that are active now; while disabled, and on a chip
 *          without interrupts: at the last ENABLE or CLEAR. One that cannot be read counts as
 *          active, but home, which stays what it was
 * @t_ns: when this was written; a tick at most before now while enabled
 * @position: steps given out, up less down, from the origin SET_POSITION gave
 * @velocity: of the profile, 2^-16 steps/s
 * @target: in force, after clamping; steps, or steps/s in velocity mode
 * @setpoint_t_ns: t_ns of the set-point in force
 * @setpoint_seq: its seq
 * @flags: INCISE_STEPPER_FLAG_… bits
 * @home_position: position at the last leading edge of the home input
 * @steps_up: since bind
 * @steps_down: since bind
 * @late: edges that came more than their shortest time too late, since bind
 * @shifted_ns: by how much the time line of the motion was put off by late edges, since bind
 * @reserved: zero
 */
struct incise_stepper_motor_status {
	__u32 seq;
	__u32 state;
	__u32 faults;
	__u32 inputs;
	__s64 t_ns;
	__s64 position;
	__s64 velocity;
	__s64 target;
	__s64 setpoint_t_ns;
	__u32 setpoint_seq;
	__u32 flags;
	__s64 home_position;
	__u64 steps_up;
	__u64 steps_down;
	__u64 late;
	__u64 shifted_ns;
	__u64 reserved[3];
};

/* incise_stepper_event.type */
#define INCISE_STEPPER_EVENT_STATE 1 /* value: the new state */
#define INCISE_STEPPER_EVENT_FAULT 2 /* value: the faults that were added */
#define INCISE_STEPPER_EVENT_INPUT 3 /* value: the inputs after the change */
#define INCISE_STEPPER_EVENT_SYNC 4  /* position: number of the pulse, from 1; motor: 0 */

/**
 * struct incise_stepper_event - 32 bytes
 * @seq: counts all events of the device from 1
 * @t_ns: when it happened: of the edge for SYNC, of the interrupt for an input
 * @position: of the motor then
 * @type: INCISE_STEPPER_EVENT_…
 * @motor: 0 …
 * @value: see the types
 */
struct incise_stepper_event {
	__u64 seq;
	__s64 t_ns;
	__s64 position;
	__u16 type;
	__u16 motor;
	__u32 value;
};

/* incise_stepper_controller.capabilities */
#define INCISE_STEPPER_CAP_SYNC (1ULL << 0)  /* has a SYNC line */
#define INCISE_STEPPER_CAP_FIXED (1ULL << 1) /* evaluates force models; none does yet */

/**
 * struct incise_stepper_controller - what the controller is, 256 bytes
 * @name: of the controller, zero-padded
 * @capabilities: INCISE_STEPPER_CAP_… bits
 * @n_motors: 1 … INCISE_STEPPER_MOTORS_MAX
 * @rate_max: steps/s that this machine's self-test allows a motor when all of them move;
 *            config.velocity and its pulse times are refused beyond. Cruising at it may be
 *            slower, by what edges are late
 * @edge_ns: self-test: median cost of reading a motor's inputs and writing a line
 * @lateness_ns: self-test: 99 % of timers were at most this late, in the best of its rounds
 * @lateness_max_ns: self-test: the latest
 * @resolution_ns: of the timer
 * @lines: per motor, the optional lines it has
 * @pulse_ns: self-test: shortest config.high_ns and low_ns
 * @tick_min_ns: self-test: shortest config.tick_ns, so that the ticks of all motors take at
 *               most a quarter of a processor
 * @polled: per motor, the inputs whose chip gives no interrupt: they are looked at when power
 *          is asked for, at each tick, and e-stop and the limit ahead before each step
 * @reserved: zero
 */
struct incise_stepper_controller {
	char name[32];
	__u64 capabilities;
	__u32 n_motors;
	__u32 rate_max;
	__u32 edge_ns;
	__u32 lateness_ns;
	__u32 lateness_max_ns;
	__u32 resolution_ns;
	__u32 lines[INCISE_STEPPER_MOTORS_MAX];
	__u32 pulse_ns;
	__u32 tick_min_ns;
	__u32 polled[INCISE_STEPPER_MOTORS_MAX];
	__u64 reserved[15];
};

/* incise_stepper_config.flags */
#define INCISE_STEPPER_CONFIG_INVERT (1U << 0) /* a step up sets dir inactive */
/* On DEADMAN and OWNER, a homed motor goes to safe_position before it is disabled. */
#define INCISE_STEPPER_CONFIG_RETRACT (1U << 1)

/**
 * struct incise_stepper_config - a motor's limits and times, 128 bytes
 * @motor: 0 …; of GET_CONFIG too
 * @flags: INCISE_STEPPER_CONFIG_… bits
 * @tick_ns: how often the set-point is read, 50000 … 2000000; ERANGE below info.tick_min_ns
 * @velocity: largest, steps/s, 1 …; ERANGE beyond info.rate_max
 * @acceleration: largest, steps/s², 1 …
 * @jerk: largest, steps/s³; 0: not limited
 * @position_min: lowest target, steps, within ±10⁹
 * @position_max: highest
 * @safe_position: see INCISE_STEPPER_CONFIG_RETRACT; within the two
 * @deadman_ns: 1000000 … 10000000000
 * @high_ns: shortest time the step line is active, 500 … 1000000
 * @low_ns: shortest time it is inactive, 500 … 1000000
 * @setup_ns: from a change of dir to the step after it, 0 … 1000000
 * @hold_ns: from a step's leading edge to a change of dir, 0 … 1000000
 * @enable_ns: from enable to the first step, 0 … 1000000000
 * @late_max: edges in a row, each late by its shortest time, until the fault LATE; 1 … 1000
 * @reserved: zero
 *
 * SET_CONFIG gives EBUSY while the motor is enabled, EINVAL for a value out of its range
 * and ERANGE for what this machine or a step cannot hold: velocity beyond info.rate_max,
 * tick_ns below info.tick_min_ns, high_ns or low_ns below info.pulse_ns, high_ns + low_ns
 * longer than a step at velocity, and a jerk so low that the profile would take more than 256
 * ticks for it.
 */
struct incise_stepper_config {
	__u32 motor;
	__u32 flags;
	__u32 tick_ns;
	__u32 velocity;
	__u32 acceleration;
	__u32 late_max;
	__u64 jerk;
	__s64 position_min;
	__s64 position_max;
	__s64 safe_position;
	__u64 deadman_ns;
	__u32 high_ns;
	__u32 low_ns;
	__u32 setup_ns;
	__u32 hold_ns;
	__u64 enable_ns;
	__u64 reserved[5];
};

/**
 * struct incise_stepper_origin - names the position at which a motor stands
 * @motor: 0 …
 * @homed: 1: from now on it is that of the machine; 0: it is just a number
 * @position: steps, within the motor's position_min … position_max
 *
 * EBUSY while the motor moves. A powered motor at rest takes it as its new target too.
 */
struct incise_stepper_origin {
	__u32 motor;
	__u32 homed;
	__s64 position;
};

/**
 * struct incise_stepper_sync - the SYNC line, 64 bytes
 * @period_ns: 0: off; else 100000 … 10000000000
 * @width_ns: time it is active, at least 1000, at most half of the period
 * @reserved0: zero
 * @first_ns: of the first pulse; 0: as soon as may be. Read back: of the first pulse.
 * @pulses: given out since it was set, read-only: zero when it is set
 * @last_ns: of the last pulse's leading edge, read-only likewise
 * @missed: pulses left out because the timer was late by a period, read-only likewise
 * @reserved: zero
 *
 * It has no deadman, as nothing moves by it: it goes on when its owner closes the file, until
 * period_ns is set to 0, the machine reboots or the device is unbound. While the machine
 * sleeps there are no pulses; it goes on in its beat then, and those of meanwhile are missed.
 */
struct incise_stepper_sync {
	__u64 period_ns;
	__u32 width_ns;
	__u32 reserved0;
	__s64 first_ns;
	__u64 pulses;
	__s64 last_ns;
	__u64 missed;
	__u64 reserved[2];
};

/* Watchers may call the ones that only read; the others need the owner (EPERM). */
#define INCISE_STEPPER_IOC 0xE8
#define INCISE_STEPPER_GET_INFO \
	_IOR(INCISE_STEPPER_IOC, 0, struct incise_stepper_controller)
#define INCISE_STEPPER_GET_CONFIG \
	_IOWR(INCISE_STEPPER_IOC, 1, struct incise_stepper_config)
#define INCISE_STEPPER_SET_CONFIG \
	_IOW(INCISE_STEPPER_IOC, 2, struct incise_stepper_config)
/*
 * A mask of motors, not 0: all get power or none does, and those that had it keep it. EPERM:
 * a fault is latched; EBUSY: an input forbids it, e-stop say, or it is still coming to rest;
 * ERANGE: it stands outside of its position limits; ESHUTDOWN: the machine goes down.
 */
#define INCISE_STEPPER_ENABLE _IOW(INCISE_STEPPER_IOC, 3, __u32)
/* Brings them to rest within the limits, then takes power away. Returns at once. */
#define INCISE_STEPPER_DISABLE _IOW(INCISE_STEPPER_IOC, 4, __u32)
/* Forgets the latched faults of motors at rest. EBUSY: the cause is still there. */
#define INCISE_STEPPER_CLEAR _IOW(INCISE_STEPPER_IOC, 5, __u32)
#define INCISE_STEPPER_SET_POSITION \
	_IOW(INCISE_STEPPER_IOC, 6, struct incise_stepper_origin)
/* Both: EOPNOTSUPP without a SYNC line. */
#define INCISE_STEPPER_SET_SYNC _IOW(INCISE_STEPPER_IOC, 7, struct incise_stepper_sync)
#define INCISE_STEPPER_GET_SYNC _IOR(INCISE_STEPPER_IOC, 8, struct incise_stepper_sync)

#endif
