/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What an actuator's backend counts since it was opened, such as SYNCs that were late.
 */
#ifndef INCISE_STEPPER_COUNTERS_H
#define INCISE_STEPPER_COUNTERS_H

#include <jansson.h>
#include <incise/stepper.h>

/* An object of its keys; empty where it counts nothing. */
json_t *stepper_counters_json(struct incise_stepper *stepper);

/* A line for each; none where it counts nothing. */
void stepper_counters_text(struct incise_stepper *stepper);

/* One line of those that tell of trouble; none where there was none. */
void stepper_counters_line(struct incise_stepper *stepper);

#endif
