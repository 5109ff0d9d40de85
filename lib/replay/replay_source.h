/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A recording as input of the loop, in order of time: the poses up to a tick, the force around
 * it, and the depth, which defines cuts. The file is untrusted.
 */
#ifndef INCISE_REPLAY_SOURCE_H
#define INCISE_REPLAY_SOURCE_H

#include <incise/replay.h>
#include "../record/read/cut.h"
#include "../record/read/recording.h"
#include "../record/read/rows.h"

struct incise_replay_stream {
	struct incise_rows rows;
	int64_t t_ns; /* time in the replay: the row's own, or that of its arrival */
};

struct incise_replay_source {
	struct incise_recording *recording;
	enum incise_replay_at at;
	struct incise_tracker_info info; /* latency 0 when poses come at acquisition */
	int64_t first_ns, last_ns;	 /* of the rows to replay */
	int64_t origin_ns;		 /* first force sample; without one first_ns */
	struct incise_replay_stream tracker, force, depth;
	struct incise_recording_force scale;
	struct incise_cut_depth deep[2]; /* before and after */
	struct incise_cut_count cut;
};

/* Values of the recording around a time. */
struct incise_replay_measure {
	double force_N, depth_mm; /* NAN: not known */
	bool clipped;
	int cut; /* 0 outside */
};

/* @calibration replaces the recording's, or NULL. 0 or -errno; then nothing needs closing. */
int incise_replay_source_open(struct incise_replay_source *source,
			      struct incise_recording *recording,
			      enum incise_replay_at at,
			      const struct incise_calibration *calibration,
			      struct incise_error *err);

/* Read the next poses up to a time, at most n of them. Returns their number, or -errno. */
int incise_replay_source_poses(struct incise_replay_source *source, int64_t t_ns,
			       struct incise_tracker_sample *poses, int n,
			       struct incise_error *err);

/* Values at a time that is later than the last; the force is the mean over period_ns. */
int incise_replay_source_measure(struct incise_replay_source *source, int64_t t_ns,
				 int64_t period_ns, struct incise_replay_measure *measure,
				 struct incise_error *err);

/* Check the rows that are left. 0 or -errno. */
int incise_replay_source_finish(struct incise_replay_source *source,
				struct incise_error *err);

void incise_replay_source_close(struct incise_replay_source *source);

#endif
