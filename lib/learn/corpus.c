// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Training from many sources; see incise/corpus.h.
 *
 * A row has a random number that is a function of the seed, of its source's hash and of its
 * place there. The sample are the rows with the smallest ones; without groups, so are the rows
 * that are held out, by another number. So both are the same for any order of the sources.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/corpus.h>
#include "../base/random.h"
#include "design.h"
#include "pairs.h"

#define COLUMNS_MAX (INCISE_MODEL_INPUTS_MAX + 1)

/* A row that may be in the sample. */
struct candidate {
	uint64_t key, source, row, group; /* source: as of source_number() */
	double values[COLUMNS_MAX];
};

/* A group of all sources. */
struct group {
	uint64_t key, rows;
	int number; /* in order of the sources and of appearance */
	bool check;
};

struct incise_corpus {
	int columns;
	bool grouped;
	uint64_t seed;
	struct incise_corpus_survey *surveys;
	int n_surveys, survey_capacity;
	struct candidate *heap; /* the largest key first, until it is settled */
	size_t n_heap, heap_capacity, sample;
	const volatile int *stop;		/* or NULL */
	struct incise_propagation *propagation; /* or NULL */
	/* After settling: */
	struct group *groups; /* by key */
	int n_groups;
	uint64_t threshold; /* of rows held out, without groups */
	bool held, settled;
	struct incise_corpus_side sides[2]; /* fit, check */
};

struct incise_corpus *incise_corpus_new(int n_inputs, bool grouped, uint64_t seed,
					size_t sample)
{
	struct incise_corpus *corpus = calloc(1, sizeof(*corpus));

	if (!corpus)
		return NULL;
	corpus->columns = n_inputs + 1;
	corpus->grouped = grouped;
	corpus->seed = seed;
	corpus->sample = sample;
	return corpus;
}

void incise_corpus_free(struct incise_corpus *corpus)
{
	if (!corpus)
		return;
	for (int i = 0; i < corpus->n_surveys; i++)
		free(corpus->surveys[i].groups);
	free(corpus->surveys);
	free(corpus->heap);
	free(corpus->groups);
	for (int side = 0; side < 2; side++)
		incise_train_side_free(&corpus->sides[side].sample);
	free(corpus);
}

void incise_corpus_set_stop(struct incise_corpus *corpus, const volatile int *stop)
{
	corpus->stop = stop;
}

void incise_corpus_weigh(struct incise_corpus *corpus,
			 struct incise_propagation *propagation)
{
	corpus->propagation = propagation;
}

static bool is_stopped(const struct incise_corpus *corpus)
{
	return corpus->stop && *corpus->stop;
}

/* --- random numbers of rows ---------------------------------------------------------- */

static uint64_t source_number(const char *hash)
{
	uint64_t number = 0;

	for (int i = 0; i < 16 && hash[i]; i++)
		number = number * 16 +
			 (uint64_t)(hash[i] <= '9' ? hash[i] - '0' : hash[i] - 'a' + 10);
	return number;
}

enum use { FOR_SAMPLE, FOR_CHECK };

static uint64_t row_key(const struct incise_corpus *corpus, enum use use, uint64_t source,
			uint64_t row)
{
	uint64_t key = incise_random_mix(corpus->seed * 2 + use + 1) ^ source;

	return incise_random_bits(incise_random_mix(key), row);
}

/* --- the sample ---------------------------------------------------------------------- */

static bool before(const struct candidate *a, const struct candidate *b)
{
	if (a->key != b->key)
		return a->key < b->key;
	return a->source != b->source ? a->source < b->source : a->row < b->row;
}

static void sift_down(struct candidate *heap, size_t n)
{
	struct candidate moved = heap[0];
	size_t at = 0;

	for (size_t child; (child = 2 * at + 1) < n; at = child) {
		child += child + 1 < n && before(&heap[child], &heap[child + 1]);
		if (!before(&moved, &heap[child]))
			break;
		heap[at] = heap[child];
	}
	heap[at] = moved;
}

static int offer(struct incise_corpus *corpus, const struct candidate *c)
{
	struct candidate *heap = corpus->heap;
	size_t at = corpus->n_heap;

	if (corpus->n_heap == corpus->sample) {
		if (!before(c, &heap[0]))
			return 0;
		heap[0] = *c;
		sift_down(heap, corpus->n_heap);
		return 0;
	}
	if (at == corpus->heap_capacity) {
		size_t capacity = at ? 2 * at : 1024;

		heap = realloc(heap, capacity * sizeof(*heap));
		if (!heap)
			return -ENOMEM;
		corpus->heap = heap;
		corpus->heap_capacity = capacity;
	}
	corpus->n_heap++;
	for (; at && before(&heap[(at - 1) / 2], c); at = (at - 1) / 2)
		heap[at] = heap[(at - 1) / 2];
	heap[at] = *c;
	return 0;
}

/* --- surveys ------------------------------------------------------------------------- */

/* Groups of a source by key: open addressing, twice as many places as groups at least. */
struct surveyor {
	struct incise_corpus *corpus;
	const struct incise_corpus_source *source;
	struct incise_corpus_survey *survey;
	uint64_t number; /* of the source */
	int capacity, last;
	int *place; /* 2 × capacity; group + 1, or 0 */
};

static uint64_t key_of(const struct incise_corpus_source *source, const char *group)
{
	if (source->group)
		return incise_group_key("", source->group);
	return group ? incise_group_key(source->own_groups ? source->hash : "", group)
		     : 0;
}

static int rehash(struct surveyor *s)
{
	int capacity = s->capacity ? 2 * s->capacity : 64;
	struct incise_corpus_group *groups =
		realloc(s->survey->groups, capacity * sizeof(*groups));
	int *place = calloc(2 * (size_t)capacity, sizeof(*place));

	if (groups)
		s->survey->groups = groups;
	if (!groups || !place) {
		free(place);
		return -ENOMEM;
	}
	for (int g = 0; g < s->survey->n_groups; g++) {
		uint64_t at = groups[g].key % (2 * capacity);

		while (place[at])
			at = (at + 1) % (2 * capacity);
		place[at] = g + 1;
	}
	free(s->place);
	s->place = place;
	s->capacity = capacity;
	return 0;
}

static struct incise_corpus_group *find_survey_group(struct surveyor *s, uint64_t key,
						     const char *name)
{
	struct incise_corpus_survey *survey = s->survey;
	struct incise_corpus_group *group;
	uint64_t at;

	if (s->last < survey->n_groups && survey->groups[s->last].key == key)
		return &survey->groups[s->last];
	if (survey->n_groups == s->capacity && rehash(s))
		return NULL;
	at = key % (2 * s->capacity);
	while (s->place[at] && survey->groups[s->place[at] - 1].key != key)
		at = (at + 1) % (2 * s->capacity);
	if (!s->place[at]) {
		group = &survey->groups[survey->n_groups++];
		*group = (struct incise_corpus_group){.key = key};
		snprintf(group->name, sizeof(group->name), "%s", name);
		s->place[at] = survey->n_groups;
	}
	s->last = s->place[at] - 1;
	return &survey->groups[s->last];
}

static int survey_row(void *user, const double *row, const char *name,
		      struct incise_error *err)
{
	struct surveyor *s = user;
	struct incise_corpus *corpus = s->corpus;
	struct incise_corpus_survey *survey = s->survey;
	struct candidate c = {.source = s->number,
			      .row = survey->rows,
			      .group = key_of(s->source, name)};
	struct incise_corpus_group *group =
		find_survey_group(s, c.group,
				  s->source->group ? s->source->group
				  : name	   ? name
						   : "");

	if (is_stopped(corpus))
		return incise_error_set(err, ECANCELED, "canceled");
	if (!group)
		return incise_error_set(err, ENOMEM, "no memory for more groups");
	for (int i = 0; i < corpus->columns; i++) {
		if (!group->rows || row[i] < group->min[i])
			group->min[i] = row[i];
		if (!group->rows || row[i] > group->max[i])
			group->max[i] = row[i];
		if (!survey->rows || row[i] < survey->min[i])
			survey->min[i] = row[i];
		if (!survey->rows || row[i] > survey->max[i])
			survey->max[i] = row[i];
		group->sum[i] += row[i];
		c.values[i] = row[i];
	}
	group->rows++;
	survey->rows++;
	c.key = row_key(corpus, FOR_SAMPLE, c.source, c.row);
	return offer(corpus, &c)
		       ? incise_error_set(err, ENOMEM, "no memory for more rows")
		       : 0;
}

static int add_survey(struct incise_corpus *corpus, const char *hash, const char *text,
		      struct incise_error *err)
{
	for (int i = 0; i < corpus->n_surveys; i++)
		if (!strcmp(corpus->surveys[i].hash, hash))
			return incise_error_set(
				err, EEXIST,
				"%s: has the same content as %s; give each recording once",
				text, corpus->surveys[i].text);
	if (corpus->n_surveys == corpus->survey_capacity) {
		int capacity = corpus->survey_capacity ? 2 * corpus->survey_capacity : 16;
		void *surveys =
			realloc(corpus->surveys, capacity * sizeof(*corpus->surveys));

		if (!surveys)
			return incise_error_set(err, ENOMEM, "no memory");
		corpus->surveys = surveys;
		corpus->survey_capacity = capacity;
	}
	corpus->surveys[corpus->n_surveys] = (struct incise_corpus_survey){0};
	snprintf(corpus->surveys[corpus->n_surveys].hash, sizeof(corpus->surveys->hash),
		 "%s", hash);
	snprintf(corpus->surveys[corpus->n_surveys].text, sizeof(corpus->surveys->text),
		 "%s", text);
	return 0;
}

int incise_corpus_survey(struct incise_corpus *corpus,
			 const struct incise_corpus_source *source,
			 struct incise_error *err)
{
	struct surveyor s = {.corpus = corpus,
			     .source = source,
			     .number = source_number(source->hash)};
	int rc = add_survey(corpus, source->hash, source->text, err);

	if (rc)
		return rc;
	s.survey = &corpus->surveys[corpus->n_surveys++];
	rc = source->read(source->user, survey_row, &s, err);
	free(s.place);
	return rc;
}

/* --- for other processes ------------------------------------------------------------- */

/* Of one program on machines of one kind: structs as they are in memory. */
struct header {
	char magic[8];
	int32_t columns, n_surveys;
	uint64_t n_heap, size;
};

void *incise_corpus_encode(const struct incise_corpus *corpus, size_t *size)
{
	struct header header = {.magic = "survey1",
				.columns = corpus->columns,
				.n_surveys = corpus->n_surveys,
				.n_heap = corpus->n_heap};
	char *bytes, *at;

	*size = sizeof(header) + corpus->n_heap * sizeof(*corpus->heap);
	for (int i = 0; i < corpus->n_surveys; i++)
		*size += sizeof(*corpus->surveys) +
			 corpus->surveys[i].n_groups * sizeof(struct incise_corpus_group);
	header.size = *size;
	bytes = at = malloc(*size);
	if (!bytes)
		return NULL;
	memcpy(at, &header, sizeof(header));
	at += sizeof(header);
	memcpy(at, corpus->heap, corpus->n_heap * sizeof(*corpus->heap));
	at += corpus->n_heap * sizeof(*corpus->heap);
	for (int i = 0; i < corpus->n_surveys; i++) {
		const struct incise_corpus_survey *survey = &corpus->surveys[i];
		size_t n = survey->n_groups * sizeof(*survey->groups);

		memcpy(at, survey, sizeof(*survey));
		at += sizeof(*survey);
		if (n)
			memcpy(at, survey->groups, n);
		at += n;
	}
	return bytes;
}

int incise_corpus_add(struct incise_corpus *corpus, const void *bytes, size_t size,
		      struct incise_error *err)
{
	const char *at = bytes, *end = at + size;
	struct header header;
	static const char *const damaged = "surveys of another process are damaged";
	int rc = 0;

	if (size < sizeof(header))
		return incise_error_set(err, EINVAL, "%s", damaged);
	memcpy(&header, at, sizeof(header));
	at += sizeof(header);
	if (memcmp(header.magic, "survey1", 8) || header.columns != corpus->columns ||
	    header.size != size || header.n_surveys < 0 ||
	    (size_t)(end - at) / sizeof(struct candidate) < header.n_heap)
		return incise_error_set(err, EINVAL, "%s", damaged);
	for (uint64_t i = 0; i < header.n_heap; i++, at += sizeof(struct candidate)) {
		struct candidate c;

		memcpy(&c, at, sizeof(c));
		if (offer(corpus, &c))
			return incise_error_set(err, ENOMEM, "no memory for more rows");
	}
	for (int i = 0; i < header.n_surveys && !rc; i++) {
		struct incise_corpus_survey survey, *to;
		size_t n;

		if ((size_t)(end - at) < sizeof(survey))
			return incise_error_set(err, EINVAL, "%s", damaged);
		memcpy(&survey, at, sizeof(survey));
		at += sizeof(survey);
		survey.hash[64] = survey.text[sizeof(survey.text) - 1] = 0;
		n = (size_t)survey.n_groups * sizeof(*survey.groups);
		if (survey.n_groups < 0 || (size_t)(end - at) < n)
			return incise_error_set(err, EINVAL, "%s", damaged);
		rc = add_survey(corpus, survey.hash, survey.text, err);
		if (rc)
			return rc;
		to = &corpus->surveys[corpus->n_surveys++];
		*to = survey;
		to->groups = malloc(n + 1);
		if (!to->groups) {
			to->n_groups = 0;
			return incise_error_set(err, ENOMEM, "no memory");
		}
		memcpy(to->groups, at, n);
		at += n;
		for (int g = 0; g < to->n_groups; g++)
			survey.rows -= to->groups[g].rows;
		if ((corpus->grouped && survey.rows) ||
		    strspn(to->hash, "0123456789abcdef") != 64)
			return incise_error_set(err, EINVAL, "%s", damaged);
	}
	return rc;
}

/* --- settling ------------------------------------------------------------------------ */

static int by_hash(const void *a, const void *b)
{
	const struct incise_corpus_survey *p = a, *q = b;

	return strcmp(p->hash, q->hash);
}

static int by_source_and_row(const void *a, const void *b)
{
	const struct candidate *p = a, *q = b;

	if (p->source != q->source)
		return p->source < q->source ? -1 : 1;
	return (p->row > q->row) - (p->row < q->row);
}

static int by_key(const void *a, const void *b)
{
	const struct group *p = a, *q = b;

	if (p->key != q->key)
		return p->key < q->key ? -1 : 1;
	return p->number - q->number;
}

static int by_number(const void *a, const void *b)
{
	const struct group *p = a, *q = b;

	return p->number - q->number;
}

static const struct group *find_group(const struct incise_corpus *corpus, uint64_t key)
{
	int low = 0, high = corpus->n_groups;

	while (low + 1 < high) {
		int middle = (low + high) / 2;

		if (corpus->groups[middle].key <= key)
			low = middle;
		else
			high = middle;
	}
	return &corpus->groups[low];
}

/* The groups of all sources, those of one key together, numbered by first appearance. */
static int join_groups(struct incise_corpus *corpus)
{
	size_t total = 0;
	struct group *groups;
	int n = 0;

	for (int i = 0; i < corpus->n_surveys; i++)
		total += corpus->surveys[i].n_groups;
	if (total > INT32_MAX)
		return -ENOMEM;
	groups = corpus->groups = malloc((total + 1) * sizeof(*groups));
	if (!groups)
		return -ENOMEM;
	for (int i = 0; i < corpus->n_surveys; i++)
		for (int g = 0; g < corpus->surveys[i].n_groups; g++, n++)
			groups[n] = (struct group){
				.key = corpus->surveys[i].groups[g].key,
				.rows = corpus->surveys[i].groups[g].rows,
				.number = n,
			};
	qsort(groups, n, sizeof(*groups), by_key);
	for (int i = 0; i < n; i++) {
		struct group *last = &groups[corpus->n_groups - 1];

		if (corpus->n_groups && last->key == groups[i].key)
			last->rows += groups[i].rows;
		else
			groups[corpus->n_groups++] = groups[i];
	}
	qsort(groups, corpus->n_groups, sizeof(*groups), by_number);
	for (int i = 0; i < corpus->n_groups; i++)
		groups[i].number = i;
	return 0;
}

/* Groups in order of their numbers; afterwards in order of their keys. */
static int hold_out_groups(struct incise_corpus *corpus, double share,
			   struct incise_error *err)
{
	uint64_t *count = malloc((corpus->n_groups + 1) * sizeof(*count));
	int rc;

	if (!count)
		return incise_error_set(err, ENOMEM, "no memory for its groups");
	for (int i = 0; i < corpus->n_groups; i++)
		count[i] = corpus->groups[i].rows;
	rc = incise_split_units(count, corpus->n_groups, share, corpus->seed, "groups",
				err);
	for (int i = 0; i < corpus->n_groups && !rc; i++)
		corpus->groups[i].check = !count[i];
	free(count);
	return rc;
}

/* Find the key of the n-th row by counting keys, 16 bits at a time. */
static void hold_out_rows(struct incise_corpus *corpus, uint64_t n)
{
	static const int bits = 16;
	uint64_t prefix = 0;

	for (int done = 0; done < 64; done += bits) {
		uint64_t count[1 << 16] = {0}, below = 0;
		int bin = 0;

		for (int i = 0; i < corpus->n_surveys; i++) {
			uint64_t source = source_number(corpus->surveys[i].hash);

			for (uint64_t r = 0; r < corpus->surveys[i].rows; r++) {
				uint64_t key = row_key(corpus, FOR_CHECK, source, r);

				if (!done || key >> (64 - done) == prefix)
					count[key >> (48 - done) & 0xffff]++;
			}
		}
		while (below + count[bin] < n)
			below += count[bin++];
		n -= below;
		prefix = prefix << bits | (uint64_t)bin;
	}
	corpus->threshold = prefix;
}

static bool is_check(const struct incise_corpus *corpus, uint64_t source, uint64_t row,
		     uint64_t group)
{
	if (!corpus->held)
		return false;
	return corpus->grouped
		       ? find_group(corpus, group)->check
		       : row_key(corpus, FOR_CHECK, source, row) <= corpus->threshold;
}

static int take_sample(struct incise_corpus *corpus)
{
	for (int side = 0; side < 2; side++) {
		struct incise_train_side *to = &corpus->sides[side].sample;
		double *rows =
			malloc((corpus->n_heap + 1) * corpus->columns * sizeof(*rows));

		to->groups = corpus->grouped
				     ? malloc((corpus->n_heap + 1) * sizeof(*to->groups))
				     : NULL;
		to->pairs = (struct incise_pairs){rows, 0, corpus->columns - 1};
		if (!rows || (corpus->grouped && !to->groups))
			return -ENOMEM;
	}
	qsort(corpus->heap, corpus->n_heap, sizeof(*corpus->heap), by_source_and_row);
	for (size_t i = 0; i < corpus->n_heap; i++) {
		const struct candidate *c = &corpus->heap[i];
		struct incise_train_side *to =
			&corpus->sides[is_check(corpus, c->source, c->row, c->group)]
				 .sample;

		memcpy((double *)to->pairs.rows + to->pairs.n * corpus->columns,
		       c->values, corpus->columns * sizeof(double));
		if (to->groups)
			to->groups[to->pairs.n] = find_group(corpus, c->group)->number;
		to->pairs.n++;
	}
	return 0;
}

static void count_sides(struct incise_corpus *corpus)
{
	struct incise_corpus_side *fit = &corpus->sides[0], *check = &corpus->sides[1];

	for (int i = 0; i < corpus->n_surveys; i++) {
		struct incise_corpus_survey *survey = &corpus->surveys[i];

		fit->rows += survey->rows;
		for (int g = 0; g < survey->n_groups && corpus->grouped && corpus->held;
		     g++) {
			struct incise_corpus_group *group = &survey->groups[g];

			group->check = find_group(corpus, group->key)->check;
			check->rows += group->check ? group->rows : 0;
		}
	}
	for (int i = 0; i < corpus->n_groups && corpus->grouped; i++)
		corpus->sides[corpus->groups[i].check].n_groups++;
	fit->sample.n_groups = fit->n_groups;
	check->sample.n_groups = check->n_groups;
}

int incise_corpus_settle(struct incise_corpus *corpus, double share,
			 struct incise_error *err)
{
	uint64_t rows = 0;
	int rc = 0;

	if (corpus->n_surveys)
		qsort(corpus->surveys, corpus->n_surveys, sizeof(*corpus->surveys),
		      by_hash);
	for (int i = 0; i < corpus->n_surveys; i++)
		rows += corpus->surveys[i].rows;
	if (!rows)
		return incise_error_set(err, ENODATA, "there are no rows to train from");
	if (join_groups(corpus))
		return incise_error_set(err, ENOMEM, "no memory for its groups");
	corpus->held = share > 0;
	if (share > 0 && corpus->grouped) {
		rc = hold_out_groups(corpus, share, err);
	} else if (share > 0) {
		double n = fmax(1, fmin(nearbyint(share * rows), rows - 1));

		if (rows < 2)
			return incise_error_set(err, EINVAL,
						"1 rows: at least two are required to "
						"hold out some for checking");
		hold_out_rows(corpus, (uint64_t)n);
		corpus->sides[1].rows = (uint64_t)n;
	}
	if (rc)
		return rc;
	qsort(corpus->groups, corpus->n_groups, sizeof(*corpus->groups), by_key);
	count_sides(corpus);
	corpus->sides[0].rows -= corpus->sides[1].rows;
	corpus->settled = true;
	return take_sample(corpus)
		       ? incise_error_set(err, ENOMEM, "no memory for a sample of rows")
		       : 0;
}

int incise_corpus_sources(const struct incise_corpus *corpus)
{
	return corpus->n_surveys;
}

const struct incise_corpus_survey *incise_corpus_source(
	const struct incise_corpus *corpus, int i)
{
	return &corpus->surveys[i];
}

const struct incise_corpus_side *incise_corpus_side(const struct incise_corpus *corpus,
						    bool check)
{
	return &corpus->sides[check];
}

void incise_corpus_ranges(const struct incise_corpus *corpus, double *min, double *max)
{
	bool first = true;

	for (int i = 0; i < corpus->n_surveys; i++)
		for (int g = 0; g < corpus->surveys[i].n_groups; g++) {
			const struct incise_corpus_group *group =
				&corpus->surveys[i].groups[g];

			if (group->check)
				continue;
			for (int c = 0; c < corpus->columns; c++) {
				min[c] = first ? group->min[c]
					       : fmin(min[c], group->min[c]);
				max[c] = first ? group->max[c]
					       : fmax(max[c], group->max[c]);
			}
			first = false;
		}
}

/* --- sums ---------------------------------------------------------------------------- */

struct folder {
	const struct incise_corpus *corpus;
	const struct incise_corpus_source *source;
	struct incise_factor *fit, *check;
	uint64_t number, row, left_out;
};

static int fold_row(void *user, const double *row, const char *name,
		    struct incise_error *err)
{
	struct folder *f = user;
	uint64_t group = key_of(f->source, name), at = f->row++;
	struct incise_error own;
	int rc;

	if (is_stopped(f->corpus))
		return incise_error_set(err, ECANCELED, "canceled");
	/* Without groups each row is in a part of cross-validation by itself. */
	if (is_check(f->corpus, f->number, at, group)) {
		rc = incise_factor_add(f->check, row, group, &own);
		f->left_out += rc == -ERANGE;
		rc = rc == -ERANGE ? 0 : rc;
	} else {
		double weight =
			f->corpus->propagation
				? incise_propagation_add(f->corpus->propagation, row)
				: 1;

		rc = incise_factor_add_weighted(f->fit, row,
						f->corpus->grouped
							? group
							: row_key(f->corpus, FOR_SAMPLE,
								  f->number, at),
						weight, &own);
	}
	return rc ? incise_error_set(err, -rc, "%s: row %llu of those used: %.300s",
				     f->source->name, (unsigned long long)at + 1,
				     own.text)
		  : 0;
}

int incise_corpus_fold(const struct incise_corpus *corpus,
		       const struct incise_corpus_source *source,
		       struct incise_factor *fit, struct incise_factor *check,
		       uint64_t *left_out, struct incise_error *err)
{
	struct folder f = {.corpus = corpus,
			   .source = source,
			   .fit = fit,
			   .check = check,
			   .number = source_number(source->hash)};
	const struct incise_corpus_survey *survey = NULL;
	int rc;

	for (int i = 0; i < corpus->n_surveys; i++)
		if (!strcmp(corpus->surveys[i].hash, source->hash))
			survey = &corpus->surveys[i];
	rc = incise_factor_start(fit, source->hash, source->text, err);
	if (!rc && corpus->propagation)
		rc = incise_propagation_origin(
			corpus->propagation, source->hash,
			source->calibration ? source->calibration : source->hash, err);
	if (!rc && check)
		rc = incise_factor_start(check, source->hash, source->text, err);
	if (!rc)
		rc = source->read(source->user, fold_row, &f, err);
	if (!rc && (!survey || f.row != survey->rows))
		rc = incise_error_set(err, ESTALE,
				      "%s: has changed while it was read; train from a "
				      "file that nobody writes",
				      source->name);
	for (int g = 0; g < (survey && corpus->grouped ? survey->n_groups : 0); g++)
		if (!survey->groups[g].check)
			incise_factor_count(fit, survey->groups[g].key, 1,
					    survey->groups[g].rows);
	if (left_out)
		*left_out += f.left_out;
	return rc;
}
