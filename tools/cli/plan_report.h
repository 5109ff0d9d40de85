/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A plan as a file, in words and as JSON: for incise compile and incise info.
 */
#ifndef INCISE_PLAN_REPORT_H
#define INCISE_PLAN_REPORT_H

#include <incise/plan_file.h>
#include "json.h"

void plan_report_text(const struct incise_plan_file_info *info);
json_t *plan_report_json(const struct incise_plan_file_info *info);

#endif
