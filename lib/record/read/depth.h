/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Depth below the tissue's surface and speed of the blade, from the tracker's records.
 *
 *            normal n
 *               ▲      · tip p above: depth negative
 *     ──────────┼───────────────────────────── surface, through p0
 *               p0     · tip p below: depth = -(p - p0)·n, positive, mm
 */
#ifndef INCISE_DEPTH_H
#define INCISE_DEPTH_H

#include <stdbool.h>
#include <stdint.h>

/*
 * Speed is the slope of a straight line through this many records before and after.
 * With 4 at 120 Hz (±33 ms) and a noise of sd 0.02 mm, a component of the velocity has
 * an sd of 0.02 mm · 120 Hz / √60 = 0.31 mm/s, which is 1 % of a cut's speed; a blade at
 * rest shows 0.5 mm/s in the mean. A swing of ±22 mm/s once a second is flattened by
 * 0.12 mm/s.
 */
#define INCISE_DEPTH_HALF 4
#define INCISE_DEPTH_WINDOW (2 * INCISE_DEPTH_HALF + 1)

/* Records further apart than this are not interpolated. */
#define INCISE_DEPTH_GAP_NS 50000000LL

/* One row of the table `depth`. */
struct incise_depth_row {
	int64_t seq, t_ns; /* of the tracker's record */
	double depth_mm, velocity_mm_s;
};

struct incise_depth_record {
	int64_t seq, t_ns;
	double position_mm[3];
};

struct incise_depth {
	double point_mm[3], normal[3];
	struct incise_depth_record window[INCISE_DEPTH_WINDOW];
	int n;	  /* records in the window, oldest first */
	int done; /* of them, from the oldest, that have their row */
};

void incise_depth_init(struct incise_depth *depth, const double point_mm[3],
		       const double normal[3]);

/* Depth of one position, mm. */
double incise_depth_of(const struct incise_depth *depth, const double position_mm[3]);

/* Add a record; true: it completes the window of an earlier one, whose row is in @row. */
bool incise_depth_push(struct incise_depth *depth, int64_t seq, int64_t t_ns,
		       const double position_mm[3], struct incise_depth_row *row);

/* At the end: the row of the next of the last records, with a shorter window; false: none. */
bool incise_depth_flush(struct incise_depth *depth, struct incise_depth_row *row);

#endif
