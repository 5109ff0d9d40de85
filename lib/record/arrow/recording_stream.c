// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Streams of a recording in Arrow's form; see incise/arrow.h. The rows of the tables are read
 * here, what an export makes of them in arrow_table.c.
 *
 *     table ──► rows, with their best times ──► batch ──► ArrowArrayStream
 */
#include <dlfcn.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/recording.h>
#include "../export/writers.h"
#include "../read/rows.h"
#include "../read/session.h"
#include "arrow_batch.h"

#define BATCH_ROWS 65536
#define COLUMNS_MAX 13

/* --- from a source to a stream ------------------------------------------------------- */

struct stream {
	struct incise_arrow_source *source;
	struct incise_error err;
	pid_t owner;
	bool ended;
};

static int stream_fail(struct stream *stream, int code)
{
	/* A message was left where the cause is known, unless there is no memory. */
	if (stream->err.code != code)
		incise_error_set(&stream->err, code, "stream of a recording: %s",
				 strerror(code));
	stream->ended = true;
	return code;
}

/* Connections and threads are not those of a child. */
static bool is_foreign(struct stream *stream)
{
	if (stream->owner == getpid())
		return false;
	incise_error_set(&stream->err, EINVAL,
			 "this stream was opened by process %ld before a fork; open "
			 "the recording again in this process",
			 (long)stream->owner);
	return true;
}

static int stream_schema(struct ArrowArrayStream *self, struct ArrowSchema *out)
{
	struct stream *stream = self->private_data;
	const struct incise_arrow_source *source = stream->source;

	memset(out, 0, sizeof(*out));
	if (incise_arrow_schema(out, source->fields, source->n_fields,
				&source->provenance))
		return stream_fail(stream, ENOMEM);
	return 0;
}

static int stream_next(struct ArrowArrayStream *self, struct ArrowArray *out)
{
	struct stream *stream = self->private_data;
	int rc;

	memset(out, 0, sizeof(*out));
	if (is_foreign(stream))
		return EINVAL;
	if (stream->ended) /* also after an error, which is repeated */
		return stream->err.code;
	rc = stream->source->next(stream->source, out, &stream->err);
	if (rc)
		return stream_fail(stream, -rc);
	stream->ended = !out->release;
	return 0;
}

static const char *stream_error(struct ArrowArrayStream *self)
{
	const struct stream *stream = self->private_data;

	return stream->err.code ? stream->err.text : NULL;
}

static void source_close(struct incise_arrow_source *source)
{
	incise_provenance_free(&source->provenance);
	source->close(source);
}

static void stream_release(struct ArrowArrayStream *self)
{
	struct stream *stream = self->private_data;

	/* In a child what is the parent's stays as it is. */
	if (stream->owner == getpid())
		source_close(stream->source);
	free(stream);
	self->release = NULL;
}

/* --- rows of a table ----------------------------------------------------------------- */

struct table;

#define FIELD(name, unit, about, type)                              \
	{                                                           \
		name, unit, about, INCISE_ARROW_##type, false, NULL \
	}
#define SEEN(name, unit, about)                                  \
	{                                                        \
		name, unit, about, INCISE_ARROW_REAL, true, NULL \
	}
#define SEQ FIELD("seq", "1", "number of the sample, from the device", INT64)
#define TIME FIELD("t_ns", "ns", "best time of acquisition, CLOCK_MONOTONIC", INT64)
#define ARRIVAL FIELD("arrival_ns", "ns", "time of receipt, CLOCK_MONOTONIC", INT64)
#define POSITION "position as received, without the calibrated tip"
#define ORIENTATION "orientation, unit quaternion"

struct rows_source {
	struct incise_arrow_source base;
	const struct table *table;
	struct incise_recording *recording;
	struct incise_rows rows;
	struct incise_arrow_batch batch;
	struct incise_recording_force scale;
	double depth_scale; /* of another calibration, of depths by vision */
	struct incise_provenance time, value;
	struct incise_arrow_field fields[COLUMNS_MAX + 1];
};

static void put_force(struct rows_source *source)
{
	struct incise_arrow_batch *batch = &source->batch;
	const struct incise_recording_force *scale = &source->scale;
	int64_t code = incise_rows_int(&source->rows, 2);

	incise_arrow_put_int(batch, 0, incise_rows_int(&source->rows, 0));
	incise_arrow_put_int(batch, 1, source->rows.t_ns);
	incise_arrow_put_int(batch, 2, code);
	incise_arrow_put_real(batch, 3, code * scale->n_per_code - scale->zero_N);
	incise_arrow_put_int(batch, 4, code <= 0 || code >= scale->top);
}

/* Column @column of the rows as column @to. */
static void put_column(struct rows_source *source, int column, int to)
{
	struct incise_arrow_batch *batch = &source->batch;
	const struct incise_arrow_field *field = &source->fields[to];
	const struct incise_rows *rows = &source->rows;

	if (field->nullable && isnan(incise_rows_real(rows, column)))
		incise_arrow_put_missing(batch, to);
	else if (!strcmp(field->name, "status"))
		incise_arrow_put_text(batch, to,
				      (const char[]){incise_rows_char(rows, column), 0});
	else if (field->type == INCISE_ARROW_TEXT)
		incise_arrow_put_text(batch, to, incise_rows_text(rows, column, NULL));
	else if (field->type == INCISE_ARROW_REAL)
		incise_arrow_put_real(batch, to,
				      incise_rows_real(rows, column) *
					      (field->nullable && field->calibration
						       ? source->depth_scale
						       : 1));
	else if (column == 1)
		incise_arrow_put_int(batch, to, rows->t_ns);
	else if (!strcmp(field->name, "arrival_ns"))
		incise_arrow_put_int(batch, to,
				     incise_session_time(rows->times.map,
							 incise_rows_int(rows, column)));
	else
		incise_arrow_put_int(batch, to, incise_rows_int(rows, column));
}

static void put_columns(struct rows_source *source)
{
	for (int i = 0; i < source->base.n_fields; i++)
		put_column(source, i, i);
}

/* Events have no number. */
static void put_event(struct rows_source *source)
{
	for (int i = 0; i < source->base.n_fields; i++)
		put_column(source, i + 1, i);
}

/* A table, and its columns, as of rows.h. */
static const struct table {
	const char *name, *columns;
	void (*put)(struct rows_source *source); /* the present row into the batch */
	struct incise_arrow_field fields[COLUMNS_MAX + 1];
	const char *calibrated; /* column whose calibration is known, or NULL */
} tables[] = {
	{"force",
	 "seq, t_ns, code",
	 put_force,
	 {SEQ, TIME, FIELD("code", "1", "code of the converter", INT32),
	  FIELD("force_N", "N", "on the blade", REAL),
	  FIELD("clipped", "1", "the converter was at an end", FLAG)},
	 "force_N"},
	{"tracker",
	 "seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status, station, "
	 "button",
	 put_columns,
	 {SEQ, TIME, ARRIVAL, FIELD("x_mm", "mm", POSITION, REAL),
	  FIELD("y_mm", "mm", POSITION, REAL), FIELD("z_mm", "mm", POSITION, REAL),
	  FIELD("qw", "1", ORIENTATION, REAL), FIELD("qx", "1", ORIENTATION, REAL),
	  FIELD("qy", "1", ORIENTATION, REAL), FIELD("qz", "1", ORIENTATION, REAL),
	  FIELD("status", "1", "error letter of the tracker, space: none", TEXT),
	  FIELD("station", "1", "sensor of the tracker, from 1", INT32),
	  FIELD("button", "1", "the button of the stylus was pressed", FLAG)},
	 NULL},
	{"depth",
	 "seq, t_ns, depth_mm, velocity_mm_s",
	 put_columns,
	 {SEQ, TIME, FIELD("depth_mm", "mm", "of the tip below the surface", REAL),
	  FIELD("velocity_mm_s", "mm/s", "speed of the tip", REAL)},
	 "depth_mm"},
	{"frames",
	 "seq, t_ns, arrival_ns, pts, bytes, length_px, sd_px, depth_mm, quality",
	 put_columns,
	 {SEQ, TIME, ARRIVAL, FIELD("pts", "ms", "timestamp in camera.mkv", INT64),
	  FIELD("bytes", "byte", "size of the coded frame", INT64),
	  SEEN("length_px", "pixel", "exposed length of the blade"),
	  SEEN("sd_px", "pixel", "standard deviation of the edge"),
	  SEEN("depth_mm", "mm", "depth of the tip below the surface, from vision"),
	  SEEN("quality", "1", "quality of the measurement, 0 to 1")},
	 "depth_mm"},
	{"events",
	 "rowid, t_ns, kind, text",
	 put_event,
	 {FIELD("t_ns", "ns", "CLOCK_MONOTONIC", INT64),
	  FIELD("kind", "1", "kind of the event", TEXT),
	  FIELD("text", "1", "its description", TEXT)},
	 NULL},
};

static int rows_next(struct incise_arrow_source *base, struct ArrowArray *array,
		     struct incise_error *err)
{
	struct rows_source *source = (struct rows_source *)base;
	struct incise_arrow_batch *batch = &source->batch;
	int rc = incise_arrow_batch_start(batch);

	while (!rc && batch->rows < BATCH_ROWS) {
		int more = incise_rows_next(&source->rows, err);

		if (more < 0)
			return more;
		if (!more)
			break;
		source->table->put(source);
		batch->rows++;
	}
	return rc || !batch->rows ? rc : incise_arrow_batch_take(batch, array);
}

static void rows_close(struct incise_arrow_source *base)
{
	struct rows_source *source = (struct rows_source *)base;

	incise_arrow_batch_close(&source->batch);
	incise_rows_close(&source->rows);
	incise_provenance_free(&source->time);
	incise_provenance_free(&source->value);
	incise_recording_close(source->recording);
	free(source);
}

/* A key of metadata, unless the number is not known. */
static int add_known(struct incise_provenance *to, const char *key, double value)
{
	return isnan(value) ? 0 : incise_provenance_add(to, key, "%.17g", value);
}

/* Standard uncertainties that the calibrations state, with their covariance. */
static int describe_uncertainties(struct rows_source *source,
				  const struct incise_export_options *options)
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
	int rc = 0;

	if (strcmp(source->table->name, "force") != 0 &&
	    strcmp(source->table->name, "depth") != 0)
		return 0;
	/* Rows are read even if the text of their calibration is damaged. */
	budget = incise_budget_open(source->recording, options, false, NULL);
	if (!budget)
		return errno == ENOMEM ? -ENOMEM : 0;
	for (size_t i = 0; i < sizeof(items) / sizeof(*items) && !rc; i++)
		if (!strcmp(items[i].table, source->table->name))
			rc = add_known(&source->value, items[i].key,
				       items[i].a == items[i].b
					       ? incise_budget_u(budget, items[i].a)
					       : incise_budget_covariance(
							 budget, items[i].a, items[i].b));
	incise_budget_free(budget);
	return rc;
}

/* The calibration of the values: scales, and the plane that depth is measured from. */
static int describe_values(struct rows_source *source,
			   const struct incise_calibration *given)
{
	const struct incise_recording_info *meta = &source->recording->meta;
	struct incise_provenance *to = &source->value;
	const double *point = meta->surface_point_mm, *normal = meta->surface_normal;
	int rc = 0;

	if (!strcmp(source->table->name, "force")) {
		if (meta->newtons)
			given = NULL;
		rc = add_known(to, "force_mV_N",
			       given ? given->force_mV_N : meta->force_mV_N);
		if (!rc)
			rc = add_known(to, "force_zero_mV",
				       given && !isnan(given->force_zero_mV)
					       ? given->force_zero_mV
					       : meta->zero_mV);
	} else if (!strcmp(source->table->name, "frames")) {
		rc = add_known(to, "depth_mm_px",
			       given ? given->depth_mm_px : meta->depth_mm_px);
	} else {
		rc = incise_provenance_add(to, "surface_point_mm", "%.17g %.17g %.17g",
					   point[0], point[1], point[2]);
		if (!rc)
			rc = incise_provenance_add(to, "surface_normal",
						   "%.17g %.17g %.17g", normal[0],
						   normal[1], normal[2]);
		if (!rc)
			rc = incise_provenance_add(to, "tip_mm", "%.17g %.17g %.17g",
						   meta->tip_mm[0], meta->tip_mm[1],
						   meta->tip_mm[2]);
	}
	return rc;
}

/* The delay that times are corrected by, and their uncertainty. */
static int describe_times(struct rows_source *source)
{
	const struct incise_row_times *times = &source->rows.times;
	int rc = 0;

	if (times->source)
		rc = add_known(&source->time, "delay_ms",
			       (times->source->delay_ns - (double)times->shift_ns) *
				       1e-6);
	if (!rc && times->source)
		rc = add_known(&source->time, "offset_sd_ms",
			       times->source->offset_sd_ns * 1e-6);
	return rc;
}

static int describe(struct rows_source *source,
		    const struct incise_export_options *options)
{
	const struct table *table = source->table;
	int rc = describe_times(source), n = 0;

	if (!rc && table->calibrated)
		rc = describe_values(source, options->calibration);
	if (!rc && table->calibrated)
		rc = describe_uncertainties(source, options);
	for (; table->fields[n].name; n++) {
		struct incise_arrow_field *field = &source->fields[n];

		*field = table->fields[n];
		if (!strcmp(field->name, "t_ns"))
			field->calibration = &source->time;
		else if (table->calibrated && !strcmp(field->name, table->calibrated))
			field->calibration = &source->value;
	}
	source->base.fields = source->fields;
	source->base.n_fields = n;
	return rc;
}

static uint64_t rows_expected(const struct rows_source *source)
{
	const struct incise_recording_info *meta = &source->recording->meta;
	const char *name = source->table->name;

	return !strcmp(name, "force")	  ? meta->force
	       : !strcmp(name, "tracker") ? meta->tracker
	       : !strcmp(name, "depth")	  ? meta->depth
					  : UINT64_MAX;
}

/* On an error nothing but the recording is left to close. */
static int rows_open(struct rows_source *source,
		     const struct incise_export_options *options,
		     struct incise_error *err)
{
	const struct incise_calibration *given = options->calibration;
	struct incise_recording *recording = source->recording;
	const struct table *table = source->table;
	int rc;

	rc = incise_rows_open(&source->rows, recording, table->name, table->columns,
			      rows_expected(source), err);
	if (rc)
		return rc;
	if (given)
		incise_row_times_calibrate(&source->rows.times, given);
	incise_recording_force(recording, given, &source->scale);
	source->depth_scale =
		given ? given->depth_mm_px / recording->meta.depth_mm_px : 1;
	rc = describe(source, options);
	if (!rc)
		rc = incise_arrow_batch_open(&source->batch, source->fields,
					     source->base.n_fields, BATCH_ROWS);
	if (rc)
		return incise_error_set(err, -rc, "%s: out of memory", recording->path);
	return incise_provenance_of(&source->base.provenance, &recording, 1, options,
				    table->name, err);
}

/* --- opening ------------------------------------------------------------------------- */

static const struct table *find_table(const char *what)
{
	for (size_t i = 0; i < sizeof(tables) / sizeof(*tables); i++)
		if (!strcmp(tables[i].name, what))
			return &tables[i];
	return NULL;
}

static struct incise_arrow_source *open_rows(struct incise_recording *recording,
					     const struct table *table,
					     const struct incise_export_options *options,
					     struct incise_error *err)
{
	struct rows_source *source = calloc(1, sizeof(*source));
	int rc;

	if (!source) {
		incise_error_set(err, ENOMEM, "%s: out of memory", recording->path);
		incise_recording_close(recording);
		return NULL;
	}
	source->base.next = rows_next;
	source->base.close = rows_close;
	source->table = table;
	source->recording = recording;
	rc = rows_open(source, options, err);
	if (!rc)
		return &source->base;
	source_close(&source->base);
	errno = -rc;
	return NULL;
}

int incise_recording_stream(struct incise_recording *recording, const char *what,
			    const struct incise_export_options *options,
			    struct ArrowArrayStream *stream, struct incise_error *err)
{
	const struct table *table = find_table(what);
	struct incise_export_options defaults;
	struct stream *made;

	*stream = (struct ArrowArrayStream){0};
	if (!table && strcmp(what, "table"))
		return incise_error_set(
			err, EINVAL,
			"no stream '%s' in a recording; there are: force, tracker, "
			"depth, frames, events, table",
			what);
	incise_export_options_init(&defaults);
	made = calloc(1, sizeof(*made));
	if (!made)
		return incise_error_set(err, ENOMEM, "%s: out of memory",
					recording->path);
	/* Of its own: a connection is for one thread at a time. */
	recording = incise_recording_open(recording->path, err);
	if (recording)
		made->source =
			table ? open_rows(recording, table, options ? options : &defaults,
					  err)
			      : incise_arrow_table(recording,
						   options ? options : &defaults, err);
	if (!made->source) {
		free(made);
		return -errno;
	}
	made->owner = getpid();
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
