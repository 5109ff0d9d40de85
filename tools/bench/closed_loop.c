// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A hand leans on a plan; see closed_loop.h. N, mm, s.
 */
#include <math.h>
#include <string.h>
#include "../../lib/base/random.h"
#include "closed_loop.h"

#define TICK_S 1e-3
#define STEPS 20 /* in a tick */
#define STEP_S (TICK_S / STEPS)
#define AIR_S 0.4 /* above the skin until the force may start */
#define AIR_MM 0.5
#define LATE_MOST 16	  /* ticks */
#define NOISE_SHARE 0.375 /* of a run; the rest of it is for coming to rest */
#define UNDERWAY 64	  /* poses on their way at most */
#define RUN_APART_S 100	  /* and mm */

struct pose {
	double arrival_s, along_mm, height_mm;
};

struct running {
	const struct closed_loop *loop;
	struct incise_plan *plan;
	double begin_s, next_pose_s;
	double x, v, y; /* height, and way along the skin */
	struct pose pose[UNDERWAY];
	unsigned int first, last;
	double late_N[LATE_MOST + 1];
	uint64_t noise;
	bool taken;
};

static int64_t to_ns(double t_s)
{
	return 2000000000 + llround(t_s * 1e9);
}

struct incise_tracker_info closed_loop_tracker(const struct closed_loop *loop)
{
	return (struct incise_tracker_info){
		.rate_hz = loop->tracker_hz,
		.latency_ns = llround(loop->latency_s * 1e9),
	};
}

static void take_pose(struct running *r, double t_s)
{
	double noise_mm = t_s < NOISE_SHARE * r->loop->run_s ? r->loop->noise_mm : 0;

	r->pose[r->last % UNDERWAY] =
		(struct pose){t_s + r->loop->latency_s, r->y,
			      r->x + noise_mm * incise_random_normal(r->noise, r->last)};
	r->last++;
	r->next_pose_s += 1 / r->loop->tracker_hz;
}

/* Feed what has arrived, and tick. Returns the force that acts now. */
static double tick(struct running *r, double t_s)
{
	struct incise_tick out;

	for (; r->first != r->last && r->pose[r->first % UNDERWAY].arrival_s <= t_s;
	     r->first++) {
		const struct pose *pose = &r->pose[r->first % UNDERWAY];
		struct incise_tracker_sample sample = {
			.t_ns = to_ns(r->begin_s + pose->arrival_s),
			.status = ' ',
			.position_mm = {pose->along_mm, 0, pose->height_mm},
			.quaternion = {1},
		};

		r->taken &= incise_plan_feed(r->plan, &sample, 1) == 1;
	}
	r->taken &= !incise_plan_tick(r->plan, to_ns(r->begin_s + t_s), &out);
	r->late_N[r->loop->late_ticks] = out.command_N[2];
	out.command_N[2] = r->late_N[0];
	memmove(r->late_N, r->late_N + 1,
		(size_t)r->loop->late_ticks * sizeof(*r->late_N));
	return out.command_N[2];
}

/* Travel to either side: from the lowest up, and from the highest down. */
struct range {
	double low, high, up, down;
};

static void see(struct range *range, double value)
{
	range->low = fmin(range->low, value);
	range->high = fmax(range->high, value);
	range->up = fmax(range->up, value - range->low);
	range->down = fmax(range->down, range->high - value);
}

bool closed_loop_run(struct incise_plan *plan, const struct closed_loop *loop, int run,
		     struct closed_loop_end *end)
{
	const double m = loop->mass_kg * 1e-3; /* N s²/mm */
	const long steps = lround(loop->run_s / STEP_S);
	struct range last = {INFINITY, -INFINITY, 0, 0}, last_N = last, shaken = last,
		     earlier = last, all = last, all_N = last;
	struct running r = {
		.loop = loop,
		.plan = plan,
		.begin_s = (double)RUN_APART_S * run,
		.x = AIR_MM,
		.y = (double)RUN_APART_S * run,
		.noise = incise_random_key((uint64_t)run, INCISE_RANDOM_TRACKER),
		.taken = true,
	};
	double force_N = 0;

	for (long i = 0; i < steps; i++) {
		double t_s = (double)i * STEP_S;

		if (t_s >= r.next_pose_s)
			take_pose(&r, t_s);
		if (i % STEPS == 0)
			force_N = tick(&r, t_s);
		if (t_s > AIR_S) {
			r.v += STEP_S *
			       (force_N - loop->lean_N - loop->damping_N_s_mm * r.v) / m;
			r.x += STEP_S * r.v;
			r.y += STEP_S * loop->along_mm_s;
		}
		see(&all, r.x);
		see(&all_N, force_N);
		if (4 * i > steps && 4 * i <= 2 * steps)
			see(&earlier, r.x);
		if (4 * i > 3 * steps) {
			see(&last, r.x);
			see(&last_N, force_N);
		} else if (4 * i > steps && i < NOISE_SHARE * steps) {
			see(&shaken, r.x);
		}
	}
	*end = (struct closed_loop_end){
		.swing_mm = fmin(last.up, last.down),
		.moved_mm = last.high - last.low,
		.earlier_mm = earlier.high - earlier.low,
		.largest_mm = fmax(all.high, -all.low),
		.largest_N = fmax(all_N.high, -all_N.low),
		.swing_N = last_N.high - last_N.low,
		.shaken_mm = fmin(shaken.up, shaken.down),
		.depth_mm = -r.x,
		.force_N = force_N,
	};
	return r.taken;
}
