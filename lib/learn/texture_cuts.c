// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The cuts of sources at full rate, for a texture: rows in their order, where the blade advances, over the
 * way of the front through new tissue.
 *
 *   way  the column way_UNIT of raw exports and recordings; else the largest depth so far
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/corpus.h>
#include "../base/grow.h"
#include "../model/companion.h"
#include "interval.h"
#include "reader.h"
#include "realism.h"

/* More rows tell no more of a texture; the cut with the last of them is the last one. */
#define ROWS_MOST 4000000

/* Rows within so much time count as one, their mean: 1 kHz is the rate of the loop. */
#define APART_S 0.95e-3

/* A cut is divided into so many parts, each with its ratio of forces. */
#define PARTS 8

/* A part has at least such a share of the force of the mean part of its cut. */
#define PART_LEAST 0.05

/* Columns behind those of the model. */
enum further { WAY, TIME, COUNT, FURTHER };

struct own_cut {
	size_t start; /* of its rows; they end where those of the next one start */
	bool held;    /* it is for checking */
};

struct cuts {
	const struct incise_trained *trained;
	const struct incise_corpus_source *source; /* the present one */
	int n_inputs, depth;			   /* number of the input */
	struct incise_texture_row *row;		   /* of all cuts */
	size_t n, capacity;
	struct own_cut *cut;
	size_t n_cuts, most; /* the latter: capacity */
	char name[256];	     /* of the present one */
	double t_s, first_s; /* of the last row; of the first one of the mean */
	struct incise_texture_row mean; /* its sums … */
	double in_mean;			/* … of so many rows */
};

static int no_cuts_memory(struct incise_error *err)
{
	return incise_error_set(err, ENOMEM, "no memory to learn a texture");
}

/* Whether the training has held out the pairs of a cut: alone, or with all of its source. */
static bool is_held(const struct cuts *cuts, const char *name)
{
	const struct incise_corpus_source *source = cuts->source;
	const struct incise_corpus *corpus = cuts->trained->corpus;

	for (int i = 0; corpus && i < incise_corpus_sources(corpus); i++) {
		const struct incise_corpus_survey *of = incise_corpus_source(corpus, i);
		uint64_t key = incise_group_key(source->own_groups ? of->hash : "", name);
		bool same = !strncmp(of->name, source->name, sizeof(of->name) - 1);

		for (int g = 0; same && g < of->n_groups; g++)
			if (of->groups[g].check &&
			    (*of->group || of->groups[g].key == key))
				return true;
	}
	return false;
}

/* Add the mean as a row of the present cut if the front has gone on. Returns whether there is memory. */
static bool end_mean(struct cuts *cuts)
{
	size_t start = cuts->n_cuts ? cuts->cut[cuts->n_cuts - 1].start : 0;
	double n = cuts->in_mean;
	struct incise_texture_row mean = {cuts->mean.way / n, cuts->mean.force / n,
					  cuts->mean.model / n};

	cuts->mean = (struct incise_texture_row){0};
	cuts->in_mean = 0;
	if (!n || (cuts->n > start && mean.way <= cuts->row[cuts->n - 1].way))
		return true;
	if (!grow_array(&cuts->row, cuts->n, &cuts->capacity, 4096, sizeof(mean)))
		return false;
	cuts->row[cuts->n++] = mean;
	return true;
}

static bool begin_cut(struct cuts *cuts, const char *name)
{
	if (!end_mean(cuts) ||
	    !grow_array(&cuts->cut, cuts->n_cuts, &cuts->most, 64, sizeof(*cuts->cut)))
		return false;
	cuts->cut[cuts->n_cuts++] = (struct own_cut){cuts->n, is_held(cuts, name)};
	snprintf(cuts->name, sizeof(cuts->name), "%s", name);
	cuts->t_s = -INFINITY;
	return true;
}

static int take_cut_row(void *user, const double *row, const char *group,
			struct incise_error *err)
{
	struct cuts *cuts = user;
	const double *more = row + cuts->n_inputs + 1;
	bool other = strncmp(cuts->name, group, sizeof(cuts->name) - 1);

	if (!isnan(more[COUNT]))
		return incise_error_set(
			err, EINVAL,
			"its rows are means over bins (count); a texture needs each sample, "
			"as incise export writes without --average");
	if (other && cuts->n >= ROWS_MOST)
		return 0;
	if (other && !begin_cut(cuts, group))
		return no_cuts_memory(err);
	if (more[TIME] < cuts->t_s)
		return incise_error_set(
			err, EINVAL,
			"t_s falls from %g to %g in cut %s; a texture needs the rows in "
			"their order, as incise export writes them",
			cuts->t_s, more[TIME], group);
	cuts->t_s = fmax(more[TIME], cuts->t_s);
	if (!(cuts->t_s - cuts->first_s < APART_S) && !end_mean(cuts))
		return no_cuts_memory(err);
	if (!cuts->in_mean)
		cuts->first_s = more[TIME];
	cuts->mean.way += isnan(more[WAY]) ? row[cuts->depth] : more[WAY];
	cuts->mean.force += row[cuts->n_inputs];
	cuts->mean.model += incise_model_eval(cuts->trained->model, row, NULL);
	cuts->in_mean++;
	return 0;
}

/*
 * The sd of the logarithm of one factor for each cut: the part that the parts of a cut have in common, by
 * analysis of variance. NaN: no memory.
 */
static double find_variation(const struct incise_texture_cut *cuts, int n)
{
	struct incise_unit *unit;
	double mean = 0, square = 0, all = 0, within;

	if (n < 2)
		return 0;
	unit = calloc((size_t)n, sizeof(*unit));
	for (int i = 0; i < n && unit; i++) {
		double force[PARTS] = {0}, model[PARTS] = {0}, sum = 0;

		for (size_t k = 0; k < cuts[i].n; k++) {
			force[k * PARTS / cuts[i].n] += cuts[i].row[k].force;
			model[k * PARTS / cuts[i].n] += cuts[i].row[k].model;
			sum += cuts[i].row[k].model;
		}
		for (int p = 0; p < PARTS; p++) {
			double least = PART_LEAST * sum / PARTS, ratio;

			if (!(model[p] > least) || !(force[p] > least))
				continue;
			ratio = log(force[p] / model[p]);
			unit[i].n++;
			unit[i].sum += ratio;
			square += ratio * ratio;
		}
		mean += unit[i].sum;
		all += unit[i].n;
	}
	mean /= fmax(all, 1);
	for (int i = 0; i < n && unit; i++)
		unit[i].sum -= mean * unit[i].n;
	square = unit ? incise_common_variance(unit, n, square - all * mean * mean,
					       &within)
		      : NAN;
	free(unit);
	/* The mean is of the same cuts. */
	return isnan(square) ? NAN : fmin(sqrt(square * n / (n - 1)), 1);
}

/* The cuts that are held out, or the others; returns their number. */
static int list_cuts(const struct cuts *cuts, bool held, struct incise_texture_cut *list)
{
	int n = 0;

	for (size_t i = 0; i < cuts->n_cuts; i++) {
		size_t at = cuts->cut[i].start;
		size_t end = i + 1 < cuts->n_cuts ? cuts->cut[i + 1].start : cuts->n;

		if (cuts->cut[i].held == held)
			list[n++] = (struct incise_texture_cut){cuts->row + at, end - at};
	}
	return n;
}

/* The rows of the sources as cuts, the texture of these, and of those held out how alike it is. */
static struct incise_texture *learn_cuts(const struct cuts *cuts, uint64_t seed,
					 struct incise_realism *realism,
					 struct incise_watch *watch,
					 struct incise_error *err)
{
	struct incise_texture_cut *list = calloc(cuts->n_cuts + 1, sizeof(*list));
	struct incise_texture *texture = NULL;
	double length = 0;
	int n, rc = 0;

	if (!list)
		return no_cuts_memory(err), NULL;
	n = list_cuts(cuts, false, list);
	for (int i = 0; i < n; i++)
		if (list[i].n)
			length += list[i].row[list[i].n - 1].way - list[i].row->way;
	texture = incise_texture_learn(list, n, seed, watch, err);
	rc = texture ? 0 : errno;
	if (texture) {
		texture->checksum = incise_model_checksum(cuts->trained->model);
		texture->info.length = length;
		texture->info.variation = find_variation(list, n);
	}
	/* Where no texture helps, the model alone is compared. */
	if ((texture && isnan(texture->info.variation)) ||
	    ((texture || rc == EDOM) && realism &&
	     incise_realism_of(texture, list, list_cuts(cuts, true, list), seed,
			       realism))) {
		incise_texture_free(texture);
		texture = NULL;
		rc = -no_cuts_memory(err);
	}
	free(list);
	errno = rc;
	return texture;
}

/* The unit of the way, by the name of a depth; NULL with an error: there is none. */
static const char *find_depth(struct cuts *cuts, struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(cuts->trained->model);

	for (; cuts->depth < info->n_inputs; cuts->depth++)
		if (!strncmp(info->input[cuts->depth].name, "depth_", 6))
			return info->input[cuts->depth].name + 6;
	return INCISE_ERROR_NULL(err, EINVAL,
				 "a texture goes by the way of a blade: the model has no "
				 "input depth_UNIT, for example depth_mm");
}

struct incise_texture *incise_train_texture(struct incise_train_source *sources, int n,
					    const struct incise_trained *trained,
					    const struct incise_train_options *options,
					    struct incise_realism *realism,
					    struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(trained->model);
	struct incise_watch watch = incise_watch_of(options);
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1 + FURTHER];
	struct incise_reading reading = {.columns = columns,
					 .n_required = info->n_inputs + 1,
					 .n_columns = info->n_inputs + 1 + FURTHER,
					 .where = "advancing",
					 .cost = 5e3,
					 .watch = &watch};
	struct cuts cuts = {.trained = trained, .n_inputs = info->n_inputs};
	const char *unit = find_depth(&cuts, err);
	struct incise_texture *texture = NULL;
	struct incise_reader *readers;
	char way[40];
	int rc;

	if (!unit)
		return NULL;
	snprintf(way, sizeof(way), "way_%.15s", unit);
	for (int i = 0; i < info->n_inputs; i++)
		columns[i] = info->input[i].name;
	columns[info->n_inputs] = info->output.name;
	memcpy(columns + info->n_inputs + 1, (const char *[]){way, "t_s", "count"},
	       FURTHER * sizeof(*columns));
	watch.step = (struct incise_train_step){.phase = INCISE_TRAIN_ADD, .sources = n};
	readers = incise_readers_new(sources, n, "cut", &reading);
	rc = readers ? 0 : no_cuts_memory(err);
	for (int i = 0; i < n && !rc; i++) {
		cuts.source = &readers[i].corpus;
		*cuts.name = '\0';
		watch.step.source = i;
		rc = cuts.source->read(cuts.source->user, take_cut_row, &cuts, err);
		if (!rc && !end_mean(&cuts))
			rc = no_cuts_memory(err);
	}
	if (!rc)
		texture = learn_cuts(&cuts, options->seed, realism, &watch, err);
	if (texture)
		snprintf(texture->info.unit, sizeof(texture->info.unit), "%.15s", unit);
	if (watch.stopped)
		incise_error_set(err, ECANCELED, "training was stopped");
	rc = texture ? 0 : errno;
	free(cuts.row);
	free(cuts.cut);
	incise_readers_free(readers, n);
	errno = rc;
	return texture;
}
