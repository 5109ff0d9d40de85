// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Rates, means and times of sent items; see serve.h.
 *
 *     samples   | | | | | | | | | | | | | | |        a value is due on a grid of 1/rate, and the
 *     due       ^       ^       ^       ^            first sample that is not more than half a step
 *     sent      ●       ●       ●       ●            of the source early is it; of forces the mean
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "../../lib/base/monotonic.h"
#include "../../lib/base/vector.h"
#include "../cli/cli.h"
#include "stream.h"

#define NS 1000000000LL
#define STATUS_NS NS

struct serve_stream {
	struct serve_source *source;
	struct serve_sink *sink[SERVE_SINKS];
	int sinks;
	double rate_hz;
	int64_t period_ns; /* of the source's time */
	int64_t due_ns[SERVE_KINDS];
	int64_t last_ns[SERVE_KINDS];
	double step_ns[SERVE_KINDS]; /* of the source's samples, a running mean */
	uint64_t sent[SERVE_KINDS];
	uint64_t lost;

	/* Forces since the last that was sent. */
	int samples;
	int64_t first_ns;
	double first_N[3], sum_N[3], squares; /* less the first, which keeps the digits */

	enum serve_state state;
	char name[32], text[300];
	int64_t status_ns; /* when it was sent; 0: never */

	/* For a recording: t_ns is played at here_ns; speed 0: live. */
	int64_t t_ns, here_ns;
	double speed;
};

int64_t serve_utc_of(int64_t t_ns)
{
	int64_t before = cli_now_ns(), utc = incise_read_clock_ns(CLOCK_REALTIME),
		after = cli_now_ns();

	return utc + (t_ns - before) - (after - before) / 2;
}

struct serve_stream *serve_stream_new(struct serve_source *source, double rate_hz)
{
	struct serve_stream *stream = cli_alloc(1, sizeof(*stream));

	stream->source = source;
	stream->rate_hz = rate_hz;
	stream->period_ns = (int64_t)(NS / rate_hz);
	return stream;
}

void serve_stream_add(struct serve_stream *stream, struct serve_sink *sink)
{
	stream->sink[stream->sinks++] = sink;
}

uint64_t serve_stream_sent(const struct serve_stream *stream, enum serve_kind kind)
{
	return stream->sent[kind];
}

uint64_t serve_stream_lost(const struct serve_stream *stream)
{
	return stream->lost;
}

void serve_stream_free(struct serve_stream *stream)
{
	free(stream);
}

void serve_play(struct serve_stream *stream, int64_t t_ns, int64_t here_ns, double speed)
{
	stream->t_ns = t_ns;
	stream->here_ns = here_ns;
	stream->speed = speed;
	stream->period_ns = (int64_t)(NS / stream->rate_hz * speed);
	memset(stream->due_ns, 0, sizeof(stream->due_ns));
	memset(stream->last_ns, 0, sizeof(stream->last_ns));
	stream->samples = 0;
}

static void send_item(struct serve_stream *stream, struct serve_item *item)
{
	item->here_ns = item->t_ns;
	if (stream->speed > 0 && item->kind != SERVE_STATUS)
		item->here_ns = stream->here_ns +
				(int64_t)((item->t_ns - stream->t_ns) / stream->speed);
	if (!item->utc_ns)
		item->utc_ns = stream->source->ops->utc(stream->source, item->t_ns);
	stream->sent[item->kind]++;
	for (int i = 0; i < stream->sinks; i++)
		stream->sink[i]->ops->send(stream->sink[i], item);
}

/* A sample has come. */
static void note_step(struct serve_stream *stream, enum serve_kind kind, int64_t t_ns)
{
	double step_ns = (double)(t_ns - stream->last_ns[kind]);

	/* A gap is no step. */
	if (stream->last_ns[kind] && step_ns > 0 && step_ns < NS)
		stream->step_ns[kind] += (step_ns - stream->step_ns[kind]) /
					 (stream->step_ns[kind] > 0 ? 16 : 1);
	stream->last_ns[kind] = t_ns;
}

/* Half a step early is on time: a source of the very rate keeps all samples, with its jitter. */
static bool is_due(const struct serve_stream *stream, enum serve_kind kind, int64_t t_ns)
{
	double early_ns = fmin(stream->step_ns[kind], (double)stream->period_ns) / 2;

	return t_ns >= stream->due_ns[kind] - (int64_t)early_ns;
}

static void set_due(struct serve_stream *stream, enum serve_kind kind, int64_t t_ns)
{
	int64_t *due = &stream->due_ns[kind];

	/* After a gap the grid starts again. */
	*due = t_ns > *due + stream->period_ns ? t_ns : *due;
	*due += stream->period_ns;
}

void serve_lost(struct serve_stream *stream, uint64_t lost)
{
	stream->lost = lost;
}

void serve_pose(struct serve_stream *stream, int64_t t_ns, const double position_mm[3],
		const double quaternion[4], const double tip_mm[3], uint64_t lost)
{
	struct serve_item item = {.kind = SERVE_POSE, .t_ns = t_ns, .lost = lost};
	const double *q = quaternion;
	double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
	double norm = sqrt(norm2), unit[4], turned[3];

	stream->lost = lost;
	note_step(stream, SERVE_POSE, t_ns);
	/* A loop has no orientation before it saw one. */
	if (!is_due(stream, SERVE_POSE, t_ns) || !(norm > 0.5 && norm < 2))
		return;
	set_due(stream, SERVE_POSE, t_ns);
	for (int i = 0; i < 4; i++)
		unit[i] = q[i] / norm;
	v3_rotate(turned, unit, tip_mm);
	for (int i = 0; i < 3; i++)
		item.pose.position_mm[i] = position_mm[i] + turned[i];
	memcpy(item.pose.quaternion, unit, sizeof(unit));
	send_item(stream, &item);
}

void serve_force(struct serve_stream *stream, int64_t t_ns, const double force_N[3],
		 uint64_t lost)
{
	struct serve_item item = {.kind = SERVE_FORCE, .lost = lost};
	double n, squares = 0;

	stream->lost = lost;
	if (!stream->samples) {
		stream->first_ns = t_ns;
		memcpy(stream->first_N, force_N, sizeof(stream->first_N));
		memset(stream->sum_N, 0, sizeof(stream->sum_N));
		stream->squares = 0;
	}
	for (int i = 0; i < 3; i++) {
		double value = force_N[i] - stream->first_N[i];

		stream->sum_N[i] += value;
		stream->squares += value * value;
	}
	n = ++stream->samples;
	note_step(stream, SERVE_FORCE, t_ns);
	if (!is_due(stream, SERVE_FORCE, t_ns))
		return;
	set_due(stream, SERVE_FORCE, t_ns);
	for (int i = 0; i < 3; i++) {
		item.force.mean_N[i] = stream->first_N[i] + stream->sum_N[i] / n;
		squares += stream->sum_N[i] * stream->sum_N[i] / n;
	}
	item.t_ns = stream->first_ns + (t_ns - stream->first_ns) / 2;
	item.force.sd_N =
		n > 1 ? sqrt(fmax(0, stream->squares - squares) / (n - 1)) : NAN;
	item.force.samples = stream->samples;
	stream->samples = 0;
	send_item(stream, &item);
}

void serve_depth(struct serve_stream *stream, int64_t t_ns, double depth_mm)
{
	struct serve_item item = {.kind = SERVE_DEPTH,
				  .t_ns = t_ns,
				  .lost = stream->lost,
				  .depth_mm = depth_mm};

	note_step(stream, SERVE_DEPTH, t_ns);
	if (!is_due(stream, SERVE_DEPTH, t_ns))
		return;
	set_due(stream, SERVE_DEPTH, t_ns);
	send_item(stream, &item);
}

void serve_loop(struct serve_stream *stream, const struct incise_state_now *now)
{
	struct serve_item item = {.kind = SERVE_LOOP,
				  .t_ns = cli_now_ns(),
				  .lost = stream->lost,
				  .loop = now};

	send_item(stream, &item);
}

bool serve_frame_is_due(const struct serve_stream *stream, int64_t t_ns)
{
	return is_due(stream, SERVE_FRAME, t_ns);
}

void serve_frame(struct serve_stream *stream, const struct incise_camera_frame *frame,
		 uint64_t lost)
{
	struct serve_item item = {.kind = SERVE_FRAME, .t_ns = frame->t_ns, .lost = lost};

	note_step(stream, SERVE_FRAME, frame->t_ns);
	if (!is_due(stream, SERVE_FRAME, frame->t_ns))
		return;
	set_due(stream, SERVE_FRAME, frame->t_ns);
	item.frame = frame;
	send_item(stream, &item);
}

void serve_status(struct serve_stream *stream, enum serve_state state, const char *name,
		  const char *text)
{
	struct serve_item item = {.kind = SERVE_STATUS, .t_ns = cli_now_ns()};

	item.status.changed = !stream->status_ns || stream->state != state ||
			      strcmp(stream->text, text) != 0;
	if (!item.status.changed && item.t_ns - stream->status_ns < STATUS_NS)
		return;
	stream->status_ns = item.t_ns;
	stream->state = state;
	snprintf(stream->name, sizeof(stream->name), "%s", name);
	snprintf(stream->text, sizeof(stream->text), "%s", text);
	item.lost = stream->lost;
	item.utc_ns = serve_utc_of(item.t_ns);
	item.status.state = state;
	item.status.name = stream->name;
	item.status.text = stream->text;
	send_item(stream, &item);
}
