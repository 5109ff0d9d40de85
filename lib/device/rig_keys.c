// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The keys of a rig with their values; see incise/rig.h. Names of keys are those that the
 * readers accept, and values are those of the plan that they read.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "../base/c_locale.h"
#include "../base/conf.h"
#include "../sim/sim.h"
#include "actuator.h"
#include "rig_plan.h"

struct list {
	const char *spec;
	const config_setting_t *root; /* NULL: @spec is a shorthand */
	const struct incise_rig_plan *plan;
	incise_rig_key_found *found;
	void *context;
	int rc; /* last return of found */
};

/* --- values as text --- */

static void INCISE_PRINTF(2, 3) append(struct incise_rig_key *key, const char *fmt, ...)
{
	size_t used = strlen(key->value);
	va_list args;

	va_start(args, fmt);
	vsnprintf(key->value + used, sizeof(key->value) - used, fmt, args);
	va_end(args);
}

/* libconfig wants the numbers of an array all whole, or none. */
static void append_numbers(struct incise_rig_key *key, const double *values, int n)
{
	bool whole = true;
	char text[32];

	for (int i = 0; i < n; i++) {
		snprintf(text, sizeof(text), "%.15g", values[i]);
		whole &= !strpbrk(text, ".e");
	}
	for (int i = 0; i < n; i++) {
		snprintf(text, sizeof(text), "%.15g", values[i]);
		append(key, "%s%s%s", i ? ", " : "", text,
		       whole || strpbrk(text, ".e") ? "" : ".0");
	}
}

static void append_array(struct incise_rig_key *key, const double *values, int n)
{
	append(key, "[");
	append_numbers(key, values, n);
	append(key, "]");
}

static void append_text(struct incise_rig_key *key, const char *text)
{
	append(key, "\"");
	for (const char *c = text; *c; c++)
		append(key, "%s%c", *c == '"' || *c == '\\' ? "\\" : "",
		       (unsigned char)*c < ' ' ? '?' : *c);
	append(key, "\"");
}

/* --- values of the plan --- */

struct field {
	const char *name;
	enum {
		REAL,	 /* double */
		WHOLE,	 /* int */
		NATURAL, /* uint32_t */
		BYTE,	 /* uint8_t */
		TRUTH,	 /* bool */
		VECTOR,	 /* double[3] */
		PAIR,	 /* int[2] */
		BOX,	 /* struct incise_vision_box */
		TEXT,	 /* char[] */
		WORD,	 /* text of the file; by default @word */
	} kind;
	size_t offset;
	bool optional; /* 0 is no value */
	const char *word;
};

#define PLAN(name, kind, field, ...)                                             \
	{                                                                        \
		name, kind, offsetof(struct incise_rig_plan, field), __VA_ARGS__ \
	}
#define ACTUATOR(name, kind, field, ...)                                         \
	{                                                                        \
		name, kind, offsetof(struct incise_actuator, field), __VA_ARGS__ \
	}

/* Some others are printed by functions. */
static const struct field plan_fields[] = {
	PLAN("surface.point_mm", VECTOR, point_mm, false, NULL),
	PLAN("surface.normal", VECTOR, normal, false, NULL),
	PLAN("tracker_setup.tube_station", BYTE, tracker.tube_station, true, NULL),
	PLAN("tracker_setup.hemisphere", VECTOR, tracker.hemisphere, false, NULL),
	PLAN("tracker_setup.sync", WORD, tracker.sync, false, "internal"),
	PLAN("tracker_setup.offset_mm", VECTOR, tracker.offset_mm, false, NULL),
	PLAN("tracker_setup.repeat_ms", REAL, tracker.repeat_ms, false, NULL),
	PLAN("force_setup.rate_hz", REAL, force.rate_hz, false, NULL),
	PLAN("force_setup.channel", WHOLE, force.channel, false, NULL),
	PLAN("force_setup.full_scale_V", REAL, force.full_scale_V, true, NULL),
	PLAN("force_setup.trigger", TEXT, force.trigger, true, NULL),
	PLAN("camera_setup.width", WHOLE, camera.width, true, NULL),
	PLAN("camera_setup.height", WHOLE, camera.height, true, NULL),
	PLAN("camera_setup.rate_hz", REAL, camera.rate_hz, true, NULL),
	PLAN("camera_setup.format", WORD, camera.pixels, false, "yuyv"),
	PLAN("camera_setup.exposure_ms", REAL, camera.exposure_ms, true, NULL),
	PLAN("camera_setup.gain", REAL, camera.gain, true, NULL),
	PLAN("camera_setup.white_balance_K", REAL, camera.white_balance_K, true, NULL),
	PLAN("camera_setup.focus", REAL, camera.focus, true, NULL),
	PLAN("vision.hue", PAIR, vision.hue, false, NULL),
	PLAN("vision.saturation", PAIR, vision.saturation, false, NULL),
	PLAN("vision.value", PAIR, vision.value, false, NULL),
	PLAN("vision.full_px", REAL, vision.full_px, true, NULL),
	PLAN("vision.roi", BOX, vision.roi, true, NULL),
	PLAN("foot_switch.device", TEXT, foot_switch.device, true, NULL),
	PLAN("foot_switch.key", WORD, foot_switch.key, false, ""),
};

static const struct field actuator_fields[] = {
	ACTUATOR("steps_per_turn", WHOLE, steps_per_turn, false, NULL),
	ACTUATOR("microsteps", WHOLE, microsteps, false, NULL),
	ACTUATOR("invert", TRUTH, invert, false, NULL),
	ACTUATOR("retract", TRUTH, retract, false, NULL),
	ACTUATOR("can.mode", WORD, can.mode, false, "csp"),
	ACTUATOR("can.bitrate", NATURAL, can.bitrate, true, NULL),
	ACTUATOR("can.following_mm", REAL, can.following_mm, false, NULL),
	ACTUATOR("can.homing_method", WHOLE, can.homing_method, false, NULL),
	ACTUATOR("can.absolute", TRUTH, can.absolute, false, NULL),
	ACTUATOR("can.master", WHOLE, can.master, false, NULL),
};

/* Numbers for which 0 means that the device or the machine decides. */
static bool is_optional(const char *name)
{
	static const char *const names[] = {
		"high_us",
		"low_us",
		"can.counts_per_turn",
		"can.velocity_per_turn_s",
		"can.acceleration_per_turn_s2",
		"can.stiffness_permille_mm",
		"can.torque_max_permille",
	};

	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++)
		if (!strcmp(name, names[i]))
			return true;
	return false;
}

static void append_number(struct incise_rig_key *key, double value, bool optional)
{
	if (value != 0 || !optional)
		append_numbers(key, &value, 1);
}

/* @setting: where it is given, or NULL. */
static void append_field(struct incise_rig_key *key, const struct field *field,
			 const void *of, const config_setting_t *setting)
{
	const void *at = (const char *)of + field->offset;
	const int *whole = at;
	const char *word;

	switch (field->kind) {
	case REAL:
		append_number(key, *(const double *)at, field->optional);
		break;
	case WHOLE:
		append_number(key, *whole, field->optional);
		break;
	case NATURAL:
		append_number(key, *(const uint32_t *)at, field->optional);
		break;
	case BYTE:
		append_number(key, *(const uint8_t *)at, field->optional);
		break;
	case TRUTH:
		append(key, "%s", *(const bool *)at ? "true" : "false");
		break;
	case VECTOR:
		append_array(key, at, 3);
		break;
	case PAIR:
		append_array(key, (double[]){whole[0], whole[1]}, 2);
		break;
	case BOX:
		if (((const struct incise_vision_box *)at)->width)
			append_array(key,
				     (double[]){whole[0], whole[1], whole[2], whole[3]},
				     4);
		break;
	case TEXT:
		if (*(const char *)at)
			append_text(key, at);
		break;
	case WORD:
		word = setting ? config_setting_get_string(setting) : NULL;
		append_text(key, word ? word : field->word);
		break;
	}
}

/* --- the list --- */

/* Whether the shorthand has KEY=…, or for motion the word mouse. */
static bool in_shorthand(const char *spec, const char *key)
{
	size_t length = strlen(key);

	if (!strncmp(key, "sim.", 4))
		return in_shorthand(spec, key + 4);
	for (const char *word = spec + 3; word; word = strchr(word, ',')) {
		word++;
		if ((!strncmp(word, key, length) && word[length] == '=') ||
		    (!strcmp(key, "motion") && !strncmp(word, "mouse", 5) &&
		     (!word[5] || word[5] == ',')))
			return true;
	}
	return false;
}

/* A key that is given at @setting, or not with NULL; its value is to be appended. */
static struct incise_rig_key begin(const struct list *list,
				   const config_setting_t *setting, const char *prefix,
				   const char *name)
{
	struct incise_rig_key key = {.given = setting};

	snprintf(key.name, sizeof(key.name), "%s%s%s", prefix, *prefix ? "." : "", name);
	if (setting)
		key.line = config_setting_source_line(setting);
	if (!list->root)
		key.given = in_shorthand(list->spec, key.name);
	return key;
}

static void end(struct list *list, const struct incise_rig_key *key)
{
	if (!list->rc)
		list->rc = list->found(list->context, key);
}

static const config_setting_t *member(const config_setting_t *group, const char *name)
{
	return group ? config_setting_get_member(group, name) : NULL;
}

static const struct field *field_of(const struct field *fields, size_t n,
				    const char *name)
{
	for (size_t i = 0; i < n; i++)
		if (!strcmp(fields[i].name, name))
			return &fields[i];
	return NULL;
}

/* One of tracker_setup …, surface. */
static void plan_key(struct list *list, const char *prefix, const char *name)
{
	const struct incise_tracker_setup *tracker = &list->plan->tracker;
	const config_setting_t *setting = member(member(list->root, prefix), name);
	struct incise_rig_key key = begin(list, setting, prefix, name);
	const struct field *field = field_of(
		plan_fields, sizeof(plan_fields) / sizeof(*plan_fields), key.name);
	double stations[4];

	if (field) {
		append_field(&key, field, list->plan, setting);
	} else if (!strcmp(key.name, "tracker_setup.stations")) {
		for (int i = 0; i < tracker->n_stations; i++)
			stations[i] = tracker->stations[i];
		append_array(&key, stations, tracker->n_stations);
	}
	end(list, &key);
}

static void lines(struct list *list, const struct incise_actuator *actuator,
		  const config_setting_t *group, const char *prefix)
{
	const config_setting_t *setting;
	struct incise_rig_key key;
	int n = 0;

	for (int i = 0; i < INCISE_LINES; i++) {
		const char *name = incise_actuator_line_keys[i];

		setting = member(group, name);
		key = begin(list, setting, prefix, name);
		if (setting)
			append_number(&key, actuator->line[i], false);
		end(list, &key);
	}
	setting = member(group, incise_actuator_line_keys[INCISE_LINES]);
	key = begin(list, setting, prefix, incise_actuator_line_keys[INCISE_LINES]);
	append(&key, "[");
	for (int i = 0; i < INCISE_LINES; i++)
		if (actuator->active_low & 1u << i) {
			append(&key, "%s", n++ ? ", " : "");
			append_text(&key, incise_actuator_line_keys[i]);
		}
	append(&key, "]");
	end(list, &key);
}

/* @inner: "" or "can." */
static void actuator_key(struct list *list, int axis, const char *inner, const char *name,
			 const config_setting_t *group, const char *prefix)
{
	const struct incise_actuator *actuator = &list->plan->actuator[axis];
	const config_setting_t *setting = member(group, name);
	struct incise_rig_key key = begin(list, setting, prefix, name);
	const struct field *field;
	char full[80];
	double value;

	snprintf(full, sizeof(full), "%s%s", inner, name);
	field = field_of(actuator_fields,
			 sizeof(actuator_fields) / sizeof(*actuator_fields), full);
	if (field)
		append_field(&key, field, actuator, setting);
	else if (incise_actuator_number(actuator, full, &value))
		append_number(&key, value, is_optional(full));
	else if (!strcmp(full, "can.cycle_us"))
		append_number(&key, actuator->can.cycle_ns / 1000.0, false);
	else if (!strcmp(full, "direction") && axis < list->plan->n_axes)
		append_array(&key, list->plan->direction[axis], 3);
	end(list, &key);
}

/* The device's string, or NULL. */
static const char *device_of(const struct list *list, int slot)
{
	const config_setting_t *setting =
		member(list->root, incise_kind_name[slot_kind(slot)]);

	if (!list->root)
		return "sim:";
	if (setting && config_setting_is_aggregate(setting))
		return config_setting_get_string_elem(setting, slot - KIND_STEPPER);
	return setting && slot <= KIND_STEPPER ? config_setting_get_string(setting)
					       : NULL;
}

static bool starts(const char *device, const char *backend)
{
	return device && !strncmp(device, backend, strlen(backend));
}

static bool is_real(const char *device)
{
	return device && !starts(device, "sim:");
}

static void actuator(struct list *list, int axis, bool several)
{
	const config_setting_t *group = member(list->root, "actuator"), *inner;
	const char *device = device_of(list, KIND_STEPPER + axis);
	char prefix[40], name[60];

	if (group && config_setting_is_list(group))
		group = config_setting_get_elem(group, axis);
	snprintf(prefix, sizeof(prefix), several ? "actuator[%d]" : "actuator", axis + 1);
	for (int i = 0; incise_actuator_keys[i]; i++)
		if (strcmp(incise_actuator_keys[i], "lines") &&
		    strcmp(incise_actuator_keys[i], "can"))
			actuator_key(list, axis, "", incise_actuator_keys[i], group,
				     prefix);
	inner = member(group, "lines");
	snprintf(name, sizeof(name), "%s.lines", prefix);
	if (inner)
		lines(list, &list->plan->actuator[axis], inner, name);
	inner = member(group, "can");
	snprintf(name, sizeof(name), "%s.can", prefix);
	if (inner || starts(device, "can:") || starts(device, "slcan:"))
		for (int i = 0; incise_actuator_can_keys[i]; i++)
			actuator_key(list, axis, "can.", incise_actuator_can_keys[i],
				     inner, name);
}

static void devices(struct list *list)
{
	for (int slot = 0; slot < N_SLOTS; slot++) {
		const char *name = incise_kind_name[slot_kind(slot)];
		const char *device = device_of(list, slot);
		const config_setting_t *setting = member(list->root, name);
		bool several = list->plan->n_axes > 1 && is_real(device);
		struct incise_rig_key key;
		char numbered[40];

		if (slot > KIND_STEPPER && (!device || !several))
			continue;
		if (slot >= KIND_STEPPER && several)
			snprintf(numbered, sizeof(numbered), "%s[%d]", name,
				 slot - KIND_STEPPER + 1);
		else
			snprintf(numbered, sizeof(numbered), "%s", name);
		key = begin(list, setting, "", numbered);
		key.given = device;
		if (device)
			append_text(&key, device);
		end(list, &key);
	}
}

static void sim(struct list *list)
{
	const config_setting_t *group = member(list->root, "sim");
	const struct incise_sim_config *config = &list->plan->config;
	double values[INCISE_SIM_DEPTHS_MAX];
	const char *name, *word;
	int n;

	for (int i = 0; (n = incise_sim_config_get(config, i, &name, values, &word));
	     i++) {
		struct incise_rig_key key = begin(list, member(group, name), "sim", name);

		if (word)
			append_text(&key, word);
		else if (!strcmp(name, "depth_mm") || !strcmp(name, "times"))
			append_array(&key, values, n);
		else
			append_numbers(&key, values, n);
		end(list, &key);
	}
}

/* Whether the keys of a group apply: it is given, or its device is there. */
static bool applies(const struct list *list, const char *group)
{
	return member(list->root, group) ||
	       (!strcmp(group, "tracker_setup") &&
		is_real(device_of(list, KIND_TRACKER))) ||
	       (!strcmp(group, "force_setup") && is_real(device_of(list, KIND_FORCE))) ||
	       (!strcmp(group, "camera_setup") &&
		is_real(device_of(list, KIND_CAMERA))) ||
	       (!strcmp(group, "vision") && list->plan->has_vision);
}

static void all(struct list *list)
{
	struct incise_rig_key clock =
		begin(list, member(list->root, "clock"), "", "clock");
	int n = list->plan->n_actuators;

	append_text(&clock, list->plan->simulated ? "simulated" : "real");
	end(list, &clock);
	devices(list);
	plan_key(list, "surface", "point_mm");
	plan_key(list, "surface", "normal");
	for (int i = 0; i < INCISE_RIG_GROUPS; i++)
		for (int k = 0; incise_rig_groups[i].keys[k] &&
				applies(list, incise_rig_groups[i].name);
		     k++)
			plan_key(list, incise_rig_groups[i].name,
				 incise_rig_groups[i].keys[k]);
	for (int i = 0; i < n; i++)
		actuator(list, i, n > 1);
	if (member(list->root, "sign_key")) {
		struct incise_rig_key key =
			begin(list, member(list->root, "sign_key"), "", "sign_key");

		append_text(&key, list->plan->sign_key);
		end(list, &key);
	}
	if (list->plan->sim || member(list->root, "sim"))
		sim(list);
}

int incise_rig_keys(const char *spec, incise_rig_key_found *found, void *context,
		    struct incise_error *err)
{
	bool shorthand = !strncmp(spec, "sim:", 4);
	struct incise_c_locale locale;
	struct incise_rig_plan plan;
	config_t config;
	struct list list = {
		.spec = spec, .plan = &plan, .found = found, .context = context};
	int rc = incise_rig_plan_read(&plan, spec, 0, err);

	if (!rc && !shorthand)
		rc = incise_conf_read(&config, spec, err);
	if (!rc) {
		if (!shorthand)
			list.root = config_root_setting(&config);
		locale = incise_c_locale_begin();
		all(&list);
		incise_c_locale_end(locale);
		if (!shorthand)
			config_destroy(&config);
		rc = list.rc;
	}
	incise_rig_plan_free(&plan);
	return rc;
}
