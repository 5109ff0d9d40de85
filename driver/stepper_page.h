/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * A set-point out of the page that the owner writes, and the check of a config:
 * pure functions over untrusted bytes. They build without a kernel
 * too, for unit tests and a fuzzer.
 */
#ifndef INCISE_DRIVER_STEPPER_PAGE_H
#define INCISE_DRIVER_STEPPER_PAGE_H

#ifdef __KERNEL__
#include <linux/types.h>
#else
#include <stdbool.h>
#include <stdint.h>
#endif

#include "uapi/incise_stepper.h"

/* A checked set-point: one copy, which no other program can change any more. */
struct stepper_setpoint {
	__u32 seq;
	__u16 mode;
	__s64 target; /* not clamped */
	__s64 t_ns;
	struct incise_stepper_pose pose; /* in mode POSE */
};

enum stepper_page_answer {
	STEPPER_PAGE_NOTHING, /* nothing new, or the owner is writing just now */
	STEPPER_PAGE_TAKEN,   /* setpoint is new */
	STEPPER_PAGE_GARBAGE, /* setpoint->seq is new, the rest is as it was */
};

enum stepper_page_answer stepper_page_take(const struct incise_stepper_setpoint *slot,
					   struct stepper_setpoint *setpoint);
__s64 stepper_page_clamp(const struct stepper_setpoint *setpoint,
			 const struct incise_stepper_config *config);
__u32 stepper_page_velocity(const struct incise_stepper_config *config,
			    const struct incise_stepper_controller *info);
__u32 stepper_page_busy_ns(const struct incise_stepper_config *config,
			   const struct incise_stepper_controller *info);
int stepper_page_config(const struct incise_stepper_config *config,
			const struct incise_stepper_controller *info);

#endif
