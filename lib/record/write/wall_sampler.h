/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Wall time of a recording that is written: a point each second, read by a thread of its own, so
 * that a slow source holds up no sample.
 *
 *     clocks, chrony, ptp4l ──► thread, 1 Hz ──► points ──► take(): the recorder's poll
 */
#ifndef INCISE_WALL_SAMPLER_H
#define INCISE_WALL_SAMPLER_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include "../../signal/wall_follow.h"

struct incise_wall_sampler;

/*
 * @source as of incise_recorder_setup; @real: of a real clock. A simulated one has wall time only
 * where the source states it: *sampler is NULL otherwise. Asks a program that the source names,
 * for some seconds. Returns 0; -EINVAL (no such source, or not of this clock), -ENODATA (its
 * program does not answer), -ENOMEM, errno of pthread_create(3).
 */
int incise_wall_sampler_new(struct incise_wall_sampler **sampler, const char *source,
			    bool real, struct incise_error *err);

/* Get the points since the last call, at most @max; @now_ns: of the rig's clock. Returns n. */
int incise_wall_sampler_take(struct incise_wall_sampler *sampler, int64_t now_ns,
			     struct incise_wall_result *results, int max);

/* Add a last point and stop: some 0.1 s for each source that hangs. NULL is accepted. */
void incise_wall_sampler_stop(struct incise_wall_sampler *sampler, int64_t now_ns);

/* Stop and free. NULL is accepted. */
void incise_wall_sampler_free(struct incise_wall_sampler *sampler);

#endif
