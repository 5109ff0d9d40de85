// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Times of acquisition from times of arrival; see timeline.h. ns.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "timeline.h"

/* --- the line below all arrivals ----------------------------------------------------- */

/*
 * The line below which no arrival of a stream lies: bounded memory, O(1) per sample.
 *
 *     y │  ·    ·      ·  ·         y: arrival less (number · nominal period), ns
 *       │    ·      ·   ·    ·      x: number · nominal period, ns
 *       │ ·    ·  ·    __·──        the line touches two of the lowest; its slope is the
 *       │  ·___─·──·───             relative error of the nominal period
 *       └──────────────────► x
 *
 * The lowest arrival of each block of x is kept, for 64 blocks at most. A block starts as one
 * period or two and doubles whenever the 64 are full, up to BLOCK_MAX_NS; after that the oldest
 * blocks are dropped, so that the line follows a clock that warms up.
 *
 * The line maximizes its own height over the blocks under the condition that none is below
 * it, which is the most likely line for exponential excess: Moon, Skelly and Towsley,
 * "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999.
 * Even the lowest arrivals are a little late: see "gap".
 */

#define BLOCKS INCISE_ENVELOPE_BLOCKS

#define SLOPE_MAX INCISE_ENVELOPE_SLOPE_MAX
#define SLOPE_SD_FIRST 300e-6
#define SLOPE_SD_NONE 1e-2 /* nothing is known */
#define FAR_OFF (2.5 * SLOPE_SD_FIRST)
/* Largest change of a known rate while there are few blocks. */
#define SLOPE_SD_KNOWN 20e-6

/* Blocks this many scales above the line had another latency; exp(-12) is 6e-6. */
#define RAISED_SCALES 12
#define RAISED_MIN_NS 1500e3 /* a frame of USB is not yet another latency */

/* Phases on a grid that are closer, or more of them, do not matter. */
#define GRAIN_MIN_NS 20e3
#define PHASES_MAX 256
/* Lowest points of a sawtooth that are enough for a line through two of them. */
#define BOTTOMS 5

/* Times and the slope's steps from knot to knot are whole ns. */
#define ROUNDING_NS 5

/* Fewest blocks for a fit of the distribution. */
#define SHAPE_BLOCKS 8
#define SHAPE_MIN 0.7
#define SHAPE_MAX 3.0
/* Lines that the shape is averaged over: one set of 64 blocks gives it to ± 25 %. */
#define SHAPE_FITS 256
#define SHAPE_FITS_FIRST 32
/* log(log(1 - 0.625) / log(1 - 0.25)): two quantiles of shape 1 */
#define LOG_ODDS 1.22645

void incise_envelope_init(struct incise_envelope *env, double period_ns, double grain_ns)
{
	memset(env, 0, sizeof(*env));
	env->period_ns = period_ns;
	env->grain_ns = grain_ns;
	/* Doubling ends at the full length. */
	env->block_ns = INCISE_ENVELOPE_BLOCK_MAX_NS;
	while (env->block_ns / 2 >= period_ns)
		env->block_ns /= 2;
	env->prior_slope_sd = SLOPE_SD_FIRST;
	/* Until it is known: shape 1, with the weight of a few lines. */
	env->shape = 1;
	env->log_ratio = LOG_ODDS;
	env->shape_fits = SHAPE_FITS_FIRST;
}

double incise_envelope_at(const struct incise_envelope *env, double x_ns)
{
	return env->y_ns + env->slope * (x_ns - env->x_ns);
}

/* Largest distance of a straight line from a clock whose rate changes. */
static double envelope_bend(double span_ns)
{
	/* Change of rate of a crystal that warms up. */
	const double per_s = 2e-7;

	return per_s / 1e9 * span_ns * span_ns / 8;
}

/* Standard deviation of line less gap at x. */
static double envelope_sd(const struct incise_envelope *env, double x_ns)
{
	return hypot(env->gap_sd_ns, env->slope_sd * (x_ns - env->x_ns));
}

bool incise_envelope_full(const struct incise_envelope *env)
{
	return env->block_ns >= INCISE_ENVELOPE_BLOCK_MAX_NS && env->count &&
	       env->blocks[env->count - 1].number - env->blocks[0].number >= BLOCKS - 1;
}

static bool lower(const struct incise_envelope *env,
		  const struct incise_envelope_block *a,
		  const struct incise_envelope_block *b)
{
	return a->y_ns - b->y_ns < env->slope * (a->x_ns - b->x_ns);
}

/* Twice the length, half the blocks. */
static void double_blocks(struct incise_envelope *env)
{
	int kept = 0;

	for (int i = 0; i < env->count; i++) {
		struct incise_envelope_block block = env->blocks[i];

		block.number /= 2;
		if (!kept || env->blocks[kept - 1].number != block.number)
			env->blocks[kept++] = block;
		else if (lower(env, &block, &env->blocks[kept - 1]))
			env->blocks[kept - 1] = block;
	}
	env->count = kept;
	env->block_ns *= 2;
}

/* Add the open block to the others. */
static void close_block(struct incise_envelope *env)
{
	struct incise_envelope_block *open = &env->open;
	int gone = 0;

	while (env->count && open->number - env->blocks[0].number >= BLOCKS &&
	       env->block_ns < INCISE_ENVELOPE_BLOCK_MAX_NS) {
		double_blocks(env);
		open->number /= 2;
	}
	while (gone < env->count && open->number - env->blocks[gone].number >= BLOCKS)
		gone++;
	env->count -= gone;
	memmove(env->blocks, env->blocks + gone,
		(size_t)env->count * sizeof(*env->blocks));
	if (env->count && env->blocks[env->count - 1].number == open->number) {
		/* Doubling has put it into the last block. */
		if (lower(env, open, &env->blocks[env->count - 1]))
			env->blocks[env->count - 1] = *open;
	} else {
		env->blocks[env->count++] = *open;
	}
}

/* Choose the blocks of this line: not those of another latency. */
static int choose_timeline(struct incise_envelope *env,
			   const struct incise_envelope_block **chosen)
{
	double limit =
		RAISED_SCALES * env->scale_ns + fmax(RAISED_MIN_NS, 1.5 * env->grain_ns);
	int n = 0;

	for (int i = 0; i < env->count; i++) {
		const struct incise_envelope_block *block = &env->blocks[i];

		if (env->scale_ns > 0 &&
		    block->y_ns - incise_envelope_at(env, block->x_ns) > limit)
			continue;
		chosen[n++] = block;
	}
	if (n)
		return n;
	for (int i = 0; i < env->count; i++)
		chosen[n++] = &env->blocks[i];
	env->scale_ns = 0; /* a new line starts */
	env->restarts++;
	return n;
}

/* Slope of the lower convex hull's edge at x; false for a single block. */
static bool hull_slope(const struct incise_envelope_block **blocks, int n, double x_ns,
		       double *slope)
{
	const struct incise_envelope_block *hull[BLOCKS];
	int top = 0, edge;

	for (int i = 0; i < n; i++) {
		const struct incise_envelope_block *c = blocks[i];

		while (top >= 2) {
			const struct incise_envelope_block *a = hull[top - 2],
							   *b = hull[top - 1];

			if ((b->y_ns - a->y_ns) * (c->x_ns - a->x_ns) <
			    (c->y_ns - a->y_ns) * (b->x_ns - a->x_ns))
				break;
			top--;
		}
		hull[top++] = c;
	}
	if (top < 2)
		return false;
	for (edge = 1; edge < top - 1 && hull[edge]->x_ns < x_ns; edge++)
		;
	*slope = (hull[edge]->y_ns - hull[edge - 1]->y_ns) /
		 (hull[edge]->x_ns - hull[edge - 1]->x_ns);
	return true;
}

static void sort(double *values, int n)
{
	for (int i = 1; i < n; i++) {
		double value = values[i];
		int j = i;

		for (; j && values[j - 1] > value; j--)
			values[j] = values[j - 1];
		values[j] = value;
	}
}

/*
 * Estimate how far the line is above the true line. If the n excesses are exponential with mean
 * m, then by the lack of memory those that the line does not touch are exponential too, their
 * sum is (n - 2)·m, and the line is 2·m/n too high in the middle. A Weibull excess is a power
 * of an exponential one: scale·(2/n)^(1/shape). Shape and scale come from two quantiles, because
 * stalls spoil a mean.
 */
static void measure_gap(struct incise_envelope *env, double *excess, int n,
			double span_ns)
{
	double low, high;

	sort(excess, n);
	low = excess[n / 4];
	high = excess[n * 5 / 8];
	env->gap_ns = 0;
	if (n < SHAPE_BLOCKS) {
		/* The spread is the only known bound. */
		env->gap_sd_ns = fmax(excess[n - 1], n < 3 ? env->block_ns : 1);
		env->slope_sd = env->prior_slope_sd;
		return;
	}
	low = fmax(low, 1); /* the resolution of a clock */
	high = fmax(high, low * 1.01);
	for (int i = 0; i < 4; i++) {
		double ratio = log((high + env->gap_ns) / (low + env->gap_ns));

		if (i == 3) { /* the average over lines takes only the last iteration */
			env->shape_fits += env->shape_fits < SHAPE_FITS;
			env->log_ratio += (ratio - env->log_ratio) / env->shape_fits;
			ratio = env->log_ratio;
		}
		env->shape = fmin(fmax(LOG_ODDS / ratio, SHAPE_MIN), SHAPE_MAX);
		env->scale_ns =
			(high + env->gap_ns) / pow(-log(1 - 0.625), 1 / env->shape);
		env->gap_ns = env->scale_ns * pow(2.0 / n, 1 / env->shape);
	}
	/* The shape gives the scatter of the gap, but no sample shows the shape below the
	 * lowest arrival: nearly all of the gap may be wrong. */
	env->gap_sd_ns = env->gap_ns * fmax(1 / env->shape, 0.8) + ROUNDING_NS;
	env->slope_sd = env->prior_slope_sd;
	if (span_ns > 0)
		env->slope_sd = 5 * (env->gap_ns / env->shape + ROUNDING_NS) / span_ns;
}

/*
 * On a grid of time q periods are nearly p grains for some small q: then only q phases of
 * the grid occur, they drift slowly, and jitter is a sawtooth of the height of their distance:
 *
 *     │  /|  /|  /      slow: one bottom or none in all blocks; the line may be too high by
 *     │ / | / | /       the height of the sawtooth, and tilted by it
 *     │/  |/  |/        fast: enough bottoms, the line is right
 *     └──────────► x
 */
static void measure_grain(struct incise_envelope *env, double span_ns)
{
	double period = env->period_ns * (1 + env->slope) / env->grain_ns;
	double count = span_ns / env->period_ns;

	for (int q = 1; q <= PHASES_MAX && env->grain_ns / q > GRAIN_MIN_NS; q++) {
		double height_ns = env->grain_ns / q;
		double bottoms = count * fabs(remainder(q * period, 1));

		if (bottoms >= BOTTOMS && count >= q)
			continue;
		env->gap_ns += height_ns / 2 * fmax(1 - bottoms / 2, 0);
		env->gap_sd_ns = hypot(env->gap_sd_ns, height_ns / sqrt(12));
		if (span_ns > 0)
			env->slope_sd = hypot(env->slope_sd, 0.6 * height_ns / span_ns);
		return; /* the others are finer */
	}
}

static void draw_timeline(struct incise_envelope *env)
{
	const struct incise_envelope_block *chosen[BLOCKS] = {NULL};
	double excess[BLOCKS], x_ns = 0, y_ns = INFINITY, slope, span_ns;
	int n = choose_timeline(env, chosen);

	for (int i = 0; i < n; i++)
		x_ns += chosen[i]->x_ns / n;
	span_ns = chosen[n - 1]->x_ns - chosen[0]->x_ns;
	if (hull_slope(chosen, n, x_ns, &slope)) {
		/* A short line defines the rate less well than the device's type. */
		double sd = n < SHAPE_BLOCKS || env->slope_sd <= 0 ? 1e-2 : env->slope_sd;
		double prior;

		/* The data contradict the type: a clock as far off as this is of none. */
		if (n >= SHAPE_BLOCKS && env->measured_sd > 0 &&
		    fabs(slope - env->prior_slope) >
			    3 * hypot(env->prior_slope_sd, env->measured_sd))
			env->prior_slope_sd = SLOPE_SD_NONE;
		prior = env->prior_slope_sd * env->prior_slope_sd;
		slope = env->prior_slope +
			(slope - env->prior_slope) * prior / (prior + sd * sd);
	} else {
		slope = env->prior_slope;
	}
	slope = fmin(fmax(slope, -SLOPE_MAX), SLOPE_MAX);
	for (int i = 0; i < n; i++)
		y_ns = fmin(y_ns, chosen[i]->y_ns - slope * (chosen[i]->x_ns - x_ns));
	for (int i = 0; i < n; i++)
		excess[i] = chosen[i]->y_ns - slope * (chosen[i]->x_ns - x_ns) - y_ns;
	env->x_ns = x_ns;
	env->y_ns = y_ns;
	env->slope = slope;
	env->has_line = true;
	measure_gap(env, excess, n, span_ns);
	if (env->grain_ns > 0)
		measure_grain(env, span_ns);
	env->gap_sd_ns = hypot(env->gap_sd_ns, envelope_bend(span_ns));
	env->measured_sd = env->slope_sd;
	env->slope_sd = fabs(slope) < SLOPE_MAX ? fmin(env->slope_sd, env->prior_slope_sd)
						: SLOPE_SD_NONE;
	if (env->slope_sd < SLOPE_SD_KNOWN) {
		env->prior_slope = slope;
		env->prior_slope_sd = SLOPE_SD_KNOWN;
	}
}

bool incise_envelope_add(struct incise_envelope *env, double x_ns, double y_ns)
{
	struct incise_envelope_block block = {(int64_t)(x_ns / env->block_ns), x_ns,
					      y_ns};
	bool drawn = false;

	if (env->has_open && block.number != env->open.number) {
		close_block(env);
		draw_timeline(env);
		drawn = true;
		block.number = (int64_t)(x_ns / env->block_ns);
		env->has_open = false;
	}
	if (!env->has_open || lower(env, &block, &env->open))
		env->open = block;
	env->has_open = true;
	if (!env->has_line) {
		env->x_ns = x_ns;
		env->y_ns = y_ns;
		env->slope = env->prior_slope;
		env->slope_sd = env->prior_slope_sd;
		env->gap_sd_ns = env->block_ns;
		env->has_line = true;
	} else if (y_ns < incise_envelope_at(env, x_ns)) {
		env->y_ns -= incise_envelope_at(env, x_ns) - y_ns;
	}
	return drawn;
}

/* 146 years: sums of two and a count of samples stay below 2^63. */
#define TIME_MAX (INT64_MAX / 2)
/* After a clock that ran back this far, or on a line this long, a new line starts. */
#define BACK_MAX_NS 1000000000LL
#define LINE_MAX_NS 1e15
#define KNOTS INCISE_TIMELINE_KNOTS
#define STEP_NS 16e9
/* The end of a line adds up to three knots, the start of the next one adds one. */
#define KNOTS_SPARE 4

/*
 * --- knots of the line, for readers of the recording --------------------------------------
 *
 *     start        middle of       middle of           middle of    last
 *     of line      64 blocks       64 blocks           the last 64  sample
 *       o──────────────o───────────────o── · · · ───────o────────────o
 *       extrapolated   a knot each 16 s                 extrapolated
 *
 * A line is most certain in the middle of its blocks, so a knot is made there. When the array is
 * full, every second knot is dropped and the step doubles: 68 min at 16 s.
 */

static int64_t later(int64_t t_ns, double step_ns)
{
	double sum_ns = (double)t_ns + step_ns;

	if (sum_ns >= (double)TIME_MAX)
		return TIME_MAX;
	if (sum_ns <= -(double)TIME_MAX)
		return -TIME_MAX;
	return t_ns + (int64_t)step_ns;
}

/* The line at x, as a knot. */
static struct incise_timeline_knot knot_at(const struct incise_timeline *timeline,
					   double x_ns, bool starts)
{
	const struct incise_envelope *env = &timeline->envelope;
	uint64_t count = (uint64_t)(x_ns / timeline->period_ns + 0.5);
	double at_ns = (double)count * timeline->period_ns;
	double delay_sd_ns = (double)timeline->setup.delay_sd_ns;
	double sd_ns = envelope_sd(env, at_ns);
	/* on the way to the next knot */
	double bend_ns = envelope_bend(timeline->knot_step_ns);

	return (struct incise_timeline_knot){
		.seq = timeline->base_seq + count,
		.t_ns = later(timeline->base_ns,
			      at_ns + incise_envelope_at(env, at_ns) - env->gap_ns -
				      (double)timeline->setup.delay_ns),
		.sd_ns = sqrt(delay_sd_ns * delay_sd_ns + sd_ns * sd_ns +
			      bend_ns * bend_ns),
		.starts = starts,
	};
}

/* A knot is kept only if its number and time increase, so that time never runs back. */
static int append(struct incise_timeline_knot *knots, int n,
		  struct incise_timeline_knot knot)
{
	if (n) {
		const struct incise_timeline_knot *last = &knots[n - 1];
		int64_t least;

		if (knot.seq <= last->seq)
			return n;
		least = later(last->t_ns, (double)(knot.seq - last->seq));
		if (knot.t_ns < least)
			knot.t_ns = least;
	}
	knots[n] = knot;
	return n + 1;
}

/* Add the knots of a line that ends now: at most 3. */
static int append_end(const struct incise_timeline *timeline,
		      struct incise_timeline_knot *knots, int n)
{
	const struct incise_envelope *env = &timeline->envelope;
	double last_ns =
		(double)(timeline->last_seq - timeline->base_seq) * timeline->period_ns;
	if (!timeline->knot_started)
		n = append(knots, n, knot_at(timeline, 0, true));
	else if (env->x_ns - timeline->knot_x_ns < timeline->knot_step_ns / 4 &&
		 !knots[n - 1].starts)
		n--; /* too near for a slope */
	if (env->x_ns >= 0 && env->x_ns < last_ns)
		n = append(knots, n, knot_at(timeline, env->x_ns, false));
	return append(knots, n, knot_at(timeline, last_ns, false));
}

static void thin(struct incise_timeline *timeline)
{
	struct incise_timeline_knot *knots = timeline->knots;
	int n = timeline->knot_count, kept = 1;

	for (int i = 1; i < n; i++) {
		bool ends = i + 1 == n || knots[i + 1].starts;

		if (i % 2 == 0 || knots[i].starts || ends)
			knots[kept++] = knots[i];
	}
	timeline->knot_step_ns *= 2;
	if (kept > KNOTS - KNOTS / 4) {
		/* plugged in too often to keep all */
		memmove(knots, knots + KNOTS / 2,
			(size_t)(kept - KNOTS / 2) * sizeof(*knots));
		kept -= KNOTS / 2;
		knots[0].starts = true;
	}
	timeline->knot_count = kept;
}

/* The line was drawn again: add a knot if one is due. */
static void extend(struct incise_timeline *timeline)
{
	const struct incise_envelope *env = &timeline->envelope;

	if (timeline->knot_step_ns <= 0)
		timeline->knot_step_ns = STEP_NS;
	if (env->restarts != timeline->restarts) {
		/* The level has changed for good: a new line starts. */
		timeline->restarts = env->restarts;
		timeline->lines++;
		if (timeline->knot_started && timeline->knot_count + KNOTS_SPARE <= KNOTS)
			timeline->knot_count =
				append(timeline->knots, timeline->knot_count,
				       knot_at(timeline, env->blocks[0].x_ns, true));
		timeline->knot_x_ns = env->blocks[0].x_ns;
		return;
	}
	if (!incise_envelope_full(env))
		return;
	if (timeline->knot_started &&
	    env->x_ns - timeline->knot_x_ns < timeline->knot_step_ns)
		return;
	if (timeline->knot_count + KNOTS_SPARE > KNOTS)
		thin(timeline);
	if (!timeline->knot_started)
		timeline->knot_count = append(timeline->knots, timeline->knot_count,
					      knot_at(timeline, 0, true));
	timeline->knot_started = true;
	timeline->knot_count = append(timeline->knots, timeline->knot_count,
				      knot_at(timeline, env->x_ns, false));
	timeline->knot_x_ns = env->x_ns;
}

/* The line has ended: add its last knots. */
static void end_line(struct incise_timeline *timeline)
{
	if (timeline->knot_step_ns <= 0)
		timeline->knot_step_ns = STEP_NS;
	if (timeline->knot_count + KNOTS_SPARE > KNOTS)
		thin(timeline);
	timeline->knot_count =
		append_end(timeline, timeline->knots, timeline->knot_count);
	timeline->knot_started = false;
	timeline->knot_x_ns = 0;
}

int incise_timeline_knots(const struct incise_timeline *timeline,
			  struct incise_timeline_knot *knots)
{
	int n = timeline->knot_count;

	memcpy(knots, timeline->knots, (size_t)n * sizeof(*knots));
	if (timeline->started && timeline->last_seq > timeline->base_seq)
		n = append_end(timeline, knots, n);
	return n < 2 ? 0 : n;
}

/* Index of the knot before seq, or of the first; the segment's end is the next knot. */
static int segment_of(const struct incise_timeline_knot *knots, int n, uint64_t seq)
{
	int low = 0, high = n - 1;

	while (high - low > 1) {
		int middle = low + (high - low) / 2;

		if (knots[middle].seq <= seq)
			low = middle;
		else
			high = middle;
	}
	return low;
}

int64_t incise_timeline_at(const struct incise_timeline_knot *knots, int n, uint64_t seq)
{
	const struct incise_timeline_knot *a = &knots[segment_of(knots, n, seq)];
	double slope, count;

	/* Between the end of a line and the start of the next, the first one continues. */
	if (a > knots && a[1].starts && seq < a[1].seq)
		a--;
	slope = (double)(a[1].t_ns - a->t_ns) / (double)(a[1].seq - a->seq);
	count = seq >= a->seq ? (double)(seq - a->seq) : -(double)(a->seq - seq);
	return later(a->t_ns, count * slope);
}

double incise_timeline_sd(const struct incise_timeline_knot *knots, int n, uint64_t seq)
{
	const struct incise_timeline_knot *a = &knots[segment_of(knots, n, seq)];

	return fmax(a->sd_ns, a[1].sd_ns);
}

/* Least squares through n knots: ns per sample, and the standard deviation of that. */
static double slope_of(const struct incise_timeline_knot *knots, int n, double *slope_sd)
{
	double x0 = 0, y0 = 0, xx = 0, xy = 0, rr = 0, sd2 = 0, slope;

	for (int i = 0; i < n; i++) {
		x0 += (double)(knots[i].seq - knots->seq) / n;
		y0 += (double)(knots[i].t_ns - knots->t_ns) / n;
	}
	for (int i = 0; i < n; i++) {
		double x = (double)(knots[i].seq - knots->seq) - x0;
		double y = (double)(knots[i].t_ns - knots->t_ns) - y0;

		xx += x * x;
		xy += x * y;
	}
	slope = xy / xx;
	for (int i = 0; i < n; i++) {
		double x = (double)(knots[i].seq - knots->seq) - x0;
		double r = (double)(knots[i].t_ns - knots->t_ns) - y0 - slope * x;

		rr += r * r / n;
		sd2 += knots[i].sd_ns * knots[i].sd_ns / n;
	}
	*slope_sd = sqrt(fmax(rr, sd2) / xx);
	return slope;
}

/* Share by which periods are longer than the nominal one, from the present line's knots. */
static bool measure_slope(const struct incise_timeline *timeline, double *slope,
			  double *slope_sd)
{
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
	int n = incise_timeline_knots(timeline, knots), first = n - 1;

	while (first > 0 && !knots[first].starts)
		first--;
	n -= first;
	if (first < 0 || n < 2)
		return false;
	*slope = slope_of(&knots[first], n, slope_sd) / timeline->period_ns - 1;
	*slope_sd /= timeline->period_ns;
	if (n < 5) { /* of one line or two */
		*slope = timeline->envelope.slope;
		*slope_sd = timeline->envelope.slope_sd;
	}
	return true;
}

/* --- samples ------------------------------------------------------------------------ */

static int64_t limited(int64_t ns)
{
	return ns < -TIME_MAX ? -TIME_MAX : ns > TIME_MAX ? TIME_MAX : ns;
}

void incise_timeline_init(struct incise_timeline *timeline,
			  const struct incise_timeline_setup *setup)
{
	memset(timeline, 0, sizeof(*timeline));
	timeline->setup = *setup;
	timeline->setup.delay_ns = limited(setup->delay_ns);
	timeline->setup.delay_sd_ns = llabs(limited(setup->delay_sd_ns));
	if (setup->grain_ns < 0 || setup->grain_ns > BACK_MAX_NS)
		timeline->setup.grain_ns = 0;
	/* Times in a recording are never negative; see incise-recording(5). */
	timeline->last_ns = -1;
	if (setup->rate_hz >= 1e-3 && setup->rate_hz <= 1e7)
		timeline->period_ns = 1e9 / setup->rate_hz;
	if (timeline->period_ns > 0)
		incise_envelope_init(&timeline->envelope, timeline->period_ns,
				     (double)timeline->setup.grain_ns);
}

void incise_timeline_replug(struct incise_timeline *timeline)
{
	struct incise_envelope *env = &timeline->envelope;
	double slope = env->prior_slope, slope_sd = env->prior_slope_sd;

	if (!timeline->started)
		return;
	end_line(timeline);
	timeline->started = false;
	incise_envelope_init(env, timeline->period_ns, (double)timeline->setup.grain_ns);
	/* The same device has the same rate. */
	env->prior_slope = slope;
	env->prior_slope_sd = slope_sd;
	timeline->restarts = 0;
}

static void measure_jitter(struct incise_timeline *timeline, double excess_ns)
{
	double step = excess_ns - timeline->jitter_mean_ns;

	timeline->jitter_n++;
	timeline->jitter_mean_ns += step / timeline->jitter_n;
	timeline->jitter_sum2 += step * (excess_ns - timeline->jitter_mean_ns);
	timeline->jitter_max_ns = fmax(timeline->jitter_max_ns, excess_ns);
	timeline->late += excess_ns > timeline->period_ns;
}

/* The sample's place on the line; NaN: it has none. */
static double on_line(struct incise_timeline *timeline, uint64_t seq, int64_t arrival_ns)
{
	struct incise_envelope *env = &timeline->envelope;
	double x_ns = 0, y_ns = 0, line_ns;

	if (timeline->period_ns <= 0)
		return NAN;
	if (timeline->started && seq <= timeline->last_seq)
		return NAN;
	if (timeline->started) {
		x_ns = (double)(seq - timeline->base_seq) * timeline->period_ns;
		y_ns = (double)(arrival_ns - timeline->base_ns) - x_ns;
		if (x_ns > LINE_MAX_NS || fabs(y_ns) > LINE_MAX_NS ||
		    arrival_ns < timeline->last_arrival_ns - BACK_MAX_NS)
			incise_timeline_replug(timeline);
	}
	if (!timeline->started) {
		timeline->started = true;
		timeline->lines++;
		timeline->base_seq = seq;
		timeline->base_ns = arrival_ns;
		x_ns = 0;
		y_ns = 0;
	}
	timeline->last_seq = seq;
	timeline->last_arrival_ns = arrival_ns;
	if (incise_envelope_add(env, x_ns, y_ns))
		extend(timeline);
	line_ns = incise_envelope_at(env, x_ns);
	measure_jitter(timeline, y_ns - line_ns);
	return x_ns + line_ns - env->gap_ns;
}

int64_t incise_timeline_sample(struct incise_timeline *timeline, uint64_t seq,
			       int64_t arrival_ns)
{
	int64_t t_ns = limited(arrival_ns);
	double line_ns = on_line(timeline, seq, t_ns);

	timeline->samples++;
	if (!timeline->setup.timestamped && !isnan(line_ns)) {
		int64_t drawn_ns = timeline->base_ns + (int64_t)line_ns;

		/* No sample is acquired after its arrival, even if the line is wrong. */
		if (drawn_ns < t_ns)
			t_ns = drawn_ns;
	}
	t_ns = limited(limited(t_ns) - timeline->setup.delay_ns);
	if (t_ns <= timeline->last_ns)
		t_ns = timeline->last_ns + 1;
	timeline->last_ns = t_ns;
	return t_ns;
}

void incise_timeline_report(const struct incise_timeline *timeline,
			    struct incise_timeline_report *report)
{
	const struct incise_envelope *env = &timeline->envelope;
	double slope, slope_sd;

	*report = (struct incise_timeline_report){
		.samples = timeline->samples,
		.rate_hz = NAN,
		.drift_ppm = NAN,
		.drift_sd_ppm = NAN,
		.jitter_ns = NAN,
		.jitter_max_ns = timeline->jitter_n > 0 ? timeline->jitter_max_ns : NAN,
		.late = timeline->late,
		.lines = timeline->lines,
		.offset_ns = (double)timeline->setup.delay_ns,
		.offset_sd_ns = timeline->setup.timestamped
					? (double)timeline->setup.delay_sd_ns
					: NAN,
	};
	if (timeline->jitter_n > 1)
		report->jitter_ns =
			sqrt(timeline->jitter_sum2 / (timeline->jitter_n - 1));
	/*
	 * At the limit of the line's slope the true rate is not known, nor where a clock that is as far off
	 * as none of its type has not yet shown its rate.
	 */
	if (measure_slope(timeline, &slope, &slope_sd) &&
	    fabs(slope) < 0.99 * INCISE_ENVELOPE_SLOPE_MAX &&
	    (fabs(slope) < FAR_OFF || slope_sd < FAR_OFF / 4)) {
		/* periods are longer by the slope, so the rate is lower */
		report->rate_hz = 1e9 / (timeline->period_ns * (1 + slope));
		report->drift_ppm = (1 / (1 + slope) - 1) * 1e6;
		report->drift_sd_ppm = slope_sd * 1e6;
	}
	if (!timeline->setup.timestamped && timeline->started) {
		double x_ns = (double)(timeline->last_seq - timeline->base_seq) *
			      timeline->period_ns;

		report->offset_ns += env->gap_ns;
		report->offset_sd_ns = hypot((double)timeline->setup.delay_sd_ns,
					     envelope_sd(env, x_ns));
	}
}
