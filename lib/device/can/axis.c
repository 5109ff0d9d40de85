// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * One drive, cycle by cycle; see axis.h.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "axis_check.h"

#define MS 1000000LL
#define FRAMES 64	       /* taken in a cycle: more than a bus carries in 2 ms */
#define START_NS (500 * MS)    /* from no power to operation enabled */
#define END_NS (200 * MS)      /* from shutdown to no power */
#define QUICK_NS (1000 * MS)   /* a quick stop beside that */
#define OBEY_NS (20 * MS)      /* from a quick stop to its beginning */
#define FULL_MOST 5	       /* set-points in a row that may not get out */
#define PICKED_UP_NS (50 * MS) /* a drive has taken the start of homing by then */
#define STALE_CYCLES 3	       /* without an answer: no loop is closed over that */
#define SMOOTH 0.25	       /* of a new speed, in its average */
#define ONE 4294967296.0       /* a step, in a profile's units */

int64_t can_axis_steps(const struct can_axis *axis, int32_t counts)
{
	double steps = (counts - axis->zero_counts) / axis->setup.counts_per_step;
	const double most = 2.0 * INCISE_PROFILE_POSITION_MAX;

	/* What a drive says may be anything. */
	return llround(fmax(-most, fmin(most, steps)));
}

static void enter(struct can_axis *axis, enum can_axis_phase phase, int64_t now)
{
	axis->phase = phase;
	axis->since_ns = now;
	axis->told = false;
	axis->answers = 0;
}

/* The first reason stays: the others follow from it. */
static void note(struct can_axis *axis, enum can_axis_why why, int64_t a, int64_t b)
{
	if (axis->why != CAN_AXIS_NO_REASON)
		return;
	axis->why_a = a;
	axis->why_b = b;
	axis->why = why;
}

void can_axis_fault(struct can_axis *axis, uint32_t bits, enum can_axis_why why,
		    int64_t a, int64_t b, int64_t now)
{
	struct incise_motion *m = &axis->motion;

	if (!m->powered)
		return;
	if (!m->status.faults)
		note(axis, why, a, b);
	if (axis->phase == CAN_AXIS_QUICK_STOP) {
		m->status.faults |= bits;
		return;
	}
	/*
	 * There is no profile to brake by yet, or none at all; and amid another's set-points
	 * ours are none.
	 */
	if (incise_motion_fault(m, bits) || why == CAN_AXIS_FOREIGN ||
	    axis->phase == CAN_AXIS_STARTING || axis->phase == CAN_AXIS_HOMING) {
		m->ending = true;
		m->status.state = INCISE_STEPPER_STATE_STOPPING;
		enter(axis, CAN_AXIS_QUICK_STOP, now);
	}
}

static void power_off(struct can_axis *axis, int64_t now)
{
	struct incise_motion *m = &axis->motion;

	incise_motion_halt(m, m->status.faults & INCISE_ABI_FAULT_LOST);
	incise_motion_power_off(m);
	if (axis->result > 0)
		axis->result = axis->outcome;
	enter(axis, CAN_AXIS_IDLE, now);
}

/* What the drive's inputs are to us. */
static unsigned int line_bits(const struct can_axis *axis, uint32_t inputs)
{
	/* Turned round, the drive's lower end is our upper one. */
	bool turned = axis->setup.counts_per_step < 0;
	unsigned int bits = 0;

	if (inputs & CIA402_AT_MIN)
		bits |= turned ? INCISE_STEPPER_LINE_LIMIT_MAX
			       : INCISE_STEPPER_LINE_LIMIT_MIN;
	if (inputs & CIA402_AT_MAX)
		bits |= turned ? INCISE_STEPPER_LINE_LIMIT_MIN
			       : INCISE_STEPPER_LINE_LIMIT_MAX;
	if (inputs & CIA402_AT_HOME)
		bits |= INCISE_STEPPER_LINE_HOME;
	if (inputs & CIA402_INTERLOCK)
		bits |= INCISE_STEPPER_LINE_ESTOP;
	return bits & axis->setup.wired;
}

static void take_status(struct can_axis *axis, const struct can_frame *frame, int64_t now)
{
	int32_t before = axis->position;

	if (!cia402_get(frame, &axis->statusword, &axis->position))
		return;
	if (axis->heard)
		axis->speed += SMOOTH * ((double)axis->position - before - axis->speed);
	axis->heard = axis->answered = axis->came = true;
	axis->tpdo_ns = now;
	axis->motion.status.position = can_axis_steps(axis, axis->position);
}

void can_axis_inputs(struct can_axis *axis, uint32_t inputs)
{
	struct incise_abi_status *status = &axis->motion.status;
	unsigned int came;

	came = line_bits(axis, inputs) & ~status->inputs;
	status->inputs = line_bits(axis, inputs);
	if (came & INCISE_STEPPER_LINE_HOME) {
		status->home_position = status->position;
		status->flags |= INCISE_STEPPER_FLAG_HOME_SEEN;
	}
}

/* All that came since the last cycle. */
static void hear(struct can_axis *axis, int64_t now)
{
	struct can_bus *bus = axis->master->bus;
	struct can_frame frame;
	uint32_t inputs;
	int64_t t_ns;
	int rc = 0;

	for (int i = 0; i < FRAMES; i++) {
		rc = bus->ops->receive(bus, &frame, &t_ns);
		if (rc <= 0)
			break;
		switch (canopen_take(axis->master, &frame, t_ns)) {
		case CANOPEN_TPDO1:
			take_status(axis, &frame, now);
			break;
		case CANOPEN_TPDO2:
			if (cia402_get_inputs(&frame, &inputs)) {
				can_axis_inputs(axis, inputs);
				axis->inputs_ns = 0;
			}
			break;
		}
	}
	if (rc < 0)
		can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_BUS_FAILED, -rc, 0,
			       now);
}

/* In the drive's units, whatever its mode asks for. */
static int32_t whole(double value, double most)
{
	value = isnan(value) ? 0 : fmax(-most, fmin(most, value));
	return (int32_t)lrint(value);
}

static int32_t hold_target(const struct can_axis *axis)
{
	return axis->setup.mode == CIA402_CSP ? axis->position : 0;
}

/* Where the profile is, as the mode says it. */
static int32_t mode_target(const struct can_axis *axis,
			   const struct incise_profile_slot *slot)
{
	const struct can_axis_setup *setup = &axis->setup;
	double to = (double)slot->to / ONE, cycle_s = setup->config.tick_ns * 1e-9;
	double at = (axis->position - axis->zero_counts) / setup->counts_per_step;
	double speed = (double)(slot->to - slot->from) / ONE / cycle_s, most;
	bool stale = axis->missed > STALE_CYCLES;

	switch (setup->mode) {
	case CIA402_CSV:
		most = setup->config.velocity;
		if (!stale)
			speed += setup->gain_1_s * (to - at);
		speed = fmax(-most, fmin(most, speed));
		return whole(speed * setup->units_per_step_s, INT32_MAX);
	case CIA402_CST:
		if (stale)
			return 0;
		speed -= axis->speed / setup->counts_per_step / cycle_s;
		return whole(setup->torque_per_step * (to - at) +
				     setup->torque_s_per_step * speed,
			     setup->torque_most);
	default:
		return whole(axis->zero_counts + to * setup->counts_per_step, INT32_MAX);
	}
}

static int32_t follow(struct can_axis *axis)
{
	struct incise_motion *m = &axis->motion;
	struct incise_profile_slot slot;

	incise_profile_tick(&m->profile, &slot);
	incise_motion_ticked(m);
	memmove(&axis->commanded[1], &axis->commanded[0],
		sizeof(axis->commanded) - sizeof(*axis->commanded));
	axis->commanded[0] = incise_profile_position(&m->profile);
	return mode_target(axis, &slot);
}

static void put(struct can_axis *axis, uint16_t controlword, int32_t target, int64_t now)
{
	struct can_bus *bus = axis->master->bus;
	struct can_frame frame;
	int rc;

	cia402_put(&frame, axis->master->node, axis->setup.mode, controlword, target);
	rc = bus->ops->send(bus, &frame);
	axis->put = !rc;
	if (!rc) {
		axis->full = 0;
		axis->counts.setpoints++;
	} else if (rc == -ENOBUFS) {
		if (++axis->full > FULL_MOST)
			can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_QUEUE_FULL,
				       axis->full, 0, now);
	} else {
		can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_BUS_FAILED, -rc, 0,
			       now);
	}
}

static void sync(struct can_axis *axis, int64_t now)
{
	const struct can_frame frame = {.can_id = CANOPEN_SYNC};
	struct can_bus *bus = axis->master->bus;

	/* A set-point that no SYNC follows is none: the drive goes on as it did. */
	axis->answered = bus->ops->send(bus, &frame) != 0;
	axis->put = axis->put && !axis->answered;
	axis->unsynced = axis->answered ? axis->unsynced + 1 : 0;
	if (axis->unsynced > FULL_MOST)
		can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_QUEUE_FULL,
			       axis->unsynced, 0, now);
}

/*
 * What the drive says now answers to what it was told in this phase: the SYNC of that cycle
 * may have sampled it before, the one after that not.
 */
static bool has_answered(const struct can_axis *axis)
{
	return axis->told && axis->answers >= 2;
}

/* Its first target lies within the limits: that must be no jump. */
static bool within(const struct can_axis *axis)
{
	const struct incise_stepper_config *config = &axis->motion.config;
	int64_t slack = 1 + (int64_t)config->velocity * config->tick_ns / 1000000000;
	int64_t at = axis->motion.status.position;

	return at >= config->position_min - slack && at <= config->position_max + slack;
}

static void start(struct can_axis *axis, int64_t now)
{
	enum cia402_state state = cia402_state(axis->statusword);
	bool homes = axis->limit_ns, fresh = axis->tpdo_ns != axis->since_ns;

	can_axis_check_inputs(axis, now);
	if (axis->phase != CAN_AXIS_STARTING)
		return;

	if (fresh && state == CIA402_ENABLED && !homes && !within(axis)) {
		/* It gave way, so far that its first target would be a jump. */
		note(axis, CAN_AXIS_OUTSIDE, axis->motion.status.position, 0);
		axis->outcome = -ERANGE;
		axis->motion.ending = true;
		enter(axis, CAN_AXIS_QUICK_STOP, now);
	} else if (fresh && state == CIA402_ENABLED) {
		axis->motion.seen_ns = now;
		/* It may have given way a little while it got power. */
		incise_motion_halt(&axis->motion, false);
		for (int i = 0; i < 4; i++)
			axis->commanded[i] =
				incise_profile_position(&axis->motion.profile);
		axis->motion.status.state =
			homes ? INCISE_STEPPER_STATE_MOVING : INCISE_STEPPER_STATE_READY;
		axis->old_bits =
			axis->statusword & (CIA402_HOMED | CIA402_FOLLOWING_ERROR);
		if (!homes)
			axis->result = 0;
		enter(axis, homes ? CAN_AXIS_HOMING : CAN_AXIS_RUNNING, now);
	} else if (now - axis->since_ns > START_NS) {
		note(axis, CAN_AXIS_NO_START, state, 0);
		axis->outcome = -ETIMEDOUT;
		axis->motion.ending = true;
		enter(axis, CAN_AXIS_QUICK_STOP, now);
	}
	/* What it said before may be old: no target is made of that. */
	if (!fresh)
		axis->put = true;
	else if (axis->phase != CAN_AXIS_QUICK_STOP)
		put(axis, cia402_up(state), hold_target(axis), now);
}

static void run(struct can_axis *axis, int64_t now)
{
	struct incise_motion *m = &axis->motion;
	uint32_t bits = incise_motion_listen(m, now);

	if (bits)
		can_axis_fault(axis, bits, CAN_AXIS_NO_REASON, 0, 0, now);
	can_axis_check_inputs(axis, now);
	if (m->ending && m->resting && axis->phase == CAN_AXIS_RUNNING)
		enter(axis, CAN_AXIS_ENDING, now);
	if (axis->phase == CAN_AXIS_RUNNING)
		put(axis, CIA402_ENABLE, follow(axis), now);
}

static void home(struct can_axis *axis, int64_t now)
{
	uint16_t word = axis->statusword;
	bool begun = !axis->old_bits || now - axis->since_ns > PICKED_UP_NS;

	can_axis_check_inputs(axis, now);
	if (axis->phase != CAN_AXIS_HOMING)
		return;
	/* What a homing before left is over when the drive takes this one up. */
	axis->old_bits &= word;
	if (axis->stop_homing) {
		axis->outcome = -EINTR;
		axis->motion.ending = true;
		axis->motion.status.state = INCISE_STEPPER_STATE_STOPPING;
		enter(axis, CAN_AXIS_QUICK_STOP, now);
	} else if (begun && word & CIA402_FOLLOWING_ERROR) {
		can_axis_fault(axis, INCISE_STEPPER_FAULT_DRIVER, CAN_AXIS_NO_HOME, 0, 0,
			       now);
	} else if (now > axis->limit_ns) {
		axis->outcome = -ETIMEDOUT;
		can_axis_fault(axis, INCISE_STEPPER_FAULT_DRIVER, CAN_AXIS_HOME_TIME, 0,
			       0, now);
	} else if (begun && word & CIA402_HOMED && word & CIA402_TARGET_REACHED) {
		axis->outcome = 0;
		axis->motion.ending = true;
		enter(axis, CAN_AXIS_ENDING, now);
	} else {
		put(axis, CIA402_HOME_START, 0, now);
	}
}

/* It rests: power away without a stop. */
static void end(struct can_axis *axis, int64_t now)
{
	enum cia402_state state = cia402_state(axis->statusword);

	if (!cia402_powered(state) && has_answered(axis)) {
		put(axis, CIA402_DISABLE_VOLTAGE, hold_target(axis), now);
		power_off(axis, now);
		return;
	}
	if (now - axis->since_ns > END_NS) {
		enter(axis, CAN_AXIS_QUICK_STOP, now);
		return;
	}
	put(axis, CIA402_SHUTDOWN, hold_target(axis), now);
	axis->told |= axis->put;
}

/* By the drive's own ramp, then without power; or as well as can be known. */
static void quick_stop(struct can_axis *axis, int64_t now)
{
	enum cia402_state state = cia402_state(axis->statusword);
	bool stopping = state == CIA402_ENABLED || state == CIA402_QUICK_STOP ||
			state == CIA402_FAULT_REACTION;
	int64_t most = QUICK_NS + (int64_t)axis->setup.config.deadman_ns +
		       (int64_t)(1e9 * axis->setup.config.velocity /
				 axis->setup.config.acceleration);

	if (can_axis_is_fresh(axis, now) && !cia402_powered(state) &&
	    has_answered(axis)) {
		put(axis, CIA402_DISABLE_VOLTAGE, hold_target(axis), now);
		power_off(axis, now);
		return;
	}
	/*
	 * Past that time it is either off the bus, and stops by its own deadman, or does not
	 * obey: nothing more can be done from here than to say it.
	 */
	if (now - axis->since_ns > most) {
		put(axis, CIA402_DISABLE_VOLTAGE, hold_target(axis), now);
		if (!axis->motion.status.faults && axis->outcome != -ETIMEDOUT)
			axis->motion.status.faults |= INCISE_ABI_FAULT_LOST;
		note(axis, CAN_AXIS_NO_STOP, state, 0);
		axis->mute = true;
		power_off(axis, now);
		return;
	}
	put(axis, stopping ? CIA402_QUICK_STOP_COMMAND : CIA402_DISABLE_VOLTAGE,
	    hold_target(axis), now);
	axis->told |= axis->put;
}

/* Nobody gave it power, and yet it says that it has it. */
static void idle(struct can_axis *axis)
{
	struct incise_abi_status *status = &axis->motion.status;

	if (!axis->came || axis->answers < 2 ||
	    cia402_state(axis->statusword) != CIA402_ENABLED)
		return;
	if (!status->faults)
		note(axis, CAN_AXIS_NO_STOP, CIA402_ENABLED, 0);
	status->faults |= INCISE_STEPPER_FAULT_DRIVER;
	status->state = INCISE_STEPPER_STATE_FAULT;
	axis->mute = true;
}

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
	hear(axis, now_ns);
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
		idle(axis);
		break;
	case CAN_AXIS_STARTING:
		start(axis, now_ns);
		break;
	case CAN_AXIS_RUNNING:
		run(axis, now_ns);
		break;
	case CAN_AXIS_HOMING:
		home(axis, now_ns);
		break;
	case CAN_AXIS_ENDING:
	case CAN_AXIS_QUICK_STOP:
		break;
	}
	/* Also when the phase began in this cycle: no stop waits for the next. */
	if (axis->phase == CAN_AXIS_ENDING)
		end(axis, now_ns);
	else if (axis->phase == CAN_AXIS_QUICK_STOP)
		quick_stop(axis, now_ns);
	sync(axis, now_ns);
	if (may_beat(axis, powered, now_ns))
		canopen_beat(axis->master, now_ns);
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

	if (!homing_ns && !within(axis))
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
	enter(axis, CAN_AXIS_STARTING, now_ns);
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
		enter(axis, CAN_AXIS_QUICK_STOP, axis->since_ns);
		break;
	default:
		incise_motion_brake(m, 0);
	}
}
