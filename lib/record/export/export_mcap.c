// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording as messages for viewers; see writers.h and messages.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/clock.h>
#include "../../base/c_locale.h"
#include "decimal.h"
#include "messages.h"
#include "writers.h"

#define STREAMS INCISE_MCAP_CHANNELS_MAX

/* --- for the profiles ---------------------------------------------------------------- */

int incise_messages_reserve(struct incise_messages *messages, size_t bytes)
{
	/* Each byte may be quoted. */
	size_t capacity =
		(16 + 4 * INCISE_BUDGET_COLUMNS) * INCISE_DECIMAL_MAX + 2 * bytes;
	char *text;

	if (capacity <= messages->capacity)
		return 0;
	text = realloc(messages->text, capacity);
	if (!text)
		return -ENOMEM;
	messages->text = text;
	messages->capacity = capacity;
	return 0;
}

int64_t incise_message_force(struct incise_messages *messages,
			     const struct incise_rows *rows, double *force_N,
			     bool *clipped)
{
	const struct incise_recording_force *scale = &messages->scale;
	int64_t code = incise_rows_int(rows, 2);

	if (code < 0 || code > scale->top)
		return -EINVAL;
	*clipped = code == 0 || code == scale->top;
	*force_N = code * scale->n_per_code - scale->zero_N;
	messages->clipped += *clipped;
	return code;
}

uint64_t incise_message_ns(const struct incise_messages *messages, int64_t t_ns)
{
	int64_t ns = t_ns + messages->wall_ns;

	if (messages->wall && !incise_wall_tai(messages->wall, t_ns, &ns, NULL))
		ns -= incise_wall_utc_offset_s(messages->wall, t_ns) * INCISE_NS_PER_S;

	return ns > 0 ? (uint64_t)ns : 0;
}

/* --- wall time ----------------------------------------------------------------------- */

/* Find the clock's t_ns when the recording started: its first event. Returns 0 or -errno. */
static int find_start(struct incise_recording *recording, int64_t *start_ns,
		      struct incise_error *err)
{
	struct incise_rows rows;
	int rc = incise_rows_open(&rows, recording, "events", "rowid, t_ns, kind",
				  UINT64_MAX, err);

	if (!rc)
		rc = incise_rows_next(&rows, err);
	*start_ns = rc > 0 ? rows.t_ns : 0;
	incise_rows_close(&rows);
	return rc < 0 ? rc : 0;
}

/* By the wall time, else from the wall clock at the start, in whole seconds. */
static int find_wall(struct incise_messages *messages, struct incise_error *err)
{
	/* Of a joined recording that of its clock, whatever is read of it. */
	struct incise_recording *recording =
		messages->recording->streams[INCISE_LEDGER_WALL]->file;
	struct incise_error none = {0};
	int64_t start_ns;
	const char *end;
	struct tm utc = {0};
	time_t t;
	int rc = find_start(recording, &start_ns, err);

	if (rc)
		return rc;
	end = strptime(recording->meta.started, "%Y-%m-%dT%H:%M:%SZ", &utc);
	t = end && !*end ? timegm(&utc) : -1;
	if (t < 0 || t > INT32_MAX)
		return incise_error_set(
			err, EINVAL,
			"%s: started at '%s', but times of ROS lie between 1970 and 2038; "
			"export it without --profile",
			recording->path, recording->meta.started);
	messages->wall_ns = (int64_t)t * 1000000000 - start_ns;
	messages->wall = incise_recording_wall(messages->recording, &none);
	/* A recording that claims to have it, and has it not, is not to be trusted. */
	if (!messages->wall && none.code != ENODATA)
		return incise_error_set(err, none.code, "%s", none.text);
	/* Of a joined recording, times may be far from the points; they go on from the last. */
	if (messages->wall) {
		const struct incise_wall_point *last;
		size_t n = incise_wall_points(messages->wall, &last);

		last += n - 1;
		messages->wall_ns =
			last->tai_ns - last->t_ns - last->utc_offset_s * INCISE_NS_PER_S;
	}
	return 0;
}

/* The largest bound at any of the points. */
static int add_points(struct incise_provenance *pairs, const struct incise_wall *wall)
{
	const struct incise_wall_point *points;
	size_t n = incise_wall_points(wall, &points);
	int64_t largest_ns = 0;
	int rc = incise_provenance_add(pairs, "source", "%s, time of %s", points->source,
				       points->reference);

	for (size_t i = 0; i < n; i++) {
		int64_t tai_ns, u_ns = 0;

		incise_wall_tai(wall, points[i].t_ns, &tai_ns, &u_ns);
		largest_ns = u_ns > largest_ns ? u_ns : largest_ns;
	}
	if (rc)
		return rc;
	return largest_ns == INCISE_WALL_UNKNOWN
		       ? incise_provenance_add(pairs, "uncertainty_s", "unknown")
		       : incise_provenance_add(pairs, "uncertainty_s", "%.9g",
					       (double)largest_ns * 1e-9);
}

static int write_wall(struct incise_mcap *mcap, const struct incise_messages *messages)
{
	struct incise_provenance pairs = {0};
	int rc = incise_provenance_add(&pairs, "clock", "UTC");

	if (!rc && messages->wall)
		rc = add_points(&pairs, messages->wall);
	if (!rc && !messages->wall)
		rc = incise_provenance_add(&pairs, "source",
					   "wall clock at the start, in whole seconds");
	if (!rc && !messages->wall)
		rc = incise_provenance_add(&pairs, "uncertainty_s", "1");
	if (!rc && !messages->wall)
		rc = incise_provenance_add(&pairs, "offset_ns", "%lld",
					   (long long)messages->wall_ns);
	if (!rc)
		incise_mcap_metadata(mcap, "incise.wall", &pairs);
	incise_provenance_free(&pairs);
	return rc;
}

/* --- uncertainties ------------------------------------------------------------------- */

/* In the style of the CF conventions: which members of a message are uncertainties of which. */
static int write_uncertainties(struct incise_mcap *mcap,
			       enum incise_export_uncertainty uncertainty)
{
	const struct incise_budget_value *values = incise_budget_values();
	const struct incise_budget_part *parts = incise_budget_parts();
	struct incise_provenance pairs = {0};
	int rc = 0;

	/* The messages have their times in their headers. */
	for (int q = 0; q < INCISE_BUDGET_TIME && !rc; q++) {
		const struct incise_budget_value *value = &values[q];
		int n = uncertainty == INCISE_EXPORT_PARTS ? value->n : 0;
		char text[600];
		int used = snprintf(text, sizeof(text), "%s", value->total);

		for (int i = value->first; i < value->first + n; i++)
			used += snprintf(text + used, sizeof(text) - (size_t)used, " %s",
					 parts[i].column);
		rc = incise_provenance_add(&pairs, value->value, "%s", text);
		for (int i = value->first; i < value->first + n && !rc; i++)
			rc = incise_provenance_add(
				&pairs, parts[i].column, "%s",
				incise_budget_correlations[parts[i].scope]);
	}
	if (!rc)
		incise_mcap_metadata(mcap, "incise.uncertainty_variables", &pairs);
	incise_provenance_free(&pairs);
	return rc;
}

/* --- writing ------------------------------------------------------------------------- */

/* An export under way; of the profile's streams, those that exist. */
struct export
{
	const struct incise_message_profile *profile;
	const struct incise_export_options *options;
	struct incise_messages messages;
	struct incise_mcap mcap;
	struct incise_rows rows[STREAMS];
	int channels[STREAMS];
	int selected;	  /* a bit for each */
	int64_t first_ns; /* of the range */
};

static int fail_write(int rc, struct incise_error *err)
{
	return incise_error_set(
		err, -rc,
		"the messages cannot be written: %s; free disk space, or give another "
		"-o",
		strerror(-rc));
}

/* Write the message of a row of a stream. Returns 0 or -errno. */
static int write_row(struct export *export, int i, struct incise_error *err)
{
	const struct incise_message_stream *stream = &export->profile->streams[i];
	struct incise_messages *messages = &export->messages;
	const struct incise_rows *rows = &export->rows[i];
	int64_t length = stream->encode(messages, rows);
	long long row = incise_rows_seq(rows);
	int rc;

	if (!length)
		messages->omitted++;
	if (!length)
		return 0;
	if (length == -EINVAL)
		return incise_error_set(err, EINVAL,
					"%s: damaged: table %s, row %lld is invalid",
					messages->recording->path, stream->table, row);
	if (length < 0)
		return incise_error_set(err, (int)-length, "%s: table %s, row %lld: %s",
					messages->recording->path, stream->table, row,
					strerror((int)-length));
	rc = incise_mcap_message(&export->mcap, export->channels[i],
				 incise_message_ns(messages, rows->t_ns), messages->text,
				 (size_t)length);
	return rc ? fail_write(rc, err) : 0;
}

/* Write all rows, the earliest first. Returns their number, or -errno. */
static int64_t each_row(struct export *export, uint64_t all, struct incise_error *err)
{
	struct incise_rows *rows = export->rows;
	int64_t n = 0;
	int rc = 0;

	for (int i = 0; i < export->profile->n && rc >= 0; i++)
		if (export->selected & 1 << i)
			rc = incise_rows_next(&rows[i], err);
	while (rc >= 0) {
		int next = -1;

		for (int i = 0; i < export->profile->n; i++)
			if (rows[i].live && (next < 0 || rows[i].t_ns < rows[next].t_ns))
				next = i;
		if (next < 0)
			return n;
		rc = 0;
		if (incise_range_has(&export->messages.recording->range,
				     rows[next].t_ns - export->first_ns, 0))
			rc = write_row(export, next, err);
		else
			export->messages.omitted++;
		if (!rc && (++n & 0xffff) == 0)
			rc = incise_export_progress(export->options, (double)n,
						    (double)all, err);
		if (!rc)
			rc = incise_rows_next(&rows[next], err);
	}
	return rc;
}

/* Rows of a table as meta has them; not known of events and frames. */
static uint64_t expected(const struct incise_recording_info *meta, const char *table)
{
	return !strcmp(table, "force")	   ? meta->force
	       : !strcmp(table, "tracker") ? meta->tracker
	       : !strcmp(table, "depth")   ? meta->depth
					   : UINT64_MAX;
}

/* Whether the rig had it; a topic without any message looks like a loss. */
static bool exists(const struct incise_recording *recording, const char *table)
{
	return strcmp(table, "force") ? expected(&recording->meta, table) > 0
				      : incise_recording_has_force(recording);
}

/* To a part, whose times count from the first sample, by the calibration in use. */
static int limit(struct export *export, struct incise_error *err)
{
	const struct incise_calibration *given = export->options->calibration;
	struct incise_recording *recording = export->messages.recording;
	struct incise_rows rows;
	int rc = incise_recording_limit(recording, export->options, err);

	if (rc || !recording->range.limited)
		return rc;
	rc = incise_rows_open(&rows, recording,
			      incise_recording_has_force(recording) ? "force" : "tracker",
			      "seq, t_ns", UINT64_MAX, err);
	if (!rc && given)
		incise_row_times_calibrate(&rows.times, given);
	if (!rc)
		rc = incise_rows_first(&rows, &export->first_ns, err);
	incise_rows_close(&rows);
	return rc;
}

/* Open the tables, and announce their topics. Returns 0 or -errno. */
static int open_streams(struct export *export, struct incise_error *err)
{
	const struct incise_message_profile *profile = export->profile;
	const struct incise_calibration *given = export->options->calibration;
	struct incise_recording *recording = export->messages.recording;
	int rc = 0;

	export->selected = (1 << profile->n) - 1;
	if (profile->select)
		export->selected = profile->select(&export->messages, err);
	if (export->selected < 0)
		return export->selected;
	for (int i = 0; i < profile->n && !rc; i++) {
		const struct incise_message_stream *stream = &profile->streams[i];

		if (!exists(recording, stream->table))
			export->selected &= ~(1 << i);
		if (!(export->selected & 1 << i))
			continue;
		rc = incise_rows_open(&export->rows[i], recording, stream->table,
				      stream->columns,
				      expected(&recording->meta, stream->table), err);
		if (!rc && given)
			incise_row_times_calibrate(&export->rows[i].times, given);
		export->channels[i] = incise_mcap_channel(
			&export->mcap,
			&(struct incise_mcap_channel){
				.topic = stream->topic,
				.encoding = profile->encoding,
				.schema_name = stream->schema_name,
				.schema_encoding = profile->schema_encoding,
				.schema = stream->schema,
				.qos = profile->qos,
			});
	}
	return rc;
}

/* Write everything. Returns the number of rows, or -errno. */
static int64_t write_messages(struct export *export,
			      const struct incise_provenance *provenance,
			      struct incise_error *err)
{
	const struct incise_message_profile *profile = export->profile;
	struct incise_messages *messages = &export->messages;
	struct incise_recording *recording = messages->recording;
	const struct incise_recording_info *meta = &recording->meta;
	int64_t n = 0;
	int rc = incise_messages_reserve(messages, 0);

	if (rc)
		return incise_error_set(err, ENOMEM, "out of memory");
	incise_recording_force(recording, export->options->calibration, &messages->scale);
	if (incise_recording_has_force(recording))
		rc = incise_recording_need_zero(recording, &messages->scale, err);
	if (!rc && profile->wall)
		rc = find_wall(messages, err);
	if (!rc && export->options->uncertainty) {
		messages->uncertainty = export->options->uncertainty;
		messages->budget =
			incise_budget_open(recording, export->options, true, err);
		rc = messages->budget
			     ? incise_blade_pose_open(&messages->blade, recording,
						      export->options->calibration, err)
			     : -errno;
	}
	if (!rc)
		rc = limit(export, err);
	if (!rc)
		rc = open_streams(export, err);
	if (rc)
		return rc;
	incise_mcap_metadata(&export->mcap, "incise", provenance);
	if (profile->wall)
		rc = write_wall(&export->mcap, messages);
	if (!rc && messages->budget)
		rc = write_uncertainties(&export->mcap, messages->uncertainty);
	if (rc)
		return fail_write(rc, err);
	n = each_row(export, meta->force + meta->tracker + meta->depth, err);
	if (n < 0)
		return n;
	if (profile->finish)
		rc = profile->finish(profile, &export->mcap);
	if (!rc)
		rc = incise_mcap_finish(&export->mcap);
	n -= (int64_t)messages->omitted;
	if (!rc && !n && recording->range.limited)
		return incise_error_set(
			err, ENODATA,
			"%s: has nothing in this part; give another --from "
			"and --to",
			recording->path);
	return rc ? fail_write(rc, err) : n;
}

int incise_export_mcap(struct incise_recording *recording,
		       const struct incise_export_options *options, FILE *out,
		       const struct incise_provenance *provenance,
		       struct incise_export_report *report, struct incise_error *err)
{
	struct export export = {
		.profile = options->ros2 ? &incise_messages_ros2 : &incise_messages_json,
		.options = options,
		.messages = {.recording = recording},
	};
	struct incise_c_locale locale = incise_c_locale_begin();
	int64_t n;

	incise_mcap_begin(&export.mcap, out, export.profile->name);
	n = write_messages(&export, provenance, err);
	incise_c_locale_end(locale);
	for (int i = 0; i < STREAMS; i++)
		incise_rows_close(&export.rows[i]);
	incise_mcap_free(&export.mcap);
	incise_frames_reader_close(export.messages.frames);
	incise_wall_free(export.messages.wall);
	free(export.messages.text);
	if (n >= 0 && report) {
		*report = (struct incise_export_report){
			.rows = (uint64_t)n,
			.clipped = export.messages.clipped,
		};
		if (export.messages.budget)
			incise_report_unstated(report, export.messages.budget);
	}
	if (export.messages.budget)
		incise_blade_pose_close(&export.messages.blade);
	incise_budget_free(export.messages.budget);
	if (n < 0)
		return (int)n;
	return 0;
}
