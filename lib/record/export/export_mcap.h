/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A recording as messages for viewers: every row of force, tracker, depth and events, in
 * order of time, log_time = t_ns (CLOCK_MONOTONIC).
 */
#ifndef INCISE_EXPORT_MCAP_H
#define INCISE_EXPORT_MCAP_H

#include <stdio.h>
#include <incise/recording.h>
#include "lineage.h"

/* @report: rows are messages. Returns 0, -EINVAL, -EIO, -ENOSPC, -ENOMEM, -EINTR. */
int incise_export_mcap(struct incise_recording *recording,
		       const struct incise_export_options *options, FILE *out,
		       const struct incise_lineage *lineage,
		       struct incise_export_report *report, struct incise_error *err);

#endif
