// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading rig.conf or the shorthand of a virtual rig; see incise/rig.h and rig.conf(5).
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/rig.h>
#include "../base/c_locale.h"
#include "../base/conf.h"
#include "../sim/surgeon.h"
#include "../sim/sim.h"
#include "actuator.h"
#include "rig_plan.h"
#include "source_setup.h"

#define SIM_BACKEND "sim"

const char *const incise_kind_name[N_KINDS] = {"tracker", "force", "camera", "stepper"};

/* What a real device needs besides its string. */
static int plan_real(struct incise_rig_plan *plan, int kind, const char *path, int line,
		     const char *device, size_t length, struct incise_error *err)
{
	struct rig_real *real = &plan->real[kind];

	snprintf(real->where, sizeof(real->where), "%.200s:%d: %s", path, line,
		 incise_kind_name[kind]);
	if (plan->simulated)
		return incise_error_set(err, EINVAL,
					"%s: only the virtual rig can follow a simulated "
					"clock; write clock = \"real\"",
					real->where);
	if (kind == KIND_STEPPER && !plan->has_actuator)
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

/*
 * A device's string. Only a device that will be opened must have a backend here: one
 * rig.conf may serve machines with different modules.
 */
static int plan_device(struct incise_rig_plan *plan, int kind, bool wanted,
		       const config_setting_t *root, const char *path,
		       struct incise_error *err)
{
	const char *name = incise_kind_name[kind], *device = NULL;
	size_t length;
	int rc, line;

	rc = incise_conf_string(root, path, name, &device, err);
	if (rc)
		return rc;
	if (!device && wanted)
		return incise_error_set(err, ENODEV,
					"%.200s: %s: not named, but needed; add `%s = "
					"\"" SIM_BACKEND ":\";` or another backend",
					path, name, name);
	if (!device)
		return 0;
	line = config_setting_source_line(config_setting_get_member(root, name));
	length = strcspn(device, ":");
	if (!device[length])
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: %s: expected BACKEND:ARGUMENTS such as "
			"\"" SIM_BACKEND ":\", found \"%.40s\"; correct it",
			path, line, name, device);
	if (length != strlen(SIM_BACKEND) || strncmp(device, SIM_BACKEND, length))
		return wanted ? plan_real(plan, kind, path, line, device, length, err)
			      : 0;
	plan->sim = true;
	if (device[length + 1])
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: %s: expected \"" SIM_BACKEND
			":\" without arguments, found \"%.40s\"; settings of "
			"the virtual rig belong in the group `sim`",
			path, line, name, device);
	return 0;
}

/* A key of the sim group; what config.c says of it gets the file and line. */
static int plan_sim_key(struct incise_sim_config *config, const char *where,
			const char *key, double value, struct incise_error *err)
{
	struct incise_error cause = {0};

	if (!incise_sim_config_set(config, key, value, &cause))
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
			"%.200s:%d: sim: expected depth_mm and times with as "
			"many values each, 1 to %d; correct them",
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

/* @where stands before the message: file and line, or the shorthand. */
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

/* Its pictures are known: no group need say what is in them. */
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
	       !strcmp(device, SIM_BACKEND ":");
}

static int plan_root(struct incise_rig_plan *plan, const config_setting_t *root,
		     const char *path, struct incise_error *err)
{
	static const char *const keys[] = {"clock",	  "tracker",	  "force",
					   "camera",	  "stepper",	  "surface",
					   "sim",	  "actuator",	  "tracker_setup",
					   "force_setup", "camera_setup", "vision",
					   NULL};
	const config_setting_t *actuator;
	const char *clock = NULL;
	char where[240];
	int rc;

	rc = incise_conf_known(root, path, keys, err);
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
	actuator = rc ? NULL : config_setting_get_member(root, "actuator");
	if (actuator) {
		rc = incise_actuator_read(&plan->actuator, actuator, path, err);
		plan->has_actuator = true;
	}
	if (!rc)
		rc = incise_tracker_setup_read(&plan->tracker, root, path, err);
	if (!rc)
		rc = incise_force_setup_read(&plan->force, root, path, err);
	if (!rc)
		rc = incise_camera_setup_read(&plan->camera, root, path, err);
	if (!rc)
		rc = incise_vision_setup_read(&plan->vision, &plan->has_vision, root,
					      path, err);
	if (plan->devices & INCISE_RIG_IF_NAMED &&
	    !config_setting_get_member(root, "camera"))
		plan->devices &= ~INCISE_RIG_CAMERA;
	for (int kind = 0; kind < N_KINDS && !rc; kind++)
		rc = plan_device(plan, kind, plan->devices & kind_bit(kind), root, path,
				 err);
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

/* One KEY=VALUE of the shorthand, which is written over. */
static int plan_word(struct incise_rig_plan *plan, char *word, struct incise_error *err)
{
	char *value = strchr(word, '=');
	struct incise_c_locale locale;
	char where[80], *end;
	double number;

	snprintf(where, sizeof(where), "sim:%.60s", word);
	if (!strcmp(word, "mouse"))
		return plan_sim_key(&plan->config, where, "motion", INCISE_SURGEON_HAND,
				    err);
	if (!value || value == word || !value[1])
		return incise_error_set(err, EINVAL, "%s: expected KEY=VALUE; correct it",
					where);
	*value++ = '\0';
	if (!strcmp(word, "clock"))
		return plan_clock(plan, where, value, err);
	locale = incise_c_locale_begin();
	number = strtod(value, &end);
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
	if (!rc)
		plan_virtual_vision(plan);
	return rc;
}

int incise_rig_plan_read(struct incise_rig_plan *plan, const char *spec,
			 unsigned int devices, struct incise_error *err)
{
	*plan = (struct incise_rig_plan){
		.normal = {0, 0, 1},
		.watch = devices & INCISE_RIG_WATCH,
		.devices = devices,
	};
	incise_sim_config_init(&plan->config);
	if (!strncmp(spec, SIM_BACKEND ":", strlen(SIM_BACKEND ":")))
		return plan_shorthand(plan, spec, err);
	return plan_file(plan, spec, err);
}

void incise_rig_plan_free(struct incise_rig_plan *plan)
{
	for (int kind = 0; kind < N_KINDS; kind++) {
		free(plan->real[kind].name);
		free(plan->real[kind].arguments);
	}
}
