/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise calibrate tip: its data, result and report.
 */
#ifndef INCISE_CALIBRATE_TIP_TOOL_H
#define INCISE_CALIBRATE_TIP_TOOL_H

#include <incise/calibrate_tip.h>
#include "calibrate.h"

struct tip {
	struct calibrate common;
	double time_s;	     /* 0: not given */
	double u_surface_mm; /* NAN: not given */
	struct incise_tip_pose *poses;
	int n;
	int doubtful; /* left out: the tracker marked them */
	struct incise_tip_fit fit;
	bool *inlier; /* n */
};

/* As struct calibrate_kind has them. */
void tip_text(const void *run, FILE *out);
json_t *tip_json(const void *run);
void tip_draw(const void *run, const char *folder);

#endif
