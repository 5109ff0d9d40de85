/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The stages of a tick that need no tissue, in double and in integers, for tests that run on both: all
 * numbers are given and taken as doubles, in mm, N and s. Of each kind there is one plan.
 */
#ifndef TEST_STAGE_KINDS_H
#define TEST_STAGE_KINDS_H

#include <incise/tracker.h>
#include "../../../lib/fixed/plan.h"
#include "../../../lib/fixed/vector.h"
#include "../../../lib/surface/surface.h"
#include "../../../lib/tissue/tick.h"
#include "kinds.h"

/* All that a predictor says of one time, and what its filter has. */
struct shown {
	double x[3], v[3], a[3], q[4];
	int64_t age_ns;
};

struct filtered {
	double x[3], v[3], a[3];
	int64_t t_ns;
	uint32_t discontinuities;
};

/* Why a force is let through, or fades. */
enum poses { FRESH, STALE, FADING, CHANGING };

struct kind {
	void *tried; /* its plan, state and tick */
	size_t size;
	bool is_double;
	double bit; /* of a length or a force */

	/* Set the predictor to its start. Returns whether this kind takes such a filter. */
	bool (*set_filter)(const struct incise_double_filter *filter);
	bool (*add_pose)(const struct incise_tracker_sample *sample);
	struct shown (*show)(int64_t t_ns);
	struct filtered (*filtered)(void);
	void (*turn_about)(double mm_s, double mm_s2, double shown_mm_s);

	void (*set_average)(int ticks);
	void (*average)(const double normal[3], double averaged[3]);
	void (*touch)(double height_mm, double averaged[3]);

	void (*set_start)(int64_t ramp_ns, int64_t fade_ns, bool half, int64_t last_ns);
	double (*start)(double wanted_N, enum poses poses, int64_t t_ns, bool *released,
			double *command_N);

	void (*set_limit)(double force_N, double slew_N, const double last_N[3]);
	uint32_t (*limit)(double force_N[3]);
	double (*number)(double value); /* a length or force, as this kind has it */
};

/* The nearest integer with so many bits behind the point; not a number is the lowest. */
static inline int64_t stage_integer(double x, int bits, int64_t most)
{
	double scaled = rint(ldexp(x, bits));

	if (!(scaled > -(double)most))
		return -most - 1;
	return scaled < (double)most ? (int64_t)scaled : most;
}

#define SET(to, from, bits)                                                       \
	((to) = _Generic((to), double                                             \
			 : (from), int32_t                                        \
			 : (int32_t)stage_integer(from, bits, INT32_MAX), int64_t \
			 : stage_integer(from, bits, INT64_MAX / 2)))
#define GET(from, bits) \
	_Generic((from), double : (from), default : ldexp((double)(from), -(bits)))
#define SET_ALL(to, from, bits)                                    \
	for (size_t i_ = 0; i_ < sizeof(to) / sizeof(*(to)); i_++) \
	SET((to)[i_], (from)[i_], bits)
#define GET_ALL(to, from, bits)                                        \
	for (size_t i_ = 0; i_ < sizeof(from) / sizeof(*(from)); i_++) \
	(to)[i_] = GET((from)[i_], bits)

#include "../../../lib/number/double_kind.h"
#define FILTER_GOOD(filter) ((void)(filter), true)
#define SET_PLANE(tried)                                                          \
	do {                                                                      \
		static const struct incise_surface plane = {                      \
			.kind = INCISE_SURFACE_PLANE, .plane = {{0}, {0, 0, 1}}}; \
		static struct incise_double_average average;                      \
		static struct incise_proxy proxy;                                 \
                                                                                  \
		incise_proxy_init(&proxy, &plane, 0.2);                           \
		(tried)->plan.proxy = &proxy;                                     \
		(tried)->state.average = &average;                                \
	} while (0)
#include "stage_kind.h"
#undef FILTER_GOOD
#undef SET_PLANE
#include "../../../lib/number/no_kind.h"

#include "../../../lib/number/fixed_kind.h"
#define FILTER_GOOD incise_fixed_filter_good
#define SET_PLANE(tried)                                            \
	((tried)->plan.numbers.shape.normal[2] = INCISE_FIXED_UNIT, \
	 (tried)->plan.numbers.leave = 13107)
#include "stage_kind.h"
#undef FILTER_GOOD
#undef SET_PLANE
#include "../../../lib/number/no_kind.h"

#define KIND(kind, is_double, bit)                                                     \
	{                                                                              \
		&incise_##kind##_tried, sizeof(incise_##kind##_tried), is_double, bit, \
			incise_##kind##_set_filter, incise_##kind##_add_pose,          \
			incise_##kind##_show, incise_##kind##_filtered,                \
			incise_##kind##_turn_about, incise_##kind##_set_average,       \
			incise_##kind##_average, incise_##kind##_touch,                \
			incise_##kind##_set_start, incise_##kind##_start,              \
			incise_##kind##_set_limit, incise_##kind##_limit,              \
			incise_##kind##_number                                         \
	}
static const struct kind kinds[] = {KIND(double, true, 0), KIND(fixed, false, 0x1p-16)};
static const struct kind *kind;

#endif
