/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Force of an actuator per microstep, from strokes up and down against a force sensor, with
 * what is lost where it turns round. A pure function on arrays; no device and no file. Part of
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
 * Lines of one slope, one for each stroke, hold what lies behind a turn's end. Where two
 * strokes meet, their lines are apart by
 *
 *     branches_mm = backlash_mm - rest_N/N_mm,      dead_mm = backlash_mm + stiction_N/N_mm
 *
 * Backlash: travel at which the force stands still, whatever the spring is. Stiction: the jump
 * at its end. What is left between the curve and its branch's line then, and fades on the way,
 * is no lost travel but force: hysteresis_N, the loss of spring and sensor. Friction between
 * spring and sensor that is the same at rest and in motion looks like a backlash of
 * 2 friction/N_mm, and is part of it: no measurement at the sensor alone distinguishes them.
 */
#ifndef INCISE_CALIBRATE_STEPPER_H
#define INCISE_CALIBRATE_STEPPER_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A commanded position, and the sensor's reading at rest there. */
struct incise_calibrate_stepper_point {
	double position_mm; /**< counted; -1e4 … 1e4 */
	double force_N;	    /**< -1e4 … 1e4 */
};

/** Settings beside the points; incise_calibrate_stepper_init() gives the defaults. */
struct incise_calibrate_stepper_setup {
	double step_mm;	 /**< one microstep; 0.000625 */
	double sensor_u; /**< standard uncertainty of the sensor's sensitivity, relative;
				     0.0289: 5 %, rectangular */
	double resolution_N;  /**< one code of the sensor; 0: not known */
	double low_N, high_N; /**< where the sensor's range ends; NAN: not known */
	double spring_N_mm;   /**< what it should be; NAN: not known */
	double tolerance;     /**< 0.2 of that */
	double linearity;     /**< largest that passes, percent of full scale; 2 */
};

/** The use of a point. */
enum incise_calibrate_stepper_state {
	INCISE_CALIBRATE_STEPPER_USED,
	INCISE_CALIBRATE_STEPPER_TURN, /**< behind a turn: not on a branch's line yet */
	INCISE_CALIBRATE_STEPPER_SATURATED,
	INCISE_CALIBRATE_STEPPER_OUTLIER,
};

/** A line of the budget of uncertainty of N_step. */
struct incise_calibrate_stepper_part {
	char source[48];
	char type; /**< 'A' by statistics of the readings, 'B' otherwise */
	double u;  /**< standard uncertainty of the source, in @unit */
	char unit[8];
	double u_N_step; /**< what it adds to that of N_step, in squares */
};

/** Lines that a budget has. */
#define INCISE_CALIBRATE_STEPPER_PARTS 3

/** The result. */
struct incise_calibrate_stepper {
	double N_step, N_step_u; /**< force per microstep; U is twice that (k = 2) */
	double N_mm,
		N_mm_u; /**< the same per mm; without the error of the screw's lead */
	double backlash_mm, backlash_u_mm;
	double hysteresis_N, hysteresis_u_N;
	double stiction_N, stiction_u_N; /**< the jump of force where it breaks away */
	double dead_mm;	    /**< travel from turning round to where the force changes */
	double rest_N;	    /**< hysteresis with its sign: > 0 is loss, < 0 is give */
	double rest_mm;	    /**< travel on which that fades */
	double branches_mm; /**< between the lines of the two ways */
	double linearity; /**< largest distance from the lines, of means of an eighth of the
				  range; percent of full scale */
	double low_mm, high_mm, low_N, high_N; /**< range of the points used */
	double residual_sd_N; /**< of the points used, about their lines */
	double misfit; /**< how much further means lie off than readings explain; 1 … */
	double drift_N; /**< largest distance between lines of strokes of the same way */
	double up_N, down_N; /**< means of the branches' lines at 0 mm */
	int freedom;
	int points, used, saturated, outliers, strokes;
	bool pass;
	int parts;
	struct incise_calibrate_stepper_part part[INCISE_CALIBRATE_STEPPER_PARTS];
};

/** Defaults as documented above. */
INCISE_API void incise_calibrate_stepper_init(
	struct incise_calibrate_stepper_setup *setup);

/**
 * Fit. A stroke is a run of positions that go one way; it restarts where they turn round.
 * Outliers are found from a slope by the median of pairs (Theil 1950, Sen 1968); the lines are
 * least squares of the rest, weighed alike.
 *
 * @param points in order of time, n of them, 1 … 1000000
 * @param states of n points, filled in also where it is refused as far as it is known; or NULL
 * @return 0 (look at @result->pass); -EINVAL (a value out of range), -ENODATA (fewer than 2
 *         strokes of each way, or of 8 points each), -EDOM (range too small; the sensor does
 *         not move; force that falls where the position rises; columns swapped; saturated or
 *         not in touch over a part of the range; strokes that stay apart: lost steps; more
 *         than one outlier in seven), -ENOMEM
 */
INCISE_API int incise_calibrate_stepper(
	const struct incise_calibrate_stepper_point *points, int n,
	const struct incise_calibrate_stepper_setup *setup,
	struct incise_calibrate_stepper *result,
	enum incise_calibrate_stepper_state *states, struct incise_error *err);

INCISE_END_DECLS
#endif
