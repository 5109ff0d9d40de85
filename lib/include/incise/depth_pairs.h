/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Pairs of depth from the camera and depth from the tracker of a recording;
 * incise/redundancy.h compares them. Part of libincise-record.
 */
#ifndef INCISE_DEPTH_PAIRS_H
#define INCISE_DEPTH_PAIRS_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

INCISE_BEGIN_DECLS

/** Depth in a frame, and the position of the tip from the tracker at that time. */
struct incise_depth_pair {
	int64_t t_ns;
	double camera_mm, tracker_mm; /**< depth below the surface */
	/** position of the tip along the surface, in two arbitrary axes */
	double place_mm[2];
	double rate_mm_s; /**< change of the tracker's depth */
};

/**
 * Read the pairs of a recording: frames with a depth of quality 0.5 or better, between two
 * tracker records at most 50 ms apart, with both depths of 1 mm or more.
 *
 * @param pairs to be freed with free(3)
 * @return number of pairs, 0 without a camera; -EINVAL, -EIO (an invalid row), -ENOMEM
 */
INCISE_API int incise_depth_pairs(struct incise_recording *recording,
				  struct incise_depth_pair **pairs,
				  struct incise_error *err);

INCISE_END_DECLS
#endif
