/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A controller of the kernel module, as its file /dev/incise-stepperN and debugfs tell of
 * it; steps and nanoseconds. Read without becoming the owner: nothing that runs is
 * disturbed.
 */
#ifndef INCISE_STEPPER_MODULE_H
#define INCISE_STEPPER_MODULE_H

#include <stdbool.h>
#include <stdint.h>
/* Not together with incise/stepper.h: the kernel's names and the library's are alike. */
#include <uapi/incise_stepper.h>

#define STEPPER_MODULE_BINS 64

/* What one timer did: firings in bins of µs that double; the last is open. */
struct stepper_histogram {
	uint64_t count[STEPPER_MODULE_BINS];
	uint64_t mean_ns, max_ns;
};

struct stepper_motor {
	struct incise_stepper_config config;
	struct incise_stepper_motor_status status;
	struct stepper_histogram lateness, cost; /* of the hard timer */
	uint64_t edges;
};

struct stepper_module {
	const char *path;
	struct incise_stepper_controller info;
	struct incise_stepper_sync sync;
	bool has_sync;
	bool has_evidence;    /* debugfs could be read: histograms and edges are there */
	const char *evidence; /* else why not */
	int bins;
	uint32_t from_us[STEPPER_MODULE_BINS];
	struct stepper_motor motor[INCISE_STEPPER_MOTORS_MAX];
};

/* Ends the program with 1 and one line when it is no such file. */
void stepper_module_read(struct stepper_module *module, const char *path);

#endif
