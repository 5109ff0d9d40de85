// SPDX-License-Identifier: GPL-2.0-or-later
/* See draw.h. */
#include <math.h>

#include "draw.h"

/* Steps/s in virtual time, if the self-test allows it. */
#define FASTEST 20000

static uint64_t state = 1;

void draw_seed(uint64_t seed)
{
	state = seed ? seed : 1;
}

/* xorshift64*: S. Vigna, 'An experimental exploration of Marsaglia's xorshift generators'. */
uint64_t draw(void)
{
	state ^= state >> 12;
	state ^= state << 25;
	state ^= state >> 27;
	return state * UINT64_C(2685821657736338717);
}

int64_t draw_between(int64_t from, int64_t to)
{
	return from + (int64_t)(draw() % (uint64_t)(to - from + 1));
}

/* As many of them small as large. */
double draw_scattered(double from, double to)
{
	return from * pow(to / from, draw_between(0, 1 << 20) / (double)(1 << 20));
}

/* The largest velocity that SET_CONFIG accepts with the pulses of a config. */
static uint32_t fastest(const struct incise_stepper_controller *info,
			const struct incise_stepper_config *config)
{
	uint32_t step_ns =
		info->step_ns > info->wait_step_ns ? info->step_ns : info->wait_step_ns;
	uint32_t fits = 1000000000 / (config->high_ns + config->low_ns + step_ns);
	uint32_t most = info->rate_max < FASTEST ? info->rate_max : FASTEST;

	return most < fits ? most : fits;
}

struct incise_stepper_config draw_config(const struct bench *bench, unsigned int motor)
{
	const uint32_t pulse_ns = bench->info.pulse_ns,
		       tick_min_ns = bench->info.tick_min_ns;
	struct incise_stepper_config config = {
		.motor = motor,
		.flags = draw_between(0, 1) ? INCISE_STEPPER_CONFIG_INVERT : 0,
		.tick_ns = draw_scattered(tick_min_ns,
					  tick_min_ns > 1000000 ? tick_min_ns : 1000000),
		.late_max = 1000,
		.deadman_ns = 10000000000,
		.high_ns = pulse_ns + draw_between(0, 5000),
		.low_ns = pulse_ns + draw_between(0, 5000),
		.setup_ns = draw_between(0, 30000),
		.hold_ns = draw_between(0, 30000),
		.enable_ns = draw_between(0, 2000000),
	};
	uint32_t most = fastest(&bench->info, &config);

	config.velocity = draw_scattered(most / 4, most);
	/* From rest to full speed in 2 to 200 ms. */
	config.acceleration = config.velocity / draw_scattered(0.002, 0.2);
	/* As much again to come to that acceleration, or at once. */
	if (draw_between(0, 1))
		config.jerk = config.acceleration / draw_scattered(0.001, 0.02);
	/* What half a second is enough for. */
	config.position_min = -draw_between(0, config.velocity / 2);
	config.position_max = draw_between(0, config.velocity / 2);
	return config;
}
