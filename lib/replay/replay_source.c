// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording as input of the loop; see replay_source.h.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "../record/read/session.h"
#include "replay_source.h"

/* Longer than any recording; a replay in real time would wait for a forged time. */
#define SPAN_MAX_NS 1000000000000000LL
#define COUNT_MAX (1LL << 53)

/* Columns of the table tracker behind seq and t_ns. */
#define ARRIVAL 2
#define POSITION 3
#define QUATERNION 6
#define STATUS 10
#define STATION 11
#define BUTTON 12

static int damaged_replay_source(const struct incise_replay_stream *s, const char *what,
				 struct incise_error *err)
{
	return incise_error_set(err, EINVAL,
				"%s: damaged: table %s, row %lld: %s; `incise verify "
				"%s` lists what is damaged",
				s->rows.recording->path, s->rows.table,
				(long long)incise_rows_seq(&s->rows), what,
				s->rows.recording->path);
}

/* Go to the next row: 1, 0 at the end, -errno. */
static int step_replay_source(struct incise_replay_stream *s, struct incise_error *err)
{
	int rc = incise_rows_next(&s->rows, err);
	int64_t seq;

	if (rc <= 0)
		return rc;
	seq = incise_rows_seq(&s->rows);
	if (seq < 0 || seq > COUNT_MAX)
		return damaged_replay_source(s, "seq is not a count", err);
	s->t_ns = s->rows.t_ns;
	return 1;
}

static int step_force(struct incise_replay_source *source, struct incise_error *err)
{
	struct incise_replay_stream *s = &source->force;
	int rc = step_replay_source(s, err);
	int64_t code;

	if (rc <= 0)
		return rc;
	code = incise_rows_int(&s->rows, 2);
	if (code < 0 || code > source->scale.top)
		return damaged_replay_source(s, "code is out of the converter's range",
					     err);
	return 1;
}

/* A time of the machine on the clock of a joined recording, however forged it is. */
static int64_t on_clock(const struct incise_replay_stream *s, int64_t t_ns)
{
	const int64_t most_ns = INT64_MAX / 4;

	if (!s->rows.times.map)
		return t_ns;
	t_ns = t_ns < 0 ? 0 : t_ns > most_ns ? most_ns : t_ns;
	return incise_session_time(s->rows.times.map, t_ns);
}

/* A pose's time is that at which the loop receives it. */
static int step_pose(struct incise_replay_source *source, struct incise_error *err)
{
	struct incise_replay_stream *s = &source->tracker;
	int64_t before_ns = s->rows.live ? s->t_ns : 0;
	int rc = step_replay_source(s, err);

	if (rc <= 0)
		return rc;
	if (source->at == INCISE_REPLAY_ACQUISITION)
		return 1;
	s->t_ns = on_clock(s, incise_rows_int(&s->rows, ARRIVAL));
	/* The clock does not run back; a pose from far ahead would delay all behind it. */
	if (s->t_ns < before_ns)
		return damaged_replay_source(s, "arrival_ns decreases", err);
	return 1;
}

static int step_depth(struct incise_replay_source *source, struct incise_error *err)
{
	struct incise_replay_stream *s = &source->depth;
	int rc = step_replay_source(s, err);

	source->deep[0] = source->deep[1];
	source->deep[1].t_ns = INCISE_TIME_NONE;
	if (rc > 0)
		source->deep[1] = (struct incise_cut_depth){
			.t_ns = s->t_ns,
			.depth_mm = incise_rows_real(&s->rows, 2),
		};
	return rc;
}

/* --- opening ------------------------------------------------------------------------- */

/* A number of table meta within bounds. */
static int check_number(const struct incise_recording *recording, const char *key,
			double value, double least, double most, struct incise_error *err)
{
	if (value >= least && value <= most)
		return 0;
	return incise_error_set(err, EINVAL,
				"%s: damaged: '%s' in table meta is missing, or out of "
				"range",
				recording->path, key);
}

/* The predictor's limits of rate and latency; lib/control/predict.h. */
static int read_info(struct incise_replay_source *source, struct incise_error *err)
{
	const struct incise_recording *recording = source->recording;
	const double rate_hz = recording->numbers.tracker_hz;
	const double latency_ns = recording->numbers.tracker_latency_ns;
	int rc = check_number(recording, "tracker_hz", rate_hz, 1, 1e4, err);

	if (!rc)
		rc = check_number(recording, "tracker_latency_ns", latency_ns, 0, 1e9,
				  err);
	if (rc)
		return rc;
	source->info = (struct incise_tracker_info){
		.name = "recorded",
		.rate_hz = rate_hz,
		.latency_ns =
			source->at == INCISE_REPLAY_ARRIVAL ? llrint(latency_ns) : 0,
		.stations = 1,
	};
	return 0;
}

static int open_streams(struct incise_replay_source *source, struct incise_error *err)
{
	struct incise_recording *recording = source->recording;
	int rc = incise_rows_open(&source->tracker.rows, recording, "tracker",
				  "seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy, "
				  "qz, status, station, button",
				  recording->meta.tracker, err);

	if (!rc)
		rc = incise_rows_open(&source->force.rows, recording, "force",
				      "seq, t_ns, code", recording->meta.force, err);
	if (!rc)
		rc = incise_rows_open(&source->depth.rows, recording, "depth",
				      "seq, t_ns, depth_mm, velocity_mm_s",
				      recording->meta.depth, err);
	return rc;
}

/* Time of the last row, if there is one; the row is checked when it is read. */
static int find_last(struct incise_replay_source *source,
		     const struct incise_replay_stream *s, bool arrival,
		     struct incise_error *err)
{
	int64_t seq, t_ns, arrival_ns;
	int rc = incise_source_end(s->rows.recording, s->rows.table, true, &seq, &t_ns,
				   &arrival_ns, err);

	if (rc <= 0)
		return rc;
	t_ns = on_clock(s, arrival ? arrival_ns
				   : incise_row_times_line(&s->rows.times, seq, t_ns));
	if (t_ns > source->last_ns)
		source->last_ns = t_ns;
	return 0;
}

static int find_span(struct incise_replay_source *source, struct incise_error *err)
{
	const char *path = source->recording->path;
	int rc;

	if (!source->tracker.rows.live)
		return incise_error_set(err, ENODATA,
					"%s: no pose to replay: its tracker sent none",
					path);
	source->origin_ns =
		source->force.rows.live ? source->force.t_ns : source->tracker.t_ns;
	source->first_ns = source->tracker.t_ns < source->origin_ns ? source->tracker.t_ns
								    : source->origin_ns;
	source->last_ns = source->first_ns;
	rc = find_last(source, &source->tracker, source->at == INCISE_REPLAY_ARRIVAL,
		       err);
	if (!rc)
		rc = find_last(source, &source->force, false, err);
	if (rc)
		return rc;
	/* The difference of the two could be too large for its type. */
	if (source->first_ns < 0 || source->last_ns > INT64_MAX / 2 ||
	    source->last_ns - source->first_ns > SPAN_MAX_NS)
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: its times from %.0f s to %.0f s are invalid", path,
			source->first_ns * 1e-9, source->last_ns * 1e-9);
	return 0;
}

int incise_replay_source_open(struct incise_replay_source *source,
			      struct incise_recording *recording,
			      enum incise_replay_at at,
			      const struct incise_calibration *calibration,
			      struct incise_error *err)
{
	int rc;

	*source = (struct incise_replay_source){
		.recording = recording,
		.at = at,
		.deep = {{.t_ns = INCISE_TIME_NONE}, {.t_ns = INCISE_TIME_NONE}},
	};
	if (!recording->meta.tracker)
		return incise_error_set(
			err, ENODATA,
			"%s: no pose to replay: it has no row of a tracker; join it with "
			"a recording of the tracker (incise join)",
			recording->path);
	incise_recording_force(recording, calibration, &source->scale);
	rc = read_info(source, err);
	if (!rc)
		rc = open_streams(source, err);
	if (!rc)
		rc = step_pose(source, err);
	if (rc >= 0)
		rc = step_force(source, err);
	if (rc >= 0)
		rc = step_depth(source, err);
	if (rc >= 0)
		rc = find_span(source, err);
	if (rc < 0)
		incise_replay_source_close(source);
	return rc;
}

void incise_replay_source_close(struct incise_replay_source *source)
{
	incise_rows_close(&source->tracker.rows);
	incise_rows_close(&source->force.rows);
	incise_rows_close(&source->depth.rows);
}

/* --- reading ------------------------------------------------------------------------- */

static void take_replay_source_pose(const struct incise_replay_stream *s,
				    struct incise_tracker_sample *pose)
{
	const struct incise_rows *rows = &s->rows;

	*pose = (struct incise_tracker_sample){
		.t_ns = s->t_ns,
		.seq = incise_rows_seq(rows),
		.status = incise_rows_char(rows, STATUS),
		.station = incise_rows_int(rows, STATION),
		.button = incise_rows_int(rows, BUTTON),
	};
	for (int i = 0; i < 3; i++)
		pose->position_mm[i] = incise_rows_real(rows, POSITION + i);
	for (int i = 0; i < 4; i++)
		pose->quaternion[i] = incise_rows_real(rows, QUATERNION + i);
}

int incise_replay_source_poses(struct incise_replay_source *source, int64_t t_ns,
			       struct incise_tracker_sample *poses, int n,
			       struct incise_error *err)
{
	int taken = 0;

	while (taken < n && source->tracker.rows.live && source->tracker.t_ns <= t_ns) {
		int rc;

		take_replay_source_pose(&source->tracker, &poses[taken++]);
		rc = step_pose(source, err);
		if (rc < 0)
			return rc;
	}
	return taken;
}

/* Each sample belongs to the tick that it is nearest to. */
static int average(struct incise_replay_source *source, int64_t t_ns, int64_t period_ns,
		   struct incise_replay_measure *measure, struct incise_error *err)
{
	const struct incise_replay_stream *s = &source->force;
	int64_t from_ns = t_ns - period_ns / 2, end_ns = from_ns + period_ns, sum = 0;
	int n = 0, rc = 0;

	while (rc >= 0 && s->rows.live && s->t_ns < end_ns) {
		int32_t code = incise_rows_int(&s->rows, 2);

		if (s->t_ns >= from_ns) {
			sum += code;
			n++;
			measure->clipped |= code == 0 || code == source->scale.top;
		}
		rc = step_force(source, err);
	}
	measure->force_N =
		n ? (double)sum / n * source->scale.n_per_code - source->scale.zero_N
		  : NAN;
	return rc < 0 ? rc : 0;
}

/* On the line between the rows before and after, if they are near. */
static int find_depth(struct incise_replay_source *source, int64_t t_ns,
		      struct incise_replay_measure *measure, struct incise_error *err)
{
	const struct incise_cut_depth *a = &source->deep[0], *b = &source->deep[1];
	double share;
	int rc = 0;

	while (rc >= 0 && source->depth.rows.live && source->depth.t_ns <= t_ns)
		rc = step_depth(source, err);
	if (rc < 0)
		return rc;
	share = incise_row_share(a->t_ns, b->t_ns, t_ns);
	measure->depth_mm = a->depth_mm + share * (b->depth_mm - a->depth_mm);
	if (isnan(share))
		return 0;
	if (incise_cut_step(&source->cut, measure->depth_mm))
		measure->cut = source->cut.count;
	return 0;
}

int incise_replay_source_measure(struct incise_replay_source *source, int64_t t_ns,
				 int64_t period_ns, struct incise_replay_measure *measure,
				 struct incise_error *err)
{
	int rc;

	*measure = (struct incise_replay_measure){0};
	rc = average(source, t_ns, period_ns, measure, err);
	return rc ? rc : find_depth(source, t_ns, measure, err);
}

int incise_replay_source_finish(struct incise_replay_source *source,
				struct incise_error *err)
{
	int rc = 0;

	while (rc >= 0 && source->tracker.rows.live)
		rc = step_pose(source, err);
	while (rc >= 0 && source->force.rows.live)
		rc = step_force(source, err);
	while (rc >= 0 && source->depth.rows.live)
		rc = step_depth(source, err);
	return rc < 0 ? rc : 0;
}
