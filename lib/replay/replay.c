// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The loop, run on a recording; see incise/replay.h. It is incise_loop_run() on a clock that
 * advances in steps, in real time or not. Rows are read between ticks, so a tick does the same
 * work as live.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <string.h>
#include <incise/clock.h>
#include "../base/vector.h"
#include "../base/crc32c.h"
#include "replay_source.h"

/* Poses that a plan accepts before a tick. */
#define POSES 32

/* The return value of a stopped replay; no callback returns it. */
#define STOPPED INT_MIN

struct replay {
	struct incise_replay_source source;
	const struct incise_replay_options *options;
	struct incise_replay_report *report;
	struct incise_plan *plan;
	struct incise_clock *clock;
	struct incise_error *err;
	double normal[3]; /* of the recording's surface */
	int64_t period_ns, first_ns;
	unsigned int flags; /* of the last tick */
	double squares_N2, least_N, most_N;
};

/* Feed the plan the poses up to the next tick. */
static int feed_replay(struct replay *replay, int64_t t_ns)
{
	struct incise_tracker_sample poses[POSES];
	int n = incise_replay_source_poses(&replay->source, t_ns, poses, POSES,
					   replay->err);

	if (n < 0)
		return n;
	replay->report->poses += n;
	incise_plan_feed(replay->plan, poses, n);
	return 0;
}

/* The same bytes on every computer. */
static uint32_t add_force(uint32_t crc, const double force_N[3])
{
	unsigned char bytes[24];

	for (int i = 0; i < 3; i++) {
		uint64_t bits;

		memcpy(&bits, &force_N[i], sizeof(bits));
		for (int k = 0; k < 8; k++)
			bytes[8 * i + k] = bits >> 8 * k;
	}
	return incise_crc32c(crc, bytes, sizeof(bytes));
}

static void compare_replay(struct replay *replay, const struct incise_replay_tick *at)
{
	struct incise_replay_report *report = replay->report;
	double error_N = at->predicted_N - at->measured_N;

	if (!at->cut || at->clipped || isnan(at->measured_N))
		return;
	replay->squares_N2 += error_N * error_N;
	replay->least_N = fmin(replay->least_N, at->measured_N);
	replay->most_N = fmax(replay->most_N, at->measured_N);
	if (!report->compared++ || fabs(error_N) > report->max_N) {
		report->max_N = fabs(error_N);
		report->max_t_s = at->t_s;
	}
}

static int ticked_replay(void *context, const struct incise_tick *tick)
{
	struct replay *replay = context;
	struct incise_replay_source *source = &replay->source;
	struct incise_replay_report *report = replay->report;
	struct incise_replay_measure measure;
	struct incise_replay_tick at;
	int rc = incise_replay_source_measure(source, tick->t_ns, replay->period_ns,
					      &measure, replay->err);

	if (rc)
		return rc;
	report->late += incise_clock_lag_ns(replay->clock) >= replay->period_ns;
	report->crc = add_force(report->crc, tick->command_N);
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		report->spells[i] += (tick->flags & ~replay->flags) >> i & 1;
	replay->flags = tick->flags;
	report->seconds = (tick->t_ns - replay->first_ns) * 1e-9;
	at = (struct incise_replay_tick){
		.tick = tick,
		.t_s = (tick->t_ns - source->origin_ns) * 1e-9,
		.done = (double)(tick->t_ns - source->first_ns) /
			(source->last_ns - source->first_ns + 1),
		.cut = measure.cut,
		.depth_mm = measure.depth_mm,
		.predicted_N = v3_dot(tick->command_N, tick->flags & INCISE_TICK_CONTACT
							       ? tick->normal
							       : replay->normal),
		.measured_N = measure.force_N,
		.clipped = measure.clipped,
	};
	compare_replay(replay, &at);
	if (replay->options->ticked) {
		rc = replay->options->ticked(replay->options->context, &at, replay->err);
		if (rc)
			return rc;
	}
	/* At once: there is no force to release first. */
	if (replay->options->stop && *replay->options->stop)
		return STOPPED;
	return feed_replay(replay, tick->t_ns + replay->period_ns);
}

static int run_replay(struct replay *replay, double rate_hz,
		      struct incise_loop_stats *stats)
{
	const struct incise_replay_options *options = replay->options;
	int64_t start_ns = replay->first_ns - replay->period_ns;
	struct incise_loop_options loop = {
		.rate_hz = rate_hz,
		.duration_ns = replay->source.last_ns - replay->first_ns + 1,
		.ticked = ticked_replay,
		.context = replay,
	};
	struct incise_clock *clock = options->real_time
					     ? incise_clock_new_paced(start_ns)
					     : incise_clock_new_simulated(start_ns);
	int rc;

	if (!clock)
		return incise_error_set(replay->err, ENOMEM, "out of memory");
	replay->clock = clock;
	rc = feed_replay(replay, replay->first_ns);
	if (!rc)
		rc = incise_loop_run(replay->plan, clock, &loop, stats, replay->err);
	if (rc == STOPPED)
		rc = 0;
	incise_clock_free(clock);
	/* Rows behind the last tick are checked too. */
	if (!rc && !(options->stop && *options->stop))
		rc = incise_replay_source_finish(&replay->source, replay->err);
	return rc;
}

static int begin_replay(struct replay *replay, const struct incise_scene *scene)
{
	const struct incise_replay_source *source = &replay->source;
	const struct incise_recording_info *meta = &source->recording->meta;

	/* Multiples of the period: ticks do not depend on the start of a stream. */
	replay->period_ns = llrint(INCISE_NS_PER_S / incise_scene_rate_hz(scene));
	replay->first_ns = (source->first_ns / replay->period_ns + 1) * replay->period_ns;
	if (replay->first_ns > source->last_ns)
		return incise_error_set(replay->err, ENODATA,
					"%s: shorter than a tick of %g ms",
					source->recording->path,
					replay->period_ns * 1e-6);
	replay->plan =
		incise_plan_new_fed_on(scene, &source->info, meta->surface_point_mm,
				       meta->surface_normal, replay->err);
	if (!replay->plan)
		return -errno;
	incise_plan_set_tip(replay->plan, meta->tip_mm);
	v3_unit(replay->normal, meta->surface_normal, 0);
	replay->report->tracker = source->info;
	return incise_plan_set_tool(replay->plan, replay->options->tool);
}

int incise_replay(struct incise_recording *recording, const struct incise_scene *scene,
		  const struct incise_replay_options *options,
		  struct incise_loop_stats *stats, struct incise_replay_report *report,
		  struct incise_error *err)
{
	struct replay replay = {
		.options = options,
		.report = report,
		.err = err,
		.least_N = INFINITY,
		.most_N = -INFINITY,
	};
	int rc;

	*report =
		(struct incise_replay_report){.rms_N = NAN, .max_N = NAN, .range_N = NAN};
	rc = incise_replay_source_open(&replay.source, recording, options->at,
				       options->calibration, err);
	if (rc)
		return rc;
	rc = begin_replay(&replay, scene);
	if (!rc)
		rc = run_replay(&replay, incise_scene_rate_hz(scene), stats);
	report->cuts = replay.source.cut.count;
	if (report->compared) {
		report->rms_N = sqrt(replay.squares_N2 / report->compared);
		report->range_N = replay.most_N - replay.least_N;
	}
	incise_plan_free(replay.plan);
	incise_replay_source_close(&replay.source);
	return rc;
}
