/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A screw with switches behind three lines, and a clock that only moves when a test moves it:
 * the world of a pulser in tests. It counts what a motor would do, and holds every edge
 * against the shortest times.
 */
#ifndef INCISE_TEST_MACHINE_H
#define INCISE_TEST_MACHINE_H

#include <stdbool.h>
#include <stdint.h>
#include "../../../lib/device/gpio/pulser.h"

#define MACHINE_HOME 40 /* steps; up to there the home input is active */

struct machine {
	int64_t now_ns;
	int64_t look_ns; /* what a look at the clock takes */
	bool invert;	 /* the dir line's sense */
	bool step, dir, enable;
	int64_t at;  /* steps; the switch at 0 is active below 0 */
	int64_t end; /* the other switch is active above this */
	bool wired_home, wired_limits;
	unsigned int forced; /* INCISE_STEPPER_LINE_… that are active anyhow */
	int write_error;     /* negative errno of the lines, or 0 */

	/* evidence */
	const struct incise_stepper_config *config;
	int64_t lead_ns, trail_ns, dir_ns, enable_ns;
	uint64_t steps, too_short, unpowered, into_limit;
};

static inline unsigned int machine_switches(const struct machine *m)
{
	unsigned int on = m->forced;

	if (m->wired_home && m->at <= MACHINE_HOME)
		on |= INCISE_STEPPER_LINE_HOME;
	if (m->wired_limits && m->at < 0)
		on |= INCISE_STEPPER_LINE_LIMIT_MIN;
	if (m->wired_limits && m->at > m->end)
		on |= INCISE_STEPPER_LINE_LIMIT_MAX;
	return on;
}

static inline int64_t machine_now(void *world)
{
	struct machine *m = world;

	return m->now_ns += m->look_ns;
}

static inline void machine_step(struct machine *m, bool active)
{
	const struct incise_stepper_config *c = m->config;
	unsigned int ahead = m->dir != m->invert ? INCISE_STEPPER_LINE_LIMIT_MAX
						 : INCISE_STEPPER_LINE_LIMIT_MIN;

	if (!active) {
		m->too_short += m->step && m->now_ns - m->lead_ns < c->high_ns;
		m->trail_ns = m->now_ns;
		return;
	}
	m->too_short += m->now_ns - m->trail_ns < c->low_ns ||
			m->now_ns - m->dir_ns < c->setup_ns ||
			m->now_ns - m->enable_ns < (int64_t)c->enable_ns;
	m->unpowered += !m->enable;
	m->into_limit += !!(machine_switches(m) & ahead);
	m->lead_ns = m->now_ns;
	m->steps++;
	m->at += m->dir != m->invert ? 1 : -1;
}

static inline int machine_write(void *world, enum incise_pulser_output output,
				bool active)
{
	struct machine *m = world;

	if (m->write_error)
		return m->write_error;
	switch (output) {
	case INCISE_PULSER_STEP:
		if (active != m->step)
			machine_step(m, active);
		m->step = active;
		break;
	case INCISE_PULSER_DIR:
		m->too_short += m->now_ns - m->lead_ns < m->config->hold_ns || m->step;
		m->dir = active;
		m->dir_ns = m->now_ns;
		break;
	case INCISE_PULSER_ENABLE:
		if (active && !m->enable)
			m->enable_ns = m->now_ns;
		m->enable = active;
		break;
	}
	return 0;
}

static inline int machine_inputs(void *world)
{
	return (int)machine_switches(world);
}

static const struct incise_pulser_ops machine_ops = {machine_now, machine_write,
						     machine_inputs};

#endif
