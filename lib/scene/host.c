// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A plan in the loop of a simulator; see incise/host.h. The plan's time starts late enough that
 * none is negative, and its ticks follow each other without a gap; the host's time is shifted
 * to it.
 *
 *   plan's ticks  ┼───┼───┼───┼───┼───┼───┼───┼───┼     tick_ns apart
 *   host's steps      ●─────────────●────────────●      from_ns earlier
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <incise/host.h>
#include "plan.h"

#define BEGIN_NS (2 * INCISE_NS_PER_S)
#define TIME_MOST_NS INT64_C(4000000000000000000)
#define SPEED_MOST_MM_S 1e6
#define PLACE_MOST_MM 1e4 /* the predictor passes over others */

/* A host that adds up its steps in double is off by less than this share of a tick. */
#define SNAP 0.01

/* A ratio of step and tick that is whole to this share: they stay together for very long. */
#define DRIFT 1e-9

/* The check of stability takes longer with more ticks in a step. */
#define HOLD_MOST 512

/* The plan's memory that ticks change. */
#define PARTS 5
struct part {
	void *at, *kept;
	size_t size;
};

struct host_pose {
	int64_t t_ns; /* of the plan's time */
	struct incise_host_place place;
	double quaternion[4];
};

struct incise_host {
	pthread_mutex_t lock;
	struct incise_plan *plan;
	struct part part[PARTS];
	int n_parts;
	struct incise_host_options options;
	double tick_ns;
	double late_ns; /* a longer step was not checked */
	/* From here on a reset sets all to 0. */
	struct host_state {
		bool started, fading;
		int64_t ticks;	  /* so far */
		int64_t from_ns;  /* the host's time at the plan's 0 */
		int64_t clock_ns; /* its time at the last step … */
		int64_t lag_ns;	  /* … and how far the host's is behind */
		bool follows;	  /* the next step goes on from the last pose */
		struct host_pose last;
		struct incise_tick tick;
	} now;
};

/* --- memory ------------------------------------------------------------------------------ */

static bool keep_part(struct incise_host *host, void *at, size_t size)
{
	struct part *part = &host->part[host->n_parts];

	if (!at)
		return true;
	*part = (struct part){.at = at, .kept = malloc(size), .size = size};
	if (!part->kept)
		return false;
	memcpy(part->kept, at, size);
	host->n_parts++;
	return true;
}

/* Keep the plan as it is before its first tick. */
static bool keep_plan(struct incise_host *host)
{
	struct incise_plan *plan = host->plan;
	struct incise_double_state *state = &plan->doubles.state;

	return keep_part(host, plan, sizeof(*plan)) &&
	       keep_part(host, state->ends, sizeof(*state->ends)) &&
	       keep_part(host, state->average, sizeof(*state->average)) &&
	       keep_part(host, plan->incision,
			 plan->incision ? incise_incision_memory(plan->incision) : 0) &&
	       keep_part(host, plan->integers, sizeof(*plan->integers));
}

/*
 * The longest hold of a force in ticks; see incise_host_options. Steps and ticks that are not
 * multiples of each other drift apart.
 */
static void count_hold(struct incise_host_hold *hold, double host_period_s,
		       double rate_hz)
{
	double ticks = host_period_s * rate_hz, ratio = ticks < 1 ? 1 / ticks : ticks;

	hold->drifts = ticks > 0 && fabs(ratio - rint(ratio)) > DRIFT * ratio;
	hold->ticks = hold->drifts ? (int)ceil(ticks - SNAP) + INCISE_HOST_SPARE
				   : (int)fmax(rint(ticks), 1);
}

static struct incise_plan *new_host_plan(const struct incise_scene *scene,
					 const struct incise_host_options *options,
					 struct incise_error *err)
{
	const struct incise_tracker_info poses = {
		.name = "host",
		.rate_hz = incise_scene_rate_hz(scene),
		.stations = 1,
	};
	struct incise_host_hold hold = {
		.cubic = options->gives_velocity,
		.fit = options->fit_gain,
	};
	struct incise_plan *plan;

	count_hold(&hold, options->host_period_s, poses.rate_hz);
	plan = incise_plan_new_held(scene, &poses, &hold, err);
	if (!plan || (!incise_plan_set_tip(plan, options->tip_mm) &&
		      !incise_plan_set_tool(plan, options->tool)))
		return plan;
	incise_plan_free(plan);
	return INCISE_ERROR_NULL(
		err, EINVAL,
		"a host's tip_mm must be finite and within 1e6 mm, and its tool "
		"an incise_tool");
}

struct incise_host *incise_host_new(const struct incise_scene *scene,
				    const struct incise_host_options *options,
				    struct incise_error *err)
{
	struct incise_host *host;
	int rc;

	if (options &&
	    !(options->host_period_s >= 0 &&
	      options->host_period_s * incise_scene_rate_hz(scene) <= HOLD_MOST))
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"host_period_s %g: expected 0 or more, up to %d ticks at "
			"the scene's rate_hz, %g",
			options->host_period_s, HOLD_MOST, incise_scene_rate_hz(scene));
	host = calloc(1, sizeof(*host));
	if (!host)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a host");
	if (options)
		host->options = *options;
	host->tick_ns = INCISE_NS_PER_S / incise_scene_rate_hz(scene);
	host->late_ns = SNAP * host->tick_ns;
	host->late_ns += host->options.host_period_s > 0
				 ? host->options.host_period_s * INCISE_NS_PER_S
				 : host->tick_ns;
	pthread_mutex_init(&host->lock, NULL);
	host->plan = new_host_plan(scene, &host->options, err);
	if (host->plan && keep_plan(host))
		return host;
	if (host->plan)
		incise_error_set(err, ENOMEM, "no memory for a host");
	rc = errno;
	incise_host_free(host);
	errno = rc;
	return NULL;
}

void incise_host_free(struct incise_host *host)
{
	if (!host)
		return;
	for (int i = 0; i < host->n_parts; i++)
		free(host->part[i].kept);
	incise_plan_free(host->plan);
	pthread_mutex_destroy(&host->lock);
	free(host);
}

/* --- steps ------------------------------------------------------------------------------- */

static bool is_pose(const struct incise_host_pose *pose)
{
	double size2 = 0;

	for (int i = 0; i < 3; i++)
		if (!(fabs(pose->position_mm[i]) < PLACE_MOST_MM))
			return false;
	for (int i = 0; i < 4; i++)
		size2 += pose->quaternion[i] * pose->quaternion[i];
	return size2 > 0.9 * 0.9 && size2 < 1.1 * 1.1;
}

static bool is_speed(const double mm_s[3])
{
	return mm_s && v3_finite(mm_s) && v3_length(mm_s) <= SPEED_MOST_MM_S;
}

/* A tick of the plan's time. */
static int64_t tick_at(const struct incise_host *host, int64_t tick)
{
	return BEGIN_NS + llround((double)tick * host->tick_ns);
}

/* The clock's lead over the host's time, where that is too much; else 0. */
static int64_t find_lag(struct incise_host *host, int64_t t_ns)
{
	struct host_state *now = &host->now;
	int64_t step_ns = t_ns - (now->from_ns + now->last.t_ns);
	int64_t before_ns = now->clock_ns, lag_ns;

	if (!host->options.clock)
		return 0;
	now->clock_ns = incise_clock_now(host->options.clock);
	if (!now->started || step_ns < 0)
		now->lag_ns = 0;
	else
		now->lag_ns += now->clock_ns - before_ns - step_ns;
	if (now->lag_ns < 0)
		now->lag_ns = 0;
	if ((double)now->lag_ns <= host->plan->scene->limits.pose_age_ms * 1e6)
		return 0;
	lag_ns = now->lag_ns;
	now->lag_ns = 0;
	return lag_ns;
}

/* Drop the force, and the way from the last pose. */
static int let_go(struct host_state *now, int rc)
{
	now->fading = true;
	now->follows = false;
	return rc;
}

/* The first tick that is too late for a step, with time for a fade. */
static int64_t too_late(const struct incise_host *host)
{
	double fade = (double)incise_plan_fade_ns(host->plan) / host->tick_ns;

	return tick_at(host, host->now.ticks + host->plan->hold.ticks + (int)ceil(fade));
}

/* Shift the host's time to the plan's. Returns 0, or why the force fades. */
static int take_time(struct incise_host *host, int64_t t_ns)
{
	struct host_state *now = &host->now;
	int64_t lag_ns = find_lag(host, t_ns), most_ns = too_late(host);

	if (!now->started || t_ns - now->from_ns < now->last.t_ns) {
		now->from_ns = t_ns - tick_at(host, now->ticks);
		return now->started ? let_go(now, -ERANGE) : 0;
	}
	now->from_ns -= lag_ns;
	if (t_ns - now->from_ns > most_ns)
		now->from_ns = t_ns - most_ns;
	if ((double)(t_ns - now->from_ns - now->last.t_ns) > host->late_ns)
		return let_go(now, -ESTALE);
	return 0;
}

static void turn_between(double q[4], const struct host_pose *from,
			 const struct host_pose *to, double share)
{
	const double *a = from->quaternion, *b = to->quaternion;
	double same = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
	double rest = copysign(1 - share, same), size2 = 0;

	for (int i = 0; i < 4; i++) {
		q[i] = rest * a[i] + share * b[i];
		size2 += q[i] * q[i];
	}
	for (int i = 0; i < 4; i++)
		q[i] /= sqrt(size2);
}

/* Feed the pose at a tick, if one is known. */
static void feed_host(struct incise_host *host, const struct host_pose *to, int64_t t_ns)
{
	const struct host_pose *from = &host->now.last;
	struct incise_tracker_sample sample = {.t_ns = t_ns, .status = ' '};
	double step_ns = (double)(to->t_ns - from->t_ns);
	double share = (double)(t_ns - from->t_ns) / step_ns;

	if ((double)(to->t_ns - t_ns) <= SNAP * host->tick_ns) {
		v3_copy(sample.position_mm, to->place.at_mm);
		memcpy(sample.quaternion, to->quaternion, sizeof(sample.quaternion));
	} else if (host->now.follows) {
		incise_host_between(sample.position_mm, &from->place, &to->place,
				    step_ns / INCISE_NS_PER_S, share,
				    host->plan->hold.cubic);
		turn_between(sample.quaternion, from, to, share);
	} else {
		return;
	}
	incise_plan_feed(host->plan, &sample, 1);
}

/* Run the ticks up to a pose. */
static int run_host(struct incise_host *host, const struct host_pose *to)
{
	struct host_state *now = &host->now;
	int64_t end_ns = to->t_ns + llround(SNAP * host->tick_ns), t_ns;
	int rc = 0;

	incise_plan_fade(host->plan, now->fading);
	while ((t_ns = tick_at(host, now->ticks)) <= end_ns && !rc) {
		feed_host(host, to, t_ns);
		rc = incise_plan_tick(host->plan, t_ns, &now->tick);
		now->ticks++;
	}
	now->fading = now->fading && !incise_plan_faded(host->plan);
	now->last = *to;
	now->started = now->follows = true;
	return rc;
}

/* The force acts at the end of the tool in the hand. */
static void get_wrench(const struct incise_host *host, struct incise_host_wrench *wrench)
{
	const struct incise_tick *tick = &host->now.tick;
	double lever[3];

	v3_rotate(lever, tick->quaternion, host->options.tip_mm);
	for (int i = 0; i < 3; i++)
		lever[i] += tick->tool_mm[i] - tick->position_mm[i];
	v3_copy(wrench->force_N, tick->command_N);
	v3_cross(wrench->torque_N_mm, lever, tick->command_N);
	wrench->flags = tick->flags;
}

static int step_host(struct incise_host *host, int64_t t_ns,
		     const struct incise_host_pose *pose, const double mm_s[3],
		     struct incise_host_wrench *wrench)
{
	struct host_pose to;
	int rc = take_time(host, t_ns), failed;

	to.t_ns = t_ns - host->now.from_ns;
	v3_copy(to.place.at_mm, pose->position_mm);
	v3_copy(to.place.mm_s, host->options.gives_velocity ? mm_s : (double[3]){0});
	memcpy(to.quaternion, pose->quaternion, sizeof(to.quaternion));
	failed = run_host(host, &to);
	get_wrench(host, wrench);
	return failed ? failed : rc;
}

int incise_host_step(struct incise_host *host, int64_t t_ns,
		     const struct incise_host_pose *pose, const double velocity_mm_s[3],
		     struct incise_host_wrench *wrench)
{
	int rc;

	*wrench = (struct incise_host_wrench){.flags = 0};
	if (t_ns < -TIME_MOST_NS || t_ns > TIME_MOST_NS || !pose || !is_pose(pose) ||
	    (host->options.gives_velocity && !is_speed(velocity_mm_s)))
		return -EINVAL;
	pthread_mutex_lock(&host->lock);
	rc = step_host(host, t_ns, pose, velocity_mm_s, wrench);
	pthread_mutex_unlock(&host->lock);
	return rc;
}

void incise_host_reset(struct incise_host *host)
{
	pthread_mutex_lock(&host->lock);
	for (int i = 0; i < host->n_parts; i++)
		memcpy(host->part[i].at, host->part[i].kept, host->part[i].size);
	host->now = (struct host_state){.ticks = 0};
	pthread_mutex_unlock(&host->lock);
}

int incise_host_set_tool(struct incise_host *host, enum incise_tool tool)
{
	int rc;

	pthread_mutex_lock(&host->lock);
	rc = incise_plan_set_tool(host->plan, tool);
	pthread_mutex_unlock(&host->lock);
	return rc;
}

void incise_host_last(struct incise_host *host, struct incise_tick *tick)
{
	pthread_mutex_lock(&host->lock);
	*tick = host->now.tick;
	pthread_mutex_unlock(&host->lock);
}

void incise_host_info(struct incise_host *host, struct incise_host_info *info)
{
	const struct incise_plan *plan = host->plan;

	pthread_mutex_lock(&host->lock);
	*info = (struct incise_host_info){
		.tick_s = host->tick_ns / INCISE_NS_PER_S,
		.hold_ticks = plan->hold.ticks,
		.gain = plan->gain,
		.scene_gain = plan->scene->tissue.gain,
		.stability = plan->stability,
	};
	pthread_mutex_unlock(&host->lock);
}
