/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * One drive, cycle by cycle: the work of each SYNC, without thread or clock, so that tests run
 * it in simulated time.
 *
 *   cycle    ──┬──────────────────────────┬──────────────────────────┬──
 *   from it    TPDO of the last SYNC      TPDO                       TPDO
 *   to it        RPDO SYNC                  RPDO SYNC                  RPDO SYNC
 *                 │    ╰ the drive takes the target, and samples its position
 *                 ╰ next point of the profile
 *
 *   IDLE ─ power ─▶ STARTING ─▶ RUNNING ─ rest ─▶ ENDING ─▶ IDLE
 *              ╰──▶ STARTING ─▶ HOMING ──────────▶ ENDING
 *                        any fault at once: QUICK_STOP ─▶ IDLE
 *
 * Lengths are steps, units of the profile; counts are the drive's. An axis never gives the
 * drive power again by itself.
 */
#ifndef INCISE_CAN_AXIS_H
#define INCISE_CAN_AXIS_H

#include <stdatomic.h>
#include "../../../rig/motion.h"
#include "cia402.h"

enum can_axis_phase {
	CAN_AXIS_IDLE,
	CAN_AXIS_STARTING,
	CAN_AXIS_RUNNING,
	CAN_AXIS_HOMING,
	CAN_AXIS_ENDING,
	CAN_AXIS_QUICK_STOP,
};

/* The cause of a stop, in more detail than status.faults. */
enum can_axis_cause {
	CAN_AXIS_NO_REASON,
	CAN_AXIS_EMCY,	       /* a: code, b: error register */
	CAN_AXIS_DRIVE_FAULT,  /* by the statusword, without an EMCY */
	CAN_AXIS_NOT_ENABLED,  /* a: enum cia402_state */
	CAN_AXIS_NO_HEARTBEAT, /* a: ms */
	CAN_AXIS_NO_TPDO,      /* a: ms */
	CAN_AXIS_NO_INPUTS,    /* a: ms */
	CAN_AXIS_REBOOTED,
	CAN_AXIS_NMT, /* a: enum canopen_state */
	CAN_AXIS_BUS_OFF,
	CAN_AXIS_QUEUE_FULL, /* a: cycles in a row */
	CAN_AXIS_BUS_FAILED, /* a: errno */
	CAN_AXIS_FOREIGN,    /* another master */
	CAN_AXIS_OFF_TARGET, /* a: steps */
	CAN_AXIS_NO_START,   /* a: enum cia402_state */
	CAN_AXIS_NO_MODE,    /* a: the mode that it is in */
	CAN_AXIS_NO_HOME,    /* the drive reports that homing failed */
	CAN_AXIS_HOME_TIME,
	CAN_AXIS_HOME_OLD,    /* the error bit of the last homing stays set */
	CAN_AXIS_HOME_OPEN,   /* it stands, with bit 12 and without bit 10 */
	CAN_AXIS_HOME_SPEED,  /* a: steps/s by its position */
	CAN_AXIS_OUTSIDE,     /* a: steps; it gave way while getting power */
	CAN_AXIS_STOOD_STILL, /* a: ms; this program, not the drive */
	CAN_AXIS_NO_STOP, /* a: enum cia402_state; it did not report to have no power */
};

struct can_axis_setup {
	struct incise_stepper_config config; /* tick_ns: of a cycle */
	double step_mm;
	enum cia402_mode mode;
	double counts_per_step;	 /* negative if inverted */
	double units_per_step_s; /* CSV: velocity units of a step/s; same sign */
	double home_steps_s;	 /* of 6099:1; 0: homing does not move it */
	double gain_1_s;	 /* CSV */
	double torque_per_step, torque_s_per_step, torque_most; /* CST: ‰; same sign */
	int64_t silence_ns;   /* of the drive until it counts as lost */
	int32_t following;    /* more steps off the target … */
	int64_t following_ns; /* … for so long are a fault */
	int64_t start_ns;     /* longest time to operation enabled */
	bool inputs;	      /* it sends TPDO2 … */
	bool inputs_timed;    /* … at each CIA402_INPUTS_MS */
	unsigned int wired;   /* INCISE_STEPPER_LINE_… bits that are valid */
};

struct can_axis_counts {
	uint64_t setpoints;    /* RPDOs sent with power */
	uint64_t sync_late;    /* SYNCs that were half a cycle late or left out */
	uint64_t tpdo_missing; /* SYNCs without an answer until the next */
};

struct can_axis {
	struct incise_motion motion; /* its setpoint and slot are to be set */
	struct canopen *master;
	struct can_axis_setup setup;
	double zero_counts; /* of the drive, at position 0 */
	uint16_t statusword;
	int32_t position;   /* the drive's, counts */
	int mode, mode_set; /* by 6061, if TPDO1 has it; by 6060 */
	bool has_status;    /* a TPDO1 came */
	enum can_axis_phase phase;
	struct can_axis_counts counts;
	/* Read by another thread once a fault is seen. */
	atomic_int cause; /* enum can_axis_cause */
	int64_t cause_a, cause_b;
	atomic_int result; /* of the last power or home: 1 under way, 0, -errno */

	/* private */
	int64_t now_ns;	      /* of the cycle */
	int64_t since_ns;     /* of the phase */
	int64_t tpdo_ns;      /* the last that came */
	int64_t off_ns;	      /* since when it is off its target; 0: not */
	int64_t limit_ns;     /* end of homing */
	int32_t commanded[4]; /* the last targets, steps */
	double speed;	      /* measured, counts per cycle, smoothed */
	uint32_t boots, emcys, bus_offs, foreign; /* when power was given */
	int outcome;				  /* result once without power */
	uint32_t full;	      /* set-points in a row that the bus did not take */
	uint32_t unsynced;    /* SYNCs in a row that the bus did not take */
	uint32_t missed;      /* SYNCs in a row without an answer */
	uint32_t answers;     /* cycles with one, in this phase */
	bool setpoint_sent;   /* with its SYNC, in this cycle */
	bool status_received; /* in this cycle */
	uint16_t old_bits;    /* of the statusword, left by an earlier homing */
	int64_t stood_ns;     /* homed, but "not there": since when it stands; 0: not */
	int64_t gauge_ns;     /* homing: when its speed was gauged … */
	int32_t gauge_counts; /* … from here … */
	double gauge_steps_s, sustained; /* … the last one; the largest of two in a row */
	uint32_t rested;    /* cycles with an answer since the profile rests */
	int64_t inputs_ns;  /* duration of cycles with an answer since the last inputs */
	bool command_sent;  /* the command of this phase */
	bool heartbeat_off; /* it did not obey a stop: leave it to its deadman */
	bool answered, stop_homing, failed;
};

/* Without power. Returns 0 or an error of incise_profile_init(). */
int can_axis_init(struct can_axis *axis, const struct can_axis_setup *setup);

/*
 * Run one cycle, sending included. @late_ns: how late it is; @left_out: cycles that were not
 * run at all.
 */
void can_axis_cycle(struct can_axis *axis, int64_t now_ns, int64_t late_ns,
		    uint32_t left_out);

/* The longest period of cycles without power. */
#define CAN_AXIS_IDLE_NS 20000000

/*
 * Start to power a drive that is set up, in its mode or, if @homing_ns > 0, in homing mode, for
 * at most so long; axis->result is the outcome. Returns 1; 0, -EPERM, -EBUSY, -ERANGE (it is
 * outside of its travel).
 */
int can_axis_power(struct can_axis *axis, int64_t now_ns, int64_t homing_ns);

/* The user cleared the fault. */
void can_axis_cleared(struct can_axis *axis);

/* Come to rest, then remove power. Stops homing. */
void can_axis_disable(struct can_axis *axis);

/* Update by 60FD. */
void can_axis_inputs(struct can_axis *axis, uint32_t inputs);

/* Returns whether the drive is within the limits, so that its first target is no jump. */
bool can_axis_is_within(const struct can_axis *axis);

/* Convert counts, rounded. */
int64_t can_axis_steps(const struct can_axis *axis, int32_t counts);

/* Write that this program stood still for @still_ns, and what to do; returns the length. */
int can_axis_still_text(int64_t still_ns, char *text, size_t size);

/* Write the cause of a stop and what to do; returns the length, 0 without a cause. */
int can_axis_cause_text(const struct can_axis *axis, char *text, size_t size);

#endif
