/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A recording as the loop meets it, time going on: the poses that have come, the force
 * around a tick, and the depth that tells of cuts. Nothing in the file is trusted.
 */
#ifndef INCISE_REPLAY_SOURCE_H
#define INCISE_REPLAY_SOURCE_H

#include <incise/replay.h>
#include "../read/cut.h"
#include "../read/recording.h"
#include "../read/rows.h"

struct incise_replay_stream {
	struct incise_rows rows;
	bool live;    /* there is a row */
	int64_t t_ns; /* when it is replayed: its own time, or that of its arrival */
};

struct incise_replay_source {
	struct incise_recording *recording;
	enum incise_replay_at at;
	struct incise_tracker_info info; /* latency 0 when poses come at acquisition */
	int64_t first_ns, last_ns;	 /* of what there is to replay */
	int64_t origin_ns;		 /* first force sample; without one first_ns */
	struct incise_replay_stream tracker, force, depth;
	struct incise_recording_force scale;
	struct incise_cut_depth deep[2]; /* before and after */
	struct incise_cut cut;
};

/* What the recording says around a time. */
struct incise_replay_measure {
	double force_N, depth_mm; /* NAN: not known */
	bool clipped;
	int cut; /* 0 outside */
};

/* Start at the beginning. @calibration or NULL. 0 or -errno; then nothing is to be closed. */
int incise_replay_source_open(struct incise_replay_source *source,
			      struct incise_recording *recording,
			      enum incise_replay_at at,
			      const struct incise_calibration *calibration,
			      struct incise_error *err);

/* Take the next poses that had come by a time, at most n of them. How many, or -errno. */
int incise_replay_source_poses(struct incise_replay_source *source, int64_t t_ns,
			       struct incise_tracker_sample *poses, int n,
			       struct incise_error *err);

/* What is known of a time that is later than the last; the mean is over period_ns. */
int incise_replay_source_measure(struct incise_replay_source *source, int64_t t_ns,
				 int64_t period_ns, struct incise_replay_measure *measure,
				 struct incise_error *err);

/* Check what is left. 0 or -errno. */
int incise_replay_source_finish(struct incise_replay_source *source,
				struct incise_error *err);

void incise_replay_source_close(struct incise_replay_source *source);

#endif
