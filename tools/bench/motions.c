// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Motions whose truth is known; see motions.h.
 */
#include <math.h>
#include <string.h>
#include <incise/clock.h>
#include "../cli/cli.h"
#include "motions.h"
#include "../../lib/sim/sim.h"

/* A value and its slope. */
struct curve {
	double at, slope;
};

/* From 0 to 1 over u = 0 … 1 with the least jerk: Flash and Hogan, J. Neurosci. 5, 1985. */
static struct curve least_jerk(double u)
{
	double left = 1 - u;

	return (struct curve){u * u * u * (10 + u * (6 * u - 15)),
			      30 * u * u * left * left};
}

/* About an axis by an angle. */
static void lean(struct motion_state *state, int axis, double angle)
{
	state->quaternion[0] = cos(angle / 2);
	state->quaternion[1 + axis] = sin(angle / 2);
}

static void line_at(double t_s, struct motion_state *state)
{
	state->position_mm[0] = 30 * t_s;
	state->velocity_mm_s[0] = 30;
}

static void tremor_at(double t_s, struct motion_state *state)
{
	for (int i = 0; i < 3; i++) {
		double w = 2 * M_PI * (8 + 2 * i);

		state->position_mm[i] = 0.1 * sin(w * t_s + i);
		state->velocity_mm_s[i] = 0.1 * w * cos(w * t_s + i);
	}
	lean(state, 0, 0.5 * M_PI / 180 * sin(2 * M_PI * 10 * t_s));
}

/* Each way takes 0.8 s, and 0.2 s of rest. */
static void stroke_at(double t_s, struct motion_state *state)
{
	double within = fmod(t_s, 2), back = within >= 1;
	double u = fmin((within - back) / 0.8, 1);
	struct curve way = least_jerk(u);

	way.slope /= 0.8;
	if (back > 0)
		way = (struct curve){1 - way.at, -way.slope};
	state->position_mm[0] = 40 * way.at;
	state->velocity_mm_s[0] = 40 * way.slope;
	state->position_mm[2] = -10 * pow(sin(M_PI * way.at), 2);
	state->velocity_mm_s[2] = -10 * M_PI * sin(2 * M_PI * way.at) * way.slope;
	lean(state, 1, 0.3 * way.at);
}

/* Faster and faster for 0.2 s, evenly for another, stopped; from 0.6 s on back. */
static void wall_at(double t_s, struct motion_state *state)
{
	double u = fmod(t_s, 1), *z = &state->position_mm[2],
	       *v = &state->velocity_mm_s[2];

	if (u < 0.2) {
		*z = 18 - 150 * u * u;
		*v = -300 * u;
	} else if (u < 0.4) {
		*z = 12 - 60 * (u - 0.2);
		*v = -60;
	} else if (u >= 0.6) {
		struct curve way = least_jerk(fmin((u - 0.6) / 0.35, 1));

		*z = 18 * way.at;
		*v = 18 * way.slope / 0.35;
	}
}

const struct motion motions[MOTIONS] = {
	{"line", "30 mm/s", line_at},
	{"tremor", "0.1 mm at 8, 10 and 12 Hz", tremor_at},
	{"stroke", "40 mm and back, up to 94 mm/s", stroke_at},
	{"wall", "60 mm/s, stopped dead", wall_at},
	{"surgeon", "two cuts of the virtual rig", NULL},
};

/* The rig tells the place at a time that does not run back, and of the velocity its size:
 * so the vector is that of places a little before and after. */
#define ASIDE_NS 500

static void surgeon_states(const int64_t *t_ns, int n, struct motion_state *states)
{
	struct incise_clock *clock = incise_clock_new_simulated(0);
	struct incise_error err = {0};
	struct incise_sim_config config;
	struct incise_sim *sim;

	incise_sim_config_init(&config);
	config.n_depths = 2;
	config.depth_mm[0] = 5;
	config.depth_mm[1] = 20;
	config.times[0] = config.times[1] = 1;
	sim = clock ? incise_sim_new(&config, clock, &err) : NULL;
	if (!sim)
		cli_fail_with(&err);
	for (int k = 0; k < n; k++) {
		struct incise_sim_truth truth[3];

		for (int i = 0; i < 3; i++) {
			incise_clock_wait_until(clock, t_ns[k] + (i - 1) * ASIDE_NS);
			incise_sim_truth(sim, &truth[i]);
		}
		for (int i = 0; i < 3; i++) {
			states[k].position_mm[i] = truth[1].position_mm[i];
			states[k].velocity_mm_s[i] =
				(truth[2].position_mm[i] - truth[0].position_mm[i]) /
				(2 * ASIDE_NS * 1e-9);
		}
		memcpy(states[k].quaternion, truth[1].quaternion,
		       sizeof(states[k].quaternion));
	}
	incise_sim_free(sim);
	incise_clock_free(clock);
}

void motion_states(const struct motion *motion, const int64_t *t_ns, int n,
		   struct motion_state *states)
{
	if (!motion->at) {
		surgeon_states(t_ns, n, states);
		return;
	}
	for (int k = 0; k < n; k++) {
		states[k] = (struct motion_state){.quaternion = {1}};
		motion->at((double)t_ns[k] / INCISE_NS_PER_S, &states[k]);
	}
}
