// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The virtual actuator: a nut that follows targets within its limits, and a handle
 * between its spring and the hand that grips it. Goes forward in ticks of 100 µs.
 *
 *      nut ─/\/\ spring /\/\─ handle ─/\/\ hand, damper /\/\─ standing still
 *
 * A target given at t acts from the first tick at or after t. Going to it:
 *
 *   speed   limit  ____________
 *                 /            \         slopes: the largest acceleration
 *           _____/              \_____
 *
 * On the bench the handle presses a stiff sensor instead: see world.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "sim.h"
#include "world.h"

#define NS 1e-9
#define TICK_S (INCISE_SIM_TICK_NS * NS)
#define DEADMAN_NS 100000000

/* The loss is complete after this way: a Jenkins element of that stiffness. */
#define LOSS_MM 0.1

struct sim_stepper {
	struct incise_stepper stepper;
	struct incise_sim *sim;
	int axis;
	int64_t t_ns;	/* script time that has been reached: a whole tick */
	int64_t set_ns; /* of the last target */
	unsigned int faults;
	bool watched; /* by the deadman: from the first target on */
	double step_mm;
	long steps_max; /* whole microsteps in the travel */
	double rest_mm; /* of the nut, where the hand and the spring are at rest */
	double target_mm, nut_mm, nut_mm_s;
	double handle_mm, handle_mm_s;
	double limit_mm_s; /* of the nut: by the screw, or by a jog */
	struct incise_bench bench;
};

/* In the names of the actuators. */
static const char *const of_axis[] = {"", ", across the blade", ", along the cut"};

static struct sim_stepper *of_stepper(const struct incise_stepper *stepper)
{
	return (struct sim_stepper *)stepper;
}

/* The motor holds the nut at the nearest microstep within the travel. */
static double nut_held(const struct sim_stepper *s)
{
	long steps = lround(s->nut_mm / s->step_mm);

	return fmax(0, fmin(s->steps_max, steps)) * s->step_mm;
}

/*
 * The fastest speed for the coming tick from which the nut comes to rest just at a
 * distance, losing aT in each tick. With lengths in aT² and speeds in aT, n ticks cover
 *
 *     v + (v-1) + … + (v-n+1) = n·v - n(n-1)/2,    n - 1 ≤ v ≤ n
 */
static double stopping_speed(double distance, double a)
{
	double units = fabs(distance) / (a * TICK_S * TICK_S);
	double n = fmax(1, ceil((sqrt(1 + 8 * units) - 1) / 2));

	return copysign((units / n + (n - 1) / 2) * a * TICK_S, distance);
}

static void move_nut(struct sim_stepper *s)
{
	const struct incise_sim_config *config = &s->sim->config;
	double change = config->screw_mm_s2 * TICK_S;
	double v = stopping_speed(s->target_mm - s->nut_mm, config->screw_mm_s2);

	v = fmax(-s->limit_mm_s, fmin(s->limit_mm_s, v));
	v = fmax(s->nut_mm_s - change, fmin(s->nut_mm_s + change, v));
	s->nut_mm += v * TICK_S;
	s->nut_mm_s = v;
}

/*
 * Implicit midpoint rule: its energy never grows by itself, however stiff the springs are,
 * and friction, taken at the midpoint too, holds a handle that rests still.
 */
static void move_handle(struct sim_stepper *s, double nut_mm)
{
	const struct incise_sim_config *config = &s->sim->config;
	double mass = config->handle_kg / 1000; /* N s²/mm */
	double stiffness = config->spring_N_mm + config->hand_N_mm;
	double push = 2 * mass / TICK_S * s->handle_mm_s - stiffness * s->handle_mm +
		      config->spring_N_mm * nut_mm + config->hand_N_mm * s->rest_mm;
	double middle;

	if (fabs(push) <= config->handle_friction_N) {
		s->handle_mm_s = 0;
		return;
	}
	middle = (push - copysign(config->handle_friction_N, push)) /
		 (2 * mass / TICK_S + stiffness * TICK_S / 2 + config->hand_N_s_mm);
	s->handle_mm += middle * TICK_S;
	s->handle_mm_s = 2 * middle - s->handle_mm_s;
}

/* Follows @x with a play of @width. */
static double play(double now, double x, double width)
{
	return fmax(x - width / 2, fmin(x + width / 2, now));
}

void incise_bench_follow(struct incise_bench *bench,
			 const struct incise_sim_config *config, double nut_mm,
			 double mm_s)
{
	const double friction_N = config->handle_friction_N;
	double moved = nut_mm - bench->nut_mm, before = bench->behind_mm, spring_N, apart;
	int way;

	bench->nut_mm = nut_mm;
	if (config->stall_mm_s > 0 && fabs(mm_s) > config->stall_mm_s)
		bench->lost_mm += moved;
	bench->behind_mm = play(before, nut_mm - bench->lost_mm, config->backlash_mm);
	bench->loss_N += config->hysteresis_N / LOSS_MM * (bench->behind_mm - before);
	bench->loss_N = fmax(-config->hysteresis_N / 2,
			     fmin(config->hysteresis_N / 2, bench->loss_N));
	spring_N = config->spring_N_mm * bench->behind_mm + bench->loss_N;

	/* The handle transmits the force that its friction does not hold. */
	apart = spring_N - bench->force_N;
	way = (apart > 0) - (apart < 0);
	if (bench->sliding && way == -bench->sliding)
		bench->sliding = 0;
	if (!bench->sliding && fabs(apart) > friction_N + config->stiction_N)
		bench->sliding = way;
	if (bench->sliding && fabs(apart) > friction_N)
		bench->force_N = spring_N - way * friction_N;
}

static void advance_sim_stepper(struct sim_stepper *s, int64_t now)
{
	while (s->t_ns + INCISE_SIM_TICK_NS <= now) {
		double before = nut_held(s);

		if (s->watched && s->t_ns - s->set_ns >= DEADMAN_NS) {
			s->target_mm = s->rest_mm;
			s->faults |= INCISE_STEPPER_FAULT_DEADMAN;
		}
		move_nut(s);
		if (s->sim->config.bench && !s->axis)
			incise_bench_follow(&s->bench, &s->sim->config, nut_held(s),
					    s->nut_mm_s);
		else
			move_handle(s, (before + nut_held(s)) / 2);
		s->t_ns += INCISE_SIM_TICK_NS;
	}
}

/* For the force channel, at its own times, at most the stepper's. */
static INCISE_REALTIME double press_N(struct incise_stepper *stepper, int64_t t_ns)
{
	struct sim_stepper *s = of_stepper(stepper);

	advance_sim_stepper(s, t_ns);
	return s->bench.force_N;
}

static int64_t script_now(const struct sim_stepper *s)
{
	/* Samples from before a target must not show its effect. */
	if (s->sim->config.bench)
		incise_sim_advance(s->sim);
	return incise_clock_now(s->sim->clock) - s->sim->start_ns;
}

static INCISE_REALTIME int sim_stepper_set(struct incise_stepper *stepper,
					   double position_mm)
{
	struct sim_stepper *s = of_stepper(stepper);
	double most = s->steps_max * s->step_mm;
	int64_t now = script_now(s);

	advance_sim_stepper(s, now);
	/* Neither a target nor a heartbeat. */
	if (!isfinite(position_mm))
		return -EDOM;
	s->limit_mm_s = s->sim->config.screw_mm_s;
	s->faults = position_mm < 0 || position_mm > s->sim->config.travel_mm
			    ? INCISE_STEPPER_FAULT_TRAVEL
			    : 0;
	position_mm = fmax(0, fmin(most, position_mm));
	s->target_mm = round(position_mm / s->step_mm) * s->step_mm;
	s->set_ns = now;
	s->watched = true;
	return 0;
}

/* On the bench only, where users request a speed. */
static int sim_stepper_jog(struct incise_stepper *stepper, double velocity_mm_s)
{
	struct sim_stepper *s = of_stepper(stepper);
	const struct incise_sim_config *config = &s->sim->config;
	double stop_mm;
	int rc;

	if (!config->bench)
		return -EOPNOTSUPP;
	if (!isfinite(velocity_mm_s))
		return -EDOM;
	advance_sim_stepper(s, script_now(s));
	stop_mm = s->nut_mm +
		  copysign(s->nut_mm_s * s->nut_mm_s / (2 * config->screw_mm_s2),
			   s->nut_mm_s);
	rc = sim_stepper_set(stepper, velocity_mm_s > 0	  ? config->travel_mm
				      : velocity_mm_s < 0 ? 0
							  : stop_mm);
	if (velocity_mm_s != 0)
		s->limit_mm_s = fmin(fabs(velocity_mm_s), config->screw_mm_s);
	return rc;
}

/* A target where it stands. The virtual actuator is always powered. */
static int sim_stepper_enable(struct incise_stepper *stepper, struct incise_error *err)
{
	struct sim_stepper *s = of_stepper(stepper);

	(void)err;
	return sim_stepper_set(stepper, nut_held(s));
}

/* There is no power to switch off: no force, and no deadman. */
static int sim_stepper_disable(struct incise_stepper *stepper, struct incise_error *err)
{
	struct sim_stepper *s = of_stepper(stepper);

	(void)err;
	sim_stepper_set(stepper, s->rest_mm);
	s->watched = false;
	return 0;
}

static int sim_stepper_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	struct sim_stepper *s = of_stepper(stepper);

	(void)err;
	advance_sim_stepper(s, script_now(s));
	s->faults = 0;
	return 0;
}

static enum incise_stepper_state sim_stepper_state(const struct sim_stepper *s)
{
	/* Within half a microstep, and slow enough to stop in one tick. */
	if (fabs(s->nut_mm - s->target_mm) < s->step_mm / 2 &&
	    fabs(s->nut_mm_s) <= s->sim->config.screw_mm_s2 * TICK_S)
		return INCISE_STEPPER_STATE_READY;
	return s->faults & INCISE_STEPPER_FAULT_DEADMAN ? INCISE_STEPPER_STATE_STOPPING
							: INCISE_STEPPER_STATE_MOVING;
}

static INCISE_REALTIME int sim_stepper_status(struct incise_stepper *stepper,
					      struct incise_stepper_status *status)
{
	struct sim_stepper *s = of_stepper(stepper);
	double nut;

	advance_sim_stepper(s, script_now(s));
	nut = nut_held(s);
	/* On the bench no hand holds it, and only the force channel measures its force. */
	if (s->sim->config.bench && !s->axis)
		s->handle_mm = 0;
	*status = (struct incise_stepper_status){
		.t_ns = s->sim->start_ns + s->t_ns,
		.position_mm = nut,
		.velocity_mm_s = s->nut_mm_s,
		.handle_mm = s->handle_mm,
		.force_N = s->sim->config.spring_N_mm * (nut - s->handle_mm),
		.faults = s->faults,
		.state = sim_stepper_state(s),
		.homed = true,
	};
	return 0;
}

static void sim_stepper_info(const struct incise_stepper *stepper,
			     struct incise_stepper_info *info)
{
	const struct sim_stepper *s = of_stepper(stepper);
	const struct incise_sim_config *config = &s->sim->config;

	*info = (struct incise_stepper_info){
		.spring_N_mm = config->spring_N_mm,
		.travel_mm = config->travel_mm,
		.step_mm = s->step_mm,
		.within_mm = s->step_mm / 2,
		.velocity_mm_s = config->screw_mm_s,
		.acceleration_mm_s2 = config->screw_mm_s2,
		.deadman_s = DEADMAN_NS * NS,
		.measures_handle = true,
		.rest_mm = s->rest_mm,
	};
	snprintf(info->name, sizeof(info->name), "simulated haptic scalpel%s",
		 of_axis[s->axis]);
}

static void sim_stepper_close(struct incise_stepper *stepper)
{
	struct sim_stepper *s = of_stepper(stepper);

	if (s->sim->stepper == stepper) {
		s->sim->press_N = NULL;
		s->sim->stepper = NULL;
	}
	free(s);
}

static const struct incise_stepper_ops ops = {
	.set = sim_stepper_set,
	.jog = sim_stepper_jog,
	.status = sim_stepper_status,
	.enable = sim_stepper_enable,
	.disable = sim_stepper_disable,
	.clear = sim_stepper_clear,
	.info = sim_stepper_info,
	.close = sim_stepper_close,
};

int incise_sim_directions(const struct incise_sim_config *config, const double normal[3],
			  double direction[][3])
{
	static const double across[3] = {0, 1, 0}, along[3] = {1, 0, 0};
	const double *const all[] = {normal, across, along};

	for (int i = 0; i < config->axes; i++)
		v3_copy(direction[i], all[i]);
	return config->axes;
}

struct incise_stepper *incise_sim_stepper_new(struct incise_sim *sim, int axis)
{
	const struct incise_sim_config *config = &sim->config;
	struct sim_stepper *s = calloc(1, sizeof(*s));

	if (!s) {
		errno = ENOMEM;
		return NULL;
	}
	s->stepper.ops = &ops;
	s->sim = sim;
	s->axis = axis;
	s->step_mm = config->lead_mm / config->steps_per_turn;
	s->limit_mm_s = config->screw_mm_s;
	/* A travel of whole steps must not lose one to the rounding of the division. */
	s->steps_max = (long)(config->travel_mm / s->step_mm * (1 + 1e-12));
	s->t_ns = script_now(s) / INCISE_SIM_TICK_NS * INCISE_SIM_TICK_NS;
	if (axis) {
		s->rest_mm = (double)(s->steps_max / 2) * s->step_mm;
		s->target_mm = s->nut_mm = s->handle_mm = s->rest_mm;
		return &s->stepper;
	}
	sim->press_N = press_N;
	sim->stepper = &s->stepper;
	return &s->stepper;
}
