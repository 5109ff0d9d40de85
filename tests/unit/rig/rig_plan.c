// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/rig_plan.c: what rig.conf and the shorthand set, and the message for each that is wrong; types and
 * ranges of all keys are read by lib/base/settings.c, which ../base/settings.c holds.
 */
#include "../unit.h"
#include <locale.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "../../../lib/rig/rig_plan.h"
#include "../base/temp_file.h"

/* --- file --- */

#define ALL \
	(INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA | INCISE_RIG_STEPPER)

TEST(shorthand_sets_keys)
{
	struct incise_rig *rig = incise_rig_open(
		"sim:seed=7,cut_s=2.5,depth_mm=5,times=3,withdrawal=paper,clock=simulated",
		ALL, NULL);
	const struct incise_sim_config *config;
	double point[3], normal[3];

	assert_non_null(rig);
	config = incise_sim_config(incise_rig_sim(rig));
	assert_int_equal(config->seed, 7);
	assert_true(config->cut_s == 2.5 && config->depth_mm[0] == 5);
	assert_int_equal(config->n_depths, 1);
	assert_int_equal(config->times[0], 3);
	assert_int_equal(config->withdrawal, 1);
	/* Three cuts of 2.5 s, four pauses of 1 s. */
	assert_int_equal(incise_sim_duration(incise_rig_sim(rig)), 11500000000LL);
	assert_false(incise_clock_is_real(incise_rig_clock(rig)));
	assert_int_equal(incise_clock_now(incise_rig_clock(rig)), 1000000000);
	incise_rig_surface(rig, point, normal);
	assert_true(point[0] == 0 && point[1] == 0 && point[2] == 0);
	assert_true(normal[0] == 0 && normal[1] == 0 && normal[2] == 1);
	incise_rig_close(rig);
}

TEST(shorthand_ignores_the_locale)
{
	struct incise_rig *rig;

	if (!setlocale(LC_NUMERIC, "de_DE.UTF-8") &&
	    !setlocale(LC_NUMERIC, "fr_FR.UTF-8"))
		skip(); /* this machine has no locale with a decimal comma */
	rig = incise_rig_open("sim:cut_s=2.5", 0, NULL);
	setlocale(LC_NUMERIC, "C");
	assert_non_null(rig);
	assert_true(incise_sim_config(incise_rig_sim(rig))->cut_s == 2.5);
	incise_rig_close(rig);
}

TEST(shorthand_refuses)
{
	static const struct {
		const char *spec, *text;
	} row[] = {
		{"sim:sede=1", "sim:sede=1: sim.sede:"},
		{"sim:clok=simulated", "sim:clok=simulated: clok:"},
		{"sim:mause=1", "sim:mause=1: mause:"},
		{"sim:haste=x", "sim:haste=x: sim.haste:"},
		{"sim:seed", "sim:seed:"},
		{"sim:seed=", "sim:seed=:"},
		{"sim:=1", "sim:=1:"},
		{"sim:seed=1,", "sim::"},
		{"sim:seed=x", "sim:seed=x: sim.seed:"},
		{"sim:seed=1x", "sim:seed=1x: sim.seed:"},
		{"sim:clock=fast", "sim:clock=fast: rig.clock:"},
		{"sim:seed=1,tooth=1", "sim:tooth=1: sim.tooth:"},
		{"sim:withdrawal=1", "sim:withdrawal=1: sim.withdrawal:"},
		{"sim:tooth=nan", "sim:tooth=nan: sim.tooth:"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		assert_error(incise_rig_open(row[i].spec, ALL, &err), EINVAL, &err,
			     row[i].text);
	}
}

TEST(file_is_read)
{
	struct temp_file file = temp_file_new(
		"rig.conf",
		"clock = \"simulated\";\n"
		"tracker = \"sim:\"; force = \"sim:\"; camera = \"other:1\";\n"
		"surface = { point_mm = [1, 2, 3]; normal = [0, 0, 2]; };\n"
		"sim = { seed = 3; depth_mm = [4.0, 8.5]; times = [1, 2];\n"
		"        cut_s = 2; };\n");
	/* The camera's backend does not exist, but nobody asked for it. */
	struct incise_rig *rig =
		incise_rig_open(file.path, INCISE_RIG_TRACKER | INCISE_RIG_FORCE, NULL);
	const struct incise_sim_config *config;
	double point[3], normal[3];

	assert_non_null(rig);
	config = incise_sim_config(incise_rig_sim(rig));
	assert_int_equal(config->seed, 3);
	assert_int_equal(config->n_depths, 2);
	assert_true(config->depth_mm[0] == 4 && config->depth_mm[1] == 8.5);
	assert_true(config->times[0] == 1 && config->times[1] == 2);
	assert_true(config->tooth == 0.2); /* not named: its default */
	assert_false(incise_clock_is_real(incise_rig_clock(rig)));
	assert_non_null(incise_rig_tracker(rig));
	assert_null(incise_rig_camera(rig));
	incise_rig_surface(rig, point, normal);
	assert_true(point[0] == 1 && point[1] == 2 && point[2] == 3);
	assert_true(normal[0] == 0 && normal[1] == 0 && normal[2] == 1);
	assert_string_equal(incise_rig_spec(rig), file.path);
	incise_rig_close(rig);
	temp_file_free(&file);
}

TEST(empty_file_is_a_rig_without_devices)
{
	struct temp_file file = temp_file_new("rig.conf", "");
	struct incise_rig *rig = incise_rig_open(file.path, 0, NULL);

	assert_non_null(rig);
	assert_null(incise_rig_sim(rig));
	assert_true(incise_clock_is_real(incise_rig_clock(rig)));
	incise_rig_close(rig);
	temp_file_free(&file);
}

TEST(file_refuses)
{
	static const struct {
		const char *text;
		int code;
		const char *says[2]; /* the place and key, and the value */
	} row[] = {
		{"", ENODEV, {": tracker: missing"}},
		{"\ntracker = \"fastrak:usb\";", ENODEV, {":2: tracker:"}},
		{"tracker = \"sim\";", EINVAL, {":1: tracker:", "\"sim\""}},
		{"tracker = \"sim:seed=1\";", EINVAL, {":1: tracker:", "\"sim:seed=1\""}},
		{"tracker = 1;", EINVAL, {":1: tracker:", "1"}},
		{"tracer = \"sim:\";", EINVAL, {":1: tracer:"}},
		{"voltmeter = \"sim:\";", EINVAL, {":1: voltmeter:"}},
		{"sim = 1;", EINVAL, {":1: sim:"}},
		{"sim = {\n\nsede = 1; };", EINVAL, {":3: sim.sede:"}},
		{"sim = { depth_mm = [5]; };", EINVAL, {":1: sim.depth_mm:"}},
		{"sim = { depth_mm = [5, 6]; times = [1]; };",
		 EINVAL,
		 {":1: sim.depth_mm:"}},
		{"sim = { depth_mm = []; times = []; };", EINVAL, {":1: sim.depth_mm:"}},
		{"sim = { depth_mm = [1,1,1,1,1,1,1,1,1]; times = [1,1,1,1,1,1,1,1,1]; };",
		 EINVAL,
		 {":1: sim.depth_mm:"}},
		/* libconfig's own rule: an array is of one type. */
		{"sim = { depth_mm = [4, 8.5]; times = [1, 1]; };",
		 EINVAL,
		 {":1: mismatched element type"}},
		{"sim = { depth_mm = 5; times = 1; };", EINVAL, {":1: sim.depth_mm:"}},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("rig.conf", row[i].text);

		assert_error(incise_rig_open(file.path, INCISE_RIG_TRACKER, &err),
			     row[i].code, &err, file.path, row[i].says[0],
			     row[i].says[1]);
		/* Without a place for the message it fails all the same. */
		assert_null(incise_rig_open(file.path, INCISE_RIG_TRACKER, NULL));
		temp_file_free(&file);
	}
	assert_null(incise_rig_open("/nowhere/rig.conf", ALL, NULL));
	assert_int_equal(errno, ENOENT);
}

/* A real actuator: what it needs besides its string. */
TEST(real_steppers_are_refused_with_a_line)
{
#define ACTUATOR "actuator = { spring_N_mm = 2.0; travel_mm = 9.0; lead_mm = 2.0; };\n"
	static const struct {
		const char *text;
		int code;
		const char *says;
	} row[] = {
		{"stepper = \"kernel:/dev/incise-nowhere\";", EINVAL, ":1: stepper:"},
		{ACTUATOR "clock = \"simulated\"; stepper = \"kernel:/dev/x\";", EINVAL,
		 ":2: stepper:"},
		{ACTUATOR "stepper = \"canopen:can0\";", ENODEV, ":2: stepper:"},
		{ACTUATOR "stepper = \"../../x:\";", ENODEV, "\"../../x\""},
		/* Broken, it is refused where the virtual actuator stands, too. */
		{"actuator = { travel_mm = 9.0; };\nstepper = \"sim:\";", EINVAL,
		 ":1: actuator.spring_N_mm"},
		{"actuator = 3; stepper = \"sim:\";", EINVAL, ":1: actuator:"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("rig.conf", row[i].text);

		assert_error(incise_rig_open(file.path, INCISE_RIG_STEPPER, &err),
			     row[i].code, &err, row[i].says);
		temp_file_free(&file);
	}
}

/* --- a haptic device --- */

TEST(a_haptic_device_is_tracker_and_stepper)
{
	const unsigned int both = INCISE_RIG_TRACKER | INCISE_RIG_STEPPER;
	struct temp_file file = temp_file_new(
		"rig.conf",
		"haptic = \"haply:\"; force = \"iio:a\";\n"
		"haptic_setup = { mass_kg = 0.2; turn = [0.6004, 0.0, 0.8, 0.0]; };");
	static const struct {
		const char *spec, *device;
		bool simulated;
	} alone[] = {
		{"haply:10.0.0.1:10001/049D", "haply:10.0.0.1:10001/049D", false},
		{"sim:haptic", "sim:", false},
		{"sim:haptic,clock=simulated,mass_kg=0.1", "sim:mass_kg=0.1", true},
	};
	struct incise_rig_plan plan;

	succeeds(!incise_rig_plan_read(&plan, file.path, both, &err));
	assert_string_equal(plan.haptic_device, "haply:");
	assert_false(plan.devices & both);
	assert_float_equal(plan.haptic.turn[0] * plan.haptic.turn[0] +
				   plan.haptic.turn[2] * plan.haptic.turn[2],
			   1, 1e-12);
	incise_rig_plan_free(&plan);
	/* A part of the rig that needs neither leaves it alone. */
	succeeds(!incise_rig_plan_read(&plan, file.path, INCISE_RIG_FORCE, &err));
	assert_null(plan.haptic_device);
	incise_rig_plan_free(&plan);
	temp_file_free(&file);
	for (size_t i = 0; i < sizeof(alone) / sizeof(*alone); i++) {
		succeeds(!incise_rig_plan_read(&plan, alone[i].spec, both, &err));
		assert_string_equal(plan.haptic_device, alone[i].device);
		assert_int_equal(plan.simulated, alone[i].simulated);
		incise_rig_plan_free(&plan);
	}
	assert_int_equal(incise_rig_plan_read(&plan, "haply:", INCISE_RIG_FORCE, &err),
			 -ENODEV);
	assert_non_null(strstr(err.text, "haply:: a haptic device alone has no force"));
	incise_rig_plan_free(&plan);
}

/* --- several actuators --- */

#define MOTOR "spring_N_mm = 2.0; travel_mm = 9.0; lead_mm = 2.0; "
#define TWO "stepper = [\"kernel:/dev/x:0\", \"kernel:/dev/x:1\"];"
#define THREE "stepper = [\"kernel:/dev/x:0\", \"kernel:/dev/x:1\", \"kernel:/dev/x:2\"];"

static int read_steppers(const char *text, struct incise_rig_plan *all,
			 struct incise_error *err)
{
	struct temp_file file = temp_file_new("rig.conf", text);
	int rc = incise_rig_plan_read(all, file.path, INCISE_RIG_STEPPER, err);

	incise_rig_plan_free(all);
	temp_file_free(&file);
	return rc;
}

TEST(each_stepper_has_its_group)
{
	struct incise_rig_plan all;

	if (read_steppers("surface = { normal = [0.0, 0.0, 2.0]; };" TWO
			  "actuator = ( {" MOTOR "late_ms = 2; }, {" MOTOR
			  "direction = [0.0, -3.0, 0.0]; rest_mm = 4.5; } );",
			  &all, &err))
		fail_msg("%s", err.text);
	assert_int_equal(all.n_axes, 2);
	/* By default out of the surface. */
	assert_true(all.direction[0][2] == 1 && all.direction[0][0] == 0);
	assert_true(all.direction[1][1] == -1);
	assert_true(all.actuator[0].rest_mm == 0 && all.actuator[1].rest_mm == 4.5);
	assert_true(all.actuator[0].late_s == 2e-3 && all.actuator[1].late_s == 0);
	/* One as ever, alone or in a list. */
	for (int i = 0; i < 2; i++) {
		assert_int_equal(
			read_steppers(i ? "stepper = \"kernel:/dev/x\"; actuator = "
					  "{" MOTOR "};"
					: "stepper = [\"kernel:/dev/x\"]; actuator "
					  "= ( {" MOTOR "} );",
				      &all, &err),
			0);
		assert_int_equal(all.n_axes, 1);
		assert_true(all.direction[0][2] == 1);
	}
	/* 30 degrees are enough. */
	assert_int_equal(read_steppers(TWO
				       "actuator = ( {" MOTOR "}, {" MOTOR
				       "direction = [0.5, 0.0, 0.8660254037844386]; } );",
				       &all, &err),
			 0);
}

TEST(the_virtual_rig_has_up_to_three)
{
	for (int n = 1; n <= 3; n++) {
		char spec[] = "sim:clock=simulated,axes=1";
		double direction[3] = {9, 9, 9};
		struct incise_rig *rig;

		spec[sizeof(spec) - 2] = (char)('0' + n);
		rig = incise_rig_open(spec, INCISE_RIG_STEPPER, NULL);
		assert_non_null(rig);
		for (int i = 0; i < n; i++) {
			assert_non_null(incise_rig_axis(rig, i, direction));
			/* Normal, across the blade, along the cut. */
			for (int k = 0; k < 3; k++)
				assert_true(direction[k] == (k == 2 - i));
		}
		assert_ptr_equal(incise_rig_axis(rig, 0, NULL), incise_rig_stepper(rig));
		direction[0] = 7;
		assert_null(incise_rig_axis(rig, n, direction));
		assert_null(incise_rig_axis(rig, -1, NULL));
		assert_true(direction[0] == 7);
		incise_rig_close(rig);
	}
}

TEST(several_steppers_are_refused_with_a_line)
{
	static const struct {
		const char *text, *says;
	} row[] = {
		{TWO "\nactuator = {" MOTOR "};", "found 2 and 1 groups"},
		{"stepper = \"kernel:/dev/x\";\nactuator = ( {" MOTOR "}, {" MOTOR "} );",
		 ":1: stepper:"},
		{"actuator = ();", ":1: actuator:"},
		{"actuator = ( {" MOTOR "}, {" MOTOR "}, {" MOTOR "}, {" MOTOR "} );",
		 "found a list of 4"},
		{"actuator = ( 3 );", ":1: actuator[1]:"},
		{"stepper = [\"sim:\", \"sim:\"];", ":1: stepper 1:"},
		{"stepper = [];", "found 0 and 0 groups"},
		{"stepper = [\"kernel:x\", \"kernel\"]; actuator = ( {" MOTOR "}, {" MOTOR
		 "} );",
		 ":1: stepper 2:"},
		/* Directions. */
		{TWO "actuator = ( {" MOTOR "}, {" MOTOR "} );",
		 ":1: the directions of actuators 1 and 2 are within 0 degrees"},
		{TWO "actuator = ( {" MOTOR "}, {" MOTOR
		     "direction = [0.0, 0.1, -1.0]; } );",
		 "actuators 1 and 2 are within 5.71 degrees"},
		{TWO "actuator = ( {" MOTOR "}, {" MOTOR
		     "direction = [0.499, 0.0, 0.8666]; } );",
		 "within 29.9 degrees"},
		{THREE "actuator = ( {" MOTOR "}, {" MOTOR
		       "direction = [0.0, 1.0, 0.0]; }, {" MOTOR
		       "direction = [0.0, 1.0, 0.4]; } );",
		 "actuators 2 and 3 are within 21.8 degrees"},
		{THREE "actuator = ( {" MOTOR "}, {" MOTOR
		       "direction = [0.0, 1.0, 0.0]; }, {" MOTOR
		       "direction = [0.0, 1.0, 1.0]; } );",
		 "of actuator 1 is within 0 degrees of the plane"},
		{THREE "actuator = ( {" MOTOR "}, {" MOTOR
		       "direction = [0.0, 1.0, 0.0]; }, {" MOTOR
		       "direction = [0.5, 1.0, 1.0]; } );",
		 "of the plane"},
		{"actuator = {" MOTOR "direction = [0.0, 0.0, 0.0]; };",
		 ":1: actuator.direction:"},
		{"actuator = {" MOTOR "rest_mm = 9.5; };", ":1: actuator.rest_mm:"},
		{"stepper = \"sim:\"; sim = { axes = 4; };", ":1: sim.axes:"},
		{"stepper = \"sim:\"; sim = { axes = 2; }; surface = { normal = [0.0, 1.0, "
		 "0.0]; };",
		 ":1: the directions of actuators 1 and 2 are within 0 degrees"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct incise_rig_plan all;

		assert_error(read_steppers(row[i].text, &all, &err), EINVAL, &err,
			     row[i].says);
	}
}

/* Its text is checked whole, whatever is opened of it. */
TEST(the_example_is_a_good_one)
{
	struct incise_rig *rig;

	if (access("doc/rig.conf.example", R_OK))
		skip();
	rig = incise_rig_open("doc/rig.conf.example", 0, &err);
	succeeds(rig);
	incise_rig_close(rig);
}

/* --- group --- */

static int read_all(const char *text, struct incise_rig_plan *all,
		    struct incise_error *err)
{
	struct temp_file file = temp_file_new("rig.conf", text);
	int rc = incise_rig_plan_read(all, file.path, 0, err);

	incise_rig_plan_free(all);
	temp_file_free(&file);
	return rc;
}

TEST(without_groups_all_is_by_default)
{
	struct incise_rig_plan all;

	assert_int_equal(read_all("", &all, &err), 0);
	assert_int_equal(all.tracker.n_stations, 1);
	assert_int_equal(all.tracker.stations[0], 1);
	assert_int_equal(all.tracker.tube_station, 0);
	assert_false(all.has_foot_switch);
	assert_true(all.tracker.hemisphere[0] == 1 && all.tracker.offset_mm[2] == 0);
	assert_true(all.tracker.repeat_ms == 100);
	assert_int_equal(all.tracker.sync, INCISE_TRACKER_INTERNAL);
	assert_true(all.force.rate_hz == 10000 && all.force.full_scale_V == 0);
	assert_string_equal(all.force.trigger, "");
	assert_int_equal(all.camera.pixels, INCISE_PIXELS_YUYV);
	assert_int_equal(all.camera.width, 0);
	assert_false(all.has_vision);
}

TEST(an_empty_vision_is_of_a_black_handle)
{
	struct incise_rig_plan all;

	assert_int_equal(read_all("vision = {};", &all, &err), 0);
	assert_true(all.has_vision);
	assert_true(all.vision.hue[0] == 0 && all.vision.hue[1] == 179);
	assert_true(all.vision.saturation[0] == 0 && all.vision.saturation[1] == 255);
	assert_true(all.vision.value[0] == 0 && all.vision.value[1] == 60);
	assert_true(all.vision.full_px == 0 && all.vision.depth_mm_px == 0);
	assert_int_equal(all.vision.roi.width, 0);
}

TEST(all_keys_are_read)
{
	struct incise_rig_plan all;

	if (read_all(
		    "tracker_setup = { stations = [2, 4]; tube_station = 4; hemisphere = [0.0, 0.0, -2.0];"
		    " sync = \"external\"; offset_mm = [1.0, 2.0, 3.5]; repeat_ms = 0; };"
		    "force_setup = { rate_hz = 5000; channel = 3; full_scale_V = 5.0;"
		    " trigger = \"my trigger\"; reference = \"differential\"; };"
		    "camera_setup = { width = 640; height = 480; rate_hz = 59.94;"
		    " format = \"grey\"; exposure_ms = 4.5; gain = 10;"
		    " white_balance_K = 5000; focus = 7; age_ms = 950; };"
		    "vision = { hue = [170, 10]; saturation = [80, 255]; value = [9, 9];"
		    " full_px = 400.5; roi = [8192, 0, 16, 8192]; };"
		    "foot_switch = { device = \"/dev/input/by-id/x-event-kbd\"; key = \"f2\"; };",
		    &all, &err))
		fail_msg("%s", err.text);
	assert_int_equal(all.tracker.n_stations, 2);
	assert_int_equal(all.tracker.stations[1], 4);
	assert_int_equal(all.tracker.tube_station, 4);
	assert_true(all.tracker.hemisphere[2] == -1 && all.tracker.offset_mm[2] == 3.5);
	assert_int_equal(all.tracker.sync, INCISE_TRACKER_EXTERNAL);
	assert_true(all.tracker.repeat_ms == 0);
	assert_true(all.force.rate_hz == 5000 && all.force.channel == 3 &&
		    all.force.full_scale_V == 5);
	assert_string_equal(all.force.trigger, "my trigger");
	assert_string_equal(all.force.channel_name, "");
	assert_int_equal(all.force.reference, INCISE_FORCE_DIFFERENTIAL);
	assert_true(all.camera.width == 640 && all.camera.height == 480 &&
		    all.camera.rate_hz == 59.94 && all.camera.exposure_ms == 4.5 &&
		    all.camera.gain == 10 && all.camera.white_balance_K == 5000 &&
		    all.camera.focus == 7 && all.camera.age_ms == 950);
	assert_int_equal(all.camera.pixels, INCISE_PIXELS_GREY);
	assert_true(all.has_vision);
	assert_true(all.vision.hue[0] == 170 && all.vision.hue[1] == 10);
	assert_true(all.vision.saturation[0] == 80 && all.vision.saturation[1] == 255);
	assert_true(all.vision.value[0] == 9 && all.vision.value[1] == 9);
	assert_true(all.vision.full_px == 400.5 && all.vision.depth_mm_px == 0);
	assert_true(all.has_foot_switch);
	assert_string_equal(all.foot_switch.device, "/dev/input/by-id/x-event-kbd");
	assert_int_equal(all.foot_switch.key, 60); /* KEY_F2 */
	assert_true(all.vision.roi.x == 8192 && all.vision.roi.y == 0 &&
		    all.vision.roi.width == 16 && all.vision.roi.height == 8192);
	assert_int_equal(read_all("force_setup = { channel = \"voltage0-voltage1\"; };",
				  &all, &err),
			 0);
	assert_string_equal(all.force.channel_name, "voltage0-voltage1");
	assert_int_equal(all.force.reference, INCISE_FORCE_ANY);
}

TEST(what_is_wrong_is_said)
{
	static const struct {
		const char *text, *says;
	} cases[] = {
		{"tracker_setup = 3;", "rig.conf:1: tracker_setup:"},
		{"tracker_setup = { stations = [2, 1]; };", "tracker_setup.stations"},
		{"tracker_setup = { stations = [1, 1]; };", "tracker_setup.stations"},
		{"tracker_setup = { stations = [1, 2, 3, 4, 4]; };",
		 "tracker_setup.stations"},
		{"tracker_setup = { tube_station = 1; };", "tracker_setup.tube_station"},
		{"tracker_setup = { stations = [2, 3]; tube_station = 2; };", "found 2"},
		{"tracker_setup = { stations = [1, 2]; tube_station = 3; };",
		 "rig.conf:1: tracker_setup.tube_station:"},
		{"tracker_setup = { stations = [1, 2]; tube_station = 0; };",
		 "tube_station"},
		{"tracker_setup = { stations = [1, 2]; tube_station = 258; };",
		 "tube_station"},
		{"\nforce_setup = { rate_hz = 0.5; };", "rig.conf:2: "},
		{"force_setup = { channel = -1; };", "channel"},
		{"force_setup = { channel = 1.5; };", "force_setup.channel"},
		{"force_setup = { channel = \"\"; };", "\"voltage0-voltage1\""},
		{"force_setup = { channel = \"../voltage0\"; };", "force_setup.channel"},
		{"force_setup = { channel = [0]; };", "force_setup.channel"},
		{"force_setup = { reference = \"earth\"; };", "one of any, ground"},
		{"force_setup = { trigger = \"../../etc\"; };", "force_setup.trigger"},
		{"force_setup = { trigger = \"0123456789012345678901234567890123456789"
		 "012345678901234567890123\"; };",
		 "force_setup.trigger"},
		{"camera_setup = { format = \"h264\"; };", "camera_setup.format"},
		{"sign_key = 1;", "sign_key:"},
		{"sign_key = \"rig_ed25519\";", "rig.conf:1: sign_key:"},
		{"foot_switch = { };", "rig.conf:1: foot_switch.device:"},
		{"foot_switch = { device = \"event0\"; key = \"b\"; };",
		 "foot_switch.device:"},
		{"foot_switch = { device = \"/dev/input/event0\"; };",
		 "rig.conf:1: foot_switch.key:"},
		{"foot_switch = { device = \"/dev/input/event0\"; key = \"pedal\"; };",
		 "foot_switch.key:"},
		{"foot_switch = { device = \"/dev/input/event0\"; key = 48; };",
		 "foot_switch.key"},
		{"foot_switch = { device = \"/dev/x\"; key = \"b\"; grab = true; };",
		 "grab"},
		{"vision = { saturation = [9, 8]; };", "vision.saturation:"},
		{"vision = { value = [1, 0]; };", "vision.value:"},
		{"vision = { roi = [0, 0, 15, 480]; };", "vision.roi"},
		{"haptic = \"haply\";", "rig.conf:1: haptic:"},
		{"haptic = \"haply:\"; tracker = \"sim:\";", "no tracker and no stepper"},
		{"haptic_setup = { turn = [1.0, 1.0, 0.0, 0.0]; };", "haptic_setup.turn"},
		{"haptic_setup = { low_mm = [1, 0, 0]; };", "haptic_setup.high_mm"},
		{"haptic_setup = { motor_mm_turn = [1]; };",
		 "haptic_setup.motor_direction"},
		{"haptic_setup = { clutch = 33; };", "haptic_setup.clutch"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig_plan all;

		assert_error(read_all(cases[i].text, &all, &err), EINVAL, &err,
			     cases[i].says);
	}
}
