// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Lower envelope of arrivals; see envelope.h.
 */
#include <math.h>
#include <string.h>
#include "envelope.h"

#define BLOCKS INCISE_ENVELOPE_BLOCKS

#define SLOPE_MAX INCISE_ENVELOPE_SLOPE_MAX
#define SLOPE_SD_FIRST 300e-6
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

double incise_envelope_bend(double span_ns)
{
	/* Change of rate of a crystal that warms up. */
	const double per_s = 2e-7;

	return per_s / 1e9 * span_ns * span_ns / 8;
}

double incise_envelope_sd(const struct incise_envelope *env, double x_ns)
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
static int choose(struct incise_envelope *env,
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

static void draw(struct incise_envelope *env)
{
	const struct incise_envelope_block *chosen[BLOCKS] = {NULL};
	double excess[BLOCKS], x_ns = 0, y_ns = INFINITY, slope, span_ns;
	int n = choose(env, chosen);

	for (int i = 0; i < n; i++)
		x_ns += chosen[i]->x_ns / n;
	span_ns = chosen[n - 1]->x_ns - chosen[0]->x_ns;
	if (hull_slope(chosen, n, x_ns, &slope)) {
		/* A short line defines the rate less well than the device's type. */
		double sd = n < SHAPE_BLOCKS || env->slope_sd <= 0 ? 1e-2 : env->slope_sd;
		double prior = env->prior_slope_sd * env->prior_slope_sd;

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
	env->gap_sd_ns = hypot(env->gap_sd_ns, incise_envelope_bend(span_ns));
	env->slope_sd = fmin(env->slope_sd, env->prior_slope_sd);
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
		draw(env);
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
