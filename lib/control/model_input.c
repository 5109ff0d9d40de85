// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Inputs of a model in the haptic loop; see model_input.h.
 */
#include <math.h>
#include <string.h>
#include "../base/vector.h"
#include "model_input.h"

const struct incise_model_input_kind incise_model_input_kinds[INCISE_MODEL_INPUT_KINDS] =
	{
		[INCISE_INPUT_DEPTH] = {INCISE_DEPTH_COLUMN},
		[INCISE_INPUT_SPEED] = {INCISE_SPEED_COLUMN},
		[INCISE_INPUT_ACCELERATION] = {INCISE_ACCELERATION_COLUMN},
		[INCISE_INPUT_TILT] = {INCISE_TILT_COLUMN},
		[INCISE_INPUT_TIME] = {INCISE_TIME_COLUMN},
		[INCISE_INPUT_MEAN_SPEED] = {INCISE_MEAN_SPEED_COLUMN},
		[INCISE_INPUT_DEEPEST] = {INCISE_DEEPEST_COLUMN},
};

int incise_model_input_find(const char *name)
{
	for (int i = 0; i < INCISE_MODEL_INPUT_KINDS; i++)
		if (!strcmp(name, incise_model_input_kinds[i].name))
			return i;
	return -1;
}

double incise_input_tilt_deg(const double quaternion[4], const double axis[3],
			     const double normal[3])
{
	double turned[3];

	v3_rotate(turned, quaternion, axis);
	return incise_double_input_tilt(turned, normal);
}

void incise_stay_add(struct incise_stay *stay, int64_t t_ns, double depth_mm,
		     double speed_mm_s)
{
	double before_mm_s = stay->speed_mm_s, gap_ns;
	int64_t from_ns = stay->t_ns;

	/* A record that the filter passes over has no speed of its own. */
	if (isnan(speed_mm_s))
		speed_mm_s = before_mm_s;

	if (!stay->inside && depth_mm > 0) {
		double rise_mm = depth_mm - stay->depth_mm;
		double share = !stay->known	     ? 0
			       : stay->depth_mm <= 0 ? depth_mm / rise_mm
						     : 1;

		stay->inside = true;
		before_mm_s = speed_mm_s - share * (speed_mm_s - before_mm_s);
		from_ns = t_ns - llround(share * (double)(t_ns - from_ns));
		stay->began_ns = from_ns;
		stay->path_mm = stay->deepest_mm = 0;
	} else if (stay->inside && depth_mm < -INCISE_STAY_LEAVE_MM) {
		stay->inside = false;
	}
	if (stay->inside) {
		gap_ns = fmin((double)(t_ns - from_ns), INCISE_INPUT_GAP_NS);
		stay->path_mm += 0.5 * (before_mm_s + speed_mm_s) * gap_ns * 1e-9;
		stay->deepest_mm = fmax(stay->deepest_mm, depth_mm);
	}
	stay->known = true;
	stay->t_ns = t_ns;
	stay->depth_mm = depth_mm;
	stay->speed_mm_s = speed_mm_s;
}

double incise_stay_mean_speed_mm_s(const struct incise_stay *stay)
{
	return stay->t_ns > stay->began_ns
		       ? stay->path_mm / ((double)(stay->t_ns - stay->began_ns) * 1e-9)
		       : stay->speed_mm_s;
}
