/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Force of an actuator per microstep, and its losses at reversals, from strokes up and down
 * against a force sensor. A pure function on arrays; no device and no file. Part of
 * libincise-learn.
 *
 *   force N                     turning round at the top, in detail
 *     |         up  /,              . . . . . . o turning point
 *     |           /,'               :  dead   / |
 *     |         /,'                 o--------´  |
 *     |       /,'                   |  stiction |  the up branch's line
 *     |     /,'  down               o           |
 *     |   /,'                      / rest       |
 *     +------------- position mm  /  the down branch's line
 *
 * Parallel lines, one per stroke, fit the points after the reversals. Where two strokes meet,
 * the distance of their lines is
 *
 *     branches_mm = backlash_mm - rest_N/N_mm,      dead_mm = backlash_mm + stiction_N/N_mm
 *
 * Backlash is the travel without a change of force, independent of the spring. Stiction is the
 * jump of the force at its end. The remaining distance between the curve and the line of its
 * branch, which decreases with the travel, is not lost travel but force: hysteresis_N, the
 * loss of spring and sensor. Friction between spring and sensor that is equal at rest and in
 * motion looks like a backlash of 2 friction/N_mm and is included in it: a measurement at the
 * sensor cannot separate them.
 */
#ifndef INCISE_CALIBRATE_STEPPER_H
#define INCISE_CALIBRATE_STEPPER_H

#include <stdbool.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A commanded position, and the sensor's reading at rest there. */
struct incise_calibrate_stepper_point {
	double position_mm; /**< counted; -1e4 … 1e4 */
	double force_N;	    /**< -1e4 … 1e4 */
};

/** Settings; comments end with the defaults of incise_calibrate_stepper_init(). */
struct incise_calibrate_stepper_setup {
	double step_mm; /**< one microstep; 0.000625 */
	/** Relative standard uncertainty of the sensor's sensitivity; 0.0289: 5 %, rectangular. */
	double sensor_u;
	double resolution_N;  /**< one code of the sensor; 0: unknown */
	double low_N, high_N; /**< ends of the sensor's range; NAN: unknown */
	double spring_N_mm;   /**< nominal stiffness; NAN: unknown */
	double tolerance;     /**< largest relative deviation from it; 0.2 */
	double linearity;     /**< largest accepted, percent of full scale; 2 */
};

/** The use of a point. */
enum incise_calibrate_stepper_state {
	INCISE_CALIBRATE_STEPPER_USED,
	INCISE_CALIBRATE_STEPPER_TURN, /**< after a reversal: not yet on the line */
	INCISE_CALIBRATE_STEPPER_SATURATED,
	INCISE_CALIBRATE_STEPPER_OUTLIER,
};

/** The result. */
struct incise_calibrate_stepper {
	double N_step, N_step_u; /**< force per microstep; U is twice that (k = 2) */
	double N_mm, N_mm_u;	 /**< per mm; without the error of the screw's lead */
	double backlash_mm, backlash_u_mm;
	double hysteresis_N, hysteresis_u_N;
	double stiction_N, stiction_u_N; /**< jump of the force at break-away */
	double dead_mm;	    /**< travel from a reversal to a change of force */
	double rest_N;	    /**< signed hysteresis: > 0 loses energy, < 0 gains */
	double rest_mm;	    /**< travel on which it decays */
	double branches_mm; /**< distance of the lines of both directions */
	/** Largest distance of means over an eighth of the range from the lines; % of full scale. */
	double linearity;
	double low_mm, high_mm, low_N, high_N; /**< range of the used points */
	double residual_sd_N; /**< of the used points, about their lines */
	/** ratio of the means' deviations to those expected from readings; 1 … */
	double misfit;
	double drift_N; /**< largest distance between lines of strokes of one direction */
	double up_N, down_N; /**< means of the branches' lines at 0 mm */
	int freedom;
	int points, used, saturated, outliers, strokes;
	bool pass;
	struct incise_calibration_budget budget; /**< of N_step */
};

/** Set the defaults documented above. */
INCISE_API void incise_calibrate_stepper_init(
	struct incise_calibrate_stepper_setup *setup);

/**
 * Fit the lines. A stroke is a run of positions in one direction. Outliers are detected with a
 * slope by the median of pairs (Theil 1950, Sen 1968); the lines are least squares of the
 * rest, equally weighted.
 *
 * @param points n points in order of time, 1 … 1000000
 * @param states use of n points, set as far as known even on error; or NULL
 * @return 0 (@result->pass has the verdict); -EINVAL (a value out of range), -ENODATA (fewer
 *         than 2 strokes in each direction, or fewer than 8 points in one), -EDOM (range too
 *         small; the sensor does not react; the force falls while the position rises; swapped
 *         columns; saturated or without contact over a part of the range; lost steps: strokes
 *         that differ; more than one outlier in seven), -ENOMEM
 */
INCISE_API int incise_calibrate_stepper(
	const struct incise_calibrate_stepper_point *points, int n,
	const struct incise_calibrate_stepper_setup *setup,
	struct incise_calibrate_stepper *result,
	enum incise_calibrate_stepper_state *states, struct incise_error *err);

INCISE_END_DECLS
#endif
