// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A rig: reads rig.conf or the shorthand, then opens what was asked for on one clock; see
 * incise/rig.h. The two steps are apart, so that a fault in the file opens nothing.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/rig.h>
#include "../base/c_locale.h"
#include "../base/conf.h"
#include "../sim/sim.h"
#include "actuator.h"
#include "backends.h"

#define SIM_BACKEND "sim"
#define SIM_START_NS INCISE_NS_PER_S /* of a simulated clock: 0 would pass for unset */

enum { TRACKER, FORCE, CAMERA, STEPPER, N_KINDS };

static const char *const kind_name[N_KINDS] = {"tracker", "force", "camera", "stepper"};

/* The kinds' order is that of their bits. */
static unsigned int kind_bit(int kind)
{
	return 1u << kind;
}

struct incise_rig {
	char *spec;
	struct incise_loaded loaded[N_KINDS]; /* modules of real devices */
	struct incise_clock *clock;
	struct incise_sim *sim;
	struct incise_tracker *tracker;
	struct incise_force *force;
	struct incise_camera *camera;
	struct incise_stepper *stepper;
	double point_mm[3], normal[3];
};

/* A device that does not stand on the virtual rig. */
struct rig_real {
	char *name; /* of its backend; NULL: none is wanted */
	char *arguments;
	char where[240];
};

/* What is wanted of a rig. */
struct rig_plan {
	bool simulated;
	bool sim;   /* one of the devices stands on the virtual rig */
	bool watch; /* the stepper */
	struct rig_real real[N_KINDS];
	struct incise_actuator actuator;
	bool has_actuator;
	struct incise_sim_config config;
	double point_mm[3], normal[3];
};

/* What a real device needs besides its string. */
static int plan_real(struct rig_plan *plan, int kind, const char *path, int line,
		     const char *device, size_t length, struct incise_error *err)
{
	struct rig_real *real = &plan->real[kind];

	snprintf(real->where, sizeof(real->where), "%.200s:%d: %s", path, line,
		 kind_name[kind]);
	if (plan->simulated)
		return incise_error_set(err, EINVAL,
					"%s: only the virtual rig can follow a simulated "
					"clock; write clock = \"real\"",
					real->where);
	if (kind == STEPPER && !plan->has_actuator)
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
static int plan_device(struct rig_plan *plan, int kind, bool wanted,
		       const config_setting_t *root, const char *path,
		       struct incise_error *err)
{
	const char *name = kind_name[kind], *device = NULL;
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

static int plan_sim(struct rig_plan *plan, const config_setting_t *root, const char *path,
		    struct incise_error *err)
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
static int plan_clock(struct rig_plan *plan, const char *where, const char *text,
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

static int plan_root(struct rig_plan *plan, unsigned int devices,
		     const config_setting_t *root, const char *path,
		     struct incise_error *err)
{
	static const char *const keys[] = {"clock",  "tracker",	 "force",
					   "camera", "stepper",	 "surface",
					   "sim",    "actuator", NULL};
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
	for (int kind = 0; kind < N_KINDS && !rc; kind++)
		rc = plan_device(plan, kind, devices & kind_bit(kind), root, path, err);
	return rc;
}

static int plan_file(struct rig_plan *plan, const char *path, unsigned int devices,
		     struct incise_error *err)
{
	config_t config;
	int rc = incise_conf_read(&config, path, err);

	if (rc)
		return rc;
	rc = plan_root(plan, devices, config_root_setting(&config), path, err);
	config_destroy(&config);
	return rc;
}

/* One KEY=VALUE of the shorthand, which is written over. */
static int plan_word(struct rig_plan *plan, char *word, struct incise_error *err)
{
	char *value = strchr(word, '=');
	struct incise_c_locale locale;
	char where[80], *end;
	double number;

	snprintf(where, sizeof(where), "sim:%.60s", word);
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

static int plan_shorthand(struct rig_plan *plan, const char *spec,
			  struct incise_error *err)
{
	char *words = strdup(spec + strlen(SIM_BACKEND ":"));
	char *rest = words, *word;
	int rc = 0;

	if (!words)
		return incise_error_set(err, ENOMEM, "sim: %s", strerror(ENOMEM));
	plan->sim = true;
	while (!rc && *words && (word = strsep(&rest, ",")))
		rc = plan_word(plan, word, err);
	free(words);
	return rc;
}

/* Where a device of a kind is kept. Each kind's struct is what its backend opens. */
static void *rig_open_sim(struct incise_rig *rig, int kind)
{
	switch (kind) {
	case TRACKER:
		return rig->tracker = incise_sim_tracker_new(rig->sim);
	case FORCE:
		return rig->force = incise_sim_force_new(rig->sim);
	case CAMERA:
		return rig->camera = incise_sim_camera_new(rig->sim);
	default:
		return rig->stepper = incise_sim_stepper_new(rig->sim);
	}
}

static int rig_open_real(struct incise_rig *rig, const struct rig_plan *plan, int kind,
			 struct incise_error *err)
{
	const struct rig_real *real = &plan->real[kind];
	struct incise_backend_request request = {
		.arguments = real->arguments,
		.where = real->where,
		.clock = rig->clock,
		.watch = plan->watch,
		.actuator = &plan->actuator,
	};
	void *device;
	int rc = incise_backend_find(&rig->loaded[kind], kind_name[kind], real->name,
				     real->where, err);

	if (rc)
		return rc;
	device = rig->loaded[kind].backend->open(&request, err);
	if (!device)
		return errno ? -errno : -EIO;
	if (kind == TRACKER)
		rig->tracker = device;
	else if (kind == FORCE)
		rig->force = device;
	else if (kind == CAMERA)
		rig->camera = device;
	else
		rig->stepper = device;
	return 0;
}

static int rig_devices(struct incise_rig *rig, const struct rig_plan *plan,
		       unsigned int devices, struct incise_error *err)
{
	int rc = 0;

	for (int kind = 0; kind < N_KINDS && !rc; kind++) {
		if (!(devices & kind_bit(kind)))
			continue;
		if (plan->real[kind].name)
			rc = rig_open_real(rig, plan, kind, err);
		else if (!rig_open_sim(rig, kind))
			rc = incise_error_set(err, ENOMEM, "%.200s: %s; free some memory",
					      rig->spec, strerror(ENOMEM));
	}
	return rc;
}

static void plan_free(struct rig_plan *plan)
{
	for (int kind = 0; kind < N_KINDS; kind++) {
		free(plan->real[kind].name);
		free(plan->real[kind].arguments);
	}
}

static struct incise_rig *rig_new(const struct rig_plan *plan, const char *spec,
				  unsigned int devices, struct incise_error *err)
{
	struct incise_rig *rig = calloc(1, sizeof(*rig));
	int rc;

	if (!rig)
		goto no_memory;
	memcpy(rig->point_mm, plan->point_mm, sizeof(rig->point_mm));
	memcpy(rig->normal, plan->normal, sizeof(rig->normal));
	rig->spec = strdup(spec);
	rig->clock = plan->simulated ? incise_clock_new_simulated(SIM_START_NS)
				     : incise_clock_new_real();
	if (!rig->spec || !rig->clock)
		goto no_memory;
	if (plan->sim) {
		rig->sim = incise_sim_new(&plan->config, rig->clock, err);
		if (!rig->sim)
			goto close;
	}
	rc = rig_devices(rig, plan, devices, err);
	if (!rc)
		return rig;
	errno = -rc;
	goto close;
no_memory:
	incise_error_set(err, ENOMEM, "%.200s: %s; free some memory", spec,
			 strerror(ENOMEM));
close:
	rc = errno;
	incise_rig_close(rig);
	errno = rc;
	return NULL;
}

struct incise_rig *incise_rig_open(const char *spec, unsigned int devices,
				   struct incise_error *err)
{
	struct rig_plan plan = {.normal = {0, 0, 1}};
	struct incise_rig *rig = NULL;
	int rc;

	plan.watch = devices & INCISE_RIG_WATCH;
	incise_sim_config_init(&plan.config);
	if (!strncmp(spec, SIM_BACKEND ":", strlen(SIM_BACKEND ":")))
		rc = plan_shorthand(&plan, spec, err);
	else
		rc = plan_file(&plan, spec, devices, err);
	if (!rc) {
		rig = rig_new(&plan, spec, devices, err);
		rc = rig ? 0 : -errno;
	}
	plan_free(&plan);
	if (rc) {
		/* A value out of range is the file's fault like any other. */
		errno = -rc;
		if (err)
			err->code = errno;
	}
	return rig;
}

void incise_rig_close(struct incise_rig *rig)
{
	if (!rig)
		return;
	if (rig->tracker)
		rig->tracker->ops->close(rig->tracker);
	if (rig->force)
		rig->force->ops->close(rig->force);
	if (rig->camera)
		rig->camera->ops->close(rig->camera);
	if (rig->stepper)
		rig->stepper->ops->close(rig->stepper);
	for (int kind = 0; kind < N_KINDS; kind++)
		incise_backend_unload(&rig->loaded[kind]);
	incise_sim_free(rig->sim);
	incise_clock_free(rig->clock);
	free(rig->spec);
	free(rig);
}

const char *incise_rig_spec(const struct incise_rig *rig)
{
	return rig->spec;
}

struct incise_clock *incise_rig_clock(struct incise_rig *rig)
{
	return rig->clock;
}

struct incise_tracker *incise_rig_tracker(struct incise_rig *rig)
{
	return rig->tracker;
}

struct incise_force *incise_rig_force(struct incise_rig *rig)
{
	return rig->force;
}

struct incise_camera *incise_rig_camera(struct incise_rig *rig)
{
	return rig->camera;
}

struct incise_stepper *incise_rig_stepper(struct incise_rig *rig)
{
	return rig->stepper;
}

struct incise_sim *incise_rig_sim(struct incise_rig *rig)
{
	return rig->sim;
}

void incise_rig_surface(const struct incise_rig *rig, double point_mm[3],
			double normal[3])
{
	memcpy(point_mm, rig->point_mm, sizeof(rig->point_mm));
	memcpy(normal, rig->normal, sizeof(rig->normal));
}
