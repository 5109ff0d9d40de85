// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The cuts of a recording, see cut.h, and its info, which needs them.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <time.h>
#include <incise/clock.h>
#include "cut.h"
#include "recalibration.h"
#include "../schema.h"

bool incise_cut_step(struct incise_cut_count *cut, double depth_mm)
{
	if (!cut->inside && depth_mm > INCISE_CUT_START_MM) {
		cut->inside = true;
		cut->count++;
	} else if (cut->inside && depth_mm < INCISE_CUT_END_MM) {
		cut->inside = false;
	}
	return cut->inside;
}

static int bad_row(const struct incise_rows *rows, const char *what,
		   struct incise_error *err)
{
	const char *path = rows->recording->path;

	return incise_error_set(err, EINVAL,
				"%s: damaged: table %s, row %lld: %s; `incise verify %s` "
				"lists what is damaged",
				path, rows->table, (long long)incise_rows_seq(rows), what,
				path);
}

static int step_force(struct incise_cuts *cuts, int64_t *t_ns, int32_t *code,
		      struct incise_error *err)
{
	int rc =
		cuts->force.n ? 0 : incise_rows_first(&cuts->force, &cuts->first_ns, err);
	int64_t value;

	if (!rc)
		rc = incise_rows_next(&cuts->force, err);
	if (rc <= 0)
		return rc;
	value = incise_rows_int(&cuts->force, 2);
	if (value < 0 || value > cuts->scale.top)
		return bad_row(&cuts->force, "code is out of the converter's range", err);
	*code = value;
	*t_ns = cuts->force.t_ns;
	cuts->last_ns = *t_ns;
	return 1;
}

/* Move on to the next depth row, if there is one. */
static int step_depth(struct incise_cuts *cuts, struct incise_error *err)
{
	struct incise_cut_depth next;
	int rc = incise_rows_next(&cuts->depth, err);

	cuts->follow.before = cuts->follow.after;
	cuts->follow.after.t_ns = INCISE_TIME_NONE;
	if (rc <= 0)
		return rc;
	next = (struct incise_cut_depth){
		.t_ns = cuts->depth.t_ns,
		.depth_mm = incise_rows_real(&cuts->depth, 2),
		.velocity_mm_s = incise_rows_real(&cuts->depth, 3),
	};
	/* A rig is some metres wide; light is slow enough for the other bound. */
	if (!(fabs(next.depth_mm) < 1e6))
		return bad_row(&cuts->depth, "depth_mm is not a depth", err);
	if (!(next.velocity_mm_s >= 0 && next.velocity_mm_s < 1e12))
		return bad_row(&cuts->depth, "velocity_mm_s is not a speed", err);
	cuts->follow.after = next;
	cuts->depth_max_mm = fmax(cuts->depth_max_mm, next.depth_mm);
	return 1;
}

void incise_cuts_calibrate(struct incise_cuts *cuts,
			   const struct incise_calibration *calibration)
{
	incise_recording_force(cuts->recording, calibration, &cuts->scale);
	incise_row_times_calibrate(&cuts->force.times, calibration);
	incise_row_times_calibrate(&cuts->depth.times, calibration);
}

int incise_cuts_open(struct incise_cuts *cuts, struct incise_recording *recording,
		     struct incise_error *err)
{
	int rc;

	*cuts = (struct incise_cuts){
		.recording = recording,
		.follow.before.t_ns = INCISE_TIME_NONE,
		.follow.after.t_ns = INCISE_TIME_NONE,
		.follow.cut.count = recording->range.cuts,
		.depth_max_mm = -INFINITY,
	};
	incise_recording_force(recording, NULL, &cuts->scale);
	rc = incise_rows_open(&cuts->force, recording, "force", "seq, t_ns, code",
			      recording->meta.force, err);
	if (!rc)
		rc = incise_rows_open(&cuts->depth, recording, "depth",
				      "seq, t_ns, depth_mm, velocity_mm_s",
				      recording->meta.depth, err);
	if (rc)
		incise_cuts_close(cuts);
	return rc;
}

void incise_cuts_close(struct incise_cuts *cuts)
{
	incise_rows_close(&cuts->force);
	incise_rows_close(&cuts->depth);
}

bool incise_cut_between(struct incise_cut_follow *follow,
			struct incise_cut_sample *sample)
{
	const struct incise_cut_depth *a = &follow->before, *b = &follow->after;
	double share = incise_row_share(a->t_ns, b->t_ns, sample->t_ns);

	if (isnan(share))
		return false;
	sample->depth_mm = a->depth_mm + share * (b->depth_mm - a->depth_mm);
	sample->velocity_mm_s =
		a->velocity_mm_s + share * (b->velocity_mm_s - a->velocity_mm_s);
	if (!incise_cut_step(&follow->cut, sample->depth_mm))
		return false;
	sample->cut = follow->cut.count;
	return true;
}

int incise_cuts_next(struct incise_cuts *cuts, struct incise_cut_sample *sample,
		     struct incise_error *err)
{
	int32_t code = 0;
	int rc;

	while ((rc = step_force(cuts, &sample->t_ns, &code, err)) > 0) {
		while ((cuts->follow.after.t_ns != INCISE_TIME_NONE || !cuts->depth.n) &&
		       cuts->follow.after.t_ns <= sample->t_ns) {
			rc = step_depth(cuts, err);
			if (rc < 0)
				return rc;
			if (!rc)
				break;
		}
		if (!incise_cut_between(&cuts->follow, sample))
			continue;
		sample->force_N = code * cuts->scale.n_per_code - cuts->scale.zero_N;
		sample->clipped = code == 0 || code == cuts->scale.top;
		return 1;
	}
	/* Rows behind the last force sample are checked too. */
	while (!rc && cuts->follow.after.t_ns != INCISE_TIME_NONE)
		rc = step_depth(cuts, err) < 0 ? -errno : 0;
	return rc;
}

/* --- info -------------------------------------------------------------------------- */

/* The rows of the tracker are checked here, because they are not exported. */
static int check_tracker(struct incise_recording *rec, struct incise_error *err)
{
	struct incise_rows rows;
	int rc = incise_rows_open(&rows, rec, "tracker", "seq, t_ns", rec->meta.tracker,
				  err);

	rc = rc ? rc : 1;
	while (rc > 0)
		rc = incise_rows_next(&rows, err);
	incise_rows_close(&rows);
	return rc;
}

/*
 * The wall clock was read at the event "start", when the recorder started: samples come later,
 * after a trigger by any time.
 */
static void find_started(struct incise_recording *rec, struct incise_recording_info *info)
{
	const struct incise_stream_source *source =
		rec->streams[info->force ? INCISE_LEDGER_FORCE : INCISE_LEDGER_TRACKER];
	struct tm utc = {0};
	const char *end =
		strptime(source->file->meta.started, "%Y-%m-%dT%H:%M:%SZ", &utc);
	int64_t read_s = end && !*end ? (int64_t)timegm(&utc) : 0, start_ns, after_ns;
	time_t started;

	start_ns = incise_schema_ask(source->file->db, -1,
				     "SELECT t_ns FROM events WHERE kind = 'start' "
				     "ORDER BY rowid LIMIT 1");
	/* A time that is damaged, or later than the samples, leaves the text as it is. */
	if (read_s <= 0 || read_s > UINT32_MAX || start_ns < 0 ||
	    __builtin_sub_overflow(info->start_ns,
				   incise_session_time(source->map, start_ns),
				   &after_ns) ||
	    after_ns < 0 || after_ns >= INT64_MAX / 4)
		return;
	info->start_utc_ns = read_s * INCISE_NS_PER_S + after_ns;
	started = (time_t)(info->start_utc_ns / INCISE_NS_PER_S);
	strftime(info->started, sizeof(info->started), "%Y-%m-%dT%H:%M:%SZ",
		 gmtime_r(&started, &utc));
}

/* Count the cuts by the rows of the depth alone, and find the largest depth in them. */
static int follow_depth(struct incise_cuts *cuts, double *depth_max_mm,
			struct incise_error *err)
{
	int rc;

	while ((rc = step_depth(cuts, err)) > 0)
		if (incise_cut_step(&cuts->follow.cut, cuts->follow.after.depth_mm))
			*depth_max_mm = fmax(*depth_max_mm, cuts->follow.after.depth_mm);
	return rc;
}

/* By all rows. Returns 0 or -errno. */
static int read_cuts(struct incise_recording *rec, struct incise_recording_info *info,
		     struct incise_error *err)
{
	struct incise_cut_sample sample;
	struct incise_cuts cuts;
	int rc = check_tracker(rec, err);

	if (!rc)
		rc = incise_cuts_open(&cuts, rec, err);
	if (rc)
		return rc;
	while ((rc = incise_cuts_next(&cuts, &sample, err)) > 0) {
		info->depth_max_mm = fmax(info->depth_max_mm, sample.depth_mm);
		info->force_max_N =
			fmax(info->force_max_N, sample.force_N); /* NaN: no zero */
	}
	/* Without force samples, by the rows of the depth themselves. */
	if (!rc && !info->force)
		rc = follow_depth(&cuts, &info->depth_max_mm, err);
	info->cuts = cuts.follow.cut.count;
	info->start_ns = cuts.first_ns;
	info->end_ns = cuts.last_ns;
	incise_cuts_close(&cuts);
	return rc;
}

/*
 * By what the recorder has found: of a recording as it was made, from format 5 on. 1, 0: there is no
 * summary; -errno.
 */
static int take_summary(struct incise_recording *rec, struct incise_recording_info *info,
			struct incise_error *err)
{
	const struct incise_recording_numbers *numbers = &rec->numbers;
	struct incise_row_times times;
	int64_t seq[2], t_ns[2];
	int rc;

	if (rec->session || rec->old || !rec->meta.complete || rec->recalibrated)
		return 0;
	if (!(numbers->cuts >= 0 && numbers->cuts < 1e9) ||
	    isnan(numbers->depth_max_mm) || isnan(numbers->force_max_N))
		return 0;
	for (int i = 0; i < 2 && info->force; i++) {
		rc = incise_source_end(rec, "force", i, &seq[i], &t_ns[i], NULL, err);
		if (rc <= 0)
			return rc;
	}
	rc = info->force ? incise_row_times_open(&times, rec, "force", err) : 0;
	if (rc)
		return rc;
	if (info->force &&
	    (!incise_row_times_next(&times, seq[0], t_ns[0], &info->start_ns) ||
	     !incise_row_times_next(&times, seq[1], t_ns[1], &info->end_ns)))
		return 0;
	info->cuts = (int)numbers->cuts;
	info->depth_max_mm = numbers->depth_max_mm;
	info->force_max_N = numbers->force_max_N;
	info->summary = true;
	return 1;
}

static int find_info(struct incise_recording *rec, bool samples,
		     struct incise_recording_info *info, struct incise_error *err)
{
	int rc;

	*info = rec->meta;
	rc = incise_recording_streams(rec, info->streams, err);
	if (rc < 0)
		return rc;
	info->n_streams = rc;
	info->depth_max_mm = 0;
	info->force_max_N = 0;
	rc = samples ? 0 : take_summary(rec, info, err);
	if (!rc)
		rc = read_cuts(rec, info, err);
	if (rc < 0)
		return rc;
	/* Without a force channel, the tracker's. */
	if (!info->force &&
	    incise_source_span(rec, "tracker", &info->start_ns, &info->end_ns)) {
		const struct incise_session_map *map =
			rec->streams[INCISE_LEDGER_TRACKER]->map;

		info->start_ns = incise_session_time(map, info->start_ns);
		info->end_ns = incise_session_time(map, info->end_ns);
	}
	find_started(rec, info);
	return 0;
}

int incise_recording_info(struct incise_recording *rec,
			  struct incise_recording_info *info, struct incise_error *err)
{
	return find_info(rec, false, info, err);
}

int incise_recording_measure(struct incise_recording *rec,
			     struct incise_recording_info *info, struct incise_error *err)
{
	return find_info(rec, true, info, err);
}
