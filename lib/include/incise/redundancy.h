/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Comparison of the depth from the tracker with the depth from camera frames. A difference
 * shows an error: steel near the tracker distorts its field differently at each place; a
 * displaced camera has the same error everywhere; with a wrong scale (mm per pixel) the error
 * grows with the depth. Part of libincise-learn.
 */
#ifndef INCISE_REDUNDANCY_H
#define INCISE_REDUNDANCY_H

#include <stdbool.h>
#include <incise/depth_pairs.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Largest bias: four pixels, or 10 ms at 50 mm/s. */
#define INCISE_REDUNDANCY_BIAS_MM 0.5
/** Largest difference between places: 15 sd of a tracker's noise; steel causes millimetres. */
#define INCISE_REDUNDANCY_PLACE_MM 0.3
/** Largest trend: 0.4 mm at 20 mm of depth. */
#define INCISE_REDUNDANCY_TREND 0.02

/** Camera compared with tracker. */
struct incise_redundancy {
	int n;
	double bias_mm, bias_u_mm; /**< camera - tracker, median */
	double trend, trend_u;	   /**< mm per mm of depth */
	/** Largest difference between quarters of the path, without the trend. */
	double place_mm, place_u_mm;
	double scatter_sd_mm; /**< robust, about bias, trend and places */
	double depth_low_mm, depth_high_mm, travel_mm; /**< range of the data */
	bool bias_bad, place_bad, trend_bad; /**< above the limit by twice its u */
};

/**
 * Compare both depths. Pairs with a change of depth above 20 mm/s are omitted. The
 * uncertainties come from means over one second, because errors of neighbouring pairs are
 * correlated. A pure function.
 *
 * @return 0; -ENODATA (fewer than 30 pairs, or 4 seconds of them), -EINVAL, -ENOMEM
 */
INCISE_API int incise_redundancy(const struct incise_depth_pair *pairs, int n,
				 struct incise_redundancy *result,
				 struct incise_error *err);

INCISE_END_DECLS
#endif
