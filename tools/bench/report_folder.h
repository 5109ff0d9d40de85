/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The folder of a report. A new one is made within, hidden, and takes the old one's place
 * when it is whole:
 *
 *     DIR/.unfinished/{data,pictures,report.*}  ─▶  DIR/{data,pictures,report.*}
 */
#ifndef INCISE_REPORT_FOLDER_H
#define INCISE_REPORT_FOLDER_H

#include <jansson.h>
#include <stdbool.h>
#include <incise/error.h>

struct report_folder {
	const char *path;
	char *unfinished;
	bool made; /* by us */
};

/* Make room for a report; fails the program when there is something else at that path. */
void report_folder_begin(struct report_folder *folder, const char *path);

/* Put the new report in the old one's place, or forget it. */
void report_folder_finish(struct report_folder *folder);
void report_folder_abandon(struct report_folder *folder);

/* Its report.json; fails the program where there is none. */
json_t *report_folder_load(const char *path);

/* report.json as given, report.html and report.md of it, each of them whole or not at all.
 * 0 or a negative errno, and the reason. */
int report_folder_write(const char *path, const json_t *report, struct incise_error *err);

#endif
