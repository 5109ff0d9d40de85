/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The members of a joined recording, for people and as JSON.
 */
#ifndef INCISE_TOOLS_JOINED_REPORT_H
#define INCISE_TOOLS_JOINED_REPORT_H

#include <jansson.h>
#include <incise/session.h>
#include "cli.h"

/* Units of --tolerance: s, ms, us, ns. */
extern const struct cli_unit joined_times[];

void joined_print(const struct incise_session_info *members, int n);
json_t *joined_json(const struct incise_session_info *members, int n);

#endif
