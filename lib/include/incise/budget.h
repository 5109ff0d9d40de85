/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The uncertainty budget of a recording's values: force, depth, velocity and time of each row,
 * by its parts (GUM, JCGM 100:2008). Part of libincise-record.
 *
 *     common to a recording             own
 *     gain zero tip surface alignment   resolution noise smoothing jitter
 *              │ signed                       │ 0 or more
 *              └──────────────┬───────────────┘
 *     u = √(Σ part²)          value ± 2 u holds 95 %
 *
 * Parts are standard uncertainties, and independent of each other: where a calibration has a
 * covariance of two values, the first part has the common error. So, of the quantities p and q of
 * two rows i and j, the covariance is the sum over the common sources s that both have
 *
 *     cov(p_i, q_j) = Σ part_p,s(i) · part_q,s(j)
 *
 * and for one row also the squares of its own parts. A source that states no uncertainty is NaN
 * in its part and in the total; incise_budget_missing() says which. Own parts of depth and
 * velocity come from the tracker: rows nearer to each other than its records share them.
 *
 * Few repeats are widened where a calibration is fitted (Student's t over 2), so that 2 u holds
 * 95 % without effective degrees of freedom. Not real-time safe; an object is for one thread at
 * a time.
 */
#ifndef INCISE_BUDGET_H
#define INCISE_BUDGET_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

INCISE_BEGIN_DECLS

/** Quantities that have a budget. */
enum incise_budget_quantity {
	INCISE_BUDGET_FORCE,
	INCISE_BUDGET_DEPTH,
	INCISE_BUDGET_VELOCITY,
	INCISE_BUDGET_TIME,
	INCISE_BUDGET_QUANTITIES /**< number of quantities */
};

/** Sources of the common parts. */
enum incise_budget_source {
	INCISE_BUDGET_GAIN,  /**< sensitivity of the force channel, mV/N */
	INCISE_BUDGET_ZERO,  /**< zero of the force channel, mV */
	INCISE_BUDGET_TIP_X, /**< position of the tip in the sensor's frame, mm */
	INCISE_BUDGET_TIP_Y,
	INCISE_BUDGET_TIP_Z,
	INCISE_BUDGET_SURFACE,	     /**< surface along its normal, mm */
	INCISE_BUDGET_ALIGNMENT,     /**< times of the tracker against the force's, s */
	INCISE_BUDGET_LINE,	     /**< line through the tracker's arrivals, s */
	INCISE_BUDGET_DELAY,	     /**< delay of the force, s */
	INCISE_BUDGET_SOURCES,	     /**< number of common sources */
	INCISE_BUDGET_NO_SOURCE = -1 /**< of a part of its own */
};

/** Rows that share the error of a part. */
enum incise_budget_scope {
	INCISE_BUDGET_CALIBRATION, /**< all recordings with the same calibration */
	INCISE_BUDGET_RECORDING,   /**< all rows of a recording */
	INCISE_BUDGET_OWN	   /**< none: independent from row to row */
};

/** A part of the uncertainty of a quantity. */
struct incise_budget_part {
	const char *name;   /**< "gain", "noise", … */
	const char *column; /**< of exports: "force_u_gain_N" */
	const char *about;  /**< in words */
	enum incise_budget_quantity quantity;
	enum incise_budget_scope scope;
	int source; /**< enum incise_budget_source */
};

/** A quantity. */
struct incise_budget_value {
	const char *name;  /**< "force", "depth", "velocity", "time" */
	const char *value; /**< column of the value: "force_N"; of time "t_s" */
	const char *total; /**< column of the total: "force_u_N" */
	const char *unit;  /**< "N", "mm", "mm/s", "s" */
	int first, n;	   /**< its parts in the table of parts, in a row */
};

#define INCISE_BUDGET_PARTS 24 /**< number of parts */

/** The parts, quantity by quantity; static. */
INCISE_API const struct incise_budget_part *incise_budget_parts(void);

/** The quantities, in the order of enum incise_budget_quantity; static. */
INCISE_API const struct incise_budget_value *incise_budget_values(void);

struct incise_budget;

/**
 * Find the uncertainties of a recording: from its calibration.conf with the history, the
 * measured zero, the noise of its rows and the lines of its streams. It reads the rows of the
 * tracker once, and some of the force.
 *
 * @param given      calibration in place of the recording's own, as in
 *                   incise_export_options; or NULL
 * @param given_path its file, whose history states the uncertainties; NULL: unknown uncertainties
 * @return budget, to be freed with incise_budget_free(); NULL with errno EINVAL (an invalid
 *         row, or an invalid calibration_conf in the recording), EIO, ENOMEM; ENOENT and others
 *         of incise_calibration_load() for @given_path
 */
INCISE_API struct incise_budget *incise_budget_new(struct incise_recording *recording,
						   const struct incise_calibration *given,
						   const char *given_path,
						   struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_budget_free(struct incise_budget *budget);

/** Standard uncertainty of a common source, in its unit; NAN: not stated. */
INCISE_API double incise_budget_u(const struct incise_budget *budget,
				  enum incise_budget_source source);

/**
 * Covariance of two common sources as their calibration has it, in the product of their units;
 * of one with itself the square of its uncertainty. NAN: not stated.
 */
INCISE_API double incise_budget_covariance(const struct incise_budget *budget,
					   enum incise_budget_source a,
					   enum incise_budget_source b);

/**
 * List the sources without an uncertainty, which make the total of a quantity unknown.
 *
 * @return one line for people with the remedy, owned by @budget; NULL: all is stated
 */
INCISE_API const char *incise_budget_missing(const struct incise_budget *budget,
					     enum incise_budget_quantity quantity);

/** Values of a row that its uncertainties depend on. NAN: not known, as its parts. */
struct incise_budget_row {
	double force_N;
	double depth_rate_mm_s;	   /**< change of the depth */
	double acceleration_mm_s2; /**< change of the velocity */
	double direction[3]; /**< of the velocity, of length 1, in the tracker's frame */
	/** change of the depth per mm of the tip's position in the sensor's frame */
	double tip[3];
	double tip_1_s[3]; /**< the same of the velocity */
	/** 0 … 1, way from one record of the tracker to the next; 0: at a record */
	double share;
	double force_share; /**< noise of the force over the noise of one sample */
	bool smoothed;	    /**< velocity of resampled rows; else of each pose */
	bool tracker_time;  /**< the time is a tracker record's, else the force's */
};

/**
 * Find the parts of a row.
 *
 * @param part INCISE_BUDGET_PARTS standard uncertainties in the units of their quantities, those
 *             of common sources with their sign; NAN: not stated
 */
INCISE_API void incise_budget_row(const struct incise_budget *budget,
				  const struct incise_budget_row *row,
				  double part[INCISE_BUDGET_PARTS]);

/** Standard uncertainty of a quantity by its parts; NAN if one of them is. */
INCISE_API double incise_budget_total(enum incise_budget_quantity quantity,
				      const double part[INCISE_BUDGET_PARTS]);

INCISE_END_DECLS
#endif
