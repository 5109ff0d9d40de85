/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench pose: how far off the pose is that the loop is given, over the tracker's rate
 * and delay and over what it costs.
 */
#ifndef INCISE_BENCH_POSE_H
#define INCISE_BENCH_POSE_H

#include <stdbool.h>
#include "harness.h"
#include "pose_error.h"

struct pose_row {
	const char *name;
	struct pose_condition condition;
	struct pose_error error;
	struct harness_time time; /* of a tick, with the poses that come meanwhile */
};

/* Rows of a condition stand together: the methods, and the exact pose. */
#define POSE_ROWS (POSE_METHODS + 1)

struct pose_table {
	struct pose_row *row;
	int n;
};

/* Writes the report to standard output, and with @plot a chart of that name. */
void bench_pose(bool json, bool quick, const char *plot);

#endif
