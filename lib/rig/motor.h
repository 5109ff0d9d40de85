/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A stepper in mm in front of pages of set-points and status, shared by the kernel
 * module, the thread over GPIO and drives on CAN; they differ in their ops.
 *
 *   incise_stepper_…()  ─▶ motor ─┬─▶ pages ◀─▶ timer of the kernel, or thread
 *        mm                       ╰─▶ ops         steps
 */
#ifndef INCISE_MOTOR_H
#define INCISE_MOTOR_H

#include <incise/backend.h>
#include "../../driver/uapi/incise_stepper.h"
#include "../fixed/profile.h"

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
 * Each returns 0 or a negative errno as the ioctl of that name; @err, never NULL, may say
 * more.
 */
struct incise_motor_ops {
	int (*enable)(struct incise_motor *motor, struct incise_error *err);
	int (*disable)(struct incise_motor *motor); /* only starts it */
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
	unsigned int lines;	      /* INCISE_STEPPER_LINE_… bits it has */
	struct incise_driver *driver; /* the first of its chip and encoder, or NULL */
	bool watches;		      /* opened to watch, not to drive */
	bool in_process; /* a thread of this program writes the status, and stops with it */
	struct incise_stepper_setpoint *setpoint; /* NULL where it watches */
	const struct incise_stepper_motor_status *slot;

	/* private */
	struct incise_stepper_motor_status last; /* last status that could be read */
	unsigned int unread;			 /* failed reads since then */
	bool beyond;				 /* the last target was clamped */
	int64_t still_ns; /* of the last look: for how long this program stood still */
};

/* Set stepper.ops; the backend sets the other fields above "private". */
void incise_motor_init(struct incise_motor *motor);

/* The configuration for the kernel module, or for a thread that does the same. */
void incise_motor_config(const struct incise_actuator *actuator, unsigned int index,
			 struct incise_stepper_config *config);

/*
 * Set pulse times that rig.conf leaves open to the shortest that the machine holds, and
 * check the rate: a step takes high, low and @step_ns. @where starts the message; @pulse_ns: for an edge and its lateness. 0
 * or -ERANGE.
 */
int incise_motor_fit(struct incise_actuator *actuator, const char *where,
		     uint32_t rate_max, uint32_t pulse_ns, uint32_t step_ns,
		     struct incise_error *err);

/* 0 if a target would move it; -EPERM, -EIO or -ENODEV. */
int incise_motor_drivable(struct incise_motor *motor) INCISE_REALTIME;

/* The INCISE_STEPPER_LINE_… bit of the input whose edge is the home, or 0. */
unsigned int incise_motor_home_line(const struct incise_motor *motor);

#endif
