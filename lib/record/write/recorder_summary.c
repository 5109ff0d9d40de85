// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Cuts, largest depth and largest force of a recording, while it is made: as readers find them of all
 * samples, but by the times of the capture; see recorder.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/grow.h"
#include "recorder.h"

/* Without a depth for so many samples none is near them. */
#define WAITING_MAX (1 << 18)

void incise_recorder_start_summary(struct incise_recorder_summary *summary)
{
	*summary = (struct incise_recorder_summary){
		.follow.before.t_ns = INCISE_TIME_NONE,
		.follow.after.t_ns = INCISE_TIME_NONE,
		.code_least = INT32_MAX,
		.code_most = INT32_MIN,
	};
}

void incise_recorder_follow_force(struct incise_recorder *rec, int64_t t_ns, int32_t code)
{
	struct incise_recorder_summary *summary = &rec->summary;

	if (!rec->streams[INCISE_LEDGER_TRACKER].exists)
		return;
	if (summary->capacity < WAITING_MAX)
		grow_array(&summary->waiting, summary->n, &summary->capacity, 1024,
			   sizeof(*summary->waiting));
	if (summary->n == summary->capacity)
		summary->n = 0;
	if (summary->capacity)
		summary->waiting[summary->n++] =
			(struct incise_recorder_force){t_ns, code};
}

static void take_force(struct incise_recorder_summary *summary,
		       const struct incise_recorder_force *force)
{
	struct incise_cut_sample sample = {.t_ns = force->t_ns};

	if (!incise_cut_between(&summary->follow, &sample))
		return;
	summary->depth_max_mm = fmax(summary->depth_max_mm, sample.depth_mm);
	if (force->code < summary->code_least)
		summary->code_least = force->code;
	if (force->code > summary->code_most)
		summary->code_most = force->code;
}

static void note_end(struct incise_recorder_summary *summary, int64_t t_ns)
{
	if (grow_array(&summary->ends_ns, summary->n_ends, &summary->ends_capacity, 64,
		       sizeof(*summary->ends_ns)))
		summary->ends_ns[summary->n_ends++] = t_ns;
	else
		summary->no_ends = true;
}

static void follow_by_depth(struct incise_recorder_summary *summary,
			    const struct incise_depth_row *row)
{
	const bool inside = summary->by_depth.inside;

	if (!incise_cut_step(&summary->by_depth, row->depth_mm) && inside)
		note_end(summary, row->t_ns);
}

void incise_recorder_follow_depth(struct incise_recorder *rec,
				  const struct incise_depth_row *row)
{
	struct incise_recorder_summary *summary = &rec->summary;
	struct incise_cut_follow *follow = &summary->follow;
	size_t k = 0;

	follow_by_depth(summary, row);
	follow->before = follow->after;
	follow->after =
		(struct incise_cut_depth){row->t_ns, row->depth_mm, row->velocity_mm_s};
	/* Without force, by the depths themselves. */
	if (!rec->streams[INCISE_LEDGER_FORCE].rows &&
	    incise_cut_step(&follow->cut, row->depth_mm))
		summary->depth_max_mm = fmax(summary->depth_max_mm, row->depth_mm);
	while (k < summary->n && summary->waiting[k].t_ns < row->t_ns)
		take_force(summary, &summary->waiting[k++]);
	summary->n -= k;
	if (k)
		memmove(summary->waiting, summary->waiting + k,
			summary->n * sizeof(*summary->waiting));
}

int incise_recorder_write_summary(struct incise_recorder *rec)
{
	const struct incise_recorder_summary *summary = &rec->summary;
	const double mV_N = rec->calibration.force_mV_N;
	const double mV = rec->force_info.offset_V * 1e3 - rec->stats.zero_mV +
			  (mV_N > 0 ? summary->code_most : summary->code_least) *
				  rec->force_info.full_scale_V * 1e3 /
				  (double)(1LL << rec->force_info.bits);
	const bool any = summary->code_most >= summary->code_least;
	int bad = incise_recorder_set_integer(rec, "cuts", summary->follow.cut.count);

	bad |= incise_recorder_set_real(rec, "depth_max_mm", summary->depth_max_mm);
	if (!summary->no_ends)
		bad |= incise_recorder_set_bytes(rec, "cut_ends_ns", summary->ends_ns,
						 summary->n_ends *
							 sizeof(*summary->ends_ns));
	/* Without a zero there is no force. */
	return bad |
	       incise_recorder_set_real(rec, "force_max_N", any ? fmax(0, mV / mV_N) : 0);
}
