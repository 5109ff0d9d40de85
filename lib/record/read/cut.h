/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cuts of a recording, as a stream: every force sample taken with the blade in the
 * tissue, with depth and velocity interpolated at its time. Memory does not grow with
 * the length of the recording.
 *
 *     depth   0.3 mm ─ ─ ─╱▔▔▔▔▔▔▔╲─ ─ ─ ─      a cut begins above 0.3 mm
 *             0.1 mm ─ ─ ╱─ ─ ─ ─ ─╲─ ─ ─ ─      and ends below 0.1 mm
 *               0  ──────╱──────────╲───────
 *                         [── cut ──)
 */
#ifndef INCISE_CUT_H
#define INCISE_CUT_H

#include <stdbool.h>
#include <stdint.h>
#include <sqlite3.h>
#include <incise/calibration.h>
#include "recording.h"
#include "row_times.h"

/* Ten times the tracker's noise apart, so that noise ends no cut. */
#define INCISE_CUT_BEGIN_MM 0.3
#define INCISE_CUT_END_MM 0.1

/* Hysteresis on depth. Set to {0} before use. */
struct incise_cut {
	bool inside;
	int count; /* begun so far; the number of the present one, from 1 */
};

/* Take the next depth; whether the blade is in the tissue. */
bool incise_cut_step(struct incise_cut *cut, double depth_mm);

/* A force sample inside a cut. */
struct incise_cut_sample {
	int cut; /* from 1 */
	int64_t t_ns;
	double depth_mm, velocity_mm_s, force_N;
	bool clipped; /* code at either end of the converter */
};

/* A row of the table `depth`, as far as it is needed here. */
struct incise_cut_depth {
	int64_t t_ns;
	double depth_mm, velocity_mm_s;
};

struct incise_cuts {
	struct incise_recording *recording;
	sqlite3_stmt *force, *depth;
	struct incise_row_times force_times, depth_times;
	struct incise_cut cut;
	struct incise_cut_depth before, after; /* the force sample */
	bool has_before, has_after;
	double n_per_code, zero_N;
	int32_t top;		   /* largest code */
	int64_t first_ns, last_ns; /* force samples so far */
	uint64_t force_rows, depth_rows;
	double depth_max_mm; /* of all depth rows so far; -INFINITY before the first */
};

/* Start at the beginning. Returns 0 or -errno; then there is nothing to close. */
int incise_cuts_open(struct incise_cuts *cuts, struct incise_recording *recording,
		     struct incise_error *err);

/* Take another calibration of force than the recording's, its zero and the delays of force
 * and tracker where that has them. Before the first sample. */
void incise_cuts_calibrate(struct incise_cuts *cuts,
			   const struct incise_calibration *calibration);

/*
 * The next sample inside a cut. Every row on the way is checked. Returns 1, 0 at the
 * end, -EINVAL (a row that cannot be; rows missing), -EIO.
 */
int incise_cuts_next(struct incise_cuts *cuts, struct incise_cut_sample *sample,
		     struct incise_error *err);

void incise_cuts_close(struct incise_cuts *cuts);

#endif
