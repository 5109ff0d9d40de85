// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The virtual force channel: force on the blade → bridge, amplifier → 12-bit converter over 5 V,
 * in codes. On the bench the force is the actuator's. Samples lie on the exact grid n / force_hz;
 * their timestamps are later by a delay, and scatter.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../base/random.h"
#include "sim.h"
#include "world.h"

#define BITS 12
#define FULL_SCALE_V 5.0

struct sim_force {
	struct incise_force force;
	struct incise_sim_stream stream;
	struct incise_sim_ring ring;
	struct incise_sim *sim;
	uint64_t key, stamp_key;
	int64_t stamp_ns;  /* the last one */
	uint64_t n, first; /* next sample by the world's count; sample of seq 0 */
};

static struct sim_force *of_force(const struct incise_force *force)
{
	return (struct sim_force *)force;
}

static int32_t code_of(double mV)
{
	double code = round(mV / (FULL_SCALE_V * 1000) * (1 << BITS));

	return (int32_t)fmax(0, fmin((1 << BITS) - 1, code));
}

/* Timestamps increase, and are not before the script's start. */
static int64_t timestamp(struct sim_force *f, int64_t t_ns,
			 const struct incise_sim_config *config)
{
	double ms = config->force_delay_ms;

	if (config->force_jitter_ms > 0)
		ms += config->force_jitter_ms * incise_random_normal(f->stamp_key, f->n);
	t_ns += llround(fmax(ms, 0) * 1e6);
	f->stamp_ns = t_ns > f->stamp_ns ? t_ns : f->stamp_ns + 1;
	return f->stamp_ns;
}

static INCISE_REALTIME void sim_force_sample(struct incise_sim_stream *stream,
					     const struct incise_sim *sim)
{
	struct sim_force *f =
		(struct sim_force *)((char *)stream - offsetof(struct sim_force, stream));
	const struct incise_sim_config *config = &sim->config;
	struct incise_force_sample sample;
	struct incise_blade blade;
	double force_N = 0;

	if (!config->bench)
		incise_sim_sense(sim, stream->t_ns, &blade, &force_N);
	else if (sim->press_N)
		force_N = sim->press_N(sim->stepper, stream->t_ns);
	sample = (struct incise_force_sample){
		.t_ns = timestamp(f, sim->start_ns + stream->t_ns, config),
		.seq = f->n - f->first,
		.code = code_of(config->force_zero_mV + force_N * config->force_mV_N +
				config->force_noise_mV *
					incise_random_normal(f->key, f->n)),
	};
	incise_sim_ring_push(&f->ring, &sample);
	stream->t_ns = incise_sim_time(++f->n, config->force_hz);
}

static int sim_force_read(struct incise_force *force, struct incise_force_sample *samples,
			  int n)
{
	struct sim_force *f = of_force(force);
	const struct incise_force_sample *oldest;
	int taken = 0;

	incise_sim_advance(f->sim);
	while (taken < n && (oldest = incise_sim_ring_peek(&f->ring))) {
		samples[taken++] = *oldest;
		incise_sim_ring_pop(&f->ring);
	}
	return taken;
}

static void sim_force_info(const struct incise_force *force,
			   struct incise_force_info *info)
{
	*info = (struct incise_force_info){
		.rate_hz = of_force(force)->sim->config.force_hz,
		.bits = BITS,
		.full_scale_V = FULL_SCALE_V,
	};
	snprintf(info->name, sizeof(info->name), "simulated force channel");
}

static uint64_t sim_force_lost(const struct incise_force *force)
{
	return of_force(force)->ring.lost;
}

static void sim_force_close(struct incise_force *force)
{
	struct sim_force *f = of_force(force);

	incise_sim_remove_stream(f->sim, &f->stream);
	incise_sim_ring_free(&f->ring);
	free(f);
}

static const struct incise_force_ops ops = {
	.read = sim_force_read,
	.info = sim_force_info,
	.lost = sim_force_lost,
	.close = sim_force_close,
};

struct incise_force *incise_sim_force_new(struct incise_sim *sim)
{
	double hz = sim->config.force_hz;
	struct sim_force *f = calloc(1, sizeof(*f));

	if (!f ||
	    incise_sim_ring_init(&f->ring, sizeof(struct incise_force_sample), hz, 0)) {
		free(f);
		errno = ENOMEM;
		return NULL;
	}
	f->force.ops = &ops;
	f->sim = sim;
	f->key = incise_random_key(sim->config.seed, INCISE_RANDOM_FORCE);
	f->stamp_key = incise_random_key(sim->config.seed, INCISE_RANDOM_STAMP);
	f->stamp_ns = INT64_MIN;
	f->n = f->first = incise_sim_first(sim, hz);
	f->stream.t_ns = incise_sim_time(f->n, hz);
	f->stream.sample = sim_force_sample;
	incise_sim_add_stream(sim, &f->stream);
	return &f->force;
}
