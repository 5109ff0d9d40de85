/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Where an actuator stands, in words and as JSON: what `incise stepper` prints.
 */
#ifndef INCISE_STEPPER_STATUS_H
#define INCISE_STEPPER_STATUS_H

#include <stddef.h>
#include <jansson.h>
#include <incise/stepper.h>

/* Whole microsteps. */
long long stepper_steps(const struct incise_stepper_info *info, double mm);

/*
 * "e-stop: release it, then clear; late: …", or the cause where the device itself tells it;
 * "" without a fault. Returns text.
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

#endif
