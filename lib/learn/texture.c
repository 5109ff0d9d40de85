// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Learning of a texture: pieces of τ = F / (k · model) − 1, with a factor k for each cut, between the places
 * where it rises through 0. Length, rise and falls of a piece stay together as they were recorded, and a
 * joint of two pieces is no fall.
 *
 *   window  τ is taken less its mean over so much of the way: bends of the model are no texture
 *   gain    τ is scaled: noise of the sensor and bends of the model add to it
 *
 * Both are chosen by cross-validation: each half of the cuts is rendered with pieces of the other one, and
 * its spectrum and its rate of events are compared with the recorded ones. Where the model alone comes as
 * near, there is no texture.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/random.h"
#include "realism.h"

/* With fewer events, the 95 % interval of their rate is wider than ± a half. */
#define EVENTS_LEAST 20

/* Where the model has a smaller share of its largest force, the ratio to it is large by chance. */
#define MODEL_LEAST 0.05

/* Below the most of a tape, whose mean is moved to 0. */
#define TAU_MOST (INCISE_TEXTURE_MOST * 19 / 20)

/* A part of a cut with more points, of long steps among short ones, is used up to there. */
#define POINTS_PER_ROW 4

/* An improvement by less, dB, may be chance: there is no texture. */
#define IMPROVEMENT 0.5

struct candidate {
	double window; /* steps of the look */
	double gain;   /* 0: no texture */
};

static const double windows[] = {256, 64, 16, 4, 2}, gains[] = {1, 0.7, 0.5, 0.35, 0.25};

struct learning {
	struct incise_texture_cut *cuts; /* in random order */
	int n;
	uint64_t seed;
	struct incise_watch *watch;
	struct incise_look recorded;
	double step;	   /* of the way, between points */
	double *tau, *sum; /* of the points of a cut */
	double *force;	   /* of the cuts, rendered */
};

/* --- pieces --- */

/* Take the mean over a window of so many points away; towards the ends it gets smaller. */
static void take_running_mean(struct learning *learning, size_t n, double window)
{
	double *sum = learning->sum;

	sum[0] = 0;
	for (size_t i = 0; i < n; i++)
		sum[i + 1] = sum[i] + learning->tau[i];
	for (size_t i = 0; i < n; i++) {
		size_t half = i < n - 1 - i ? i : n - 1 - i;

		half = (size_t)fmin((double)half, window / 2);
		learning->tau[i] -=
			(sum[i + half + 1] - sum[i - half]) / (double)(2 * half + 1);
	}
}

/*
 * τ of part of a cut at each step, that of the nearest row: means of rows would make falls less steep. Returns
 * the number of points.
 */
static size_t find_tau(struct learning *learning, const struct incise_texture_cut *cut,
		       double window)
{
	struct incise_texture_cut part = incise_look_part(cut, learning->sum);
	double *tau = learning->tau, least = 0, mean = 0, step = learning->step;
	const struct incise_texture_row *row = part.row;
	size_t n = 0, k = 0;

	for (size_t i = 0; i < part.n; i++)
		least = fmax(least, MODEL_LEAST * row[i].model);
	for (; k + 1 < part.n && n < POINTS_PER_ROW * part.n; n++) {
		double at = row->way + (double)n * step;

		while (k + 1 < part.n && row[k + 1].way - at < at - row[k].way)
			k++;
		tau[n] = row[k].force / fmax(row[k].model, least);
		mean += tau[n];
	}
	mean /= fmax((double)n, 1);
	if (!(mean > 0 && isfinite(mean)))
		return 0;
	for (size_t i = 0; i < n; i++)
		tau[i] = tau[i] / mean - 1;
	take_running_mean(learning, n, window * learning->recorded.step / step);
	return n;
}

static void add_piece(struct incise_texture *texture, size_t *points, const double *tau,
		      size_t n, double gain)
{
	if (n > INCISE_TEXTURE_PIECE || *points + n > INCISE_TEXTURE_POINTS ||
	    texture->n_curves == INCISE_TEXTURE_CURVES)
		return;
	for (size_t i = 0; i < n; i++) {
		double point = rint(gain * tau[i] * INCISE_TEXTURE_ONE) + 0.0;

		point = fmax(-TAU_MOST, fmin(point, TAU_MOST));
		texture->point[(*points)++] = point;
		texture->info.most =
			fmax(texture->info.most, fabs(point) / INCISE_TEXTURE_ONE);
	}
	texture->n[texture->n_curves++] = (int)n;
}

/* Pieces of cuts: a like share of each if all have too many points; NULL: there are none, or no memory. */
static struct incise_texture *find_pieces(struct learning *learning,
					  const struct incise_texture_cut *cuts, int n,
					  const struct candidate *candidate)
{
	double share = INCISE_TEXTURE_POINTS * learning->step / learning->recorded.length;
	struct incise_texture *texture = calloc(1, sizeof(*texture));
	uint64_t at = 0;
	size_t points = 0;

	if (!texture)
		return NULL;
	texture->step = learning->step;
	for (int i = 0; i < n; i++) {
		const double *tau = learning->tau;
		size_t m = find_tau(learning, &cuts[i], candidate->window), from = 0;

		for (size_t k = 1; k < m; k++) {
			if (!(tau[k - 1] < 0 && tau[k] >= 0))
				continue;
			if (from && incise_random_uniform(learning->seed, at++) < share)
				add_piece(texture, &points, tau + from, k - from,
					  candidate->gain);
			from = k;
		}
	}
	if (points)
		return texture;
	incise_texture_free(texture);
	return NULL;
}

/* --- cross-validation --- */

/* Look at each half of the cuts, rendered with pieces of the other one. 0, -ENODATA (no pieces), -ENOMEM. */
static int render_halves(struct learning *learning, const struct candidate *candidate,
			 struct incise_look *look)
{
	int half = learning->n / 2;
	double *force = learning->force;

	*look = (struct incise_look){.step = learning->recorded.step,
				     .noise = learning->recorded.noise};
	for (int i = 0; i < 2; i++) {
		int from = i ? half : 0, n = i ? learning->n - half : half;
		struct incise_fixed_texture knots;
		struct incise_texture *texture = NULL;

		if (candidate->gain) {
			texture = find_pieces(learning, learning->cuts + half - from,
					      learning->n - n, candidate);
			if (!texture)
				return -ENODATA;
		}
		incise_texture_fill(texture, 0, learning->seed, &knots);
		incise_texture_free(texture);
		incise_look_render(&knots, learning->cuts + from, n, look->noise,
				   learning->seed + (uint64_t)i, force);
		force += incise_look_rows(learning->cuts, half);
	}
	return incise_look_at(look, learning->cuts, learning->n, learning->force);
}

/*
 * The candidate nearest to the recorded cuts, if it improves on no texture, which is the first; note what was
 * seen of both. 0, -ENOMEM or -ECANCELED.
 */
static int choose_candidate(struct learning *learning, struct candidate *best,
			    struct incise_texture_info *info)
{
	const struct incise_look *recorded = &learning->recorded;
	int n_gains = sizeof(gains) / sizeof(*gains);
	int n = 1 + n_gains * (int)(sizeof(windows) / sizeof(*windows)), rc = 0;
	double least = INFINITY;

	for (int i = 0; i < n && rc != -ENOMEM && rc != -ECANCELED; i++) {
		struct candidate candidate = {0};
		struct incise_look look;

		if (i)
			candidate = (struct candidate){windows[(i - 1) / n_gains],
						       gains[(i - 1) % n_gains]};
		rc = render_halves(learning, &candidate, &look);
		if (!rc) {
			double rate = look.shape.rate / recorded->shape.rate;
			double error = incise_look_distance(&look, recorded);
			double score = error + fabs(INCISE_DECIBEL(fmax(rate, 1e-3)));

			if (score < least) {
				least = score - (i ? 0 : IMPROVEMENT);
				*best = candidate;
				info->error[i > 0] = error;
				info->rendered = look.shape;
			}
		}
		free(look.drop);
		if (learning->watch && incise_watch_ask(learning->watch))
			rc = -ECANCELED;
	}
	return rc == -ENODATA ? 0 : rc;
}

/* --- texture --- */

static struct incise_texture *learn_pieces(struct learning *learning,
					   struct incise_error *err)
{
	struct incise_look *recorded = &learning->recorded;
	int rc = incise_look_at(recorded, learning->cuts, learning->n, NULL);
	struct incise_texture_info info = {.n_cuts = learning->n,
					   .n_events = (int)recorded->n_events,
					   .up_to_cycles = 0.5 / recorded->step};
	struct incise_texture *texture = NULL;
	struct candidate best = {0};
	int shift = INCISE_TEXTURE_SHIFT_LEAST;

	if (!rc && (learning->n < 2 || recorded->n_events < EVENTS_LEAST))
		return INCISE_ERROR_NULL(
			err, ENODATA,
			"%zu events (falls of the force by at least 2 %% of its largest and 6 "
			"sd of the noise) in %d cuts; a texture needs %d in 2 cuts or more, "
			"so that their rate is known within a half: record more cuts, at "
			"full rate",
			recorded->n_events, learning->n, EVENTS_LEAST);
	while (shift < INCISE_TEXTURE_SHIFT_MOST &&
	       ldexp(1, shift - 15) <= recorded->step)
		shift++;
	learning->step = ldexp(1, shift - 16);
	rc = rc ? rc : choose_candidate(learning, &best, &info);
	if (!rc && !best.gain)
		return INCISE_ERROR_NULL(
			err, EDOM,
			"no texture makes unseen cuts more alike the recorded ones than "
			"the model alone, which has %.2g times their events "
			"(cross-validated); fewer membership functions (--mf) make it "
			"smoother",
			info.rendered.rate / recorded->shape.rate);
	if (!rc)
		texture = find_pieces(learning, learning->cuts, learning->n, &best);
	if (!texture)
		return INCISE_ERROR_NULL(err, rc ? -rc : ENOMEM, "%s",
					 rc == -ECANCELED
						 ? "training was stopped"
						 : "no memory to learn a texture");
	info.recorded = recorded->shape;
	info.most = texture->info.most;
	texture->info = info;
	return texture;
}

struct incise_texture *incise_texture_learn(const struct incise_texture_cut *cuts, int n,
					    uint64_t seed, struct incise_watch *watch,
					    struct incise_error *err)
{
	struct learning learning = {
		.n = n, .seed = incise_random_mix(seed + 1), .watch = watch};
	struct incise_texture *texture = NULL;
	size_t rows = incise_look_rows(cuts, n), room = POINTS_PER_ROW * rows + 1;

	learning.tau = calloc(rows + 2 * room, sizeof(*learning.tau));
	learning.cuts = calloc((size_t)n + 1, sizeof(*cuts));
	if (learning.tau && learning.cuts) {
		learning.sum = learning.tau + room;
		learning.force = learning.sum + room;
		for (int i = 0; i < n; i++) {
			int j = (int)(incise_random_bits(seed, (uint64_t)i) %
				      (uint64_t)(i + 1));

			learning.cuts[i] = learning.cuts[j];
			learning.cuts[j] = cuts[i];
		}
		texture = learn_pieces(&learning, err);
	} else {
		incise_error_set(err, ENOMEM, "no memory to learn a texture");
	}
	if (texture)
		texture->info.seed = seed;
	free(learning.tau);
	free(learning.cuts);
	free(learning.recorded.drop);
	return texture;
}
