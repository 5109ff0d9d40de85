/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What incise capture has recorded: told, and judged.
 */
#ifndef INCISE_CAPTURE_REPORT_H
#define INCISE_CAPTURE_REPORT_H

#include <stdbool.h>
#include <incise/recorder.h>

struct capture_result {
	const char *path;
	double seconds;		   /* recorded */
	struct incise_error early; /* why it ended by itself; code 0: it did not */
	struct incise_recorder_stats stats;
};

/* On standard output, as text or JSON. */
void capture_report(const struct capture_result *result, bool json);

/* Whatever is not as it should be is exit 1, with one line that says what. */
void capture_judge(const struct capture_result *result);

#endif
