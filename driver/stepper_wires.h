/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * The lines of chips that signals are wired to: stepper_configfs.c fills them in,
 * stepper_nodes.c makes a device of them. They go into a lookup table.
 */
#ifndef INCISE_DRIVER_STEPPER_WIRES_H
#define INCISE_DRIVER_STEPPER_WIRES_H

#include <linux/types.h>

#include "uapi/incise_stepper.h"

struct device;
struct stepper_nodes;

struct stepper_wire {
	char *label; /* of the chip; NULL: not wired */
	unsigned int offset;
	unsigned long flags; /* enum gpio_lookup_flags */
};

enum { STEPPER_WIRE_ESTOP, STEPPER_WIRE_SYNC, STEPPER_WIRES };

enum {
	STEPPER_WIRE_STEP,
	STEPPER_WIRE_DIR,
	STEPPER_WIRE_ENABLE,
	STEPPER_WIRE_LIMIT_MIN,
	STEPPER_WIRE_LIMIT_MAX,
	STEPPER_WIRE_HOME,
	STEPPER_WIRE_FAULT,
	STEPPER_MOTOR_WIRES
};

/* As firmware nodes name them, less "-gpios"; in the lookup table behind "motorN-". */
extern const char *const stepper_wire_names[STEPPER_WIRES];
extern const char *const stepper_motor_wire_names[STEPPER_MOTOR_WIRES];

struct stepper_wires {
	const char *name;
	struct stepper_wire wire[STEPPER_WIRES];
	int n_motors;
	struct stepper_wire motor[INCISE_STEPPER_MOTORS_MAX][STEPPER_MOTOR_WIRES];
	u32 lost_steps_max[INCISE_STEPPER_MOTORS_MAX];
	u32 debounce_ns[INCISE_STEPPER_MOTORS_MAX], cpu[INCISE_STEPPER_MOTORS_MAX];
};

struct stepper_nodes *stepper_nodes_make(const struct stepper_wires *wires);
void stepper_nodes_free(struct stepper_nodes *nodes);
struct device *stepper_nodes_device(struct stepper_nodes *nodes);
const char *stepper_nodes_label(struct device *dev, const char *key);

#endif
