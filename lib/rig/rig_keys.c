// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The keys of a rig with their values; see incise/rig.h.
 */
#include <stdio.h>
#include <string.h>
#include "../sim/sim.h"
#include "actuator.h"
#include "rig_plan.h"

struct rig_list {
	struct incise_settings_list list;
	const char *spec;
	const config_setting_t *root; /* NULL: @spec is a shorthand */
	const struct incise_rig_plan *plan;
	incise_key_found *found; /* of a shorthand: the caller's */
	void *context;
};

static const config_setting_t *member(const config_setting_t *group, const char *name)
{
	return group ? config_setting_get_member(group, name) : NULL;
}

/* The device's string, or NULL. */
static const char *device_of(const struct rig_list *rig, int slot)
{
	const config_setting_t *setting =
		member(rig->root, incise_kind_name[slot_kind(slot)]);

	if (!rig->root)
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

static void devices(struct rig_list *rig)
{
	for (int slot = 0; slot < N_SLOTS; slot++) {
		const char *name = incise_kind_name[slot_kind(slot)];
		const char *device = device_of(rig, slot);
		bool several = rig->plan->n_axes > 1 && is_real(device);
		char text[SETTING_TEXT_MAX] = "", numbered[40];

		if (slot > KIND_STEPPER && (!device || !several))
			continue;
		snprintf(numbered, sizeof(numbered),
			 slot >= KIND_STEPPER && several ? "%s[%d]" : "%s", name,
			 slot - KIND_STEPPER + 1);
		if (device)
			incise_setting_quoted(device, text, sizeof(text));
		incise_settings_put(&rig->list,
				    incise_setting_of(incise_rig_settings, name),
				    member(rig->root, name), "", numbered, text);
	}
}

static void actuator(struct rig_list *rig, int axis)
{
	const config_setting_t *group = member(rig->root, "actuator");
	const char *device = device_of(rig, KIND_STEPPER + axis);
	struct incise_actuator shown = rig->plan->actuator[axis];
	char prefix[40], inner[60];

	if (axis < rig->plan->n_axes && is_real(device))
		memcpy(shown.direction, rig->plan->direction[axis],
		       sizeof(shown.direction));
	if (group && config_setting_is_list(group))
		group = config_setting_get_elem(group, axis);
	snprintf(prefix, sizeof(prefix),
		 rig->plan->n_actuators > 1 ? "actuator[%d]" : "actuator", axis + 1);
	incise_settings_list(&rig->list, incise_actuator_settings, &shown, group, prefix);
	snprintf(inner, sizeof(inner), "%s.lines", prefix);
	if (member(group, "lines"))
		incise_settings_list(&rig->list, incise_actuator_line_settings, &shown,
				     member(group, "lines"), inner);
	snprintf(inner, sizeof(inner), "%s.tmc", prefix);
	if (member(group, "tmc"))
		incise_settings_list(&rig->list, incise_actuator_tmc_settings, &shown,
				     member(group, "tmc"), inner);
	snprintf(inner, sizeof(inner), "%s.can", prefix);
	if (member(group, "can") || starts(device, "can:") || starts(device, "slcan:"))
		incise_settings_list(&rig->list, incise_actuator_can_settings, &shown,
				     member(group, "can"), inner);
}

/* Whether the keys of a group apply: it is given, or its device is there. */
static bool applies(const struct rig_list *rig, const char *group)
{
	static const char *const of_kind[] = {"tracker_setup", "force_setup",
					      "camera_setup"};

	for (int kind = KIND_TRACKER; kind <= KIND_CAMERA; kind++)
		if (!strcmp(group, of_kind[kind]) && is_real(device_of(rig, kind)))
			return true;
	return member(rig->root, group) ||
	       (!strcmp(group, "haptic_setup") && member(rig->root, "haptic")) ||
	       !strcmp(group, "surface") ||
	       (!strcmp(group, "vision") && rig->plan->has_vision);
}

/* A text at the top level; without it, its key. */
static void text_key(struct rig_list *rig, const char *key)
{
	const config_setting_t *setting = member(rig->root, key);
	char text[SETTING_TEXT_MAX] = "";

	if (setting)
		incise_setting_quoted(config_setting_get_string(setting), text,
				      sizeof(text));
	incise_settings_put(&rig->list, incise_setting_of(incise_rig_settings, key),
			    setting, "", key, text);
}

static void all(struct rig_list *rig)
{
	const struct incise_setting *row = incise_rig_settings;
	char clock[40];

	incise_setting_text(row, rig->plan, clock, sizeof(clock));
	incise_settings_put(&rig->list, row, member(rig->root, row->key), "", row->key,
			    clock);
	devices(rig);
	text_key(rig, "haptic");
	for (; row->key; row++)
		if (row->kind == SETTING_IS_GROUP && applies(rig, row->key))
			incise_settings_list(&rig->list, row->rows, rig->plan,
					     member(rig->root, row->key), row->key);
	for (int i = 0; i < rig->plan->n_actuators; i++)
		actuator(rig, i);
	if (*rig->plan->sign_key)
		text_key(rig, "sign_key");
	if (rig->plan->sim || member(rig->root, "sim"))
		incise_settings_list(&rig->list, incise_sim_settings, &rig->plan->config,
				     member(rig->root, "sim"), "sim");
}

/* Whether the shorthand has KEY=…, or for motion the word mouse. */
static bool in_shorthand(const char *spec, const char *key)
{
	size_t length = strlen(key);

	for (const char *word = spec + 3; word; word = strchr(word, ',')) {
		word++;
		if ((!strncmp(word, key, length) &&
		     (word[length] == '=' || word[length] == '[')) ||
		    (!strcmp(key, "motion") && !strncmp(word, "mouse", 5) &&
		     (!word[5] || word[5] == ',')))
			return true;
	}
	return false;
}

/* A shorthand has no file: its words give the keys, and it has all devices. */
static int found_in_shorthand(void *context, const struct incise_key *key)
{
	const struct rig_list *rig = context;
	bool sim = !strncmp(key->name, "sim.", 4);
	struct incise_key copy = *key;

	copy.given = in_shorthand(rig->spec, key->name + (sim ? 4 : 0)) ||
		     !strcmp(key->value, "\"sim:\"");
	return rig->found(rig->context, &copy);
}

int incise_rig_keys(const char *spec, incise_key_found *found, void *context,
		    struct incise_error *err)
{
	bool shorthand = !strncmp(spec, "sim:", 4);
	struct incise_rig_plan plan;
	config_t config;
	struct rig_list rig = {
		.list = {.found = found, .context = context},
		.spec = spec,
		.plan = &plan,
		.found = found,
		.context = context,
	};
	int rc = incise_rig_plan_read(&plan, spec, 0, err);

	if (!rc && !shorthand)
		rc = incise_conf_read(&config, spec, err);
	if (shorthand)
		rig.list = (struct incise_settings_list){.found = found_in_shorthand,
							 .context = &rig};
	if (!rc) {
		if (!shorthand)
			rig.root = config_root_setting(&config);
		all(&rig);
		if (!shorthand)
			config_destroy(&config);
		rc = rig.list.rc;
	}
	incise_rig_plan_free(&plan);
	return rc;
}

bool incise_rig_has_key(const char *key)
{
	return incise_setting_of(incise_rig_settings, key);
}
