// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The world of the virtual rig, and the ring of samples of each device; see incise/sim.h and
 * world.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "sim.h"
#include "world.h"

#define NS 1e-9

struct incise_sim *incise_sim_new(const struct incise_sim_config *config,
				  struct incise_clock *clock, struct incise_error *err)
{
	struct incise_sim *sim;

	if (incise_settings_check(incise_sim_settings, "sim", config, err))
		return NULL;
	sim = calloc(1, sizeof(*sim));
	if (!sim)
		return INCISE_ERROR_NULL(err, ENOMEM,
					 "simulated rig: %s; free some memory",
					 strerror(ENOMEM));
	sim->config = *config;
	sim->clock = clock;
	sim->start_ns = incise_clock_now(clock);
	sim->load_N = NAN;
	incise_surgeon_init(&sim->surgeon, &sim->config);
	incise_tissue_init(&sim->tissue, &sim->config);
	incise_surgeon_blade(&sim->surgeon, 0, &sim->blade);
	return sim;
}

void incise_sim_free(struct incise_sim *sim)
{
	free(sim);
}

const struct incise_sim_config *incise_sim_config(const struct incise_sim *sim)
{
	return &sim->config;
}

int64_t incise_sim_duration(const struct incise_sim *sim)
{
	return incise_surgeon_duration(&sim->surgeon);
}

void incise_sim_add_stream(struct incise_sim *sim, struct incise_sim_stream *stream)
{
	stream->next = sim->streams;
	sim->streams = stream;
}

void incise_sim_remove_stream(struct incise_sim *sim, struct incise_sim_stream *stream)
{
	struct incise_sim_stream **at = &sim->streams;

	while (*at && *at != stream)
		at = &(*at)->next;
	if (*at)
		*at = stream->next;
}

uint64_t incise_sim_first(const struct incise_sim *sim, double hz)
{
	uint64_t n = (uint64_t)(sim->t_ns * NS * hz);

	/* The estimate may be off by one either way: start below and search. */
	n -= n > 0;
	while (incise_sim_time(n, hz) < sim->t_ns)
		n++;
	return n;
}

int64_t incise_sim_time(uint64_t n, double hz)
{
	return llround((double)n * (INCISE_NS_PER_S / hz));
}

void incise_sim_sense(const struct incise_sim *sim, int64_t t_ns,
		      struct incise_blade *blade, double *force_N)
{
	if (t_ns == sim->t_ns)
		*blade = sim->blade;
	else
		incise_surgeon_blade(&sim->surgeon, t_ns, blade);
	*force_N = isnan(sim->load_N) ? incise_tissue_force(&sim->tissue, blade,
							    (t_ns - sim->t_ns) * NS)
				      : sim->load_N;
}

void incise_sim_load(struct incise_sim *sim, double load_N)
{
	incise_sim_advance(sim);
	sim->load_N = isfinite(load_N) ? load_N : NAN;
}

int incise_sim_hold(struct incise_sim *sim, const double position_mm[3],
		    const double velocity_mm_s[3], const double quaternion[4])
{
	double length2 = quaternion[0] * quaternion[0] + quaternion[1] * quaternion[1] +
			 quaternion[2] * quaternion[2] + quaternion[3] * quaternion[3];

	if (sim->config.motion != INCISE_SURGEON_HAND || !v3_finite(position_mm) ||
	    !v3_finite(velocity_mm_s) || v3_length(position_mm) > 1e6 ||
	    v3_length(velocity_mm_s) > 1e6 || !(fabs(length2 - 1) < 1e-6))
		return -EINVAL;
	incise_hand_move(&sim->surgeon.hand, position_mm, velocity_mm_s, quaternion);
	return 0;
}

void incise_sim_advance(struct incise_sim *sim)
{
	int64_t now = incise_clock_now(sim->clock) - sim->start_ns;

	while (sim->t_ns + INCISE_SIM_TICK_NS <= now) {
		int64_t next = sim->t_ns + INCISE_SIM_TICK_NS;

		for (struct incise_sim_stream *s = sim->streams; s; s = s->next)
			while (s->t_ns < next)
				s->sample(s, sim);
		incise_tissue_advance(&sim->tissue, &sim->blade, INCISE_SIM_TICK_NS * NS);
		sim->t_ns = next;
		incise_surgeon_blade(&sim->surgeon, next, &sim->blade);
	}
}

void incise_sim_truth(struct incise_sim *sim, struct incise_sim_truth *truth)
{
	struct incise_blade blade;
	double force_N;
	int64_t now;

	incise_sim_advance(sim);
	/* On a real clock time has passed since: the present tick is the latest known. */
	now = incise_clock_now(sim->clock) - sim->start_ns;
	if (now >= sim->t_ns + INCISE_SIM_TICK_NS)
		now = sim->t_ns + INCISE_SIM_TICK_NS - 1;
	incise_sim_sense(sim, now, &blade, &force_N);
	*truth = (struct incise_sim_truth){
		.t_ns = sim->start_ns + now,
		.cut = blade.cut,
		.depth_mm = blade.depth_mm,
		.velocity_mm_s = blade.speed_mm_s,
		.force_N = force_N,
	};
	memcpy(truth->position_mm, blade.position_mm, sizeof(truth->position_mm));
	incise_surgeon_grip(&sim->surgeon, now, truth->quaternion);
}

int incise_sim_ring_init(struct incise_sim_ring *ring, size_t size, double hz,
			 double extra_s)
{
	*ring = (struct incise_sim_ring){
		.size = size,
		.capacity = (size_t)ceil(hz * (INCISE_SIM_RING_S + extra_s)) + 1,
	};
	ring->records = calloc(ring->capacity, size);
	return ring->records ? 0 : -ENOMEM;
}

void incise_sim_ring_free(struct incise_sim_ring *ring)
{
	free(ring->records);
}

void incise_sim_ring_push(struct incise_sim_ring *ring, const void *record)
{
	size_t tail;

	if (ring->count == ring->capacity) {
		incise_sim_ring_pop(ring);
		ring->lost++;
	}
	tail = ring->head + ring->count++;
	if (tail >= ring->capacity)
		tail -= ring->capacity;
	memcpy(ring->records + tail * ring->size, record, ring->size);
}

const void *incise_sim_ring_peek(const struct incise_sim_ring *ring)
{
	return ring->count ? ring->records + ring->head * ring->size : NULL;
}

void incise_sim_ring_pop(struct incise_sim_ring *ring)
{
	if (++ring->head == ring->capacity)
		ring->head = 0;
	ring->count--;
}
