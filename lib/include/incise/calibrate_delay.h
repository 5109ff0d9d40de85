/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Delay between two streams of one motion. Part of libincise-learn.
 *
 *     depth by the tracker  ____/~~\____/~~~\____
 *     force, or depth by    ______/~~\____/~~~\__     y(t) = f(d(t + delay)), delay < 0 here:
 *     the camera                 |-|                  the motion's timestamps are earlier
 *
 * Correlation of band-limited derivatives finds the delay roughly (as the PLUS toolkit does:
 * Lasso et al., IEEE Trans. Biomed. Eng. 61, 2014), least squares find it to a fraction of a
 * sample, and resampled blocks of the run give its uncertainty.
 *
 * A force depends on depth by an unknown curve, and leads it if the material is viscous: a
 * stiffness c1 and a viscosity c2 look like a delay of c2/c1. Both are fitted as far as they
 * can be separated: F = E(x) + v·V(x) + W(x, |v|) with x the depth of the contact, and E, V, W
 * polynomials of x that are 0 at the start of the contact (Hunt and Crossley, J. Appl. Mech.
 * 42, 1975). A material that reacts only by viscosity at first contact would bias the result.
 */
#ifndef INCISE_CALIBRATE_DELAY_H
#define INCISE_CALIBRATE_DELAY_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Shortest motion. */
#define INCISE_DELAY_SPAN_MIN_S 8.0
/** Smallest correlation of the streams. */
#define INCISE_DELAY_CORRELATION_MIN 0.8
#define INCISE_DELAY_SECOND_MAX 0.8 /**< largest second peak, relative to the first */
#define INCISE_DELAY_SD_MAX_MS 0.5  /**< largest uncertainty */

/** A value of a stream, with its timestamp. */
struct incise_delay_point {
	int64_t t_ns; /**< ascending */
	double value; /**< not finite: missing, for example a clipped force */
};

/** The relation of the other stream to the motion. */
enum incise_delay_relation {
	INCISE_DELAY_ALIKE, /**< the same depth, scaled; it may end at a depth */
	INCISE_DELAY_FORCE, /**< force on a pressed material */
};

/** The delay between two streams, and its uncertainty. */
struct incise_delay_fit {
	double delay_ms;	      /**< how late the motion's timestamps are */
	double sd_ms;		      /**< standard uncertainty */
	double low_ms, high_ms;	      /**< 95 % interval */
	double drift_ms, drift_sd_ms; /**< change of the delay over the run */
	double correlation;	      /**< of the derivatives of other stream and fit */
	double second;		      /**< highest other peak of correlation, relative */
	double contact_mm; /**< motion at the start of contact; NAN: permanent contact */
	double span_s;	   /**< common duration of both streams */
	int blocks;	   /**< number of blocks of the run */
};

/**
 * Find the delay between two streams of one motion.
 *
 * @param motion   depth, mm
 * @param other    depth, mm, or force, N
 * @param range_ms the delay is searched from -range_ms to range_ms, 10 to 1000
 * @param fit      set as far as known even on error
 * @return 0; -EINVAL (times that do not ascend), -EDOM (less than 8 s in common, too little
 *         motion, no correlation, a periodic motion, a delay beyond the range, an interval
 *         that is too wide; the message names it), -ENOMEM.
 */
INCISE_API int incise_calibrate_delay(const struct incise_delay_point *motion,
				      int n_motion,
				      const struct incise_delay_point *other, int n_other,
				      enum incise_delay_relation relation,
				      double range_ms, struct incise_delay_fit *fit,
				      struct incise_error *err);

INCISE_END_DECLS
#endif
