// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Streams of a recording in Arrow's form, as one more format of an export; see incise/arrow.h. An export pushes
 * its rows; a stream is pulled: the export runs in a thread, but only while the caller waits in get_next()
 * for a block of rows.
 *
 *     thread:   waits ─┐ rows ──► block ─┐ waits
 *     caller:          └ get_next() ……   └──► returns
 *
 * So a caller that forks finds the thread at rest: SQLite's locks are free in the child. A consumer may move
 * columns out of an array and free them later: each column owns its buffers.
 */
#include <dlfcn.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/arrow.h>
#include "../base/utf8.h"
#include "../rig/thread.h"
#include "streams.h"

/* --- schema -------------------------------------------------------------------------- */

/* Arrow's letters. */
static char format_of(enum incise_column_type type)
{
	switch (type) {
	case INCISE_COLUMN_SINGLE:
	case INCISE_COLUMN_COARSE:
		return 'f';
	case INCISE_COLUMN_REAL:
	case INCISE_COLUMN_SEEN:
		return 'g';
	case INCISE_COLUMN_FLAG:
		return 'b';
	case INCISE_COLUMN_SHORT:
		return 'i';
	case INCISE_COLUMN_NAME:
	case INCISE_COLUMN_TEXT:
		return 'u'; /* UTF-8 */
	default:
		return 'l';
	}
}

/* Bytes of metadata, written if @to is not NULL: a count, then a length before each text. */
static size_t put_count(char *to, size_t at, int32_t count)
{
	if (to)
		memcpy(to + at, &count, sizeof(count));
	return at + sizeof(count);
}

static size_t put_word(char *to, size_t at, const char *text)
{
	size_t length = strlen(text);

	at = put_count(to, at, (int32_t)length);
	if (to)
		memcpy(to + at, text, length);
	return at + length;
}

static size_t put_pairs(char *to, const struct incise_provenance *pairs)
{
	size_t at = put_count(to, 0, pairs->n);

	for (int i = 0; i < pairs->n; i++) {
		at = put_word(to, at, pairs->items[i].key);
		at = put_word(to, at, pairs->items[i].value);
	}
	return at;
}

static void schema_release(struct ArrowSchema *schema)
{
	for (int64_t i = 0; i < schema->n_children; i++) {
		if (schema->children[i] && schema->children[i]->release)
			schema->children[i]->release(schema->children[i]);
		free(schema->children[i]);
	}
	free(schema->children);
	free((char *)schema->format);
	free((char *)schema->name);
	free((char *)schema->metadata);
	schema->release = NULL;
}

/* False: no memory; it has to be released all the same. */
static bool open_schema(struct ArrowSchema *schema, const char *format, const char *name,
			const struct incise_provenance *pairs)
{
	char *metadata = malloc(put_pairs(NULL, pairs));

	if (metadata)
		put_pairs(metadata, pairs);
	*schema = (struct ArrowSchema){
		.format = strdup(format),
		.name = strdup(name),
		.metadata = metadata,
		.release = schema_release,
	};
	return schema->format && schema->name && metadata && !pairs->rc;
}

/* Describe a column: its unit, the calibration that enters it, and whose uncertainty it is or has. */
static void describe_column(struct incise_provenance *pairs,
			    const struct incise_table_column *columns, int n, int i)
{
	const struct incise_table_column *column = &columns[i];
	const struct incise_provenance *calibration = column->calibration;
	char *names = incise_column_uncertainties(columns, n, i);

	incise_provenance_add(pairs, "unit", "%s", column->unit);
	incise_provenance_add(pairs, "description", "%s", column->about);
	for (int k = 0; calibration && k < calibration->n; k++)
		incise_provenance_add(pairs, calibration->items[k].key, "%s",
				      calibration->items[k].value);
	if (names)
		incise_provenance_add(pairs, "uncertainty_variables", "%s", names);
	if (column->of)
		incise_provenance_add(pairs, "uncertainty_of", "%s", column->of);
	if (column->of)
		incise_provenance_add(pairs, "correlation", "%s", column->correlation);
	free(names);
}

static bool add_child(struct ArrowSchema *schema,
		      const struct incise_table_column *columns, int n, int i)
{
	const char format[] = {format_of(columns[i].type), '\0'};
	struct ArrowSchema *child = calloc(1, sizeof(*child));
	struct incise_provenance pairs = {0};
	bool made;

	if (!child)
		return false;
	schema->children[schema->n_children++] = child;
	describe_column(&pairs, columns, n, i);
	made = open_schema(child, format, columns[i].name, &pairs);
	child->flags = columns[i].type == INCISE_COLUMN_SEEN ? ARROW_FLAG_NULLABLE : 0;
	incise_provenance_free(&pairs);
	return made;
}

/* The schema of a table. Returns 0 or -ENOMEM. */
static int make_schema(struct ArrowSchema *schema,
		       const struct incise_table_column *columns, int n,
		       const struct incise_provenance *provenance)
{
	bool made = open_schema(schema, "+s", "", provenance);

	schema->children = calloc((size_t)n, sizeof(*schema->children));
	made = made && schema->children;
	for (int i = 0; i < n && made; i++)
		made = add_child(schema, columns, n, i);
	if (made)
		return 0;
	schema_release(schema);
	return -ENOMEM;
}

/* --- arrays -------------------------------------------------------------------------- */

static void array_release(struct ArrowArray *array)
{
	for (int64_t i = 0; i < array->n_children; i++) {
		if (array->children[i] && array->children[i]->release)
			array->children[i]->release(array->children[i]);
		free(array->children[i]);
	}
	for (int64_t i = 0; i < array->n_buffers; i++)
		free((void *)array->buffers[i]);
	free(array->children);
	free(array->buffers);
	array->release = NULL;
}

/* An array of the block's rows, or of a column of them. False: no memory; it has to be released all the same. */
static bool open_array(struct ArrowArray *array, const struct incise_table *table,
		       int n_buffers)
{
	*array = (struct ArrowArray){
		.length = (int64_t)table->filled,
		.buffers = calloc((size_t)n_buffers, sizeof(*array->buffers)),
		.release = array_release,
	};
	array->n_buffers = array->buffers ? n_buffers : 0;
	return array->buffers;
}

static void set_bit(uint8_t *bits, size_t at, bool value)
{
	bits[at / 8] |= (uint8_t)(value << at % 8);
}

/* The values of a column of numbers; NULL: no memory. */
static void *copy_numbers(const union incise_cell *cells, size_t n, char format)
{
	void *to = calloc(n, format == 'b' ? 1 : format == 'f' || format == 'i' ? 4 : 8);
	float *singles = to;
	int32_t *shorts = to;

	if (!to)
		return NULL;
	switch (format) {
	case 'b':
		for (size_t i = 0; i < n; i++)
			set_bit(to, i, cells[i].integer);
		break;
	case 'f':
		for (size_t i = 0; i < n; i++)
			singles[i] = (float)cells[i].real;
		break;
	case 'i':
		for (size_t i = 0; i < n; i++)
			shorts[i] = (int32_t)cells[i].integer;
		break;
	default:
		memcpy(to, cells, n * sizeof(*cells));
	}
	return to;
}

/* Mark the values that are there, and write 0 for the others, if any is missing. False: no memory. */
static bool mark_missing(struct ArrowArray *child, double *values, uint8_t **bits)
{
	size_t n = (size_t)child->length;

	for (size_t i = 0; i < n; i++)
		child->null_count += isnan(values[i]);
	*bits = child->null_count ? calloc(1, (n + 7) / 8) : NULL;
	for (size_t i = 0; i < n && *bits; i++) {
		set_bit(*bits, i, !isnan(values[i]));
		values[i] = isnan(values[i]) ? 0 : values[i];
	}
	return !child->null_count || *bits;
}

static const char *text_of_recording_stream(const struct incise_table *table,
					    enum incise_column_type type,
					    const union incise_cell *cell)
{
	return type == INCISE_COLUMN_NAME ? table->names[cell->integer - 1]
					  : table->texts + cell->integer;
}

/* The texts of a column, and their offsets. False: no memory, or too many bytes. */
static bool copy_texts(const struct incise_table *table, enum incise_column_type type,
		       const union incise_cell *cells, const void *buffers[2])
{
	int32_t *offsets = calloc(table->filled + 1, sizeof(*offsets));
	size_t size = 0;
	char *to;

	for (size_t i = 0; i < table->filled; i++)
		size += strlen(text_of_recording_stream(table, type, &cells[i]));
	to = size < INT32_MAX ? malloc(size + 1) : NULL;
	buffers[0] = offsets;
	buffers[1] = to;
	for (size_t i = 0; offsets && to && i < table->filled; i++)
		offsets[i + 1] =
			(int32_t)(utf8_copy_printable(to + offsets[i],
						      text_of_recording_stream(
							      table, type, &cells[i]),
						      "") -
				  to);
	return offsets && to;
}

/* Copy column @i of the block. False: no memory; it has to be released all the same. */
static bool copy_column(const struct incise_table *table, int i, struct ArrowArray *child)
{
	const union incise_cell *cells = &table->block[(size_t)i * INCISE_TABLE_STRIDE];
	enum incise_column_type type = table->columns[i].type;
	char format = format_of(type);
	void *values;

	if (!open_array(child, table, format == 'u' ? 3 : 2))
		return false;
	if (format == 'u')
		return copy_texts(table, type, cells, child->buffers + 1);
	child->buffers[1] = values = copy_numbers(cells, table->filled, format);
	return values && (type != INCISE_COLUMN_SEEN ||
			  mark_missing(child, values, (uint8_t **)&child->buffers[0]));
}

/* The rows of the block. Returns 0 or -ENOMEM. */
static int make_array(struct ArrowArray *array, const struct incise_table *table)
{
	bool made = open_array(array, table, 1); /* no row is missing */

	array->children = calloc((size_t)table->n_columns, sizeof(*array->children));
	made = made && array->children;
	for (int i = 0; i < table->n_columns && made; i++) {
		struct ArrowArray *child = calloc(1, sizeof(*child));

		array->children[i] = child;
		array->n_children += child != NULL;
		made = child && copy_column(table, i, child);
	}
	if (made)
		return 0;
	array_release(array);
	return -ENOMEM;
}

/* --- a stream, and its export in the thread ------------------------------------------- */

struct stream {
	struct incise_table_format format; /* table->format is this one */
	const char *what;
	struct incise_recording *recording;
	struct incise_export_options options, given; /* for the thread; as given */
	struct incise_calibration calibration;
	char *calibration_path;
	struct incise_provenance provenance, time,
		value; /* time and value of some columns */
	struct incise_table_column *columns;
	int n_columns;
	pthread_t thread;
	pid_t owner;
	struct incise_error last; /* of the caller */

	pthread_mutex_t lock; /* of all that follows */
	pthread_cond_t changed;
	struct ArrowArray block; /* release NULL: none */
	bool started;		 /* the columns are known */
	bool wanted;		 /* the caller waits for a block */
	bool ended, stop;
	int rc; /* of the export, once it has ended */
	struct incise_error err;
};

static struct stream *stream_of(const struct incise_table *table)
{
	return (struct stream *)((char *)(uintptr_t)table->format -
				 offsetof(struct stream, format));
}

static void signal_state(struct stream *stream, bool *flag)
{
	pthread_mutex_lock(&stream->lock);
	*flag = true;
	pthread_cond_broadcast(&stream->changed);
	pthread_mutex_unlock(&stream->lock);
}

/* Leave a block, or NULL before the first, and wait until another is wanted. 0 or -ECANCELED. */
static int hand_over(struct stream *stream, const struct ArrowArray *block)
{
	bool stop;

	pthread_mutex_lock(&stream->lock);
	if (block) {
		stream->block = *block;
		stream->wanted = false;
	}
	pthread_cond_broadcast(&stream->changed);
	while (!stream->wanted && !stream->stop)
		pthread_cond_wait(&stream->changed, &stream->lock);
	stop = stream->stop;
	pthread_mutex_unlock(&stream->lock);
	return stop ? -ECANCELED : 0;
}

static int fail_memory(const struct stream *stream, struct incise_error *err)
{
	return incise_error_set(err, ENOMEM, "%s: out of memory",
				stream->recording->path);
}

static int stream_open(struct incise_table *table, struct incise_error *err)
{
	struct stream *stream = stream_of(table);

	stream->columns = calloc((size_t)table->n_columns, sizeof(*stream->columns));
	if (!stream->columns)
		return fail_memory(stream, err);
	stream->n_columns = table->n_columns;
	memcpy(stream->columns, table->columns,
	       (size_t)table->n_columns * sizeof(*stream->columns));
	signal_state(stream, &stream->started);
	return hand_over(stream, NULL);
}

static int stream_put(struct incise_table *table, struct incise_error *err)
{
	struct stream *stream = stream_of(table);
	struct ArrowArray block;

	if (make_array(&block, table))
		return fail_memory(stream, err);
	return hand_over(stream, &block);
}

static int report_progress(void *context, double share)
{
	struct stream *stream = context;
	bool stop;

	pthread_mutex_lock(&stream->lock);
	stop = stream->stop;
	pthread_mutex_unlock(&stream->lock);
	return stop || (stream->given.progress &&
			stream->given.progress(stream->given.context, share));
}

/* --- what enters the values of a stream ------------------------------------------------ */

/* A key of metadata, unless the number is not known. */
static void add_known(struct incise_provenance *to, const char *key, double value)
{
	if (!isnan(value))
		incise_provenance_add(to, key, "%.17g", value);
}

static void add_vector(struct incise_provenance *to, const char *key, const double v[3])
{
	incise_provenance_add(to, key, "%.17g %.17g %.17g", v[0], v[1], v[2]);
}

/* Standard uncertainties that the calibrations state, with their covariance. */
static void describe_uncertainties(struct stream *stream)
{
	static const struct {
		const char *table, *key;
		enum incise_budget_source a,
			b; /* equal: an uncertainty, else a covariance */
	} items[] = {
		{"force", "force_mV_N_u", INCISE_BUDGET_GAIN, INCISE_BUDGET_GAIN},
		{"force", "force_zero_mV_u", INCISE_BUDGET_ZERO, INCISE_BUDGET_ZERO},
		{"force", "covariance_force_mV_N_force_zero_mV", INCISE_BUDGET_GAIN,
		 INCISE_BUDGET_ZERO},
		{"depth", "surface_u_mm", INCISE_BUDGET_SURFACE, INCISE_BUDGET_SURFACE},
		{"depth", "tip_x_u_mm", INCISE_BUDGET_TIP_X, INCISE_BUDGET_TIP_X},
		{"depth", "tip_y_u_mm", INCISE_BUDGET_TIP_Y, INCISE_BUDGET_TIP_Y},
		{"depth", "tip_z_u_mm", INCISE_BUDGET_TIP_Z, INCISE_BUDGET_TIP_Z},
		{"depth", "covariance_tip_x_tip_y_mm2", INCISE_BUDGET_TIP_X,
		 INCISE_BUDGET_TIP_Y},
		{"depth", "covariance_tip_x_tip_z_mm2", INCISE_BUDGET_TIP_X,
		 INCISE_BUDGET_TIP_Z},
		{"depth", "covariance_tip_y_tip_z_mm2", INCISE_BUDGET_TIP_Y,
		 INCISE_BUDGET_TIP_Z},
	};
	struct incise_budget *budget;
	struct incise_provenance *to = &stream->value;

	if (strcmp(stream->what, "force") && strcmp(stream->what, "depth"))
		return;
	/* Rows are read even if the text of their calibration is damaged. */
	budget = incise_budget_open(stream->recording, &stream->options, false, NULL);
	if (!budget && errno == ENOMEM)
		to->rc = -ENOMEM;
	for (size_t i = 0; i < sizeof(items) / sizeof(*items) && budget; i++)
		if (!strcmp(items[i].table, stream->what))
			add_known(to, items[i].key,
				  items[i].a == items[i].b
					  ? incise_budget_u(budget, items[i].a)
					  : incise_budget_covariance(budget, items[i].a,
								     items[i].b));
	incise_budget_free(budget);
}

/* The calibration of the values: scales, and the plane that depth is measured from. */
static void describe_values(struct stream *stream)
{
	const struct incise_calibration *given = stream->options.calibration;
	const struct incise_recording_info *meta = &stream->recording->meta;
	struct incise_provenance *to = &stream->value;

	if (!strcmp(stream->what, "force")) {
		if (meta->newtons)
			given = NULL;
		add_known(to, "force_mV_N", given ? given->force_mV_N : meta->force_mV_N);
		add_known(to, "force_zero_mV",
			  given && !isnan(given->force_zero_mV) ? given->force_zero_mV
								: meta->zero_mV);
	} else if (!strcmp(stream->what, "frames")) {
		add_known(to, "depth_mm_px",
			  given ? given->depth_mm_px : meta->depth_mm_px);
	} else {
		add_vector(to, "surface_point_mm", meta->surface_point_mm);
		add_vector(to, "surface_normal", meta->surface_normal);
		add_vector(to, "tip_mm", meta->tip_mm);
	}
}

/* The delay that times are corrected by, and their uncertainty; and what enters the calibrated column. */
static int describe_stream(struct stream *stream, struct incise_stream_rows *rows)
{
	const struct incise_row_times *times = &rows->rows.times;
	const char *calibrated =
		!strcmp(stream->what, "force") ? "force_N"
		: !strcmp(stream->what, "depth") || !strcmp(stream->what, "frames")
			? "depth_mm"
			: "";

	if (times->source) {
		add_known(&stream->time, "delay_ms",
			  (times->source->delay_ns - (double)times->shift_ns) * 1e-6);
		add_known(&stream->time, "offset_sd_ms",
			  times->source->offset_sd_ns * 1e-6);
	}
	if (*calibrated) {
		describe_values(stream);
		describe_uncertainties(stream);
	}
	for (int i = 0; i < rows->n; i++)
		if (!strcmp(rows->columns[i].name, "t_ns"))
			rows->columns[i].calibration = &stream->time;
		else if (!strcmp(rows->columns[i].name, calibrated))
			rows->columns[i].calibration = &stream->value;
	return stream->time.rc ? stream->time.rc : stream->value.rc;
}

static int export_stream(struct stream *stream)
{
	struct incise_export_pass pass = {&stream->recording, 1, &stream->options,
					  .err = &stream->err};
	struct incise_stream_rows rows;
	int rc = incise_messages_limit(&pass);

	if (rc)
		return rc;
	rc = incise_stream_rows_open(&rows, stream->recording, stream->what,
				     &stream->options, &stream->err);
	if (!rc && describe_stream(stream, &rows))
		rc = fail_memory(stream, &stream->err);
	if (!rc)
		rc = incise_export_stream(&rows, &pass, &stream->format);
	incise_stream_rows_close(&rows);
	return rc;
}

static void *run_export(void *argument)
{
	struct stream *stream = argument;
	struct incise_export_pass pass = {&stream->recording, 1, &stream->options,
					  .err = &stream->err};

	stream->rc = incise_stream_known(stream->what)
			     ? export_stream(stream)
			     : incise_export_rows(&pass, &stream->format, NULL, NULL);
	signal_state(stream, &stream->ended);
	return NULL;
}

/* --- in the caller's thread ----------------------------------------------------------- */

/* Connections and threads are not those of a child. */
static bool is_foreign(struct stream *stream)
{
	if (stream->owner == getpid())
		return false;
	incise_error_set(&stream->last, EINVAL,
			 "this stream was opened by process %ld before a fork; open "
			 "the recording again in this process",
			 (long)stream->owner);
	return true;
}

static int stream_schema(struct ArrowArrayStream *self, struct ArrowSchema *out)
{
	struct stream *stream = self->private_data;

	memset(out, 0, sizeof(*out));
	if (!make_schema(out, stream->columns, stream->n_columns, &stream->provenance))
		return 0;
	return -fail_memory(stream, &stream->last);
}

/* Wait for a block, the end or, of an error, its text, which is repeated. */
static int stream_next(struct ArrowArrayStream *self, struct ArrowArray *out)
{
	struct stream *stream = self->private_data;
	int rc = 0;

	memset(out, 0, sizeof(*out));
	if (is_foreign(stream))
		return EINVAL;
	pthread_mutex_lock(&stream->lock);
	stream->wanted = true;
	pthread_cond_broadcast(&stream->changed);
	while (!stream->block.release && !stream->ended)
		pthread_cond_wait(&stream->changed, &stream->lock);
	if (stream->block.release) {
		*out = stream->block;
		stream->block.release = NULL;
	} else {
		rc = stream->rc;
		stream->last = stream->err;
	}
	pthread_mutex_unlock(&stream->lock);
	return -rc;
}

static const char *stream_error(struct ArrowArrayStream *self)
{
	const struct stream *stream = self->private_data;

	return stream->last.code ? stream->last.text : NULL;
}

static void stream_free(struct stream *stream)
{
	pthread_cond_destroy(&stream->changed);
	pthread_mutex_destroy(&stream->lock);
	incise_provenance_free(&stream->provenance);
	incise_provenance_free(&stream->time);
	incise_provenance_free(&stream->value);
	incise_recording_close(stream->recording);
	free(stream->columns);
	free(stream->calibration_path);
	free(stream);
}

static void stream_close(struct stream *stream)
{
	signal_state(stream, &stream->stop);
	pthread_join(stream->thread, NULL);
	if (stream->block.release)
		stream->block.release(&stream->block);
	stream_free(stream);
}

static void stream_release(struct ArrowArrayStream *self)
{
	struct stream *stream = self->private_data;

	/* In a child what is the parent's stays as it is. */
	if (stream->owner == getpid())
		stream_close(stream);
	self->release = NULL;
}

/* Wait for the columns, or for the export's error. Returns 0 or -errno. */
static int wait_for_columns(struct stream *stream, struct incise_error *err)
{
	int rc;

	pthread_mutex_lock(&stream->lock);
	while (!stream->started && !stream->ended)
		pthread_cond_wait(&stream->changed, &stream->lock);
	rc = stream->started ? 0 : stream->rc;
	if (rc && err)
		*err = stream->err;
	pthread_mutex_unlock(&stream->lock);
	return rc;
}

/* Start the export. Returns 0 or -errno. */
static int start_export(struct stream *stream,
			const struct incise_export_options *options,
			struct incise_error *err)
{
	const char *table = incise_stream_known(stream->what) ? stream->what : NULL;
	int rc = incise_export_check(options, err);

	if (!rc && table && options->cut)
		rc = incise_error_set(err, EINVAL,
				      "%s: rows of %s have no cut; give a range of times",
				      stream->recording->path, table);
	if (!rc)
		rc = incise_provenance_of(&stream->provenance, &stream->recording, 1,
					  options, table, err);
	if (rc)
		return rc;
	stream->given = stream->options = *options;
	stream->options.progress = report_progress;
	stream->options.context = stream;
	if (options->calibration) {
		stream->calibration = *options->calibration;
		stream->options.calibration = &stream->calibration;
	}
	if (options->calibration_path) {
		stream->calibration_path = strdup(options->calibration_path);
		stream->options.calibration_path = stream->calibration_path;
		if (!stream->calibration_path)
			return fail_memory(stream, err);
	}
	rc = incise_thread_start(&stream->thread, run_export, stream, NULL);
	if (rc)
		return incise_error_set(err, -rc, "%s: no thread to read it: %s",
					stream->recording->path, strerror(-rc));
	return 0;
}

static struct stream *make_stream(const char *path, const char *what,
				  struct incise_error *err)
{
	struct stream *stream = calloc(1, sizeof(*stream));

	if (!stream)
		return INCISE_ERROR_NULL(err, ENOMEM, "%s: out of memory", path);
	*stream = (struct stream){
		.format = {.abi = INCISE_TABLE_ABI,
			   .open = stream_open,
			   .put = stream_put},
		.what = what,
		.owner = getpid(),
	};
	pthread_mutex_init(&stream->lock, NULL);
	pthread_cond_init(&stream->changed, NULL);
	/* It opens the recording again: a connection is for one thread at a time. */
	stream->recording = incise_recording_open(path, err);
	if (stream->recording)
		return stream;
	stream_free(stream);
	return NULL;
}

/* --- opening ------------------------------------------------------------------------- */

int incise_recording_stream(struct incise_recording *recording, const char *what,
			    const struct incise_export_options *options,
			    struct ArrowArrayStream *stream, struct incise_error *err)
{
	struct incise_export_options defaults;
	const char *name = incise_stream_known(what);
	struct stream *made;
	int rc;

	*stream = (struct ArrowArrayStream){0};
	if (!name && strcmp(what, "table"))
		return incise_error_set(
			err, EINVAL,
			"no stream '%s' in a recording; there are: force, tracker, "
			"depth, frames, events, table",
			what);
	incise_export_options_init(&defaults);
	made = make_stream(recording->path, name ? name : "table", err);
	if (!made)
		return -errno;
	rc = start_export(made, options ? options : &defaults, err);
	if (rc) {
		stream_free(made);
		return rc;
	}
	rc = wait_for_columns(made, err);
	if (rc) {
		stream_close(made);
		return rc;
	}
	*stream = (struct ArrowArrayStream){
		.get_schema = stream_schema,
		.get_next = stream_next,
		.get_last_error = stream_error,
		.release = stream_release,
		.private_data = made,
	};
	return 0;
}

void incise_arrow_capsule_free(void *capsule)
{
	void *(*pointer_of)(void *, const char *);
	struct ArrowArrayStream *stream;

	/* POSIX has this form for a function's address. */
	*(void **)&pointer_of = dlsym(RTLD_DEFAULT, "PyCapsule_GetPointer");
	stream = pointer_of ? pointer_of(capsule, "arrow_array_stream") : NULL;
	if (stream && stream->release)
		stream->release(stream);
	free(stream);
}
