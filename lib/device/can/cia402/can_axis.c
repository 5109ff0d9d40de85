// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * One drive, cycle by cycle; see axis.h.
 */
#include <errno.h>
#include "can_axis_cycle.h"

#define MS 1000000LL
#define OBEY_NS (20 * MS) /* from a quick stop to its beginning */

/*
 * Heartbeats keep the drive from stopping by itself. With power they answer for set-points
 * that really go out, and for no less; and a drive that is to stop, and does not say that it
 * does, is left to its own watch.
 */
static bool may_beat(const struct can_axis *axis, bool powered, int64_t now)
{
	bool obeys = cia402_state(axis->statusword) != CIA402_ENABLED ||
		     now - axis->since_ns < OBEY_NS;

	if (axis->mute)
		return false;
	if (axis->phase == CAN_AXIS_QUICK_STOP &&
	    !(obeys && can_axis_is_fresh(axis, now)))
		return false;
	return !powered || axis->put;
}

void can_axis_cycle(struct can_axis *axis, int64_t now_ns, int64_t late_ns,
		    uint32_t left_out)
{
	struct incise_motion *m = &axis->motion;
	bool powered = m->powered;

	axis->put = axis->came = false;
	can_axis_hear(axis, now_ns);
	axis->answers += axis->came;
	/* A time in which the drive did live. */
	axis->inputs_ns += axis->came ? axis->setup.config.tick_ns : 0;
	axis->missed = axis->answered ? 0 : axis->missed + 1;
	if (powered) {
		axis->counts.sync_late +=
			left_out + (2 * late_ns > (int64_t)axis->setup.config.tick_ns);
		axis->counts.tpdo_missing += !axis->answered;
		can_axis_check_drive(axis, now_ns);
	}
	if (axis->phase == CAN_AXIS_RUNNING || axis->phase == CAN_AXIS_HOMING)
		can_axis_check_running(axis, now_ns);
	switch (axis->phase) {
	case CAN_AXIS_IDLE:
		can_axis_idle(axis);
		break;
	case CAN_AXIS_STARTING:
		can_axis_start(axis, now_ns);
		break;
	case CAN_AXIS_RUNNING:
		can_axis_run(axis, now_ns);
		break;
	case CAN_AXIS_HOMING:
		can_axis_home(axis, now_ns);
		break;
	case CAN_AXIS_ENDING:
	case CAN_AXIS_QUICK_STOP:
		break;
	}
	/* Also when the phase began in this cycle: no stop waits for the next. */
	if (axis->phase == CAN_AXIS_ENDING)
		can_axis_end(axis, now_ns);
	else if (axis->phase == CAN_AXIS_QUICK_STOP)
		can_axis_quick_stop(axis, now_ns);
	can_axis_sync(axis, now_ns);
	if (may_beat(axis, powered, now_ns))
		canopen_send_heartbeat(axis->master, now_ns);
	m->status.late = axis->counts.sync_late;
	incise_motion_publish(m, now_ns);
}

int can_axis_init(struct can_axis *axis, const struct can_axis_setup *setup)
{
	int rc = incise_motion_init(&axis->motion, &setup->config);

	axis->setup = *setup;
	axis->answered = true;
	return rc;
}

int can_axis_power(struct can_axis *axis, int64_t now_ns, int64_t homing_ns)
{
	struct incise_motion *m = &axis->motion;
	const struct canopen *master = axis->master;
	int rc;

	if (!homing_ns && !can_axis_within(axis))
		return -ERANGE;
	rc = incise_motion_power_on(m, now_ns);
	if (rc <= 0)
		return rc;
	axis->why = CAN_AXIS_NO_REASON;
	axis->boots = master->boots;
	axis->emcys = master->emcy.count;
	axis->bus_offs = master->bus_offs;
	axis->foreign = master->foreign;
	axis->full = 0;
	axis->off_ns = 0;
	axis->speed = 0;
	axis->stop_homing = axis->failed = axis->mute = false;
	axis->missed = 0;
	/* Until it has homed again. */
	if (homing_ns)
		m->status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	axis->answered = true;
	axis->tpdo_ns = now_ns;
	axis->inputs_ns = 0;
	axis->limit_ns = homing_ns ? now_ns + homing_ns : 0;
	axis->result = 1;
	axis->outcome = -EIO;
	can_axis_enter(axis, CAN_AXIS_STARTING, now_ns);
	return 1;
}

void can_axis_cleared(struct can_axis *axis)
{
	axis->why = CAN_AXIS_NO_REASON;
	axis->mute = false;
	axis->answers = 0;
}

void can_axis_disable(struct can_axis *axis)
{
	struct incise_motion *m = &axis->motion;

	if (!m->powered || m->ending)
		return;
	switch (axis->phase) {
	case CAN_AXIS_HOMING:
		axis->stop_homing = true;
		break;
	case CAN_AXIS_STARTING:
		axis->outcome = -EINTR;
		m->ending = true;
		can_axis_enter(axis, CAN_AXIS_QUICK_STOP, axis->since_ns);
		break;
	default:
		incise_motion_brake(m, 0);
	}
}
