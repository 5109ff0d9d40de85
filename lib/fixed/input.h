/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Inputs of a model in integers; lib/tissue/predict.c does the same in double, see there.
 *
 *   velocities Q16.16 mm/s     accelerations Q16 mm/s², in 64 bits     directions Q2.30
 *   inputs Q16.16 of their units, held to 32 bits
 */
#ifndef INCISE_FIXED_INPUT_H
#define INCISE_FIXED_INPUT_H

#include <incise/export.h>
#include "integers.h"

/* As a plan numbers them: one more than enum incise_model_input. */
enum incise_fixed_input_kind {
	INCISE_FIXED_INPUT_NONE,
	INCISE_FIXED_INPUT_DEPTH,
	INCISE_FIXED_INPUT_SPEED,
	INCISE_FIXED_INPUT_ACCELERATION,
	INCISE_FIXED_INPUT_TILT,
	INCISE_FIXED_INPUT_TIME,
	INCISE_FIXED_INPUT_MEAN_SPEED,
	INCISE_FIXED_INPUT_DEEPEST,
	INCISE_FIXED_INPUT_KINDS,
};

/*
 * Rounding of incise_fixed_input_acceleration(), _tilt(), _time() and _mean_speed() (tick.proto.h), of exact operands:
 * 2^-11 mm/s² and 2^-19 of it, by the speed; 10^-5 degrees; 2^-16 s; 2^-16 mm/s and 2^-18 of it. A unit vector off
 * by 2^-27 turns the angle by as many radians.
 */
#define INCISE_FIXED_INPUT_ACCELERATION_BITS 11
#define INCISE_FIXED_INPUT_ACCELERATION_SHARE_BITS 19
#define INCISE_FIXED_INPUT_TILT_DEG 1e-5
#define INCISE_FIXED_INPUT_MEAN_SPEED_SHARE_BITS 18

/* Ticks farther apart add to a path as if they were as near, in double as well. */
#define INCISE_INPUT_GAP_NS 4000000000

#endif
