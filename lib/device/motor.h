/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A motor behind pages of set-points and status, in mm: what the kernel module and the
 * thread over GPIO have in common. What differs stands behind a door.
 *
 *   incise_stepper_…()  ─▶ motor ─┬─▶ pages ◀─▶ timer of the kernel, or thread
 *        mm                       ╰─▶ door        steps
 */
#ifndef INCISE_MOTOR_H
#define INCISE_MOTOR_H

#include <incise/backend.h>
#include "../fixed/profile.h"
#include "abi.h"

/* Largest velocity and acceleration in microsteps: they are 32 bits. */
#define INCISE_MOTOR_STEPS_MAX 2e9

/*
 *      microsteps ─▶ turns ─▶ mm        step_mm = lead_mm / (steps_per_turn · microsteps)
 *      0 ─────────────────── travel     position 0 is where the spring gives no force
 */

/* One microstep, mm. */
double incise_actuator_step_mm(const struct incise_actuator *actuator) INCISE_REALTIME;

/* The microstep nearest to a position, within the travel; 0 for NaN. */
int32_t incise_actuator_steps(const struct incise_actuator *actuator,
			      double position_mm) INCISE_REALTIME;

/* Microsteps/s of a speed, within the largest; 0 for NaN. */
int64_t incise_actuator_rate(const struct incise_actuator *actuator,
			     double velocity_mm_s);

/* Limits in microsteps, for a profile; rounded towards the slower and nearer. */
void incise_actuator_limits(const struct incise_actuator *actuator,
			    struct incise_profile_limits *limits);

struct incise_motor;

/*
 * Each returns 0 or a negative errno as the ioctl of the same name does. Who knows more of
 * the cause says so in @err, which is always there.
 */
struct incise_motor_ops {
	int (*enable)(struct incise_motor *motor, struct incise_error *err);
	int (*disable)(struct incise_motor *motor); /* begins it */
	int (*clear)(struct incise_motor *motor, struct incise_error *err);
	int (*origin)(struct incise_motor *motor, int32_t steps, bool homed);
	void (*close)(struct incise_motor *motor);
	int64_t (*now)(struct incise_motor *motor) INCISE_REALTIME;
	int (*wait)(struct incise_motor *motor, int64_t ns); /* NULL: sleep */
};

struct incise_motor {
	struct incise_stepper stepper;
	const struct incise_motor_ops *ops;
	struct incise_actuator actuator;
	char name[64];
	double rate_max_hz;
	unsigned int lines; /* INCISE_STEPPER_LINE_… bits it has */
	bool watches;	    /* it may not be driven from here */
	struct incise_stepper_setpoint *setpoint; /* NULL where it watches */
	const struct incise_abi_status *slot;

	/* private */
	struct incise_abi_status last; /* status that could be read */
	unsigned int unread;	       /* looks since then */
	bool beyond;		       /* the last target was clamped */
};

/* Fill in the functions; the fields above "private" are the backend's to set. */
void incise_motor_init(struct incise_motor *motor);

/* Its configuration for the module, or a thread that does the same. */
void incise_motor_config(const struct incise_actuator *actuator, unsigned int index,
			 struct incise_stepper_config *config);

/*
 * With what a machine can hold, give pulses that rig.conf leaves open their shortest times.
 * @where begins the message; @pulse_ns: what an edge and its lateness take. Returns 0; -ERANGE: err says which rate was
 * asked for, and which is the largest.
 */
int incise_motor_fit(struct incise_actuator *actuator, const char *where,
		     uint32_t rate_max, uint32_t pulse_ns, struct incise_error *err);

#endif
