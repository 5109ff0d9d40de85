// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tracker of Polhemus as struct incise_tracker; see polhemus_tracker.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/thread.h"
#include "../../rig/tracker_feed.h"
#include "polhemus_setup.h"
#include "polhemus_stream.h"
#include "polhemus_tracker.h"

#define POLL_MS 50  /* about how long close() waits for the thread */
#define LOST_MS 500 /* of silence, after which missing records count as lost */
#define NOISE_MAX (2 * POLHEMUS_RECORD_MAX) /* bytes that would contain a record */

struct polhemus_tracker {
	struct tracker_feed feed; /* first */
	struct polhemus_line *line;
	struct polhemus_times times;
	struct polhemus_identity identity;
	struct polhemus_stream stream;
	pthread_t thread;
	_Atomic bool stop;
};

static struct polhemus_tracker *of_tracker(const struct incise_tracker *tracker)
{
	return (struct polhemus_tracker *)tracker;
}

static int64_t now_ms(void)
{
	return incise_monotonic_ns() / 1000000;
}

/* Try to open it again. False: it did not come back, or is being closed. */
static bool recover(struct polhemus_tracker *t)
{
	int64_t began_ms = now_ms();
	struct timespec pause = {t->times.retry_ms / 1000,
				 t->times.retry_ms % 1000 * 1000000L};

	while (!atomic_load(&t->stop)) {
		struct polhemus_identity identity;

		if (!t->line->ops->reopen(t->line) &&
		    !polhemus_setup(t->line, &t->stream.setup, &identity, "", NULL)) {
			polhemus_stream_broken(&t->stream, &identity.layout);
			return true;
		}
		polhemus_stream_silent(&t->stream, incise_monotonic_ns());
		if (now_ms() - began_ms >= t->times.gone_ms)
			return false;
		nanosleep(&pause, NULL);
	}
	return false;
}

/*
 * No valid record for too long. With sync from outside, pauses are normal; but a tracker
 * that was switched off and on sends nothing, or records in its default format.
 */
static bool is_unresponsive(const struct polhemus_tracker *t, int64_t silent_ms,
			    size_t noise)
{
	return silent_ms >= t->times.silent_ms &&
	       (t->stream.setup.sync == INCISE_TRACKER_INTERNAL || noise > NOISE_MAX);
}

static int64_t least_polhemus_tracker(int64_t a, int64_t b)
{
	return a < b ? a : b;
}

static void *run_polhemus_tracker(void *argument)
{
	struct polhemus_tracker *t = argument;
	unsigned char bytes[POLHEMUS_LINE_CHUNK];
	int64_t silent_ms = 0, before_ms = now_ms(), now;
	size_t noise = 0; /* bytes since the last record */

	while (!atomic_load(&t->stop)) {
		int64_t t_ns = 0;
		ssize_t n =
			t->line->ops->read(t->line, bytes, sizeof(bytes), &t_ns, POLL_MS);

		if (n > 0) {
			noise += (size_t)n;
			if (polhemus_stream_put(&t->stream, bytes, (size_t)n, t_ns)) {
				silent_ms = 0;
				noise = 0;
			}
		}
		/* While the computer stood still, the line was not read. */
		now = now_ms();
		silent_ms += least_polhemus_tracker(now - before_ms, 2 * POLL_MS);
		before_ms = now;
		/* A shorter silence may be due to a busy host. */
		if (n < 0 || silent_ms >= LOST_MS)
			polhemus_stream_silent(&t->stream, incise_monotonic_ns());
		if (n >= 0 && !is_unresponsive(t, silent_ms, noise))
			continue;
		incise_thread_hurry(false);
		if (!recover(t))
			break;
		incise_thread_hurry(true);
		silent_ms = 0;
		before_ms = now_ms();
		noise = 0;
	}
	tracker_feed_end(
		&t->feed,
		"%s disconnected and was not back and set up after %.0f s; plug it in, "
		"switch it on and start again",
		t->identity.name, t->times.gone_ms / 1e3);
	return NULL;
}

static void tracker_info(const struct incise_tracker *tracker,
			 struct incise_tracker_info *info)
{
	const struct polhemus_tracker *t = of_tracker(tracker);
	const struct polhemus_layout *layout = &t->identity.layout;
	int n = t->stream.setup.n_stations;

	*info = (struct incise_tracker_info){
		.rate_hz = polhemus_family_hz(layout->family, n),
		.stations = n,
		.scalpel_station = t->stream.setup.stations[0],
		.tube_station = t->stream.setup.tube_station,
		.external_sync = !t->stream.gaps.period_ns,
		.latency_ns =
			polhemus_family_latency_ns(layout->family) +
			(int64_t)polhemus_layout_length(layout) * t->line->ns_per_byte,
		.grain_ns = t->line->grain_ns,
		.lost_unsure = atomic_load(&t->stream.unsure),
	};
	snprintf(info->name, sizeof(info->name), "%s", t->identity.name);
	snprintf(info->note, sizeof(info->note), "%s", t->identity.note);
}

static uint64_t tracker_lost(const struct incise_tracker *tracker)
{
	return polhemus_stream_lost(&of_tracker(tracker)->stream);
}

static void tracker_close(struct incise_tracker *tracker)
{
	struct polhemus_tracker *t = of_tracker(tracker);

	atomic_store(&t->stop, true);
	pthread_join(t->thread, NULL);
	t->line->stop = NULL;
	polhemus_stop(t->line, t->identity.layout.family);
	t->line->ops->close(t->line);
	polhemus_stream_free(&t->stream);
	free(t);
}

static const struct incise_tracker_ops ops = {
	.read = tracker_feed_read,
	.info = tracker_info,
	.lost = tracker_lost,
	.close = tracker_close,
	.cause = tracker_feed_cause,
};

static int check_polhemus_tracker(const struct incise_tracker_setup *setup,
				  const char *where, struct incise_error *err)
{
	const double *h = setup->hemisphere, *offset = setup->offset_mm;
	bool tube = !setup->tube_station;
	bool good = setup->n_stations >= 1 && setup->n_stations <= POLHEMUS_STATIONS &&
		    setup->sync >= INCISE_TRACKER_INTERNAL &&
		    setup->sync <= INCISE_TRACKER_VIDEO &&
		    fabs(h[0] * h[0] + h[1] * h[1] + h[2] * h[2] - 1) <= 1e-3 &&
		    isfinite(offset[0] + offset[1] + offset[2]) && setup->repeat_ms >= 0;

	for (int i = 0; good && i < setup->n_stations; i++)
		good = setup->stations[i] >= 1 &&
		       setup->stations[i] <= POLHEMUS_STATIONS &&
		       (!i || setup->stations[i] > setup->stations[i - 1]);
	for (int i = 1; good && i < setup->n_stations; i++)
		tube |= setup->stations[i] == setup->tube_station;
	return good && tube
		       ? 0
		       : incise_error_set(err, EINVAL,
					  "%s: tracker_setup: expected stations 1 to 4, "
					  "ascending, the tube's not the first, a "
					  "hemisphere of length 1 and finite numbers; "
					  "correct it",
					  where);
}

static int begin_polhemus_tracker(struct polhemus_tracker *t,
				  const struct incise_tracker_setup *setup,
				  const char *where, struct incise_error *err)
{
	bool real_time;
	int rc = check_polhemus_tracker(setup, where, err);

	if (!rc)
		rc = polhemus_setup(t->line, setup, &t->identity, where, err);
	if (rc)
		return rc;
	/* It need not be asked again when it comes back. */
	t->line->family = (int)t->identity.layout.family;
	if (polhemus_stream_init(&t->stream, setup, &t->identity.layout))
		rc = incise_error_set(err, ENOMEM,
				      "%s: out of memory; end other programs", where);
	if (!rc) {
		polhemus_gaps_start(&t->stream.gaps, incise_monotonic_ns());
		t->line->stop = &t->stop;
		rc = incise_thread_start(&t->thread, run_polhemus_tracker, t, &real_time);
		if (!rc)
			return 0;
		incise_error_set(
			err, -rc,
			"%s: no thread to read the tracker; end other programs, or "
			"raise the limit of threads",
			where);
	}
	t->line->stop = NULL;
	polhemus_stop(t->line, t->identity.layout.family);
	polhemus_stream_free(&t->stream);
	return rc;
}

struct incise_tracker *polhemus_tracker_open(struct polhemus_line *line,
					     const struct incise_tracker_setup *setup,
					     const struct polhemus_times *times,
					     const char *where, struct incise_error *err)
{
	struct polhemus_tracker *t = incise_device_new(sizeof(*t), where, err);
	int rc;

	if (!t) {
		line->ops->close(line);
		return NULL;
	}
	*t = (struct polhemus_tracker){
		.feed = {.tracker.ops = &ops, .ring = &t->stream.ring},
		.line = line,
		.times = *times,
	};
	rc = begin_polhemus_tracker(t, setup, where, err);
	if (!rc)
		return &t->feed.tracker;
	line->ops->close(line);
	free(t);
	errno = -rc;
	return NULL;
}
