/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Requirements of every stepper, with any backend: a table of cases, each for one that
 * was just opened. The test that runs them advances time and raises inputs.
 *
 *   for (i = 0; conformance[i].name; i++) { open; conformance[i].run(&c); close; }
 */
#ifndef INCISE_TEST_CONFORMANCE_H
#define INCISE_TEST_CONFORMANCE_H

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/stepper.h>

struct conformance {
	struct incise_stepper *stepper;
	void *world;
	void (*advance)(void *world, int64_t ns);
	/*
	 * Make INCISE_STEPPER_LINE_ESTOP, or _AT_MAX, active or not; NULL: it has none.
	 */
	void (*input)(void *world, unsigned int input, bool active);
	bool always_powered; /* the virtual rig: no power, and faults end by themselves */
	double slack_s;	     /* what this machine may be late by */
	void (*say)(const char *text);
	struct incise_stepper_info info;
};

#define CONFORM(c, condition)                                                     \
	do {                                                                      \
		if (!(condition)) {                                               \
			char text_[300];                                          \
			struct incise_stepper_status s_ = {0};                    \
			int rc_ = incise_stepper_status((c)->stepper, &s_);       \
			snprintf(text_, sizeof(text_),                            \
				 "%s:%d: %s: rc %d, %s, faults %#x, inputs %#x, " \
				 "%.6f mm, %.3f mm/s, late %llu",                 \
				 __func__, __LINE__, #condition, rc_,             \
				 incise_stepper_state_name(s_.state), s_.faults,  \
				 s_.inputs, s_.position_mm, s_.velocity_mm_s,     \
				 (unsigned long long)s_.late);                    \
			(c)->say(text_);                                          \
		}                                                                 \
	} while (0)

#define CONFORM_MS 1000000LL

static inline struct incise_stepper_status conform_look(struct conformance *c)
{
	struct incise_stepper_status status = {0};

	CONFORM(c, !incise_stepper_status(c->stepper, &status));
	return status;
}

static inline void conform_enable(struct conformance *c)
{
	struct incise_error err = {0};

	if (incise_stepper_enable(c->stepper, &err))
		c->say(err.text);
}

/* Hold a target for a time, well within the deadman's. */
static inline void conform_hold(struct conformance *c, double mm, double seconds)
{
	double every_s = fmin(0.005, c->info.deadman_s / 8);

	for (double t = 0; t < seconds; t += every_s) {
		CONFORM(c, !incise_stepper_set(c->stepper, mm));
		c->advance(c->world, (int64_t)(every_s * 1e9));
	}
}

/* Of the fastest way over a distance, and half a second for a jerk's smoothing. */
static inline double conform_time(const struct conformance *c, double mm)
{
	return fabs(mm) / c->info.velocity_mm_s +
	       c->info.velocity_mm_s / c->info.acceleration_mm_s2 + 0.5;
}

static inline void conform_rests_when_opened(struct conformance *c)
{
	struct incise_stepper_status s = conform_look(c), later;

	CONFORM(c, s.faults == 0 && s.velocity_mm_s == 0);
	CONFORM(c, s.state == (c->always_powered ? INCISE_STEPPER_STATE_READY
						 : INCISE_STEPPER_STATE_DISABLED));
	CONFORM(c, c->info.travel_mm > 0 && c->info.step_mm > 0 && c->info.name[0]);
	CONFORM(c, c->info.spring_N_mm > 0 && c->info.deadman_s > 0);
	if (!c->always_powered)
		CONFORM(c, incise_stepper_set(c->stepper, 1) == -EIO);
	c->advance(c->world, 300 * CONFORM_MS);
	later = conform_look(c);
	/* Without power nobody need look at it at each tick. */
	CONFORM(c, later.position_mm == s.position_mm && later.t_ns >= s.t_ns);
	CONFORM(c, later.faults == 0);
}

static inline void conform_goes_where_it_is_sent(struct conformance *c)
{
	static const double part[] = {0.3, 0.31, 0, 0.1234567};
	double before = 0;

	conform_enable(c);
	for (size_t i = 0; i < sizeof(part) / sizeof(*part); i++) {
		double mm = part[i] * c->info.travel_mm;
		struct incise_stepper_status s;

		conform_hold(c, mm, conform_time(c, mm - before) + c->slack_s);
		s = conform_look(c);
		/* The nearest microstep. */
		CONFORM(c, fabs(s.position_mm - mm) <= 0.501 * c->info.step_mm);
		CONFORM(c, s.state == INCISE_STEPPER_STATE_READY && s.velocity_mm_s == 0);
		CONFORM(c, s.faults == 0);
		before = mm;
	}
}

static inline void conform_keeps_its_limits(struct conformance *c)
{
	uint64_t random = 88172645463325252ULL;
	struct incise_stepper_status last;

	conform_enable(c);
	last = conform_look(c);
	for (int i = 0; i < 400; i++) {
		struct incise_stepper_status s;
		double dt, most;

		random ^= random << 13;
		random ^= random >> 7;
		random ^= random << 17;
		/* Now and then a new target, in and out of the travel; else the last. */
		CONFORM(c, !incise_stepper_set(
				   c->stepper,
				   (i / 20 % 2 ? 1.5 : -0.5) * c->info.travel_mm *
					   (double)(random >> 11) / 9007199254740992.0));
		c->advance(c->world, CONFORM_MS);
		s = conform_look(c);
		dt = (double)(s.t_ns - last.t_ns) * 1e-9;
		/*
		 * A step is there or not, at both ends; what was late may be made good
		 * 1/7 faster; the status may be a tick, 2 ms at most, older than its
		 * position.
		 */
		most = c->info.velocity_mm_s * 8 / 7 * (dt + 0.002);
		CONFORM(c, fabs(s.position_mm - last.position_mm) <=
				   most + 2 * c->info.step_mm);
		CONFORM(c, fabs(s.velocity_mm_s) <= c->info.velocity_mm_s * (1 + 1e-4));
		CONFORM(c, s.position_mm >= 0 && s.position_mm <= c->info.travel_mm);
		last = s;
	}
}

static inline void conform_holds_targets_within_the_travel(struct conformance *c)
{
	struct incise_stepper_status s;

	conform_enable(c);
	conform_hold(c, -1e30, 0.1);
	s = conform_look(c);
	CONFORM(c, s.position_mm == 0 && s.faults == INCISE_STEPPER_FAULT_TRAVEL);
	conform_hold(c, 1e30, conform_time(c, c->info.travel_mm) + c->slack_s);
	s = conform_look(c);
	CONFORM(c, fabs(s.position_mm - c->info.travel_mm) < c->info.step_mm);
	CONFORM(c, s.faults == INCISE_STEPPER_FAULT_TRAVEL);
	/* No number is no target. */
	CONFORM(c, incise_stepper_set(c->stepper, NAN) == -EDOM);
	CONFORM(c, incise_stepper_set(c->stepper, INFINITY) == -EDOM);
	CONFORM(c, incise_stepper_set(c->stepper, -INFINITY) == -EDOM);
	conform_hold(c, c->info.travel_mm / 2, 0.05);
	CONFORM(c, conform_look(c).faults == 0);
}

static inline void conform_deadman(struct conformance *c)
{
	struct incise_stepper_status s, later;
	double stop_s = 2 * c->info.velocity_mm_s / c->info.acceleration_mm_s2 + 0.2;

	conform_enable(c);
	conform_hold(c, 0.5 * c->info.travel_mm, conform_time(c, 0) / 2);
	CONFORM(c, conform_look(c).faults == 0);
	c->advance(c->world, (int64_t)((c->info.deadman_s + stop_s + c->slack_s) * 1e9));
	if (c->always_powered) {
		CONFORM(c, conform_look(c).faults == INCISE_STEPPER_FAULT_DEADMAN);
		return;
	}
	s = conform_look(c);
	CONFORM(c, s.faults == INCISE_STEPPER_FAULT_DEADMAN);
	CONFORM(c, s.state == INCISE_STEPPER_STATE_FAULT && s.velocity_mm_s == 0);
	/* Latched: no target, and no power, before it is cleared. */
	CONFORM(c, incise_stepper_set(c->stepper, 1) == -EIO);
	CONFORM(c, incise_stepper_enable(c->stepper, NULL) == -EPERM);
	CONFORM(c, !incise_stepper_clear(c->stepper, NULL));
	CONFORM(c, conform_look(c).state == INCISE_STEPPER_STATE_DISABLED);
	conform_enable(c);
	c->advance(c->world, (int64_t)(c->info.deadman_s / 2 * 1e9));
	/* And nothing moves by itself. */
	later = conform_look(c);
	CONFORM(c, later.position_mm == s.position_mm);
	CONFORM(c, later.state == INCISE_STEPPER_STATE_READY && later.faults == 0);
}

static inline void conform_disable(struct conformance *c)
{
	struct incise_stepper_status s, later;
	struct incise_error err = {0};

	conform_enable(c);
	conform_enable(c); /* a second time is none */
	conform_hold(c, c->info.travel_mm, 0.05);
	if (incise_stepper_disable(c->stepper, &err))
		c->say(err.text);
	s = conform_look(c);
	if (c->always_powered)
		return;
	CONFORM(c, s.state == INCISE_STEPPER_STATE_DISABLED && s.faults == 0);
	CONFORM(c, s.velocity_mm_s == 0 && s.position_mm > 0);
	c->advance(c->world, 300 * CONFORM_MS);
	later = conform_look(c);
	CONFORM(c, later.position_mm == s.position_mm && later.faults == 0);
}

static inline void conform_jog(struct conformance *c)
{
	double speed = 0.2 * c->info.velocity_mm_s;
	struct incise_stepper_status s;
	int rc;

	conform_enable(c);
	rc = incise_stepper_jog(c->stepper, speed);
	if (c->always_powered) {
		CONFORM(c, rc == -EOPNOTSUPP);
		return;
	}
	CONFORM(c, !rc);
	CONFORM(c, incise_stepper_jog(c->stepper, NAN) == -EDOM);
	c->advance(c->world, (int64_t)(fmin(0.05, c->info.deadman_s / 2) * 1e9));
	s = conform_look(c);
	CONFORM(c, s.state == INCISE_STEPPER_STATE_MOVING && s.position_mm > 0);
	/* To a step/s, what a target is rounded to. */
	CONFORM(c, fabs(s.velocity_mm_s - speed) <= 1.01 * c->info.step_mm);
	/* Down again, to the end of the travel and no farther. */
	for (int i = 0; i < 100; i++) {
		CONFORM(c, !incise_stepper_jog(c->stepper, -speed));
		c->advance(c->world, 5 * CONFORM_MS);
	}
	s = conform_look(c);
	CONFORM(c, s.position_mm == 0 && s.velocity_mm_s == 0);
}

static inline void conform_estop(struct conformance *c)
{
	struct incise_stepper_status s, later;

	if (!c->input)
		return;
	conform_enable(c);
	conform_hold(c, c->info.travel_mm, 0.1);
	CONFORM(c, conform_look(c).state == INCISE_STEPPER_STATE_MOVING);
	c->input(c->world, INCISE_STEPPER_LINE_ESTOP, true);
	c->advance(c->world, 5 * CONFORM_MS + (int64_t)(c->slack_s * 1e9));
	s = conform_look(c);
	CONFORM(c, s.state == INCISE_STEPPER_STATE_FAULT);
	CONFORM(c, s.faults == INCISE_STEPPER_FAULT_ESTOP && !s.homed);
	CONFORM(c, s.inputs & INCISE_STEPPER_LINE_ESTOP);
	CONFORM(c, incise_stepper_set(c->stepper, 0) == -EIO);
	CONFORM(c, incise_stepper_clear(c->stepper, NULL) == -EBUSY);
	c->input(c->world, INCISE_STEPPER_LINE_ESTOP, false);
	c->advance(c->world, 10 * CONFORM_MS);
	/* Released, it is still latched. */
	CONFORM(c, incise_stepper_enable(c->stepper, NULL) == -EPERM);
	CONFORM(c, !incise_stepper_clear(c->stepper, NULL));
	conform_enable(c);
	later = conform_look(c);
	CONFORM(c, later.position_mm == s.position_mm && later.faults == 0);
	/* Pressed before, it forbids power. */
	CONFORM(c, !incise_stepper_disable(c->stepper, NULL));
	c->input(c->world, INCISE_STEPPER_LINE_ESTOP, true);
	c->advance(c->world, 10 * CONFORM_MS);
	CONFORM(c, incise_stepper_enable(c->stepper, NULL) == -EBUSY);
	c->input(c->world, INCISE_STEPPER_LINE_ESTOP, false);
}

static inline void conform_limit(struct conformance *c)
{
	struct incise_stepper_status s;

	if (!c->input || !(c->info.inputs & INCISE_STEPPER_LINE_LIMIT_MAX))
		return;
	conform_enable(c);
	conform_hold(c, c->info.travel_mm, 0.1);
	c->input(c->world, INCISE_STEPPER_LINE_LIMIT_MAX, true);
	c->advance(c->world, 5 * CONFORM_MS + (int64_t)(c->slack_s * 1e9));
	s = conform_look(c);
	CONFORM(c, s.state == INCISE_STEPPER_STATE_FAULT &&
			   s.faults == INCISE_STEPPER_FAULT_LIMIT_MAX);
	/* Away from it, it may go while it is active. */
	CONFORM(c, !incise_stepper_clear(c->stepper, NULL));
	conform_enable(c);
	conform_hold(c, 0, conform_time(c, s.position_mm) + c->slack_s);
	s = conform_look(c);
	CONFORM(c, s.position_mm == 0 && s.faults == 0);
	c->input(c->world, INCISE_STEPPER_LINE_LIMIT_MAX, false);
}

static inline void conform_home(struct conformance *c)
{
	struct incise_error err = {0};
	struct incise_stepper_status s;
	int rc;

	conform_enable(c);
	rc = incise_stepper_home(c->stepper, NULL, NULL, &err);
	if (!c->info.can_home) {
		CONFORM(c, rc == -EOPNOTSUPP && err.text[0]);
		return;
	}
	if (rc)
		c->say(err.text);
	s = conform_look(c);
	CONFORM(c, s.homed && s.state == INCISE_STEPPER_STATE_READY && s.faults == 0);
}

static const struct {
	const char *name;
	void (*run)(struct conformance *c);
} conformance[] = {
	{"rests when opened", conform_rests_when_opened},
	{"goes where it is sent", conform_goes_where_it_is_sent},
	{"keeps its limits", conform_keeps_its_limits},
	{"holds targets within the travel", conform_holds_targets_within_the_travel},
	{"deadman", conform_deadman},
	{"disable", conform_disable},
	{"jog", conform_jog},
	{"e-stop", conform_estop},
	{"limit", conform_limit},
	{"home", conform_home},
	{NULL, NULL},
};

#endif
