// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A hand leans on a plan; see closed_loop.h. N, mm, s.
 */
#include <math.h>
#include <string.h>
#include "../../lib/base/random.h"
#include "../../lib/base/vector.h"
#include "closed_loop.h"

#define TICK_S 1e-3
#define STEPS 20 /* in a tick */
#define STEP_S (TICK_S / STEPS)
#define AIR_S 0.4 /* above the skin until the force may start */
#define AIR_MM 0.5
#define LATE_MOST 16	  /* ticks */
#define NOISE_SHARE 0.375 /* of a run; the rest of it is for coming to rest */
#define UNDERWAY 64	  /* poses on their way at most */
#define AWAY_MM 40
#define RUN_APART_S 100 /* and, on the plane, mm */

struct pose {
	double arrival_s, at_mm[3];
};

struct running {
	const struct closed_loop *loop;
	struct incise_plan *plan;
	double begin_s, next_pose_s;
	double axis[3][3]; /* the normal of the place, and two along the skin */
	double x[3], v[3]; /* along them, from the place */
	struct pose pose[UNDERWAY];
	unsigned int first, last;
	double late_N[LATE_MOST + 1][3];
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

static void take_closed_loop_pose(struct running *r, double t_s)
{
	double noise_mm = t_s < NOISE_SHARE * r->loop->run_s ? r->loop->noise_mm : 0;
	struct pose *pose = &r->pose[r->last % UNDERWAY];

	pose->arrival_s = t_s + r->loop->latency_s;
	v3_copy(pose->at_mm, r->loop->place_mm);
	for (int i = 0; i < 3; i++)
		v3_add(pose->at_mm, pose->at_mm, r->x[i], r->axis[i]);
	v3_add(pose->at_mm, pose->at_mm,
	       noise_mm * incise_random_normal(r->noise, r->last), r->axis[0]);
	r->last++;
	r->next_pose_s += 1 / r->loop->tracker_hz;
}

/* Feed the poses that have arrived, and tick; then force_N acts, along the axes. */
static void tick(struct running *r, double t_s, double force_N[3])
{
	int late = r->loop->late_ticks;
	struct incise_tick out;

	for (; r->first != r->last && r->pose[r->first % UNDERWAY].arrival_s <= t_s;
	     r->first++) {
		const struct pose *pose = &r->pose[r->first % UNDERWAY];
		struct incise_tracker_sample sample = {
			.t_ns = to_ns(r->begin_s + pose->arrival_s),
			.status = ' ',
			.quaternion = {1},
		};

		v3_copy(sample.position_mm, pose->at_mm);
		r->taken &= incise_plan_feed(r->plan, &sample, 1) == 1;
	}
	r->taken &= !incise_plan_tick(r->plan, to_ns(r->begin_s + t_s), &out);
	for (int i = 0; i < 3; i++) {
		r->late_N[late][i] = v3_dot(out.command_N, r->axis[i]);
		force_N[i] = r->late_N[0][i];
	}
	memmove(r->late_N, r->late_N + 1, (size_t)late * sizeof(*r->late_N));
}

/* A step of the device, in the hand along the skin; a guided one goes along it as it is told. */
static void move(struct running *r, const double force_N[3])
{
	const struct closed_loop *loop = r->loop;
	double m = loop->mass_kg * 1e-3; /* N s²/mm */

	for (int i = 0; i < (loop->free ? 3 : 1); i++) {
		const struct closed_loop_hand *hand = &loop->hand;
		double lean_N =
			i ? i == 1 ? loop->askew * loop->lean_N : 0 : -loop->lean_N;
		double held_N = i ? hand->damping_N_s_mm * r->v[i] +
						hand->stiffness_N_mm * r->x[i]
				  : 0;

		r->v[i] +=
			STEP_S *
			(force_N[i] + lean_N - loop->damping_N_s_mm * r->v[i] - held_N) /
			(m + (i ? hand->mass_kg * 1e-3 : 0));
		r->x[i] += STEP_S * r->v[i];
	}
	if (!loop->free)
		r->x[1] += STEP_S * loop->along_mm_s;
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

/* The widest way to and fro of the axes that move by themselves, and the widest range. */
static double swing_of(const struct running *r, const struct range range[3],
		       bool to_and_fro)
{
	double most = 0;

	for (int i = 0; i < (r->loop->free ? 3 : 1); i++)
		most = fmax(most, to_and_fro ? fmin(range[i].up, range[i].down)
					     : range[i].high - range[i].low);
	return most;
}

bool closed_loop_run(struct incise_plan *plan, const struct closed_loop *loop, int run,
		     struct closed_loop_end *end)
{
	const struct range none = {INFINITY, -INFINITY, 0, 0};
	const long steps = lround(loop->run_s / STEP_S);
	struct range last[3] = {none, none, none}, shaken[3] = {none, none, none},
		     last_N = none, earlier = none, all = none, all_N = none;
	struct running r = {
		.loop = loop,
		.plan = plan,
		.begin_s = (double)RUN_APART_S * run,
		.axis = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
		.x = {AIR_MM, loop->free ? 0 : (double)RUN_APART_S * run},
		.noise = incise_random_key((uint64_t)run, INCISE_RANDOM_TRACKER),
		.taken = true,
	};
	double force_N[3] = {0};

	if (loop->free) {
		v3_copy(r.axis[0], loop->normal);
		v3_any_across(r.axis[1], r.axis[0]);
		v3_cross(r.axis[2], r.axis[0], r.axis[1]);
	}
	for (long i = 0; i < steps; i++) {
		double t_s = (double)i * STEP_S;

		if (t_s >= r.next_pose_s)
			take_closed_loop_pose(&r, t_s);
		if (i % STEPS == 0)
			tick(&r, t_s, force_N);
		if (t_s > AIR_S)
			move(&r, force_N);
		see(&all, r.x[0]);
		see(&all_N, force_N[0]);
		if (4 * i > steps && 4 * i <= 2 * steps)
			see(&earlier, r.x[0]);
		if (4 * i > 3 * steps)
			see(&last_N, force_N[0]);
		for (int k = 0; k < 3; k++)
			if (4 * i > 3 * steps)
				see(&last[k], r.x[k]);
			else if (4 * i > steps && i < NOISE_SHARE * steps)
				see(&shaken[k], r.x[k]);
	}
	*end = (struct closed_loop_end){
		.swing_mm = swing_of(&r, last, true),
		.moved_mm = swing_of(&r, last, false),
		.earlier_mm = earlier.high - earlier.low,
		.largest_mm = fmax(all.high, -all.low),
		.largest_N = fmax(all_N.high, -all_N.low),
		.swing_N = last_N.high - last_N.low,
		.shaken_mm = swing_of(&r, shaken, true),
		.depth_mm = -r.x[0],
		.force_N = force_N[0],
		.left = loop->free && v3_length(r.x) > AWAY_MM,
	};
	return r.taken;
}
