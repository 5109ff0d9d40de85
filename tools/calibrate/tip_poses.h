/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Poses of the tracker's sensor for incise calibrate tip: from a CSV file, a recording, or
 * the tracker itself.
 */
#ifndef INCISE_TIP_POSES_H
#define INCISE_TIP_POSES_H

#include <stddef.h>
#include <incise/calibrate_tip.h>
#include <incise/tracker.h>

struct tip_list {
	struct incise_tip_pose *poses;
	int n, room;
	int doubtful; /* records that the tracker itself doubts: left out */
};

/* Add a record. Fails the program without memory. */
void tip_list_add(struct tip_list *list, const struct incise_tracker_sample *sample);

/* Read PATH, a recording if it is a folder, else CSV. Fails the program. */
void tip_list_read(struct tip_list *list, const char *path);

/* Write them as CSV. Fails the program. */
void tip_list_write(const struct tip_list *list, const char *path);

#endif
