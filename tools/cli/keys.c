// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The keys of a rig.conf or a scene as a report; see keys.h.
 */
#include <stdio.h>
#include <stdlib.h>
#include "cli.h"
#include "json.h"
#include "keys.h"

int keys_add(void *context, const struct incise_key *key)
{
	struct keys *keys = context;

	keys->key = cli_resize(keys->key, keys->n + 1, sizeof(*keys->key));
	keys->key[keys->n++] = *key;
	return 0;
}

/* "rig.conf:7", "sim:" or "default" */
static char *origin_of(const struct incise_key *key, const char *path)
{
	if (!key->given)
		return cli_text("default");
	return key->line ? cli_text("%s:%d", path, key->line) : cli_text("sim:");
}

/* Columns that a UTF-8 text takes on a terminal. */
static int width_of_keys(const char *text)
{
	int width = 0;

	for (; *text; text++)
		width += (*text & 0xc0) != 0x80;
	return width;
}

void keys_print(const struct keys *keys, const char *path, bool all)
{
	int longest = 0;

	for (size_t i = 0; i < keys->n; i++)
		if (width_of_keys(keys->key[i].name) > longest)
			longest = width_of_keys(keys->key[i].name);
	printf("%-*s %-24s %s\n", longest, "key", "value", "from");
	for (size_t i = 0; i < keys->n; i++) {
		const struct incise_key *key = &keys->key[i];
		const char *unit = *key->value ? key->unit : "";
		char *value, *origin;

		if (!all && !key->given)
			continue;
		value = cli_text("%s%s%s", *key->value ? key->value : "-",
				 *unit ? " " : "", unit);
		origin = origin_of(key, path);
		printf("%-*s %s%*s %s\n", longest, key->name, value,
		       width_of_keys(value) < 24 ? 24 - width_of_keys(value) : 0, "",
		       origin);
		free(value);
		free(origin);
	}
}

static json_t *value_of(const char *text)
{
	json_t *value = *text ? json_loads(text, JSON_DECODE_ANY, NULL) : json_null();

	/* Text of the file that is no UTF-8. */
	return value ? value : json_text(text);
}

json_t *keys_json(const struct keys *keys, const char *path, bool all)
{
	json_t *list = json_array();

	for (size_t i = 0; i < keys->n; i++) {
		const struct incise_key *key = &keys->key[i];
		char *origin = origin_of(key, path);

		if (all || key->given)
			json_array_append_new(
				list, json_pack("{s:s, s:o, s:o, s:o}", "key", key->name,
						"value", value_of(key->value), "unit",
						*key->unit ? json_string(key->unit)
							   : json_null(),
						"from", json_text(origin)));
		free(origin);
	}
	return list;
}
