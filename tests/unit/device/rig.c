// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * lib/device/rig.c: what is asked for is opened, on one clock and in one world.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <incise/rig.h>

#define ALL \
	(INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA | INCISE_RIG_STEPPER)

static void only_what_is_asked_for_is_open(void **state)
{
	for (unsigned int devices = 0; devices <= ALL; devices++) {
		struct incise_rig *rig = incise_rig_open("sim:", devices, NULL);

		assert_non_null(rig);
		assert_true(!!incise_rig_tracker(rig) ==
			    !!(devices & INCISE_RIG_TRACKER));
		assert_true(!!incise_rig_force(rig) == !!(devices & INCISE_RIG_FORCE));
		assert_true(!!incise_rig_camera(rig) == !!(devices & INCISE_RIG_CAMERA));
		assert_true(!!incise_rig_stepper(rig) ==
			    !!(devices & INCISE_RIG_STEPPER));
		assert_non_null(incise_rig_sim(rig));
		assert_true(incise_clock_is_real(incise_rig_clock(rig)));
		assert_string_equal(incise_rig_spec(rig), "sim:");
		incise_rig_close(rig);
	}
	incise_rig_close(NULL);
}

static void devices_share_one_world(void **state)
{
	struct incise_rig *rig = incise_rig_open("sim:clock=simulated", ALL, NULL);
	static struct incise_force_sample force[30000];
	struct incise_tracker_sample tracker[400];
	struct incise_camera_frame frame;

	incise_clock_wait_until(incise_rig_clock(rig), 1000000000LL + 2400000000LL);
	assert_int_equal(incise_force_read(incise_rig_force(rig), force, 30000), 24000);
	assert_int_equal(force[0].t_ns, 1000000000LL);
	/* 2.4 s of 120 Hz, the last one on its way. */
	assert_int_equal(incise_tracker_read(incise_rig_tracker(rig), tracker, 400), 288);
	assert_int_equal(incise_camera_read(incise_rig_camera(rig), &frame), 1);
	assert_int_equal(frame.seq, 120);
	assert_int_equal(incise_stepper_set(incise_rig_stepper(rig), 1), 0);
	incise_rig_close(rig);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(only_what_is_asked_for_is_open),
		cmocka_unit_test(devices_share_one_world),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
