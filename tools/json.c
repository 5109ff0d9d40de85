// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Reports as JSON; see json.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "json.h"

json_t *json_number(double value)
{
	return isfinite(value) ? json_real(value) : json_null();
}

json_t *json_text(const char *text)
{
	json_t *string = json_string(text);
	char *clean;

	if (string)
		return string;
	clean = strdup(text);
	for (char *c = clean; c && *c; c++)
		if ((unsigned char)*c >= 0x80)
			*c = '?';
	string = clean ? json_string(clean) : NULL;
	free(clean);
	return string;
}

void json_print(json_t *object)
{
	/* A part that could not be made makes the whole NULL. */
	if (!object)
		cli_fail(
			"the report cannot be written as JSON: no memory, or a name that is "
			"not UTF-8");
	json_dumpf(object, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
	putchar('\n');
	json_decref(object);
	cli_finish();
}
