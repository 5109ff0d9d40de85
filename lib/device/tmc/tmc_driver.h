/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Driver chips TMC2209 and TMC5160, used by step and direction: settings of rig.conf into registers of
 * 32 bits and back, and faults that the chip reports.
 *
 *   rig.conf ─▶ registers ─▶ read back, compared
 *   GSTAT, DRV_STATUS ─▶ a thread looks, a few times a second ─▶ fault with its text
 *
 * tmc2209.c and tmc5160.c have their chip's registers and its line.
 */
#ifndef INCISE_TMC_DRIVER_H
#define INCISE_TMC_DRIVER_H

#include <pthread.h>
#include <stdatomic.h>
#include <incise/backend.h>

#define TMC_GCONF 0x00
#define TMC_GSTAT 0x01
#define TMC_IHOLD_IRUN 0x10
#define TMC_TPOWERDOWN 0x11
#define TMC_TPWMTHRS 0x13
#define TMC_TCOOLTHRS 0x14
#define TMC_CHOPCONF 0x6c
#define TMC_PWMCONF 0x70
#define TMC_WRITE 0x80 /* added to the address */

#define TMC_POWER_DOWN 20 /* 0.44 s at rest before the current falls to hold_A */
#define TMC_SENSE_V 0.325 /* over the sense resistor at full current */

/* A register's value as rig.conf has it; those that are only written are confirmed by the line. */
struct tmc_row {
	uint8_t reg;
	bool readable;
	uint32_t value;
};
#define TMC_ROWS_MAX 12

struct tmc_driver;

struct tmc_model {
	const char *name;
	uint8_t inputs, version; /* register IOIN, and its highest byte */
	uint32_t
		used_by_steps; /* bit of IOIN that is 1 where step and dir are used; 0: always */
	uint32_t warm, hot, shorted, open, stealth; /* bits of DRV_STATUS */
	int threshold_least, threshold_most;
	int threshold_load; /* a stall is a load of at most this times the threshold */
	uint8_t load;	    /* register of StallGuard's value, in its lowest bits */
	bool stall_in_stealthchop; /* else StallGuard needs SpreadCycle */
	double sense_extra_ohm;	   /* inside the chip */
	int (*connect)(struct tmc_driver *d, const struct incise_backend_request *request,
		       struct incise_error *err);
	/* 0 or a negative errno; a write returns 0 only when the chip has confirmed it. */
	int (*read)(struct tmc_driver *d, uint8_t reg, uint32_t *value);
	int (*write)(struct tmc_driver *d, uint8_t reg, uint32_t value);
	/* The rows, which reach the current *most_A at 31; returns their number. */
	int (*fill)(const struct tmc_driver *d, struct tmc_row *rows, double *most_A);
};

struct tmc_driver {
	struct incise_driver driver;
	const struct tmc_model *model;
	struct incise_actuator actuator;
	char name[80];		 /* "driver tmc2209:/dev/serial0:0" */
	int fd;			 /* of the line, once opened */
	uint8_t node;		 /* on the line */
	struct tmc_driver *line; /* whose lock and fd it uses: itself, or another node */
	pthread_mutex_t lock;	 /* of the line, and of what follows */
	atomic_uint faults;	 /* latched, enum incise_stepper_fault */
	char cause[240];	 /* of the first fault; complete before it is in faults */
	uint64_t warnings, repeats;    /* times too warm; datagrams sent again */
	int unanswered, open, stalled; /* looks in a row */
	bool warm;
	pthread_t thread;
	bool runs;
	atomic_bool stop;
};

/* Open, set up and watch a chip; NULL with errno and @err. */
void *tmc_driver_open(const struct incise_backend_request *request,
		      const struct tmc_model *model, struct incise_error *err);

/* One look of the thread, under the lock: latch the first fault. */
void tmc_driver_look(struct tmc_driver *d);

/* Largest effective current at a voltage over the sense resistor. */
double tmc_full_A(const struct tmc_driver *d, double sense_V);

/* Values of IHOLD_IRUN; of CHOPCONF without the chopper; of TPWMTHRS and TCOOLTHRS at a speed. */
uint32_t tmc_currents(const struct tmc_driver *d, double most_A);
uint32_t tmc_microsteps(const struct tmc_driver *d);
uint32_t tmc_step_clocks(const struct tmc_driver *d, double mm_s);

#endif
