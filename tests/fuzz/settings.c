// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A text as a group of one of the tables of settings, which its first byte chooses: what is accepted is
 * printed as a text that is accepted, and printed the same again.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/rig/actuator.h"
#include "../../lib/scene/scene.h"
#include "../../lib/sim/sim.h"

#define STRUCT_MOST 16384

struct printed {
	char text[20000];
	const struct incise_setting *rows;
};

static int print_key(void *context, const struct incise_key *key)
{
	struct printed *to = context;
	size_t used = strlen(to->text);

	if (*key->value && incise_setting_of(to->rows, key->name)->kind != SETTING_IS_OWN)
		snprintf(to->text + used, sizeof(to->text) - used, "%s = %s;\n",
			 key->name, key->value);
	return 0;
}

/* Read a text onto the defaults, and print what there is then; false: it is refused. */
static bool pass(const struct incise_setting *rows, const char *text, size_t size,
		 struct printed *printed)
{
	static _Alignas(16) char values[STRUCT_MOST];
	struct incise_settings_list list = {.found = print_key, .context = printed};
	struct incise_error err = {0};
	char *copy = malloc(size + 1);
	config_t config;
	int rc;

	memcpy(copy, text, size);
	copy[size] = '\0';
	memset(values, 0, sizeof(values));
	incise_settings_init(rows, values);
	rc = incise_conf_read_text(&config, "input", copy, size, &err);
	if (!rc) {
		rc = incise_settings_read(rows, config_root_setting(&config), "input",
					  values, &err);
		*printed = (struct printed){.rows = rows};
		incise_settings_list(&list, rows, values, NULL, "");
		config_destroy(&config);
	}
	free(copy);
	if (rc && !err.code)
		abort();
	return !rc;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static struct printed once, again;
	struct incise_setting tissue[SETTING_ROWS_MAX + 1];
	const struct incise_setting *const tables[] = {
		incise_sim_settings, incise_actuator_settings, tissue,
		incise_scene_surface_settings("capsule")};
	const struct incise_setting *rows;

	_Static_assert(sizeof(struct incise_scene) <= STRUCT_MOST, "raise it");
	if (size < 2)
		return 0;
	incise_scene_tissue_settings(tissue);
	rows = tables[*data % 4];
	if (!pass(rows, (const char *)data + 1, size - 1, &once))
		return 0;
	if (!pass(rows, once.text, strlen(once.text), &again) ||
	    strcmp(once.text, again.text) != 0)
		abort();
	return 0;
}
