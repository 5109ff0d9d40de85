// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/rig_keys.c: the list of a rig's keys, written as a rig.conf, makes the same rig
 * again, and has every key that a rig.conf may have.
 */
#include "../unit.h"
#include <locale.h>
#include <incise/rig.h>
#include "../../../lib/rig/actuator.h"
#include "../../../lib/rig/rig_plan.h"
#include "../../../lib/sim/sim.h"
#include "../base/temp_file.h"

/* Every key of rig.conf, in two actuators; the virtual rig is the force channel. */
static const char everything[] =
	"clock = \"real\"; tracker = \"usb:0f44:0002\"; force = \"sim:\";\n"
	"camera = \"v4l2:a\\\\b\\\"c\"; stepper = [\"kernel:/dev/a\", \"can:can0:0x10\"];\n"
	"surface = { point_mm = [1.5, 2.0, -3.0]; normal = [0, 0, 2]; };\n"
	"tracker_setup = { stations = [1, 3]; tube_station = 3; hemisphere = [0, 0, -1];\n"
	"	sync = \"video\"; offset_mm = [1, 2, 3]; repeat_ms = 50; };\n"
	"force_setup = { rate_hz = 12500.5; channel = \"voltage3\"; full_scale_V = 2.5;\n"
	"	trigger = \"incise\"; reference = \"common\"; };\n"
	"camera_setup = { width = 640; height = 480; rate_hz = 60; format = \"mjpeg\";\n"
	"	exposure_ms = 4; gain = 2; white_balance_K = 4600; focus = 30; age_ms = 900; };\n"
	"vision = { hue = [170, 10]; saturation = [1, 2]; value = [3, 4]; full_px = 400.25;\n"
	"	roi = [200, 0, 240, 480]; };\n"
	"sign_key = \"/etc/incise/rig_ed25519\"; "
	"foot_switch = { device = \"/dev/input/event0\"; key = \"b\"; };\n"
	"sim = { seed = 7; withdrawal = \"paper\"; depth_mm = [5.0, 7.5]; times = [1, 2]; };\n"
	"actuator = ( { spring_N_mm = 2; travel_mm = 20; lead_mm = 4; steps_per_turn = 400;\n"
	"	microsteps = 8; velocity_mm_s = 9; acceleration_mm_s2 = 400; jerk_mm_s3 = 5e4;\n"
	"	deadman_ms = 12.3; retract = true; tick_us = 300; high_us = 2.5; low_us = 3;\n"
	"	setup_us = 6; hold_us = 7; enable_ms = 5; home_mm_s = 1; home_mm = -0.5;\n"
	"	origin_mm = 120; rest_mm = 1; late_ms = 2; direction = [0, 0, 1]; invert = true;\n"
	"	lines = { step = 17; dir = 27; enable = 0; limit_min = 5; limit_max = 6;\n"
	"		home = 13; estop = 19; alarm = 20; active_low = [\"enable\", \"estop\"]; };\n"
	"	can = { mode = \"csv\"; bitrate = 500000; cycle_us = 1500;\n"
	"		counts_per_turn = 1e5; velocity_per_turn_s = 60;\n"
	"		acceleration_per_turn_s2 = 61; following_mm = 1.5; following_ms = 51;\n"
	"		homing_method = -3; absolute = true; position_gain_1_s = 10;\n"
	"		stiffness_permille_mm = 5; damping_permille_s_mm = 6;\n"
	"		torque_max_permille = 700; master = 126; };\n"
	"	encoder = \"counter0/count0\"; encoder_counts_per_mm = -500; driver = \"tmc2209:/dev/serial0:1\"; tmc = { sense_ohm = 0.1; run_A = 0.8;\n"
	"		hold_A = 0.2; interpolate = false; stealthchop = false;\n"
	"		stealthchop_mm_s = 5; stall_mm_s = 0.5; stall_threshold = 60;\n"
	"		stall_home = true; answer_ms = 60; }; },\n"
	"	{ spring_N_mm = 1; travel_mm = 10; lead_mm = 2; direction = [0, 1, 0]; } );\n"
	"haptic_setup = { mass_kg = 0.1; damping_N_s_mm = 0.02; coulomb_N = 0.3; peak_N = 8;\n"
	"	continuous_N = 3; low_mm = [-60, -50, -40]; high_mm = [60, 50, 40]; rate_hz = 900;\n"
	"	latency_ms = 1.5; force_latency_ms = 0.5; turn = [0.6, 0.8, 0.0, 0.0];\n"
	"	origin_mm = [1, 2, 3]; clutch = 1; enable = 2; start_s = 2; lost_s = 4;\n"
	"	motor_direction = [1.0, 0.0, 0.0]; motor_mm_turn = [31.5];\n"
	"	motor_torque_N_mm = [200.5]; };\n";

struct keys {
	struct incise_key key[300];
	int n;
};

static int keep(void *context, const struct incise_key *key)
{
	struct keys *keys = context;

	keys->key[keys->n++] = *key;
	return keys->n == 300;
}

static struct keys keys_of(const char *spec)
{
	struct keys keys = {.n = 0};

	if (incise_rig_keys(spec, keep, &keys, &err))
		fail_msg("%s: %s", spec, err.text);
	return keys;
}

static const struct incise_key *find(const struct keys *keys, const char *name)
{
	for (int i = 0; i < keys->n; i++)
		if (!strcmp(keys->key[i].name, name))
			return &keys->key[i];
	return NULL;
}

/* --- the list as a rig.conf --- */

struct writer {
	char text[20000], open[4][40]; /* groups that are open */
	int depth;
};

static void put(struct writer *writer, const char *text)
{
	assert_true(strlen(writer->text) + strlen(text) < sizeof(writer->text));
	strcat(writer->text, text);
}

/* "name = {", "name = ( {", or of a later element "{". */
static void open_group(struct writer *writer, const char *name)
{
	char line[80];
	int i = strchr(name, '[') ? atoi(strchr(name, '[') + 1) : 0;

	if (i < 2) {
		snprintf(line, sizeof(line), "%.*s = %s", (int)strcspn(name, "["), name,
			 i ? "( " : "");
		put(writer, line);
	}
	put(writer, i > 1 ? ", {\n" : "{\n");
	strcpy(writer->open[writer->depth++], name);
}

/* @next: the name of the next group. */
static void close_group(struct writer *writer, const char *next)
{
	const char *name = writer->open[--writer->depth];
	size_t length = strcspn(name, "[");

	put(writer, "}");
	if (name[length] && (strncmp(name, next, length) || next[length] != '['))
		put(writer, " )");
	if (!name[length] || strncmp(name, next, length) || next[length] != '[')
		put(writer, ";\n");
}

static void write_key(struct writer *writer, const struct incise_key *key)
{
	char name[80], *part[5], *rest = name, line[500];
	int n = 0, same = 0, element;

	strcpy(name, key->name);
	while ((part[n] = strsep(&rest, ".")))
		n++;
	while (same < n - 1 && same < writer->depth &&
	       !strcmp(part[same], writer->open[same]))
		same++;
	while (writer->depth > same)
		close_group(writer, part[same]);
	for (; same < n - 1; same++)
		open_group(writer, part[same]);
	if (!*key->value)
		return;
	element = strchr(part[n - 1], '[') ? atoi(strchr(part[n - 1], '[') + 1) : 0;
	if (element == 1) /* "stepper[1]" of two */
		snprintf(line, sizeof(line), "stepper = [ %s", key->value);
	else if (element == 2)
		snprintf(line, sizeof(line), ", %s ];\n", key->value);
	else
		snprintf(line, sizeof(line), "%s = %s;\n", part[n - 1], key->value);
	put(writer, line);
}

static void same_again(const char *spec)
{
	struct keys keys = keys_of(spec), again;
	static struct writer writer;
	struct incise_rig_plan before, after;
	struct temp_file file;

	memset(&writer, 0, sizeof(writer));
	for (int i = 0; i < keys.n; i++)
		write_key(&writer, &keys.key[i]);
	while (writer.depth)
		close_group(&writer, "");
	file = temp_file_new("rig.conf", writer.text);
	again = keys_of(file.path);
	/* a rig with the keys of groups that do not apply has more of them than its shorthand */
	for (int i = 0; i < keys.n; i++) {
		const struct incise_key *key = find(&again, keys.key[i].name);

		assert_non_null(key);
		assert_string_equal(key->value, keys.key[i].value);
		assert_true(key->given == !!*key->value);
		assert_true(!!key->line == key->given);
	}
	/* words are of the file, and must be those of the plan */
	assert_int_equal(incise_rig_plan_read(&before, spec, 0, NULL), 0);
	assert_int_equal(incise_rig_plan_read(&after, file.path, 0, NULL), 0);
	assert_int_equal(before.tracker.sync, after.tracker.sync);
	if (find(&keys, "camera_setup.format"))
		assert_int_equal(before.camera.pixels, after.camera.pixels);
	assert_int_equal(before.foot_switch.key, after.foot_switch.key);
	for (int i = 0; i < before.n_actuators; i++)
		assert_int_equal(before.actuator[i].can.mode, after.actuator[i].can.mode);
	incise_rig_plan_free(&before);
	incise_rig_plan_free(&after);
	temp_file_free(&file);
}

TEST(the_list_is_a_rig_conf)
{
	static const char *const texts[] = {
		everything,
		"",
		"tracker = \"tty:/dev/a:115200\"; force = \"iio:a\"; camera = \"v4l2:a\";",
		"stepper = \"can:can0:1\"; actuator = { spring_N_mm = 2; travel_mm = 20; "
		"lead_mm = 4; };",
		"haptic = \"haply:\"; haptic_setup = { clutch = 1; };",
		"clock = \"simulated\"; camera = \"sim:\"; sim = { seed = 3; };",
	};

	for (size_t i = 0; i < sizeof(texts) / sizeof(*texts); i++) {
		struct temp_file file = temp_file_new("rig.conf", texts[i]);

		same_again(file.path);
		temp_file_free(&file);
	}
	same_again("sim:");
	same_again(
		"sim:mouse,seed=7,withdrawal=paper,depth_mm=2.5,times=3,clock=simulated");
}

/* Whether the list has GROUP or GROUP.KEY, and that a value. */
static void has(const struct keys *keys, const char *group, const char *name)
{
	char full[80];

	for (int i = 0; i < keys->n; i++) {
		snprintf(full, sizeof(full), "%s%s%s", group, *group ? "." : "", name);
		if (strncmp(keys->key[i].name, full, strlen(full)) ||
		    !strchr(".[", keys->key[i].name[strlen(full)]))
			continue;
		assert_true(keys->key[i].name[strlen(full)] || *keys->key[i].value);
		return;
	}
	fail_msg("%s.%s is not listed", group, name);
}

static void has_all(const struct keys *keys, const struct incise_setting *rows,
		    const char *group)
{
	for (; rows->key; rows++) {
		/* In place of a tracker and a stepper. */
		if (!strcmp(rows->key, "haptic"))
			continue;
		has(keys, group, rows->key);
		if (rows->kind == SETTING_IS_GROUP && !*group)
			has_all(keys, rows->rows, rows->key);
	}
}

TEST(every_key_is_listed)
{
	struct temp_file file = temp_file_new("rig.conf", everything);
	struct keys keys = keys_of(file.path);

	has_all(&keys, incise_rig_settings, "");
	has_all(&keys, incise_sim_settings, "sim");
	has_all(&keys, incise_actuator_settings, "actuator[1]");
	has_all(&keys, incise_actuator_can_settings, "actuator[1].can");
	has_all(&keys, incise_actuator_line_settings, "actuator[1].lines");
	has_all(&keys, incise_actuator_tmc_settings, "actuator[1].tmc");
	/* no key is given without its value */
	for (int i = 0; i < keys.n; i++)
		assert_true(!keys.key[i].given || *keys.key[i].value);
	temp_file_free(&file);
}

TEST(values_are_those_of_the_file)
{
	static const struct {
		const char *name, *value;
		int line; /* 0: the default */
	} row[] = {
		{"clock", "\"real\"", 1},
		{"camera", "\"v4l2:a\\\\b\\\"c\"", 2},
		{"stepper[2]", "\"can:can0:0x10\"", 2},
		{"surface.point_mm", "[1.5, 2.0, -3.0]", 3},
		{"surface.normal", "[0, 0, 1]", 3}, /* of length 1 */
		{"tracker_setup.stations", "[1, 3]", 4},
		{"force_setup.rate_hz", "12500.5", 6},
		{"force_setup.channel", "\"voltage3\"", 6},
		{"force_setup.reference", "\"common\"", 7},
		{"vision.roi", "[200, 0, 240, 480]", 11},
		{"foot_switch.key", "\"b\"", 12},
		{"sign_key", "\"/etc/incise/rig_ed25519\"", 12},
		{"sim.withdrawal", "\"paper\"", 13},
		{"sim.depth_mm", "[5.0, 7.5]", 13},
		{"sim.force_mV_N", "1240", 0},
		{"actuator[1].deadman_ms", "12.3", 16},
		{"actuator[1].high_us", "2.5", 16},
		{"actuator[1].lines.enable", "0", 19},
		{"actuator[1].lines.active_low", "[\"enable\", \"estop\"]", 20},
		{"actuator[1].can.cycle_us", "1500", 21},
		{"actuator[2].lead_mm", "2", 31},
		{"actuator[2].high_us", "", 0},
		{"actuator[2].can.following_mm", "1", 0},
		{"actuator[2].direction", "[0, 1, 0]", 31},
	};
	struct temp_file file = temp_file_new("rig.conf", everything);
	struct keys keys;

	/* a decimal comma is no libconfig's; without this locale the test is of "C" */
	setlocale(LC_NUMERIC, "de_DE.UTF-8");
	keys = keys_of(file.path);
	setlocale(LC_NUMERIC, "C");
	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		const struct incise_key *key = find(&keys, row[i].name);

		assert_non_null(key);
		assert_string_equal(key->value, row[i].value);
		assert_int_equal(key->line, row[i].line);
		assert_true(key->given == (row[i].line > 0));
	}
	temp_file_free(&file);
}

TEST(the_shorthand_gives_its_words)
{
	struct keys keys = keys_of("sim:mouse,seed=1,clock=simulated");

	assert_true(find(&keys, "sim.motion")->given);
	assert_string_equal(find(&keys, "sim.motion")->value, "3");
	assert_true(find(&keys, "sim.seed")->given);
	assert_true(find(&keys, "clock")->given);
	assert_true(find(&keys, "tracker")->given);
	assert_false(find(&keys, "sim.cut_s")->given);
	assert_false(find(&keys, "vision.hue")->given);
	for (int i = 0; i < keys.n; i++)
		assert_int_equal(keys.key[i].line, 0);
}

static int stop_at_third(void *context, const struct incise_key *key)
{
	return ++*(int *)context == 3 ? 42 : 0;
}

TEST(errors_and_stops)
{
	struct temp_file file = temp_file_new("rig.conf", "\nclokc = \"real\";\n");
	int calls = 0;

	assert_error(incise_rig_keys(file.path, stop_at_third, &calls, &err), EINVAL,
		     &err, "rig.conf:2: clokc:");
	assert_int_equal(incise_rig_keys("/none/rig.conf", stop_at_third, &calls, &err),
			 -ENOENT);
	assert_int_equal(incise_rig_keys("sim:sede=1", stop_at_third, &calls, &err),
			 -EINVAL);
	assert_int_equal(calls, 0);
	assert_int_equal(incise_rig_keys("sim:", stop_at_third, &calls, &err), 42);
	assert_int_equal(calls, 3);
	temp_file_free(&file);
}
