// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A drive and the bus that leads to it; see can_session.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <linux/can/netlink.h>
#include "../../../rig/motor.h"
#include "can_units.h"
#include "can_session.h"

#define MS 1000000LL
#define DEVICE_MAX 200
#define LISTEN_NS (60 * MS) /* for another master; a SYNC comes every 20 ms at least */
#define READY_NS (500 * MS) /* until the drive reports to be operational */
#define WATCH_FRAMES 256    /* received in one look */
#define WATCH_NS (200 * MS) /* without TPDOs for so long, no program drives it */
#define STILL_STEPS_S 1	    /* slower is at rest */

static const struct cia402_object digital_inputs = {0x60fd, 0, 4, "digital inputs"};

/* The next messages begin with @where. */
static void begin_can_session(struct can_session *s, const char *where,
			      struct incise_error *err)
{
	s->client = (struct cia402_client){&s->master, where, err};
}

int can_session_parse(const char *arguments, char *device, size_t size,
		      unsigned int *node)
{
	const char *colon = strrchr(arguments, ':');
	size_t length = colon ? (size_t)(colon - arguments) : 0;
	unsigned long value;
	char *end;

	if (!length || length >= size || !colon[1] || strchr("+- \t", colon[1]))
		return -EINVAL;
	value = strtoul(colon + 1, &end, 0);
	if (*end || value < 1 || value > 127)
		return -EINVAL;
	memcpy(device, arguments, length);
	device[length] = '\0';
	*node = (unsigned int)value;
	return 0;
}

/* Receive frames of this drive and those that reveal another master. */
static int set_filter(struct can_session *s)
{
	const uint32_t node = s->master.node;
	const uint32_t ids[] = {
		CANOPEN_NMT,
		CANOPEN_SYNC,
		CANOPEN_EMCY + node,
		CANOPEN_TPDO1 + node,
		CANOPEN_TPDO2 + node,
		CANOPEN_RPDO1 + node,
		CANOPEN_SDO_ANSWER + node,
		CANOPEN_SDO_REQUEST + node, /* an echo */
		CANOPEN_HEARTBEAT + node,
		CANOPEN_HEARTBEAT + s->master.own,
	};
	struct can_filter filter[sizeof(ids) / sizeof(*ids)];
	int n = sizeof(ids) / sizeof(*ids);

	for (int i = 0; i < n; i++)
		filter[i] = (struct can_filter){ids[i], CAN_EFF_FLAG | CAN_RTR_FLAG |
								CAN_SFF_MASK};
	return s->bus->ops->filter(s->bus, filter, n);
}

static int open_bus(struct can_session *s, const struct can_transport *transport,
		    const struct incise_backend_request *request, bool watch)
{
	struct incise_error *err = s->client.err;
	const struct incise_actuator_can *can = &request->actuator->can;
	const char *example =
		strcmp(transport->name, "can") ? "slcan:/dev/ttyACM0" : "can:can0";
	char device[DEVICE_MAX];
	struct can_bus_request bus = {
		.where = request->where, .device = device, .bitrate = can->bitrate};
	unsigned int node;
	int rc = can_session_parse(request->arguments, device, sizeof(device), &node);

	if (rc)
		return incise_error_set(
			err, EINVAL,
			"%s: expected %s:DEVICE:NODE such as %s:0x10 with a node id of "
			"1 to 127, found %s:%.60s; `incise info %s` lists drives",
			request->where, transport->name, example, transport->name,
			request->arguments, example);
	if (node == (unsigned int)can->master)
		return incise_error_set(err, EINVAL,
					"%s: node %u is also actuator.can.master, the "
					"id of this program's heartbeat; give another "
					"id there",
					request->where, node);
	bus.node = watch ? 0 : (uint8_t)node;
	rc = transport->open(&s->bus, &bus, err);
	if (rc)
		return rc;
	s->master =
		(struct canopen){.bus = s->bus,
				 .node = (uint8_t)node,
				 .answer_ns = (int64_t)(can->answer_s * INCISE_NS_PER_S),
				 .state = CANOPEN_UNKNOWN};
	snprintf(s->name, sizeof(s->name), "drive 0x%02x at %.36s", node, s->bus->name);
	return 0;
}

static bool is_foreign(const struct canopen *master)
{
	return master->foreign;
}

static int check_alone(struct can_session *s)
{
	const struct cia402_client *client = &s->client;
	int64_t until = s->bus->ops->now(s->bus) + LISTEN_NS;
	int rc = canopen_await(&s->master, is_foreign, until);

	if (rc == -ETIMEDOUT)
		return 0;
	if (rc)
		return cia402_error(client, -rc, "%s: %s", s->bus->name, strerror(-rc));
	return cia402_error(client, EBUSY,
			    "another master sends SYNCs, setpoints or heartbeats of "
			    "node 0x%02x on %s; end it, or give another "
			    "actuator.can.master",
			    s->master.own, s->bus->name);
}

/* Read the position, and place 0. @keep: the drive's count continues. */
static int read_position(struct can_session *s, bool keep)
{
	struct incise_stepper_motor_status *status = &s->axis.motion.status;
	const struct cia402_object position = {0x6064, 0, 4, "position"};
	uint32_t counts;
	int rc = cia402_read(&s->client, &position, &counts);

	if (rc)
		return rc;
	s->axis.position = (int32_t)counts;
	if (s->is_homed)
		s->axis.zero_counts = -s->actuator.home_mm * can_units_per_mm(s);
	else if (!keep)
		s->axis.zero_counts = (int32_t)counts;
	status->position = can_axis_steps(&s->axis, s->axis.position);
	status->flags &= ~INCISE_STEPPER_FLAG_HOMED;
	if (s->is_homed)
		status->flags |= INCISE_STEPPER_FLAG_HOMED;
	return 0;
}

/*
 * A drive that reports to be homed may have been homed by another program, to another place, or
 * without its count being set. It is trusted where its 607D is the range of this rig.conf, which
 * is written only after a homing that can_session_homed() found right, and taken back before the
 * next one.
 */
static int read_homed(struct can_session *s)
{
	bool known = s->is_homed && s->is_setup && s->boots == s->master.boots;
	double zero = s->axis.zero_counts;
	int rc;

	s->is_homed = s->actuator.can.absolute;
	if (s->is_homed || !s->actuator.can.homing_method)
		return 0;
	rc = cia402_read_homed(&s->client, s->setup.mode, &s->is_homed);
	if (rc || !s->is_homed || known)
		return rc;
	s->axis.zero_counts = -s->actuator.home_mm * can_units_per_mm(s);
	can_units_range(s);
	s->axis.zero_counts = zero;
	return cia402_has_range(&s->client, s->setup.position_min, s->setup.position_max,
				&s->is_homed);
}

static int write_range(struct can_session *s)
{
	can_units_range(s);
	return cia402_set_range(&s->client, s->setup.position_min, s->setup.position_max);
}

/* The drive does not report which inputs are wired: all that 60FD has a bit for. */
static void set_inputs(struct can_session *s, bool inputs)
{
	struct can_axis_setup *setup = &s->axis.setup;

	setup->inputs = inputs;
	setup->wired =
		inputs ? INCISE_STEPPER_LINE_LIMIT_MIN | INCISE_STEPPER_LINE_LIMIT_MAX |
				 INCISE_STEPPER_LINE_HOME | INCISE_STEPPER_LINE_ESTOP
		       : 0;
}

/* Set the drive up, also after it restarted. */
static int set_up_can_session(struct can_session *s)
{
	bool was_homed = s->is_homed, keep;
	int rc = read_homed(s);

	keep = s->is_setup && s->boots == s->master.boots && s->is_homed == was_homed;
	s->is_setup = false;
	if (!rc)
		rc = read_position(s, keep);
	if (rc)
		return rc;
	can_units_range(s);
	if (!s->in_range)
		return cia402_error(&s->client, ERANGE,
				    "its position is %d counts, and with %g counts per "
				    "turn the travel exceeds 32 bits; switch its power "
				    "off and on, or check counts_per_turn in rig.conf",
				    s->axis.position, s->units.counts_per_turn);
	s->boots = s->master.boots;
	rc = cia402_configure(&s->client, &s->setup, &s->supported);
	if (rc)
		return rc;
	s->is_setup = true;
	set_inputs(s, s->supported.inputs);
	s->axis.setup.inputs_timed = s->supported.inputs && s->supported.inputs_timed;
	return 0;
}

/* Read why a drive is in fault, by its own error code; a known cause stays. */
static void find_cause(struct can_session *s)
{
	struct can_axis *axis = &s->axis;
	uint32_t code;

	if (axis->cause != CAN_AXIS_NO_REASON)
		return;
	if (canopen_read(&s->master, 0x603f, 0, 2, &code))
		code = 0;
	axis->cause_a = code;
	axis->cause = code ? CAN_AXIS_EMCY : CAN_AXIS_DRIVE_FAULT;
}

/* Report a fault that the drive has from before. */
static void adopt_fault(struct can_session *s)
{
	struct can_axis *axis = &s->axis;
	uint32_t word = 0;

	if (canopen_read(&s->master, 0x6041, 0, 2, &word))
		return;
	axis->statusword = (uint16_t)word;
	if (cia402_state(axis->statusword) != CIA402_FAULT)
		return;
	axis->motion.status.faults |= INCISE_STEPPER_FAULT_ALARM;
	axis->motion.status.state = INCISE_STEPPER_STATE_FAULT;
	find_cause(s);
}

/* Identify the drive; compute setup and axis from its units and rig.conf. */
static int prepare(struct can_session *s)
{
	const struct cia402_client *client = &s->client;
	const struct incise_actuator_can *can = &s->actuator.can;
	int rc = set_filter(s);

	if (rc)
		return cia402_error(client, -rc, "%s: cannot be filtered: %s",
				    s->bus->name, strerror(-rc));
	s->units = (struct cia402_units){can->counts_per_turn, can->velocity_per_turn_s,
					 can->acceleration_per_turn_s2};
	rc = cia402_identify(client);
	if (!rc)
		rc = cia402_read_units(client, &s->units);
	if (!rc && s->master.echoes > s->master.requests / 2)
		rc = cia402_error(
			client, EPROTO,
			"%s sends back what this program sends (echo), which looks "
			"like another master; switch its echo off",
			s->bus->name);
	if (rc)
		return rc;
	rc = can_units_steps(s);
	can_units_setup(s);
	return rc ? rc : can_units_axis(s);
}

int can_session_open(struct can_session *s, const struct can_transport *transport,
		     const struct incise_backend_request *request,
		     struct incise_error *err)
{
	int rc;

	begin_can_session(s, request->where, err);
	s->actuator = *request->actuator;
	rc = can_units_deadman(s);
	if (!rc)
		rc = open_bus(s, transport, request, false);
	if (rc)
		return rc;
	s->master.own = (uint8_t)request->actuator->can.master;
	rc = set_filter(s);
	if (!rc)
		rc = check_alone(s);
	/* A drive that another master stopped answers nothing else. */
	if (!rc && (rc = canopen_send_nmt(&s->master, CANOPEN_PREPARE)) < 0)
		rc = incise_error_set(err, -rc, "%s: %s: cannot send: %s", request->where,
				      s->bus->name, strerror(-rc));
	if (!rc)
		rc = prepare(s);
	if (!rc)
		rc = can_units_load(s);
	/* Another program may have left it in motion, without a deadman that stops it. */
	if (!rc)
		rc = cia402_power_off(&s->client);
	if (!rc)
		rc = set_up_can_session(s);
	if (!rc)
		adopt_fault(s);
	return rc;
}

/*
 * The drive reports only in homing mode whether it is homed. Enter that as the node's owner for
 * a moment, so that no other program drives it.
 */
static int watch_homed(struct can_session *s, const struct can_transport *transport,
		       const struct incise_backend_request *request)
{
	struct incise_error *err = s->client.err;
	uint32_t word;
	bool alone;
	int rc = open_bus(s, transport, request, false);

	if (rc)
		return rc;
	s->master.own = (uint8_t)request->actuator->can.master;
	rc = prepare(s);
	/* Nor may another kind of master drive it. */
	s->client.err = NULL;
	alone = !rc && !check_alone(s);
	s->client.err = err;
	if (alone && !canopen_read(&s->master, 0x6041, 0, 2, &word) &&
	    cia402_state((uint16_t)word) == CIA402_DISABLED)
		rc = read_homed(s);
	s->bus->ops->close(s->bus);
	s->bus = NULL;
	return rc;
}

static int find_inputs(struct can_session *s)
{
	uint32_t inputs;
	bool has;
	int rc = cia402_read_optional(&s->client, &digital_inputs, &inputs, &has);

	if (!rc)
		set_inputs(s, has);
	return rc;
}

int can_session_watch(struct can_session *s, const struct can_transport *transport,
		      const struct incise_backend_request *request,
		      struct incise_error *err)
{
	int rc;

	begin_can_session(s, request->where, err);
	s->actuator = *request->actuator;
	rc = watch_homed(s, transport, request);
	if (rc && rc != -EBUSY)
		return rc;
	if (err)
		*err = (struct incise_error){0};
	rc = open_bus(s, transport, request, true);
	if (!rc)
		rc = prepare(s);
	/* No heartbeats. */
	s->master.own = 0;
	if (!rc)
		rc = find_inputs(s);
	return rc ? rc : read_position(s, false);
}

/* A pressed e-stop forbids power, a released one allows it. */
static int read_inputs(struct can_session *s)
{
	uint32_t inputs;
	int rc;

	if (!s->supported.inputs)
		return 0;
	rc = cia402_read(&s->client, &digital_inputs, &inputs);
	if (rc)
		return rc;
	can_axis_inputs(&s->axis, inputs);
	return 0;
}

/* A drive that shows its mode with power only shows it in TPDO1: the axis waits for it. */
static int set_mode(struct can_session *s, enum cia402_mode mode)
{
	int rc = cia402_set_mode(&s->client, mode);

	if (rc > 0 && !s->setup.mode_mapped) {
		s->setup.mode_mapped = true;
		rc = cia402_configure(&s->client, &s->setup, &s->supported);
		if (!rc)
			rc = cia402_set_mode(&s->client, mode);
	}
	return rc < 0 ? rc : 0;
}

int can_session_ready(struct can_session *s, bool homing, struct incise_error *err)
{
	const struct incise_actuator *a = &s->actuator;
	double per_turn_s = s->units.velocity_per_turn_s / a->lead_mm;
	int64_t now = s->bus->ops->now(s->bus);
	int rc = 0;

	begin_can_session(s, s->name, err);
	if (!s->is_setup || s->boots != s->master.boots)
		rc = set_up_can_session(s);
	/* Unhomed until homing succeeds. */
	s->is_homed = s->is_homed && (!homing || a->can.absolute);
	if (!rc && homing)
		rc = write_range(s);
	if (!rc && homing)
		rc = cia402_set_homing(
			&s->client, a->can.homing_method,
			can_units_whole(a->home_mm_s * per_turn_s),
			can_units_whole(a->home_mm_s / 10 * per_turn_s),
			can_units_whole(a->acceleration_mm_s2 / a->lead_mm *
					s->units.acceleration_per_turn_s2));
	if (!rc)
		rc = set_mode(s, homing ? CIA402_HOMING : s->setup.mode);
	if (!rc)
		rc = read_inputs(s);
	if (rc)
		return rc;
	rc = canopen_await(&s->master, canopen_is_operational, now + READY_NS);
	return rc ? incise_error_set(err, -rc,
				     "%s: does not become operational, and is %s: %s; "
				     "check its power and cable",
				     s->name, canopen_state_name(s->master.state),
				     strerror(-rc))
		  : 0;
}

int can_session_clear(struct can_session *s, struct incise_error *err)
{
	int state = s->bus->ops->state(s->bus), rc;

	begin_can_session(s, s->name, err);
	if (state == CAN_STATE_BUS_OFF)
		return incise_error_set(err, EBUSY,
					"%s: cannot be cleared: %s is still bus-off; "
					"`ip link set %s type can restart`, then clear",
					s->name, s->bus->name, s->bus->name);
	rc = cia402_power_off(&s->client);
	if (!rc)
		rc = cia402_clear(&s->client);
	/* After a fault its old setup is not trusted. */
	if (!rc)
		rc = set_up_can_session(s);
	if (!rc)
		rc = read_inputs(s);
	if (!rc)
		can_axis_cleared(&s->axis);
	return rc;
}

/*
 * Homing gives the edge the count 0, from which the drive brakes: where its count says otherwise, it was not set,
 * and the shaft is elsewhere than it seems.
 */
static int check_homed(struct can_session *s, struct incise_error *err)
{
	const struct incise_actuator *a = &s->actuator;
	double off_mm = s->axis.position / can_units_per_mm(s);
	double brake_mm = a->home_mm_s * a->home_mm_s / (2 * a->acceleration_mm_s2);

	if (fabs(off_mm) <= brake_mm + a->can.following_mm &&
	    can_axis_is_within(&s->axis))
		return 0;
	s->is_homed = false;
	s->axis.motion.status.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	return incise_error_set(
		err, EIO,
		"%s: after its homing it reports %.3f mm in place of 0: its "
		"count was not set; look for a home position or an offset "
		"of its own beside 607C in its setup",
		s->name, off_mm);
}

int can_session_homed(struct can_session *s, struct incise_error *err)
{
	int rc;

	begin_can_session(s, s->name, err);
	s->is_homed = true;
	rc = read_position(s, false);
	if (!rc)
		rc = check_homed(s, err);
	return rc ? rc : write_range(s);
}

void can_session_close(struct can_session *s)
{
	if (!s->bus)
		return;
	begin_can_session(s, s->name, NULL);
	/*
	 * Only a drive that reports to have no power may stop watching this side: else only its
	 * deadman stops it now.
	 */
	if (s->is_setup && s->master.own && !cia402_power_off(&s->client)) {
		canopen_write(&s->master, 0x1016, 1, 4, 0);
		canopen_send_nmt(&s->master, CANOPEN_PREPARE);
	}
	s->bus->ops->close(s->bus);
	s->bus = NULL;
}

/* --- watching --- */

static void receive_can_session(struct can_session *s, int64_t now)
{
	struct can_axis *axis = &s->axis;
	struct can_frame frame;
	uint32_t inputs;
	int64_t t_ns;

	for (int i = 0;
	     i < WATCH_FRAMES && s->bus->ops->receive(s->bus, &frame, &t_ns) > 0; i++) {
		uint32_t function = canopen_handle(&s->master, &frame, t_ns);

		if (function == CANOPEN_TPDO1 &&
		    cia402_parse_status(&frame, &axis->statusword, &axis->position,
					&axis->mode))
			s->watch.tpdo_ns = now;
		else if (function == CANOPEN_TPDO2 &&
			 cia402_parse_inputs(&frame, &inputs))
			can_axis_inputs(axis, inputs);
	}
}

static int read_status(struct can_session *s)
{
	struct can_axis *axis = &s->axis;
	uint32_t word, counts, inputs;
	int rc = canopen_read(&s->master, 0x6041, 0, 2, &word);

	if (!rc)
		rc = canopen_read(&s->master, 0x6064, 0, 4, &counts);
	if (!rc && axis->setup.inputs)
		rc = canopen_read(&s->master, 0x60fd, 0, 4, &inputs);
	if (rc)
		return rc;
	if (axis->setup.inputs)
		can_axis_inputs(axis, inputs);
	axis->statusword = (uint16_t)word;
	axis->position = (int32_t)counts;
	return 0;
}

static unsigned int state_of(enum cia402_state state, bool moves)
{
	switch (state) {
	case CIA402_ENABLED:
		return moves ? INCISE_STEPPER_STATE_MOVING : INCISE_STEPPER_STATE_READY;
	case CIA402_QUICK_STOP:
	case CIA402_FAULT_REACTION:
		return INCISE_STEPPER_STATE_STOPPING;
	case CIA402_FAULT:
		return INCISE_STEPPER_STATE_FAULT;
	default:
		return INCISE_STEPPER_STATE_DISABLED;
	}
}

/* Publish the drive's own state, without faults that only the program driving it latched. */
static void publish(struct can_session *s, int rc, int64_t now)
{
	struct can_axis *axis = &s->axis;
	struct incise_motion *m = &axis->motion;
	enum cia402_state state = cia402_state(axis->statusword);
	double at = (double)can_axis_steps(axis, axis->position);
	double dt = (double)(now - s->watch.looked_ns) / INCISE_NS_PER_S;
	bool moves = s->watch.looked_ns && dt > 0 &&
		     fabs(at - s->watch.position) > STILL_STEPS_S * dt;

	s->watch.looked_ns = now;
	s->watch.position = at;
	m->status.position = (int64_t)at;
	m->status.state = state_of(state, moves);
	m->status.faults = 0;
	if (rc)
		m->status.faults = INCISE_STEPPER_FAULT_LOST;
	else if (state == CIA402_FAULT)
		m->status.faults = INCISE_STEPPER_FAULT_ALARM;
	if (m->status.faults)
		m->status.state = INCISE_STEPPER_STATE_FAULT;
	incise_motion_publish(m, now);
}

void can_session_watch_cycle(struct can_session *s)
{
	int64_t now = s->bus->ops->now(s->bus);
	int rc = 0;

	receive_can_session(s, now);
	if (!s->watch.tpdo_ns || now - s->watch.tpdo_ns > WATCH_NS)
		rc = read_status(s);
	if (!rc && cia402_state(s->axis.statusword) == CIA402_FAULT)
		find_cause(s);
	else
		s->axis.cause = CAN_AXIS_NO_REASON;
	publish(s, rc, s->bus->ops->now(s->bus));
}
