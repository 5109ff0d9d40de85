// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading rig.conf or the shorthand of a virtual rig; see incise/rig.h and rig.conf(5).
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include <incise/rig.h>
#include "../base/c_locale.h"
#include "../base/conf.h"
#include "../sim/sim.h"
#include "../sim/surgeon.h"
#include "../base/vector.h"
#include "actuator.h"
#include "axes.h"
#include "rig_plan.h"

/* --- groups tracker_setup, force_setup, camera_setup, vision and foot_switch --- */

const char *const incise_rig_root_keys[] = {
	"clock",	"tracker", "force",	  "camera",	   "stepper",
	"surface",	"sim",	   "actuator",	  "tracker_setup", "force_setup",
	"camera_setup", "vision",  "foot_switch", "sign_key",	   NULL};

const struct incise_rig_group incise_rig_groups[INCISE_RIG_GROUPS] = {
	{"tracker_setup",
	 {"stations", "tube_station", "hemisphere", "sync", "offset_mm", "repeat_ms"}},
	{"force_setup", {"rate_hz", "channel", "full_scale_V", "trigger"}},
	{"camera_setup",
	 {"width", "height", "rate_hz", "format", "exposure_ms", "gain",
	  "white_balance_K", "focus"}},
	{"vision", {"hue", "saturation", "value", "full_px", "roi"}},
	{"foot_switch", {"device", "key"}},
};

/* *group is NULL where the file has none. */
static int group_of(const config_setting_t *root, const char *name, const char *path,
		    const config_setting_t **group, struct incise_error *err)
{
	const struct incise_rig_group *known = incise_rig_groups;

	*group = config_setting_get_member(root, name);
	if (!*group)
		return 0;
	if (!config_setting_is_group(*group))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: %s: expected a group { key = value; }; "
			"correct it",
			path, config_setting_source_line(*group), name);
	while (strcmp(known->name, name))
		known++;
	return incise_conf_known(*group, path, known->keys, err);
}

/* sign_key = "/PATH": capture may run in any folder. */
static int read_sign_key(struct incise_rig_plan *plan, const config_setting_t *root,
			 const char *path, struct incise_error *err)
{
	const char *key = NULL;
	int rc = incise_conf_string(root, path, "sign_key", &key, err);

	if (rc || !key)
		return rc;
	if (*key != '/' || strlen(key) >= sizeof(plan->sign_key))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: sign_key: expected the path of a private key of SSH, "
			"such as \"/etc/incise/rig_ed25519\"; correct it",
			path,
			config_setting_source_line(
				config_setting_get_member(root, "sign_key")));
	strcpy(plan->sign_key, key);
	return 0;
}

/* *value is the index in @words; unchanged where the key is absent. */
static int read_word(const config_setting_t *group, const char *path, const char *key,
		     const char *const *words, int *value, struct incise_error *err)
{
	const char *word = NULL;
	char known[100] = "";
	int rc = incise_conf_string(group, path, key, &word, err);

	if (rc || !word)
		return rc;
	for (int i = 0; words[i]; i++) {
		if (!strcmp(word, words[i])) {
			*value = i;
			return 0;
		}
		snprintf(known + strlen(known), sizeof(known) - strlen(known), "%s%s",
			 i ? ", " : "", words[i]);
	}
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: %s.%s: expected one of %s, found \"%.40s\"; "
		"correct it",
		path, config_setting_source_line(config_setting_get_member(group, key)),
		config_setting_name(group), key, known, word);
}

/* stations = [1, 2]: of 1 … 4, ascending. */
static int read_stations(struct incise_tracker_setup *setup,
			 const config_setting_t *group, const char *path,
			 struct incise_error *err)
{
	const config_setting_t *list = config_setting_get_member(group, "stations");
	int n = list && config_setting_is_aggregate(list) &&
				!config_setting_is_group(list)
			? config_setting_length(list)
			: 0;
	bool good = n >= 1 && n <= 4;

	if (!list)
		return 0;
	for (int i = 0; i < n && good; i++) {
		const config_setting_t *one = config_setting_get_elem(list, i);
		int station = config_setting_type(one) == CONFIG_TYPE_INT
				      ? config_setting_get_int(one)
				      : 0;

		good = station >= 1 && station <= 4 &&
		       (!i || station > setup->stations[i - 1]);
		setup->stations[i] = (uint8_t)station;
	}
	setup->n_stations = n;
	if (good)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: tracker_setup.stations: expected numbers of 1 to "
		"4, ascending, such as [1]; correct it",
		path, config_setting_source_line(list));
}

/* tube_station = 2: of the stations, but not the first, which is the scalpel's. */
static int read_tube_station(struct incise_tracker_setup *setup,
			     const config_setting_t *group, const char *path,
			     struct incise_error *err)
{
	const config_setting_t *setting =
		config_setting_get_member(group, "tube_station");
	int station = 0;
	int rc = incise_conf_integer(group, path, "tube_station", 1, 4, &station, err);

	if (rc || !setting)
		return rc;
	setup->tube_station = (uint8_t)station;
	for (int i = 1; i < setup->n_stations; i++)
		if (setup->stations[i] == station)
			return 0;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: tracker_setup.tube_station: expected one of "
		"tracker_setup.stations except the first, which is the scalpel's, "
		"found %d; correct it",
		path, config_setting_source_line(setting), station);
}

static int read_tracker_setup(struct incise_tracker_setup *setup,
			      const config_setting_t *root, const char *path,
			      struct incise_error *err)
{
	static const char *const syncs[] = {"internal", "external", "video", NULL};
	const config_setting_t *group;
	int sync = INCISE_TRACKER_INTERNAL;
	int rc = group_of(root, "tracker_setup", path, &group, err);

	*setup = (struct incise_tracker_setup){.n_stations = 1,
					       .stations = {1},
					       .hemisphere = {1, 0, 0},
					       .repeat_ms = 100};
	if (rc || !group)
		return rc;
	rc = read_stations(setup, group, path, err);
	if (!rc)
		rc = read_tube_station(setup, group, path, err);
	if (!rc)
		rc = incise_conf_direction(group, path, "hemisphere", setup->hemisphere,
					   err);
	if (!rc)
		rc = read_word(group, path, "sync", syncs, &sync, err);
	setup->sync = (enum incise_tracker_sync)sync;
	if (!rc)
		rc = incise_conf_vector(group, path, "offset_mm", setup->offset_mm, err);
	return rc ? rc
		  : incise_conf_number(group, path, "repeat_ms", 0, 60000,
				       &setup->repeat_ms, err);
}

static int read_force_setup(struct incise_force_setup *setup,
			    const config_setting_t *root, const char *path,
			    struct incise_error *err)
{
	const config_setting_t *group;
	const char *trigger = NULL;
	int rc = group_of(root, "force_setup", path, &group, err);

	*setup = (struct incise_force_setup){.rate_hz = 10000};
	if (rc || !group)
		return rc;
	rc = incise_conf_number(group, path, "rate_hz", 1, 100000, &setup->rate_hz, err);
	if (!rc)
		rc = incise_conf_integer(group, path, "channel", 0, 255, &setup->channel,
					 err);
	if (!rc)
		rc = incise_conf_number(group, path, "full_scale_V", 1e-6, 1000,
					&setup->full_scale_V, err);
	if (!rc)
		rc = incise_conf_string(group, path, "trigger", &trigger, err);
	if (rc || !trigger)
		return rc;
	if (strlen(trigger) >= sizeof(setup->trigger) || strchr(trigger, '/'))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: force_setup.trigger: expected the name of a trigger of "
			"at most %zu letters, without a slash; correct it",
			path,
			config_setting_source_line(
				config_setting_get_member(group, "trigger")),
			sizeof(setup->trigger) - 1);
	strcpy(setup->trigger, trigger);
	return 0;
}

static int read_camera_setup(struct incise_camera_setup *setup,
			     const config_setting_t *root, const char *path,
			     struct incise_error *err)
{
	static const char *const formats[] = {"rgb", "grey", "yuyv", "mjpeg", NULL};
	const config_setting_t *group;
	int pixels = INCISE_PIXELS_YUYV;
	int rc = group_of(root, "camera_setup", path, &group, err);

	*setup = (struct incise_camera_setup){.pixels = INCISE_PIXELS_YUYV};
	if (rc || !group)
		return rc;
	rc = incise_conf_integer(group, path, "width", 16, 16384, &setup->width, err);
	if (!rc)
		rc = incise_conf_integer(group, path, "height", 16, 16384, &setup->height,
					 err);
	if (!rc)
		rc = incise_conf_number(group, path, "rate_hz", 0.1, 1000,
					&setup->rate_hz, err);
	if (!rc)
		rc = read_word(group, path, "format", formats, &pixels, err);
	if (!rc)
		rc = incise_conf_number(group, path, "exposure_ms", 0.001, 1000,
					&setup->exposure_ms, err);
	if (!rc)
		rc = incise_conf_number(group, path, "gain", 1, 1e6, &setup->gain, err);
	if (!rc)
		rc = incise_conf_number(group, path, "white_balance_K", 1000, 20000,
					&setup->white_balance_K, err);
	if (!rc)
		rc = incise_conf_number(group, path, "focus", 1, 1e6, &setup->focus, err);
	setup->pixels = (enum incise_pixels)pixels;
	return rc;
}

/* @n whole numbers of 0 … @most; *values are unchanged where the key is absent. */
static int read_numbers(const config_setting_t *group, const char *path, const char *key,
			int n, int most, int *values, const char *form,
			struct incise_error *err)
{
	const config_setting_t *list = config_setting_get_member(group, key);
	bool good = list && config_setting_is_aggregate(list) &&
		    !config_setting_is_group(list) && config_setting_length(list) == n;
	int number[4] = {0};

	if (!list)
		return 0;
	for (int i = 0; i < n && good; i++) {
		const config_setting_t *one = config_setting_get_elem(list, i);

		number[i] = config_setting_get_int(one);
		good = config_setting_type(one) == CONFIG_TYPE_INT && number[i] >= 0 &&
		       number[i] <= most;
	}
	if (good) {
		memcpy(values, number, n * sizeof(*values));
		return 0;
	}
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: vision.%s: expected %s of whole numbers from 0 to %d; "
		"correct it",
		path, config_setting_source_line(list), key, form, most);
}

/* [low, high], the lower one first unless it @wraps around. */
static int read_range(const config_setting_t *group, const char *path, const char *key,
		      int most, bool wraps, int range[2], struct incise_error *err)
{
	int rc = read_numbers(group, path, key, 2, most, range, "[low, high]", err);

	if (rc || wraps || range[0] <= range[1])
		return rc;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: vision.%s: expected the lower number first; correct it", path,
		config_setting_source_line(config_setting_get_member(group, key)), key);
}

/* All of roi or nothing; a smaller box shows no handle. */
static int read_roi(const config_setting_t *group, const char *path,
		    struct incise_vision_box *roi, struct incise_error *err)
{
	int box[4] = {0};
	int rc = read_numbers(group, path, "roi", 4, 8192, box, "[x, y, width, height]",
			      err);

	*roi = (struct incise_vision_box){box[0], box[1], box[2], box[3]};
	if (rc || !config_setting_get_member(group, "roi") ||
	    (roi->width >= 16 && roi->height >= 16))
		return rc;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: vision.roi: expected a width and a height of 16 or more; "
		"correct it",
		path,
		config_setting_source_line(config_setting_get_member(group, "roi")));
}

static int read_vision_setup(struct incise_vision_setup *setup, bool *given,
			     const config_setting_t *root, const char *path,
			     struct incise_error *err)
{
	const config_setting_t *group;
	int rc = group_of(root, "vision", path, &group, err);

	*given = group;
	*setup = (struct incise_vision_setup){
		.hue = {0, 179}, .saturation = {0, 255}, .value = {0, 60}};
	if (rc || !group)
		return rc;
	rc = read_range(group, path, "hue", 179, true, setup->hue, err);
	if (!rc)
		rc = read_range(group, path, "saturation", 255, false, setup->saturation,
				err);
	if (!rc)
		rc = read_range(group, path, "value", 255, false, setup->value, err);
	if (!rc)
		rc = incise_conf_number(group, path, "full_px", 16, 8192, &setup->full_px,
					err);
	return rc ? rc : read_roi(group, path, &setup->roi, err);
}

/* Both keys must be there: no device is meant by default. */
static int read_foot_switch(struct incise_rig_plan *plan, const config_setting_t *root,
			    const char *path, struct incise_error *err)
{
	struct incise_foot_switch_setup *setup = &plan->foot_switch;
	const char *device = NULL, *key = NULL;
	const config_setting_t *group;
	int rc = group_of(root, "foot_switch", path, &group, err), code;

	if (rc || !group)
		return rc;
	rc = incise_conf_string(group, path, "device", &device, err);
	if (!rc)
		rc = incise_conf_string(group, path, "key", &key, err);
	if (rc)
		return rc;
	if (!device || *device != '/' || strlen(device) >= sizeof(setup->device))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: foot_switch.device: expected the path of an input "
			"device, such as \"/dev/input/by-id/…-event-kbd\"; correct it",
			path, config_setting_source_line(group));
	code = key ? incise_foot_switch_key(key) : -EINVAL;
	if (code < 0)
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: foot_switch.key: expected the name of a key, such as "
			"\"b\", found \"%.40s\"; rig.conf(5) lists them",
			path, config_setting_source_line(group), key ? key : "");
	strcpy(setup->device, device);
	setup->key = (uint16_t)code;
	plan->has_foot_switch = true;
	return 0;
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

static int plan_device(struct incise_rig_plan *plan, int kind, bool wanted,
		       const config_setting_t *root, const char *path,
		       struct incise_error *err)
{
	const char *name = incise_kind_name[kind], *device = NULL;
	const config_setting_t *setting = config_setting_get_member(root, name);
	int rc = incise_conf_string(root, path, name, &device, err);

	if (rc)
		return rc;
	if (!device && wanted)
		return incise_error_set(err, ENODEV,
					"%.200s: %s: missing, but required; add `%s = "
					"\"" SIM_BACKEND ":\";` or another backend",
					path, name, name);
	if (!device)
		return 0;
	return plan_string(plan, kind, wanted, config_setting_source_line(setting), name,
			   device, path, err);
}

/* --- one to three actuators: stepper = "…", or [ "…", "…" ], and as many groups --- */

static int read_actuators(struct incise_rig_plan *plan, const config_setting_t *root,
			  const char *path, struct incise_error *err)
{
	const config_setting_t *all = config_setting_get_member(root, "actuator");
	int n = all && config_setting_is_list(all) ? config_setting_length(all) : !!all;
	int rc = 0;

	if (all && (n < 1 || n > INCISE_RIG_AXES_MAX))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: actuator: expected a group { key = value; }, or 1 to %d "
			"of them in ( ), one for each stepper, found %d; correct it",
			path, config_setting_source_line(all), INCISE_RIG_AXES_MAX, n);
	for (int i = 0; i < n && !rc; i++) {
		const config_setting_t *one = config_setting_is_list(all)
						      ? config_setting_get_elem(all, i)
						      : all;

		if (one != all && !config_setting_is_group(one))
			return incise_error_set(
				err, EINVAL,
				"%.200s:%d: actuator: expected groups { key = value; } in "
				"the list; correct it",
				path, config_setting_source_line(one));
		rc = incise_actuator_read(&plan->actuator[i], one, path, err);
	}
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
		/* Not a number: in the plane of the others. By rounding 1 may be passed. */
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
		rc = plan_device(plan, KIND_STEPPER, wanted, root, path, err);
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

/* A key of the group sim; a message of config.c gets file and line in front. */
static int plan_sim_key(struct incise_sim_config *config, const char *where,
			const char *key, double value, struct incise_error *err)
{
	struct incise_error cause = {0};

	if (!incise_sim_config_set(config, key, value, &cause))
		return 0;
	return incise_error_set(err, EINVAL, "%s: %s", where, cause.text);
}

static int plan_sim_word(struct incise_sim_config *config, const char *where,
			 const char *key, const char *word, struct incise_error *err)
{
	struct incise_error cause = {0};

	if (!incise_sim_config_set_word(config, key, word, &cause))
		return 0;
	return incise_error_set(err, EINVAL, "%s: %s", where, cause.text);
}

static int plan_sim_setting(struct incise_sim_config *config, const char *path,
			    const config_setting_t *setting, struct incise_error *err)
{
	const char *name = config_setting_name(setting);
	int length =
		config_setting_is_aggregate(setting) ? config_setting_length(setting) : 1;
	bool protocol = !strcmp(name, "depth_mm") || !strcmp(name, "times");
	char where[240], key[64];

	snprintf(where, sizeof(where), "%.200s:%d", path,
		 config_setting_source_line(setting));
	if (!incise_sim_config_has(name))
		return plan_sim_key(config, where, name, 0, err);
	if (incise_sim_config_has_words(name)) {
		const char *word = NULL;
		int rc = incise_conf_string(config_setting_parent(setting), path, name,
					    &word, err);

		return rc ? rc : plan_sim_word(config, where, name, word, err);
	}
	if (config_setting_is_group(setting) ||
	    config_setting_is_aggregate(setting) != protocol ||
	    length > INCISE_SIM_DEPTHS_MAX)
		return incise_error_set(
			err, EINVAL,
			protocol ? "%s: sim.%.40s: expected an array of at most "
				   "8 numbers such as [5, 10]; correct it"
				 : "%s: sim.%.40s: expected a number; correct it",
			where, name);
	for (int i = 0; i < length; i++) {
		const config_setting_t *element =
			protocol ? config_setting_get_elem(setting, i) : setting;
		double value;

		switch (config_setting_type(element)) {
		case CONFIG_TYPE_INT:
		case CONFIG_TYPE_INT64:
			value = (double)config_setting_get_int64(element);
			break;
		case CONFIG_TYPE_FLOAT:
			value = config_setting_get_float(element);
			break;
		default:
			return incise_error_set(
				err, EINVAL,
				"%s: sim.%.40s: expected a number; correct it", where,
				name);
		}
		snprintf(key, sizeof(key), protocol ? "%.40s[%d]" : "%.40s", name, i);
		if (plan_sim_key(config, where, key, value, err))
			return -EINVAL;
	}
	return 0;
}

static int plan_sim(struct incise_rig_plan *plan, const config_setting_t *root,
		    const char *path, struct incise_error *err)
{
	const config_setting_t *group = config_setting_get_member(root, "sim");
	const config_setting_t *depths, *times;
	int rc;

	if (!group)
		return 0;
	if (!config_setting_is_group(group))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: sim: expected a group { key = value; }; "
			"correct it",
			path, config_setting_source_line(group));
	depths = config_setting_get_member(group, "depth_mm");
	times = config_setting_get_member(group, "times");
	if (!!depths != !!times ||
	    (depths && (config_setting_length(depths) != config_setting_length(times) ||
			!config_setting_length(depths))))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: sim: expected depth_mm and times with equally many "
			"values, 1 to %d; correct them",
			path, config_setting_source_line(depths ? depths : times),
			INCISE_SIM_DEPTHS_MAX);
	if (depths)
		plan->config.n_depths = config_setting_length(depths);
	for (int i = 0; i < config_setting_length(group); i++) {
		rc = plan_sim_setting(&plan->config, path,
				      config_setting_get_elem(group, i), err);
		if (rc)
			return rc;
	}
	return 0;
}

/* @where, the file and line or the shorthand, starts the message. */
static int plan_clock(struct incise_rig_plan *plan, const char *where, const char *text,
		      struct incise_error *err)
{
	plan->simulated = !strcmp(text, "simulated");
	if (plan->simulated || !strcmp(text, "real"))
		return 0;
	return incise_error_set(err, EINVAL,
				"%s: clock: expected real or simulated, found %.40s; "
				"correct it",
				where, text);
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

static int plan_root(struct incise_rig_plan *plan, const config_setting_t *root,
		     const char *path, struct incise_error *err)
{
	const char *clock = NULL;
	char where[240];
	int rc;

	rc = incise_conf_known(root, path, incise_rig_root_keys, err);
	if (!rc)
		rc = incise_conf_string(root, path, "clock", &clock, err);
	if (!rc && clock) {
		snprintf(where, sizeof(where), "%.200s:%d", path,
			 config_setting_source_line(
				 config_setting_get_member(root, "clock")));
		rc = plan_clock(plan, where, clock, err);
	}
	if (!rc)
		rc = incise_conf_surface(root, path, plan->point_mm, plan->normal, err);
	if (!rc)
		rc = plan_sim(plan, root, path, err);
	if (!rc)
		rc = read_actuators(plan, root, path, err);
	if (!rc)
		rc = read_tracker_setup(&plan->tracker, root, path, err);
	if (!rc)
		rc = read_force_setup(&plan->force, root, path, err);
	if (!rc)
		rc = read_camera_setup(&plan->camera, root, path, err);
	if (!rc)
		rc = read_vision_setup(&plan->vision, &plan->has_vision, root, path, err);
	if (!rc)
		rc = read_foot_switch(plan, root, path, err);
	if (!rc)
		rc = read_sign_key(plan, root, path, err);
	if (plan->devices & INCISE_RIG_IF_NAMED &&
	    !config_setting_get_member(root, "camera"))
		plan->devices &= ~INCISE_RIG_CAMERA;
	for (int kind = 0; kind < KIND_STEPPER && !rc; kind++)
		rc = plan_device(plan, kind, plan->devices & kind_bit(kind), root, path,
				 err);
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

	if (rc)
		return rc;
	rc = plan_root(plan, config_root_setting(&config), path, err);
	config_destroy(&config);
	return rc;
}

/* One KEY=VALUE of the shorthand; @word is overwritten. */
static int plan_word(struct incise_rig_plan *plan, char *word, struct incise_error *err)
{
	static const char *const own[] = {"clock", "mouse", NULL};
	const char *meant;
	char *value = strchr(word, '=');
	struct incise_c_locale locale;
	char where[80], *end;
	double number;

	snprintf(where, sizeof(where), "sim:%.60s", word);
	if (!strcmp(word, "mouse"))
		return plan_sim_key(&plan->config, where, "motion", INCISE_SURGEON_HAND,
				    err);
	if (!value || value == word || !value[1])
		return incise_error_set(err, EINVAL,
					"%s: expected KEY=VALUE, for example "
					"sim:seed=7,clock=simulated; correct it",
					where);
	*value++ = '\0';
	if (!strcmp(word, "clock"))
		return plan_clock(plan, where, value, err);
	if (incise_sim_config_has_words(word))
		return plan_sim_word(&plan->config, where, word, value, err);
	meant = incise_sim_config_has(word) ? NULL : incise_nearest_name(word, own);
	if (meant)
		return incise_error_set(err, EINVAL,
					"%s: %s: unknown key; did you mean %s?", where,
					word, meant);
	if (!incise_sim_config_has(word))
		return plan_sim_key(&plan->config, where, word, 0, err);
	locale = incise_c_locale_begin();
	number = incise_decimal(value, &end);
	incise_c_locale_end(locale);
	if (*end)
		return incise_error_set(
			err, EINVAL,
			"%s: %.40s: expected a number, found %.40s; correct it", where,
			word, value);
	return plan_sim_key(&plan->config, where, word, number, err);
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

int incise_rig_plan_read(struct incise_rig_plan *plan, const char *spec,
			 unsigned int devices, struct incise_error *err)
{
	*plan = (struct incise_rig_plan){
		.normal = {0, 0, 1},
		.watch = devices & INCISE_RIG_WATCH,
		.devices = devices,
		.n_axes = 1,
	};
	incise_sim_config_init(&plan->config);
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
}
