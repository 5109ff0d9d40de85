/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The world of the virtual rig: it advances in ticks of 100 µs, and its streams take their
 * samples on the way.
 *
 *   tick      0        1        2        3
 *   ──────────┼────────┼────────┼────────┼──▶ script time
 *   sample    *     *     *     *              each at its own time, from the state at
 *                                              the tick before it
 *
 * All samples of a tick exist once the world has passed it. So their values depend neither on
 * the times at which devices are read nor on the set of open devices.
 */
#ifndef INCISE_SIM_WORLD_H
#define INCISE_SIM_WORLD_H

#include <stddef.h>
#include <incise/sim.h>
#include <incise/stepper.h>
#include "../tissue/tick.h"
#include "surgeon.h"

/* --- the liver: the force on a blade that moves through it --------------------------- */

/*
 * Its state moves on once a tick. A force within the tick comes from a copy, so that it does not
 * depend on earlier requests.
 */
struct incise_tissue {
	const struct incise_sim_config *config;
	uint64_t tooth_key, boundary_key;
	struct incise_double_front front; /* of the cut; see tissue.c */
	bool inside;			  /* the blade was in the tissue */
	int cut;			  /* of the script, that the front is of */
	double factor;			  /* tooth and bound, where the blade cut last */
	double force_N;			  /* of the last advance */
	double work_N_mm;   /* put into the cut, less the work that came back */
	double most_N_mm;   /* of that, so far */
	double path_mm;	    /* cut so far */
	double fracture_mm; /* path at the last fracture */
	double tooth_mm;    /* path from there to the next */
	uint64_t teeth;
};

/* @config must outlive @tissue. */
void incise_tissue_init(struct incise_tissue *tissue,
			const struct incise_sim_config *config);

/* Bring the tissue to the blade, then let that move on at its speed for a short time. */
void incise_tissue_advance(struct incise_tissue *tissue, const struct incise_blade *blade,
			   double dt_s) INCISE_REALTIME;

/* Force on a blade that has moved on for @ahead_s since the last advance, N. */
double incise_tissue_force(const struct incise_tissue *tissue,
			   const struct incise_blade *blade,
			   double ahead_s) INCISE_REALTIME;

/* --- the world ---------------------------------------------------------------------- */

#define INCISE_SIM_TICK_NS 100000
#define INCISE_SIM_RING_S 2.5 /* of each stream: an fdatasync may stall for long */

/* One device that samples the world; embedded in it. */
struct incise_sim_stream {
	struct incise_sim_stream *next;
	int64_t t_ns; /* script time of the next sample */
	/* Take the sample at t_ns and set t_ns to the time of the next sample. */
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
	double load_N; /* weight on the sensor; NAN: the blade is on it */
	/* Force on the sensor on the bench, at a script time; or NULL. */
	double (*press_N)(struct incise_stepper *stepper, int64_t t_ns) INCISE_REALTIME;
	struct incise_stepper *stepper; /* the first one */
};

/* Add a stream from the present tick on; its t_ns must not be earlier. */
void incise_sim_add_stream(struct incise_sim *sim, struct incise_sim_stream *stream);
void incise_sim_remove_stream(struct incise_sim *sim, struct incise_sim_stream *stream);

/* Advance to the clock's time. Real-time safe. */
void incise_sim_advance(struct incise_sim *sim) INCISE_REALTIME;

/* The blade and the force on it at a time within the present tick. */
void incise_sim_sense(const struct incise_sim *sim, int64_t t_ns,
		      struct incise_blade *blade, double *force_N) INCISE_REALTIME;

/* Number and script time of the samples of a device of so many Hz. */
uint64_t incise_sim_first(const struct incise_sim *sim, double hz);
int64_t incise_sim_time(uint64_t n, double hz) INCISE_REALTIME;

/*
 * The virtual actuator on the bench: its handle is pressed against a stiff force sensor.
 *
 *   nut ─▶| backlash |─/\/\ spring, loss /\/\─ handle ─▶| sensor
 *                                              friction
 *
 *       force N
 *         |          __.   after turning round the force stands still for the backlash,
 *         |        ,'  /   and until the handle breaks away; the spring's loss has the
 *         |      ,'  ,'    opposite sign on the way back
 *         |    ,'  ,'
 *         +--------------- nut mm
 *
 * Quasi-static: a spring without mass, friction that does not depend on time. Starts with {0}.
 */
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

/* Samples on their way to a reader: records of one size, first in, first out. */
struct incise_sim_ring {
	size_t size, capacity; /* bytes of a record; records */
	size_t head, count;
	uint64_t lost; /* oldest records, replaced by new ones */
	char *records;
};

/* Capacity for 2.5 s and @extra_s at a rate. Returns 0 or -ENOMEM. */
int incise_sim_ring_init(struct incise_sim_ring *ring, size_t size, double hz,
			 double extra_s);
void incise_sim_ring_free(struct incise_sim_ring *ring);
void incise_sim_ring_push(struct incise_sim_ring *ring,
			  const void *record) INCISE_REALTIME;

/* The oldest record, or NULL; stays until popped. */
const void *incise_sim_ring_peek(const struct incise_sim_ring *ring) INCISE_REALTIME;
void incise_sim_ring_pop(struct incise_sim_ring *ring) INCISE_REALTIME;

#endif
