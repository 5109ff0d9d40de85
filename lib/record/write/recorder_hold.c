// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recorder that is armed: what comes is held for a second, and the oldest goes, until the
 * trigger writes all that is held; see recorder.h.
 *
 *     ─────────────[── 1 s held ──]▼ trigger
 *                   recording ─────────────────────►
 *
 * What triggers is seen late, by the way of the sample and by a poll: the second before it
 * holds its beginning.
 */
#include <errno.h>
#include <math.h>
#include "recorder.h"

/* More than a second at any rate that is near the nominal one. */
static size_t room(double rate_hz)
{
	return rate_hz > 0 && rate_hz < 1e6 ? (size_t)ceil(rate_hz * 1.1) + 16 : 100000;
}

int incise_recorder_hold(struct incise_recorder *rec)
{
	int rc = incise_ring_init(&rec->hold.force,
				  sizeof(struct incise_recorder_force_row),
				  room(rec->force_info.rate_hz));

	if (!rc)
		rc = incise_ring_init(&rec->hold.tracker,
				      sizeof(struct incise_recorder_tracker_row),
				      room(rec->tracker_info.rate_hz));
	rec->stats.armed = !rc;
	return rc;
}

void incise_recorder_hold_free(struct incise_recorder *rec)
{
	incise_ring_free(&rec->hold.force);
	incise_ring_free(&rec->hold.tracker);
}

void incise_recorder_hold_force(struct incise_recorder *rec,
				const struct incise_recorder_force_row *row)
{
	struct incise_recorder_force_row oldest;

	while (!incise_ring_put(&rec->hold.force, row))
		incise_ring_take(&rec->hold.force, &oldest, 1);
}

void incise_recorder_hold_tracker(struct incise_recorder *rec,
				  const struct incise_recorder_tracker_row *row)
{
	struct incise_recorder_tracker_row oldest;

	while (!incise_ring_put(&rec->hold.tracker, row))
		incise_ring_take(&rec->hold.tracker, &oldest, 1);
}

/* Both begin at one time, whatever the rings have room for. */
int incise_recorder_release(struct incise_recorder *rec, struct incise_error *err)
{
	int64_t now_ns = incise_clock_now(incise_rig_clock(rec->rig));
	int64_t from_ns = now_ns - INCISE_NS_PER_S;
	struct incise_recorder_tracker_row tracker;
	struct incise_recorder_force_row force;
	int rc = 0;

	rec->stats.armed = false;
	rec->not_finite = 0;
	rec->streams[INCISE_LEDGER_FORCE].lost_at_start =
		incise_force_lost(incise_rig_force(rec->rig));
	rec->streams[INCISE_LEDGER_TRACKER].lost_at_start =
		incise_tracker_lost(incise_rig_tracker(rec->rig));
	if (incise_recorder_note(rec, "trigger", "triggered; it begins 1 s before") !=
	    SQLITE_OK)
		return incise_recorder_fail(rec, err);
	while (!rc && incise_ring_take(&rec->hold.force, &force, 1))
		if (force.t_ns >= from_ns)
			rc = incise_recorder_write_force(rec, &force, err);
	while (!rc && incise_ring_take(&rec->hold.tracker, &tracker, 1))
		if (tracker.t_ns >= from_ns)
			rc = incise_recorder_write_tracker(rec, &tracker, err);
	/* The device counts from here; what is missing in the second before was lost too. */
	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++)
		rec->streams[i].gaps_held = rec->streams[i].gaps;
	incise_recorder_hold_free(rec);
	if (!rc)
		rc = incise_recorder_start_camera(rec, err);
	return rc;
}
