// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * How many records were lost before this one; see polhemus_gaps.h.
 */
#include <string.h>
#include "polhemus_gaps.h"

#define REFUSED_MAX 2 /* in a row; then it is us who were wrong */
#define FAR_NS (INT64_C(1) << 60)

void polhemus_gaps_init(struct polhemus_gaps *gaps, const uint8_t *stations, int n,
			bool counts, double hz, unsigned int length)
{
	*gaps = (struct polhemus_gaps){
		.n = n,
		.counts = counts,
		.period_ns = hz > 0 ? (int64_t)(1e9 / hz + 0.5) : 0,
		.length = length,
	};
	memcpy(gaps->order, stations, (size_t)n);
}

void polhemus_gaps_start(struct polhemus_gaps *gaps, int64_t t_ns)
{
	gaps->started = true;
	gaps->last_ns = t_ns;
}

void polhemus_gaps_broken(struct polhemus_gaps *gaps)
{
	gaps->broken = gaps->begun || gaps->started;
}

/* Less a round: one may be on its way. */
uint64_t polhemus_gaps_silent(const struct polhemus_gaps *gaps, int64_t t_ns)
{
	int64_t round_ns = gaps->n * gaps->period_ns;
	int64_t rounds = (gaps->begun || gaps->started) && round_ns
				 ? (t_ns - gaps->last_ns) / round_ns - 1
				 : 0;

	return rounds > 0 ? (uint64_t)(rounds * gaps->n) : 0;
}

static int place(const struct polhemus_gaps *gaps, uint8_t station)
{
	for (int i = 0; i < gaps->n; i++)
		if (gaps->order[i] == station)
			return i;
	return 0;
}

static void restart_window(struct polhemus_gaps *gaps)
{
	gaps->in_window = 0;
	gaps->moved = false;
	gaps->least_ns = FAR_NS;
}

static void step(struct polhemus_gaps *gaps, uint64_t steps)
{
	gaps->seq += steps;
	gaps->lost += steps - 1;
}

/* Of all stations in a frame that is counted the time is the frame's. */
static int64_t due_ns(const struct polhemus_gaps *gaps, uint64_t seq)
{
	uint64_t n = gaps->counts ? (uint64_t)gaps->n : 1;

	return (int64_t)((seq + gaps->first_place) / n * n) * gaps->period_ns;
}

static int64_t lateness(const struct polhemus_gaps *gaps, int64_t t_ns, uint64_t seq)
{
	return t_ns - gaps->base_ns - due_ns(gaps, seq);
}

/* Steps of one record to the next of @where, at least 1. */
static uint64_t in_order(const struct polhemus_gaps *gaps, int where)
{
	return (uint64_t)((where - gaps->last - 1 + 2 * gaps->n) % gaps->n) + 1;
}

/* Whole rounds of the stations in @ns, to the nearest. */
static uint64_t rounds(const struct polhemus_gaps *gaps, int64_t ns)
{
	int64_t round_ns = gaps->n * gaps->period_ns;

	return ns > 0 && round_ns ? (uint64_t)((ns + round_ns / 2) / round_ns) : 0;
}

/*
 * After a pause only time and order are left to tell: from the earliest that the record could
 * have come, as the last one before the pause may have come late.
 */
static void step_over(struct polhemus_gaps *gaps, int64_t t_ns, int where)
{
	uint64_t steps = in_order(gaps, where);
	uint64_t more = rounds(gaps, lateness(gaps, t_ns, gaps->seq + steps));

	/* Without a period: one round, so that it shows. */
	if (!gaps->period_ns)
		more = 1;
	step(gaps, steps + more * (uint64_t)gaps->n);
	gaps->base_ns = t_ns - due_ns(gaps, gaps->seq);
	gaps->broken = gaps->settled = false;
	gaps->anew = true;
	restart_window(gaps);
}

/* Too early by half a period: it cannot be so, unless it is we who are wrong, always. */
static bool is_too_early(struct polhemus_gaps *gaps, int64_t late)
{
	if (late >= -gaps->period_ns / 2 || !gaps->settled ||
	    gaps->refused >= REFUSED_MAX)
		return false;
	gaps->refused++;
	return true;
}

/* The lateness that stayed for a window is records that are missing; the rest is drift. */
static void look_back(struct polhemus_gaps *gaps, int64_t late)
{
	uint64_t missing = 0;

	if (late < 0) {
		gaps->moved |= late < -gaps->period_ns / 4;
		gaps->base_ns += late;
		late = 0;
	}
	if (!gaps->in_window)
		gaps->first_ns = late;
	if (late < gaps->least_ns)
		gaps->least_ns = late;
	if (++gaps->in_window < POLHEMUS_GAPS_WINDOW)
		return;
	/* Unless it shrinks: records that were held up come all at once. */
	if (late >= gaps->first_ns - gaps->period_ns / 2) {
		if (!gaps->counts)
			missing = rounds(gaps, gaps->least_ns) * (uint64_t)gaps->n;
		gaps->base_ns +=
			(gaps->least_ns - (int64_t)missing * gaps->period_ns) / 4;
	}
	gaps->seq += missing;
	gaps->lost += missing;
	gaps->settled = !gaps->moved;
	restart_window(gaps);
}

/* Two in a row that the count refused, and they agree: the count began anew. */
static bool began_anew(struct polhemus_gaps *gaps, const struct polhemus_record *record)
{
	int64_t round_ns = gaps->n * gaps->period_ns;
	int64_t frames = (int32_t)(record->frame - gaps->refused_frame);
	int64_t apart_ns = record->t_ns - gaps->refused_ns - frames * round_ns;
	bool anew = gaps->refused && frames >= 0 && apart_ns > -4 * round_ns &&
		    apart_ns < 4 * round_ns;

	gaps->refused++;
	gaps->refused_frame = record->frame;
	gaps->refused_ns = record->t_ns;
	return anew;
}

static bool take_counted(struct polhemus_gaps *gaps, const struct polhemus_record *record,
			 int where)
{
	int64_t frames = (int32_t)(record->frame - gaps->frame);
	int64_t steps = frames * gaps->n + where - gaps->last;
	int64_t late = steps > 0
			       ? lateness(gaps, record->t_ns, gaps->seq + (uint64_t)steps)
			       : -FAR_NS;

	/* A count from before, or of what cannot have been measured yet, came to harm. */
	if (steps <= 0 || late < -gaps->n * gaps->period_ns / 2) {
		if (!began_anew(gaps, record))
			return false;
		step_over(gaps, record->t_ns, where);
		return true;
	}
	step(gaps, (uint64_t)steps);
	look_back(gaps, late);
	return true;
}

static bool take_timed(struct polhemus_gaps *gaps, const struct polhemus_record *record,
		       int where)
{
	uint64_t steps = in_order(gaps, where), most, more;
	int64_t late = lateness(gaps, record->t_ns, gaps->seq + steps);

	/* What its station says came to harm; or it came twice. */
	if (is_too_early(gaps, late))
		return false;
	if (record->skipped) {
		/*
		 * As many as the bytes make that were no record, to the nearest, and as fit
		 * into the time: a host that is late must not make two of one.
		 */
		most = (record->skipped + gaps->length / 2) / gaps->length;
		more = rounds(gaps, late) * (uint64_t)gaps->n;
		while (more && steps - 1 + more > most + (uint64_t)gaps->n - 1)
			more -= (uint64_t)gaps->n;
		steps += more;
	}
	step(gaps, steps);
	look_back(gaps, lateness(gaps, record->t_ns, gaps->seq));
	return true;
}

/* Nothing but order, and bytes that are half a record or more. */
static void take_ordered(struct polhemus_gaps *gaps, const struct polhemus_record *record,
			 int where)
{
	uint64_t steps = in_order(gaps, where);

	if (gaps->n == 1)
		steps += (record->skipped + gaps->length / 2) / gaps->length;
	step(gaps, steps);
}

/*
 * Before the first record lie what the bytes make that were no record, as fits into the time,
 * and where the link was gone as well all of the time since the start, less a round, as the
 * first one takes that long.
 */
static void begin(struct polhemus_gaps *gaps, const struct polhemus_record *record,
		  int where)
{
	uint64_t n = (uint64_t)gaps->n, missing = 0, most;

	if (gaps->started) {
		most = rounds(gaps, record->t_ns - gaps->last_ns) * n;
		missing = (record->skipped + gaps->length / 2) / gaps->length;
		if (gaps->period_ns && missing > most)
			missing = most;
		if (gaps->broken && polhemus_gaps_silent(gaps, record->t_ns) > missing)
			missing = polhemus_gaps_silent(gaps, record->t_ns);
	}
	gaps->begun = true;
	gaps->broken = false;
	gaps->first_place = gaps->counts ? (uint64_t)where : 0;
	/* Whole rounds, so that the stations keep their places. */
	gaps->seq = gaps->lost = (missing + n - 1) / n * n;
	gaps->base_ns = record->t_ns - due_ns(gaps, gaps->seq);
	restart_window(gaps);
}

bool polhemus_gaps_take(struct polhemus_gaps *gaps, const struct polhemus_record *record,
			uint64_t *seq)
{
	int where = place(gaps, record->station);

	gaps->anew = false;
	if (!gaps->begun) {
		begin(gaps, record, where);
	} else if (gaps->broken) {
		step_over(gaps, record->t_ns, where);
	} else if (gaps->counts) {
		if (!take_counted(gaps, record, where))
			return false;
	} else if (!gaps->period_ns) {
		take_ordered(gaps, record, where);
	} else if (!take_timed(gaps, record, where)) {
		return false;
	}
	gaps->refused = 0;
	gaps->last_ns = record->t_ns;
	gaps->last = where;
	gaps->frame = record->frame;
	*seq = gaps->seq;
	return true;
}
