// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/rig/rig.c: what is asked for is opened, on one clock and in one world. */
#include "../unit.h"
#include <incise/rig.h>
#include "../base/temp_file.h"

#define ALL \
	(INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA | INCISE_RIG_STEPPER)

TEST(only_what_is_asked_for_is_open)
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

TEST(devices_share_one_world)
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
	assert_int_equal(incise_camera_newest(incise_rig_camera(rig), &frame), 1);
	assert_int_equal(frame.seq, 120);
	assert_int_equal(incise_stepper_set(incise_rig_stepper(rig), 1), 0);
	incise_rig_close(rig);
}

/* The settings of vision of a rig; -1 in value[1] where it has none. */
static struct incise_vision_setup vision_of(const char *spec)
{
	struct incise_vision_setup setup = {.value = {-1, -1}};
	struct incise_rig *rig = incise_rig_open(spec, 0, NULL);
	int rc;

	assert_non_null(rig);
	rc = incise_rig_vision(rig, &setup);
	assert_int_equal(rc, setup.value[1] < 0 ? -ENOENT : 0);
	incise_rig_close(rig);
	return setup;
}

TEST(vision_is_that_of_rig_conf_or_of_the_virtual_camera)
{
	/* full_px: 47.5 mm over camera_mm_px, which is 0.11875 unless it is given */
	static const struct {
		const char *text; /* of a file, or the shorthand */
		int value;
		double full_px, depth_mm_px;
	} row[] = {
		{"sim:", 60, 400, 47.5 / 400},
		{"sim:camera_mm_px=0.2375", 60, 200, 0.2375},
		{"camera = \"sim:\"; sim = { camera_mm_px = 0.475; };", 60, 100, 0.475},
		{"camera = \"sim:\"; vision = { value = [0, 70]; };", 70, 0, 0},
		{"camera = \"v4l2:/dev/video0\"; vision = { full_px = 300; };", 60, 300,
		 0},
		{"vision = { value = [1, 2]; };", 2, 0, 0},
		{"camera = \"v4l2:/dev/video0\"; tracker = \"sim:\";", -1, 0, 0},
		{"", -1, 0, 0},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		bool shorthand = row[i].text[0] == 's';
		struct temp_file file = temp_file_new("rig.conf", row[i].text);
		struct incise_vision_setup setup =
			vision_of(shorthand ? row[i].text : file.path);

		assert_int_equal(setup.value[1], row[i].value);
		/* a rounding of the division */
		assert_true(fabs(setup.full_px - row[i].full_px) < 1e-9);
		assert_true(setup.depth_mm_px == row[i].depth_mm_px);
		temp_file_free(&file);
	}
}
