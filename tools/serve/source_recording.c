// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A recording as a source: played at its pace, and read in batches meanwhile, so that its length
 * does not matter.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/recording.h>
#include <incise/wall.h>
#include "../cli/batch.h"
#include "../cli/cli.h"
#include "../cli/recording.h"
#include "serve.h"

#define POLL_NS 2000000LL
/* A process that was stopped for longer goes on where it was. */
#define STALL_NS 1000000000LL

/* Rows of a stream, one after the other. */
struct rows {
	struct ArrowArrayStream stream; /* release NULL: not open, or at its end */
	struct ArrowArray batch;
	int64_t at;
};

struct playback {
	struct serve_source base;
	struct incise_recording *recording;
	struct incise_recording_info info;
	struct rows poses, forces;
	struct incise_frame_reader *frames;
	int64_t frame_ns; /* the last that was sent */
	int64_t first_ns;
	struct incise_wall *wall; /* NULL: the recording has no wall time */
	int64_t utc_start_ns;	  /* of info.start_ns, to a second; 0: not known */
	int64_t here_ns;	  /* when first_ns was played; 0: not started */
	int64_t read_ns;
	double speed;
	bool endless;
};

static void rows_close(struct rows *rows)
{
	if (rows->batch.release)
		rows->batch.release(&rows->batch);
	if (rows->stream.release)
		rows->stream.release(&rows->stream);
	*rows = (struct rows){0};
}

/* Whether there is a row, at rows->at of the batch; the stream is closed at its end. */
static bool rows_have(struct rows *rows)
{
	while (rows->stream.release &&
	       (!rows->batch.release || rows->at >= rows->batch.length)) {
		if (rows->batch.release)
			rows->batch.release(&rows->batch);
		rows->at = 0;
		if (rows->stream.get_next(&rows->stream, &rows->batch))
			cli_fail("%s", rows->stream.get_last_error(&rows->stream));
		if (!rows->batch.release)
			rows_close(rows);
	}
	return rows->stream.release;
}

#define T_NS 1 /* the column */

static int64_t rows_time(struct rows *rows)
{
	return rows_have(rows) ? whole_at(&rows->batch, T_NS, rows->at) : INT64_MAX;
}

static void rows_open(struct rows *rows, struct incise_recording *recording,
		      const char *what)
{
	struct incise_error err = {0};

	rows_close(rows);
	if (incise_recording_stream(recording, what, NULL, &rows->stream, &err))
		cli_fail_with(&err);
}

/* From the first row on. */
static void open_rows(struct playback *playback)
{
	int64_t pose_ns, force_ns;

	rows_open(&playback->poses, playback->recording, "tracker");
	rows_open(&playback->forces, playback->recording, "force");
	pose_ns = rows_time(&playback->poses);
	force_ns = rows_time(&playback->forces);
	playback->first_ns = pose_ns < force_ns ? pose_ns : force_ns;
}

static void start(struct playback *playback, struct serve_stream *stream)
{
	/* Opening takes its time. */
	playback->here_ns = playback->read_ns = serve_now();
	playback->frame_ns = INT64_MIN;
	serve_play(stream, playback->first_ns, playback->here_ns, playback->speed);
}

static void play_pose(struct playback *playback, struct serve_stream *stream)
{
	const struct ArrowArray *batch = &playback->poses.batch;
	int64_t row = playback->poses.at++;
	double position_mm[3], quaternion[4];
	char status[8];

	text_at(batch, 10, row, status, sizeof(status));
	if (!incise_pose_usable(*status))
		return;
	for (int i = 0; i < 3; i++)
		position_mm[i] = real_at(batch, 3 + i, row);
	for (int i = 0; i < 4; i++)
		quaternion[i] = real_at(batch, 6 + i, row);
	serve_pose(stream, whole_at(batch, T_NS, row), position_mm, quaternion,
		   playback->info.tip_mm,
		   playback->info.tracker_lost + playback->info.force_lost);
}

static void play_force(struct playback *playback, struct serve_stream *stream)
{
	const struct ArrowArray *batch = &playback->forces.batch;
	int64_t row = playback->forces.at++;
	double force_N[3] = {0, 0, real_at(batch, 3, row)};

	if (!isnan(force_N[2]) && !flag_at(batch, 4, row))
		serve_force(stream, whole_at(batch, T_NS, row), force_N,
			    playback->info.tracker_lost + playback->info.force_lost);
}

static void play_frame(struct playback *playback, struct serve_stream *stream,
		       int64_t t_ns)
{
	struct incise_camera_frame frame;
	struct incise_error err = {0};
	int rc;

	if (!serve_frame_is_due(stream, t_ns))
		return;
	rc = incise_frame_reader_at(playback->frames, t_ns, &frame, &err);
	if (!rc && frame.t_ns != playback->frame_ns && frame.t_ns <= t_ns) {
		playback->frame_ns = frame.t_ns;
		serve_frame(stream, &frame, 0);
	}
	/* One frame that is missing in the file is no reason to end. */
	if (!rc || rc == -ENODATA || rc == -EBADMSG)
		return;
	cli_warn("%s; no more frames are sent", err.text);
	incise_frame_reader_free(playback->frames);
	playback->frames = NULL;
}

static int playback_read(struct serve_source *source, struct serve_stream *stream,
			 int64_t now_ns, int64_t *next_ns)
{
	struct playback *p = (struct playback *)source;
	int64_t t_ns;
	char text[400];

	*next_ns = now_ns + POLL_NS;
	if (!p->here_ns)
		start(p, stream);
	else if (now_ns - p->read_ns > STALL_NS) {
		p->here_ns += now_ns - p->read_ns;
		serve_play(stream, p->first_ns, p->here_ns, p->speed);
	}
	p->read_ns = now_ns;
	t_ns = p->first_ns + (int64_t)((now_ns - p->here_ns) * p->speed);
	while (rows_time(&p->poses) <= t_ns)
		play_pose(p, stream);
	while (rows_time(&p->forces) <= t_ns)
		play_force(p, stream);
	if (p->frames)
		play_frame(p, stream, t_ns);
	snprintf(text, sizeof(text), "recording of %.200s", p->info.rig);
	if (rows_have(&p->poses) || rows_have(&p->forces)) {
		serve_status(stream, SERVE_RUNS, "playing", text);
		return 0;
	}
	if (p->endless) {
		open_rows(p);
		start(p, stream);
		return 0;
	}
	serve_status(stream, SERVE_ENDED, "ended", text);
	return 1;
}

static int64_t playback_utc(struct serve_source *source, int64_t t_ns)
{
	const struct playback *playback = (struct playback *)source;
	int64_t tai_ns;

	if (playback->wall)
		return incise_wall_tai(playback->wall, t_ns, &tai_ns, NULL)
			       ? 0
			       : tai_ns - 1000000000LL * incise_wall_utc_offset_s(
								 playback->wall, t_ns);
	return playback->utc_start_ns
		       ? playback->utc_start_ns + (t_ns - playback->info.start_ns)
		       : 0;
}

static void playback_free(struct serve_source *source)
{
	struct playback *playback = (struct playback *)source;

	incise_frame_reader_free(playback->frames);
	incise_wall_free(playback->wall);
	incise_recording_close(playback->recording);
	rows_close(&playback->poses);
	rows_close(&playback->forces);
	free(playback);
}

static const struct serve_source_ops playback_ops = {
	.read = playback_read, .utc = playback_utc, .free = playback_free};

/* "2026-11-27T01:02:03Z", in whole seconds; 0: something else. */
static int64_t utc_of(const char *text)
{
	struct tm tm = {0};
	const char *end = strptime(text, "%Y-%m-%dT%H:%M:%S", &tm);

	return end ? (int64_t)timegm(&tm) * 1000000000LL : 0;
}

static bool has_camera(const struct incise_recording_info *info)
{
	for (int i = 0; i < info->n_streams; i++)
		if (!strcmp(info->streams[i].name, "camera"))
			return true;
	return false;
}

static void open_frames(struct playback *playback,
			const struct serve_source_options *options)
{
	struct incise_error err = {0};

	if (!options->camera || (!options->camera_needed && !has_camera(&playback->info)))
		return;
	playback->frames = incise_frame_reader_new(playback->recording, &err);
	if (!playback->frames && options->camera_needed)
		cli_fail_with(&err);
	if (!playback->frames && err.code != ENODATA)
		cli_warn("%s; no frames are sent", err.text);
}

struct serve_source *serve_recording_open(const struct serve_source_options *options,
					  struct serve_info *info)
{
	struct playback *p = cli_alloc(1, sizeof(*p));
	struct incise_error err = {0};

	p->base.ops = &playback_ops;
	p->recording = recording_open(options->operand);
	p->speed = options->speed;
	p->endless = options->endless;
	if (incise_recording_info(p->recording, &p->info, &err))
		cli_fail_with(&err);
	open_rows(p);
	if (p->first_ns == INT64_MAX)
		cli_fail("%s: it has no samples", options->operand);
	open_frames(p, options);
	p->wall = incise_recording_wall(p->recording, &err);
	if (!p->wall && err.code != ENODATA)
		cli_fail_with(&err);
	p->utc_start_ns = utc_of(p->info.started);
	info->name = cli_text("recording %s", options->operand);
	info->kinds[SERVE_POSE] = rows_have(&p->poses);
	info->kinds[SERVE_FORCE] = rows_have(&p->forces);
	info->kinds[SERVE_FRAME] = p->frames;
	return &p->base;
}
