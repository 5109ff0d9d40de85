// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * One drive, cycle by cycle; see can_axis.h.
 *
 *   receive() ─▶ check, then the phase ─▶ send_setpoint() ─▶ send_sync()
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "can_axis.h"

#define MS 1000000LL
#define END_NS (200 * MS)    /* from shutdown to no power */
#define QUICK_NS (1000 * MS) /* for a quick stop, next to deadman and ramp */
#define OBEY_NS (20 * MS)    /* from the command to the start of a quick stop */
#define OLD_BITS_NS \
	(5000 * MS) /* from the command to homing: the bits of the last one fall */
#define STAND_NS (1000 * MS) /* homed at rest: bit 10 of the statusword comes */
/* Homing: its speed by its position, against that which it was given. */
#define GAUGE_NS (100 * MS)
#define GAUGE_COUNTS 8	   /* less in that time is noise */
#define TOO_FAST 2	   /* times home_mm_s */
#define TOO_SLOW (0.1 / 2) /* half of the speed to zero, 6099:2 */
#define REST_ANSWERS 2	   /* of which the second was sampled at rest */
#define INPUTS_NS (3 * CIA402_INPUTS_MS * MS)
#define OPEN_CYCLES 10	  /* without an answer, in csv and cst … */
#define OPEN_NS (20 * MS) /* … and at least that */
#define STALE_CYCLES 3	  /* without an answer: the loop is not closed over that */
#define FRAMES 64	  /* received in a cycle: more than a bus carries in 2 ms */
#define FULL_MOST 5	  /* set-points in a row that the bus may refuse */
#define SMOOTH 0.25	  /* of a new speed, in its average */
#define ONE 4294967296.0  /* a step, in a profile's units */

/* --- targets: the profile's steps and the drive's counts --- */

int64_t can_axis_steps(const struct can_axis *axis, int32_t counts)
{
	double steps = (counts - axis->zero_counts) / axis->setup.counts_per_step;
	const double most = 2.0 * INCISE_PROFILE_POSITION_MAX;

	/* A drive may report any position. */
	return llround(fmax(-most, fmin(most, steps)));
}

static int32_t whole(double value, double most)
{
	value = isnan(value) ? 0 : fmax(-most, fmin(most, value));
	return (int32_t)lrint(value);
}

/* Returns a target that moves nothing, in the units of the mode. */
static int32_t hold_target(const struct can_axis *axis)
{
	return axis->setup.mode == CIA402_CSP ? axis->position : 0;
}

/* Returns the position of the profile in the units of the mode. */
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

/* Returns the profile's next point, likewise. */
static int32_t next_target(struct can_axis *axis)
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

bool can_axis_is_within(const struct can_axis *axis)
{
	const struct incise_stepper_config *config = &axis->motion.config;
	int64_t slack = 1 + (int64_t)config->velocity * config->tick_ns / 1000000000;
	int64_t at = axis->motion.status.position;

	return at >= config->position_min - slack && at <= config->position_max + slack;
}

/* --- faults --- */

static void enter_phase(struct can_axis *axis, enum can_axis_phase phase)
{
	axis->phase = phase;
	axis->since_ns = axis->now_ns;
	axis->command_sent = false;
	axis->answers = 0;
}

/* The first cause stays: the others follow from it. */
static void set_cause(struct can_axis *axis, enum can_axis_cause cause, int64_t a,
		      int64_t b)
{
	if (axis->cause != CAN_AXIS_NO_REASON)
		return;
	axis->cause_a = a;
	axis->cause_b = b;
	axis->cause = cause;
}

/* Latch a fault with its cause, and start to stop. No effect without power. */
static void set_fault(struct can_axis *axis, uint32_t bits, enum can_axis_cause cause,
		      int64_t a, int64_t b)
{
	struct incise_motion *m = &axis->motion;

	if (!m->powered)
		return;
	if (!m->status.faults)
		set_cause(axis, cause, a, b);
	if (axis->phase == CAN_AXIS_QUICK_STOP) {
		m->status.faults |= bits;
		return;
	}
	/*
	 * A quick stop where there is no profile to brake by, amid the set-points of
	 * another master, and where the drive has left the profile.
	 */
	if (incise_motion_fault(m, bits) || cause == CAN_AXIS_FOREIGN ||
	    cause == CAN_AXIS_STOOD_STILL || axis->phase == CAN_AXIS_STARTING ||
	    axis->phase == CAN_AXIS_HOMING) {
		m->ending = true;
		m->status.state = INCISE_STEPPER_STATE_STOPPING;
		enter_phase(axis, CAN_AXIS_QUICK_STOP);
	}
}

/* --- the bus --- */

/* Returns the drive's inputs as INCISE_STEPPER_LINE_… bits. */
static unsigned int line_bits(const struct can_axis *axis, uint32_t inputs)
{
	/* Inverted, the drive's lower end is the upper one here. */
	bool inverted = axis->setup.counts_per_step < 0;
	unsigned int bits = 0;

	if (inputs & CIA402_AT_MIN)
		bits |= inverted ? INCISE_STEPPER_LINE_LIMIT_MAX
				 : INCISE_STEPPER_LINE_LIMIT_MIN;
	if (inputs & CIA402_AT_MAX)
		bits |= inverted ? INCISE_STEPPER_LINE_LIMIT_MIN
				 : INCISE_STEPPER_LINE_LIMIT_MAX;
	if (inputs & CIA402_AT_HOME)
		bits |= INCISE_STEPPER_LINE_HOME;
	if (inputs & CIA402_INTERLOCK)
		bits |= INCISE_STEPPER_LINE_ESTOP;
	return bits & axis->setup.wired;
}

void can_axis_inputs(struct can_axis *axis, uint32_t inputs)
{
	struct incise_stepper_motor_status *status = &axis->motion.status;
	unsigned int bits = line_bits(axis, inputs), rising = bits & ~status->inputs;

	status->inputs = bits;
	if (rising & INCISE_STEPPER_LINE_HOME) {
		status->home_position = status->position;
		status->flags |= INCISE_STEPPER_FLAG_HOME_SEEN;
	}
}

static void handle_status(struct can_axis *axis, const struct can_frame *frame)
{
	int32_t before = axis->position;

	if (!cia402_parse_status(frame, &axis->statusword, &axis->position, &axis->mode))
		return;
	if (axis->has_status)
		axis->speed += SMOOTH * ((double)axis->position - before - axis->speed);
	axis->has_status = axis->answered = axis->status_received = true;
	axis->tpdo_ns = axis->now_ns;
	axis->motion.status.position = can_axis_steps(axis, axis->position);
}

/* Handle the frames since the last cycle. */
static void receive_can_axis(struct can_axis *axis)
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
		switch (canopen_handle(axis->master, &frame, t_ns)) {
		case CANOPEN_TPDO1:
			handle_status(axis, &frame);
			break;
		case CANOPEN_TPDO2:
			if (cia402_parse_inputs(&frame, &inputs)) {
				can_axis_inputs(axis, inputs);
				axis->inputs_ns = 0;
			}
			break;
		}
	}
	if (rc < 0)
		set_fault(axis, INCISE_STEPPER_FAULT_BUS, CAN_AXIS_BUS_FAILED, -rc, 0);
}

/* axis->setpoint_sent: whether it went out. */
static void send_setpoint(struct can_axis *axis, uint16_t controlword, int32_t target)
{
	struct can_bus *bus = axis->master->bus;
	struct can_frame frame;
	int rc;

	cia402_pack_rpdo(&frame, axis->master->node, axis->setup.mode, controlword,
			 target);
	rc = bus->ops->send(bus, &frame);
	axis->setpoint_sent = !rc;
	if (!rc) {
		axis->full = 0;
		axis->counts.setpoints++;
	} else if (rc == -ENOBUFS) {
		if (++axis->full > FULL_MOST)
			set_fault(axis, INCISE_STEPPER_FAULT_BUS, CAN_AXIS_QUEUE_FULL,
				  axis->full, 0);
	} else {
		set_fault(axis, INCISE_STEPPER_FAULT_BUS, CAN_AXIS_BUS_FAILED, -rc, 0);
	}
}

static void send_sync(struct can_axis *axis)
{
	const struct can_frame frame = {.can_id = CANOPEN_SYNC};
	struct can_bus *bus = axis->master->bus;

	/* Without a SYNC a set-point has no effect: the drive continues as before. */
	axis->answered = bus->ops->send(bus, &frame) != 0;
	axis->setpoint_sent = axis->setpoint_sent && !axis->answered;
	axis->unsynced = axis->answered ? axis->unsynced + 1 : 0;
	if (axis->unsynced > FULL_MOST)
		set_fault(axis, INCISE_STEPPER_FAULT_BUS, CAN_AXIS_QUEUE_FULL,
			  axis->unsynced, 0);
}

/* --- checks --- */

/* Returns whether the status is current. */
static bool is_fresh(const struct can_axis *axis)
{
	return axis->now_ns - axis->tpdo_ns <= 3 * (int64_t)axis->setup.config.tick_ns;
}

static bool is_fault(enum cia402_state state)
{
	return state == CIA402_FAULT || state == CIA402_FAULT_REACTION;
}

/* With power: heartbeat, TPDOs, EMCY, NMT, the bus, other masters. */
static void check_drive(struct can_axis *axis)
{
	const struct canopen *master = axis->master;
	enum cia402_state state = cia402_state(axis->statusword);
	int64_t most_ns = axis->setup.silence_ns;

	if (master->bus_offs != axis->bus_offs)
		set_fault(axis, INCISE_STEPPER_FAULT_BUS, CAN_AXIS_BUS_OFF, 0, 0);
	if (master->boots != axis->boots)
		set_fault(axis, INCISE_STEPPER_FAULT_LOST, CAN_AXIS_REBOOTED, 0, 0);
	if (master->emcy.count != axis->emcys)
		set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_EMCY,
			  master->emcy.code, master->emcy.error_register);
	/* Its EMCY may be a frame behind: wait for the next cycle. */
	else if (is_fault(state)) {
		if (axis->failed)
			set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_DRIVE_FAULT,
				  0, 0);
		axis->failed = true;
	}
	if (master->foreign != axis->foreign)
		set_fault(axis, INCISE_STEPPER_FAULT_SETPOINT, CAN_AXIS_FOREIGN, 0, 0);
	if (axis->now_ns - master->last_heartbeat_ns > axis->setup.silence_ns)
		set_fault(axis, INCISE_STEPPER_FAULT_LOST, CAN_AXIS_NO_HEARTBEAT,
			  axis->setup.silence_ns / MS, 0);
	else if (master->state != CANOPEN_OPERATIONAL)
		set_fault(axis, INCISE_STEPPER_FAULT_LOST, CAN_AXIS_NMT, master->state,
			  0);
	if (axis->setup.inputs_timed && axis->inputs_ns > INPUTS_NS)
		set_fault(axis, INCISE_STEPPER_FAULT_LOST, CAN_AXIS_NO_INPUTS,
			  INPUTS_NS / MS, 0);
	/* A loop that is closed here must not stay open for long. */
	if (axis->setup.mode != CIA402_CSP && axis->missed >= OPEN_CYCLES)
		most_ns = OPEN_NS;
	if (axis->now_ns - axis->tpdo_ns > most_ns)
		set_fault(axis, INCISE_STEPPER_FAULT_LOST, CAN_AXIS_NO_TPDO, most_ns / MS,
			  0);
}

/* E-stop, and the limit ahead. */
static void check_inputs(struct can_axis *axis)
{
	uint32_t inputs = axis->motion.status.inputs;
	int64_t velocity = incise_profile_velocity(&axis->motion.profile);

	if (inputs & INCISE_STEPPER_LINE_ESTOP)
		set_fault(axis, INCISE_STEPPER_FAULT_ESTOP, CAN_AXIS_NO_REASON, 0, 0);
	if (axis->phase != CAN_AXIS_RUNNING)
		return;
	/* Motion away from a limit is allowed. */
	if (inputs & INCISE_STEPPER_LINE_LIMIT_MIN && velocity < 0)
		set_fault(axis, INCISE_STEPPER_FAULT_LIMIT_MIN, CAN_AXIS_NO_REASON, 0, 0);
	if (inputs & INCISE_STEPPER_LINE_LIMIT_MAX && velocity > 0)
		set_fault(axis, INCISE_STEPPER_FAULT_LIMIT_MAX, CAN_AXIS_NO_REASON, 0, 0);
}

/* The drive lags: it should be between the targets that it may have now. */
static void check_following(struct can_axis *axis)
{
	int64_t at = axis->motion.status.position, low = INT64_MAX, high = INT64_MIN, off;

	for (int i = 0; i < 4; i++) {
		low = axis->commanded[i] < low ? axis->commanded[i] : low;
		high = axis->commanded[i] > high ? axis->commanded[i] : high;
	}
	off = at < low ? low - at : at > high ? at - high : 0;
	if (off <= axis->setup.following) {
		axis->off_ns = 0;
		return;
	}
	if (!axis->off_ns)
		axis->off_ns = axis->now_ns;
	if (axis->now_ns - axis->off_ns >= axis->setup.following_ns)
		set_fault(axis, INCISE_STEPPER_FAULT_FOLLOWING, CAN_AXIS_OFF_TARGET, off,
			  0);
}

/* The drive keeps its power, and follows its targets. */
static void check_running(struct can_axis *axis)
{
	enum cia402_state state = cia402_state(axis->statusword);

	if (is_fault(state))
		return;
	if (state != CIA402_ENABLED)
		set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_NOT_ENABLED, state,
			  0);
	/* Only with a current position. */
	else if (axis->phase == CAN_AXIS_RUNNING && is_fresh(axis))
		check_following(axis);
}

/* --- phases, from power to no power; drawn in can_axis.h --- */

/* Stop without a fault; @outcome of the started motion. */
static void abandon(struct can_axis *axis, int outcome)
{
	axis->outcome = outcome;
	axis->motion.ending = true;
	enter_phase(axis, CAN_AXIS_QUICK_STOP);
}

static void power_off(struct can_axis *axis)
{
	struct incise_motion *m = &axis->motion;

	incise_motion_halt(m, m->status.faults & INCISE_STEPPER_FAULT_LOST);
	incise_motion_power_off(m);
	if (axis->result > 0)
		axis->result = axis->outcome;
	enter_phase(axis, CAN_AXIS_IDLE);
}

/*
 * Returns whether the status answers the command of this phase: the SYNC of that cycle may have
 * sampled it before, the next one not.
 */
static bool has_answered(const struct can_axis *axis)
{
	return axis->command_sent && axis->answers >= 2;
}

/* The drive must not have power. */
static void run_idle(struct can_axis *axis)
{
	struct incise_stepper_motor_status *status = &axis->motion.status;

	if (!axis->status_received || axis->answers < 2 ||
	    cia402_state(axis->statusword) != CIA402_ENABLED)
		return;
	if (!status->faults)
		set_cause(axis, CAN_AXIS_NO_STOP, CIA402_ENABLED, 0);
	status->faults |= INCISE_STEPPER_FAULT_ALARM;
	status->state = INCISE_STEPPER_STATE_FAULT;
	axis->heartbeat_off = true;
}

static void run_starting(struct can_axis *axis)
{
	enum cia402_state state = cia402_state(axis->statusword);
	bool homes = axis->limit_ns, fresh = axis->tpdo_ns != axis->since_ns;
	bool enabled = fresh && state == CIA402_ENABLED;
	bool started = enabled && axis->mode == axis->mode_set;

	check_inputs(axis);
	if (axis->phase != CAN_AXIS_STARTING)
		return;

	if (started && !homes && !can_axis_is_within(axis)) {
		/* It gave way so far that its first target would be a jump. */
		set_cause(axis, CAN_AXIS_OUTSIDE, axis->motion.status.position, 0);
		abandon(axis, -ERANGE);
	} else if (started) {
		axis->motion.seen_ns = axis->now_ns;
		/* It may have given way a little while it got power. */
		incise_motion_halt(&axis->motion, false);
		for (int i = 0; i < 4; i++)
			axis->commanded[i] =
				incise_profile_position(&axis->motion.profile);
		axis->rested = REST_ANSWERS;
		axis->stood_ns = 0;
		axis->gauge_ns = axis->tpdo_ns;
		axis->gauge_counts = axis->position;
		axis->gauge_steps_s = axis->sustained = 0;
		axis->motion.status.state =
			homes ? INCISE_STEPPER_STATE_MOVING : INCISE_STEPPER_STATE_READY;
		axis->old_bits =
			axis->statusword & (CIA402_HOMED | CIA402_FOLLOWING_ERROR);
		if (!homes)
			axis->result = 0;
		enter_phase(axis, homes ? CAN_AXIS_HOMING : CAN_AXIS_RUNNING);
	} else if (axis->now_ns - axis->since_ns > axis->setup.start_ns) {
		if (enabled)
			set_cause(axis, CAN_AXIS_NO_MODE, axis->mode, 0);
		set_cause(axis, CAN_AXIS_NO_START, state, 0);
		abandon(axis, -ETIMEDOUT);
	}
	/* No target is computed from an old position. */
	if (!fresh)
		axis->setpoint_sent = true;
	else if (axis->phase != CAN_AXIS_QUICK_STOP)
		send_setpoint(axis, cia402_next_controlword(state), hold_target(axis));
}

/* It is at rest where its position is not one from before that. */
static void check_rest(struct can_axis *axis)
{
	struct incise_motion *m = &axis->motion;

	axis->rested = m->resting ? axis->rested + axis->status_received : 0;
	if (axis->rested < REST_ANSWERS && m->status.state == INCISE_STEPPER_STATE_READY)
		m->status.state = INCISE_STEPPER_STATE_MOVING;
}

static void run_running(struct can_axis *axis)
{
	struct incise_motion *m = &axis->motion;
	uint32_t bits = incise_motion_listen(m, axis->now_ns);

	if (bits)
		set_fault(axis, bits, CAN_AXIS_NO_REASON, 0, 0);
	check_inputs(axis);
	if (m->ending && m->resting && axis->phase == CAN_AXIS_RUNNING)
		enter_phase(axis, CAN_AXIS_ENDING);
	if (axis->phase == CAN_AXIS_RUNNING) {
		send_setpoint(axis, CIA402_ENABLE, next_target(axis));
		check_rest(axis);
	}
}

/* Returns whether it has stood for a while, homed by its bit 12, and not there by its bit 10. */
static bool stands_open(struct can_axis *axis, uint16_t word)
{
	if (!(word & CIA402_HOMED) || fabs(axis->speed) >= 1)
		axis->stood_ns = 0;
	else if (!axis->stood_ns)
		axis->stood_ns = axis->now_ns;
	return axis->stood_ns && axis->now_ns - axis->stood_ns > STAND_NS;
}

/*
 * Returns whether its position (6064) moves at the speed that it was given (6099), so far or at its
 * end. That shows a drive whose counts are others than it reports, or than rig.conf has. It does
 * not show a factor between the two bounds, one that its unit of velocity has too, or a wrong
 * lead_mm: then all that a drive reports fits, and only a ruler differs.
 */
static bool fits_home_speed(struct can_axis *axis, bool ended)
{
	double asked = axis->setup.home_steps_s,
	       per_step = fabs(axis->setup.counts_per_step);
	int64_t t_ns = axis->tpdo_ns - axis->gauge_ns;
	double noise = GAUGE_COUNTS * 1e9 / GAUGE_NS / per_step, is;

	if (t_ns >= GAUGE_NS) {
		is = fabs((double)axis->position - axis->gauge_counts) * 1e9 /
		     (double)t_ns / per_step;
		/* Where its count is set at the switch, one of two is wrong. */
		axis->sustained = fmax(axis->sustained, fmin(is, axis->gauge_steps_s));
		axis->gauge_steps_s = is;
		axis->gauge_ns = axis->tpdo_ns;
		axis->gauge_counts = axis->position;
	}
	if (!asked || axis->sustained < noise)
		return true;
	return axis->sustained <= TOO_FAST * asked &&
	       (!ended || axis->sustained >= TOO_SLOW * asked);
}

static void run_homing(struct can_axis *axis)
{
	bool ended;
	uint16_t word = axis->statusword;
	bool waited = axis->now_ns - axis->since_ns > OLD_BITS_NS;

	check_inputs(axis);
	if (axis->phase != CAN_AXIS_HOMING)
		return;
	/* The drive clears the bits of an earlier homing when it starts this one. */
	axis->old_bits &= word;
	/*
	 * A bit that has not fallen answers the last homing, however late that is. A drive that was homed, and has
	 * nothing to do, may keep its bits: then its count must say that it is there, see can_session_homed().
	 */
	if (!waited || axis->old_bits & CIA402_FOLLOWING_ERROR)
		word &= ~axis->old_bits;
	ended = word & CIA402_HOMED && word & CIA402_TARGET_REACHED;
	if (axis->stop_homing) {
		axis->motion.status.state = INCISE_STEPPER_STATE_STOPPING;
		abandon(axis, -EINTR);
	} else if (word & CIA402_FOLLOWING_ERROR) {
		set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_NO_HOME, 0, 0);
	} else if (!fits_home_speed(axis, ended)) {
		set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_HOME_SPEED,
			  llround(axis->sustained), 0);
	} else if (axis->now_ns > axis->limit_ns) {
		axis->outcome = -ETIMEDOUT;
		set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_HOME_TIME, 0, 0);
	} else if (waited && axis->old_bits & CIA402_FOLLOWING_ERROR) {
		axis->outcome = -ETIMEDOUT;
		set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_HOME_OLD, 0, 0);
	} else if (ended) {
		axis->outcome = 0;
		axis->motion.ending = true;
		enter_phase(axis, CAN_AXIS_ENDING);
	} else if (stands_open(axis, word)) {
		set_fault(axis, INCISE_STEPPER_FAULT_ALARM, CAN_AXIS_HOME_OPEN, 0, 0);
	} else {
		send_setpoint(axis, CIA402_HOME_START, 0);
	}
}

/* At rest: remove power without a stop. */
static void run_ending(struct can_axis *axis)
{
	enum cia402_state state = cia402_state(axis->statusword);

	if (!cia402_powered(state) && has_answered(axis)) {
		send_setpoint(axis, CIA402_DISABLE_VOLTAGE, hold_target(axis));
		power_off(axis);
		return;
	}
	if (axis->now_ns - axis->since_ns > END_NS) {
		enter_phase(axis, CAN_AXIS_QUICK_STOP);
		return;
	}
	send_setpoint(axis, CIA402_SHUTDOWN, hold_target(axis));
	axis->command_sent |= axis->setpoint_sent;
}

/* Stop on the drive's ramp, then without power, as far as its status shows. */
static void run_quick_stop(struct can_axis *axis)
{
	enum cia402_state state = cia402_state(axis->statusword);
	bool stopping = state == CIA402_ENABLED || state == CIA402_QUICK_STOP ||
			state == CIA402_FAULT_REACTION;
	int64_t most = QUICK_NS + (int64_t)axis->setup.config.deadman_ns +
		       (int64_t)(1e9 * axis->setup.config.velocity /
				 axis->setup.config.acceleration);

	if (is_fresh(axis) && !cia402_powered(state) && has_answered(axis)) {
		send_setpoint(axis, CIA402_DISABLE_VOLTAGE, hold_target(axis));
		power_off(axis);
		return;
	}
	/*
	 * After that time it either is off the bus, and stops by its own deadman, or does not
	 * obey: all that is left is to report it.
	 */
	if (axis->now_ns - axis->since_ns > most) {
		send_setpoint(axis, CIA402_DISABLE_VOLTAGE, hold_target(axis));
		if (!axis->motion.status.faults && axis->outcome != -ETIMEDOUT)
			axis->motion.status.faults |= INCISE_STEPPER_FAULT_LOST;
		set_cause(axis, CAN_AXIS_NO_STOP, state, 0);
		axis->heartbeat_off = true;
		power_off(axis);
		return;
	}
	send_setpoint(axis, stopping ? CIA402_QUICK_STOP_COMMAND : CIA402_DISABLE_VOLTAGE,
		      hold_target(axis));
	axis->command_sent |= axis->setpoint_sent;
}

/* --- the cycle, and commands --- */

/*
 * Heartbeats keep the drive's deadman off. With power they require that set-points go out; and
 * a drive that does not obey a quick stop is left to its deadman.
 */
static bool may_send_heartbeat(const struct can_axis *axis, bool powered)
{
	bool obeys = cia402_state(axis->statusword) != CIA402_ENABLED ||
		     axis->now_ns - axis->since_ns < OBEY_NS;

	if (axis->heartbeat_off)
		return false;
	if (axis->phase == CAN_AXIS_QUICK_STOP && !(obeys && is_fresh(axis)))
		return false;
	return !powered || axis->setpoint_sent;
}

/*
 * A quick stop leaves it to the drive's own ramp, whatever it did while no cycle came. While
 * it starts and ends it is given no target.
 */
static void check_awake(struct can_axis *axis, int64_t still_ns)
{
	uint32_t fault = incise_motion_awake(&axis->motion, axis->now_ns);

	if (fault && (axis->phase == CAN_AXIS_RUNNING || axis->phase == CAN_AXIS_HOMING))
		set_fault(axis, fault, CAN_AXIS_STOOD_STILL, still_ns / MS, 0);
}

void can_axis_cycle(struct can_axis *axis, int64_t now_ns, int64_t late_ns,
		    uint32_t left_out)
{
	struct incise_motion *m = &axis->motion;
	int64_t still_ns = now_ns - axis->now_ns;
	bool powered = m->powered;

	axis->now_ns = now_ns;
	check_awake(axis, still_ns);
	axis->setpoint_sent = axis->status_received = false;
	receive_can_axis(axis);
	axis->answers += axis->status_received;
	/* Only time in which the drive answers. */
	axis->inputs_ns += axis->status_received ? axis->setup.config.tick_ns : 0;
	axis->missed = axis->answered ? 0 : axis->missed + 1;
	if (powered) {
		axis->counts.sync_late +=
			left_out + (2 * late_ns > (int64_t)axis->setup.config.tick_ns);
		axis->counts.tpdo_missing += !axis->answered;
		check_drive(axis);
	}
	if (axis->phase == CAN_AXIS_RUNNING || axis->phase == CAN_AXIS_HOMING)
		check_running(axis);
	switch (axis->phase) {
	case CAN_AXIS_IDLE:
		run_idle(axis);
		break;
	case CAN_AXIS_STARTING:
		run_starting(axis);
		break;
	case CAN_AXIS_RUNNING:
		run_running(axis);
		break;
	case CAN_AXIS_HOMING:
		run_homing(axis);
		break;
	case CAN_AXIS_ENDING:
	case CAN_AXIS_QUICK_STOP:
		break;
	}
	/* Also if the phase started in this cycle: a stop does not wait for the next. */
	if (axis->phase == CAN_AXIS_ENDING)
		run_ending(axis);
	else if (axis->phase == CAN_AXIS_QUICK_STOP)
		run_quick_stop(axis);
	send_sync(axis);
	if (may_send_heartbeat(axis, powered))
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

	if (!homing_ns && !can_axis_is_within(axis))
		return -ERANGE;
	rc = incise_motion_power_on(m, now_ns);
	if (rc <= 0)
		return rc;
	axis->now_ns = now_ns;
	axis->cause = CAN_AXIS_NO_REASON;
	axis->boots = master->boots;
	axis->emcys = master->emcy.count;
	axis->bus_offs = master->bus_offs;
	axis->foreign = master->foreign;
	axis->full = 0;
	axis->off_ns = 0;
	axis->speed = 0;
	axis->stop_homing = axis->failed = axis->heartbeat_off = false;
	axis->missed = 0;
	/* Until homing has succeeded. */
	if (homing_ns)
		m->status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	axis->answered = true;
	axis->tpdo_ns = now_ns;
	axis->inputs_ns = 0;
	axis->limit_ns = homing_ns ? now_ns + homing_ns : 0;
	axis->mode = axis->mode_set = homing_ns ? CIA402_HOMING : axis->setup.mode;
	axis->result = 1;
	axis->outcome = -EIO;
	enter_phase(axis, CAN_AXIS_STARTING);
	return 1;
}

void can_axis_cleared(struct can_axis *axis)
{
	axis->cause = CAN_AXIS_NO_REASON;
	axis->heartbeat_off = false;
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
		/* The time limits of the stop count from the start. */
		axis->now_ns = axis->since_ns;
		abandon(axis, -EINTR);
		break;
	default:
		incise_motion_brake(m, 0);
	}
}

int can_axis_still_text(int64_t still_ns, char *text, size_t size)
{
	return snprintf(text, size,
			"this program was stopped for %lld ms, longer than deadman_ms: "
			"find the cause, for example a busy machine, then clear",
			(long long)(still_ns / MS));
}

int can_axis_cause_text(const struct can_axis *axis, char *text, size_t size)
{
	long long a = axis->cause_a, b = axis->cause_b;
	char words[120];

	switch ((enum can_axis_cause)axis->cause) {
	case CAN_AXIS_NO_REASON:
		return 0;
	case CAN_AXIS_EMCY:
		return snprintf(text, size,
				"emergency message: %s, error register %02llxh; remove "
				"the cause, then clear",
				canopen_emcy_text((uint16_t)a, words, sizeof(words)), b);
	case CAN_AXIS_DRIVE_FAULT:
		return snprintf(text, size,
				"it is in fault without a reported cause: see its own "
				"indicators, then clear");
	case CAN_AXIS_NOT_ENABLED:
		return snprintf(text, size,
				"it left operation enabled by itself and is in %s: "
				"check its enable and safe-torque-off inputs, then "
				"clear",
				cia402_state_name((enum cia402_state)a));
	case CAN_AXIS_NO_HEARTBEAT:
	case CAN_AXIS_NO_TPDO:
		return snprintf(text, size,
				"no %s from it for %lld ms: check its power and cable, "
				"then clear",
				axis->cause == CAN_AXIS_NO_TPDO ? "status (TPDO1)"
								: "heartbeat",
				a);
	case CAN_AXIS_NO_INPUTS:
		return snprintf(
			text, size,
			"no inputs (TPDO2), including the e-stop, from it for %lld ms: "
			"find out why its set-up changed, then clear",
			a);
	case CAN_AXIS_REBOOTED:
		return snprintf(text, size,
				"it restarted (boot-up message): check its power "
				"supply, then clear, enable and home");
	case CAN_AXIS_NMT:
		return snprintf(text, size,
				"another master or its own fault set it to %s: remove "
				"the cause, then clear",
				canopen_state_name((enum canopen_state)a));
	case CAN_AXIS_BUS_OFF:
		return snprintf(text, size,
				"the bus is off after too many errors: check cable, "
				"termination and bit rate, then clear");
	case CAN_AXIS_QUEUE_FULL:
		return snprintf(text, size,
				"the bus accepted no setpoint for %lld cycles, its "
				"queue is full: check that a node acknowledges frames, "
				"then clear",
				a);
	case CAN_AXIS_BUS_FAILED:
		return snprintf(text, size,
				"the bus fails: %s; see `ip -details link show`, or plug "
				"the adapter in, then clear",
				strerror((int)a));
	case CAN_AXIS_FOREIGN:
		return snprintf(text, size,
				"another program sends setpoints or SYNCs on this bus: "
				"end it, then clear");
	case CAN_AXIS_OFF_TARGET:
		return snprintf(text, size,
				"it was off its target by %.3g mm for longer than "
				"following_ms: check that nothing blocks it, or give a "
				"smaller acceleration_mm_s2, then clear",
				(double)a * axis->setup.step_mm);
	case CAN_AXIS_NO_START:
		return snprintf(text, size,
				"it did not reach operation enabled and remains in %s: "
				"check its supply, enable and safe-torque-off inputs",
				cia402_state_name((enum cia402_state)a));
	case CAN_AXIS_NO_MODE:
		return snprintf(
			text, size,
			"it is enabled in the mode %s (6061) and not in that which "
			"was set (6060): see its manual",
			cia402_mode_name((int)a));
	case CAN_AXIS_NO_HOME:
		return snprintf(
			text, size,
			"its homing failed: check its switches and homing_method in "
			"rig.conf, then clear");
	case CAN_AXIS_HOME_TIME:
		return snprintf(text, size,
				"its homing was not done in time: check that it moves, "
				"home_mm_s and homing_method in rig.conf, then clear");
	case CAN_AXIS_HOME_OLD:
		return snprintf(
			text, size,
			"it still reports that its last homing failed, and not "
			"whether it homed now: switch it off and on, and home again");
	case CAN_AXIS_HOME_OPEN:
		return snprintf(
			text, size,
			"it stands after its homing with bit 12 of its statusword set "
			"(homed) and bit 10 not (target reached): see its manual for "
			"bit 10 in homing mode and its position window (6067), then clear");
	case CAN_AXIS_HOME_SPEED:
		return snprintf(
			text, size,
			"it moved at %.3g mm/s by its position (6064), and was given %.3g "
			"(6099): its units do not fit each other; give counts_per_turn "
			"and velocity_per_turn_s in rig.conf, then clear",
			(double)a * axis->setup.step_mm,
			axis->setup.home_steps_s * axis->setup.step_mm);
	case CAN_AXIS_OUTSIDE:
		return snprintf(
			text, size,
			"it moved while it was switched on, to %.3f mm, outside its "
			"travel: check its brake, and home it",
			(double)a * axis->setup.step_mm);
	case CAN_AXIS_STOOD_STILL:
		return can_axis_still_text(a * MS, text, size);
	case CAN_AXIS_NO_STOP:
		return snprintf(text, size,
				"it did not report that it stopped; its last state was "
				"%s: switch its power off",
				cia402_state_name((enum cia402_state)a));
	}
	return 0;
}
