/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The same depth by two ways: from the tracker and from the camera's pictures. Where they
 * disagree, one of them is wrong: steel near the tracker bends its field, by another amount at
 * each place; a camera that was moved is off by the same amount everywhere; a wrong mm per
 * pixel by an amount that grows with the depth.
 */
#ifndef INCISE_REDUNDANCY_H
#define INCISE_REDUNDANCY_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

INCISE_BEGIN_DECLS

/** A picture, and where the tracker says the tip was at its time. */
struct incise_depth_pair {
	int64_t t_ns;
	double camera_mm, tracker_mm; /**< depth below the surface */
	double place_mm[2]; /**< of the tip along the surface, in any two axes */
	double rate_mm_s;   /**< of the tracker's depth: what an error of time makes */
};

/**
 * Pairs of a recording: pictures with a depth of quality 0.5 or better, between two records of
 * the tracker that are at most 50 ms apart, with both depths of 1 mm or more. Part of
 * libincise-record.
 *
 * @param pairs to be freed with free(3)
 * @return how many, 0 where there was no camera; -EINVAL, -EIO (a row that cannot be), -ENOMEM
 */
INCISE_API int incise_depth_pairs(struct incise_recording *recording,
				  struct incise_depth_pair **pairs,
				  struct incise_error *err);

/** What is borne. */
struct incise_redundancy_limits {
	/** 0.5 mm: four pixels; 10 ms at 50 mm/s make as much. */
	double bias_mm;
	/** 0.3 mm between places: 15 sd of a tracker's noise; steel makes millimetres. */
	double place_mm;
	/** 0.02: 0.4 mm at 20 mm of depth. */
	double trend;
};

/** Camera against tracker. */
struct incise_redundancy {
	int n;
	double bias_mm, bias_u_mm;   /**< camera - tracker, median */
	double trend, trend_u;	     /**< mm per mm of depth */
	double place_mm, place_u_mm; /**< largest difference between quarters of the way,
				      * without the trend */
	double scatter_sd_mm;	     /**< about all of that; robust */
	double depth_low_mm, depth_high_mm, travel_mm; /**< what was visited */
	bool bias_bad, place_bad, trend_bad; /**< above the limit by twice its u */
};

INCISE_API void incise_redundancy_limits_init(struct incise_redundancy_limits *limits);

/**
 * Compare. Pairs while the depth changes by more than 20 mm/s are left out, and the
 * uncertainties are those of means over a second, as neighbours err alike. A pure function;
 * part of libincise-learn.
 *
 * @return 0; -ENODATA (fewer than 30 pairs, or 4 seconds of them), -EINVAL, -ENOMEM
 */
INCISE_API int incise_redundancy(const struct incise_depth_pair *pairs, int n,
				 const struct incise_redundancy_limits *limits,
				 struct incise_redundancy *result,
				 struct incise_error *err);

INCISE_END_DECLS
#endif
