// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The look of cuts; see realism.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "../base/grow.h"
#include "../base/random.h"
#include "realism.h"

#define WINDOW 32 /* cells; windows overlap by half */

/* A fall that is an event: in sd of the noise, and as a share of the cut's largest force. */
#define FALL_SD 6
#define FALL_SHARE 0.02

/* A part with more cells, of long steps among short ones, is looked at up to there. */
#define CELLS_PER_ROW 4

/* sd of a normal distribution over the median of |second difference|: 1/(0.6745 √6). */
#define SD_OF_BENDS 0.60527

/* --- part of a cut, step of the way and noise --- */

/* The part is at least so fast and has such a force, relative to almost the most. */
#define FAST_SHARE 0.2
#define FORCE_SHARE 0.5
#define ALMOST 0.99

size_t incise_look_rows(const struct incise_texture_cut *cuts, int n)
{
	size_t rows = 0;

	for (int i = 0; i < n; i++)
		rows += cuts[i].n;
	return rows;
}

static double take_quantile(double *numbers, size_t n, double share)
{
	qsort(numbers, n, sizeof(*numbers), ascending);
	return n ? numbers[(size_t)(share * (double)(n - 1))] : 0;
}

struct incise_texture_cut incise_look_part(const struct incise_texture_cut *cut,
					   double *numbers)
{
	const struct incise_texture_row *row = cut->row;
	double fast, strong;
	size_t from = cut->n, to = 0;

	for (size_t i = 1; i < cut->n; i++)
		numbers[i - 1] = row[i].way - row[i - 1].way;
	fast = FAST_SHARE * take_quantile(numbers, cut->n ? cut->n - 1 : 0, ALMOST);
	for (size_t i = 0; i < cut->n; i++)
		numbers[i] = row[i].force;
	strong = FORCE_SHARE * take_quantile(numbers, cut->n, ALMOST);
	for (size_t i = 1; i < cut->n; i++)
		if (row[i].way - row[i - 1].way >= fast && row[i].force >= strong) {
			from = from < i ? from : i;
			to = i + 1;
		}
	from = from < to ? from : to;
	return (struct incise_texture_cut){row + from, to - from};
}

/* The medians of the way of a row, and of the second differences of the force. */
static void find_scales(struct incise_look *look, const struct incise_texture_cut *cuts,
			int n, double *numbers)
{
	size_t m = 0;

	for (int c = 0; c < n; c++) {
		struct incise_texture_cut part = incise_look_part(&cuts[c], numbers + m);

		for (size_t k = 1; k < part.n; k++)
			numbers[m++] = part.row[k].way - part.row[k - 1].way;
	}
	look->step = m ? take_quantile(numbers, m, 0.5) : 1;
	m = 0;
	for (int c = 0; c < n; c++) {
		const struct incise_texture_row *row = cuts[c].row;

		for (size_t k = 2; k < cuts[c].n; k++)
			numbers[m++] = fabs(row[k].force - 2 * row[k - 1].force +
					    row[k - 2].force);
	}
	look->noise = take_quantile(numbers, m, 0.5) * SD_OF_BENDS;
}

/* --- one cut --- */

/* The means of the line through the rows over cells of one step; returns their number, @most or fewer. */
static size_t average_cells(const struct incise_texture_cut *cut, const double *rendered,
			    double step, double *cell, size_t most)
{
	const struct incise_texture_row *row = cut->row;
	double at = 0, sum = 0;
	size_t n = 0;

	for (size_t i = 1; i < cut->n; i++) {
		double force = rendered ? rendered[i - 1] : row[i - 1].force;
		double from = at, until = row[i].way - row[0].way;
		double slope = ((rendered ? rendered[i] : row[i].force) - force) /
			       (until - from);

		while (n < most && at < until) {
			double edge = (double)(n + 1) * step, to = fmin(edge, until);

			sum += (to - at) * (force + slope * ((at + to) / 2 - from));
			at = to;
			if (to < edge)
				continue;
			cell[n++] = sum / step;
			sum = 0;
		}
	}
	return n;
}

static int add_drop(struct incise_look *look, double top, double bottom)
{
	if (!grow_array(&look->drop, look->n_events, &look->capacity, 64,
			sizeof(*look->drop)))
		return -ENOMEM;
	look->drop[look->n_events++] = bottom > 0 ? (top - bottom) / top : 1;
	return 0;
}

/*
 * A fall ends where the force rises again by as much as makes an event:
 *
 *   top ─╮     ╭
 *        ╰╮   ╭╯  least
 *         ╰───╯ bottom
 */
static int find_events(struct incise_look *look, const double *cell, size_t n,
		       double least)
{
	double top = n ? cell[0] : 0, bottom = top;
	bool falls = false;
	int rc = 0;

	for (size_t i = 1; i < n && !rc; i++) {
		bottom = fmin(bottom, cell[i]);
		if (!falls && cell[i] > top)
			top = bottom = cell[i];
		else if (!falls)
			falls = top - cell[i] >= least;
		else if (cell[i] - bottom >= least) {
			rc = add_drop(look, top, bottom);
			falls = false;
			top = bottom = cell[i];
		}
	}
	return falls && !rc ? add_drop(look, top, bottom) : rc;
}

/* Sums of windows and of differences. */
struct sums {
	double power[INCISE_TEXTURE_OCTAVES], square, force;
	double difference[3]; /* of its powers 1 … 3 */
	double windows, spectra, cells;
};

static void add_rms(struct sums *sums, const double *cell)
{
	double mean = 0, slope = 0, square = 0, width = 0;

	for (int i = 0; i < WINDOW; i++)
		mean += cell[i] / WINDOW;
	for (int i = 0; i < WINDOW; i++) {
		double t = i - (WINDOW - 1) / 2.0;

		slope += t * cell[i];
		width += t * t;
		square += (cell[i] - mean) * (cell[i] - mean);
	}
	sums->square += fmax(square - slope * slope / width, 0) / WINDOW;
	sums->force += mean;
	sums->windows++;
}

/* The power of the differences of WINDOW + 1 cells in the octaves, with the window of Hann. */
static void add_spectrum(struct sums *sums, const double *cell)
{
	double x[WINDOW], mean = (cell[WINDOW] - cell[0]) / WINDOW;
	int last = WINDOW / 2;

	for (int i = 0; i < WINDOW; i++)
		x[i] = (cell[i + 1] - cell[i] - mean) *
		       (0.5 - 0.5 * cos(2 * M_PI * (i + 1) / (WINDOW + 1)));
	for (int k = 0; k < INCISE_TEXTURE_OCTAVES; k++) {
		int first = k ? (last + 1) / 2 : last / 2;

		for (int f = first; f <= last; f++) {
			double re = 0, im = 0;

			for (int i = 0; i < WINDOW; i++) {
				re += x[i] * cos(2 * M_PI * f * i / WINDOW);
				im += x[i] * sin(2 * M_PI * f * i / WINDOW);
			}
			sums->power[k] += (re * re + im * im) / (last - first + 1);
		}
		last = first - 1;
	}
	sums->spectra++;
}

static int look_at_cells(struct incise_look *look, struct sums *sums, const double *cell,
			 size_t n, double largest)
{
	for (size_t i = 0; i + 1 < n; i++) {
		double d = cell[i + 1] - cell[i];

		sums->difference[0] += d;
		sums->difference[1] += d * d;
		sums->difference[2] += d * d * d;
		sums->cells++;
	}
	for (size_t i = 0; i + WINDOW <= n; i += WINDOW / 2) {
		add_rms(sums, cell + i);
		if (i + WINDOW < n)
			add_spectrum(sums, cell + i);
	}
	look->length += (double)n * look->step;
	return find_events(look, cell, n,
			   fmax(FALL_SD * look->noise, FALL_SHARE * largest));
}

/* --- all of them --- */

static void finish_look(struct incise_look *look, const struct sums *sums)
{
	struct incise_texture_look *shape = &look->shape;
	double m = fmax(sums->cells, 1), mean = sums->difference[0] / m,
	       square = sums->difference[1] / m, variance = fmax(square - mean * mean, 0);

	if (look->n_events)
		qsort(look->drop, look->n_events, sizeof(*look->drop), ascending);
	for (int i = 0; i < INCISE_TEXTURE_DECILES && look->n_events; i++)
		shape->drop[i] = look->drop[look->n_events * (size_t)(i + 1) /
					    (INCISE_TEXTURE_DECILES + 1)];
	shape->rate = look->length > 0 ? (double)look->n_events / look->length : 0;
	shape->rms =
		sums->force > 0 ? sqrt(sums->square * sums->windows) / sums->force : 0;
	look->skewness = variance > 0 ? (sums->difference[2] / m - 3 * mean * square +
					 2 * mean * mean * mean) /
						pow(variance, 1.5)
				      : 0;
	for (int k = 0; k < INCISE_TEXTURE_OCTAVES; k++)
		shape->octave[k] =
			INCISE_DECIBEL(sums->power[k] / fmax(sums->spectra, 1));
}

int incise_look_at(struct incise_look *look, const struct incise_texture_cut *cuts, int n,
		   const double *rendered)
{
	size_t most = CELLS_PER_ROW * incise_look_rows(cuts, n) + 1, row = 0;
	double *numbers = malloc(most * sizeof(*numbers));
	struct sums sums = {0};
	int rc = numbers ? 0 : -ENOMEM;

	if (!rc && !look->step)
		find_scales(look, cuts, n, numbers);
	for (int i = 0; i < n && !rc; row += cuts[i++].n) {
		struct incise_texture_cut part = incise_look_part(&cuts[i], numbers);
		const double *force =
			rendered ? rendered + row + (part.row - cuts[i].row) : NULL;
		double largest = 0;
		size_t m;

		for (size_t k = 0; k < cuts[i].n; k++)
			largest = fmax(largest, cuts[i].row[k].force);
		m = average_cells(&part, force, look->step, numbers, most);
		rc = look_at_cells(look, &sums, numbers, m, largest);
	}
	free(numbers);
	if (!rc)
		finish_look(look, &sums);
	return rc;
}

double incise_look_distance(const struct incise_look *a, const struct incise_look *b)
{
	double sum = 0;

	for (int k = 0; k < INCISE_TEXTURE_OCTAVES; k++)
		sum += fabs(a->shape.octave[k] - b->shape.octave[k]);
	return sum / INCISE_TEXTURE_OCTAVES;
}

double incise_look_drops(const struct incise_look *a, const struct incise_look *b)
{
	double largest = 0;
	size_t i = 0, j = 0;

	if (!a->n_events || !b->n_events)
		return 1;
	while (i < a->n_events && j < b->n_events) {
		double x = fmin(a->drop[i], b->drop[j]);

		while (i < a->n_events && a->drop[i] <= x)
			i++;
		while (j < b->n_events && b->drop[j] <= x)
			j++;
		largest = fmax(largest, fabs((double)i / (double)a->n_events -
					     (double)j / (double)b->n_events));
	}
	return largest;
}

/* --- realism --- */

#define DRAWS 8	   /* seeds of each way to render */
#define WHITE 1024 /* numbers of white noise behind a knot of the coloured one */

/* τ of a cut; see lib/fixed/texture.h. */
static double tau_at(const struct incise_fixed_texture *texture, int cut, double way)
{
	double knot = texture->start[cut % INCISE_TEXTURE_CUTS] +
		      way * 65536 / (double)(1 << texture->step_shift);
	size_t at = (size_t)fmin(fmax(knot, 0), 1e15);
	double a = texture->knot[at % INCISE_TEXTURE_KNOTS],
	       b = texture->knot[(at + 1) % INCISE_TEXTURE_KNOTS];

	return (a + (b - a) * (knot - floor(knot))) / INCISE_TEXTURE_ONE;
}

/* Replace knots by normal noise of the same spectrum: white noise, each number drawing all of them. */
static void make_noise(struct incise_fixed_texture *texture, uint64_t key)
{
	static const int n = INCISE_TEXTURE_KNOTS;
	int16_t old[INCISE_TEXTURE_KNOTS];
	double white[WHITE];

	memcpy(old, texture->knot, sizeof(old));
	for (int i = 0; i < WHITE; i++)
		white[i] = incise_random_normal(key, (uint64_t)i) / sqrt(WHITE);
	for (int i = 0; i < n; i++) {
		double sum = 0;

		for (int k = 0; k < WHITE; k++)
			sum += white[k] * old[(i + k) % n];
		texture->knot[i] = (int16_t)lrint(
			fmax(-INCISE_TEXTURE_MOST, fmin(sum, INCISE_TEXTURE_MOST)));
	}
}

double incise_look_render(const struct incise_fixed_texture *knots,
			  const struct incise_texture_cut *cuts, int n, double noise,
			  uint64_t key, double *force)
{
	double sum = 0, model = 0;
	uint64_t at = 0;

	for (int i = 0; i < n; i++)
		for (size_t k = 0; k < cuts[i].n; k++) {
			const struct incise_texture_row *row = &cuts[i].row[k];
			double f = fmax(row->model, 0);

			model += f;
			f *= 1 + tau_at(knots, i, row->way - cuts[i].row->way);
			sum += f;
			force[at] = f + noise * incise_random_normal(key, at);
			at++;
		}
	return model > 0 ? sum / model : 1;
}

/* Add one draw of one kind to its row. */
static int add_draw(const struct incise_texture *texture, enum incise_realism_kind kind,
		    uint64_t seed, const struct incise_texture_cut *cuts, int n,
		    const struct incise_look *recorded, double *force,
		    struct incise_realism_row *row)
{
	struct incise_look look = {.step = recorded->step, .noise = recorded->noise};
	struct incise_fixed_texture knots;
	double mean;
	int rc;

	incise_texture_fill(kind == INCISE_REALISM_NONE ? NULL : texture, 0, seed,
			    &knots);
	if (kind == INCISE_REALISM_NOISE)
		make_noise(&knots, incise_random_mix(seed + 1));
	mean = incise_look_render(&knots, cuts, n, look.noise, incise_random_mix(~seed),
				  force);
	rc = incise_look_at(&look, cuts, n, force);
	if (!rc) {
		row->rate += look.shape.rate / recorded->shape.rate / DRAWS;
		row->drops += incise_look_drops(&look, recorded) / DRAWS;
		row->spectrum_dB += incise_look_distance(&look, recorded) / DRAWS;
		row->rms += look.shape.rms / recorded->shape.rms / DRAWS;
		row->skewness += look.skewness / DRAWS;
		row->mean_force += (mean - 1) / DRAWS;
	}
	free(look.drop);
	return rc;
}

int incise_realism_of(const struct incise_texture *texture,
		      const struct incise_texture_cut *cuts, int n, uint64_t seed,
		      struct incise_realism *realism)
{
	double *force = malloc((incise_look_rows(cuts, n) + 1) * sizeof(*force));
	struct incise_look recorded = {0};
	int rc = force ? incise_look_at(&recorded, cuts, n, NULL) : -ENOMEM;
	double events = (double)recorded.n_events, more = events + 1;

	*realism = (struct incise_realism){.cuts = n,
					   .up_to_cycles = 0.5 / recorded.step,
					   .events = (int)recorded.n_events,
					   .skewness = recorded.skewness};
	/* The interval of Poisson of so many events; Breslow and Day (1987), after Byar. */
	if (events > 0) {
		realism->rate_low =
			pow(1 - 1 / (9 * events) - 1.96 / (3 * sqrt(events)), 3);
		realism->rate_high = more / events *
				     pow(1 - 1 / (9 * more) + 1.96 / (3 * sqrt(more)), 3);
	}
	for (int i = 0; i < INCISE_REALISM_KINDS * DRAWS && !rc; i++)
		rc = add_draw(texture, i / DRAWS, seed + (uint64_t)(i % DRAWS), cuts, n,
			      &recorded, force, &realism->kind[i / DRAWS]);
	free(recorded.drop);
	free(force);
	return rc;
}
