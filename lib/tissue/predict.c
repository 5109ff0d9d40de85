// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Where a point is, and the inputs of a model, in double; see tick.h. Apart from the ticks, since exports
 * and checks have these only.
 */
#include <math.h>
#include "tick.h"
#include "../number/double.h"

#include "predict.proto.c"

/* Below this speed the noise of a tracker hides the direction of the motion. */
#define SLOW_MM_S 5.0

double incise_double_input_acceleration(const double velocity[3],
					const double acceleration[3])
{
	return v3_dot(velocity, acceleration) / fmax(v3_length(velocity), SLOW_MM_S);
}

double incise_double_input_tilt(const double axis[3], const double normal[3])
{
	double across[3];

	v3_cross(across, axis, normal);
	/* Exact at all angles, where an arc cosine is not near 0 and 180. */
	return atan2(v3_length(across), v3_dot(axis, normal)) * (180 / M_PI);
}

double incise_double_input_time(int64_t t_ns, int64_t from_ns)
{
	/* Unsigned: two times may be farther apart than an int64_t holds. */
	return (double)((uint64_t)t_ns - (uint64_t)from_ns) / INCISE_NS_PER_S;
}

double incise_double_input_path(double path, double speed, int64_t from_ns, int64_t t_ns)
{
	double gone_ns = (double)((uint64_t)t_ns - (uint64_t)from_ns);

	return t_ns > from_ns ? path + speed * fmin(gone_ns, INCISE_INPUT_GAP_NS) : path;
}

double incise_double_input_mean_speed(double path, double speed, int64_t from_ns,
				      int64_t t_ns)
{
	return t_ns > from_ns ? path / (double)((uint64_t)t_ns - (uint64_t)from_ns)
			      : speed;
}
