/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The virtual actuator on the bench: its handle is pressed against a stiff force sensor.
 *
 *   nut ─▶| backlash |─/\/\ spring, loss /\/\─ handle ─▶| sensor
 *                                              friction
 *
 *       force N
 *         |          __.   after turning round the force stands still for the backlash,
 *         |        ,'  /   and until the handle breaks away; the loss goes the other way
 *         |      ,'  ,'    round: it is in the force that the spring needs
 *         |    ,'  ,'
 *         +--------------- nut mm
 *
 * All of it is at rest at any time: a spring without mass, friction that no time changes.
 */
#ifndef INCISE_SIM_BENCH_H
#define INCISE_SIM_BENCH_H

#include <stdbool.h>
#include <incise/sim.h>

/* All zero at the begin. */
struct incise_bench {
	double nut_mm;	  /* counted, when it was last looked at */
	double lost_mm;	  /* of the count: steps that were not made */
	double behind_mm; /* behind the backlash */
	double loss_N;	  /* of the spring, now */
	double force_N;	  /* on the sensor */
	int sliding;	  /* the handle, which way; 0: it sticks */
};

/* The nut's count is at @nut_mm now, at a speed of @mm_s. */
void incise_bench_follow(struct incise_bench *bench,
			 const struct incise_sim_config *config, double nut_mm,
			 double mm_s) INCISE_REALTIME;

#endif
