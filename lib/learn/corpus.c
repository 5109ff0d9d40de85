// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Training from many sources; see corpus.h.
 *
 * A row has a random number that is a function of the seed and of its values. The sample are the
 * different rows with the smallest ones; without groups, so are the rows that are held out, by
 * another number. So both are the same for any order of the sources, and rows that are equal are
 * on one side, and in one fold.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/grow.h"
#include "../base/random.h"
#include "corpus.h"
#include "pairs.h"

#define COLUMNS_MAX (INCISE_MODEL_INPUTS_MAX + 1)

/* Without groups, numbers of rows are counted by their first bits. */
#define BINS (1 << 16)
#define BIN(key) ((key) >> 48)

/* A row that may be in the sample, the first of those that are equal. */
struct candidate {
	uint64_t key, source, row, group; /* source: as of source_number() */
	uint64_t hash;			  /* of the values */
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
	int further_at, n_further; /* the sample has these behind the columns */
	bool grouped;
	uint64_t seed;
	struct incise_corpus_survey *surveys;
	int n_surveys;
	struct candidate *rows; /* those of the smallest keys first, then more */
	size_t n_rows, capacity, survey_capacity, sample;
	uint64_t limit; /* keys above it are not in the sample */
	uint64_t *bins; /* rows by their number for checking; NULL with groups */
	struct incise_propagation *propagation; /* or NULL */
	/* After settling: */
	struct group *groups; /* by key */
	int n_groups;
	uint64_t
		threshold; /* bin of the first row that is not held out, without groups */
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
	corpus->limit = UINT64_MAX;
	corpus->bins = grouped ? NULL : calloc(BINS, sizeof(*corpus->bins));
	if (!grouped && !corpus->bins) {
		free(corpus);
		return NULL;
	}
	return corpus;
}

void incise_corpus_free(struct incise_corpus *corpus)
{
	if (!corpus)
		return;
	for (int i = 0; i < corpus->n_surveys; i++)
		free(corpus->surveys[i].groups);
	free(corpus->surveys);
	free(corpus->rows);
	free(corpus->bins);
	free(corpus->groups);
	for (int side = 0; side < 2; side++)
		incise_train_side_free(&corpus->sides[side].sample);
	free(corpus);
}

void incise_corpus_weigh(struct incise_corpus *corpus,
			 struct incise_propagation *propagation)
{
	corpus->propagation = propagation;
}

void incise_corpus_keep(struct incise_corpus *corpus, int at, int n)
{
	corpus->further_at = at;
	corpus->n_further = n;
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

static uint64_t hash_row(const struct incise_corpus *corpus, const double *row)
{
	uint64_t hash = 0, bits;

	for (int i = 0; i < corpus->columns; i++) {
		double value = row[i] + 0.0; /* of -0, 0 */

		memcpy(&bits, &value, sizeof(bits));
		hash = incise_random_bits(hash, bits);
	}
	return hash;
}

static uint64_t row_key(const struct incise_corpus *corpus, enum use use, uint64_t hash)
{
	return incise_random_bits(incise_random_mix(corpus->seed * 2 + use + 1), hash);
}

/* --- the sample ---------------------------------------------------------------------- */

static int by_row_key(const void *a, const void *b)
{
	const struct candidate *p = a, *q = b;
	const uint64_t x[] = {p->key, p->group, p->source, p->row};
	const uint64_t y[] = {q->key, q->group, q->source, q->row};
	int i = 0;

	while (i < 3 && x[i] == y[i])
		i++;
	return (x[i] > y[i]) - (x[i] < y[i]);
}

/* Keep the different rows with the smallest keys. */
static void squeeze(struct incise_corpus *corpus)
{
	struct candidate *rows = corpus->rows;
	size_t n = 0;

	if (corpus->n_rows)
		qsort(rows, corpus->n_rows, sizeof(*rows), by_row_key);
	for (size_t i = 0; i < corpus->n_rows; i++)
		if (!n || rows[n - 1].key != rows[i].key ||
		    rows[n - 1].group != rows[i].group)
			rows[n++] = rows[i];
	corpus->n_rows = n;
	if (n <= corpus->sample)
		return;
	corpus->n_rows = corpus->sample;
	corpus->limit = rows[corpus->sample - 1].key;
}

/* Squeeze, and have at least half of the capacity free. */
static int make_room(struct incise_corpus *corpus)
{
	size_t capacity;
	void *rows;

	squeeze(corpus);
	if (2 * corpus->n_rows < corpus->capacity)
		return 0;
	capacity = corpus->n_rows ? 4 * corpus->n_rows : 1024;
	rows = realloc(corpus->rows, capacity * sizeof(*corpus->rows));
	if (!rows)
		return -ENOMEM;
	corpus->rows = rows;
	corpus->capacity = capacity;
	return 0;
}

static int offer(struct incise_corpus *corpus, const struct candidate *c)
{
	if (c->key > corpus->limit)
		return 0;
	if (corpus->n_rows == corpus->capacity && make_room(corpus))
		return -ENOMEM;
	corpus->rows[corpus->n_rows++] = *c;
	return 0;
}

/* --- surveys ------------------------------------------------------------------------- */

/* The group of the row before: most rows are of the same. */
struct same_group {
	char name[64];
	uint64_t key;
};

/* Groups of a source by key: open addressing, twice as many places as groups at least. */
struct surveyor {
	struct incise_corpus *corpus;
	const struct incise_corpus_source *source;
	struct incise_corpus_survey *survey;
	uint64_t number; /* of the source */
	int capacity, last;
	int *place; /* 2 × capacity; group + 1, or 0 */
	struct same_group same;
};

static uint64_t key_of(const struct incise_corpus_source *source, const char *group,
		       struct same_group *same)
{
	if (*source->group)
		group = source->group;
	if (!group)
		return 0;
	if (!same->key || strcmp(same->name, group)) {
		same->key = incise_group_key(
			source->own_groups && !*source->group ? source->hash : "", group);
		snprintf(same->name, sizeof(same->name), "%s", group);
	}
	return same->key;
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
			      .group = key_of(s->source, name, &s->same),
			      .hash = hash_row(corpus, row)};
	struct incise_corpus_group *group =
		find_survey_group(s, c.group,
				  *s->source->group ? s->source->group
				  : name	    ? name
						    : "");

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
	for (int i = 0; i < corpus->n_further; i++) {
		c.values[corpus->columns + i] = row[corpus->further_at + i];
		if (isnan(row[corpus->further_at + i]))
			survey->missing |= 1u << i;
	}
	group->rows++;
	survey->rows++;
	survey->digest = incise_random_bits(survey->digest ^ c.group, c.hash);
	c.key = row_key(corpus, FOR_SAMPLE, c.hash);
	if (corpus->bins)
		corpus->bins[BIN(row_key(corpus, FOR_CHECK, c.hash))]++;
	return offer(corpus, &c)
		       ? incise_error_set(err, ENOMEM, "no memory for more rows")
		       : 0;
}

static int add_survey(struct incise_corpus *corpus, const char *name, const char *hash,
		      const char *text, struct incise_error *err)
{
	struct incise_corpus_survey *survey;

	for (int i = 0; i < corpus->n_surveys; i++)
		if (!strcmp(corpus->surveys[i].hash, hash) ||
		    incise_is_same_recording(corpus->surveys[i].text, text))
			return incise_error_set(
				err, EEXIST,
				"%.199s: has the same content as %s; give each "
				"recording once",
				name, corpus->surveys[i].name);
	if (!grow_array(&corpus->surveys, (size_t)corpus->n_surveys,
			&corpus->survey_capacity, 16, sizeof(*corpus->surveys)))
		return incise_error_set(err, ENOMEM, "no memory");
	survey = &corpus->surveys[corpus->n_surveys];
	*survey = (struct incise_corpus_survey){0};
	snprintf(survey->name, sizeof(survey->name), "%s", name);
	snprintf(survey->hash, sizeof(survey->hash), "%s", hash);
	snprintf(survey->text, sizeof(survey->text), "%s", text);
	return 0;
}

int incise_corpus_survey(struct incise_corpus *corpus,
			 const struct incise_corpus_source *source,
			 struct incise_error *err)
{
	struct surveyor s = {.corpus = corpus,
			     .source = source,
			     .number = source_number(source->hash)};
	int rc = add_survey(corpus, source->name, source->hash, source->text, err);

	if (rc)
		return rc;
	s.survey = &corpus->surveys[corpus->n_surveys++];
	snprintf(s.survey->group, sizeof(s.survey->group), "%s", source->group);
	rc = source->read(source->user, survey_row, &s, err);
	s.survey->left_out = source->left_out;
	free(s.place);
	return rc;
}

/* --- for other processes ------------------------------------------------------------- */

/* A file for one program on machines of one kind: structs as they are in memory. */
struct header {
	char magic[8];
	int32_t columns, n_surveys;
	uint64_t n_rows, limit, size;
};

static size_t size_of_bins(const struct incise_corpus *corpus)
{
	return corpus->bins ? BINS * sizeof(*corpus->bins) : 0;
}

void *incise_corpus_encode(struct incise_corpus *corpus, size_t *size)
{
	struct header header = {.magic = "survey6",
				.columns = corpus->columns,
				.n_surveys = corpus->n_surveys};
	char *bytes, *at;

	squeeze(corpus);
	header.n_rows = corpus->n_rows;
	header.limit = corpus->limit;
	*size = sizeof(header) + size_of_bins(corpus) +
		corpus->n_rows * sizeof(*corpus->rows);
	for (int i = 0; i < corpus->n_surveys; i++)
		*size += sizeof(*corpus->surveys) +
			 corpus->surveys[i].n_groups * sizeof(struct incise_corpus_group);
	header.size = *size;
	bytes = at = malloc(*size);
	if (!bytes)
		return NULL;
	memcpy(at, &header, sizeof(header));
	at += sizeof(header);
	if (corpus->bins)
		memcpy(at, corpus->bins, size_of_bins(corpus));
	at += size_of_bins(corpus);
	if (corpus->n_rows)
		memcpy(at, corpus->rows, corpus->n_rows * sizeof(*corpus->rows));
	at += corpus->n_rows * sizeof(*corpus->rows);
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
	if (memcmp(header.magic, "survey6", 8) || header.columns != corpus->columns ||
	    header.size != size || header.n_surveys < 0 ||
	    (size_t)(end - at) < size_of_bins(corpus) ||
	    ((size_t)(end - at) - size_of_bins(corpus)) / sizeof(struct candidate) <
		    header.n_rows)
		return incise_error_set(err, EINVAL, "%s", damaged);
	for (int i = 0; i < BINS && corpus->bins; i++, at += sizeof(*corpus->bins)) {
		uint64_t count;

		memcpy(&count, at, sizeof(count));
		corpus->bins[i] += count;
	}
	if (header.limit < corpus->limit)
		corpus->limit = header.limit;
	for (uint64_t i = 0; i < header.n_rows; i++, at += sizeof(struct candidate)) {
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
		survey.name[sizeof(survey.name) - 1] = 0;
		survey.group[sizeof(survey.group) - 1] = 0;
		n = (size_t)survey.n_groups * sizeof(*survey.groups);
		if (survey.n_groups < 0 || (size_t)(end - at) < n)
			return incise_error_set(err, EINVAL, "%s", damaged);
		rc = add_survey(corpus, survey.name, survey.hash, survey.text, err);
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

/* Hold out as near to @n rows as equal ones and bins allow, and some on either side. */
static int hold_out_rows(struct incise_corpus *corpus, uint64_t rows, double n,
			 struct incise_error *err)
{
	uint64_t below = 0, best = 0;

	for (uint64_t bin = 0; bin < BINS; bin++) {
		below += corpus->bins[bin];
		if (!below || below == rows ||
		    (best && fabs((double)below - n) >= fabs((double)best - n)))
			continue;
		best = below;
		corpus->threshold = bin + 1;
	}
	corpus->sides[1].rows = best;
	return best ? 0
		    : incise_error_set(err, EINVAL,
				       "%llu rows: at least two that differ are required "
				       "to hold out some for checking",
				       (unsigned long long)rows);
}

static bool is_check(const struct incise_corpus *corpus, uint64_t hash, uint64_t group)
{
	if (!corpus->held)
		return false;
	return corpus->grouped
		       ? find_group(corpus, group)->check
		       : BIN(row_key(corpus, FOR_CHECK, hash)) < corpus->threshold;
}

static int take_sample(struct incise_corpus *corpus)
{
	for (int side = 0; side < 2; side++) {
		struct incise_train_side *to = &corpus->sides[side].sample;
		double *rows =
			malloc((corpus->n_rows + 1) * corpus->columns * sizeof(*rows));

		to->groups = corpus->grouped
				     ? malloc((corpus->n_rows + 1) * sizeof(*to->groups))
				     : NULL;
		to->pairs = (struct incise_pairs){
			.rows = rows, .n = 0, .n_inputs = corpus->columns - 1};
		if (!rows || (corpus->grouped && !to->groups))
			return -ENOMEM;
	}
	qsort(corpus->rows, corpus->n_rows, sizeof(*corpus->rows), by_source_and_row);
	for (size_t i = 0; i < corpus->n_rows; i++) {
		const struct candidate *c = &corpus->rows[i];
		struct incise_train_side *to =
			&corpus->sides[is_check(corpus, c->hash, c->group)].sample;

		memcpy((double *)to->pairs.rows + to->pairs.n * corpus->columns,
		       c->values, corpus->columns * sizeof(double));
		if (to->groups)
			to->groups[to->pairs.n] = find_group(corpus, c->group)->number;
		to->pairs.n++;
	}
	return 0;
}

double *incise_corpus_extend(const struct incise_corpus *corpus, int i)
{
	const struct incise_pairs *fit = &corpus->sides[0].sample.pairs;
	size_t n = fit->n_inputs, size = (n + 2) * sizeof(double);
	double *rows, *to;

	/* Also a row outside the sample, or held out, would be left out of a training with it. */
	for (int s = 0; s < corpus->n_surveys; s++)
		if (corpus->surveys[s].missing >> i & 1)
			return NULL;
	rows = to = malloc((fit->n + 1) * size);
	for (size_t r = 0; r < corpus->n_rows && rows; r++) {
		const struct candidate *c = &corpus->rows[r];

		if (is_check(corpus, c->hash, c->group))
			continue;
		memcpy(to, c->values, size);
		to[n] = c->values[n + 1 + i];
		to[n + 1] = c->values[n];
		to += n + 2;
	}
	return rows;
}

static void count_sides(struct incise_corpus *corpus)
{
	struct incise_corpus_side *fit = &corpus->sides[0], *check = &corpus->sides[1];

	for (int i = 0; i < corpus->n_surveys; i++) {
		struct incise_corpus_survey *survey = &corpus->surveys[i];

		fit->rows += survey->rows;
		for (int g = 0; g < survey->n_groups && corpus->grouped; g++) {
			struct incise_corpus_group *group = &survey->groups[g];

			group->number = find_group(corpus, group->key)->number;
			group->check = find_group(corpus, group->key)->check;
			check->rows += group->check ? group->rows : 0;
		}
	}
	for (int i = 0; i < corpus->n_groups && corpus->grouped; i++)
		corpus->sides[corpus->groups[i].check].n_groups++;
	fit->sample.n_groups = fit->n_groups;
	check->sample.n_groups = check->n_groups;
}

/* The number of different rows, from those in the sample: keys are spread evenly. */
static uint64_t scale_up(const struct incise_corpus *corpus, size_t n)
{
	if (corpus->limit == UINT64_MAX)
		return n;
	return (uint64_t)((double)n * 0x1p64 / ((double)corpus->limit + 1));
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
		rc = hold_out_rows(corpus, rows, share * (double)rows, err);
	}
	if (rc)
		return rc;
	qsort(corpus->groups, corpus->n_groups, sizeof(*corpus->groups), by_key);
	count_sides(corpus);
	corpus->sides[0].rows -= corpus->sides[1].rows;
	corpus->settled = true;
	squeeze(corpus);
	if (take_sample(corpus))
		return incise_error_set(err, ENOMEM, "no memory for a sample of rows");
	for (int side = 0; side < 2; side++) {
		struct incise_corpus_side *of = &corpus->sides[side];

		of->different = scale_up(corpus, of->sample.pairs.n);
		of->different = of->different < of->rows ? of->different : of->rows;
	}
	return 0;
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
	uint64_t row, digest;
	struct same_group same;
};

static int fold_row(void *user, const double *row, const char *name,
		    struct incise_error *err)
{
	struct folder *f = user;
	uint64_t group = key_of(f->source, name, &f->same), at = f->row++;
	uint64_t hash = hash_row(f->corpus, row);
	struct incise_error own;
	int rc;

	f->digest = incise_random_bits(f->digest ^ group, hash);
	/* Without groups each row is in a part of cross-validation by itself, with its equals. */
	if (is_check(f->corpus, hash, group)) {
		rc = incise_factor_add(f->check, row, group, 1, &own);
		rc = rc == -ERANGE ? 0 : rc;
	} else {
		double weight =
			f->corpus->propagation
				? incise_propagation_add(f->corpus->propagation, row)
				: 1;

		rc = incise_factor_add(
			f->fit, row,
			f->corpus->grouped ? group : row_key(f->corpus, FOR_SAMPLE, hash),
			weight, &own);
	}
	return rc ? incise_error_set(err, -rc, "%s: row %llu of those used: %.300s",
				     f->source->name, (unsigned long long)at + 1,
				     own.text)
		  : 0;
}

/* Count the groups and the different rows of a source, by the folds that they are in. */
static void count_parts(const struct incise_corpus *corpus,
			const struct incise_corpus_survey *survey,
			struct incise_factor *fit)
{
	uint64_t n[INCISE_FACTOR_FOLDS] = {0}, source = source_number(survey->hash);

	for (int g = 0; g < survey->n_groups && corpus->grouped; g++)
		if (!survey->groups[g].check)
			incise_factor_count(fit, survey->groups[g].key, 1, 0);
	for (size_t i = 0; i < corpus->n_rows; i++) {
		const struct candidate *c = &corpus->rows[i];

		if (c->source == source && !is_check(corpus, c->hash, c->group))
			n[(corpus->grouped ? c->group : c->key) % INCISE_FACTOR_FOLDS]++;
	}
	for (uint64_t f = 0; f < INCISE_FACTOR_FOLDS; f++)
		incise_factor_count(fit, f, 0, scale_up(corpus, n[f]));
}

int incise_corpus_fold(const struct incise_corpus *corpus,
		       const struct incise_corpus_source *source,
		       struct incise_factor *fit, struct incise_factor *check,
		       struct incise_error *err)
{
	struct folder f = {
		.corpus = corpus, .source = source, .fit = fit, .check = check};
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
	if (!rc && (!survey || f.row != survey->rows || f.digest != survey->digest))
		rc = incise_error_set(err, ESTALE,
				      "%s: has changed while it was read; train from a "
				      "file that nobody writes",
				      source->name);
	if (survey)
		count_parts(corpus, survey, fit);
	return rc;
}
