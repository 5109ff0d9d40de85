/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The force samples near a row of a resampled recording, and the force at the row's time.
 * Memory is that of the samples that are near.
 *
 *     samples  │││││││││││││││││
 *     weights      ╱▔▔╲           filtered, where rows are fewer
 *     row           ▲
 *
 * N, ns.
 */
#ifndef INCISE_FORCE_NEAR_H
#define INCISE_FORCE_NEAR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "../read/rows.h"

#define INCISE_FORCE_HALF 8 /* rows to each side that a row is made of */

struct incise_force_sample_near {
	int64_t t_ns;
	int32_t code;
};

struct incise_force_near {
	struct incise_rows rows;
	struct incise_recording_force scale;
	int64_t last_ns; /* of the recording's last sample, as far as it says */
	struct incise_force_sample_near *samples;
	size_t n, room;
	double *weights; /* of |rows|, in small steps */
};

/* The force at a time, with its standard uncertainty from noise. */
struct incise_force_value {
	double force_N, u_N; /* NAN: none near */
	bool clipped;
};

/*
 * Weight of a force sample that is so many rows away from the row: a sinc with its -6 dB
 * at a third of the rate of rows, under Blackman's window of 8 rows to each side. Even,
 * so that phase and delay are 0; the weights are divided by their sum, so that a constant
 * comes out as it is. From half the rate of rows on, where aliases would begin, less than
 * 1e-3 is let through.
 */
double incise_force_weight(double rows);

/* With the first sample, where there is one. Returns 0 or -errno. */
int incise_force_near_open(struct incise_force_near *near,
			   struct incise_recording *recording,
			   const struct incise_calibration *given,
			   struct incise_error *err);
void incise_force_near_close(struct incise_force_near *near);

/* Take another sample: 1, 0 at the end, -errno. */
int incise_force_near_more(struct incise_force_near *near, struct incise_error *err);

/* The first samples are not near any more; they go in large lots. Returns how many went. */
size_t incise_force_near_forget(struct incise_force_near *near, size_t n);

/* At the time of a sample. */
void incise_force_near_sample(const struct incise_force_near *near, size_t at,
			      struct incise_force_value *value);

/* Weighted over rows that far apart; nothing, where none is within half a row. */
void incise_force_near_filter(const struct incise_force_near *near, int64_t t_ns,
			      double row_ns, struct incise_force_value *value);

/* On the line between the samples before and after. */
void incise_force_near_line(const struct incise_force_near *near, int64_t t_ns,
			    struct incise_force_value *value);

#endif
