/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cuts of a recording, as a stream: every force sample acquired with the blade in the
 * tissue, with depth and velocity interpolated at its time. Memory does not grow with
 * the length of the recording.
 *
 *     depth   0.3 mm ─ ─ ─╱▔▔▔▔▔▔▔╲─ ─ ─ ─      a cut starts above 0.3 mm
 *             0.1 mm ─ ─ ╱─ ─ ─ ─ ─╲─ ─ ─ ─      and ends below 0.1 mm
 *               0  ──────╱──────────╲───────
 *                         [── cut ──)
 */
#ifndef INCISE_CUT_H
#define INCISE_CUT_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/calibration.h>
#include "recording.h"
#include "rows.h"

/* Hysteresis on depth. Set to {0} before use. */
struct incise_cut_count {
	bool inside;
	int count; /* started so far; the number of the present one, from 1 */
};

/* Add the next depth. Returns whether the blade is in the tissue. */
bool incise_cut_step(struct incise_cut_count *cut, double depth_mm);

/* A force sample inside a cut. */
struct incise_cut_sample {
	int cut; /* from 1 */
	int64_t t_ns;
	double depth_mm, velocity_mm_s, force_N;
	bool clipped; /* code at either end of the converter */
};

/* Columns of the table `depth`. */
struct incise_cut_depth {
	int64_t t_ns; /* INCISE_TIME_NONE: none */
	double depth_mm, velocity_mm_s;
};

/* The depths around a force sample, and the cuts by it. */
struct incise_cut_follow {
	struct incise_cut_count cut;
	struct incise_cut_depth before, after;
};

/* Depth and velocity at sample->t_ns, to the sample. False: no depth is near, or not in a cut. */
bool incise_cut_between(struct incise_cut_follow *follow,
			struct incise_cut_sample *sample);

struct incise_cuts {
	struct incise_recording *recording;
	struct incise_rows force, depth;
	struct incise_cut_follow follow;
	struct incise_recording_force scale;
	int64_t first_ns, last_ns; /* force samples so far */
	double depth_max_mm; /* of all depth rows so far; -INFINITY before the first */
};

/* Start at the beginning. Returns 0 or -errno; then there is nothing to close. */
int incise_cuts_open(struct incise_cuts *cuts, struct incise_recording *recording,
		     struct incise_error *err);

/* Use another calibration than the recording's: its force, its zero and the delays of force
 * and tracker if it has them. Before the first sample. */
void incise_cuts_calibrate(struct incise_cuts *cuts,
			   const struct incise_calibration *calibration);

/*
 * Go to the next sample inside a cut and check every row on the way. Returns 1, 0 at the
 * end, -EINVAL (an impossible row; rows missing), -EIO.
 */
int incise_cuts_next(struct incise_cuts *cuts, struct incise_cut_sample *sample,
		     struct incise_error *err);

void incise_cuts_close(struct incise_cuts *cuts);

#endif
