// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The calibration that a command uses; see calibration.h.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/rig.h>
#include "calibration.h"
#include "file_kind.h"
#include "json.h"

const char *calibration_default(void)
{
	static const char *const places[] = {"calibration.conf",
					     "/etc/incise/calibration.conf", NULL};
	const char *const *place = places;

	while (*place && access(*place, F_OK))
		place++;
	return *place;
}

static int add_device(void *context, const struct incise_key *key)
{
	static const struct {
		const char *key;
		unsigned int device;
	} devices[] = {
		{"tracker", INCISE_RIG_TRACKER}, {"force", INCISE_RIG_FORCE},
		{"camera", INCISE_RIG_CAMERA},	 {"stepper", INCISE_RIG_STEPPER},
		{"haptic", INCISE_RIG_HAPTIC},
	};
	unsigned int *has = context;

	for (size_t i = 0; i < sizeof(devices) / sizeof(*devices); i++) {
		if (strcmp(key->name, devices[i].key) || strlen(key->value) < 3)
			continue;
		*has |= devices[i].device;
		if (strncmp(key->value, "\"sim:", 5))
			*has &= ~CALIBRATION_SIMULATED;
	}
	return 0;
}

unsigned int calibration_devices(const char *rig, struct incise_error *err)
{
	unsigned int has = CALIBRATION_SIMULATED;

	return incise_rig_keys(rig, add_device, &has, err) ? 0 : has;
}

bool calibration_needed(const char *kind, unsigned int devices)
{
	/* It needs all of these devices, and none of the others. */
	static const struct {
		const char *kind;
		unsigned int needs, without;
	} kinds[] = {
		{"force", INCISE_RIG_FORCE, 0},
		{"depth", INCISE_RIG_CAMERA, 0},
		{"tip", INCISE_RIG_TRACKER, INCISE_RIG_HAPTIC},
		{"delay", INCISE_RIG_TRACKER | INCISE_RIG_FORCE, INCISE_RIG_HAPTIC},
		{"stepper", INCISE_RIG_STEPPER, INCISE_RIG_HAPTIC},
		{"frame", INCISE_RIG_HAPTIC, 0},
	};

	for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++)
		if (!strcmp(kind, kinds[i].kind))
			return (devices & kinds[i].needs) == kinds[i].needs &&
			       !(devices & kinds[i].without);
	return false;
}

void calibration_use(struct calibration_used *used, const char *given, const char *rig)
{
	struct incise_calibration_record *records = NULL;
	struct incise_error err = {0};
	int n;

	*used = (struct calibration_used){.path = given ? given : calibration_default()};
	incise_calibration_nominal(&used->values);
	if (used->path && !strcmp(used->path, "none"))
		used->path = NULL;
	if (!used->path) {
		if (rig && !given && strncmp(rig, "sim:", 4))
			cli_warn("nominal values: not calibrated; 'incise calibrate' "
				 "makes calibration.conf, and -c none accepts them");
		return;
	}
	cli_input(used->path);
	file_expect(used->path, FILE_CALIBRATION);
	cli_check(incise_calibration_load(used->path, &used->values, &err), &err);
	n = incise_calibration_history(used->path, &records, &err);
	if (n > 0)
		snprintf(used->date, sizeof(used->date), "%s", records[n - 1].date);
	free(records);
}

const char *calibration_text(const struct calibration_used *used)
{
	static char text[400];

	if (!used->path)
		return "nominal values";
	snprintf(text, sizeof(text), "%.300s%s%.10s", used->path,
		 *used->date ? " of " : "", used->date);
	return text;
}

json_t *calibration_json(const struct calibration_used *used)
{
	if (!used->path)
		return json_null();
	return json_pack("{so so}", "path", json_text(used->path), "date",
			 *used->date ? json_string(used->date) : json_null());
}
