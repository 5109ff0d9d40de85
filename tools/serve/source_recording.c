// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A recording as a source: played at its pace, and read in batches meanwhile, so that its length
 * does not matter.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/recording.h>
#include <incise/wall.h>
#include "../cli/batch.h"
#include "../cli/cli.h"
#include "../cli/recording.h"
#include "serve.h"

#define POLL_NS 2000000LL
/* A process that was stopped for longer goes on where it was. */
#define STALL_NS 1000000000LL
/* A frame is left out when it can be read only so much later than it is due. */
#define LATE_NS 500000000LL

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
	struct rows poses, forces, times; /* times: of the frames */
	struct incise_frame_reader *frames;
	uint64_t skipped; /* frames that were too late */
	int64_t first_ns;
	struct incise_wall *wall; /* NULL: the recording has no wall time */
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
	cli_check(incise_recording_stream(recording, what, NULL, &rows->stream, &err),
		  &err);
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
	if (!playback->frames)
		return;
	rows_open(&playback->times, playback->recording, "frames");
	if (rows_time(&playback->times) < playback->first_ns)
		playback->first_ns = rows_time(&playback->times);
}

static void start_source_recording(struct playback *playback, struct serve_stream *stream)
{
	/* Opening takes its time. */
	playback->here_ns = playback->read_ns = cli_now_ns();
	serve_play(stream, playback->first_ns, playback->here_ns, playback->speed);
}

static uint64_t lost(const struct playback *playback)
{
	return playback->info.tracker_lost + playback->info.force_lost +
	       playback->skipped;
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
		   playback->info.tip_mm, lost(playback));
}

static void play_force(struct playback *playback, struct serve_stream *stream)
{
	const struct ArrowArray *batch = &playback->forces.batch;
	int64_t row = playback->forces.at++;
	double force_N[3] = {0, 0, real_at(batch, 3, row)};

	if (!isnan(force_N[2]) && !flag_at(batch, 4, row))
		serve_force(stream, whole_at(batch, T_NS, row), force_N, lost(playback));
}

/*
 * The next frame, if it is due: one at a time, as decoding takes long, and poses do not wait for
 * all that are late. Returns whether there may be another.
 */
static bool play_frame(struct playback *playback, struct serve_stream *stream,
		       int64_t t_ns)
{
	int64_t row_ns = rows_time(&playback->times);
	struct incise_camera_frame frame;
	struct incise_error err = {0};
	int rc;

	if (row_ns > t_ns)
		return false;
	playback->times.at++;
	if (!serve_frame_is_due(stream, row_ns))
		return true;
	if ((double)(t_ns - row_ns) > LATE_NS * playback->speed) {
		playback->skipped++;
		return true;
	}
	rc = incise_frame_reader_at(playback->frames, row_ns, &frame, &err);
	if (!rc)
		serve_frame(stream, &frame, lost(playback));
	/* A frame that is missing in the file is no reason to end. */
	playback->skipped += rc == -ENODATA || rc == -EBADMSG;
	if (!rc || rc == -ENODATA || rc == -EBADMSG)
		return true;
	cli_warn("%s; no more frames are sent", err.text);
	rows_close(&playback->times);
	return false;
}

/* Frames end with the other streams, or a moment later. */
static bool has_more(struct playback *playback, int64_t t_ns)
{
	return rows_have(&playback->poses) || rows_have(&playback->forces) ||
	       rows_time(&playback->times) < t_ns + STALL_NS;
}

static int playback_read(struct serve_source *source, struct serve_stream *stream,
			 int64_t now_ns, int64_t *next_ns)
{
	struct playback *p = (struct playback *)source;
	int64_t t_ns;
	char text[400];

	*next_ns = now_ns + POLL_NS;
	if (!p->here_ns)
		start_source_recording(p, stream);
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
	if (play_frame(p, stream, t_ns))
		*next_ns = now_ns;
	serve_lost(stream, lost(p));
	snprintf(text, sizeof(text), "recording of %.200s", p->info.rig);
	if (has_more(p, t_ns)) {
		serve_status(stream, SERVE_RUNS, "playing", text);
		return 0;
	}
	if (p->endless) {
		open_rows(p);
		start_source_recording(p, stream);
		return 0;
	}
	serve_status(stream, SERVE_ENDED, "ended", text);
	if (p->skipped)
		cli_warn("%llu frames were skipped, as they could not be read in time: "
			 "use a lower --speed or --rate",
			 (unsigned long long)p->skipped);
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
	return playback->info.start_utc_ns
		       ? playback->info.start_utc_ns + (t_ns - playback->info.start_ns)
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
	rows_close(&playback->times);
	free(playback);
}

static const struct serve_source_ops playback_ops = {
	.read = playback_read, .utc = playback_utc, .free = playback_free};

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

	if (!options->camera)
		return;
	if (!has_camera(&playback->info)) {
		if (options->camera_needed)
			cli_fail(
				"--camera frames: %s has no camera; leave the option out, "
				"or name another recording",
				options->operand);
		return;
	}
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
	cli_check(incise_recording_info(p->recording, &p->info, &err), &err);
	open_frames(p, options);
	open_rows(p);
	if (p->first_ns == INT64_MAX)
		cli_fail("%s: has no samples; name another recording", options->operand);
	p->wall = incise_recording_wall(p->recording, &err);
	if (!p->wall && err.code != ENODATA)
		cli_fail_with(&err);
	info->name = cli_text("recording %s", options->operand);
	info->kinds[SERVE_POSE] = rows_have(&p->poses);
	info->kinds[SERVE_FORCE] = rows_have(&p->forces);
	info->kinds[SERVE_FRAME] = p->frames;
	return &p->base;
}
