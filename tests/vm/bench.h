/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A controller of the stepper module on the simulated chip, with a judge of edges and a
 * simulated carriage behind each motor. Lines of motor m, from 7 m on:
 *
 *   step  dir  enable (active low)  limit_min  limit_max  home  fault
 *
 * and behind those of all motors e-stop (active low, driven inactive) and SYNC. Functions
 * return 0 or a negative errno, if nothing else is said.
 */
#ifndef INCISE_VM_BENCH_H
#define INCISE_VM_BENCH_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "../../driver/uapi/incise_stepper.h"
#include "edge_log.h"
#include "simulator.h"

enum {
	BENCH_STEP,
	BENCH_DIR,
	BENCH_ENABLE,
	BENCH_MIN,
	BENCH_MAX,
	BENCH_HOME,
	BENCH_FAULT,
	BENCH_LINES
};

#define BENCH_ESTOP (BENCH_LINES * INCISE_STEPPER_MOTORS_MAX)
#define BENCH_SYNC (BENCH_ESTOP + 1)

static inline unsigned int bench_line(unsigned int motor, unsigned int which)
{
	return motor * BENCH_LINES + which;
}

struct bench {
	unsigned int number, n_motors;
	char cdev[64];	   /* in /dev */
	char dev_name[64]; /* on the platform bus */
	int fd;		   /* < 0: not open */
	volatile struct incise_stepper_setpoint *setpoint;
	const volatile struct incise_stepper_motor_status *status;
	struct incise_stepper_controller info;
	struct incise_stepper_config config[INCISE_STEPPER_MOTORS_MAX];
	struct edge_log log[INCISE_STEPPER_MOTORS_MAX];
	uint64_t edges; /* judged so far, of all lines */
};

/* By configfs, under the name "bench0"; the simulator and the module are loaded. */
int bench_bind(struct bench *bench, unsigned int n_motors);

/*
 * With step, dir and enable alone, as controller @number of several: its motor m has the lines of motor
 * m + @number * INCISE_STEPPER_MOTORS_MAX. Its edges are not judged.
 */
int bench_bind_bare(struct bench *bench, unsigned int number, unsigned int n_motors);

int bench_unbind(struct bench *bench);

/* Asks again for the names of the node and the device: they may be others after a bind. */
int bench_name(struct bench *bench);

/* As owner, with both pages. Closing takes care of a bench that is not open. */
int bench_open(struct bench *bench);
void bench_close(struct bench *bench);

int bench_command(const struct bench *bench, unsigned long request, uint32_t mask);

/* Limits for a motor that stands at @position, for the module and for the judge alike. */
int bench_configure(struct bench *bench, const struct incise_stepper_config *config,
		    int64_t position);

/*
 * Mechanics behind a motor that stands at @position: with limits and home as @more says in
 * the words of the file "carriage", or "".
 */
int bench_carriage(const struct incise_stepper_config *config, int64_t position,
		   const char *more);

void bench_want(struct bench *bench, unsigned int motor, unsigned int mode,
		int64_t target);
struct incise_stepper_motor_status bench_look(const struct bench *bench,
					      unsigned int motor);

/* Disable the first motors until they rest, 60 s at most, and clear them. Returns whether they do. */
bool bench_rest(struct bench *bench, unsigned int motors);

/* Hands all edges of the ring to the judges. */
void bench_judge(struct bench *bench);

/* Sum of faults that the judges have found; prints the first of each motor. */
uint64_t bench_faulty(const struct bench *bench);

/* Signs of life until a motor is in one of the states (bits); false after @ns. */
bool bench_until(struct bench *bench, unsigned int motor, uint32_t states,
		 unsigned int mode, int64_t target, int64_t ns);

/* A program that holds 90 % of the free memory until it is killed; not without having it. */
pid_t bench_take_memory(void);

int64_t bench_now_ns(void);
void bench_nap(int64_t ns);

#endif
