/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A part of a recording: its rows are read from shortly before it, so that filters have settled and cuts keep
 * their numbers, to its end. What comes before and behind it is not read, but the poses before it.
 *
 *     force     ················├────────────────────────┤·········
 *     blade     ▔▔\__/▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔\______/▔▔▔▔▔▔▔▔
 *                            begin   │ from        to │ end
 *                            outside of tissue
 */
#ifndef INCISE_RANGE_H
#define INCISE_RANGE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>

struct incise_export_options;
struct incise_recording;

struct incise_recording_range {
	bool limited;
	int64_t begin_ns, end_ns; /* rows that are read, by their own times */
	int64_t every_ns; /* from a block of rows to the next one that is read; 0: all */
	int cuts;	  /* that are over at begin_ns */
	/* asked for: from the first sample, and of a cut, 0: any */
	int64_t from_ns, to_ns;
	int cut;
};

/*
 * Limit the rows of a recording that are opened from now on; without a range in the options, not. Those of a
 * joined recording are read all. @cuts: rows have the number of their cut, which depths from the cut before tell.
 * Returns 0, -ENODATA (no such cut, nothing there), -errno.
 */
int incise_recording_limit(struct incise_recording *recording,
			   const struct incise_export_options *options, bool cuts,
			   struct incise_error *err);

/* Whether a time, from the first sample, and a cut are in the range. */
bool incise_range_has(const struct incise_recording_range *range, int64_t since_ns,
		      int cut);

#endif
