// SPDX-License-Identifier: GPL-2.0-or-later
/* See edge_log.h. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "edge_log.h"

/* Long before anything that a log holds. */
#define NEVER (INT64_MIN / 4)

/* Steps at full speed: a gap between two steps of which parts are looked at too. */
#define LONG_PAUSE 3

const char *edge_log_name(enum edge_log_fault fault)
{
	static const char *const names[EDGE_LOG_FAULTS] = {
		[EDGE_LOG_LOST] = "lost",
		[EDGE_LOG_ORDER] = "order",
		[EDGE_LOG_REPEAT] = "repeat",
		[EDGE_LOG_HIGH] = "high",
		[EDGE_LOG_LOW] = "low",
		[EDGE_LOG_SETUP] = "set-up",
		[EDGE_LOG_HOLD] = "hold",
		[EDGE_LOG_ENABLE] = "enable",
		[EDGE_LOG_VELOCITY] = "velocity",
		[EDGE_LOG_ACCELERATION] = "acceleration",
		[EDGE_LOG_RANGE] = "range",
		[EDGE_LOG_STOP] = "stop",
	};

	return names[fault];
}

__attribute__((format(printf, 3, 4))) static void edge_log_fault(
	struct edge_log *log, enum edge_log_fault fault, const char *text, ...)
{
	va_list rest;
	int size;

	log->faults[fault]++;
	if (log->faulty++)
		return;
	size = snprintf(
		log->first, sizeof(log->first),
		"%s at edge %u, t = %lld ns, position %lld: ", edge_log_name(fault),
		log->sequence, (long long)log->t_ns, (long long)log->position);
	va_start(rest, text);
	vsnprintf(log->first + size, sizeof(log->first) - size, text, rest);
	va_end(rest);
}

static void edge_log_at_least(struct edge_log *log, enum edge_log_fault fault,
			      int64_t since_ns, int64_t least_ns)
{
	int64_t was_ns = log->t_ns - since_ns;

	if (was_ns < least_ns)
		edge_log_fault(log, fault, "%lld ns, at least %lld", (long long)was_ns,
			       (long long)least_ns);
}

void edge_log_limits(struct edge_log *log, const struct edge_log_motor *motor)
{
	log->motor = *motor;
	log->steps = 0;
}

void edge_log_init(struct edge_log *log, const struct edge_log_motor *motor,
		   int64_t position, unsigned int levels)
{
	memset(log, 0, sizeof(*log));
	edge_log_limits(log, motor);
	log->position = position;
	log->lead_ns = log->trail_ns = log->dir_ns = log->powered_ns = NEVER;
	log->t_ns = NEVER;
	log->step_on = (levels & 1) != motor->step_low;
	log->dir_on = (levels >> 1 & 1) != motor->dir_low;
	log->powered = (levels >> 2 & 1) != motor->enable_low;
}

/* Velocities that a way in a time may have been, the time known to lateness only. */
struct range {
	double from, to;
};

static struct range edge_log_velocity(double way, double time, double late)
{
	double slow = way / (time + late);
	double fast = time > late ? way / (time - late) : copysign(INFINITY, way);

	if (way == 0)
		return (struct range){0, 0};
	return way > 0 ? (struct range){slow, fast} : (struct range){fast, slow};
}

/* Two windows, @before and @after, their middles @apart seconds apart. */
static void edge_log_judge(struct edge_log *log, struct range before, struct range after,
			   double apart, const char *what, unsigned int steps)
{
	double change = fmax(fmax(after.from - before.to, before.from - after.to), 0);
	double allowed = log->motor.acceleration * apart;

	log->hardest = fmax(log->hardest, change / allowed);
	if (change > allowed * (1 + 1e-9))
		edge_log_fault(
			log, EDGE_LOG_ACCELERATION,
			"%s of %u steps: velocity changed by %.1f steps/s, at most %.1f",
			what, steps, change, allowed);
}

/* Now the motor stands at position exactly. */
static void edge_log_remember(struct edge_log *log)
{
	log->history[log->steps % EDGE_LOG_HISTORY].t_ns = log->t_ns;
	log->history[log->steps % EDGE_LOG_HISTORY].position = log->position;
	log->steps++;
}

static int64_t edge_log_back_ns(const struct edge_log *log, uint64_t steps)
{
	return log->history[(log->steps - 1 - steps) % EDGE_LOG_HISTORY].t_ns;
}

static int64_t edge_log_back(const struct edge_log *log, uint64_t steps)
{
	return log->history[(log->steps - 1 - steps) % EDGE_LOG_HISTORY].position;
}

/*
 * Between two steps the motor is within a step of where it was. Of a pause as much is looked
 * at as reveals most: all of it, a half, a quarter ... down to a step at full speed.
 */
static void edge_log_still(struct edge_log *log, struct range moving, double g,
			   double pause, double way_from, double way_to, const char *what,
			   unsigned int steps)
{
	double late = log->motor.lateness_ns * 1e-9, tick = log->motor.tick_ns * 1e-9;

	for (double h = pause; h > 2 * late && h * log->motor.velocity >= 1; h /= 2) {
		const struct range still = {way_from / (h - late), way_to / (h - late)};

		edge_log_judge(log, moving, still, (g + h) / 2 + late + tick, what,
			       steps);
	}
}

/* A pause after the step @last steps back. */
static void edge_log_stopped(struct edge_log *log, unsigned int last, double pause)
{
	double late = log->motor.lateness_ns * 1e-9;

	for (unsigned int n = 1; n <= EDGE_LOG_WINDOW && last + n < log->steps; n *= 2) {
		double g =
			(edge_log_back_ns(log, last) - edge_log_back_ns(log, last + n)) *
			1e-9;
		double way = edge_log_back(log, last) - edge_log_back(log, last + n);

		edge_log_still(log, edge_log_velocity(way, g, late), g, pause, -1, 1,
			       "stop after a window", n);
	}
}

/* A pause before the newest steps, as it ended with a step itself. */
static void edge_log_started(struct edge_log *log)
{
	double late = log->motor.lateness_ns * 1e-9;

	for (unsigned int n = 1; n <= EDGE_LOG_WINDOW && n + 1 < log->steps; n *= 2) {
		double g = (edge_log_back_ns(log, 0) - edge_log_back_ns(log, n)) * 1e-9;
		double way = edge_log_back(log, 0) - edge_log_back(log, n);
		double pause =
			(edge_log_back_ns(log, n) - edge_log_back_ns(log, n + 1)) * 1e-9;
		double last = edge_log_back(log, n) - edge_log_back(log, n + 1);

		if (pause * log->motor.velocity >= LONG_PAUSE)
			edge_log_still(log, edge_log_velocity(way, g, late), g, pause,
				       last - 1, last + 1, "start before a window", n);
	}
}

/* The step that was just put into the history, in windows of all sizes. */
static void edge_log_accelerate(struct edge_log *log)
{
	double late = log->motor.lateness_ns * 1e-9, tick = log->motor.tick_ns * 1e-9;

	double pause;

	if (log->motor.lateness_ns < 0 || log->steps < 2)
		return;
	edge_log_started(log);
	pause = (edge_log_back_ns(log, 0) - edge_log_back_ns(log, 1)) * 1e-9;
	if (pause * log->motor.velocity >= LONG_PAUSE)
		edge_log_stopped(log, 1, pause);
	for (unsigned int n = 1; n <= EDGE_LOG_WINDOW && 2 * n < log->steps; n *= 2) {
		int64_t last = edge_log_back_ns(log, 0),
			middle = edge_log_back_ns(log, n);
		double g = (middle - edge_log_back_ns(log, 2 * n)) * 1e-9;
		double h = (last - middle) * 1e-9;
		double way_g = edge_log_back(log, n) - edge_log_back(log, 2 * n);
		double way_h = edge_log_back(log, 0) - edge_log_back(log, n);

		edge_log_judge(log, edge_log_velocity(way_g, g, late),
			       edge_log_velocity(way_h, h, late),
			       (g + h) / 2 + late + tick, "windows", n);
	}
}

/* The motor has stood since its last step, until @t_ns. */
static uint64_t edge_log_rest(struct edge_log *log, int64_t t_ns)
{
	if (log->motor.lateness_ns >= 0 && log->steps)
		edge_log_stopped(log, 0, (t_ns - edge_log_back_ns(log, 0)) * 1e-9);
	return log->faulty;
}

static void edge_log_stops(struct edge_log *log, int direction)
{
	for (int i = 0; i < EDGE_LOG_STOPS; i++) {
		const struct edge_log_stop *stop = &log->motor.stop[i];

		if (!log->stopped[i] || (stop->direction && stop->direction != direction))
			continue;
		log->after_stop[i]++;
		if (log->after_stop[i] > log->into_stop)
			log->into_stop = log->after_stop[i];
		if (log->after_stop[i] > stop->allowed)
			edge_log_fault(log, EDGE_LOG_STOP,
				       "step %u after line %u forbade it, at most %u",
				       log->after_stop[i], stop->line, stop->allowed);
	}
}

static void edge_log_lead(struct edge_log *log)
{
	const struct edge_log_motor *motor = &log->motor;
	int direction = log->dir_on ? 1 : -1;

	edge_log_at_least(log, EDGE_LOG_LOW, log->trail_ns, motor->low_ns);
	edge_log_at_least(log, EDGE_LOG_SETUP, log->dir_ns, motor->setup_ns);
	if (!log->powered)
		edge_log_fault(log, EDGE_LOG_ENABLE, "a step without power");
	else
		edge_log_at_least(log, EDGE_LOG_ENABLE, log->powered_ns,
				  motor->enable_ns);
	/* A step less than 1e9/v, less what may be caught up, after the last one, whatever its direction. */
	if ((log->t_ns - log->lead_ns + motor->catch_ns) * motor->velocity < 1e9)
		edge_log_fault(log, EDGE_LOG_VELOCITY,
			       "%lld ns after a step at %.0f steps/s",
			       (long long)(log->t_ns - log->lead_ns), motor->velocity);
	edge_log_stops(log, direction);

	log->marked += log->t_ns > log->mark_ns;
	log->lead_ns = log->t_ns;
	log->position += direction;
	if (direction > 0)
		log->up++;
	else
		log->down++;
	if (log->position < motor->position_min || log->position > motor->position_max)
		edge_log_fault(log, EDGE_LOG_RANGE, "not within %lld ... %lld",
			       (long long)motor->position_min,
			       (long long)motor->position_max);
	edge_log_remember(log);
	edge_log_accelerate(log);
}

static void edge_log_step(struct edge_log *log, bool on)
{
	if (on) {
		edge_log_lead(log);
	} else {
		edge_log_at_least(log, EDGE_LOG_HIGH, log->lead_ns, log->motor.high_ns);
		log->trail_ns = log->t_ns;
	}
	log->step_on = on;
}

static void edge_log_dir(struct edge_log *log, bool on)
{
	edge_log_at_least(log, EDGE_LOG_HOLD, log->lead_ns, log->motor.hold_ns);
	if (log->step_on)
		edge_log_fault(log, EDGE_LOG_HOLD, "the step is still active");
	log->dir_ns = log->t_ns;
	log->dir_on = on;
}

/* Does an input say now that all is to stop at once? */
static bool edge_log_halted(const struct edge_log *log)
{
	bool halted = false;

	for (int i = 0; i < EDGE_LOG_STOPS; i++)
		halted |= log->stopped[i];
	return halted;
}

static void edge_log_enable(struct edge_log *log, bool on)
{
	if (on) {
		log->powered_ns = log->t_ns;
		/* Begins again, from rest where the steps have come to. */
		log->steps = 0;
		edge_log_remember(log);
	} else if (!edge_log_halted(log)) {
		edge_log_rest(log, log->t_ns);
	}
	log->powered = on;
}

static void edge_log_input(struct edge_log *log, const struct incise_sim_edge *edge)
{
	for (int i = 0; i < EDGE_LOG_STOPS; i++) {
		const struct edge_log_stop *stop = &log->motor.stop[i];

		if (!stop->used || stop->line != edge->line)
			continue;
		log->stopped[i] = edge->value != stop->low;
		log->after_stop[i] = 0;
	}
}

static void edge_log_output(struct edge_log *log, const struct incise_sim_edge *edge)
{
	const struct edge_log_motor *motor = &log->motor;
	bool configured = edge->flags & INCISE_SIM_EDGE_CONFIGURED;
	bool step_on = edge->value != motor->step_low;
	bool dir_on = edge->value != motor->dir_low;
	bool powered = edge->value != motor->enable_low;
	bool same;

	if (edge->line == motor->step) {
		same = step_on == log->step_on;
		if (!same)
			edge_log_step(log, step_on);
	} else if (edge->line == motor->dir) {
		same = dir_on == log->dir_on;
		if (!same)
			edge_log_dir(log, dir_on);
	} else if (edge->line == motor->enable) {
		same = powered == log->powered;
		if (!same)
			edge_log_enable(log, powered);
	} else {
		return;
	}
	log->edges += !same;
	if (same && !configured)
		edge_log_fault(log, EDGE_LOG_REPEAT, "line %u is %u already", edge->line,
			       edge->value);
}

uint64_t edge_log_take(struct edge_log *log, const struct incise_sim_edge *edge, size_t n)
{
	for (; n--; edge++) {
		int64_t before_ns = log->t_ns;
		uint32_t due = log->sequence + 1;

		log->t_ns = edge->t_ns;
		log->sequence = edge->sequence;
		if (log->begun && edge->sequence != due)
			edge_log_fault(log, EDGE_LOG_LOST, "edge %u was due", due);
		log->begun = true;
		if (edge->t_ns < before_ns)
			edge_log_fault(log, EDGE_LOG_ORDER,
				       "%lld ns after the edge before",
				       (long long)(edge->t_ns - before_ns));
		if (edge->flags & INCISE_SIM_EDGE_INPUT)
			edge_log_input(log, edge);
		else
			edge_log_output(log, edge);
	}
	return log->faulty;
}
