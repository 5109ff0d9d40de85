// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Rows that are not on their line; see fit.h. ns.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include "../base/ascending.h"
#include "fit.h"

#define WINDOW INCISE_FIT_WINDOW
/* So few fresh rows that are all late show no level, but make one possible. */
#define FEW 5
/*
 * Largest deviation of an even distribution, √12 standard deviations of it; a little less, as
 * the bounds of these are estimates.
 */
#define EVEN 3
/* Rows that show a rate above, or below that of the device. */
#define FAST 60
#define SLOW 30
/* Intervals around a row whose median is the local period. */
#define AROUND 7
/* Rounding of times and slopes. */
#define ROUNDING_NS 1000

struct fit {
	const struct incise_fit_setup *setup;
	const struct incise_fit_row *rows;
	size_t n;
	double *late;	 /* arrival - delay - line; without a line 0 */
	double *held;	 /* how long the host held the row up, by its neighbours */
	double *longest; /* and may have, if some between them were lost */
	double *level;	 /* lateness of all around */
	double *doubt;	 /* by which the time on the line may be wrong */
	bool *odd;	 /* not at the rate of the device */
	size_t *fresh;	 /* rows behind which nothing else waited */
	size_t n_fresh;
	double scatter; /* of the host's lateness */
	double noise;	/* median lateness above the level */
};

/* Rounds of a selection, of which each leaves half of the values by luck; then they are sorted. */
#define ROUNDS 40

/* The value that sorting would put at @k; Hoare's FIND. */
static double at_place(double *values, ptrdiff_t n, ptrdiff_t k)
{
	ptrdiff_t low = 0, high = n - 1;

	for (int round = 0; low < high; round++) {
		const double pivot = values[k];
		ptrdiff_t i = low, j = high;

		if (round == ROUNDS) {
			qsort(values + low, (size_t)(high - low + 1), sizeof(*values),
			      ascending);
			break;
		}
		while (i <= j) {
			while (values[i] < pivot)
				i++;
			while (pivot < values[j])
				j--;
			if (i <= j) {
				const double swapped = values[i];

				values[i++] = values[j];
				values[j--] = swapped;
			}
		}
		low = j < k ? i : low;
		high = k < i ? j : high;
	}
	return values[k];
}

static double quantile(double *values, size_t n, double share)
{
	return n ? at_place(values, (ptrdiff_t)n, (ptrdiff_t)(share * (double)(n - 1)))
		 : 0;
}

static double interval(const struct fit *fit, size_t i)
{
	return (double)(fit->rows[i + 1].arrival_ns - fit->rows[i].arrival_ns);
}

static double span(const struct fit *fit, size_t last, size_t rows)
{
	return (double)(fit->rows[last].arrival_ns - fit->rows[last - rows].arrival_ns);
}

/* Whether two rows arrived within so many periods. */
static bool is_near(const struct fit *fit, size_t i, double from, double to)
{
	double periods = interval(fit, i) / fit->setup->period_ns;

	return periods >= from && periods < to;
}

/*
 * Rows of a higher rate: a window of them is shorter than it can be, and not because some were
 * held up, as these arrive together.
 */
static void find_fast(struct fit *fit)
{
	size_t together = 0, marked = 0;

	for (size_t i = 0; i + 1 < fit->n; i++) {
		together += is_near(fit, i, 0, 0.25);
		if (i + 1 < FAST)
			continue;
		if (i >= FAST)
			together -= is_near(fit, i - FAST, 0, 0.25);
		if (together <= FAST / 20 &&
		    span(fit, i + 1, FAST) < 0.9 * FAST * fit->setup->period_ns)
			for (marked = marked > i + 1 - FAST ? marked : i + 1 - FAST;
			     marked <= i + 1; marked++)
				fit->odd[marked] = true;
	}
}

/* Find a lower rate: hardly any two rows are a period apart, nor do many arrive together. */
static void find_slow(struct fit *fit)
{
	size_t close = 0, together = 0, marked = 0;

	for (size_t i = 0; i + 1 < fit->n; i++) {
		close += is_near(fit, i, 0.25, 1.1);
		together += is_near(fit, i, 0, 0.25);
		if (i + 1 < SLOW)
			continue;
		if (i >= SLOW) {
			close -= is_near(fit, i - SLOW, 0.25, 1.1);
			together -= is_near(fit, i - SLOW, 0, 0.25);
		}
		if (close <= SLOW / 10 && together <= SLOW / 5)
			for (marked = marked > i + 1 - SLOW ? marked : i + 1 - SLOW;
			     marked <= i + 1; marked++)
				fit->odd[marked] = true;
	}
}

/* Two records are measured a period apart at least, so that the earlier of these waited. */
static bool is_fresh(const struct fit *fit, size_t i)
{
	return i + 1 >= fit->n ||
	       interval(fit, i) >= fit->setup->period_ns / (fit->odd[i] ? 8 : 2);
}

static void find_fresh(struct fit *fit)
{
	for (size_t i = 0; i < fit->n; i++)
		if (is_fresh(fit, i))
			fit->fresh[fit->n_fresh++] = i;
}

/* The median of the intervals behind the fresh rows around the @k-th. */
static double local_period(const struct fit *fit, size_t k)
{
	double around[2 * AROUND + 1];
	size_t n = 0, first = k > AROUND ? k - AROUND : 0;

	for (size_t j = first; j <= k + AROUND && j < fit->n_fresh; j++)
		if (fit->fresh[j] + 1 < fit->n)
			around[n++] = interval(fit, fit->fresh[j]);
	return n ? quantile(around, n, 0.5) : fit->setup->period_ns;
}

/*
 * With even periods a row was held up as long as the one behind it and what is missing in
 * between, and never since before the host last read.
 */
static void find_held(struct fit *fit, double *scratch)
{
	size_t k = fit->n_fresh, last_read, short_ones = 0;
	double period = fit->setup->period_ns, since;

	for (size_t i = fit->n; i-- > 0;) {
		bool fresh = is_fresh(fit, i);

		if (fresh)
			period = local_period(fit, --k);
		last_read = k ? fit->fresh[k - 1] : 0;
		since = (double)(fit->rows[i].arrival_ns -
				 fit->rows[last_read].arrival_ns);
		fit->held[i] = 0;
		fit->longest[i] = !k || since > 1.5 * period ? since : 0;
		if (i + 1 < fit->n)
			fit->held[i] =
				fmax(0, fit->held[i + 1] + period - interval(fit, i));
		/* Before a pause only the interval ahead of it shows anything. */
		if (i > 0 && i + 1 < fit->n && interval(fit, i) > 1.5 * period)
			fit->held[i] = fmax(fit->held[i], interval(fit, i - 1) - period);
		if (k)
			fit->held[i] = fmin(fit->held[i], since);
		if (fresh && i + 1 < fit->n)
			scratch[short_ones++] = fabs(period - interval(fit, i));
	}
	/*
	 * Not the longest, which are pauses and losses. Of two exponential latenesses of mean b
	 * the difference is above 2.3 b once in 10, and one is above 6.9 b once in 1000.
	 */
	fit->scatter = 3 * quantile(scratch, short_ones, 0.9);
}

/* Least lateness of the fresh rows from the @k-th to the @last-th. */
static double least_fit(const struct fit *fit, size_t k, size_t last)
{
	double found = INFINITY;

	/* fmin() is a call, for the sake of NaN, which no lateness is. */
	for (; k <= last; k++) {
		const double late = fit->late[fit->fresh[k]];

		found = late < found ? late : found;
	}
	return found;
}

/* Lateness of @rows rows behind or ahead of the @i-th fresh one; -INFINITY: there are fewer. */
static double level_of(const struct fit *fit, size_t i, size_t rows)
{
	double before = i + 1 >= rows ? least_fit(fit, i + 1 - rows, i) : -INFINITY;
	double after =
		i + rows <= fit->n_fresh ? least_fit(fit, i, i + rows - 1) : -INFINITY;

	return fmax(before, after);
}

static void find_levels(struct fit *fit, double *scratch)
{
	double lowest = fit->n_fresh ? least_fit(fit, 0, fit->n_fresh - 1) : 0;
	size_t k = 0;

	for (size_t i = 0; i < fit->n_fresh; i++) {
		double level = level_of(fit, i, WINDOW);

		/* Too few rows; what all of them show is certain. */
		if (isinf(level))
			level = fmin(0, lowest);
		scratch[i] = fit->late[fit->fresh[i]] - level;
		for (; k <= fit->fresh[i]; k++) {
			fit->level[k] = level;
			fit->doubt[k] = fmax(0, level_of(fit, i, FEW) - level);
		}
	}
	fit->noise = quantile(scratch, fit->n_fresh, 0.5);
}

/* Late rows up to a loss, too few to show a level: it may have been before them. */
static void doubt_before(struct fit *fit, size_t k)
{
	double late = INFINITY;

	for (size_t rows = 0; rows < WINDOW; rows++, k--) {
		size_t i = fit->fresh[k];

		late = fmin(late, fit->late[i] - fit->level[i]);
		if (late < fit->setup->period_ns / 2)
			return;
		fit->doubt[i] = fmax(fit->doubt[i], late);
		if (!k)
			return;
	}
}

/*
 * Rows that arrived together: where some were lost around them, it may have been before or behind
 * any of them. One that came alone behind a loss may have waited for the host while others were lost.
 */
static void find_doubts(struct fit *fit)
{
	size_t first = 0;

	for (size_t k = 0; k < fit->n_fresh; k++) {
		size_t last = fit->fresh[k];
		uint64_t most = 0;
		double step;

		for (size_t i = first ? first : 1;
		     i <= last + (first < last) && i < fit->n; i++) {
			uint64_t missing = fit->rows[i].seq - fit->rows[i - 1].seq - 1;

			most = missing > most ? missing : most;
		}
		step = first && first < last
			       ? fabs(fit->level[last] - fit->level[first - 1])
			       : 0;
		for (size_t i = first; i <= last; i++)
			fit->doubt[i] =
				fmax(fit->doubt[i],
				     fmax(step, (double)most * fit->setup->period_ns));
		if (last + 1 < fit->n &&
		    fit->rows[last + 1].seq - fit->rows[last].seq > 1)
			doubt_before(fit, k);
		first = last + 1;
	}
}

static void by_arrival(const struct fit *fit, size_t i, struct incise_fit_time *time)
{
	const struct incise_fit_setup *setup = fit->setup;

	time->kind = INCISE_FIT_ARRIVAL;
	time->held_ns = is_fresh(fit, i) ? 0 : fit->held[i];
	time->t_ns = fit->rows[i].arrival_ns - setup->delay_ns - llrint(time->held_ns);
	time->sd_ns = hypot((fit->scatter + fmax(fit->held[i], fit->longest[i]) +
			     setup->grain_ns + ROUNDING_NS) /
				    EVEN,
			    setup->delay_sd_ns);
}

/* True: the row is not simply on the line. */
static bool judge_fit(const struct fit *fit, size_t i, double tail,
		      struct incise_fit_time *time)
{
	const struct incise_fit_setup *setup = fit->setup;
	double limit = fmax(setup->period_ns / 2, fit->noise), level = fit->level[i];
	double whole = round(level / setup->period_ns), unsure;
	uint64_t seq = fit->rows[i].seq;

	*time = (struct incise_fit_time){.seq = seq};
	if (setup->n_knots < 2 || fit->odd[i]) {
		by_arrival(fit, i, time);
		return true;
	}
	time->sd_ns = incise_timeline_sd(setup->knots, setup->n_knots, seq);
	/* Nothing is measured after it arrived. */
	if (level > limit || fit->late[i] < -limit) {
		if (level <= limit || whole > 1e9 ||
		    fabs(level - whole * setup->period_ns) >
			    fmax(setup->period_ns / 4, fit->noise)) {
			by_arrival(fit, i, time);
			return true;
		}
		seq += (uint64_t)whole;
		time->kind = INCISE_FIT_MOVED;
		time->sd_ns = incise_timeline_sd(setup->knots, setup->n_knots, seq);
	} else {
		time->kind = INCISE_FIT_WIDER;
	}
	time->t_ns = incise_timeline_at(setup->knots, setup->n_knots, seq);
	unsure = fit->doubt[i] > limit ? fit->doubt[i] : 0;
	/* One row with a wrong number may have pulled the line down. */
	if (time->kind == INCISE_FIT_WIDER && level > 4 * time->sd_ns)
		unsure = fmax(unsure, level);
	/* Late to the end, for too few rows to show a level. */
	if (time->kind == INCISE_FIT_WIDER && tail > limit)
		unsure = fmax(unsure, tail);
	time->sd_ns = hypot(time->sd_ns, unsure / EVEN);
	return time->kind != INCISE_FIT_WIDER || unsure > 0;
}

/* Judge all rows; with @times, which has capacity for them, keep those that are not on the line. */
static size_t judge_all(const struct fit *fit, double *tail,
			struct incise_fit_time *times)
{
	struct incise_fit_time time;
	size_t found = 0;

	/* The least lateness up to the end. */
	for (size_t i = fit->n; i-- > 0;)
		tail[i] = fmin(fit->late[i], i + 1 < fit->n ? tail[i + 1] : INFINITY);
	for (size_t i = 0; i < fit->n; i++)
		if (judge_fit(fit, i, tail[i], &time)) {
			if (times)
				times[found] = time;
			found++;
		}
	return found;
}

static int64_t find_fit(struct fit *fit, double *scratch, struct incise_fit_time **times)
{
	size_t found;

	memset(fit->odd, 0, fit->n * sizeof(*fit->odd));
	find_fast(fit);
	find_slow(fit);
	find_fresh(fit);
	find_held(fit, scratch);
	find_levels(fit, scratch);
	find_doubts(fit);
	found = judge_all(fit, scratch, NULL);
	if (!found)
		return 0;
	*times = malloc(found * sizeof(**times));
	if (!*times)
		return -ENOMEM;
	return (int64_t)judge_all(fit, scratch, *times);
}

int64_t incise_fit(const struct incise_fit_setup *setup,
		   const struct incise_fit_row *rows, size_t n,
		   struct incise_fit_time **times)
{
	struct fit fit = {.setup = setup, .rows = rows, .n = n};
	double *values = malloc(6 * (n + 1) * sizeof(*values));
	int64_t found = -ENOMEM;

	*times = NULL;
	fit.fresh = malloc((n + 1) * sizeof(*fit.fresh));
	fit.odd = malloc((n + 1) * sizeof(*fit.odd));
	if (values && fit.fresh && fit.odd) {
		fit.late = values;
		fit.held = fit.late + n;
		fit.longest = fit.held + n;
		fit.level = fit.longest + n;
		fit.doubt = fit.level + n;
		for (size_t i = 0; i < n; i++)
			fit.late[i] =
				setup->n_knots < 2
					? 0
					: (double)(rows[i].arrival_ns - setup->delay_ns -
						   incise_timeline_at(setup->knots,
								      setup->n_knots,
								      rows[i].seq));
		found = find_fit(&fit, fit.doubt + n, times);
	}
	free(fit.odd);
	free(fit.fresh);
	free(values);
	return found;
}
