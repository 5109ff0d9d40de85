/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Delay between two streams that have seen one motion. Part of libincise-learn.
 *
 *     depth by the tracker  ____/~~\____/~~~\____
 *     force, or depth by    ______/~~\____/~~~\__     y(t) = f(d(t + delay)), delay < 0 here:
 *     the camera                 |-|                  the motion's timestamps are earlier
 *
 * Correlation of band-limited derivatives finds the delay roughly (as the PLUS toolkit does:
 * Lasso et al., IEEE Trans. Biomed. Eng. 61, 2014), least squares of one stream under the
 * other finds it to a fraction of a sample, and resampled blocks of the run give its uncertainty.
 *
 * A force follows from depth by a curve that is not known, and leads it where the material is
 * viscous: a stiffness c1 and a viscosity of c2 look like a delay of c2/c1. Both are
 * fitted as far as they can be separated: F = E(x) + v·V(x) + W(x, |v|) with x the depth of the contact, and E,
 * V, W polynomials of x that are 0 where the contact starts (Hunt and Crossley, J. Appl. Mech. 42,
 * 1975). A material that pushes back by its viscosity alone at first touch would bias this.
 */
#ifndef INCISE_CALIBRATE_DELAY_H
#define INCISE_CALIBRATE_DELAY_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A motion that is shorter is refused. */
#define INCISE_DELAY_SPAN_MIN_S 8.0
/** Streams that agree less are refused. */
#define INCISE_DELAY_CORRELATION_MIN 0.8
#define INCISE_DELAY_SECOND_MAX 0.8 /**< of a second peak, relative to the first */
#define INCISE_DELAY_SD_MAX_MS 0.5  /**< a larger uncertainty is refused */

/** One value of a stream, at the time that the stream states. */
struct incise_delay_point {
	int64_t t_ns; /**< ascending */
	double value; /**< not finite: none, as of a force that is clipped */
};

/** The relation of the other stream to the motion. */
enum incise_delay_relation {
	INCISE_DELAY_ALIKE, /**< the same depth, scaled, maybe not below some depth */
	INCISE_DELAY_FORCE, /**< force of something that is pressed on */
};

/** The delay between two streams, and its uncertainty. */
struct incise_delay_fit {
	double delay_ms;	      /**< how much later the motion's timestamps are */
	double sd_ms;		      /**< standard uncertainty */
	double low_ms, high_ms;	      /**< 95 % interval */
	double drift_ms, drift_sd_ms; /**< of the delay from the beginning to the end */
	double correlation; /**< of the derivatives of the other stream and of the fit */
	double second;	    /**< highest other peak of correlation, relative */
	double contact_mm;  /**< motion at which the contact starts; NAN: it always is */
	double span_s;	    /**< that both streams cover */
	int blocks;	    /**< of the run */
};

/**
 * Delay of two streams of one motion.
 *
 * @param motion   depth, mm
 * @param other    depth, mm, or force, N
 * @param range_ms the delay is looked for from -range_ms to range_ms, 10 to 1000
 * @param fit      filled in as far as it got in any case
 * @return 0; -EINVAL (times that do not ascend), -EDOM (refused: less than 8 s in common, too
 *         little motion, no likeness, a periodic motion, a delay beyond the range, an
 *         interval that is too wide: the line says which), -ENOMEM.
 */
INCISE_API int incise_calibrate_delay(const struct incise_delay_point *motion,
				      int n_motion,
				      const struct incise_delay_point *other, int n_other,
				      enum incise_delay_relation relation,
				      double range_ms, struct incise_delay_fit *fit,
				      struct incise_error *err);

INCISE_END_DECLS
#endif
