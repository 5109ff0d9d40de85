// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The virtual magnetic tracker: tip position, mm, and attitude, with noise, a clock that drifts
 * and a latency to the host.
 *
 *   acquisition   |           |           |        every 1 / (hz · (1 + drift))
 *   arrival       '-latency-|~|           '-latency-|~~|   + a jitter ≥ 0
 *
 * A record carries the time of its arrival and is readable from then on. With a tube every other
 * record is of its station, so that the two share the rate.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "../base/random.h"
#include "sim.h"
#include "world.h"

/* Attitude noise, rad: FASTRAK's 0.025° static accuracy (Song et al. (2006), §2). */
#define ATTITUDE_NOISE (0.025 * M_PI / 180)

enum { SCALPEL = 1, TUBE }; /* stations */

#define DRAWS 8 /* random numbers per record: 3 position, 3 attitude, jitter, a spare */

struct sim_tracker {
	struct incise_tracker tracker;
	struct incise_sim_stream stream;
	struct incise_sim_ring ring;
	struct incise_sim *sim;
	uint64_t key;
	double hz;	    /* true, by the host's clock */
	uint64_t n, first;  /* next record by the world's count; record of seq 0 */
	int64_t arrival_ns; /* of the last record */
};

static struct sim_tracker *of_tracker(const struct incise_tracker *tracker)
{
	return (struct sim_tracker *)tracker;
}

/* q = q · (1, r/2), made unit: a small turn in the scalpel's own frame. */
static void turn(double q[4], const double r[3])
{
	double w = q[0], x = q[1], y = q[2], z = q[3];
	double a = r[0] / 2, b = r[1] / 2, c = r[2] / 2;
	double norm;

	q[0] = w - x * a - y * b - z * c;
	q[1] = x + w * a + y * c - z * b;
	q[2] = y + w * b + z * a - x * c;
	q[3] = z + w * c + x * b - y * a;
	norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
	for (int i = 0; i < 4; i++)
		q[i] /= norm;
}

/* The tube's end, upright: a cosine from above to below and back. */
static void place_tube(const struct incise_sim_config *config, int64_t t_ns,
		       double position_mm[3])
{
	double turn = 2 * M_PI * (double)t_ns / INCISE_NS_PER_S / config->tube_s;
	double down = (1 - cos(turn)) / 2;

	position_mm[0] = config->tube_x_mm;
	position_mm[1] = config->tube_y_mm;
	position_mm[2] = config->tube_above_mm -
			 down * (config->tube_above_mm + config->tube_below_mm);
}

static void place_scalpel(const struct incise_sim *sim, int64_t t_ns,
			  struct incise_tracker_sample *sample)
{
	const struct incise_sim_config *config = &sim->config;
	const double tip_mm[3] = {config->tip_x_mm, config->tip_y_mm, config->tip_z_mm};
	struct incise_blade blade;
	double arm_mm[3];

	incise_surgeon_blade(&sim->surgeon, t_ns, &blade);
	incise_surgeon_grip(&sim->surgeon, t_ns, sample->quaternion);
	v3_rotate(arm_mm, sample->quaternion, tip_mm);
	v3_sub(sample->position_mm, blade.position_mm, arm_mm);
}

static INCISE_REALTIME void sim_tracker_sample(struct incise_sim_stream *stream,
					       const struct incise_sim *sim)
{
	struct sim_tracker *t =
		(struct sim_tracker *)((char *)stream -
				       offsetof(struct sim_tracker, stream));
	const struct incise_sim_config *config = &sim->config;
	struct incise_tracker_sample sample = {
		.status = ' ', .station = SCALPEL, .quaternion = {1}};
	double draw[7], shake[3], delay_ms;

	for (int i = 0; i < 7; i++)
		draw[i] = incise_random_normal(t->key, t->n * DRAWS + i);
	if (config->tube_s > 0 && t->n % 2)
		sample.station = TUBE;
	if (sample.station == TUBE)
		place_tube(config, stream->t_ns, sample.position_mm);
	else
		place_scalpel(sim, stream->t_ns, &sample);
	for (int i = 0; i < 3; i++) {
		sample.position_mm[i] += config->tracker_noise_mm * draw[i];
		shake[i] = ATTITUDE_NOISE * draw[3 + i];
	}
	turn(sample.quaternion, shake);
	delay_ms = config->tracker_latency_ms + config->tracker_jitter_ms * fabs(draw[6]);
	sample.t_ns = sim->start_ns + stream->t_ns + llround(delay_ms * 1e6);
	/* One wire: a record cannot overtake the one before it. */
	if (sample.t_ns < t->arrival_ns)
		sample.t_ns = t->arrival_ns;
	t->arrival_ns = sample.t_ns;
	sample.seq = t->n - t->first;
	incise_sim_ring_push(&t->ring, &sample);
	stream->t_ns = incise_sim_time(++t->n, t->hz);
}

static INCISE_REALTIME int sim_tracker_read(struct incise_tracker *tracker,
					    struct incise_tracker_sample *samples, int n)
{
	struct sim_tracker *t = of_tracker(tracker);
	const struct incise_tracker_sample *oldest;
	int64_t now;
	int taken = 0;

	incise_sim_advance(t->sim);
	now = incise_clock_now(t->sim->clock);
	while (taken < n && (oldest = incise_sim_ring_peek(&t->ring)) &&
	       oldest->t_ns <= now) {
		samples[taken++] = *oldest;
		incise_sim_ring_pop(&t->ring);
	}
	return taken;
}

static void sim_tracker_info(const struct incise_tracker *tracker,
			     struct incise_tracker_info *info)
{
	const struct incise_sim_config *config = &of_tracker(tracker)->sim->config;

	*info = (struct incise_tracker_info){
		.rate_hz = config->tracker_hz,
		.stations = config->tube_s > 0 ? 2 : 1,
		.scalpel_station = SCALPEL,
		.tube_station = config->tube_s > 0 ? TUBE : 0,
		.latency_ns = llround(config->tracker_latency_ms * 1e6),
	};
	snprintf(info->name, sizeof(info->name), "virtual tracker");
}

static uint64_t sim_tracker_lost(const struct incise_tracker *tracker)
{
	return of_tracker(tracker)->ring.lost;
}

static void sim_tracker_close(struct incise_tracker *tracker)
{
	struct sim_tracker *t = of_tracker(tracker);

	incise_sim_remove_stream(t->sim, &t->stream);
	incise_sim_ring_free(&t->ring);
	free(t);
}

static const struct incise_tracker_ops ops = {
	.read = sim_tracker_read,
	.info = sim_tracker_info,
	.lost = sim_tracker_lost,
	.close = sim_tracker_close,
};

struct incise_tracker *incise_sim_tracker_new(struct incise_sim *sim)
{
	const struct incise_sim_config *config = &sim->config;
	double hz = config->tracker_hz * (1 + config->tracker_drift_ppm * 1e-6);
	/* The ring also holds records that have not arrived; no deviate exceeds 7 sd. */
	double transit_s =
		(config->tracker_latency_ms + 7 * config->tracker_jitter_ms) * 1e-3;
	struct sim_tracker *t = calloc(1, sizeof(*t));

	if (!t || incise_sim_ring_init(&t->ring, sizeof(struct incise_tracker_sample), hz,
				       transit_s)) {
		free(t);
		errno = ENOMEM;
		return NULL;
	}
	t->tracker.ops = &ops;
	t->sim = sim;
	t->key = incise_random_key(config->seed, INCISE_RANDOM_TRACKER);
	t->hz = hz;
	t->n = t->first = incise_sim_first(sim, hz);
	t->stream.t_ns = incise_sim_time(t->n, hz);
	t->stream.sample = sim_tracker_sample;
	t->arrival_ns = INT64_MIN;
	incise_sim_add_stream(sim, &t->stream);
	return &t->tracker;
}
