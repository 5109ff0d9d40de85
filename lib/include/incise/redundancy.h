/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The same depth by two ways: from the tracker and from the camera's frames. Where they
 * disagree, one of them is wrong: steel near the tracker bends its field, by another amount at
 * each place; a camera that was moved is off by the same amount everywhere; a wrong mm per
 * pixel by an amount that grows with the depth. Part of libincise-learn.
 */
#ifndef INCISE_REDUNDANCY_H
#define INCISE_REDUNDANCY_H

#include <stdbool.h>
#include <incise/depth_pairs.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Largest bias: four pixels; 10 ms at 50 mm/s make as much. */
#define INCISE_REDUNDANCY_BIAS_MM 0.5
/** Largest difference between places: 15 sd of a tracker's noise; steel makes millimetres. */
#define INCISE_REDUNDANCY_PLACE_MM 0.3
/** Largest trend: 0.4 mm at 20 mm of depth. */
#define INCISE_REDUNDANCY_TREND 0.02

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

/**
 * Compare. Pairs while the depth changes by more than 20 mm/s are left out, and the
 * uncertainties are those of means over a second, as neighbours err alike. A pure function.
 *
 * @return 0; -ENODATA (fewer than 30 pairs, or 4 seconds of them), -EINVAL, -ENOMEM
 */
INCISE_API int incise_redundancy(const struct incise_depth_pair *pairs, int n,
				 struct incise_redundancy *result,
				 struct incise_error *err);

INCISE_END_DECLS
#endif
