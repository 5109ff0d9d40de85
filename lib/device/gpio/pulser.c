// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Steps from user space; see pulser.h. All is planned from the state alone, so that it
 * may be asked at any time what is due next, and nothing is done twice.
 */
#include <errno.h>
#include <stddef.h>
#include "../page.h"
#include "pulser.h"

#define CATCH_UP 3	/* an interval may be 1/2^3 shorter than the profile's */
#define IDLE_NS 1000000 /* between looks at the inputs without power */

#define AT_ONCE                                                            \
	(INCISE_STEPPER_FAULT_LIMIT_MIN | INCISE_STEPPER_FAULT_LIMIT_MAX | \
	 INCISE_STEPPER_FAULT_ESTOP | INCISE_STEPPER_FAULT_DRIVER |        \
	 INCISE_STEPPER_FAULT_LATE | INCISE_STEPPER_FAULT_LINE)
#define RETRACTS (INCISE_STEPPER_FAULT_DEADMAN | INCISE_STEPPER_FAULT_OWNER)
#define FORBIDS (INCISE_STEPPER_LINE_ESTOP | INCISE_STEPPER_LINE_DRIVER)

enum next { NEXT_TICK, NEXT_DIR, NEXT_LEAD, NEXT_TRAIL, NEXT_LOOK };

static int64_t later(int64_t a, int64_t b)
{
	return a > b ? a : b;
}

static void publish(struct incise_pulser *p, int64_t now)
{
	p->status.t_ns = now;
	p->status.velocity = p->powered ? incise_profile_velocity(&p->profile) : 0;
	incise_page_put_status(p->slot, &p->status);
}

static void power_off(struct incise_pulser *p, int64_t now)
{
	p->powered = p->ending = false;
	/* There is nothing left to do about a line that cannot be written. */
	if (p->door->write(p->world, INCISE_PULSER_ENABLE, false) < 0)
		p->status.faults |= INCISE_STEPPER_FAULT_LINE;
	p->status.state = p->status.faults ? INCISE_STEPPER_STATE_FAULT
					   : INCISE_STEPPER_STATE_DISABLED;
	publish(p, now);
}

/* No further step. Where it moved, the rotor may be anywhere near. */
static void halt(struct incise_pulser *p, int64_t now)
{
	if (p->given < p->steps.n || !p->resting)
		p->status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	p->steps.n = p->given = 0;
	incise_profile_halt(&p->profile, (int32_t)p->status.position);
	p->resting = true;
	p->status.target = p->status.position;
	power_off(p, now);
}

/* Come to rest within the limits, then without power. */
static void brake(struct incise_pulser *p, uint32_t fault)
{
	if (p->ending)
		return;
	p->ending = true;
	if (fault & RETRACTS && p->config.flags & INCISE_STEPPER_CONFIG_RETRACT &&
	    p->status.flags & INCISE_STEPPER_FLAG_HOMED)
		p->status.target = incise_profile_target(
			&p->profile, INCISE_PROFILE_POSITION, p->config.safe_position);
	else
		incise_profile_stop(&p->profile);
	p->resting = false;
	p->status.state = INCISE_STEPPER_STATE_STOPPING;
}

static void fault_at(struct incise_pulser *p, uint32_t fault, int64_t now)
{
	if (!p->powered)
		return;
	p->status.faults |= fault;
	if (fault & AT_ONCE)
		halt(p, now);
	else
		brake(p, fault);
}

void incise_pulser_fault(struct incise_pulser *pulser, uint32_t fault)
{
	int64_t now = pulser->door->now(pulser->world);

	fault_at(pulser, fault, now);
	publish(pulser, now);
}

/* Returns when the line has changed for sure. */
static int64_t write_line(struct incise_pulser *p, enum incise_pulser_output output,
			  bool active)
{
	int rc = p->door->write(p->world, output, active);
	int64_t now = p->door->now(p->world);

	if (rc < 0)
		fault_at(p, INCISE_STEPPER_FAULT_LINE, now);
	return now;
}

static void look(struct incise_pulser *p, int64_t now)
{
	bool moves = p->powered && (p->given < p->steps.n || !p->resting);
	int inputs = p->door->inputs(p->world);
	uint32_t came;

	if (inputs < 0) {
		fault_at(p, INCISE_STEPPER_FAULT_LINE, now);
		return;
	}
	came = (uint32_t)inputs & ~p->status.inputs;
	p->status.inputs = (uint32_t)inputs;
	if (came & INCISE_STEPPER_LINE_HOME) {
		p->status.home_position = p->status.position;
		p->status.flags |= INCISE_STEPPER_FLAG_HOME_SEEN;
	}
	if (inputs & INCISE_STEPPER_LINE_ESTOP)
		fault_at(p, INCISE_STEPPER_FAULT_ESTOP, now);
	if (inputs & INCISE_STEPPER_LINE_DRIVER)
		fault_at(p, INCISE_STEPPER_FAULT_DRIVER, now);
	/* Away from a limit it may go. */
	if (moves && inputs & INCISE_STEPPER_LINE_LIMIT_MIN && p->steps.dir < 0)
		fault_at(p, INCISE_STEPPER_FAULT_LIMIT_MIN, now);
	if (moves && inputs & INCISE_STEPPER_LINE_LIMIT_MAX && p->steps.dir > 0)
		fault_at(p, INCISE_STEPPER_FAULT_LIMIT_MAX, now);
}

/* What is due next, and when. @want: that step by the profile. */
static enum next plan(const struct incise_pulser *p, int64_t *due, int64_t *want)
{
	int64_t tick = p->base_ns + p->config.tick_ns;
	int64_t trail = p->lead_ns + p->config.high_ns, gap;
	bool steps = p->given < p->steps.n;

	*want = 0;
	if (p->high && (!p->powered || steps || trail <= tick)) {
		*due = trail;
		return NEXT_TRAIL;
	}
	if (!p->powered) {
		*due = p->base_ns + IDLE_NS;
		return NEXT_LOOK;
	}
	if (!steps) {
		*due = tick;
		return NEXT_TICK;
	}
	*want = p->base_ns + incise_profile_step_ns(&p->steps, p->given);
	if (p->direction != p->steps.dir) {
		*due = later(*want - p->config.setup_ns,
			     later(p->lead_ns + p->config.hold_ns, p->trail_ns));
		return NEXT_DIR;
	}
	/* What was lost is caught up a little at a time, and never beyond the limit. */
	gap = *want - p->lead_want_ns;
	gap = later(gap - (gap >> CATCH_UP), p->interval_ns);
	*due = later(later(*want, p->lead_ns + gap), p->trail_ns + p->config.low_ns);
	*due = later(later(*due, p->dir_ns + p->config.setup_ns), p->powered_ns);
	return NEXT_LEAD;
}

static void note_late(struct incise_pulser *p, int64_t late_ns, uint32_t shortest_ns,
		      int64_t now)
{
	if (late_ns <= shortest_ns) {
		p->late_row = 0;
		return;
	}
	p->status.late++;
	if (++p->late_row >= p->config.late_max)
		fault_at(p, INCISE_STEPPER_FAULT_LATE, now);
}

static void lead(struct incise_pulser *p, int64_t due, int64_t want)
{
	int64_t now = p->door->now(p->world), lag;

	/* The last look at what forbids this step. */
	look(p, now);
	if (!p->powered)
		return;
	p->given++;
	p->high = true;
	p->status.position += p->steps.dir;
	if (p->steps.dir > 0)
		p->status.steps_up++;
	else
		p->status.steps_down++;
	p->lead_ns = write_line(p, INCISE_PULSER_STEP, true);
	p->lead_want_ns = want;
	lag = p->lead_ns - want;
	if (lag > p->config.tick_ns) {
		p->base_ns += lag;
		p->lead_want_ns += lag;
		p->status.shifted_ns += (uint64_t)lag;
	}
	note_late(p, now - due, p->config.low_ns, p->lead_ns);
}

static void trail(struct incise_pulser *p, int64_t now, int64_t due)
{
	p->high = false;
	p->trail_ns = write_line(p, INCISE_PULSER_STEP, false);
	if (p->powered)
		note_late(p, now - due, p->config.high_ns, p->trail_ns);
}

static void set_direction(struct incise_pulser *p)
{
	bool invert = p->config.flags & INCISE_STEPPER_CONFIG_INVERT;

	p->direction = p->steps.dir;
	p->dir_ns = write_line(p, INCISE_PULSER_DIR, (p->steps.dir > 0) != invert);
}

/* A new set-point, if there is one and it is still asked for. */
static void listen(struct incise_pulser *p, int64_t now)
{
	int taken;

	if (p->ending)
		return;
	taken = incise_page_get_setpoint(p->setpoint, &p->seq, &p->wish);
	if (taken < 0)
		fault_at(p, INCISE_STEPPER_FAULT_SETPOINT, now);
	if (taken > 0) {
		p->seen_ns = now;
		p->status.target =
			incise_profile_target(&p->profile,
					      p->wish.mode == INCISE_STEPPER_MODE_VELOCITY
						      ? INCISE_PROFILE_VELOCITY
						      : INCISE_PROFILE_POSITION,
					      p->wish.target);
		p->resting = false;
		p->status.flags &= ~INCISE_STEPPER_FLAG_HELD;
		if (p->status.target != p->wish.target)
			p->status.flags |= INCISE_STEPPER_FLAG_HELD;
		p->status.setpoint_t_ns = p->wish.t_ns;
		p->status.setpoint_seq = p->seq;
	}
	if (now - p->seen_ns > (int64_t)p->config.deadman_ns)
		fault_at(p, INCISE_STEPPER_FAULT_DEADMAN, now);
}

static void tick(struct incise_pulser *p, int64_t now, int64_t due)
{
	look(p, now);
	if (p->powered)
		listen(p, now);
	if (!p->powered)
		return;
	p->resting = incise_profile_resting(&p->profile);
	if (p->resting && p->ending) {
		power_off(p, now);
		return;
	}
	p->base_ns = due;
	if (now - due > p->config.tick_ns) {
		p->base_ns = now;
		if (!p->resting)
			p->status.shifted_ns += (uint64_t)(now - due);
	}
	incise_profile_tick(&p->profile, &p->steps);
	p->given = 0;
	p->resting = incise_profile_resting(&p->profile);
	if (!p->ending)
		p->status.state = p->resting ? INCISE_STEPPER_STATE_READY
					     : INCISE_STEPPER_STATE_MOVING;
	publish(p, now);
}

int64_t incise_pulser_run(struct incise_pulser *p)
{
	int64_t due, want, now = p->door->now(p->world);
	enum next next = plan(p, &due, &want);

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
		look(p, now);
		p->base_ns = now;
		publish(p, now);
		break;
	}
	plan(p, &due, &want);
	return due;
}

int incise_pulser_init(struct incise_pulser *p,
		       const struct incise_stepper_config *config)
{
	const struct incise_profile_limits limits = {
		.tick_ns = config->tick_ns,
		.velocity = config->velocity,
		.acceleration = config->acceleration,
		.position_min = (int32_t)config->position_min,
		.position_max = (int32_t)config->position_max,
		.jerk = config->jerk,
	};
	int64_t now = p->door->now(p->world);
	int rc = incise_profile_init(&p->profile, &limits, 0);

	if (rc)
		return rc;
	p->config = *config;
	p->interval_ns = (1000000000 + config->velocity - 1) / config->velocity;
	p->base_ns = now;
	/* Long enough ago for all shortest times. */
	p->lead_ns = p->trail_ns = p->dir_ns = p->lead_want_ns = now - 1000000000;
	p->resting = true;
	look(p, now);
	power_off(p, now);
	return p->status.faults ? -EIO : 0;
}

int incise_pulser_enable(struct incise_pulser *p)
{
	int64_t now = p->door->now(p->world);

	look(p, now);
	if (p->status.faults)
		return -EPERM;
	if (p->status.inputs & FORBIDS)
		return -EBUSY;
	if (p->powered)
		return p->ending ? -EBUSY : 0;
	p->powered = true;
	p->late_row = 0;
	p->steps.n = p->given = 0;
	incise_profile_halt(&p->profile, (int32_t)p->status.position);
	p->resting = true;
	p->seq = __atomic_load_n(&p->setpoint->seq, __ATOMIC_ACQUIRE);
	p->status.target = p->status.position;
	p->status.state = INCISE_STEPPER_STATE_READY;
	p->status.flags &= ~(INCISE_STEPPER_FLAG_HOME_SEEN | INCISE_STEPPER_FLAG_HELD);
	now = write_line(p, INCISE_PULSER_ENABLE, true);
	p->seen_ns = p->base_ns = now;
	p->powered_ns = now + (int64_t)p->config.enable_ns;
	publish(p, now);
	return p->powered ? 0 : -EIO;
}

void incise_pulser_disable(struct incise_pulser *p)
{
	if (p->powered)
		brake(p, 0);
	publish(p, p->door->now(p->world));
}

int incise_pulser_clear(struct incise_pulser *p)
{
	int64_t now = p->door->now(p->world);

	look(p, now);
	if (p->status.inputs & FORBIDS && p->status.faults)
		return -EBUSY;
	if (p->powered)
		return p->status.faults ? -EBUSY : 0;
	p->status.faults = 0;
	p->status.state = INCISE_STEPPER_STATE_DISABLED;
	publish(p, now);
	return 0;
}

int incise_pulser_origin(struct incise_pulser *p, int32_t steps, bool homed)
{
	if (p->powered && (!p->resting || p->ending))
		return -EBUSY;
	if (steps < p->config.position_min || steps > p->config.position_max)
		return -EINVAL;
	p->status.position = p->status.target = steps;
	incise_profile_halt(&p->profile, steps);
	p->status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	if (homed)
		p->status.flags |= INCISE_STEPPER_FLAG_HOMED;
	publish(p, p->door->now(p->world));
	return 0;
}
