/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The seal of a recording, for people and as JSON. It is read, not verified: incise verify does that.
 */
#ifndef INCISE_SEAL_REPORT_H
#define INCISE_SEAL_REPORT_H

#include <jansson.h>

/* A list with the seal of a recording, or of each member of a joined one. Every failure ends the program. */
json_t *seal_report_json(const char *path);

/* A line for each. */
void seal_report_print(const json_t *list);

#endif
