/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a run of the loop leaves: the log of its ticks, and the report.
 */
#ifndef INCISE_HAPTIC_REPORT_H
#define INCISE_HAPTIC_REPORT_H

#include <incise/outfile.h>
#include "haptic.h"

/* Room for all ticks of a run that long, of half of this machine's memory at most. */
void haptic_make_log(double duration_s, struct incise_loop_options *loop);

/* Write them as CSV, under the file's final name. */
void haptic_write_log(struct incise_outfile *file, const struct incise_tick *ticks,
		      size_t n);

void haptic_report_json(const struct haptic *haptic);
void haptic_report_text(const struct haptic *haptic);

#endif
