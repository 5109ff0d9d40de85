// SPDX-License-Identifier: LGPL-2.1-or-later
/* Sources of a training; see reader.h. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/arrow.h>
#include "../base/crypto/sha256.h"
#include "reader.h"

/* The column with the groups of rows, or NULL. */
static const char *group_column(const struct incise_reader *source)
{
	const char *group = source->reading->group;

	return *source->group || (group && !strcmp(group, "recording")) ? NULL : group;
}

/* --- state --------------------------------------------------------------------------- */

static char *file_state(const char *path)
{
	struct stat st = {0};
	char *text;

	stat(path, &st);
	if (asprintf(&text, "%s %jd %jd.%09ld %ju\n", path, (intmax_t)st.st_size,
		     (intmax_t)st.st_mtim.tv_sec, st.st_mtim.tv_nsec,
		     (uintmax_t)st.st_ino) < 0)
		return NULL;
	return text;
}

char *incise_reader_state(const struct incise_reader *source)
{
	const struct incise_train_source *given = source->given;

	return given->state  ? given->state(given)
	       : given->path ? file_state(given->path)
			     : NULL;
}

/* Fail if it is not what it was before it was first read. */
static int check_unchanged(const struct incise_reader *source, struct incise_error *err)
{
	char *state = source->state ? incise_reader_state(source) : NULL;
	bool same = !source->state || (state && !strcmp(source->state, state));

	free(state);
	return same ? 0
		    : incise_error_set(err, ESTALE,
				       "%s: has changed while it was read; train from a "
				       "file that nobody writes",
				       source->given->name);
}

/* --- reading ------------------------------------------------------------------------- */

static int pass_row(void *user, const double *row, const char *group,
		    struct incise_error *err)
{
	struct incise_reader *source = user;
	struct incise_watch *watch = source->reading->watch;

	watch->step.rows++;
	if (incise_watch_count(watch, source->reading->cost))
		return incise_error_set(err, ECANCELED, "training was stopped");
	return source->take(source->taker, row, group, err);
}

/* A message with the name of the source in front, instead of that of its file or stream. */
static int name_error(const struct incise_reader *source, int rc,
		      struct incise_error *err)
{
	static const char stream[] = "Arrow stream: ";
	const char *name = source->given->name;
	const char *path = source->given->path ? source->given->path : stream;
	struct incise_error own = *err;
	size_t n = strlen(path);

	if (rc && !strncmp(own.text, path, n) &&
	    (source->given->path || !strncmp(own.text + n, name, strlen(name))))
		return incise_error_set(err, own.code, "%s%s",
					source->given->path ? name : "", own.text + n);
	return rc && strncmp(own.text, name, strlen(name))
		       ? incise_error_set(err, own.code, "%s: %.300s", name, own.text)
		       : rc;
}

static int each_row(struct incise_reader *source, incise_row_taker take, void *taker,
		    struct incise_error *err)
{
	const struct incise_reading *reading = source->reading;
	struct incise_train_source *given = source->given;
	struct ArrowArrayStream stream;
	int rc;

	if (given->path)
		return incise_dataset_each(given->path, reading->columns,
					   reading->n_columns, reading->n_required,
					   group_column(source), reading->where, take,
					   taker, &source->corpus.left_out, err);
	rc = given->stream(given, &stream, err);
	return rc ? rc
		  : incise_dataset_each_arrow(&stream, reading->columns,
					      reading->n_columns, reading->n_required,
					      group_column(source), reading->where, take,
					      taker, &source->corpus.left_out, err);
}

static int read_rows(void *user, incise_row_taker take, void *taker,
		     struct incise_error *err)
{
	struct incise_reader *source = user;
	int rc;

	if (!source->state)
		source->state = incise_reader_state(source);
	source->take = take;
	source->taker = taker;
	rc = each_row(source, pass_row, source, err);
	if (!rc)
		rc = check_unchanged(source, err);
	return name_error(source, rc, err);
}

static int stop_reading(void *user, const double *row, const char *group,
			struct incise_error *err)
{
	(void)user;
	(void)row;
	(void)group;
	(void)err;
	return 1;
}

/* --- names --------------------------------------------------------------------------- */

/* A path without its folders. */
static const char *base_name(const char *path)
{
	const char *slash = strrchr(path, '/');

	return slash && slash[1] ? slash + 1 : path;
}

static bool count_bytes(void *watch, size_t n)
{
	return incise_watch_count(watch, 16.0 * (double)n);
}

static int find_hash(struct incise_reader *source, struct incise_error *err)
{
	const struct incise_train_source *given = source->given;
	const char *file = given->hashed ? given->hashed : given->path;

	if (file)
		return incise_sha256_file(file, source->hash, count_bytes,
					  source->reading->watch, err);
	return incise_sha256_text(given->name, strlen(given->name), source->hash)
		       ? incise_error_set(err, ENOMEM, "%s: no memory", given->name)
		       : 0;
}

/* The group of all its rows; none: the column of the group says which. */
static void find_group(struct incise_reader *source)
{
	const char *group = source->reading->group;
	const char *whole = !group			  ? NULL
			    : !strcmp(group, "recording") ? source->hash
			    : !strcmp(group, "rig")	  ? source->given->rig
							  : NULL;

	snprintf(source->group, sizeof(source->group), "%s", whole ? whole : "");
}

int incise_reader_open(struct incise_reader *source, struct incise_error *err)
{
	struct incise_train_source *given = source->given;
	int rc = 0;

	source->state = incise_reader_state(source);
	/* A file of another kind is refused before all of it is hashed. */
	if (given->path)
		rc = each_row(source, stop_reading, NULL, err);
	if (!rc && given->open)
		rc = given->open(given, err);
	if (!rc)
		rc = find_hash(source, err);
	if (rc)
		return name_error(source, rc, err);
	snprintf(source->text, sizeof(source->text), "%.999s",
		 given->text   ? given->text
		 : given->path ? base_name(given->path)
			       : given->name);
	find_group(source);
	source->corpus.calibration = given->calibration;
	return 0;
}

void incise_reader_resume(struct incise_reader *source,
			  const struct incise_corpus_survey *survey)
{
	memcpy(source->hash, survey->hash, sizeof(source->hash));
	memcpy(source->text, survey->text, sizeof(source->text));
	memcpy(source->group, survey->group, sizeof(source->group));
}

static bool has_cuts(const struct incise_train_source *given)
{
	return given->path ? incise_dataset_has(given->path, "cut", NULL) : given->cuts;
}

struct incise_reader *incise_readers_new(struct incise_train_source *given, int n,
					 const char *group,
					 struct incise_reading *reading)
{
	struct incise_reader *sources = calloc(n ? n : 1, sizeof(*sources));
	bool all = n > 0; /* have cuts */

	if (!sources)
		return NULL;
	for (int i = 0; i < n; i++) {
		struct incise_reader *source = &sources[i];

		source->given = &given[i];
		source->reading = reading;
		source->corpus = (struct incise_corpus_source){
			.name = given[i].name,
			.hash = source->hash,
			.text = source->text,
			.group = source->group,
			.read = read_rows,
			.user = source,
		};
		all = all && !group && has_cuts(&given[i]);
	}
	reading->group = all ? "cut" : group && strcmp(group, "none") ? group : NULL;
	/* Cuts are numbered in each recording; other names mean the same everywhere. */
	for (int i = 0; i < n && reading->group; i++)
		sources[i].corpus.own_groups = !strcmp(reading->group, "cut");
	return sources;
}

void incise_readers_free(struct incise_reader *sources, int n)
{
	for (int i = 0; i < n && sources; i++)
		free(sources[i].state);
	free(sources);
}
