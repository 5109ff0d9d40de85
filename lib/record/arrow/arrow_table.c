// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An export as a source of Arrow batches. An export pushes its rows; a stream is pulled: the export
 * runs in a thread, but only while the caller waits in get_next() for a block of rows.
 *
 *     thread:   waits ─┐ rows ──► block ─┐ waits
 *     caller:          └ get_next() ……   └──► returns
 *
 * So a caller that forks finds the thread at rest: SQLite's locks are free in the child.
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <incise/recording.h>
#include "../../device/thread.h"
#include "../export/table_writer.h"
#include "../export/writers.h"
#include "../read/recording.h"
#include "arrow_batch.h"

struct table_source {
	struct incise_arrow_source base;
	struct incise_table_format format; /* table->format is this one */
	struct incise_recording *recording;
	struct incise_export_options options, given;
	struct incise_calibration calibration;
	char *calibration_path;
	struct incise_arrow_field *fields;
	struct incise_provenance *uncertainties; /* of each field */
	struct incise_arrow_batch batch;
	pthread_t thread;

	pthread_mutex_t lock; /* of all that follows */
	pthread_cond_t changed;
	struct ArrowArray block; /* release NULL: none */
	bool started;		 /* the columns are known */
	bool wanted;		 /* the caller waits for a block */
	bool ended, stop;
	int rc; /* of the export, once it has ended */
	struct incise_error err;
};

static struct table_source *source_of(const struct incise_table *table)
{
	return (struct table_source *)((char *)(uintptr_t)table->format -
				       offsetof(struct table_source, format));
}

static void signal_state(struct table_source *source, bool *flag)
{
	pthread_mutex_lock(&source->lock);
	*flag = true;
	pthread_cond_broadcast(&source->changed);
	pthread_mutex_unlock(&source->lock);
}

/* --- in the thread ------------------------------------------------------------------- */

static enum incise_arrow_type type_of(enum incise_column_type type)
{
	switch (type) {
	case INCISE_COLUMN_REAL:
		return INCISE_ARROW_REAL;
	case INCISE_COLUMN_SINGLE:
		return INCISE_ARROW_SINGLE;
	case INCISE_COLUMN_FLAG:
		return INCISE_ARROW_FLAG;
	case INCISE_COLUMN_NAME:
		return INCISE_ARROW_TEXT;
	default:
		return INCISE_ARROW_INT64;
	}
}

/* Leave a block, or NULL before the first, and wait until another is wanted. 0 or -ECANCELED. */
static int hand_over(struct table_source *source, const struct ArrowArray *block)
{
	bool stop;

	pthread_mutex_lock(&source->lock);
	if (block) {
		source->block = *block;
		source->wanted = false;
	}
	pthread_cond_broadcast(&source->changed);
	while (!source->wanted && !source->stop)
		pthread_cond_wait(&source->changed, &source->lock);
	stop = source->stop;
	pthread_mutex_unlock(&source->lock);
	return stop ? -ECANCELED : 0;
}

/* Metadata of a field: the fields with its uncertainties, or the one whose uncertainty it is. */
static int describe_field(struct table_source *source, const struct incise_table *table,
			  int i)
{
	const struct incise_table_column *column = &table->columns[i];
	char *names = incise_column_uncertainties(table->columns, table->n_columns, i);
	struct incise_provenance *to = &source->uncertainties[i];
	int rc = 0;

	if (names)
		rc = incise_provenance_add(to, "uncertainty_variables", "%s", names);
	free(names);
	if (!rc && column->of)
		rc = incise_provenance_add(to, "uncertainty_of", "%s", column->of);
	if (!rc && column->of)
		rc = incise_provenance_add(to, "correlation", "%s", column->correlation);
	source->fields[i] = (struct incise_arrow_field){
		.name = column->name,
		.unit = column->unit,
		.about = column->about,
		.type = type_of(column->type),
		.calibration = to->n ? to : NULL,
	};
	return rc;
}

static int table_begin(struct incise_table *table, struct incise_error *err)
{
	struct table_source *source = source_of(table);
	int rc = 0;

	source->fields = calloc((size_t)table->n_columns, sizeof(*source->fields));
	source->uncertainties =
		calloc((size_t)table->n_columns, sizeof(*source->uncertainties));
	/* For its end, even if the rest fails. */
	source->base.n_fields = source->uncertainties ? table->n_columns : 0;
	if (!source->fields || !source->uncertainties ||
	    incise_arrow_batch_open(&source->batch, source->fields, table->n_columns,
				    INCISE_TABLE_BLOCK))
		return incise_error_set(err, ENOMEM, "%s: out of memory",
					source->recording->path);
	for (int i = 0; i < table->n_columns && !rc; i++)
		rc = describe_field(source, table, i);
	if (rc)
		return incise_error_set(err, -rc, "%s: out of memory",
					source->recording->path);
	source->base.fields = source->fields;
	signal_state(source, &source->started);
	return hand_over(source, NULL);
}

static void put_cell(struct table_source *source, const struct incise_table *table,
		     int column, const union incise_cell *cell)
{
	switch (table->columns[column].type) {
	case INCISE_COLUMN_REAL:
	case INCISE_COLUMN_SINGLE:
		incise_arrow_put_real(&source->batch, column, cell->real);
		break;
	case INCISE_COLUMN_NAME:
		incise_arrow_put_text(&source->batch, column,
				      table->names[cell->integer - 1]);
		break;
	default:
		incise_arrow_put_int(&source->batch, column, cell->integer);
	}
}

static int table_rows(struct incise_table *table, struct incise_error *err)
{
	struct table_source *source = source_of(table);
	struct incise_arrow_batch *batch = &source->batch;
	struct ArrowArray block;
	int rc = incise_arrow_batch_start(batch);

	for (; !rc && batch->rows < table->filled; batch->rows++)
		for (int i = 0; i < table->n_columns; i++)
			put_cell(source, table, i,
				 &table->block[(size_t)i * INCISE_TABLE_BLOCK +
					       batch->rows]);
	if (!rc)
		rc = incise_arrow_batch_take(batch, &block);
	if (rc)
		return incise_error_set(err, -rc, "%s: out of memory",
					source->recording->path);
	return hand_over(source, &block);
}

static int table_end(struct incise_table *table, struct incise_error *err)
{
	(void)table, (void)err; /* the format's form */
	return 0;
}

static int progress(void *context, double share)
{
	struct table_source *source = context;
	bool stop;

	pthread_mutex_lock(&source->lock);
	stop = source->stop;
	pthread_mutex_unlock(&source->lock);
	return stop || (source->given.progress &&
			source->given.progress(source->given.context, share));
}

static void *run(void *argument)
{
	struct table_source *source = argument;

	source->rc = incise_export_table(&source->recording, 1, &source->options,
					 &source->format, NULL, NULL, NULL, &source->err);
	signal_state(source, &source->ended);
	return NULL;
}

/* --- in the caller's thread ---------------------------------------------------------- */

static int table_next(struct incise_arrow_source *base, struct ArrowArray *array,
		      struct incise_error *err)
{
	struct table_source *source = (struct table_source *)base;
	int rc = 0;

	pthread_mutex_lock(&source->lock);
	source->wanted = true;
	pthread_cond_broadcast(&source->changed);
	while (!source->block.release && !source->ended)
		pthread_cond_wait(&source->changed, &source->lock);
	if (source->block.release) {
		*array = source->block;
		source->block.release = NULL;
	} else {
		rc = source->rc;
		*err = source->err;
	}
	pthread_mutex_unlock(&source->lock);
	return rc;
}

static void table_free(struct table_source *source)
{
	incise_arrow_batch_close(&source->batch);
	for (int i = 0; i < source->base.n_fields; i++)
		incise_provenance_free(&source->uncertainties[i]);
	free(source->uncertainties);
	free(source->fields);
	free(source->calibration_path);
	pthread_cond_destroy(&source->changed);
	pthread_mutex_destroy(&source->lock);
	incise_recording_close(source->recording);
	free(source);
}

static void table_close(struct incise_arrow_source *base)
{
	struct table_source *source = (struct table_source *)base;

	signal_state(source, &source->stop);
	pthread_join(source->thread, NULL);
	if (source->block.release)
		source->block.release(&source->block);
	table_free(source);
}

/* Wait for the columns, or for the export's error. Returns 0 or -errno. */
static int wait_for_columns(struct table_source *source, struct incise_error *err)
{
	int rc;

	pthread_mutex_lock(&source->lock);
	while (!source->started && !source->ended)
		pthread_cond_wait(&source->changed, &source->lock);
	rc = source->started ? 0 : source->rc;
	if (rc && err)
		*err = source->err;
	pthread_mutex_unlock(&source->lock);
	return rc;
}

static int table_open(struct table_source *source,
		      const struct incise_export_options *options,
		      struct incise_error *err)
{
	int rc = incise_export_check(options, err);

	if (!rc)
		rc = incise_provenance_of(&source->base.provenance, &source->recording, 1,
					  options, NULL, err);
	if (rc)
		return rc;
	source->given = source->options = *options;
	source->options.progress = progress;
	source->options.context = source;
	if (options->calibration) {
		source->calibration = *options->calibration;
		source->options.calibration = &source->calibration;
	}
	if (options->calibration_path) {
		source->calibration_path = strdup(options->calibration_path);
		source->options.calibration_path = source->calibration_path;
		if (!source->calibration_path)
			return incise_error_set(err, ENOMEM, "%s: out of memory",
						source->recording->path);
	}
	rc = incise_thread_start(&source->thread, run, source, NULL);
	if (rc)
		return incise_error_set(err, -rc, "%s: no thread to read it: %s",
					source->recording->path, strerror(-rc));
	return 0;
}

struct incise_arrow_source *incise_arrow_table(
	struct incise_recording *recording, const struct incise_export_options *options,
	struct incise_error *err)
{
	struct table_source *source = calloc(1, sizeof(*source));
	int rc;

	if (!source) {
		incise_error_set(err, ENOMEM, "%s: out of memory", recording->path);
		incise_recording_close(recording);
		return NULL;
	}
	source->base.next = table_next;
	source->base.close = table_close;
	source->format = (struct incise_table_format){
		.abi = INCISE_TABLE_ABI,
		.begin = table_begin,
		.rows = table_rows,
		.end = table_end,
	};
	source->recording = recording;
	pthread_mutex_init(&source->lock, NULL);
	pthread_cond_init(&source->changed, NULL);
	rc = table_open(source, options, err);
	if (rc) {
		incise_provenance_free(&source->base.provenance);
		table_free(source);
		errno = -rc;
		return NULL;
	}
	rc = wait_for_columns(source, err);
	if (!rc)
		return &source->base;
	incise_provenance_free(&source->base.provenance);
	table_close(&source->base);
	errno = -rc;
	return NULL;
}
