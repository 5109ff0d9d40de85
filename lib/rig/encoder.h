/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * An encoder at the nut of a motor, a count of the kernel's counter subsystem. A thread compares it
 * with the steps given: a difference of more than lost_steps_max is the motor's fault STEPS.
 */
#ifndef INCISE_ENCODER_H
#define INCISE_ENCODER_H

#include "motor.h"

/*
 * Open the encoder of a motor, to which it is then attached; it is closed first, and disables the
 * motor. @folder: "/sys/bus/counter/devices". NULL with errno and @err; @where starts the message.
 */
struct incise_driver *incise_encoder_open(struct incise_motor *motor, const char *folder,
					  const char *where, struct incise_error *err);

/* Start the thread: 0 or a negative errno. It does incise_encoder_look() each 2 ms. */
int incise_encoder_start(struct incise_driver *encoder);
void incise_encoder_look(struct incise_driver *encoder);

#endif
