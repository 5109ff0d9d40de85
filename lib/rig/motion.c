// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A motor that follows set-points; see motion.h.
 */
#include <errno.h>
#include "motion.h"
#include "page.h"

#define RETRACTS (INCISE_STEPPER_FAULT_DEADMAN | INCISE_STEPPER_FAULT_OWNER)
/* The power stage loses its supply, and the rotor may turn unseen; or it is elsewhere already. */
#define UNHOME                                                     \
	(INCISE_STEPPER_FAULT_ESTOP | INCISE_STEPPER_FAULT_ALARM | \
	 INCISE_STEPPER_FAULT_STEPS)
#define FORBIDS (INCISE_STEPPER_LINE_ESTOP | INCISE_STEPPER_LINE_ALARM)

int incise_motion_init(struct incise_motion *m,
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
	int rc = incise_profile_init(&m->profile, &limits, 0);

	if (rc)
		return rc;
	m->config = *config;
	m->resting = true;
	return 0;
}

void incise_motion_publish(struct incise_motion *m, int64_t now_ns)
{
	m->status.t_ns = now_ns;
	m->status.velocity = m->powered ? incise_profile_velocity(&m->profile) : 0;
	incise_page_put_status(m->slot, &m->status);
}

int incise_motion_power_on(struct incise_motion *m, int64_t now_ns)
{
	if (m->status.faults)
		return -EPERM;
	if (m->status.inputs & FORBIDS)
		return -EBUSY;
	if (m->powered)
		return m->ending ? -EBUSY : 0;
	m->powered = true;
	incise_motion_halt(m, false);
	m->seq = __atomic_load_n(&m->setpoint->seq, __ATOMIC_ACQUIRE);
	m->seen_ns = m->ran_ns = now_ns;
	m->status.state = INCISE_STEPPER_STATE_READY;
	m->status.flags &= ~(INCISE_STEPPER_FLAG_HOME_SEEN | INCISE_STEPPER_FLAG_HELD);
	return 1;
}

void incise_motion_power_off(struct incise_motion *m)
{
	m->powered = m->ending = false;
	if (m->config.flags & INCISE_STEPPER_CONFIG_VOLATILE_HOME)
		m->status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	m->status.state = m->status.faults ? INCISE_STEPPER_STATE_FAULT
					   : INCISE_STEPPER_STATE_DISABLED;
}

void incise_motion_halt(struct incise_motion *m, bool moved)
{
	if (moved)
		m->status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	incise_profile_halt(&m->profile, (int32_t)m->status.position);
	m->resting = true;
	m->status.target = m->status.position;
}

void incise_motion_brake(struct incise_motion *m, uint32_t fault)
{
	if (m->ending)
		return;
	m->ending = true;
	if (fault & RETRACTS && m->config.flags & INCISE_STEPPER_CONFIG_RETRACT &&
	    m->status.flags & INCISE_STEPPER_FLAG_HOMED)
		m->status.target = incise_profile_target(
			&m->profile, INCISE_PROFILE_POSITION, m->config.safe_position);
	else
		incise_profile_stop(&m->profile);
	m->resting = false;
	m->status.state = INCISE_STEPPER_STATE_STOPPING;
}

bool incise_motion_fault(struct incise_motion *m, uint32_t fault)
{
	if (fault & UNHOME)
		m->status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	if (!m->powered || !fault)
		return false;
	m->status.faults |= fault;
	if (fault & INCISE_MOTION_AT_ONCE)
		return true;
	incise_motion_brake(m, fault);
	return false;
}

/* Follow the latest set-point. */
static void obey(struct incise_motion *m)
{
	enum incise_profile_mode mode = m->latest.mode == INCISE_STEPPER_MODE_VELOCITY
						? INCISE_PROFILE_VELOCITY
						: INCISE_PROFILE_POSITION;

	m->status.target = incise_profile_target(&m->profile, mode, m->latest.target);
	m->resting = false;
	m->status.flags &= ~INCISE_STEPPER_FLAG_HELD;
	if (m->status.target != m->latest.target)
		m->status.flags |= INCISE_STEPPER_FLAG_HELD;
	m->status.setpoint_t_ns = m->latest.t_ns;
	m->status.setpoint_seq = m->seq;
}

uint32_t incise_motion_awake(struct incise_motion *m, int64_t now_ns)
{
	/* A tick is the usual time. */
	int64_t still_ns = now_ns - m->ran_ns - m->config.tick_ns;

	m->ran_ns = now_ns;
	return m->powered && still_ns > (int64_t)m->config.deadman_ns
		       ? INCISE_STEPPER_FAULT_DEADMAN
		       : 0;
}

uint32_t incise_motion_listen(struct incise_motion *m, int64_t now_ns)
{
	int taken;

	if (m->ending)
		return 0;
	taken = incise_page_get_setpoint(m->setpoint, &m->seq, &m->latest);
	if (taken < 0)
		return INCISE_STEPPER_FAULT_SETPOINT;
	if (taken > 0) {
		m->seen_ns = now_ns;
		obey(m);
	}
	return now_ns - m->seen_ns > (int64_t)m->config.deadman_ns
		       ? INCISE_STEPPER_FAULT_DEADMAN
		       : 0;
}

uint32_t incise_motion_compare(struct incise_motion *m, bool passed, int32_t direction)
{
	bool lost = m->powered &&
		    incise_home_edge_look(&m->edge,
					  m->status.flags & INCISE_STEPPER_FLAG_HOMED,
					  passed && direction, m->status.position,
					  direction, (int64_t)m->config.lost_steps_max);

	m->status.lost_steps = m->edge.lost;
	return lost ? INCISE_STEPPER_FAULT_STEPS : 0;
}

void incise_motion_ticked(struct incise_motion *m)
{
	m->resting = incise_profile_resting(&m->profile);
	if (!m->ending)
		m->status.state = m->resting ? INCISE_STEPPER_STATE_READY
					     : INCISE_STEPPER_STATE_MOVING;
}

int incise_motion_clear(struct incise_motion *m)
{
	if (m->status.inputs & FORBIDS && m->status.faults)
		return -EBUSY;
	if (m->powered)
		return m->status.faults ? -EBUSY : 0;
	m->status.faults = 0;
	m->status.state = INCISE_STEPPER_STATE_DISABLED;
	return 0;
}

int incise_motion_origin(struct incise_motion *m, int32_t steps, bool homed)
{
	if (m->powered && (!m->resting || m->ending))
		return -EBUSY;
	if (steps < m->config.position_min || steps > m->config.position_max)
		return -EINVAL;
	incise_home_edge_rename(&m->edge, steps - m->status.position, homed);
	m->status.lost_steps = m->edge.lost;
	m->status.position = steps;
	incise_motion_halt(m, true);
	if (homed)
		m->status.flags |= INCISE_STEPPER_FLAG_HOMED;
	return 0;
}
