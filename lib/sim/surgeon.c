// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The surgeon's script; see surgeon.h. Lengths in mm, times in s unless they say ns.
 *
 *            pause    descent 45 %     hold 37 %    withdrawal 18 %   pause …
 *   z  5 mm   .-.                                                      .-.
 *      1 mm  /   \_                                              _____/
 *      0     ------\--------------------------------------------/-------- surface
 *   -depth           `-.________________________~~~~~~~~~~~~~~~'
 *
 * Each nominal depth is cut all its times before the next. The blade follows a path in a plane of
 * x and z, next to the path of the cut before, with progress p from 0 to 1 along it. The hand's
 * speed along the path swings about its mean, so that every depth occurs at every velocity; where
 * the path is steep the blade moves less in x, so that its speed remains the hand's. Tremor is
 * across the cut and along z only: along x it would hide the slow phases.
 */
#include <math.h>
#include "../base/vector.h"
#include "../base/random.h"
#include "surgeon.h"

#define NS 1e-9

#define START_MM 5.0	 /* x of a cut's start */
#define APART_MM 3.0	 /* between cuts along y: each is in new tissue */
#define CLEARANCE_MM 1.0 /* above the surface at a cut's start and end */
#define AIR_MM 5.0	 /* above the surface during a pause */
#define DESCENT 0.45	 /* shares of the path */
#define WITHDRAWAL 0.18
#define SWING_HZ 1.6	/* of the speed */
#define DRIFT 0.025	/* of the held depth, relative */
#define DRIFT_TURNS 2.6 /* per cut */
#define ONSET_S 0.15	/* the hand's time to reach speed and to stop */

/* Pressing: heights above and below the surface, rate, and swing of the rate. */
#define PRESS_FROM_MM 3.0
#define PRESS_TO_MM 8.0
#define PRESS_HZ 2.0
#define PRESS_SWING_HZ 1.1
#define PRESS_SWING_TURNS 0.13 /* per second */

/* Initial height of a held scalpel; maximum number of reads. */
#define HAND_ABOVE_MM 30.0
#define HAND_TRIES 100

/* Golden angle: phases of any number of consecutive cuts spread evenly. */
#define GOLDEN 2.39996322972865332

static const struct {
	double hz, mm;
} tremor[2] = {{8.7, 0.03}, {9.6, 0.025}}; /* of y and z */

/* A value and its derivative. */
struct curve {
	double at, slope;
};

/* From 0 to 1 over u = 0 … 1, at rest at both ends. */
static struct curve ease(double u)
{
	return (struct curve){u * u * (3 - 2 * u), 6 * u * (1 - u)};
}

/*
 * x over a ramp, u = 0 … 1, in units of the ramp's share of the path. With z' = s·b(u),
 * b = 4u(1-u), and x' = 1 - k·b(u), the speed is √(1 - 2kb(1-b)), never above 1 and
 * never below 0.7, when k = 1 - √(1-s²).
 */
static struct curve ramp_x(double u, double s)
{
	double k = s < 1 ? 1 - sqrt(1 - s * s) : 1;

	return (struct curve){u - k * u * u * (2 - 4 * u / 3), 1 - k * 4 * u * (1 - u)};
}

/* The path of one cut at progress p: x and depth, with slopes by p. */
static void path(double depth_mm, double phase, double length_mm, double p,
		 struct curve *x, struct curve *depth)
{
	double turn = 2 * M_PI * DRIFT_TURNS;
	double rise = depth_mm + CLEARANCE_MM;
	double drop = depth_mm * (1 + DRIFT * sin(turn * p + phase)) + CLEARANCE_MM;
	double drop_slope = depth_mm * DRIFT * turn * cos(turn * p + phase);
	double down_s = 1.5 * rise / (DESCENT * length_mm);
	double up_s = 1.5 * rise / (WITHDRAWAL * length_mm);
	double hold = 1 - DESCENT - WITHDRAWAL;
	double at = START_MM;
	struct curve r = {0, 1}, e = {1, 0};
	double share;

	if (p < DESCENT) {
		share = DESCENT;
		r = ramp_x(p / share, down_s);
		e = ease(p / share);
		e.slope /= share;
	} else if (p < 1 - WITHDRAWAL) {
		share = hold;
		at += length_mm * DESCENT * ramp_x(1, down_s).at;
		r.at = (p - DESCENT) / share;
	} else {
		share = WITHDRAWAL;
		at += length_mm * (DESCENT * ramp_x(1, down_s).at + hold);
		r = ramp_x((p - 1 + share) / share, up_s);
		e = ease((1 - p) / share);
		e.slope /= -share;
	}
	*x = (struct curve){at + length_mm * share * r.at, length_mm * r.slope};
	*depth = (struct curve){drop * e.at - CLEARANCE_MM,
				drop_slope * e.at + drop * e.slope};
}

static double onset_s(const struct incise_sim_config *config)
{
	return fmin(ONSET_S, config->cut_s / 8);
}

/* The hand's own time, which starts and ends slowly: the slope goes 0 → 1 → 0. */
static struct curve hand_time(const struct incise_sim_config *config, double t)
{
	double onset = onset_s(config);
	double end = config->cut_s - onset;
	double left = config->cut_s - t;

	if (t < onset)
		return (struct curve){t * t / (2 * onset), t / onset};
	if (t < end)
		return (struct curve){t - onset / 2, 1};
	return (struct curve){end - left * left / (2 * onset), left / onset};
}

/* Distance along the path after a span of the hand's own time. */
static struct curve way(const struct incise_sim_config *config, double phase, double hand)
{
	double w = 2 * M_PI * SWING_HZ;
	double swing = config->speed_swing;

	return (struct curve){
		config->speed_mm_s *
			(hand + swing / w * (cos(phase) - cos(w * hand + phase))),
		config->speed_mm_s * (1 + swing * sin(w * hand + phase)),
	};
}

static double cut_phase(const struct incise_surgeon *surgeon, int cut)
{
	return 2 * M_PI * incise_random_uniform(surgeon->key, 0) + cut * GOLDEN;
}

static double drift_phase(const struct incise_surgeon *surgeon, int cut)
{
	return 2 * M_PI * incise_random_uniform(surgeon->key, 16 + cut);
}

static double cut_length(const struct incise_surgeon *surgeon, int cut)
{
	const struct incise_sim_config *config = surgeon->config;

	return way(config, cut_phase(surgeon, cut), config->cut_s - onset_s(config)).at;
}

static double cut_depth(const struct incise_sim_config *config, int cut)
{
	for (int i = 0; i < config->n_depths; i++) {
		if (cut < config->times[i])
			return config->depth_mm[i];
		cut -= config->times[i];
	}
	return config->depth_mm[config->n_depths - 1];
}

/* With withdrawal = paper tissue does not know where it was cut. */
static double cut_y(const struct incise_surgeon *surgeon, int cut)
{
	return surgeon->config->withdrawal == INCISE_TISSUE_PAPER ? 0 : APART_MM * cut;
}

static void blade_cutting(const struct incise_surgeon *surgeon, int cut, double t,
			  struct incise_blade *blade)
{
	const struct incise_sim_config *config = surgeon->config;
	double phase = cut_phase(surgeon, cut);
	double length = cut_length(surgeon, cut);
	struct curve hand = hand_time(config, t);
	struct curve gone = way(config, phase, hand.at);
	double p = fmin(gone.at / length, 1);
	double rate = gone.slope * hand.slope / length;
	struct curve x, depth;

	path(cut_depth(config, cut), drift_phase(surgeon, cut), length, p, &x, &depth);
	blade->cut = cut;
	blade->boundary = cut;
	blade->slab = p;
	blade->position_mm[0] = x.at;
	blade->velocity_mm_s[0] = x.slope * rate;
	blade->position_mm[1] = cut_y(surgeon, cut);
	blade->position_mm[2] = -depth.at;
	blade->velocity_mm_s[2] = -depth.slope * rate;
}

static double cut_end(const struct incise_surgeon *surgeon, int cut)
{
	double length = cut_length(surgeon, cut);
	struct curve x, depth;

	path(cut_depth(surgeon->config, cut), 0, length, 1, &x, &depth);
	return x.at;
}

/* Before cut @cut, or after the last one when @cut is their number; @t in the pause. */
static void blade_pausing(const struct incise_surgeon *surgeon, int cut, double t,
			  struct incise_blade *blade)
{
	double pause = surgeon->config->pause_s;
	double u = fmin(t / pause, 1);
	double from = cut ? cut_end(surgeon, cut - 1) : START_MM;
	double to = cut < surgeon->cuts ? START_MM : from;
	double aside = cut_y(surgeon, cut ? cut - 1 : 0);
	double aside_to = cut < surgeon->cuts ? cut_y(surgeon, cut) : aside;
	struct curve along = ease(u);
	struct curve lift;

	if (cut < surgeon->cuts)
		lift = (struct curve){16 * u * u * (1 - u) * (1 - u),
				      32 * u * (1 - u) * (1 - 2 * u)};
	else
		lift = along;
	blade->cut = -1;
	blade->boundary = cut < surgeon->cuts ? cut : cut - 1;
	blade->slab = cut < surgeon->cuts ? 0 : 1;
	blade->position_mm[0] = from + (to - from) * along.at;
	blade->velocity_mm_s[0] = (to - from) * along.slope / pause;
	blade->position_mm[1] = aside + (aside_to - aside) * along.at;
	blade->velocity_mm_s[1] = (aside_to - aside) * along.slope / pause;
	blade->position_mm[2] = CLEARANCE_MM + (AIR_MM - CLEARANCE_MM) * lift.at;
	blade->velocity_mm_s[2] = (AIR_MM - CLEARANCE_MM) * lift.slope / pause;
}

/* The tip rests in a dimple; incise_surgeon_grip() has the lean. */
static void blade_turning(struct incise_blade *blade)
{
	*blade = (struct incise_blade){.cut = -1, .position_mm = {START_MM, 0, 0}};
}

/*
 * Pressing on the tissue: from PRESS_FROM_MM above to PRESS_TO_MM below the surface, at a
 * rate that swings within PRESS_HZ ± PRESS_SWING_HZ, so that no two strokes are alike.
 */
static void blade_pressing(const struct incise_surgeon *surgeon, double t,
			   struct incise_blade *blade)
{
	double s = fmax(0, t - surgeon->config->pause_s);
	double w = 2 * M_PI * PRESS_SWING_TURNS;
	double angle = 2 * M_PI * (PRESS_HZ * s + PRESS_SWING_HZ / w * (1 - cos(w * s)));
	double rate = 2 * M_PI * (PRESS_HZ + PRESS_SWING_HZ * sin(w * s));
	double half = (PRESS_FROM_MM + PRESS_TO_MM) / 2;

	*blade = (struct incise_blade){.cut = -1, .position_mm = {START_MM, 0, 0}};
	blade->position_mm[2] = PRESS_FROM_MM - half + half * cos(angle);
	if (s > 0)
		blade->velocity_mm_s[2] = -half * rate * sin(angle);
}

void incise_hand_init(struct incise_hand *hand)
{
	atomic_store(&hand->turn, 0);
	for (int i = 0; i < 10; i++)
		atomic_store(&hand->pose[0][i], i == 2 ? HAND_ABOVE_MM : i == 6);
}

void incise_hand_move(struct incise_hand *hand, const double position_mm[3],
		      const double velocity_mm_s[3], const double quaternion[4])
{
	uint64_t next = atomic_load_explicit(&hand->turn, memory_order_relaxed) + 1;

	/* A reader that sees any of these also sees the turn before, and tries again. */
	atomic_thread_fence(memory_order_release);
	for (int i = 0; i < 10; i++)
		atomic_store_explicit(&hand->pose[next & 1][i],
				      i < 3   ? position_mm[i]
				      : i < 6 ? velocity_mm_s[i - 3]
					      : quaternion[i - 6],
				      memory_order_relaxed);
	atomic_store_explicit(&hand->turn, next, memory_order_release);
}

void incise_hand_look(const struct incise_hand *hand, double position_mm[3],
		      double velocity_mm_s[3], double quaternion[4])
{
	/* A suspended writer is at the other pose: only two moves during this make it try
	 * again. */
	for (int try = 0; try < HAND_TRIES; try++) {
		uint64_t turn = atomic_load_explicit(&hand->turn, memory_order_acquire);

		for (int i = 0; i < 10; i++) {
			double value = atomic_load_explicit(&hand->pose[turn & 1][i],
							    memory_order_relaxed);

			*(i < 3	  ? &position_mm[i]
			  : i < 6 ? &velocity_mm_s[i - 3]
				  : &quaternion[i - 6]) = value;
		}
		atomic_thread_fence(memory_order_acquire);
		if (turn == atomic_load_explicit(&hand->turn, memory_order_relaxed))
			return;
	}
}

static INCISE_REALTIME void blade_held(const struct incise_surgeon *surgeon,
				       struct incise_blade *blade)
{
	const double across[3] = {0, 1, 0};
	double attitude[4];

	*blade = (struct incise_blade){.cut = -1};
	incise_hand_look(&surgeon->hand, blade->position_mm, blade->velocity_mm_s,
			 attitude);
	blade->speed_mm_s = v3_length(blade->velocity_mm_s);
	blade->depth_mm = fmax(0, -blade->position_mm[2]);
	v3_rotate(blade->side, attitude, across);
}

void incise_surgeon_init(struct incise_surgeon *surgeon,
			 const struct incise_sim_config *config)
{
	*surgeon = (struct incise_surgeon){
		.config = config,
		.key = incise_random_key(config->seed, INCISE_RANDOM_SURGEON),
		.cut_ns = llround(config->cut_s * INCISE_NS_PER_S),
		.pause_ns = llround(config->pause_s * INCISE_NS_PER_S),
	};
	incise_hand_init(&surgeon->hand);
	for (int i = 0; i < config->n_depths; i++)
		surgeon->cuts += config->times[i];
	for (int i = 0; i < 2; i++)
		surgeon->tremor_phase[i] =
			2 * M_PI * incise_random_uniform(surgeon->key, 1 + i);
}

int64_t incise_surgeon_duration(const struct incise_surgeon *surgeon)
{
	return surgeon->cuts * (surgeon->cut_ns + surgeon->pause_ns) + surgeon->pause_ns;
}

void incise_surgeon_blade(const struct incise_surgeon *surgeon, int64_t t_ns,
			  struct incise_blade *blade)
{
	int64_t period = surgeon->pause_ns + surgeon->cut_ns;
	int64_t cut = t_ns / period;
	int64_t within;
	const double *v = blade->velocity_mm_s;

	if (surgeon->config->motion == INCISE_SURGEON_TURNS) {
		blade_turning(blade);
		return;
	}
	if (surgeon->config->motion == INCISE_SURGEON_HAND) {
		blade_held(surgeon, blade);
		return;
	}
	if (surgeon->config->motion == INCISE_SURGEON_PRESSES) {
		blade_pressing(surgeon, t_ns * NS, blade);
		blade->speed_mm_s = fabs(v[2]);
		blade->depth_mm = fmax(0, -blade->position_mm[2]);
		return;
	}
	if (cut > surgeon->cuts)
		cut = surgeon->cuts;
	within = t_ns - cut * period;
	blade->position_mm[1] = 0;
	blade->velocity_mm_s[1] = 0;
	blade->side[0] = blade->side[2] = 0;
	blade->side[1] = 1;
	if (within < surgeon->pause_ns || cut == surgeon->cuts)
		blade_pausing(surgeon, (int)cut, within * NS, blade);
	else
		blade_cutting(surgeon, (int)cut, (within - surgeon->pause_ns) * NS,
			      blade);
	for (int i = 0; i < 2; i++) {
		double w = 2 * M_PI * tremor[i].hz;
		double angle = w * t_ns * NS + surgeon->tremor_phase[i];

		blade->position_mm[1 + i] += tremor[i].mm * sin(angle);
		blade->velocity_mm_s[1 + i] += tremor[i].mm * w * cos(angle);
	}
	blade->speed_mm_s = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
	blade->depth_mm = blade->position_mm[2] < 0 ? -blade->position_mm[2] : 0;
}

void incise_surgeon_grip(const struct incise_surgeon *surgeon, int64_t t_ns,
			 double quaternion[4])
{
	double t = t_ns * NS;
	/* A rotation vector, rad: the handle leans towards the cut and wavers. */
	double roll = 0.03 * sin(2 * M_PI * 0.31 * t + surgeon->tremor_phase[0]);
	double lean = 0.10 + 0.03 * sin(2 * M_PI * 0.23 * t + surgeon->tremor_phase[1]);
	double yaw = 0.02 * sin(2 * M_PI * 0.17 * t);
	double angle, scale;

	if (surgeon->config->motion == INCISE_SURGEON_HAND) {
		double position_mm[3], velocity_mm_s[3];

		incise_hand_look(&surgeon->hand, position_mm, velocity_mm_s, quaternion);
		return;
	}
	if (surgeon->config->motion == INCISE_SURGEON_TURNS) {
		/* it leans in all directions in turn, and turns a little about itself */
		double half = surgeon->config->cone_deg * M_PI / 360;
		double tilt = half * (0.75 + 0.25 * sin(2 * M_PI * 0.37 * t));

		roll = tilt * cos(2 * M_PI * 0.29 * t);
		lean = tilt * sin(2 * M_PI * 0.29 * t);
		yaw = 0.3 * sin(2 * M_PI * 0.11 * t);
	}
	angle = sqrt(roll * roll + lean * lean + yaw * yaw);
	scale = angle > 1e-9 ? sin(angle / 2) / angle : 0.5;

	quaternion[0] = cos(angle / 2);
	quaternion[1] = roll * scale;
	quaternion[2] = lean * scale;
	quaternion[3] = yaw * scale;
}
