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
#include "cli/keys.h"

struct options {
	const char *rig;
	bool show, json;
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

int main(int argc, char **argv)
{
	struct options options = {0};
	struct incise_error err = {0};
	struct keys keys = {0};
	json_t *passed_over = json_array(), *report;
	const char *rig, *reason;

	cli_parse(&command, argc, argv, &options);
	cli_no_operands(argc, argv, "a rig is named with --rig");
	rig = cli_rig(options.rig);
	if (incise_rig_keys(rig, keys_add, &keys, &err))
		cli_fail_with(&err);
	if (!options.json)
		printf("rig          %s\n", rig);
	for (int i = 0; !options.rig && (reason = cli_rig_passed_over(i)); i++) {
		if (!options.json)
			printf("passed over  %s\n", reason);
		json_array_append_new(passed_over, json_text(reason));
	}
	report = json_pack("{s:o, s:o}", "rig", json_text(rig), "passed_over",
			   passed_over);
	if (options.show && options.json) {
		json_object_set_new(report, "keys", keys_json(&keys, rig, true));
	} else if (options.show) {
		puts("");
		keys_print(&keys, rig, true);
	}
	if (options.json)
		json_print(report);
	else
		json_decref(report);
	free(keys.key);
	cli_finish();
	return 0;
}
