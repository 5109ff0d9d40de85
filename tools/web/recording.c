// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A recording in the viewer; see web.h.
 *
 *     overview: a block of rows in each 1/1500 of the time ─┐
 *     then all rows, in a thread ───────────────────────────┴─▶ spans ─┐
 *     below two spans a column: rows of that part alone ───────────────┴─▶ part
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <incise/arrow.h>
#include <incise/budget.h>
#include <incise/camera.h>
#include <incise/clock.h>
#include <incise/session.h>
#include "../cli/batch.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/recording.h"
#include "web.h"

#define OVERVIEW 1500	       /* blocks of rows of a stream */
#define OVERVIEW_ROWS 2000000U /* fewer are read at once */
#define JOINED_ROWS 5000000U   /* a joined recording is read whole for any part of it */
#define EVENTS_MOST 2000
#define SPAN_LEAST_S 0.05

enum { FORCE, DEPTH, SPEED, CAMERA, X, Y, Z, TRACKS };

static const struct stream {
	const char *name;
	int column, track, n; /* the first column, and the first track of n */
} streams[] = {
	{"force", 3, FORCE, 1},
	{"depth", 2, DEPTH, 2},
	{"tracker", 3, X, 3},
	{"frames", 7, CAMERA, 1},
};

#define STREAMS (sizeof(streams) / sizeof(*streams))

struct web_recording {
	struct web_file base;
	struct incise_recording *recording;
	struct incise_recording_info info;
	double to_s;
	uint64_t rows, rows_read;
	json_t *events;
	struct incise_frame_reader *frames; /* of the thread that asks for them */

	pthread_mutex_t lock; /* of all that follows */
	struct web_series series[TRACKS];
	struct recording_cuts cuts;
	double done;
	struct incise_budget *budget; /* NULL: not yet, or not known */
	double depth_u_mm;
	char damaged[sizeof(
		((struct incise_error *)0)
			->text)]; /* why it could not be read to its end; "": it could */
};

static double web_seconds(const struct web_recording *w, int64_t t_ns)
{
	return (double)(t_ns - w->info.start_ns) / INCISE_NS_PER_S;
}

/* --- reading --------------------------------------------------------------------------- */

/* Where rows go: to series of a part, or to those of the whole. */
struct reading {
	struct web_recording *w;
	struct web_series *series;
	const volatile sig_atomic_t *stop;
	bool whole, overview;
};

static void take_rows(const struct reading *r, const struct stream *stream,
		      const struct ArrowArray *batch, int64_t *last_seq)
{
	struct web_recording *w = r->w;
	const double *zero = stream->track == X ? w->info.surface_point_mm : NULL;

	for (int64_t i = 0; i < batch->length; i++) {
		int64_t seq = whole_at(batch, 0, i);
		double t_s = web_seconds(w, whole_at(batch, 1, i));

		for (int k = 0; k < stream->n; k++) {
			struct web_series *series = &r->series[stream->track + k];
			double y = real_at(batch, stream->column + k, i);

			if (seq != *last_seq + 1 && !r->overview)
				web_series_add(series, t_s, NAN);
			web_series_add(series, t_s, zero ? y - zero[k] : y);
		}
		if (r->whole && stream->track == DEPTH)
			recording_cuts_step(&w->cuts, t_s, real_at(batch, 2, i));
		*last_seq = seq;
	}
	w->rows_read += r->whole ? (uint64_t)batch->length : 0;
	if (r->whole && w->rows)
		w->done = fmin(0.99, (double)w->rows_read / (double)w->rows);
}

/* Rows of a stream. 0, -ECANCELED, or -errno. */
static int web_read_stream(const struct reading *r, const struct stream *stream,
			   const struct incise_export_options *options,
			   struct incise_error *err)
{
	struct ArrowArrayStream rows;
	struct ArrowArray batch;
	int64_t last_seq = -1;
	int rc = incise_recording_stream(r->w->recording, stream->name, options, &rows,
					 err);

	if (rc) /* one of format 1 has no frames, and no stream of them */
		return rc == -ENOTSUP ? 0 : rc;
	for (;;) {
		rc = -rows.get_next(&rows, &batch);
		if (rc)
			incise_error_set(err, -rc, "%s", rows.get_last_error(&rows));
		if (rc || !batch.release)
			break;
		pthread_mutex_lock(&r->w->lock);
		take_rows(r, stream, &batch, &last_seq);
		pthread_mutex_unlock(&r->w->lock);
		batch.release(&batch);
		if (r->stop && *r->stop) {
			rc = -ECANCELED;
			break;
		}
	}
	rows.release(&rows);
	return rc;
}

static int read_streams(const struct reading *r,
			const struct incise_export_options *options,
			struct incise_error *err)
{
	int rc = 0;

	for (size_t i = 0; i < STREAMS && !rc; i++)
		rc = web_read_stream(r, &streams[i], options, err);
	return rc;
}

/* Half a band of force, and the widest of depth: a tip's error counts most along one of its axes. */
static double force_u_N(const void *of, double force_N)
{
	const struct web_recording *w = of;
	const struct incise_budget_row row = {.force_N = force_N, .force_share = 1};
	double part[INCISE_BUDGET_PARTS];

	incise_budget_row(w->budget, &row, part);
	return incise_budget_total(INCISE_BUDGET_FORCE, part);
}

static double depth_u_mm(const void *of, double depth_mm)
{
	(void)depth_mm;
	return ((const struct web_recording *)of)->depth_u_mm;
}

static void take_budget(struct web_recording *w, struct incise_budget *budget)
{
	double part[INCISE_BUDGET_PARTS], widest_mm = 0;

	for (int i = 0; i < 3 && budget; i++) {
		struct incise_budget_row row = {.force_share = 1};

		row.tip[i] = 1;
		incise_budget_row(budget, &row, part);
		part[0] = incise_budget_total(INCISE_BUDGET_DEPTH, part);
		widest_mm = part[0] > widest_mm || isnan(part[0]) ? part[0] : widest_mm;
	}
	pthread_mutex_lock(&w->lock);
	w->budget = budget;
	w->depth_u_mm = widest_mm;
	w->done = 1;
	pthread_mutex_unlock(&w->lock);
}

static int web_recording_read(struct web_file *file, int spans,
			      const volatile sig_atomic_t *stop, struct incise_error *err)
{
	struct web_recording *w = (struct web_recording *)file;
	struct reading reading = {w, w->series, stop, .overview = true};
	struct incise_export_options options;
	int rc = 0;

	/* Not so short that a slow stream has less than a row in a column of two spans. */
	spans = (int)fmin(spans, 1 + w->to_s / SPAN_LEAST_S);
	incise_export_options_init(&options);
	pthread_mutex_lock(&w->lock);
	for (int i = 0; i < TRACKS; i++)
		web_series_init(&w->series[i], 0, w->to_s, spans, 0);
	pthread_mutex_unlock(&w->lock);
	if (w->rows > OVERVIEW_ROWS) {
		options.every_s = w->to_s / OVERVIEW;
		rc = read_streams(&reading, &options, err);
		options.every_s = 0;
	}
	reading.overview = false;
	reading.whole = true;
	if (!rc)
		rc = read_streams(&reading, &options, err);
	if (rc && rc != -ECANCELED) {
		pthread_mutex_lock(&w->lock);
		snprintf(w->damaged, sizeof(w->damaged), "%s", err ? err->text : "");
		pthread_mutex_unlock(&w->lock);
	}
	if (rc != -ECANCELED)
		take_budget(w, rc ? NULL
				  : incise_budget_new(w->recording, NULL, NULL, NULL));
	return rc;
}

static double web_recording_done(struct web_file *file)
{
	struct web_recording *w = (struct web_recording *)file;
	double done;

	pthread_mutex_lock(&w->lock);
	done = w->done;
	pthread_mutex_unlock(&w->lock);
	return done;
}

/* --- what is shown --------------------------------------------------------------------- */

static bool has_frames(const struct web_recording *w)
{
	for (int i = 0; i < w->info.n_streams; i++)
		if (!strcmp(w->info.streams[i].name, "camera"))
			return w->info.streams[i].rows > 0;
	return false;
}

static bool has_values(const struct web_series *series)
{
	for (int i = 0; i < series->n; i++)
		if (series->low[i] <= series->high[i])
			return true;
	return false;
}

static void put_facts(const struct web_recording *w, json_t *head)
{
	const struct incise_recording_info *info = &w->info;
	json_t *facts = json_array();
	const char *missing;

	json_array_append_new(facts, json_pack("[so]", "rig", json_text(info->rig)));
	json_array_append_new(facts,
			      json_pack("[so]", "started", json_text(info->started)));
	for (int i = 0; i < info->n_streams; i++) {
		const struct incise_stream *stream = &info->streams[i];
		char text[400];

		snprintf(text, sizeof(text), "%llu rows, %.6g/s, %llu lost%s%s",
			 (unsigned long long)stream->rows, stream->rate_hz,
			 (unsigned long long)stream->lost,
			 *stream->ended ? "; ended early: " : "", stream->ended);
		json_array_append_new(facts,
				      json_pack("[so]", stream->name, json_text(text)));
	}
	if (!info->complete)
		json_array_append_new(facts, json_pack("[ss]", "state", "interrupted"));
	if (*w->damaged)
		json_array_append_new(facts, json_pack("[so]", "read in part",
						       json_text(w->damaged)));
	for (int i = INCISE_BUDGET_FORCE; w->budget && i <= INCISE_BUDGET_DEPTH; i++) {
		missing = incise_budget_missing(w->budget, i);
		if (missing)
			json_array_append_new(facts, json_pack("[so]", "no band",
							       json_text(missing)));
	}
	json_object_set_new(head, "facts", facts);
}

static void put_members(const struct web_recording *w, json_t *head)
{
	const struct incise_session_info *members;
	int n = incise_session_members(w->recording, &members);
	json_t *list = json_array();
	char text[300];

	for (int i = 0; i < n; i++) {
		const struct incise_session_info *member = &members[i];

		snprintf(text, sizeof(text),
			 !i || !strcmp(member->method, "same")
				 ? "%s; the clock of all"
				 : "%s; clock %+.6f ms, %+.4f ppm, within %.3g ms, by %s",
			 member->streams, (double)member->offset_ns * 1e-6,
			 member->rate_ppm, member->uncertainty_ns * 1e-6, member->method);
		json_array_append_new(
			list, json_pack("{so sf sf so}", "label", json_text(member->name),
					"from", web_seconds(w, member->first_ns), "to",
					web_seconds(w, member->last_ns), "text",
					json_text(text)));
	}
	if (n)
		json_object_set(head, "members", list);
	json_decref(list);
}

static json_t *web_recording_head(struct web_file *file)
{
	struct web_recording *w = (struct web_recording *)file;
	json_t *cuts = json_array(),
	       *head = web_head_new("recording", file->path, "time", "s", 0, w->to_s);
	char number[16];

	web_head_panel(head, "force", "N", "force");
	web_head_panel(head, "depth", "mm", "depth");
	web_head_panel(head, "speed", "mm/s", "speed");
	pthread_mutex_lock(&w->lock);
	/* Frames need not show a depth. */
	web_head_panel(head,
		       has_frames(w) && (w->done < 1 || has_values(&w->series[CAMERA]))
			       ? "depth by camera"
			       : NULL,
		       "mm", "camera");
	web_head_panel(head, "position", "mm", "x|y|z");
	for (int i = 0; i < w->cuts.n; i++) {
		const struct recording_cut *cut = &w->cuts.cut[i];

		snprintf(number, sizeof(number), "%d", i + 1);
		json_array_append_new(cuts,
				      json_pack("[ffs]", cut->from_s, cut->to_s, number));
	}
	put_facts(w, head);
	pthread_mutex_unlock(&w->lock);
	json_object_set_new(head, "cuts", cuts);
	json_object_set(head, "events", w->events);
	put_members(w, head);
	if (has_frames(w))
		json_object_set_new(head, "frames", json_pack("{sb}", "shown", 1));
	json_object_set_new(
		head, "export",
		json_taken(cli_text("incise export %s --range {from}s..{to}s -o part.csv",
				    file->path)));
	return head;
}

/* Rows of a part alone, as short as it is. */
static int read_part(struct web_recording *w, double from, double to, int columns,
		     struct web_series series[TRACKS], struct incise_error *err)
{
	struct incise_export_options options;
	const struct reading reading = {w, series, NULL, false, false};

	for (int i = 0; i < TRACKS; i++)
		web_series_init(&series[i], from, to, columns, columns + 1);
	if (!(to > 0))
		return 0;
	incise_export_options_init(&options);
	options.from_s = fmax(0, from);
	options.to_s = to;
	return read_streams(&reading, &options, err);
}

static int web_recording_part(struct web_file *file, double from, double to, int columns,
			      FILE *out, struct incise_error *err)
{
	struct web_recording *w = (struct web_recording *)file;
	const struct incise_session_info *members;
	struct web_series own[TRACKS] = {0}, *series = w->series;
	bool joined = incise_session_members(w->recording, &members);
	int rc = 0;

	pthread_mutex_lock(&w->lock);
	if (!series->n || (!(joined && w->rows > JOINED_ROWS) &&
			   (to - from) / columns < 2 * w->to_s / series->n))
		series = own;
	pthread_mutex_unlock(&w->lock);
	if (series == own)
		rc = read_part(w, from, to, columns, own, err);
	pthread_mutex_lock(&w->lock);
	fprintf(out, "{\"from\":%.10g,\"to\":%.10g,\"done\":%.3f,\"tracks\":[", from, to,
		w->done);
	for (int i = 0; i < TRACKS && !rc; i++) {
		bool known = w->budget && (i == FORCE || i == DEPTH);

		fputs(i ? "," : "", out);
		web_series_put(&series[i], from, to, columns,
			       !known	    ? NULL
			       : i == FORCE ? force_u_N
					    : depth_u_mm,
			       w, out);
	}
	pthread_mutex_unlock(&w->lock);
	fputs("]}", out);
	for (int i = 0; i < TRACKS; i++)
		web_series_free(&own[i]);
	return rc;
}

static int web_recording_frame(struct web_file *file, double *t_s, struct pixels *pixels,
			       struct incise_error *err)
{
	struct web_recording *w = (struct web_recording *)file;
	struct incise_camera_frame frame;
	int rc;

	if (!has_frames(w))
		return incise_error_set(err, ENODATA, "%s: has no frames", file->path);
	if (!w->frames)
		w->frames = incise_frame_reader_new(w->recording, err);
	if (!w->frames)
		return -err->code;
	rc = incise_frame_reader_at(w->frames, w->info.start_ns + (int64_t)(*t_s * 1e9),
				    &frame, err);
	if (rc)
		return rc;
	rc = pixels_convert(pixels, &frame);
	if (rc)
		return incise_error_set(err, -rc, "%s: a frame cannot be decoded",
					file->path);
	*t_s = web_seconds(w, frame.t_ns);
	web_reduce(pixels);
	return 0;
}

static void web_recording_close(struct web_file *file)
{
	struct web_recording *w = (struct web_recording *)file;

	for (int i = 0; i < TRACKS; i++)
		web_series_free(&w->series[i]);
	incise_frame_reader_free(w->frames);
	incise_budget_free(w->budget);
	incise_recording_close(w->recording);
	json_decref(w->events);
	pthread_mutex_destroy(&w->lock);
	free(w);
}

/* --- opening --------------------------------------------------------------------------- */

static void read_web_events(struct web_recording *w)
{
	struct ArrowArrayStream stream;
	struct incise_error err = {0};
	struct ArrowArray batch;
	char kind[32], text[200];

	cli_check(incise_recording_stream(w->recording, "events", NULL, &stream, &err),
		  &err);
	for (;; batch.release(&batch)) {
		if (stream.get_next(&stream, &batch))
			cli_fail("%s", stream.get_last_error(&stream));
		if (!batch.release)
			break;
		for (int64_t i = 0; i < batch.length; i++) {
			text_at(&batch, 1, i, kind, sizeof(kind));
			text_at(&batch, 2, i, text, sizeof(text));
			if (recording_shows_event(kind) &&
			    json_array_size(w->events) < EVENTS_MOST)
				json_array_append_new(
					w->events,
					json_pack("[foo]",
						  web_seconds(w, whole_at(&batch, 0, i)),
						  json_text(kind), json_text(text)));
		}
	}
	stream.release(&stream);
}

static const struct web_kind web_recording_kind = {
	.read = web_recording_read,
	.done = web_recording_done,
	.head = web_recording_head,
	.part = web_recording_part,
	.frame = web_recording_frame,
	.close = web_recording_close,
};

struct web_file *web_recording_open(const char *path)
{
	struct web_recording *w = cli_alloc(1, sizeof(*w));
	struct incise_error err = {0};
	const struct incise_recording_info *info = &w->info;

	w->base = (struct web_file){&web_recording_kind, path};
	w->recording = recording_open(path);
	cli_check(incise_recording_info(w->recording, &w->info, &err), &err);
	pthread_mutex_init(&w->lock, NULL);
	w->events = json_array();
	w->rows = info->force + info->tracker + info->depth;
	if (!w->rows)
		cli_fail("%s: holds no sample", path);
	w->to_s = web_seconds(w, info->end_ns);
	/* A stream may go on behind the force's end. */
	for (int i = 0; i < info->n_streams; i++)
		if (info->streams[i].rate_hz > 0)
			w->to_s = fmax(w->to_s, (double)(info->streams[i].rows +
							 info->streams[i].lost) /
							info->streams[i].rate_hz);
	w->to_s = fmax(w->to_s, 1e-3);
	read_web_events(w);
	return &w->base;
}
