// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The force that the owner of a haptic device gives; see haptic_page.h.
 */
#include <math.h>
#include "../base/vector.h"
#include "haptic_backend.h"
#include "haptic_page.h"

/* Without a decision for so long the device may have dropped the force by itself. */
#define GAP_NS INCISE_HAPTIC_PAGE_PERIOD_NS

static INCISE_REALTIME const char *judge_half(
	const struct incise_haptic_page_user *before,
	const struct incise_haptic_page_user *half, int64_t now_ns)
{
	if (!half->heartbeat_ns)
		return "none";
	if (half->wants > INCISE_HAPTIC_PAGE_END || !v3_finite(half->force_N) ||
	    !v3_finite(half->torque_N_mm) || half->period_ns <= 0 ||
	    half->period_ns > INCISE_HAPTIC_PAGE_PERIOD_NS)
		return "invalid";
	if ((int32_t)(half->seq - before->seq) < 0)
		return "back";
	if (half->heartbeat_ns < 0 || half->heartbeat_ns > now_ns)
		return "time";
	return NULL;
}

/* Periods of the user since its last heartbeat. */
static INCISE_REALTIME double count_periods(const struct incise_haptic_page_user *half,
					    int64_t now_ns)
{
	return half->period_ns
		       ? (double)(now_ns - half->heartbeat_ns) / (double)half->period_ns
		       : HUGE_VAL;
}

/* A ramp since the last decision; after a gap from 0. */
static INCISE_REALTIME void ramp_up(struct haptic_gate *gate, int64_t now_ns)
{
	int64_t step_ns = now_ns - gate->now_ns;

	if (!gate->now_ns || step_ns > (gate->gap_ns > GAP_NS ? gate->gap_ns : GAP_NS) ||
	    step_ns < 0)
		gate->share = 0;
	else
		gate->share = fmin(1, gate->share + (double)step_ns /
							    INCISE_HAPTIC_PAGE_RAMP_NS);
}

const char *incise_haptic_gate(struct haptic_gate *gate,
			       const struct incise_haptic_page_user *half, int64_t now_ns,
			       double force_N[3], double torque_N_mm[3])
{
	const char *why = half ? judge_half(&gate->last, half, now_ns) : "torn";
	double periods;

	if (half && !why)
		gate->last = *half;
	periods = count_periods(&gate->last, now_ns);
	if (half && !why && half->wants != INCISE_HAPTIC_PAGE_FORCE)
		why = "off";
	if (!(periods >= 0 && periods <= 2))
		why = why ? why : "late";
	if (!why)
		ramp_up(gate, now_ns);
	else if (!half && gate->last.wants == INCISE_HAPTIC_PAGE_FORCE)
		gate->share = fmin(gate->share, fmax(0, 2 - periods));
	else
		gate->share = 0;
	gate->now_ns = now_ns;
	incise_haptic_limit(force_N, gate->last.force_N, gate->share, gate->peak_N);
	incise_haptic_limit(torque_N_mm, gate->last.torque_N_mm, gate->share,
			    gate->torque_N_mm);
	return why;
}
