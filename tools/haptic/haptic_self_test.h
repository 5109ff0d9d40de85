/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a scene does on this machine before anything moves: a stroke into its tissue without
 * devices, which must push, stay within its limits, and let go when poses end.
 */
#ifndef INCISE_HAPTIC_SELF_TEST_H
#define INCISE_HAPTIC_SELF_TEST_H

#include <incise/rig.h>
#include <incise/scene.h>

struct self_test {
	double force_max_N;   /* largest */
	double silent_ms;     /* from the last pose to no force */
	double silent_max_ms; /* what the scene's limits say it may be */
	unsigned int contact; /* ticks in the tissue */
};

/*
 * @tracker: the rig's
 * Returns 0; -EPROTO (it does not do as it should: @err says what), or as
 * incise_plan_new_fed().
 */
int haptic_self_test(const struct incise_scene *scene, struct incise_tracker *tracker,
		     struct self_test *test, struct incise_error *err);

#endif
