/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The inputs that a model can have in the haptic loop, and how each is computed: an export writes
 * columns of these names by the same definitions, so that training and loop agree.
 *
 *   depth_mm            of the tip below the surface
 *   velocity_mm_s       speed of the tip, |v|
 *   acceleration_mm_s2  rate of change of that speed, by the loop's causal filter
 *   tilt_deg            angle of the scalpel to the outward normal of the surface:
 *
 *                            normal  ▲   ╱ handle
 *                                    │  ╱
 *                                    │ ╱ tilt, 0 … 180
 *                            ────────┴────────
 *
 *   time_in_tissue_s    since the tip first touched the surface
 *   mean_speed_mm_s     path of the tip since then over that time
 *   deepest_mm          largest depth since then
 */
#ifndef INCISE_MODEL_INPUT_H
#define INCISE_MODEL_INPUT_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/export.h>
#include "../tissue/tick.h"

/* Name, unit and meaning, as a column of an export has them. */
#define INCISE_DEPTH_COLUMN "depth_mm", "mm", "of the tip below the surface"
#define INCISE_SPEED_COLUMN "velocity_mm_s", "mm/s", "speed of the tip"
#define INCISE_ACCELERATION_COLUMN      \
	"acceleration_mm_s2", "mm/s^2", \
		"rate of change of the speed, by the filter of the haptic loop"
#define INCISE_TILT_COLUMN \
	"tilt_deg", "deg", "angle of the scalpel to the surface's normal"
#define INCISE_TIME_COLUMN \
	"time_in_tissue_s", "s", "since the tip first touched the surface"
#define INCISE_MEAN_SPEED_COLUMN   \
	"mean_speed_mm_s", "mm/s", \
		"path of the tip since it first touched the surface over that time"
#define INCISE_DEEPEST_COLUMN \
	"deepest_mm", "mm", "largest depth since the tip first touched the surface"
#define INCISE_WAY_COLUMN \
	"way_mm", "mm", "of the front through new tissue: depth and length of the cut"

enum incise_model_input {
	INCISE_INPUT_DEPTH,
	INCISE_INPUT_SPEED,
	INCISE_INPUT_ACCELERATION,
	INCISE_INPUT_TILT,
	INCISE_INPUT_TIME,
	INCISE_INPUT_MEAN_SPEED,
	INCISE_INPUT_DEEPEST,
	INCISE_MODEL_INPUT_KINDS,
};

struct incise_model_input_kind {
	const char *name, *unit, *about;
};

extern const struct incise_model_input_kind
	incise_model_input_kinds[INCISE_MODEL_INPUT_KINDS];

/* An enum incise_model_input by its name, or -1. */
int incise_model_input_find(const char *name);

/* The default of a scene's tool.axis, by which exports compute the tilt. */
#define INCISE_SCALPEL_AXIS \
	{                   \
		0, 0, 1     \
	}

/* @axis and @normal: of unit length. NaN for a quaternion of NaN. */
double incise_input_tilt_deg(const double quaternion[4], const double axis[3],
			     const double normal[3]) INCISE_REALTIME;

/*
 * A stay in the tissue by depths at known times: it begins where the depth goes through 0 and ends
 * INCISE_STAY_LEAVE_MM above, as contact in the loop with the default of a scene's tissue.leave_mm.
 * Set to {0} before use.
 */
#define INCISE_STAY_LEAVE_MM 0.2

struct incise_stay {
	bool inside, known;
	int64_t began_ns;
	double path_mm, deepest_mm; /* since then */
	/* of the depth before */
	int64_t t_ns;
	double depth_mm, speed_mm_s;
};

/* Add a later depth, with the speed of the tip there. */
void incise_stay_add(struct incise_stay *stay, int64_t t_ns, double depth_mm,
		     double speed_mm_s);

/* At the last depth; its speed where the stay begins. */
double incise_stay_mean_speed_mm_s(const struct incise_stay *stay);

#endif
