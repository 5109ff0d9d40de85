// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Steps from user space; see pulser.h. The plan depends on the state alone: it may be computed
 * at any time, and nothing is done twice.
 */
#include <errno.h>
#include "pulser.h"

#define CATCH_UP 3	/* an interval may be 1/2^3 shorter than the profile's */
#define IDLE_NS 1000000 /* between looks at the inputs without power */

enum next { NEXT_TICK, NEXT_DIR, NEXT_LEAD, NEXT_TRAIL, NEXT_LOOK };

static int64_t later(int64_t a, int64_t b)
{
	return a > b ? a : b;
}

static void power_off(struct incise_pulser *p, int64_t now)
{
	/* No more can be done about a line that cannot be written. */
	if (p->ops->write(p->world, INCISE_PULSER_ENABLE, false) < 0)
		p->motion.status.faults |= INCISE_STEPPER_FAULT_LINE;
	incise_motion_power_off(&p->motion);
	incise_motion_publish(&p->motion, now);
}

/* No further step. If it moved, the rotor may be several steps away. */
static void halt(struct incise_pulser *p, int64_t now)
{
	incise_motion_halt(&p->motion, p->given < p->steps.n || !p->motion.resting);
	p->steps.n = p->given = 0;
	power_off(p, now);
}

static void fault_at(struct incise_pulser *p, uint32_t fault, int64_t now)
{
	if (incise_motion_fault(&p->motion, fault))
		halt(p, now);
}

void incise_pulser_fault(struct incise_pulser *pulser, uint32_t fault)
{
	int64_t now = pulser->ops->now(pulser->world);

	fault_at(pulser, fault, now);
	incise_motion_publish(&pulser->motion, now);
}

/* Returns a time at which the line has changed for sure. */
static int64_t write_line(struct incise_pulser *p, enum incise_pulser_output output,
			  bool active)
{
	int rc = p->ops->write(p->world, output, active);
	int64_t now = p->ops->now(p->world);

	if (rc < 0)
		fault_at(p, INCISE_STEPPER_FAULT_LINE, now);
	return now;
}

/* Whether a way is left: the last step of a motion may end on a limit switch. */
static bool goes_on(const struct incise_pulser *p, int direction)
{
	return p->motion.powered && p->steps.dir == direction &&
	       (p->given < p->steps.n ||
		incise_profile_ahead(&p->motion.profile, direction));
}

static void look_pulser(struct incise_pulser *p, int64_t now)
{
	int inputs = p->ops->inputs(p->world);
	uint32_t rising;

	if (inputs < 0) {
		fault_at(p, INCISE_STEPPER_FAULT_LINE, now);
		return;
	}
	rising = (uint32_t)inputs & ~p->motion.status.inputs;
	p->motion.status.inputs = (uint32_t)inputs;
	if (rising & INCISE_STEPPER_LINE_HOME) {
		p->motion.status.home_position = p->motion.status.position;
		p->motion.status.flags |= INCISE_STEPPER_FLAG_HOME_SEEN;
	}
	fault_at(p, incise_motion_compare(&p->motion, rising & p->home, p->direction),
		 now);
	if (inputs & INCISE_STEPPER_LINE_ESTOP)
		fault_at(p, INCISE_STEPPER_FAULT_ESTOP, now);
	if (inputs & INCISE_STEPPER_LINE_ALARM)
		fault_at(p, INCISE_STEPPER_FAULT_ALARM, now);
	/* Motion away from a limit is allowed. */
	if (inputs & INCISE_STEPPER_LINE_LIMIT_MIN && goes_on(p, -1))
		fault_at(p, INCISE_STEPPER_FAULT_LIMIT_MIN, now);
	if (inputs & INCISE_STEPPER_LINE_LIMIT_MAX && goes_on(p, 1))
		fault_at(p, INCISE_STEPPER_FAULT_LIMIT_MAX, now);
}

/* Returns the next action and its time. @want: the time of that step in the profile. */
static enum next plan(const struct incise_pulser *p, int64_t *due, int64_t *want)
{
	int64_t tick = p->base_ns + p->motion.config.tick_ns;
	int64_t trail = p->lead_ns + p->motion.config.high_ns, gap;
	bool steps = p->given < p->steps.n;

	*want = 0;
	if (p->high && (!p->motion.powered || steps || trail <= tick)) {
		*due = trail;
		return NEXT_TRAIL;
	}
	if (!p->motion.powered) {
		*due = p->base_ns + IDLE_NS;
		return NEXT_LOOK;
	}
	if (!steps) {
		*due = tick;
		return NEXT_TICK;
	}
	*want = p->base_ns + incise_profile_step_ns(&p->steps, p->given);
	if (p->direction != p->steps.dir) {
		*due = later(*want - p->motion.config.setup_ns,
			     later(p->lead_ns + p->motion.config.hold_ns, p->trail_ns));
		return NEXT_DIR;
	}
	/* A delay is caught up a little at a time, and never beyond the limit. */
	gap = *want - p->lead_want_ns;
	gap = later(gap - (gap >> CATCH_UP), p->interval_ns);
	*due = later(later(*want, p->lead_ns + gap),
		     p->trail_ns + p->motion.config.low_ns);
	*due = later(later(*due, p->dir_ns + p->motion.config.setup_ns), p->powered_ns);
	return NEXT_LEAD;
}

static void note_late(struct incise_pulser *p, int64_t late_ns, uint32_t shortest_ns,
		      int64_t now)
{
	if (late_ns <= shortest_ns) {
		p->late_row = 0;
		return;
	}
	p->motion.status.late++;
	if (++p->late_row >= p->motion.config.late_max)
		fault_at(p, INCISE_STEPPER_FAULT_LATE, now);
}

static void lead(struct incise_pulser *p, int64_t due, int64_t want)
{
	int64_t now = p->ops->now(p->world), lag;

	/* The last check of the inputs before this step. */
	look_pulser(p, now);
	if (!p->motion.powered)
		return;
	p->given++;
	p->high = true;
	p->motion.status.position += p->steps.dir;
	if (p->steps.dir > 0)
		p->motion.status.steps_up++;
	else
		p->motion.status.steps_down++;
	p->lead_ns = write_line(p, INCISE_PULSER_STEP, true);
	p->lead_want_ns = want;
	lag = p->lead_ns - want;
	if (lag > p->motion.config.tick_ns) {
		p->base_ns += lag;
		p->lead_want_ns += lag;
		p->motion.status.shifted_ns += (uint64_t)lag;
	}
	note_late(p, now - due, p->motion.config.low_ns, p->lead_ns);
}

static void trail(struct incise_pulser *p, int64_t now, int64_t due)
{
	p->high = false;
	p->trail_ns = write_line(p, INCISE_PULSER_STEP, false);
	if (p->motion.powered)
		note_late(p, now - due, p->motion.config.high_ns, p->trail_ns);
}

static void set_direction(struct incise_pulser *p)
{
	bool invert = p->motion.config.flags & INCISE_STEPPER_CONFIG_INVERT;

	p->direction = p->steps.dir;
	p->dir_ns = write_line(p, INCISE_PULSER_DIR, (p->steps.dir > 0) != invert);
}

static void tick(struct incise_pulser *p, int64_t now, int64_t due)
{
	struct incise_motion *m = &p->motion;

	look_pulser(p, now);
	if (m->powered)
		fault_at(p, incise_motion_listen(m, now), now);
	if (!m->powered)
		return;
	m->resting = incise_profile_resting(&m->profile);
	if (m->resting && m->ending) {
		power_off(p, now);
		return;
	}
	p->base_ns = due;
	if (now - due > m->config.tick_ns) {
		p->base_ns = now;
		if (!m->resting)
			m->status.shifted_ns += (uint64_t)(now - due);
	}
	incise_profile_tick(&m->profile, &p->steps);
	p->given = 0;
	incise_motion_ticked(m);
	incise_motion_publish(m, now);
}

/* The motor has stood since then: no step of the profile before follows. */
static void stood_still(struct incise_pulser *p, uint32_t fault, int64_t now)
{
	incise_motion_halt(&p->motion, p->given < p->steps.n || !p->motion.resting);
	p->steps.n = p->given = 0;
	fault_at(p, fault, now);
	incise_motion_publish(&p->motion, now);
}

int64_t incise_pulser_run(struct incise_pulser *p)
{
	int64_t due, want, now = p->ops->now(p->world);
	uint32_t fault = incise_motion_awake(&p->motion, now);
	enum next next;

	if (fault)
		stood_still(p, fault, now);
	next = plan(p, &due, &want);

	if (due > now)
		return due;
	switch (next) {
	case NEXT_TICK:
		tick(p, now, due);
		break;
	case NEXT_DIR:
		set_direction(p);
		break;
	case NEXT_LEAD:
		lead(p, due, want);
		break;
	case NEXT_TRAIL:
		trail(p, now, due);
		break;
	case NEXT_LOOK:
		look_pulser(p, now);
		p->base_ns = now;
		incise_motion_publish(&p->motion, now);
		break;
	}
	plan(p, &due, &want);
	return due;
}

int incise_pulser_init(struct incise_pulser *p,
		       const struct incise_stepper_config *config)
{
	int64_t now = p->ops->now(p->world);
	int rc = incise_motion_init(&p->motion, config);

	if (rc)
		return rc;
	p->interval_ns = (1000000000 + config->velocity - 1) / config->velocity;
	p->base_ns = now;
	/* Long enough ago for all shortest times. */
	p->lead_ns = p->trail_ns = p->dir_ns = p->lead_want_ns = now - 1000000000;
	look_pulser(p, now);
	power_off(p, now);
	return p->motion.status.faults ? -EIO : 0;
}

int incise_pulser_enable(struct incise_pulser *p)
{
	struct incise_motion *m = &p->motion;
	int64_t now = p->ops->now(p->world);
	int rc;

	look_pulser(p, now);
	rc = incise_motion_power_on(m, now);
	if (rc <= 0)
		return rc;
	p->late_row = 0;
	p->steps.n = p->given = 0;
	now = write_line(p, INCISE_PULSER_ENABLE, true);
	m->seen_ns = m->ran_ns = p->base_ns = now;
	p->powered_ns = now + (int64_t)m->config.enable_ns;
	incise_motion_publish(m, now);
	return m->powered ? 0 : -EIO;
}

void incise_pulser_disable(struct incise_pulser *p)
{
	if (p->motion.powered)
		incise_motion_brake(&p->motion, 0);
	incise_motion_publish(&p->motion, p->ops->now(p->world));
}

int incise_pulser_clear(struct incise_pulser *p)
{
	int64_t now = p->ops->now(p->world);
	int rc;

	look_pulser(p, now);
	rc = incise_motion_clear(&p->motion);
	incise_motion_publish(&p->motion, now);
	return rc;
}

int incise_pulser_origin(struct incise_pulser *p, int32_t steps, bool homed)
{
	int rc = incise_motion_origin(&p->motion, steps, homed);

	incise_motion_publish(&p->motion, p->ops->now(p->world));
	return rc;
}
