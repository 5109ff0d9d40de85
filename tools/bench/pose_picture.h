/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pictures of incise bench pose: a panel per motion.
 */
#ifndef INCISE_POSE_PICTURE_H
#define INCISE_POSE_PICTURE_H

#include "bench_pose.h"

/* Error over the cost of a tick, NAME; over the tracker's rate, NAME-rates. */
void pose_picture_cost(const struct pose_table *rows, const char *folder,
		       const char *name);
void pose_picture_rates(const struct pose_table *rows, const char *folder,
			const char *name);

#endif
