/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * State of an actuator and counters of its backend as text and JSON.
 */
#ifndef INCISE_STEPPER_STATUS_TOOL_H
#define INCISE_STEPPER_STATUS_TOOL_H

#include <stddef.h>
#include <jansson.h>
#include <incise/stepper.h>

/* By bit, in JSON and as rig.conf names them. */
#define STEPPER_LINES 7
extern const char *const stepper_line_keys[STEPPER_LINES],
	*const stepper_fault_keys[INCISE_STEPPER_FAULTS];

/* Whole microsteps. */
long long stepper_steps(const struct incise_stepper_info *info, double mm);

/*
 * "e-stop: release it, then clear; late: …", or the cause that the device reports; "" without
 * a fault. Returns @text.
 */
const char *stepper_why(struct incise_stepper *stepper, unsigned int faults, char *text,
			size_t size);

/* A block of lines. */
void stepper_status_text(struct incise_stepper *stepper,
			 const struct incise_stepper_info *info,
			 const struct incise_stepper_status *status);

/* One line, "ready at 1.000 mm, 0.0 mm/s, homed; inputs home", for --follow. */
void stepper_status_line(struct incise_stepper *stepper,
			 const struct incise_stepper_status *status, double t_s);

json_t *stepper_status_json(struct incise_stepper *stepper,
			    const struct incise_stepper_info *info,
			    const struct incise_stepper_status *status);

/* Counters since the backend was opened, for example late SYNCs: an object of their keys. */
json_t *stepper_counters_json(struct incise_stepper *stepper);

/* One line of the counters that count trouble; no line without trouble. */
void stepper_counters_line(struct incise_stepper *stepper);

#endif
