// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading rig.conf or the shorthand of a virtual rig; see incise/rig.h and rig.conf(5).
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/rig.h>
#include "../sim/sim.h"
#include "../sim/surgeon.h"
#include "../base/vector.h"
#include "actuator.h"
#include "axes.h"
#include "rig_plan.h"

/* --- the keys ------------------------------------------------------------------------------ */

#define SETTINGS_OF struct incise_rig_plan

static bool is_ascending(const double *number, int n, const char *text)
{
	(void)text;
	for (int i = 1; i < n; i++)
		if (number[i] <= number[i - 1])
			return false;
	return true;
}

static bool is_range(const double *number, int n, const char *text)
{
	(void)n;
	(void)text;
	return number[0] <= number[1];
}

/* A smaller box shows no handle. */
static bool is_box(const double *number, int n, const char *text)
{
	(void)n;
	(void)text;
	return number[2] >= 16 && number[3] >= 16;
}

static bool has_no_slash(const double *number, int n, const char *text)
{
	(void)number;
	(void)n;
	return !strchr(text, '/');
}

/* capture may run in any folder. */
static bool is_path(const double *number, int n, const char *text)
{
	(void)number;
	(void)n;
	return *text == '/';
}

static int read_foot_key(void *to, const config_setting_t *setting, const char *path,
			 struct incise_error *err)
{
	const char *name = config_setting_get_string(setting);
	int code = name ? incise_foot_switch_key(name) : -EINVAL;

	if (code < 0)
		return incise_conf_error(
			setting, NULL, path, err,
			"the name of a key, such as \"b\", of those that "
			"rig.conf(5) lists");
	((struct incise_rig_plan *)to)->foot_switch.key = (uint16_t)code;
	return 0;
}

/* A number is the usual form. */
static int read_channel(void *to, const config_setting_t *setting, const char *path,
			struct incise_error *err)
{
	struct incise_force_setup *force = &((struct incise_rig_plan *)to)->force;
	const char *name = config_setting_get_string(setting);
	size_t size = sizeof(force->channel_name);

	if (!name || !*name || strlen(name) >= size || !has_no_slash(NULL, 0, name))
		return incise_conf_error(
			setting, NULL, path, err,
			"a whole number from 0 to 255, or for IIO the name of a channel, "
			"such as \"voltage0-voltage1\"");
	snprintf(force->channel_name, size, "%s", name);
	return 0;
}

static int read_actuators(void *to, const config_setting_t *all, const char *path,
			  struct incise_error *err);
static int read_sim(void *to, const config_setting_t *group, const char *path,
		    struct incise_error *err);

static const char *const clocks[] = {"real", "simulated", NULL};
static const char *const references[] = {"any", "ground", "common", "differential", NULL};
static const char *const syncs[] = {"internal", "external", "video", NULL};
static const char *const formats[] = {"rgb", "grey", "yuyv", "mjpeg", NULL};

static const struct incise_setting surface_settings[] = {
	SETTING_VECTOR(point_mm, point_mm, "mm", "[0, 0, 0]", "a point of the surface"),
	SETTING_DIRECTION(normal, normal, "[0, 0, 1]", "out of the tissue"),
	{0},
};

static const struct incise_setting tracker_settings[] = {
	SETTING_WHOLE(
		stations, tracker.stations, "", 1, 4, "[1]",
		"array of the sensors to read, ascending; the first is on the scalpel",
		.count = offsetof(struct incise_rig_plan, tracker.n_stations),
		.fits = is_ascending,
		.expected = "numbers of 1 to 4, ascending, such as [1]"),
	SETTING_WHOLE(
		tube_station, tracker.tube_station, "", 1, 4, "(none)",
		"sensor at the end of the tube; one of stations, but not the first"),
	SETTING_DIRECTION(hemisphere, tracker.hemisphere, "[1, 0, 0]",
			  "from the source to the half-space of the sensors"),
	SETTING_WORD(sync, tracker.sync, syncs, "internal",
		     "clock of the measurements, see below"),
	SETTING_VECTOR(offset_mm, tracker.offset_mm, "mm", "[0, 0, 0]",
		       "tracked point in the frame of the sensor"),
	SETTING_NUMBER(repeat_ms, tracker.repeat_ms, "ms", 0, 60000, "100",
		       "longest time without a change of the pose; 0: no limit"),
	{0},
};

static const struct incise_setting force_settings[] = {
	SETTING_NUMBER(rate_hz, force.rate_hz, "Hz", 1, 100000, "10000",
		       "samples per second"),
	SETTING_WHOLE(channel, force.channel, "", 0, 255, "0",
		      "channel of the device; IIO: or its name in quotes",
		      .read = read_channel),
	SETTING_WORD(reference, force.reference, references, "any",
		     "comedi: what the input is compared with: ground, common, "
		     "differential, or any, the first of these that the card has"),
	SETTING_NUMBER(full_scale_V, force.full_scale_V, "V", 1e-6, 1000,
		       "(by the device)", "input range"),
	SETTING_TEXT(trigger, force.trigger, "(see below)",
		     "IIO: name of the trigger, at most 63 letters, without a slash",
		     .fits = has_no_slash,
		     .expected = "the name of a trigger of at most 63 letters, without a "
				 "slash"),
	{0},
};

static const struct incise_setting camera_settings[] = {
	SETTING_WHOLE(width, camera.width, "px", 16, 16384, "(as set)",
		      "width of a frame"),
	SETTING_WHOLE(height, camera.height, "px", 16, 16384, "(as set)",
		      "height of a frame"),
	SETTING_NUMBER(rate_hz, camera.rate_hz, "Hz", 0.1, 1000, "(as set)",
		       "frames per second"),
	SETTING_WORD(format, camera.pixels, formats, "yuyv", "yuyv, grey, rgb or mjpeg"),
	SETTING_NUMBER(exposure_ms, camera.exposure_ms, "ms", 0.001, 1000, "(as set)",
		       "exposure time"),
	SETTING_NUMBER(gain, camera.gain, "", 1, 1e6, "(as set)",
		       "gain, in units of the driver"),
	SETTING_NUMBER(white_balance_K, camera.white_balance_K, "K", 1000, 20000,
		       "(as set)", "colour temperature"),
	SETTING_NUMBER(focus, camera.focus, "", 1, 1e6, "(as set)",
		       "focus, in units of the driver"),
	SETTING_NUMBER(age_ms, camera.age_ms, "ms", 1, 60000, "(see below)",
		       "largest age of a timestamp when its frame arrives"),
	{0},
};

static const struct incise_setting vision_settings[] = {
	SETTING_WHOLE(hue, vision.hue, "", 0, 179, "[0, 179]",
		      "[low, high], in degrees / 2; if low > high, the range includes 0 "
		      "(red)"),
	SETTING_WHOLE(saturation, vision.saturation, "", 0, 255, "[0, 255]",
		      "[low, high]", .fits = is_range,
		      .expected = "whole numbers [low, high] from 0 to 255"),
	SETTING_WHOLE(value, vision.value, "", 0, 255, "[0, 60]",
		      "[low, high]; the default is a black handle", .fits = is_range,
		      .expected = "whole numbers [low, high] from 0 to 255"),
	SETTING_NUMBER(
		full_px, vision.full_px, "px", 16, 8192, "(none)",
		"exposed length at depth 0, from the upper end of the black to the "
		"tissue"),
	SETTING_WHOLE(
		roi, vision.roi, "px", 0, 8192, "(whole frame)",
		"first search region [x, y, width, height]; width and height from 16",
		.fits = is_box,
		.expected = "whole numbers [x, y, width, height] from 0 to 8192, "
			    "width and height from 16"),
	{0},
};

#define OF_DEVICE "(by the device)"

static const struct incise_setting haptic_settings[] = {
	SETTING_NUMBER(mass_kg, haptic.mass_kg, "kg", 0.001, 100, OF_DEVICE,
		       "mass that the hand feels"),
	SETTING_NUMBER(damping_N_s_mm, haptic.damping_N_s_mm, "N s/mm", 1e-6, 10,
		       OF_DEVICE, "damping of the device"),
	SETTING_NUMBER(coulomb_N, haptic.coulomb_N, "N", 1e-6, 100, OF_DEVICE,
		       "Coulomb friction of the device"),
	SETTING_NUMBER(peak_N, haptic.peak_N, "N", 0.01, 1000, OF_DEVICE,
		       "largest force"),
	SETTING_NUMBER(continuous_N, haptic.continuous_N, "N", 0.01, 1000, OF_DEVICE,
		       "force that the device stands for ever"),
	SETTING_VECTOR(low_mm, haptic.low_mm, "mm", OF_DEVICE,
		       "least corner of the workspace, in the frame of the device"),
	SETTING_VECTOR(high_mm, haptic.high_mm, "mm", OF_DEVICE, "its other corner"),
	SETTING_NUMBER(rate_hz, haptic.rate_hz, "Hz", 1, 20000, OF_DEVICE,
		       "poses per second"),
	SETTING_NUMBER(latency_ms, haptic.latency_ms, "ms", 0.001, 1000, OF_DEVICE,
		       "from the acquisition of a pose to its arrival"),
	SETTING_NUMBER(force_latency_ms, haptic.force_latency_ms, "ms", 0.001, 1000,
		       OF_DEVICE, "from a new force to its action"),
	SETTING_NUMBER(turn, haptic.turn, "", -1, 1, "[1, 0, 0, 0]",
		       "rotation from the frame of the device to that of the scene, as a "
		       "unit quaternion, w first; `incise calibrate frame` finds it"),
	SETTING_VECTOR(origin_mm, haptic.origin_mm, "mm", "[0, 0, 0]",
		       "place of the device's origin in the scene"),
	SETTING_WHOLE(
		clutch, haptic.clutch, "", 0, 32, "0",
		"button, from 1 on, that uncouples the tool while it is pressed; 0: "
		"none"),
	SETTING_WHOLE(enable, haptic.enable, "", 0, 32, "0",
		      "button, from 1 on, that must be pressed for a force; 0: none"),
	SETTING_NUMBER(start_s, haptic.start_s, "s", 0.1, 60, "1",
		       "time from no force to all of it, at each start"),
	SETTING_NUMBER(lost_s, haptic.lost_s, "s", 0, 3600, "5",
		       "the device's owner ends so long after its last user"),
	SETTING_NUMBER(motor_direction, haptic.motor_direction, "", -1, 1, "(none)",
		       "moteus: for each motor, the direction of the handle as it turns "
		       "positively: three numbers each",
		       .count = offsetof(struct incise_rig_plan,
					 haptic.n_motor_directions)),
	SETTING_NUMBER(
		motor_mm_turn, haptic.motor_mm_turn, "mm", 0.01, 10000, "(none)",
		"moteus: travel of the handle per turn of each motor: the lead of a "
		"screw, or 2π times the radius of a drum",
		.count = offsetof(struct incise_rig_plan, haptic.n_motors)),
	SETTING_NUMBER(motor_torque_N_mm, haptic.motor_torque_N_mm, "N mm", 0.01, 1e6,
		       "(none)", "moteus: largest torque of each motor",
		       .count = offsetof(struct incise_rig_plan, haptic.n_motor_torques)),
	{0},
};

/* Both must be there: no device is meant by default. */
static const struct incise_setting foot_switch_settings[] = {
	SETTING_TEXT(device, foot_switch.device, SETTING_REQUIRED,
		     "path of the event device; paths in /dev/input/by-id and "
		     "/dev/input/by-path are stable",
		     .fits = is_path,
		     .expected = "the path of an input device, such as "
				 "\"/dev/input/by-id/…-event-kbd\""),
	SETTING_OWN(key, "", SETTING_REQUIRED,
		    "the key that it sends: a letter, a digit, f1 to f12, space, enter, "
		    "tab, esc, left, right, up, down, pageup, pagedown, home, end, "
		    "btn_left, btn_right or btn_middle",
		    .read = read_foot_key),
	{0},
};

const struct incise_setting incise_rig_settings[] = {
	SETTING_WORD(
		clock, simulated, clocks, "real",
		"real: the computer's clock; simulated: time that runs as fast as the "
		"program, from 1 s on, so a loop of 10 s ends at once"),
	SETTING_OWN(tracker, "", "(none)", "tracker, as BACKEND:ARGUMENTS"),
	SETTING_OWN(force, "", "(none)", "force channel, as BACKEND:ARGUMENTS"),
	SETTING_OWN(camera, "", "(none)", "camera, as BACKEND:ARGUMENTS"),
	SETTING_OWN(stepper, "", "(none)",
		    "actuator, as BACKEND:ARGUMENTS, or an array of two or three"),
	SETTING_OWN(
		haptic, "", "(none)",
		"haptic device, as BACKEND:ARGUMENTS, in place of tracker and stepper"),
	SETTING_GROUP(surface, surface_settings, "plane of the tissue surface"),
	SETTING_OWN(actuator, "group", "(none)",
		    "mechanics of a real actuator, or a list of two or three groups",
		    .read = read_actuators),
	SETTING_GROUP(tracker_setup, tracker_settings, "settings of a real tracker"),
	SETTING_GROUP(haptic_setup, haptic_settings, "settings of a haptic device"),
	SETTING_GROUP(force_setup, force_settings, "settings of a real force channel"),
	SETTING_GROUP(camera_setup, camera_settings, "settings of a real camera"),
	SETTING_GROUP(vision, vision_settings, "look of the scalpel in camera frames"),
	SETTING_GROUP(foot_switch, foot_switch_settings,
		      "a foot switch for the haptic loop"),
	SETTING_TEXT(
		sign_key, sign_key, "(none)",
		"path of the private key of SSH that signs each recording of this rig",
		.fits = is_path,
		.expected = "the path of a private key of SSH, such as "
			    "\"/etc/incise/rig_ed25519\""),
	SETTING_OWN(sim, "group", "(none)", "settings of the simulated rig",
		    .read = read_sim),
	{0},
};

/* tube_station = 2: of the stations, but not the first, which is the scalpel's. */
static int check_tube_station(const struct incise_tracker_setup *tracker,
			      const config_setting_t *root, const char *path,
			      struct incise_error *err)
{
	bool good = !tracker->tube_station;

	for (int i = 1; i < tracker->n_stations; i++)
		good |= tracker->stations[i] == tracker->tube_station;
	return good ? 0
		    : incise_conf_error(
			      config_setting_get_member(root, "tracker_setup"),
			      "tube_station", path, err,
			      "one of tracker_setup.stations except the first, which is "
			      "the scalpel's");
}

#define SIM_BACKEND "sim"

const char *const incise_kind_name[N_KINDS] = {"tracker", "force", "camera", "stepper"};

/* --- devices, clock and the group sim --- */

/* A real device needs more than its string. */
static int plan_real(struct incise_rig_plan *plan, int slot, const char *path, int line,
		     const char *name, const char *device, size_t length,
		     struct incise_error *err)
{
	struct rig_real *real = &plan->real[slot];

	snprintf(real->where, sizeof(real->where), "%.200s:%d: %.20s", path, line, name);
	if (plan->simulated)
		return incise_error_set(err, EINVAL,
					"%s: only the simulated rig can follow a "
					"simulated clock; write clock = \"real\"",
					real->where);
	if (slot == KIND_STEPPER && !plan->n_actuators)
		return incise_error_set(
			err, EINVAL,
			"%s: \"%.40s\" needs the group actuator; add actuator = { "
			"spring_N_mm = …; travel_mm = …; lead_mm = …; };",
			real->where, device);
	real->name = strndup(device, length);
	real->arguments = strdup(device + length + 1);
	if (!real->name || !real->arguments)
		return incise_error_set(err, ENOMEM, "%s: %s", real->where,
					strerror(ENOMEM));
	return 0;
}

static bool is_virtual(const char *device)
{
	return !strcmp(device, SIM_BACKEND ":");
}

/*
 * A device's string. Only a device that will be opened must have a backend here: one
 * rig.conf may serve machines with different modules.
 */
static int plan_string(struct incise_rig_plan *plan, int slot, bool wanted, int line,
		       const char *name, const char *device, const char *path,
		       struct incise_error *err)
{
	size_t length = strcspn(device, ":");

	if (!device[length])
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: %s: expected BACKEND:ARGUMENTS such as "
			"\"" SIM_BACKEND ":\", found \"%.40s\"; correct it",
			path, line, name, device);
	if (length != strlen(SIM_BACKEND) || strncmp(device, SIM_BACKEND, length))
		return wanted ? plan_real(plan, slot, path, line, name, device, length,
					  err)
			      : 0;
	plan->sim = true;
	if (device[length + 1])
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: %s: expected \"" SIM_BACKEND
			":\" without arguments, found \"%.40s\"; settings of "
			"the simulated rig belong in the group `sim`",
			path, line, name, device);
	return 0;
}

static int plan_device(struct incise_rig_plan *plan, int kind,
		       const config_setting_t *root, const char *path,
		       struct incise_error *err)
{
	const char *name = incise_kind_name[kind];
	const config_setting_t *setting = config_setting_get_member(root, name);
	bool wanted = plan->devices & kind_bit(kind);
	const char *device = setting ? config_setting_get_string(setting) : NULL;

	if (device)
		return plan_string(plan, kind, wanted, incise_conf_line(setting), name,
				   device, path, err);
	if (setting)
		return incise_conf_error(setting, NULL, path, err, "text in quotes");
	if (!wanted)
		return 0;
	return incise_error_set(
		err, ENODEV,
		"%.200s: %s: missing, but required; add `%s = \"" SIM_BACKEND
		":\";` or another backend",
		path, name, name);
}

/* --- one to three actuators: stepper = "…", or [ "…", "…" ], and as many groups --- */

static int read_actuators(void *to, const config_setting_t *all, const char *path,
			  struct incise_error *err)
{
	struct incise_rig_plan *plan = to;
	bool list = config_setting_is_list(all);
	int n = list ? config_setting_length(all) : 1, rc = 0;

	if (n < 1 || n > INCISE_RIG_AXES_MAX)
		return incise_conf_error(
			all, NULL, path, err,
			"a group { KEY = VALUE; … }, or 1 to %d of them in "
			"( ), one for each stepper",
			INCISE_RIG_AXES_MAX);
	for (int i = 0; i < n && !rc; i++)
		rc = incise_actuator_read(&plan->actuator[i],
					  list ? config_setting_get_elem(all, i) : all,
					  path, err);
	plan->n_actuators = n;
	return rc;
}

/* In which each actuator pushes: by its group, by default out of the surface. */
static void set_directions(struct incise_rig_plan *plan)
{
	for (int i = 0; i < plan->n_axes; i++) {
		const double *own = plan->actuator[i].direction;

		v3_copy(plan->direction[i], v3_length(own) > 0 ? own : plan->normal);
	}
}

/*
 * Actuators closer to each other's directions would push against each other with more than
 * twice the force that is felt: 1 / sin 30° = 2.
 */
#define APART_DEG 30
#define DEG (M_PI / 180)
#define ROUNDING 1e-9 /* of unit vectors, so that 30 degrees are enough */

static int check_pair(const struct incise_rig_plan *plan, int i, int k, const char *where,
		      struct incise_error *err)
{
	double across[3], apart_deg;

	v3_cross(across, plan->direction[i], plan->direction[k]);
	apart_deg = atan2(v3_length(across),
			  fabs(v3_dot(plan->direction[i], plan->direction[k]))) /
		    DEG;
	if (apart_deg >= APART_DEG - ROUNDING)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%s: the directions of actuators %d and %d are within %.3g degrees of "
		"one line: expected %d or more; give each actuator its own direction = "
		"[x, y, z]",
		where, i + 1, k + 1, apart_deg, APART_DEG);
}

static int check_directions(const struct incise_rig_plan *plan, const char *where,
			    struct incise_error *err)
{
	double dual[INCISE_RIG_AXES_MAX][3], apart_deg;

	for (int i = 0; i < plan->n_axes; i++)
		for (int k = i + 1; k < plan->n_axes; k++)
			if (check_pair(plan, i, k, where, err))
				return -EINVAL;
	incise_axes_dual(plan->n_axes, plan->direction, dual);
	for (int i = 0; i < plan->n_axes; i++) {
		/* NaN: in the plane of the others. By rounding 1 may be passed. */
		apart_deg = 1 / v3_length(dual[i]);
		apart_deg = apart_deg >= 1 ? 90 : asin(apart_deg) / DEG;
		if (!(apart_deg >= APART_DEG - ROUNDING))
			return incise_error_set(
				err, EINVAL,
				"%s: the direction of actuator %d is within %.3g "
				"degrees of the plane of the other two: expected %d or "
				"more; correct one",
				where, i + 1, isnan(apart_deg) ? 0 : apart_deg,
				APART_DEG);
	}
	return 0;
}

/* Several steppers; each has its own string and its own group. */
static int plan_list(struct incise_rig_plan *plan, bool wanted,
		     const config_setting_t *list, const char *path,
		     struct incise_error *err)
{
	int n = config_setting_length(list), line = config_setting_source_line(list);
	int rc = 0;

	for (int i = 0; i < n && i < INCISE_RIG_AXES_MAX && !rc; i++) {
		const config_setting_t *one = config_setting_get_elem(list, i);
		const char *device = config_setting_get_string(one);
		char name[20];

		snprintf(name, sizeof(name), n > 1 ? "stepper %d" : "stepper", i + 1);
		if (!device || is_virtual(device))
			return incise_error_set(
				err, EINVAL,
				"%.200s:%d: %s: expected text in quotes, the BACKEND:ARGUMENTS "
				"of a real one; the simulated rig's are all named by stepper = "
				"\"" SIM_BACKEND ":\", and sim.axes counts them",
				path, config_setting_source_line(one), name);
		rc = plan_string(plan, KIND_STEPPER + i, wanted,
				 config_setting_source_line(one), name, device, path,
				 err);
	}
	if (rc)
		return rc;
	if (n < 1 || n > INCISE_RIG_AXES_MAX || n != plan->n_actuators)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: stepper: expected 1 to %d, each with a group in "
			"actuator = ( { … }, { … } ), found %d and %d groups; correct "
			"them",
			path, line, INCISE_RIG_AXES_MAX, n, plan->n_actuators);
	plan->n_axes = n;
	return 0;
}

static int plan_steppers(struct incise_rig_plan *plan, const config_setting_t *root,
			 const char *path, struct incise_error *err)
{
	bool wanted = plan->devices & kind_bit(KIND_STEPPER);
	const config_setting_t *setting = config_setting_get_member(root, "stepper");
	const char *device = setting ? config_setting_get_string(setting) : NULL;
	char where[240];
	int rc;

	if (!setting || !config_setting_is_aggregate(setting) ||
	    config_setting_is_group(setting))
		rc = plan_device(plan, KIND_STEPPER, root, path, err);
	else
		rc = plan_list(plan, wanted, setting, path, err);
	if (rc || !setting)
		return rc;
	snprintf(where, sizeof(where), "%.200s:%d", path,
		 config_setting_source_line(setting));
	if (device && is_virtual(device)) {
		plan->n_axes = incise_sim_directions(&plan->config, plan->normal,
						     plan->direction);
		return check_directions(plan, where, err);
	}
	if (device && plan->n_actuators > 1)
		return incise_error_set(
			err, EINVAL,
			"%s: stepper: one device, but actuator has %d groups; give as "
			"many devices in [ ], or keep one group",
			where, plan->n_actuators);
	set_directions(plan);
	return check_directions(plan, where, err);
}

static int read_sim(void *to, const config_setting_t *group, const char *path,
		    struct incise_error *err)
{
	struct incise_sim_config *config = &((struct incise_rig_plan *)to)->config;
	int rc = incise_settings_read(incise_sim_settings, group, path, config, err);
	const config_setting_t *depths, *times;

	if (rc)
		return rc;
	depths = config_setting_get_member(group, "depth_mm");
	times = config_setting_get_member(group, "times");
	if (!depths && !times)
		return 0;
	if (!depths || !times ||
	    config_setting_length(depths) != config_setting_length(times))
		return incise_conf_error(group, depths ? "depth_mm" : "times", path, err,
					 "depth_mm and times with equally many values");
	return 0;
}

/* Its frames are known, so the group vision is not needed. */
static void plan_virtual_vision(struct incise_rig_plan *plan)
{
	incise_sim_vision_setup(&plan->config, &plan->vision);
	plan->has_vision = true;
}

static bool virtual_camera(const config_setting_t *root)
{
	const char *device = NULL;

	return config_setting_lookup_string(root, incise_kind_name[KIND_CAMERA],
					    &device) &&
	       is_virtual(device);
}

/* It is the tracker and the stepper of its rig, and opened for these, too. */
static int keep_haptic(struct incise_rig_plan *plan, const char *device,
		       struct incise_error *err)
{
	const unsigned int all =
		INCISE_RIG_TRACKER | INCISE_RIG_STEPPER | INCISE_RIG_HAPTIC;
	bool wanted = plan->devices & all;

	plan->devices &= ~all;
	if (!wanted)
		return 0;
	if (plan->watch)
		return incise_error_set(err, EOPNOTSUPP,
					"%s: a haptic device cannot be watched",
					plan->haptic_where);
	if (plan->simulated && strncmp(device, SIM_BACKEND ":", strlen(SIM_BACKEND ":")))
		return incise_error_set(err, EINVAL,
					"%s: only the simulated rig can follow a "
					"simulated clock; write clock = \"real\"",
					plan->haptic_where);
	plan->haptic_device = strdup(device);
	return plan->haptic_device
		       ? 0
		       : incise_error_set(err, ENOMEM, "%s: %s", plan->haptic_where,
					  strerror(ENOMEM));
}

/* Numbers that must fit each other, and a turn that must be one, which is made unit here. */
static int check_haptic(struct incise_haptic_setup *haptic, const config_setting_t *root,
			const char *path, struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, "haptic_setup");
	double size = sqrt(haptic->turn[0] * haptic->turn[0] +
			   v3_dot(haptic->turn + 1, haptic->turn + 1));

	if (!(fabs(size - 1) < 1e-3))
		return incise_conf_error(group, "turn", path, err,
					 "a unit quaternion [w, x, y, z]");
	for (int i = 0; i < 4; i++)
		haptic->turn[i] /= size;
	for (int i = 0; i < 3; i++)
		if (haptic->high_mm[i] < haptic->low_mm[i] ||
		    (group && !config_setting_get_member(group, "low_mm") !=
				      !config_setting_get_member(group, "high_mm")))
			return incise_conf_error(
				group, "high_mm", path, err,
				"low_mm and high_mm, and no number below that of low_mm");
	if (haptic->n_motor_directions != 3 * haptic->n_motors ||
	    haptic->n_motor_torques != haptic->n_motors)
		return incise_conf_error(
			group, "motor_direction", path, err,
			"for each motor three numbers, and one each in motor_mm_turn and "
			"motor_torque_N_mm");
	return 0;
}

static int plan_haptic(struct incise_rig_plan *plan, const config_setting_t *root,
		       const char *path, struct incise_error *err)
{
	const config_setting_t *setting = config_setting_get_member(root, "haptic");
	const char *device = setting ? config_setting_get_string(setting) : NULL;

	if (!setting && plan->devices & INCISE_RIG_HAPTIC)
		return incise_error_set(err, ENODEV,
					"%.200s: haptic: missing, but required; add "
					"`haptic = \"BACKEND:ARGUMENTS\";`",
					path);
	if (!setting)
		return 0;
	if (!device || !strchr(device, ':'))
		return incise_conf_error(
			setting, NULL, path, err,
			"BACKEND:ARGUMENTS in quotes, such as \"haply:\"");
	if (config_setting_get_member(root, "tracker") ||
	    config_setting_get_member(root, "stepper"))
		return incise_conf_error(
			setting, NULL, path, err,
			"no tracker and no stepper beside a haptic device, which gives the "
			"pose and takes the force");
	snprintf(plan->haptic_where, sizeof(plan->haptic_where), "%.200s:%d: haptic",
		 path, incise_conf_line(setting));
	return keep_haptic(plan, device, err);
}

static int plan_root(struct incise_rig_plan *plan, const config_setting_t *root,
		     const char *path, struct incise_error *err)
{
	int rc = incise_settings_read(incise_rig_settings, root, path, plan, err);

	plan->has_vision = config_setting_get_member(root, "vision");
	plan->has_foot_switch = config_setting_get_member(root, "foot_switch");
	if (plan->devices & INCISE_RIG_IF_NAMED &&
	    !config_setting_get_member(root, "camera"))
		plan->devices &= ~INCISE_RIG_CAMERA;
	if (plan->devices & INCISE_RIG_FORCE_IF_NAMED &&
	    config_setting_get_member(root, "haptic") &&
	    !config_setting_get_member(root, "force"))
		plan->devices &= ~INCISE_RIG_FORCE;
	if (!rc)
		rc = check_tube_station(&plan->tracker, root, path, err);
	if (!rc)
		rc = check_haptic(&plan->haptic, root, path, err);
	if (!rc)
		rc = plan_haptic(plan, root, path, err);
	for (int kind = 0; kind < KIND_STEPPER && !rc; kind++)
		rc = plan_device(plan, kind, root, path, err);
	if (!rc)
		rc = plan_steppers(plan, root, path, err);
	if (!rc && !plan->has_vision && virtual_camera(root))
		plan_virtual_vision(plan);
	return rc;
}

static int plan_file(struct incise_rig_plan *plan, const char *path,
		     struct incise_error *err)
{
	config_t config;
	int rc = incise_conf_read(&config, path, err);

	if (rc == -ENOENT && !strcmp(path, SIM_BACKEND))
		return incise_error_set(
			err, ENOENT,
			"sim: no such file; did you mean sim: with a colon?");
	if (rc)
		return rc;
	rc = plan_root(plan, config_root_setting(&config), path, err);
	config_destroy(&config);
	return rc;
}

/* A KEY=VALUE of the shorthand; @word is overwritten. */
static int plan_word(struct incise_rig_plan *plan, char *word, struct incise_error *err)
{
	static const char *const own[] = {"clock", "mouse", NULL};
	char *value = strchr(word, '='), where[80];
	struct incise_error why = {0};
	const char *meant;
	int rc;

	snprintf(where, sizeof(where), "sim:%.60s", word);
	if (!strcmp(word, "mouse")) {
		plan->config.motion = INCISE_SURGEON_HAND;
		return 0;
	}
	if (!value || value == word || !value[1])
		return incise_error_set(err, EINVAL,
					"%s: expected KEY=VALUE, for example "
					"sim:seed=7,clock=simulated; correct it",
					where);
	*value++ = '\0';
	if (!strcmp(word, "clock"))
		rc = incise_settings_set(incise_rig_settings, "rig", word, value, plan,
					 &why);
	else
		rc = incise_settings_set(incise_sim_settings, "sim", word, value,
					 &plan->config, &why);
	meant = rc == -ENOENT ? incise_nearest_name(word, own) : NULL;
	if (meant)
		return incise_error_set(err, EINVAL,
					"%s: %s: unknown key; did you mean %s?", where,
					word, meant);
	return rc ? incise_error_set(err, EINVAL, "%s: %s", where, why.text) : 0;
}

static int plan_shorthand(struct incise_rig_plan *plan, const char *spec,
			  struct incise_error *err)
{
	char *words = strdup(spec + strlen(SIM_BACKEND ":"));
	char *rest = words, *word;
	int rc = 0;

	if (!words)
		return incise_error_set(err, ENOMEM, "sim: %s", strerror(ENOMEM));
	plan->sim = true;
	if (plan->devices & INCISE_RIG_IF_NAMED)
		plan->devices &= ~INCISE_RIG_CAMERA;
	while (!rc && *words && (word = strsep(&rest, ",")))
		rc = plan_word(plan, word, err);
	free(words);
	if (rc)
		return rc;
	plan_virtual_vision(plan);
	plan->n_axes =
		incise_sim_directions(&plan->config, plan->normal, plan->direction);
	return 0;
}

#define SIM_HAPTIC SIM_BACKEND ":haptic"

/* A rig that is a haptic device alone: no file has that name. */
static bool is_haptic_alone(const char *spec)
{
	size_t length = strspn(spec, "abcdefghijklmnopqrstuvwxyz0123456789_");

	if (!strncmp(spec, SIM_HAPTIC, strlen(SIM_HAPTIC)))
		return true;
	return length && spec[length] == ':' && strncmp(spec, SIM_BACKEND ":", 4) &&
	       access(spec, F_OK);
}

static int plan_haptic_alone(struct incise_rig_plan *plan, const char *spec,
			     struct incise_error *err)
{
	const char *words = spec + strlen(SIM_HAPTIC);
	char device[300];

	snprintf(plan->haptic_where, sizeof(plan->haptic_where), "%.200s", spec);
	if (plan->devices & INCISE_RIG_IF_NAMED)
		plan->devices &= ~INCISE_RIG_CAMERA;
	if (plan->devices & INCISE_RIG_FORCE_IF_NAMED)
		plan->devices &= ~INCISE_RIG_FORCE;
	if (plan->devices & (INCISE_RIG_FORCE | INCISE_RIG_CAMERA))
		return incise_error_set(err, ENODEV,
					"%s: a haptic device alone has no %s; write a "
					"rig.conf that names one",
					plan->haptic_where,
					plan->devices & INCISE_RIG_FORCE ? "force channel"
									 : "camera");
	if (strncmp(spec, SIM_HAPTIC, strlen(SIM_HAPTIC)))
		return keep_haptic(plan, spec, err);
	/* sim:haptic,clock=simulated,KEY=VALUE */
	if (!strncmp(words, ",clock=simulated", 16)) {
		plan->simulated = true;
		words += 16;
	}
	snprintf(device, sizeof(device), SIM_BACKEND ":%.280s", *words ? words + 1 : "");
	return keep_haptic(plan, device, err);
}

int incise_rig_plan_read(struct incise_rig_plan *plan, const char *spec,
			 unsigned int devices, struct incise_error *err)
{
	*plan = (struct incise_rig_plan){
		.watch = devices & INCISE_RIG_WATCH,
		.devices = devices,
		.n_axes = 1,
	};
	incise_settings_init(incise_rig_settings, plan);
	incise_sim_config_init(&plan->config);
	if (is_haptic_alone(spec))
		return plan_haptic_alone(plan, spec, err);
	if (!strncmp(spec, SIM_BACKEND ":", strlen(SIM_BACKEND ":")))
		return plan_shorthand(plan, spec, err);
	return plan_file(plan, spec, err);
}

void incise_rig_plan_free(struct incise_rig_plan *plan)
{
	for (int slot = 0; slot < N_SLOTS; slot++) {
		free(plan->real[slot].name);
		free(plan->real[slot].arguments);
	}
	free(plan->haptic_device);
}
