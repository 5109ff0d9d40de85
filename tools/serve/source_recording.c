// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A recording as a source: played at its pace. Its poses and forces are in memory, 100 bytes and 16
 * bytes each.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/recording.h>
#include <incise/wall.h>
#include "../cli/cli.h"
#include "../cli/recording.h"
#include "serve.h"

#define POLL_NS 2000000LL
/* A process that was stopped for longer goes on where it was. */
#define STALL_NS 1000000000LL

struct playback {
	struct serve_source base;
	struct incise_recording *recording;
	struct incise_recording_info info;
	struct incise_tracker_sample *poses;
	struct incise_recording_value *forces;
	int n_poses, n_forces, pose, force;
	struct incise_frame_reader *frames;
	int64_t frame_ns; /* the last that was sent */
	int64_t first_ns, last_ns;
	struct incise_wall *wall; /* NULL: the recording has no wall time */
	int64_t utc_start_ns;	  /* of info.start_ns, to a second; 0: not known */
	int64_t here_ns;	  /* when first_ns was played; 0: not started */
	int64_t read_ns;
	double speed;
	bool endless;
	uint64_t rounds;
};

static void start(struct playback *playback, struct serve_stream *stream, int64_t now_ns)
{
	playback->here_ns = now_ns;
	playback->pose = playback->force = 0;
	playback->frame_ns = INT64_MIN;
	serve_play(stream, playback->first_ns, now_ns, playback->speed);
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
	double force_N[3] = {0};
	int64_t t_ns;
	char text[400];

	*next_ns = now_ns + POLL_NS;
	if (!p->here_ns)
		start(p, stream, now_ns);
	else if (now_ns - p->read_ns > STALL_NS) {
		p->here_ns += now_ns - p->read_ns;
		serve_play(stream, p->first_ns, p->here_ns, p->speed);
	}
	p->read_ns = now_ns;
	t_ns = p->first_ns + (int64_t)((now_ns - p->here_ns) * p->speed);
	for (; p->pose < p->n_poses && p->poses[p->pose].t_ns <= t_ns; p->pose++)
		if (incise_pose_usable(p->poses[p->pose].status))
			serve_pose(stream, p->poses[p->pose].t_ns,
				   p->poses[p->pose].position_mm,
				   p->poses[p->pose].quaternion, p->info.tip_mm,
				   p->info.tracker_lost + p->info.force_lost);
	for (; p->force < p->n_forces && p->forces[p->force].t_ns <= t_ns; p->force++) {
		force_N[2] = p->forces[p->force].value;
		if (!isnan(force_N[2]))
			serve_force(stream, p->forces[p->force].t_ns, force_N,
				    p->info.tracker_lost + p->info.force_lost);
	}
	if (p->frames)
		play_frame(p, stream, t_ns);
	snprintf(text, sizeof(text), "recording of %.200s", p->info.rig);
	if (t_ns < p->last_ns) {
		serve_status(stream, SERVE_RUNS, "playing", text);
		return 0;
	}
	if (p->endless) {
		p->rounds++;
		start(p, stream, now_ns);
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
	free(playback->poses);
	free(playback->forces);
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

static void open_frames(struct playback *playback,
			const struct serve_source_options *options)
{
	struct incise_error err = {0};

	if (!options->camera)
		return;
	playback->frames = incise_frame_reader_new(playback->recording, &err);
	if (!playback->frames && options->camera_needed)
		cli_fail_with(&err);
	if (!playback->frames && err.code != ENODATA && err.code != ENOTSUP)
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
	p->n_poses = incise_recording_poses(p->recording, &p->poses, &err);
	if (p->n_poses >= 0)
		p->n_forces =
			incise_recording_values(p->recording, "force", &p->forces, &err);
	if (p->n_poses < 0 || p->n_forces < 0)
		cli_fail_with(&err);
	if (!p->n_poses && !p->n_forces)
		cli_fail("%s: it has no samples", options->operand);
	open_frames(p, options);
	p->first_ns = INT64_MAX;
	p->last_ns = INT64_MIN;
	if (p->n_poses) {
		p->first_ns = p->poses[0].t_ns;
		p->last_ns = p->poses[p->n_poses - 1].t_ns;
	}
	if (p->n_forces) {
		p->first_ns =
			p->first_ns < p->forces[0].t_ns ? p->first_ns : p->forces[0].t_ns;
		p->last_ns = p->last_ns > p->forces[p->n_forces - 1].t_ns
				     ? p->last_ns
				     : p->forces[p->n_forces - 1].t_ns;
	}
	p->wall = incise_recording_wall(p->recording, &err);
	if (!p->wall && err.code != ENODATA)
		cli_fail_with(&err);
	p->utc_start_ns = utc_of(p->info.started);
	info->name = cli_text("recording %s", options->operand);
	info->kinds[SERVE_POSE] = p->n_poses > 0;
	info->kinds[SERVE_FORCE] = p->n_forces > 0;
	info->kinds[SERVE_FRAME] = p->frames;
	return &p->base;
}
