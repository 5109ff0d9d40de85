/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The world of the virtual rig: it goes forward in ticks of 100 µs and lets the streams
 * that listen take their samples on the way.
 *
 *   tick      0        1        2        3
 *   ──────────┼────────┼────────┼────────┼──▶ script time
 *   sample    *     *     *     *              each at its own time, from the state at
 *                                              the tick before it
 *
 * All of a tick's samples exist once the world has gone past it, so what they hold
 * depends neither on when and how often a device is read nor on which are open.
 */
#ifndef INCISE_SIM_WORLD_H
#define INCISE_SIM_WORLD_H

#include <stddef.h>
#include <incise/sim.h>
#include <incise/stepper.h>
#include "surgeon.h"
#include "tissue.h"

#define INCISE_SIM_TICK_NS 100000
#define INCISE_SIM_ROOM_S 2.5 /* of every stream: an fdatasync may stall for long */

/* One device that samples the world; embedded in it. */
struct incise_sim_stream {
	struct incise_sim_stream *next;
	int64_t t_ns; /* script time of the next sample */
	/* Take the sample at t_ns and set t_ns to that of the one after it. */
	void (*sample)(struct incise_sim_stream *stream,
		       const struct incise_sim *sim) INCISE_REALTIME;
};

struct incise_sim {
	struct incise_sim_config config;
	struct incise_clock *clock;
	int64_t start_ns; /* of the script, by the clock */
	int64_t t_ns;	  /* script time that has been reached: a whole tick */
	struct incise_surgeon surgeon;
	struct incise_tissue tissue;
	struct incise_blade blade; /* at t_ns */
	struct incise_sim_stream *streams;
	double load_N; /* hung on the sensor; NAN: the blade is on it */
	/* What presses the force sensor on the bench, at a script time; or NULL. */
	double (*press_N)(struct incise_stepper *stepper, int64_t t_ns) INCISE_REALTIME;
	struct incise_stepper *stepper;
};

/* Let a stream listen from the present tick on; its t_ns must not lie before that. */
void incise_sim_listen(struct incise_sim *sim, struct incise_sim_stream *stream);
void incise_sim_unlisten(struct incise_sim *sim, struct incise_sim_stream *stream);

/* Go forward to the clock's time. Real-time safe. */
void incise_sim_advance(struct incise_sim *sim) INCISE_REALTIME;

/* The blade and the force on it at a time within the present tick. */
void incise_sim_sense(const struct incise_sim *sim, int64_t t_ns,
		      struct incise_blade *blade, double *force_N) INCISE_REALTIME;

/* Number and script time of the samples of a device of so many Hz. */
uint64_t incise_sim_first(const struct incise_sim *sim, double hz);
int64_t incise_sim_time(uint64_t n, double hz) INCISE_REALTIME;

/* Samples on their way to a reader: records of one size, first in, first out. */
struct incise_sim_ring {
	size_t size, room; /* bytes of a record; records */
	size_t head, count;
	uint64_t lost; /* oldest records that gave way to new ones */
	char *records;
};

/* Room for 2.5 s and @extra_s at a rate. Returns 0 or -ENOMEM. */
int incise_sim_ring_init(struct incise_sim_ring *ring, size_t size, double hz,
			 double extra_s);
void incise_sim_ring_free(struct incise_sim_ring *ring);
void incise_sim_ring_push(struct incise_sim_ring *ring,
			  const void *record) INCISE_REALTIME;

/* The oldest record, or NULL; stays until popped. */
const void *incise_sim_ring_peek(const struct incise_sim_ring *ring) INCISE_REALTIME;
void incise_sim_ring_pop(struct incise_sim_ring *ring) INCISE_REALTIME;

#endif
