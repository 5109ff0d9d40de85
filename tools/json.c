// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Reports as JSON; see json.h.
 */
#include <math.h>
#include <stdio.h>
#include "cli.h"
#include "json.h"

json_t *json_number(double value)
{
	return isfinite(value) ? json_real(value) : json_null();
}

void json_print(json_t *object)
{
	json_dumpf(object, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
	putchar('\n');
	json_decref(object);
	cli_finish();
}
