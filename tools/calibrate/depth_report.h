/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a calibration of depth has found: as text, as JSON, and as the folder of --report.
 */
#ifndef INCISE_DEPTH_REPORT_H
#define INCISE_DEPTH_REPORT_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/calibrate_depth.h>
#include <incise/calibration.h>
#include "depth_data.h"

struct depth_result {
	const char *way; /* two-point, line, board */
	const struct incise_calibration_record *record;
	const struct depth_lengths *lengths; /* of two-point and line */
	const struct depth_corners *corners; /* of a board */
	const struct incise_depth_fit *fit;
	const struct incise_board_fit *board;
	const struct incise_board_views *views;
	const bool *inlier;
	const struct depth_source *source;
	bool refused; /* record->verdict says why */
	bool in_force;
};

void depth_report_text(const struct depth_result *result, FILE *out);
json_t *depth_report_json(const struct depth_result *result);

/* DIR with report.txt, report.json, fit.png and residuals.png, each as .svg too. */
void depth_report_folder(const struct depth_result *result, const char *folder);

#endif
