// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The group actuator.lines of rig.conf, of the backend gpio. In libincise, as rig.conf is read where the
 * module is not, too.
 */
#include <stddef.h>
#include <string.h>
#include "../../rig/actuator.h"

#define SETTINGS_OF struct incise_actuator

static int read_active_low(void *to, const config_setting_t *names, const char *path,
			   struct incise_error *err);

/* In the order of enum incise_actuator_line. */
const struct incise_setting incise_actuator_line_settings[] = {
	SETTING_WHOLE(step, line[INCISE_LINE_STEP], "", 0, 1023, "(required)",
		      "step pulses"),
	SETTING_WHOLE(dir, line[INCISE_LINE_DIR], "", 0, 1023, "(required)", "direction"),
	SETTING_WHOLE(enable, line[INCISE_LINE_ENABLE], "", 0, 1023, "(none)",
		      "power of the motor"),
	SETTING_WHOLE(limit_min, line[INCISE_LINE_LIMIT_MIN], "", 0, 1023, "(none)",
		      "limit switch at 0"),
	SETTING_WHOLE(limit_max, line[INCISE_LINE_LIMIT_MAX], "", 0, 1023, "(none)",
		      "limit switch at the end of the travel"),
	SETTING_WHOLE(home, line[INCISE_LINE_HOME], "", 0, 1023, "(none)", "home switch"),
	SETTING_WHOLE(estop, line[INCISE_LINE_ESTOP], "", 0, 1023, "(none)",
		      "emergency stop"),
	SETTING_WHOLE(alarm, line[INCISE_LINE_ALARM], "", 0, 1023, "(none)",
		      "fault output of the power stage"),
	SETTING_OWN(
		active_low, "", "(none)",
		"array of the lines that are active when low, for example [\"enable\"]; not a "
		"breaking contact to ground, whose broken wire must read as pressed: "
		"doc/hardware.md, Switches and emergency stop",
		.read = read_active_low),
	{0},
};

/* Names in active_low = ["enable"]; behind the names of the lines. */
static int read_active_low(void *to, const config_setting_t *names, const char *path,
			   struct incise_error *err)
{
	struct incise_actuator *actuator = to;
	bool list = config_setting_is_aggregate(names) && !config_setting_is_group(names);

	for (int i = 0; list && i < config_setting_length(names); i++) {
		const char *name = config_setting_get_string_elem(names, i);
		const struct incise_setting *row =
			name ? incise_setting_of(incise_actuator_line_settings, name)
			     : NULL;
		int k = row ? (int)(row - incise_actuator_line_settings) : INCISE_LINES;

		if (k >= INCISE_LINES || actuator->line[k] < 0)
			return incise_conf_error(names, NULL, path, err,
						 "names of lines of this group, not "
						 "\"%.40s\"",
						 name ? name : "?");
		actuator->active_low |= 1u << k;
	}
	return list ? 0
		    : incise_conf_error(names, NULL, path, err,
					"names such as [\"enable\"]");
}

int incise_actuator_lines_check(const struct incise_actuator *actuator,
				const config_setting_t *group, const char *path,
				struct incise_error *err)
{
	const config_setting_t *lines = config_setting_get_member(group, "lines");

	for (int i = 0; i < INCISE_LINES; i++)
		for (int k = 0; k < i; k++)
			if (actuator->line[i] >= 0 &&
			    actuator->line[k] == actuator->line[i])
				return incise_conf_error(
					lines, incise_actuator_line_settings[i].key, path,
					err, "another line than that of %s",
					incise_actuator_line_settings[k].key);
	return 0;
}
