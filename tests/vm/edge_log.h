/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Judges the edges of one motor as the simulated chip has timestamped them. Nothing of the
 * module is believed: steps, direction and times are those on the lines.
 *
 *              set_up >=      high >=  low >=          hold >=   set_up >=
 *   dir   ____/~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~\_______________
 *   step  ________________/~~~~~~~\_______/~~~~~~~\__________________/~~~~~~~\__
 *                         |<----- 1/v at least --->|
 *
 * A timestamp is taken within the write, and the module counts from after a write to before the
 * next: so high, low, set-up, hold and the interval at full speed hold to the nanosecond,
 * however late an edge is.
 *
 * Acceleration: at a step the profile stands exactly where the steps have come to. So the
 * mean velocity between two steps is known, whatever is between; and of two windows of G
 * and H seconds that follow each other it differs by a ((G + H)/2 + T) at most, T being the
 * tick in which velocity jumps. A step may be out up to lateness_ns after its time, which
 * leaves each window a range of velocities; the two ranges must come as near as that.
 * Windows are of 1, 2, 4 ... 64 steps: the long ones are hardly touched by lateness. While
 * no step comes, the motor is within a step of where it was: so a stop without braking is
 * found too.
 */
#ifndef INCISE_VM_EDGE_LOG_H
#define INCISE_VM_EDGE_LOG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../../driver/sim/incise_sim.h"

#define EDGE_LOG_STOPS 4
#define EDGE_LOG_WINDOW 64 /* steps, a power of two */
#define EDGE_LOG_HISTORY 256

/* An input that forbids steps: how many may still come after its edge. */
struct edge_log_stop {
	bool used;
	unsigned int line;
	bool low;      /* active low */
	int direction; /* +1, -1: only these steps; 0: all, and at once */
	unsigned int allowed;
};

/* The timing that a motor guarantees. */
struct edge_log_motor {
	unsigned int step, dir, enable;	    /* lines */
	bool step_low, dir_low, enable_low; /* active low; dir: up is low */
	int64_t high_ns, low_ns, setup_ns, hold_ns, enable_ns;
	double velocity;     /* steps/s */
	double acceleration; /* steps/s^2 */
	int64_t tick_ns;
	int64_t catch_ns;    /* a step may follow so much sooner than velocity says */
	int64_t lateness_ns; /* of a step at most; < 0: acceleration is not judged */
	int64_t position_min, position_max;
	struct edge_log_stop stop[EDGE_LOG_STOPS];
};

enum edge_log_fault {
	EDGE_LOG_LOST,	 /* a gap in the sequence */
	EDGE_LOG_ORDER,	 /* time went backwards */
	EDGE_LOG_REPEAT, /* a line changed to what it was */
	EDGE_LOG_HIGH,
	EDGE_LOG_LOW,
	EDGE_LOG_SETUP,
	EDGE_LOG_HOLD,
	EDGE_LOG_ENABLE, /* a step without power, or too soon after it */
	EDGE_LOG_VELOCITY,
	EDGE_LOG_ACCELERATION, /* of steps, or a stop without braking */
	EDGE_LOG_RANGE,	       /* beyond position_min ... position_max */
	EDGE_LOG_STOP,	       /* a step that a limit or the e-stop forbids */
	EDGE_LOG_FAULTS
};

struct edge_log {
	struct edge_log_motor motor;
	/* Result */
	int64_t position;
	uint64_t edges, up, down;
	uint64_t faults[EDGE_LOG_FAULTS];
	uint64_t faulty;    /* sum of faults */
	char first[200];    /* the first, for a person */
	uint64_t into_stop; /* most steps that came after a stop's edge */
	int64_t mark_ns;    /* set by the caller: steps after it are counted */
	uint64_t marked;
	double hardest; /* acceleration that steps show for sure, of the limit */
	/* State */
	bool begun, step_on, dir_on, powered;
	uint32_t sequence;
	int64_t t_ns, lead_ns, trail_ns, dir_ns, powered_ns;
	bool stopped[EDGE_LOG_STOPS];
	unsigned int after_stop[EDGE_LOG_STOPS];
	uint64_t steps; /* in history */
	struct {
		int64_t t_ns, position;
	} history[EDGE_LOG_HISTORY];
};

/*
 * Begins with a motor at rest, without power, at @position. @levels are those of the lines
 * step, dir, enable when the log starts, bits 0 to 2.
 */
void edge_log_init(struct edge_log *log, const struct edge_log_motor *motor,
		   int64_t position, unsigned int levels);

/* New limits for a motor that stands; position and counts go on. */
void edge_log_limits(struct edge_log *log, const struct edge_log_motor *motor);

/* Goes on with more edges, of this motor or not; returns the sum of faults so far. */
uint64_t edge_log_take(struct edge_log *log, const struct incise_sim_edge *edge,
		       size_t n);

const char *edge_log_name(enum edge_log_fault fault);

#endif
