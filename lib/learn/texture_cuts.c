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
#include "../model/companion.h"
#include "interval.h"
#include "reader.h"
#include "texture.h"

/* More rows tell no more of a texture; the cut with the last of them is the last one. */
#define ROWS_MOST 4000000

/* A cut is divided into so many parts, each with its ratio of forces. */
#define PARTS 8

/* A part has at least such a share of the force of the mean part of its cut. */
#define PART_LEAST 0.05

/* Columns behind those of the model. */
enum further { WAY, TIME, COUNT, FURTHER };

struct cuts {
	const struct incise_model *model;
	int n_inputs, depth;	    /* number of the input */
	double *way, *force, *mean; /* of all rows */
	size_t n, capacity;
	size_t *start; /* of each cut, and the end of the last one */
	char **name;
	int n_cuts, first; /* the latter of the present source */
	double deepest, t_s;
};

static int no_cuts_memory(struct incise_error *err)
{
	return incise_error_set(err, ENOMEM, "no memory to learn a texture");
}

static int begin_cut(struct cuts *cuts, const char *name, struct incise_error *err)
{
	size_t n = (size_t)cuts->n_cuts + 2;
	size_t *start = realloc(cuts->start, n * sizeof(*start));
	char **names = start ? realloc(cuts->name, n * sizeof(*names)) : NULL;

	cuts->start = start ? start : cuts->start;
	cuts->name = names ? names : cuts->name;
	if (!names || !(names[cuts->n_cuts] = strdup(name)))
		return no_cuts_memory(err);
	for (int i = cuts->first; i < cuts->n_cuts; i++)
		if (!strcmp(names[i], name))
			return incise_error_set(
				err, EINVAL,
				"the rows of cut %s are not together; a texture needs "
				"them in their order, as incise export writes them",
				name);
	start[cuts->n_cuts++] = cuts->n;
	cuts->deepest = cuts->t_s = -INFINITY;
	return 0;
}

static int make_room(struct cuts *cuts, struct incise_error *err)
{
	size_t n = cuts->capacity ? 2 * cuts->capacity : 4096;
	double **of[] = {&cuts->way, &cuts->force, &cuts->mean};

	if (cuts->n < cuts->capacity)
		return 0;
	for (int i = 0; i < 3; i++) {
		double *more = realloc(*of[i], n * sizeof(**of));

		if (!more)
			return no_cuts_memory(err);
		*of[i] = more;
	}
	cuts->capacity = n;
	return 0;
}

static int take_cut_row(void *user, const double *row, const char *group,
			struct incise_error *err)
{
	struct cuts *cuts = user;
	const double *more = row + cuts->n_inputs + 1;
	const char *name = cuts->n_cuts > cuts->first ? cuts->name[cuts->n_cuts - 1] : "";
	double way;
	int rc = 0;

	if (!isnan(more[COUNT]))
		return incise_error_set(
			err, EINVAL,
			"its rows are means over bins (count); a texture needs each sample, "
			"as incise export writes without --average");
	if (cuts->n_cuts == cuts->first || strcmp(name, group)) {
		if (cuts->n >= ROWS_MOST)
			return 0;
		rc = begin_cut(cuts, group, err);
	}
	if (!rc && more[TIME] < cuts->t_s)
		return incise_error_set(
			err, EINVAL,
			"t_s falls from %g to %g in cut %s; a texture needs the rows in "
			"their order, as incise export writes them",
			cuts->t_s, more[TIME], group);
	if (!rc)
		rc = make_room(cuts, err);
	if (rc)
		return rc;
	cuts->t_s = fmax(more[TIME], cuts->t_s);
	way = isnan(more[WAY]) ? row[cuts->depth] : more[WAY];
	if (!(way > cuts->deepest))
		return 0;
	cuts->way[cuts->n] = cuts->deepest = way;
	cuts->force[cuts->n] = row[cuts->n_inputs];
	cuts->mean[cuts->n++] = incise_model_eval(cuts->model, row, NULL);
	return 0;
}

/*
 * The sd of the logarithm of one factor for each cut: the part that the parts of a cut have in common, by
 * analysis of variance.
 */
static double find_variation(const struct incise_texture_cut *cuts, int n)
{
	struct incise_unit *unit = calloc((size_t)n, sizeof(*unit));
	double mean = 0, square = 0, all = 0, within;

	for (int i = 0; i < n && unit; i++) {
		double force[PARTS] = {0}, model[PARTS] = {0}, sum = 0;

		for (size_t k = 0; k < cuts[i].n; k++) {
			force[k * PARTS / cuts[i].n] += cuts[i].force[k];
			model[k * PARTS / cuts[i].n] += cuts[i].model[k];
			sum += cuts[i].model[k];
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
		      : 0;
	free(unit);
	/* The mean is of the same cuts. */
	return n > 1 ? fmin(sqrt(square * n / (n - 1)), 1) : 0;
}

/* The rows of the sources as cuts, and the texture of these. */
static struct incise_texture *learn_cuts(const struct cuts *cuts, uint64_t seed,
					 struct incise_watch *watch,
					 struct incise_error *err)
{
	size_t n = (size_t)cuts->n_cuts;
	struct incise_texture_cut *list = calloc(n + 1, sizeof(*list));
	struct incise_texture *texture = NULL;
	double length = 0;

	if (!list)
		return no_cuts_memory(err), NULL;
	for (size_t i = 0; i < n; i++) {
		size_t at = cuts->start[i],
		       end = i + 1 < n ? cuts->start[i + 1] : cuts->n;

		list[i] = (struct incise_texture_cut){cuts->way + at, cuts->force + at,
						      cuts->mean + at, end - at};
		if (end > at)
			length += cuts->way[end - 1] - cuts->way[at];
	}
	texture = incise_texture_learn(list, (int)n, seed, watch, err);
	if (texture) {
		texture->checksum = incise_model_checksum(cuts->model);
		texture->info.length = length;
		texture->info.variation = find_variation(list, (int)n);
	}
	free(list);
	return texture;
}

static int read_cuts(struct cuts *cuts, struct incise_reader *sources, int n,
		     struct incise_watch *watch, struct incise_error *err)
{
	int rc = 0;

	for (int i = 0; i < n && !rc; i++) {
		struct incise_corpus_source *source = &sources[i].corpus;

		watch->step.source = i;
		cuts->first = cuts->n_cuts;
		rc = source->read(source->user, take_cut_row, cuts, err);
	}
	return rc;
}

/* The unit of the way, by the name of a depth; NULL with an error: there is none. */
static const char *find_depth(struct cuts *cuts, struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(cuts->model);

	for (; cuts->depth < info->n_inputs; cuts->depth++)
		if (!strncmp(info->input[cuts->depth].name, "depth_", 6))
			return info->input[cuts->depth].name + 6;
	return INCISE_ERROR_NULL(err, EINVAL,
				 "a texture goes by the way of a blade: the model has no "
				 "input depth_UNIT, for example depth_mm");
}

struct incise_texture *incise_train_texture(struct incise_train_source *sources, int n,
					    const struct incise_model *model,
					    const struct incise_train_options *options,
					    struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(model);
	struct incise_watch watch = incise_watch_of(options);
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1 + FURTHER];
	struct incise_reading reading = {.columns = columns,
					 .n_required = info->n_inputs + 1,
					 .n_columns = info->n_inputs + 1 + FURTHER,
					 .where = "advancing",
					 .cost = 5e3,
					 .watch = &watch};
	struct cuts cuts = {.model = model, .n_inputs = info->n_inputs};
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
	rc = readers ? read_cuts(&cuts, readers, n, &watch, err) : no_cuts_memory(err);
	if (!rc)
		texture = learn_cuts(&cuts, options->seed, &watch, err);
	if (texture)
		snprintf(texture->unit, sizeof(texture->unit), "%.15s", unit);
	if (watch.stopped)
		incise_error_set(err, ECANCELED, "training was stopped");
	rc = texture ? 0 : errno;
	for (int i = 0; i < cuts.n_cuts; i++)
		free(cuts.name[i]);
	free(cuts.name);
	free(cuts.start);
	free(cuts.way);
	free(cuts.force);
	free(cuts.mean);
	incise_readers_free(readers, n);
	errno = rc;
	return texture;
}
