/* SPDX-License-Identifier: (GPL-2.0-only WITH Linux-syscall-note) OR LGPL-2.1-or-later */
/*
 * /dev/incise-stepperN: up to eight stepper motors on one controller.
 *
 *   open    O_RDWR makes the owner; there is one (EBUSY). O_RDONLY watches.
 *   mmap    page 0: set-points, written by the owner; page 1: status, read-only. A slot
 *           per motor in each, and one for the plan behind them. In the loop nothing else is
 *           needed: no system call.
 *   ioctl   what is set up while the motors stand.
 *   read    events, whole structs; poll shows when there is one. Each open file has a
 *           place of its own in the ring of events; a gap in seq shows what it missed. A
 *           thread of the controller (SCHED_FIFO 50) wakes readers: the status page is sooner.
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
 *
 * With a plan, the controller renders a scene's force by itself: the owner stores poses of the
 * tracker in place of targets, and each tick of the plan makes the targets of its motors.
 *
 *   page ── pose ──▶ plan: contact, force, start, fade, limit ── target ──▶ profile of each motor
 *
 * A plan only takes the place of a target: position limits, profile, e-stop and deadman are
 * below it, and hold whatever it asks for. The force goes on while the owner's scene is stopped,
 * late or dead, as long as somebody who has the file stores poses. It is no stiffer for it: with
 * a tracker of 120 Hz, the age of its poses decides that. Without poses the force fades.
 *
 *   EMPTY ─ LOAD_PLAN ─▶ LOADED ─ ENABLE, a pose ─▶ WAIT ─▶ RISE ─▶ FELT ⇄ FADE ─ deadman ─▶ stop
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
#define INCISE_STEPPER_MODE_POSE 2     /* target by the plan; 0 here */

/* In page 0: the slot of the tube's poses, behind the slots of the motors. */
#define INCISE_STEPPER_SLOT_TUBE INCISE_STEPPER_MOTORS_MAX

/* incise_stepper_pose.tool */
#define INCISE_STEPPER_POSE_TOOL 0xffU	   /* enum incise_tool: the tool in the hand */
#define INCISE_STEPPER_POSE_FADE (1U << 9) /* let go of the force, while it is set */

/**
 * struct incise_stepper_pose - where the tracker saw the scalpel, or the tube
 * @position: of the sensor, in the scene; 2^-16 mm, within ±16384 mm
 * @quaternion: of the sensor, w first; 2^-30. All 0: no pose, but a sign of life, of which tool is
 *              taken; another that is not of length 1 leaves the attitude as it was
 * @tool: INCISE_STEPPER_POSE_… bits; others are the fault SETPOINT. 0 in the tube's slot
 * @reserved: zero
 *
 * Its time is t_ns of the set-point, of CLOCK_MONOTONIC. A pose from the future counts as of the
 * tick that takes it; a pose that is not newer than the last, or beyond 10000 mm, is left out and
 * counted. A pose that is taken is a sign of life, and so is one that is no pose.
 */
struct incise_stepper_pose {
	__s32 position[3];
	__s32 quaternion[4];
	__u32 tool;
	__u64 reserved;
};

/**
 * struct incise_stepper_setpoint - what the owner wants of a motor; one slot, 64 bytes
 * @seq: odd while the slot is being written; each new even value is a set-point and a sign
 *       of life. The writer: seq+1, barrier, fields, barrier, seq+2.
 * @mode: INCISE_STEPPER_MODE_…; another value is the fault SETPOINT
 * @reserved0: zero
 * @target: clamped to the limits in force
 * @t_ns: when the owner made it; only handed back in status
 * @pose: in mode POSE
 * @reserved: zero in the other modes
 *
 * The kernel copies a slot once per tick, and takes the copy when seq was even and the same
 * before and after.
 *
 * Mode POSE needs a plan (else SETPOINT). Poses come in the slot of the plan's first motor, and the
 * tube's in INCISE_STEPPER_SLOT_TUBE, of mode POSE too; tool and FADE of the first motor's slot are
 * the tube's as well. That slot is only looked at by a plan with a tube's station. The other motors
 * of the plan follow it from the time on at which their own slots were set to mode POSE; the first
 * motor's poses are their sign of life, and the pose of their own slots is not looked at.
 *
 * The plan starts with the tick of the first motor that finds mode POSE there, after ENABLE or
 * after another mode: without a pose and a force, which comes when the tool was out of the tissue.
 * Cuts and a punctured membrane stay, as tissue does not heal; LOAD_PLAN takes them away.
 *
 * A fault of one motor that follows a plan gives the others the fault PLAN, and so does DISABLE of
 * some of them only. When the owner closes the file or dies, the force fades first, then the fault
 * OWNER follows; until then ENABLE of the next owner gives EBUSY. Before unbind, suspend and
 * reboot it fades likewise.
 */
struct incise_stepper_setpoint {
	__u32 seq;
	__u16 mode;
	__u16 reserved0;
	__s64 target;
	__s64 t_ns;
	union {
		struct incise_stepper_pose pose;
		__u64 reserved[5];
	};
};

/* incise_stepper_motor_status.flags */
/*
 * Position is the machine's. A stop at once while moving takes it away, and so do e-stop, ALARM,
 * suspend, STEPS and, with INCISE_STEPPER_CONFIG_VOLATILE_HOME, each power off.
 */
#define INCISE_STEPPER_FLAG_HOMED (1U << 0)
#define INCISE_STEPPER_FLAG_HELD (1U << 1)	/* the last set-point was clamped */
#define INCISE_STEPPER_FLAG_HOME_SEEN (1U << 2) /* home_position is of this enable */

/**
 * struct incise_stepper_motor_status - where a motor stands; one slot, 128 bytes
 * @seq: odd while the kernel writes; a reader tries again when it changed meanwhile: on 32 bits a
 *       field of 64 is read in two parts, and belongs together only then
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
 * @lost_steps: where the home edge was passed last since homing, less where it was at homing;
 *              where it was due and did not come, how far the motor went beyond. Of the home
 *              input's leading edge, without one of the lower limit's; with power, in the
 *              direction of homing only
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
	__s64 lost_steps;
	__u64 reserved[2];
};

/* In page 1: the slot of the plan's status, in 128 bytes; it is longer. */
#define INCISE_STEPPER_SLOT_PLAN INCISE_STEPPER_MOTORS_MAX

/* incise_stepper_plan_status.state and .reasons: enum incise_stepper_plan_state and
 * incise_stepper_plan_reason of incise/stepper_state.h. Reasons are latched from
 * the start on.
 */

/**
 * struct incise_stepper_plan_status - what the plan renders; one, 384 bytes
 * @seq: odd while the kernel writes; a reader tries again when it changed meanwhile
 * @state: INCISE_STEPPER_PLAN_…
 * @reasons: why the force is or was taken away
 * @motors: mask of its motors; 0: there is no plan
 * @plan: CRC-32C of the plan's file, its field crc
 * @digest: CRC-32C over all ticks since the start, see below
 * @ticks: since the start
 * @missed: ticks left out because the timer came too late by one of them; each is an event
 * @t_ns: of the last tick: when it was due, which is what it computed with
 * @age_ns: of its pose; at its largest without one
 * @pose_tick: number of the tick, from 1, at which the last pose was taken
 * @pose_seq: seq of the last pose taken
 * @tube_seq: of the tube's
 * @poses: taken since the start, the tube's too
 * @refused: not taken since the start: older than the last one, too far away, or none
 * @flags: of the tick; enum incise_tick_flag
 * @phase: enum incise_phase
 * @held: enum incise_tool
 * @tool: end of the tool; 2^-16 mm
 * @proxy: its place on the surface, in a contact; else 0
 * @normal: of the surface there; 2^-30
 * @quaternion: of the scalpel; w first, 2^-30
 * @depth: in the tissue; 2^-16 mm
 * @speed: of the tool; 2^-16 mm/s
 * @command: the force; 2^-16 N
 * @along: of each motor
 * @target: of each motor, steps, before its limits
 * @reserved0: zero
 * @reserved: zero
 *
 * The counts and reasons stay when the plan has stopped, command and along are 0 then.
 *
 * A program gets the same digest from the same poses: for each tick the words command[0 … 2],
 * target[0 … axes - 1] and flags, 32 bits each, little-endian, one after the other through
 * CRC-32C (Castagnoli, reflected polynomial 0x82f63b78), which begins with ~0 and is inverted at
 * the end: as of one file of all ticks. Tick n is due at t_ns - (ticks - n) × the plan's tick_ns
 * where none was missed. A tick takes the pose of the first motor's slot, then the tube's.
 */
struct incise_stepper_plan_status {
	__u32 seq;
	__u32 state;
	__u32 reasons;
	__u32 motors;
	__u32 plan;
	__u32 digest;
	__u64 ticks;
	__u64 missed;
	__s64 t_ns;
	__s64 age_ns;
	__u64 pose_tick;
	__u32 pose_seq;
	__u32 tube_seq;
	__u64 poses;
	__u64 refused;
	__u32 flags;
	__u16 phase;
	__u16 held;
	__s32 tool[3];
	__s32 proxy[3];
	__s32 normal[3];
	__s32 quaternion[4];
	__s32 depth;
	__s32 speed;
	__s32 command[3];
	__s32 along[3];
	__s32 target[3];
	__u32 reserved0[2];
	__u64 reserved[23];
};

/* incise_stepper_event.type */
#define INCISE_STEPPER_EVENT_STATE 1 /* value: the new state */
#define INCISE_STEPPER_EVENT_FAULT 2 /* value: the faults that were added */
#define INCISE_STEPPER_EVENT_INPUT 3 /* value: the inputs after the change */
#define INCISE_STEPPER_EVENT_SYNC 4  /* position: number of the pulse, from 1; motor: 0 */
#define INCISE_STEPPER_EVENT_PLAN \
	5 /* value: the new state; position: number of the tick */
#define INCISE_STEPPER_EVENT_MISSED \
	6 /* value: ticks left out before the tick of that number */

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
#define INCISE_STEPPER_CAP_SYNC (1ULL << 0) /* has a SYNC line */
#define INCISE_STEPPER_CAP_PLAN (1ULL << 1) /* LOAD_PLAN, mode POSE */

/**
 * struct incise_stepper_controller - what the controller is, 256 bytes
 * @name: of the controller, zero-padded
 * @capabilities: INCISE_STEPPER_CAP_… bits
 * @n_motors: 1 … INCISE_STEPPER_MOTORS_MAX
 * @rate_max: steps/s that this machine's self-test allows a motor when all of them move;
 *            config.velocity is refused beyond
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
 * @step_ns: self-test: time that a step takes besides config.high_ns and low_ns, where the timer
 *           ends its pulse: 10⁹ / (high_ns + low_ns + step_ns) is the largest velocity with these
 * @wait_step_ns: the same where the timer waits for the end of a pulse
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
	__u32 step_ns;
	__u32 wait_step_ns;
	__u64 reserved[14];
};

/* incise_stepper_config.flags */
#define INCISE_STEPPER_CONFIG_INVERT (1U << 0) /* a step up sets dir inactive */
/* On DEADMAN and OWNER, a homed motor goes to safe_position before it is disabled. */
#define INCISE_STEPPER_CONFIG_RETRACT (1U << 1)
/* Without power the machine moves: it is not homed any more. */
#define INCISE_STEPPER_CONFIG_VOLATILE_HOME (1U << 2)
/* The timer ends each pulse; else it waits for the end of one of at most …_WAIT_MAX_NS. */
#define INCISE_STEPPER_CONFIG_NO_WAIT (1U << 3)
#define INCISE_STEPPER_WAIT_MAX_NS 2000
/* debounce_ns is the e-stop's too. */
#define INCISE_STEPPER_CONFIG_DEBOUNCE_ESTOP (1U << 4)

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
 * @late_max: edges in a row, each late by its shortest time, until the fault LATE; 1 … 1000. A
 *            motion that is put off by more than 1/64 of its time for a second is the same fault.
 *            Of a plan's first motor also ticks of the plan in a row, each late by its tick_ns,
 *            or taking more than half of it
 * @lost_steps_max: more |lost_steps| of the status are the fault STEPS, which brakes; 0: never
 * @cpu: 1 + the number of the processor on which its timer fires, and that of a plan it leads;
 *       0: that which calls ENABLE
 * @debounce_ns: with power, limits, home and ALARM change when a level was seen for so long, at
 *               most 100000000: each tick and step looks at it. home_position is that of the
 *               edge. 0: at once
 * @reserved: zero
 *
 * SET_CONFIG gives EBUSY while the motor is enabled, EINVAL for a value out of its range
 * and ERANGE for what this machine or a step cannot hold: velocity beyond info.rate_max,
 * tick_ns below info.tick_min_ns, high_ns or low_ns below info.pulse_ns, high_ns + low_ns and
 * info.step_ns or wait_step_ns longer than a step at velocity, and a jerk so low that the
 * profile would take more than 256 ticks for it.
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
	__u64 lost_steps_max;
	__u32 cpu;
	__u32 debounce_ns;
	__u64 reserved[3];
};

/**
 * struct incise_stepper_origin - names the position at which a motor stands
 * @motor: 0 …
 * @homed: 1: from now on it is the machine's; 0: it is just a number
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
 * sleeps there are no pulses; it goes on in its beat then, without the pulses of meanwhile.
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

/**
 * struct incise_stepper_plan - a plan for motors, 128 bytes
 * @motors: mask; the plan's first axis is the lowest of them. As many as the plan has axes
 * @flags: zero
 * @data: where the file of `incise compile` is in memory
 * @size: of it, bytes; 0: the plan of these motors goes, and the rest is 0
 * @reserved: zero
 *
 * A controller has one plan. The file is checked in full; after that, a tick takes a bounded time,
 * and no pose makes it overflow.
 *
 * EBUSY: a motor of the plan, or of the one before, has power, or still comes to rest, or another
 * thread loads a plan. EINVAL: the
 * file or a field is not good; EOPNOTSUPP: its version is not known here.
 * ERANGE: a motor's deadman_ns is not longer than the plan's pose age, its fade and the way of its
 * largest force at its slew, a motor's tick_ns is longer than the plan's, or a tick of the plan
 * takes more than a quarter of its tick_ns on this machine, in more than one of ten. EFBIG: more
 * than 32 MiB. ENOMEM, EFAULT. Nothing has changed then.
 *
 * While there is a plan, SET_CONFIG of its motors gives EBUSY. It goes with LOAD_PLAN, with the
 * device, and at the next open for writing.
 */
struct incise_stepper_plan {
	__u32 motors;
	__u32 flags;
	__u64 data;
	__u64 size;
	__u64 reserved[13];
};

/* Watchers may call the ones that only read, and DISABLE; the others need the owner (EPERM). */
#define INCISE_STEPPER_IOC 0xE8
#define INCISE_STEPPER_GET_INFO \
	_IOR(INCISE_STEPPER_IOC, 0, struct incise_stepper_controller)
#define INCISE_STEPPER_GET_CONFIG \
	_IOWR(INCISE_STEPPER_IOC, 1, struct incise_stepper_config)
#define INCISE_STEPPER_SET_CONFIG \
	_IOW(INCISE_STEPPER_IOC, 2, struct incise_stepper_config)
/*
 * A mask of motors, not 0: all get power or no motor does, and motors that had power keep it.
 * The timers of those that get it, and of their plan, fire on the processor of their config, or
 * that this call runs on. ENXIO: it is off. ENOSPC: motors of other controllers leave it no time
 * for this one's largest velocity. ENOTRECOVERABLE: a fault is latched, until CLEAR; EBUSY: an
 * input forbids it, e-stop say, or it is still coming to rest; ERANGE: it stands outside of its
 * position limits; ESHUTDOWN: the machine goes down.
 */
#define INCISE_STEPPER_ENABLE _IOW(INCISE_STEPPER_IOC, 3, __u32)
/*
 * Brings them to rest within the limits, then takes power away. Returns at once. A watcher may
 * too: whoever may look may stop.
 */
#define INCISE_STEPPER_DISABLE _IOW(INCISE_STEPPER_IOC, 4, __u32)
/* Forgets the latched faults of motors at rest. EBUSY: the cause is still there. */
#define INCISE_STEPPER_CLEAR _IOW(INCISE_STEPPER_IOC, 5, __u32)
#define INCISE_STEPPER_SET_POSITION \
	_IOW(INCISE_STEPPER_IOC, 6, struct incise_stepper_origin)
/* Both: EOPNOTSUPP without a SYNC line. */
#define INCISE_STEPPER_SET_SYNC _IOW(INCISE_STEPPER_IOC, 7, struct incise_stepper_sync)
#define INCISE_STEPPER_GET_SYNC _IOR(INCISE_STEPPER_IOC, 8, struct incise_stepper_sync)
#define INCISE_STEPPER_LOAD_PLAN _IOW(INCISE_STEPPER_IOC, 9, struct incise_stepper_plan)

#endif
