// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise rig: prints which rig.conf the commands use here, and with --show every key that
 * applies, with its value, its unit and where it comes from. No device is opened.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/rig.h>
#include "cli/cli.h"
#include "cli/json.h"

struct options {
	const char *rig;
	bool show, json;
};

/* The keys of a rig, in the order of rig.conf(5). */
struct keys {
	struct incise_rig_key *key;
	size_t n;
};

static const struct cli_option option_table[] = {
	{0, "show", NULL, "print every key with its value, unit and origin",
	 CLI_FLAG(struct options, show)},
	{CLI_RIG_OPTION(struct options, rig)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "rig",
	.synopsis = "[--show] [--rig RIG] [--json]",
	.summary =
		"Print which rig.conf is used here, and with --show what it resolves to. "
		"No device is opened.",
	.options = option_table,
	.failure = "there is no rig.conf, or it is wrong",
};

/* Units of keys, by the ends of their names: the longest one counts. */
static const struct {
	const char *end, *unit;
} units[] = {
	{"_mm", "mm"},
	{"_N", "N"},
	{"_N_mm", "N/mm"},
	{"_N_mm2", "N/mm²"},
	{"_N_s_mm", "N s/mm"},
	{"_mm_s", "mm/s"},
	{"_mm_s2", "mm/s²"},
	{"_mm_s3", "mm/s³"},
	{"_s", "s"},
	{"_ms", "ms"},
	{"_us", "µs"},
	{"_hz", "Hz"},
	{"_V", "V"},
	{"_mV", "mV"},
	{"_mV_N", "mV/N"},
	{"_K", "K"},
	{"_kg", "kg"},
	{"_deg", "°"},
	{"_ppm", "ppm"},
	{"_px", "px"},
	{"_mm_px", "mm/px"},
	{"_1_s", "1/s"},
	{"_permille", "‰"},
	{"_permille_mm", "‰/mm"},
	{"_permille_s_mm", "‰ s/mm"},
	{"_per_turn", "1/turn"},
	{"_per_turn_s", "s/turn"},
	{"_per_turn_s2", "s²/turn"},
	{".bitrate", "bit/s"},
	{"camera_setup.width", "px"},
	{"camera_setup.height", "px"},
	{"vision.roi", "px"},
};

static const char *unit_of(const char *name)
{
	const char *unit = "";
	size_t longest = 0;

	/* steps_per_turn is a number of steps. */
	if (cli_ends_with(name, ".steps_per_turn"))
		return "";
	for (size_t i = 0; i < sizeof(units) / sizeof(*units); i++)
		if (strlen(units[i].end) > longest && cli_ends_with(name, units[i].end)) {
			longest = strlen(units[i].end);
			unit = units[i].unit;
		}
	return unit;
}

static int keep(void *context, const struct incise_rig_key *key)
{
	struct keys *keys = context;

	keys->key = cli_resize(keys->key, keys->n + 1, sizeof(*keys->key));
	keys->key[keys->n++] = *key;
	return 0;
}

/* "rig.conf:7", "sim:" or "default" */
static char *origin_of(const struct incise_rig_key *key, const char *rig)
{
	if (!key->given)
		return cli_text("default");
	return key->line ? cli_text("%s:%d", rig, key->line) : cli_text("sim:");
}

/* Columns that a UTF-8 text takes on a terminal. */
static int width_of(const char *text)
{
	int width = 0;

	for (; *text; text++)
		width += (*text & 0xc0) != 0x80;
	return width;
}

static void print(const struct options *options, const char *rig, const struct keys *keys)
{
	const char *reason;
	int longest = 0;

	printf("rig          %s\n", rig);
	for (int i = 0; !options->rig && (reason = cli_rig_passed_over(i)); i++)
		printf("passed over  %s\n", reason);
	for (size_t i = 0; i < keys->n; i++)
		if (width_of(keys->key[i].name) > longest)
			longest = width_of(keys->key[i].name);
	if (options->show)
		printf("\n%-*s %-24s %s\n", longest, "key", "value", "from");
	for (size_t i = 0; i < keys->n; i++) {
		const struct incise_rig_key *key = &keys->key[i];
		const char *unit = unit_of(key->name);
		char *value = cli_text("%s%s%s", *key->value ? key->value : "-",
				       *key->value && *unit ? " " : "",
				       *key->value ? unit : "");
		char *origin = origin_of(key, rig);

		printf("%-*s %s%*s %s\n", longest, key->name, value,
		       width_of(value) < 24 ? 24 - width_of(value) : 0, "", origin);
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

static void print_json(const struct options *options, const char *rig,
		       const struct keys *keys)
{
	json_t *object = json_pack("{s:o}", "rig", json_text(rig));
	json_t *passed_over = json_array(), *list = json_array();
	const char *reason;

	for (int i = 0; !options->rig && (reason = cli_rig_passed_over(i)); i++)
		json_array_append_new(passed_over, json_text(reason));
	json_object_set_new(object, "passed_over", passed_over);
	for (size_t i = 0; i < keys->n; i++) {
		const struct incise_rig_key *key = &keys->key[i];
		const char *unit = unit_of(key->name);
		char *origin = origin_of(key, rig);

		json_array_append_new(list,
				      json_pack("{s:s, s:o, s:o, s:o}", "key", key->name,
						"value", value_of(key->value), "unit",
						*unit ? json_string(unit) : json_null(),
						"from", json_text(origin)));
		free(origin);
	}
	if (options->show)
		json_object_set(object, "keys", list);
	json_decref(list);
	json_print(object);
}

int main(int argc, char **argv)
{
	struct options options = {0};
	struct incise_error err = {0};
	struct keys keys = {0};
	const char *rig;

	cli_parse(&command, argc, argv, &options);
	cli_no_operands(argc, argv, "a rig is named with --rig");
	rig = cli_rig(options.rig);
	if (incise_rig_keys(rig, keep, &keys, &err))
		cli_fail_with(&err);
	if (!options.show)
		keys.n = 0;
	if (options.json)
		print_json(&options, rig, &keys);
	else
		print(&options, rig, &keys);
	free(keys.key);
	cli_finish();
	return 0;
}
