// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The lowest and highest slopes of a model over its support; see slope.h.
 *
 * Certified by branch and bound: the support is cut into patches whose slopes are
 * enclosed (model_grid.h), and only those that may hold a steeper slope than one that is
 * already met, by more than a tolerance, are cut again. The rest encloses all slopes.
 *
 *   ┌───┬───┬─┬─┐
 *   │   │   ├─┼─┤   where the steepest slope may be, patches are small
 *   ├───┼───┼─┴─┤
 *   │   │   │   │
 *   └───┴───┴───┘
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include "interval.h"
#include "model.h"
#include "model_grid.h"
#include "slope.h"

/* Share of the larger end: a stiffness that is known to 1 % is known well. */
#define TOLERANCE 0.01

/* A looser bound is worth less than an estimate. */
#define LOOSEST 0.2

/* Boxes per input to begin with, how often they are cut, and how many may be left. */
#define FIRST 16
#define ROUNDS 16
#define BOXES_MAX 2048

/* Secants, as a share of the support: a model's and, because its output is rounded, a
 * compiled model's. */
#define MODEL_SECANT (1.0 / 1024)
#define FIXED_SECANT 256
#define FIXED_SECANT_LSB 64

/* The most points to search from, and the cost of one, in degrees and rules. */
#define POINTS_MAX 8192
#define POINTS_WORK (1 << 21)
#define POINTS_MIN 256

/* The first step uphill as a share of the box, and how often it is halved. */
#define FIRST_STEP (1.0 / 16)
#define HALVINGS 8

/* Uphill from more than one point, for there may be more than one hill. */
#define STARTS 4

struct box {
	struct interval x[2];
	struct interval f[2]; /* slopes */
};

struct branches {
	const struct incise_grid *grid;
	struct interval met[2];	  /* slopes that are surely met: hi may be below lo */
	struct interval bound[2]; /* of all boxes that are done with */
};

static void blocks_over(const struct incise_grid *grid, struct incise_block block[2],
			const struct interval x[2])
{
	incise_block_over(&block[0], &grid->a, x[0]);
	incise_block_over(&block[1], &grid->b, x[1]);
}

/*
 * Enclose a box's slopes in two ways and take what both allow: directly, and as the slopes in
 * its middle plus second derivatives times the way from there, which is tighter for small boxes.
 * The slopes in the middle are met.
 */
static void look_slope(struct branches *b, struct box *box)
{
	struct incise_block block[2];
	struct incise_patch patch;
	struct interval middle[2], off[2], at[2], mixed;

	for (int i = 0; i < 2; i++) {
		middle[i] = iv(box->x[i].lo + (box->x[i].hi - box->x[i].lo) / 2);
		off[i] = iv_sub(box->x[i], middle[i]);
	}
	blocks_over(b->grid, block, middle);
	incise_patch_slopes(&patch, b->grid, &block[0], &block[1]);
	at[0] = patch.f1;
	at[1] = patch.f2;
	blocks_over(b->grid, block, box->x);
	incise_patch_over(&patch, b->grid, &block[0], &block[1]);
	mixed = incise_patch_mixed(&patch, b->grid, &block[0], &block[1]);
	box->f[0] =
		iv_add(at[0], iv_add(iv_mul(patch.f11, off[0]), iv_mul(mixed, off[1])));
	box->f[1] =
		iv_add(at[1], iv_add(iv_mul(mixed, off[0]), iv_mul(patch.f22, off[1])));
	box->f[0] = iv_intersect(box->f[0], patch.f1);
	box->f[1] = iv_intersect(box->f[1], patch.f2);
	for (int i = 0; i < 2; i++) {
		b->met[i].lo = fmin(b->met[i].lo, at[i].hi);
		b->met[i].hi = fmax(b->met[i].hi, at[i].lo);
		/* A NaN would be lost in fmin(). */
		if (isnan(box->f[i].lo) || isnan(box->f[i].hi))
			box->f[i] = (struct interval){-INFINITY, INFINITY};
	}
}

/* True where a box adds no more than a tolerance to the slopes that are met. */
static bool is_done(const struct branches *b, const struct box *box, double tolerance)
{
	for (int i = 0; i < 2; i++) {
		double may = tolerance * iv_mag(b->met[i]);

		if (!(box->f[i].lo >= b->met[i].lo - may &&
		      box->f[i].hi <= b->met[i].hi + may))
			return false;
	}
	return true;
}

/* Cut in two along each input that has a width. @return number of parts */
static int cut_slope_box(const struct box *box, struct box *part)
{
	int n = 1;

	part[0] = *box;
	for (int i = 0; i < 2; i++) {
		double middle = box->x[i].lo + (box->x[i].hi - box->x[i].lo) / 2;

		if (!(middle > box->x[i].lo && middle < box->x[i].hi))
			continue;
		for (int k = 0; k < n; k++) {
			part[n + k] = part[k];
			part[k].x[i].hi = part[n + k].x[i].lo = middle;
		}
		n *= 2;
	}
	return n;
}

/*
 * Go through the boxes; those that must be cut are left, cut, in @next. Where they would
 * be too many, the tolerance grows.
 */
static int narrow(struct branches *b, struct box *box, int n, struct box *next, bool last)
{
	double tolerance = TOLERANCE;
	int n_next = 0, open;

	for (int k = 0; k < n; k++)
		look_slope(b, &box[k]);
	do {
		open = 0;
		for (int k = 0; k < n; k++)
			open += !is_done(b, &box[k], tolerance);
		tolerance *= 2;
	} while (4 * open > BOXES_MAX && tolerance < LOOSEST);
	last |= 4 * open > BOXES_MAX;
	for (int k = 0; k < n; k++) {
		if (!last && !is_done(b, &box[k], tolerance / 2)) {
			n_next += cut_slope_box(&box[k], next + n_next);
			continue;
		}
		for (int i = 0; i < 2; i++) {
			b->bound[i].lo = fmin(b->bound[i].lo, box[k].f[i].lo);
			b->bound[i].hi = fmax(b->bound[i].hi, box[k].f[i].hi);
		}
	}
	return n_next;
}

static int first_boxes(const struct incise_grid *grid, struct box *box)
{
	const struct incise_axis *axis[] = {&grid->a, &grid->b};
	int n_a = grid->one ? 1 : FIRST, n = 0;

	for (int ka = 0; ka < n_a; ka++)
		for (int kb = 0; kb < FIRST; kb++, n++) {
			const int k[] = {ka, kb}, of[] = {n_a, FIRST};

			for (int i = 0; i < 2; i++) {
				double from = axis[i]->min, to = axis[i]->max;

				/* The same expression on both sides of a cut: no gap. */
				box[n].x[i].lo = from + (to - from) * k[i] / of[i];
				box[n].x[i].hi =
					k[i] + 1 < of[i]
						? from + (to - from) * (k[i] + 1) / of[i]
						: to;
			}
		}
	return n;
}

/* 0; -ERANGE where nothing useful can be certified and the slopes are those met; -ENOMEM. */
static int enclose(const struct incise_grid *grid, struct incise_slope *slopes)
{
	static const struct interval none = {INFINITY, -INFINITY};
	struct branches b = {.grid = grid, .met = {none, none}, .bound = {none, none}};
	struct box *boxes = malloc(2 * BOXES_MAX * sizeof(*boxes));
	struct incise_grid_size size;
	struct box *now = boxes, *next = boxes + BOXES_MAX;
	int n, n_inputs = grid->one ? 1 : 2;

	if (!boxes)
		return -ENOMEM;
	incise_grid_size(grid, &size);
	n = size.parts < INCISE_GRID_LARGEST ? first_boxes(grid, now) : 0;
	for (int round = 1; n; round++) {
		struct box *then = now;

		n = narrow(&b, now, n, next, round == ROUNDS);
		now = next;
		next = then;
	}
	free(boxes);
	for (int i = 0; i < n_inputs; i++) {
		const struct interval *bound = &b.bound[i + 2 - n_inputs];
		const struct interval *met = &b.met[i + 2 - n_inputs];
		double may = LOOSEST * iv_mag(*met);

		slopes[i] = (struct incise_slope){bound->lo, bound->hi, true};
		if (bound->lo >= met->lo - may && bound->hi <= met->hi + may)
			continue;
		for (int k = 0; k < n_inputs; k++) {
			met = &b.met[k + 2 - n_inputs];
			slopes[k] = (struct incise_slope){met->lo, met->hi, false};
		}
		return -ERANGE;
	}
	return 0;
}

/*
 * --- estimates ---
 *
 * Points spread evenly over the box, then from the best of them uphill by steps along the inputs
 * that grow shorter.
 */

/* A point and the slope there, negated where the lowest is sought. */
struct slope_place {
	double slope;
	double x[INCISE_MODEL_INPUTS_MAX];
};

/*
 * Fractions of k·φ^-1, k·φ^-2 … for the φ > 1 with φ^(n+1) = φ + 1, the golden ratio for
 * n = 1: they leave no large gap in n dimensions, for any number of points.
 */
static void even_steps(double *step, int n)
{
	double phi = 2, power = 1;

	for (int k = 0; k < 64; k++)
		phi = pow(1 + phi, 1.0 / (n + 1));
	for (int i = 0; i < n; i++) {
		power /= phi;
		step[i] = power;
	}
}

static double climb(const struct incise_secant *s, int input, double sign,
		    struct slope_place *place)
{
	/* Both ends' climbs together ask as often as the points before them. */
	int left = s->n_points / (2 * STARTS);
	double share = FIRST_STEP;

	for (int halving = 0; halving < HALVINGS && left > 0;) {
		struct slope_place best = *place;

		for (int k = 0; k < 2 * s->n_inputs; k++) {
			struct slope_place next = *place;
			int i = k / 2;
			double by = (s->max[i] - s->min[i]) * share;

			next.x[i] += k % 2 ? by : -by;
			next.x[i] = fmax(s->min[i], fmin(s->max[i], next.x[i]));
			next.slope = sign * s->slope(s->of, next.x, input);
			left--;
			if (next.slope > best.slope)
				best = next;
		}
		if (best.slope > place->slope) {
			*place = best;
			continue;
		}
		share /= 2;
		halving++;
	}
	return place->slope;
}

/* Keep the best, the steepest first. */
static void keep_slope(struct slope_place *best, const struct slope_place *place)
{
	int k = STARTS;

	while (k > 0 && !(best[k - 1].slope >= place->slope))
		k--;
	if (k == STARTS)
		return;
	memmove(&best[k + 1], &best[k], (size_t)(STARTS - 1 - k) * sizeof(*best));
	best[k] = *place;
}

static void search_slope(const struct incise_secant *s, int input,
			 struct incise_slope *slope)
{
	struct slope_place best[2][STARTS];
	double step[INCISE_MODEL_INPUTS_MAX];

	even_steps(step, s->n_inputs);
	for (int k = 0; k < STARTS; k++) {
		best[0][k].slope = -INFINITY;
		memcpy(best[0][k].x, s->min, sizeof(s->min));
		best[1][k] = best[0][k];
	}
	for (int k = 0; k < s->n_points; k++) {
		struct slope_place place;

		for (int i = 0; i < s->n_inputs; i++) {
			double u = fmod(0.5 + k * step[i], 1);

			place.x[i] = s->min[i] * (1 - u) + s->max[i] * u;
		}
		place.slope = s->slope(s->of, place.x, input);
		keep_slope(best[1], &place);
		place.slope = -place.slope;
		keep_slope(best[0], &place);
	}
	*slope = (struct incise_slope){INFINITY, -INFINITY, false};
	for (int k = 0; k < STARTS; k++) {
		slope->lowest = fmin(slope->lowest, -climb(s, input, -1, &best[0][k]));
		slope->highest = fmax(slope->highest, climb(s, input, 1, &best[1][k]));
	}
}

/* Real numbers within min … max only are asked for, and nothing is allocated. */
void incise_secant_search(const struct incise_secant *secant, struct incise_slope *slopes)
{
	for (int i = 0; i < secant->n_inputs; i++)
		search_slope(secant, i, &slopes[i]);
}

static double model_slope(const void *of, const double *x, int i)
{
	const struct incise_model *model = of;
	const struct incise_variable *in = &model->info.input[i];
	double width = (in->max - in->min) * MODEL_SECANT;
	double at[INCISE_MODEL_INPUTS_MAX], lo, hi, from;

	for (int k = 0; k < model->info.n_inputs; k++)
		at[k] = x[k];
	lo = fmax(in->min, fmin(x[i] - width / 2, in->max - width));
	hi = fmin(in->max, lo + width);
	at[i] = lo;
	from = incise_model_eval(model, at, NULL);
	at[i] = hi;
	/* A support of a few ulp may leave no width. */
	return hi > lo ? (incise_model_eval(model, at, NULL) - from) / (hi - lo) : 0;
}

/* Widen the slopes by those that are found. */
static void search_model(const struct incise_model *model, struct incise_slope *slopes)
{
	struct incise_slope found[INCISE_MODEL_INPUTS_MAX];
	int n = model->info.n_inputs;
	struct incise_secant secant = {.of = model, .n_inputs = n, .slope = model_slope};
	int points = POINTS_WORK / (n * (model->info.n_rules + 12 * n));

	secant.n_points = points > POINTS_MAX	? POINTS_MAX
			  : points < POINTS_MIN ? POINTS_MIN
						: points;
	for (int i = 0; i < n; i++) {
		secant.min[i] = model->info.input[i].min;
		secant.max[i] = model->info.input[i].max;
	}
	incise_secant_search(&secant, found);
	for (int i = 0; i < n; i++) {
		slopes[i].lowest = fmin(slopes[i].lowest, found[i].lowest);
		slopes[i].highest = fmax(slopes[i].highest, found[i].highest);
	}
}

int incise_model_slopes(const struct incise_model *model, struct incise_slope *slopes)
{
	struct incise_grid *grid = malloc(sizeof(*grid));
	int rc;

	if (!grid)
		return -ENOMEM;
	for (int i = 0; i < model->info.n_inputs; i++)
		slopes[i] = (struct incise_slope){INFINITY, -INFINITY, false};
	rc = incise_grid_init(grid, model, NULL);
	if (!rc)
		rc = enclose(grid, slopes);
	free(grid);
	if (rc == -ENOMEM)
		return rc;
	if (rc)
		search_model(model, slopes);
	return 0;
}

/* Inputs in LSB; output and input have the same LSB, so that slopes come out in units. */
static double fixed_slope(const void *of, const double *x, int i)
{
	const struct incise_fixed *fx = of;
	const struct incise_fixed_input *in = &fx->input[i];
	int64_t range = (int64_t)in->max - in->min, width = range / FIXED_SECANT, lo;
	int32_t at[INCISE_FIXED_INPUTS_MAX], from;

	if (width < FIXED_SECANT_LSB)
		width = range < FIXED_SECANT_LSB ? range : FIXED_SECANT_LSB;
	for (int k = 0; k < fx->n_inputs; k++)
		at[k] = (int32_t)lrint(x[k]);
	lo = at[i] - width / 2;
	lo = lo > in->max - width ? in->max - width : lo;
	lo = lo < in->min ? in->min : lo;
	at[i] = (int32_t)lo;
	from = incise_fixed_eval(fx, at);
	at[i] = (int32_t)(lo + width);
	return (double)((int64_t)incise_fixed_eval(fx, at) - from) / (double)width;
}

void incise_fixed_slopes(const struct incise_fixed *fx, struct incise_slope *slopes)
{
	struct incise_secant secant = {
		.of = fx,
		.n_inputs = fx->n_inputs,
		.n_points = POINTS_MAX,
		.slope = fixed_slope,
	};

	for (int i = 0; i < fx->n_inputs; i++) {
		secant.min[i] = fx->input[i].min;
		secant.max[i] = fx->input[i].max;
	}
	incise_secant_search(&secant, slopes);
}
