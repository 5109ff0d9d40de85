// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The times of the tracker's rows compared with its arrivals: rows whose t_ns, or whose place on
 * the line in table knots, is not to be trusted; see lib/signal/fit.h.
 */
#include <math.h>
#include "../read/rows.h"
#include "verify.h"

/* Whether two rows are reported as one: of one kind, in a row but for some in between. */
static bool belongs(const struct incise_fit_time *a, const struct incise_fit_time *b)
{
	return a->kind == b->kind && b->seq - a->seq <= 2 * INCISE_FIT_WINDOW;
}

static void report_verify_times(struct incise_verification *verify,
				const struct incise_fit_time *first,
				const struct incise_fit_time *last, uint64_t count,
				double sd_ns)
{
	struct incise_verify_finding found = incise_verify_finding(INCISE_VERIFY_TIMES);
	const char *why = first->kind == INCISE_FIT_MOVED
				  ? "arrived later than their numbers say, because "
				    "losses before them were counted late"
				  : "did not arrive at the rate of the tracker";

	found.stream = "tracker";
	found.first_seq = (int64_t)first->seq;
	found.last_seq = (int64_t)last->seq;
	found.first_ns = first->t_ns;
	found.last_ns = last->t_ns;
	found.count = count;
	incise_verify_found(
		verify, found,
		"tracker: numbers %lld to %lld, %.4f to %.4f s: %llu rows %s; their "
		"t_ns is wrong; readers use the arrival, with a standard uncertainty "
		"of up to %.3g ms",
		(long long)found.first_seq, (long long)found.last_seq,
		incise_verify_s(verify, found.first_ns),
		incise_verify_s(verify, found.last_ns), (unsigned long long)count, why,
		sd_ns * 1e-6);
}

void incise_verify_times(struct incise_verification *verify)
{
	const struct incise_fit_time *other = NULL;
	struct incise_fit_time first, last;
	struct incise_row_times times;
	struct incise_error err = {0};
	uint64_t count = 0;
	double sd_ns = 0;

	if (incise_row_times_open(&times, verify->recording, "tracker", &err))
		return;
	/* Without a line all rows are timed by arrival, as their t_ns is. */
	if (times.source->n_knots)
		other = incise_row_times_other(&times, 0);
	for (; other; other = incise_row_times_other(&times, other->seq + 1)) {
		/* On the line, with an uncertainty that covers the doubt. */
		if (other->kind == INCISE_FIT_WIDER)
			continue;
		if (count && !belongs(&last, other)) {
			report_verify_times(verify, &first, &last, count, sd_ns);
			count = 0;
		}
		if (!count) {
			first = *other;
			sd_ns = 0;
		}
		last = *other;
		count++;
		sd_ns = fmax(sd_ns, other->sd_ns);
	}
	if (count)
		report_verify_times(verify, &first, &last, count, sd_ns);
	incise_row_times_close(&times);
}
