// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording as messages for viewers: every row of force, tracker, depth and events, in order
 * of time, log_time = t_ns (CLOCK_MONOTONIC); see streams.h and messages.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/clock.h>
#include "decimal.h"
#include "messages.h"

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
	/* A joined recording has the wall time of its clock, whatever is read of it. */
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
	/* In a joined recording, times may be far from the points; they go on from the last. */
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
static int64_t find_bound(const struct incise_wall *wall)
{
	const struct incise_wall_point *points;
	size_t n = incise_wall_points(wall, &points);
	int64_t largest_ns = 0;

	for (size_t i = 0; i < n; i++) {
		int64_t tai_ns, u_ns = 0;

		incise_wall_tai(wall, points[i].t_ns, &tai_ns, &u_ns);
		largest_ns = u_ns > largest_ns ? u_ns : largest_ns;
	}
	return largest_ns;
}

static int write_wall(struct incise_messages *messages)
{
	struct incise_provenance pairs = {0};
	const struct incise_wall_point *points;

	incise_provenance_add(&pairs, "clock", "UTC");
	if (messages->wall) {
		int64_t bound_ns = find_bound(messages->wall);

		incise_wall_points(messages->wall, &points);
		incise_provenance_add(&pairs, "source", "%s, time of %s", points->source,
				      points->reference);
		if (bound_ns == INCISE_WALL_UNKNOWN)
			incise_provenance_add(&pairs, "uncertainty_s", "unknown");
		else
			incise_provenance_add(&pairs, "uncertainty_s", "%.9g",
					      (double)bound_ns * 1e-9);
	} else {
		incise_provenance_add(&pairs, "source",
				      "wall clock at the start, in whole seconds");
		incise_provenance_add(&pairs, "uncertainty_s", "1");
		incise_provenance_add(&pairs, "offset_ns", "%lld",
				      (long long)messages->wall_ns);
	}
	return incise_messages_pairs(messages, "incise.wall", &pairs);
}

/* --- uncertainties ------------------------------------------------------------------- */

/* In the style of the CF conventions: which members of a message are uncertainties of which. */
static int write_uncertainties(struct incise_messages *messages)
{
	const struct incise_budget_value *values = incise_budget_values();
	const struct incise_budget_part *parts = incise_budget_parts();
	bool with_parts = messages->pass->options->uncertainty == INCISE_EXPORT_PARTS;
	struct incise_provenance pairs = {0};

	/* The messages have their times in their headers. */
	for (int q = 0; q < INCISE_BUDGET_TIME; q++) {
		const struct incise_budget_value *value = &values[q];
		int end = value->first + (with_parts ? value->n : 0);
		char text[600];
		int used = snprintf(text, sizeof(text), "%s", value->total);

		for (int i = value->first; i < end; i++)
			used += snprintf(text + used, sizeof(text) - (size_t)used, " %s",
					 parts[i].column);
		incise_provenance_add(&pairs, value->value, "%s", text);
		for (int i = value->first; i < end; i++)
			incise_provenance_add(&pairs, parts[i].column, "%s",
					      incise_budget_correlations[parts[i].scope]);
	}
	return incise_messages_pairs(messages, "incise.uncertainty_variables", &pairs);
}

/* --- writing ------------------------------------------------------------------------- */

static int fail_write(int rc, struct incise_error *err)
{
	return incise_error_set(
		err, -rc,
		"the messages cannot be written: %s; free disk space, or give another "
		"-o",
		strerror(-rc));
}

/* Whether the rig had it; a topic without any message looks like a loss. */
static bool is_present(const struct incise_recording *recording, const char *table)
{
	return !strcmp(table, "force")	   ? incise_recording_has_force(recording)
	       : !strcmp(table, "tracker") ? recording->meta.tracker > 0
	       : !strcmp(table, "depth")   ? recording->meta.depth > 0
					   : true;
}

/* Open the streams that exist, and announce their topics. Returns 0 or -errno. */
static int open_streams(struct incise_messages *messages, struct incise_error *err)
{
	const struct incise_message_profile *profile = messages->profile;
	int rc = 0, selected = (1 << profile->n) - 1;

	if (profile->select)
		selected = profile->select(messages, err);
	if (selected < 0)
		return selected;
	for (int i = 0; i < profile->n && !rc; i++) {
		const struct incise_message_stream *kind = &profile->streams[i];

		if (!(selected & 1 << i) || !is_present(messages->recording, kind->table))
			continue;
		messages->kinds[messages->n] = kind;
		rc = incise_stream_rows_open(&messages->streams[messages->n++],
					     messages->recording, kind->table,
					     messages->pass->options, err);
		incise_mcap_channel(&messages->mcap,
				    &(struct incise_mcap_channel){
					    .topic = kind->topic,
					    .encoding = profile->encoding,
					    .schema_name = kind->schema_name,
					    .schema_encoding = profile->schema_encoding,
					    .schema = kind->schema,
					    .qos = profile->qos,
				    });
	}
	return rc;
}

/* Read what the messages depend on. Returns 0 or -errno. */
static int prepare_messages(struct incise_messages *messages, struct incise_error *err)
{
	struct incise_recording *recording = messages->recording;
	const struct incise_calibration *given = messages->pass->options->calibration;
	struct incise_recording_force scale;
	int rc = 0;

	if (incise_messages_reserve(messages, 0))
		return incise_error_set(err, ENOMEM, "out of memory");
	incise_recording_force(recording, given, &scale);
	if (incise_recording_has_force(recording))
		rc = incise_recording_need_zero(recording, &scale, err);
	if (!rc && messages->profile->wall)
		rc = find_wall(messages, err);
	if (!rc)
		rc = incise_export_budgets(messages->pass);
	if (!rc && messages->pass->budgets)
		rc = incise_blade_pose_open(&messages->blade, recording, given, err);
	return rc ? rc : incise_messages_limit(messages->pass);
}

static int mcap_open(struct incise_table *table, struct incise_error *err)
{
	struct incise_messages *messages = calloc(1, sizeof(*messages));
	int rc;

	if (!messages)
		return incise_error_set(err, ENOMEM, "out of memory");
	table->state = messages;
	messages->locale = incise_c_locale_begin();
	messages->pass = table->pass;
	messages->recording = table->pass->recordings[0];
	messages->profile = table->pass->options->ros2 ? &incise_messages_ros2
						       : &incise_messages_json;
	incise_mcap_begin(&messages->mcap, table->out, messages->profile->name);
	rc = prepare_messages(messages, err);
	if (!rc)
		rc = open_streams(messages, err);
	if (rc)
		return rc;
	table->streams = messages->streams;
	table->n_streams = messages->n;
	incise_mcap_metadata(&messages->mcap, "incise", table->provenance);
	if (messages->profile->wall)
		rc = write_wall(messages);
	if (!rc && table->pass->budgets)
		rc = write_uncertainties(messages);
	return rc ? fail_write(rc, err) : 0;
}

/* Encode the row of a stream. Returns as encode(); -EINVAL: the row is impossible. */
static int64_t encode_row(struct incise_messages *messages,
			  const struct incise_message_stream *kind,
			  const struct incise_stream_rows *stream)
{
	const union incise_cell *cells = stream->cells;
	int64_t code = cells[INCISE_CELL_CODE].integer;

	if (!strcmp(kind->table, "force")) {
		if (code < 0 || code > stream->scale.top)
			return -EINVAL;
		messages->pass->report.clipped += cells[INCISE_CELL_CLIPPED].flag;
	}
	if (!strcmp(kind->table, "events") &&
	    incise_messages_reserve(messages,
				    strlen(cells[INCISE_CELL_KIND].text) +
					    strlen(cells[INCISE_CELL_TEXT].text)))
		return -ENOMEM;
	return kind->encode(messages, stream);
}

/* Write the message of a row; a row without one is omitted. Returns 0 or -errno. */
static int mcap_put(struct incise_table *table, struct incise_error *err)
{
	struct incise_messages *messages = table->state;
	const struct incise_stream_rows *stream = table->stream;
	int channel = (int)(stream - messages->streams);
	const struct incise_message_stream *kind = messages->kinds[channel];
	int64_t length = encode_row(messages, kind, stream);
	long long row = incise_rows_seq(&stream->rows);
	int rc;

	if (length == -EINVAL)
		return incise_error_set(err, EINVAL,
					"%s: damaged: table %s, row %lld is invalid",
					messages->recording->path, kind->table, row);
	if (length < 0)
		return incise_error_set(err, (int)-length, "%s: table %s, row %lld: %s",
					messages->recording->path, kind->table, row,
					strerror((int)-length));
	if (!length)
		return 0;
	rc = incise_mcap_message(&messages->mcap, channel,
				 incise_message_ns(messages, stream->rows.t_ns),
				 messages->text, (size_t)length);
	messages->pass->report.rows++;
	return rc ? fail_write(rc, err) : 0;
}

static int mcap_end(struct incise_table *table, struct incise_error *err)
{
	struct incise_messages *messages = table->state;
	int rc = messages->profile->finish ? messages->profile->finish(messages) : 0;

	if (!rc)
		rc = incise_mcap_finish(&messages->mcap);
	return rc ? fail_write(rc, err) : 0;
}

static void mcap_close(struct incise_table *table)
{
	struct incise_messages *messages = table->state;

	for (int i = 0; i < messages->n; i++)
		incise_stream_rows_close(&messages->streams[i]);
	incise_mcap_free(&messages->mcap);
	incise_frames_reader_close(messages->frames);
	incise_wall_free(messages->wall);
	incise_blade_pose_close(&messages->blade);
	incise_c_locale_end(messages->locale);
	free(messages->text);
	free(messages);
}

const struct incise_table_format incise_table_mcap = {
	.abi = INCISE_TABLE_ABI,
	.open = mcap_open,
	.put = mcap_put,
	.end = mcap_end,
	.close = mcap_close,
};
