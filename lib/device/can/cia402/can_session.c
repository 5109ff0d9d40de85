// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A drive and the bus that leads to it; see can_link.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <linux/can/netlink.h>
#include "can_units.h"
#include "cia402_object.h"
#include "can_session.h"

#define MS 1000000LL
#define DEVICE_MAX 200
#define LISTEN_NS (60 * MS) /* for another master; a SYNC comes every 20 ms at least */
#define READY_NS (500 * MS) /* until it says that it is operational */

static const struct cia402_object digital_inputs = {0x60fd, 0, 4, "digital inputs"};

int can_link_parse(const char *arguments, char *device, size_t size, unsigned int *node)
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

/* Only what concerns this drive, and what would show another master. */
static int set_filter(struct can_link *link)
{
	const uint32_t node = link->master.node;
	const uint32_t ids[] = {
		CANOPEN_NMT,
		CANOPEN_SYNC,
		CANOPEN_EMCY + node,
		CANOPEN_TPDO1 + node,
		CANOPEN_TPDO2 + node,
		CANOPEN_RPDO1 + node,
		CANOPEN_SDO_ANSWER + node,
		CANOPEN_HEARTBEAT + node,
		CANOPEN_HEARTBEAT + link->master.own,
	};
	struct can_filter filter[sizeof(ids) / sizeof(*ids)];
	int n = sizeof(ids) / sizeof(*ids);

	for (int i = 0; i < n; i++)
		filter[i] = (struct can_filter){ids[i], CAN_EFF_FLAG | CAN_RTR_FLAG |
								CAN_SFF_MASK};
	return link->bus->ops->filter(link->bus, filter, n);
}

static int open_bus(struct can_link *link, const struct can_transport *transport,
		    const struct incise_backend_request *asked, bool look,
		    struct incise_error *err)
{
	const struct incise_actuator_can *can = &asked->actuator->can;
	char device[DEVICE_MAX];
	struct can_bus_request request = {
		.where = asked->where, .device = device, .bitrate = can->bitrate};
	unsigned int node;
	int rc = can_link_parse(asked->arguments, device, sizeof(device), &node);

	if (rc)
		return incise_error_set(
			err, EINVAL,
			"%s: expected %s:DEVICE:NODE such as %s with a node id of 1 to 127, "
			"found %s:%.60s; `incise info %s` lists drives",
			asked->where, transport->name,
			strcmp(transport->name, "can") ? "slcan:/dev/ttyACM0:0x10"
						       : "can:can0:0x10",
			transport->name, asked->arguments,
			strcmp(transport->name, "can") ? "slcan:/dev/ttyACM0"
						       : "can:can0");
	if (node == (unsigned int)can->master)
		return incise_error_set(
			err, EINVAL,
			"%s: node %u is also actuator.can.master, the id of "
			"this program's heartbeat; give another one there",
			asked->where, node);
	request.node = look ? 0 : (uint8_t)node;
	rc = transport->open(&link->bus, &request, err);
	if (rc)
		return rc;
	link->master = (struct canopen){
		.bus = link->bus, .node = (uint8_t)node, .state = CANOPEN_UNKNOWN};
	snprintf(link->where, sizeof(link->where), "drive 0x%02x at %.36s", node,
		 link->bus->name);
	return 0;
}

static bool is_foreign(const struct canopen *master)
{
	return master->foreign;
}

static int check_alone(struct can_link *link, const char *where, struct incise_error *err)
{
	int64_t until = link->bus->ops->now(link->bus) + LISTEN_NS;
	int rc = canopen_await(&link->master, is_foreign, until);

	if (rc == -ETIMEDOUT)
		return 0;
	if (rc)
		return incise_error_set(err, -rc, "%s: %s: %s", where, link->bus->name,
					strerror(-rc));
	return incise_error_set(
		err, EBUSY,
		"%s: another master sends SYNCs, set-points or heartbeats of node 0x%02x on "
		"%s; end it, or give another actuator.can.master",
		where, link->master.own, link->bus->name);
}

/* Where it stands, and what of that is the machine's. @keep: a count that goes on. */
static int take_position(struct can_link *link, bool keep, const char *where,
			 struct incise_error *err)
{
	const struct incise_actuator *a = &link->actuator;
	double per_mm = link->axis.setup.counts_per_step / incise_actuator_step_mm(a);
	struct incise_abi_status *status = &link->axis.motion.status;
	const struct cia402_object position = {0x6064, 0, 4, "position"};
	const struct cia402_talk talk = {&link->master, where, err};
	uint32_t counts;
	int rc = cia402_ask(&talk, &position, &counts);

	if (rc)
		return rc;
	link->axis.position = (int32_t)counts;
	if (link->is_homed)
		link->axis.zero_counts = -a->home_mm * per_mm;
	else if (!keep)
		link->axis.zero_counts = (int32_t)counts;
	status->position = can_axis_steps(&link->axis, link->axis.position);
	status->flags &= ~INCISE_STEPPER_FLAG_HOMED;
	if (link->is_homed)
		status->flags |= INCISE_STEPPER_FLAG_HOMED;
	return 0;
}

static int ask_homed(struct can_link *link, const char *where, struct incise_error *err)
{
	link->is_homed = link->actuator.can.absolute;
	if (link->is_homed || !link->actuator.can.homing_method)
		return 0;
	return cia402_homed(&link->master, link->setup.mode, &link->is_homed, where, err);
}

/* Which of them are wired, only a person knows: all that 60FD has a bit for. */
static void have_inputs(struct can_link *link, bool inputs)
{
	struct can_axis_setup *setup = &link->axis.setup;

	setup->inputs = inputs;
	setup->wired =
		inputs ? INCISE_STEPPER_LINE_LIMIT_MIN | INCISE_STEPPER_LINE_LIMIT_MAX |
				 INCISE_STEPPER_LINE_HOME | INCISE_STEPPER_LINE_ESTOP
		       : 0;
}

/* All of it, also after it began anew. */
static int set_up(struct can_link *link, const char *where, struct incise_error *err)
{
	bool was_homed = link->is_homed, keep;
	int rc = ask_homed(link, where, err);

	keep = link->is_setup && link->boots == link->master.boots &&
	       link->is_homed == was_homed;
	link->is_setup = false;
	if (!rc)
		rc = take_position(link, keep, where, err);
	if (rc)
		return rc;
	can_fit_range(link);
	if (!link->in_range)
		return incise_error_set(
			err, ERANGE,
			"%s: its position is %d counts, and with %g counts a turn the travel "
			"goes beyond what 32 bits hold; switch its power off and on, or see "
			"counts_per_turn in rig.conf",
			where, link->axis.position, link->units.counts_per_turn);
	link->boots = link->master.boots;
	rc = cia402_configure(&link->master, &link->setup, &link->taken, where, err);
	if (rc)
		return rc;
	link->is_setup = true;
	have_inputs(link, link->taken.inputs);
	link->axis.setup.inputs_timed = link->taken.inputs && link->taken.inputs_timed;
	return 0;
}

void can_link_ask_why(struct can_link *link)
{
	struct can_axis *axis = &link->axis;
	uint32_t code;

	if (axis->why != CAN_AXIS_NO_REASON)
		return;
	if (canopen_read(&link->master, 0x603f, 0, 2, &code))
		code = 0;
	axis->why_a = code;
	axis->why = code ? CAN_AXIS_EMCY : CAN_AXIS_DRIVE_FAULT;
}

/* A fault that it has from before: whoever drives it must hear of it. */
static void take_fault(struct can_link *link)
{
	struct can_axis *axis = &link->axis;
	uint32_t word = 0;

	if (canopen_read(&link->master, 0x6041, 0, 2, &word))
		return;
	axis->statusword = (uint16_t)word;
	if (cia402_state(axis->statusword) != CIA402_FAULT)
		return;
	axis->motion.status.faults |= INCISE_STEPPER_FAULT_DRIVER;
	axis->motion.status.state = INCISE_STEPPER_STATE_FAULT;
	can_link_ask_why(link);
}

static int know(struct can_link *link, const char *where, struct incise_error *err)
{
	const struct incise_actuator_can *can = &link->actuator.can;
	int rc = set_filter(link);

	if (rc)
		return incise_error_set(err, -rc, "%s: %s: cannot be filtered: %s", where,
					link->bus->name, strerror(-rc));
	link->units =
		(struct cia402_units){can->counts_per_turn, can->velocity_per_turn_s,
				      can->acceleration_per_turn_s2};
	rc = cia402_identify(&link->master, &link->identity, where, err);
	if (!rc)
		rc = cia402_units(&link->master, &link->units, where, err);
	if (rc)
		return rc;
	can_fit_steps(link);
	can_fit_setup(link);
	return can_fit_axis(link, where, err);
}

int can_link_open(struct can_link *link, const struct can_transport *transport,
		  const struct incise_backend_request *asked, struct incise_error *err)
{
	int rc = can_fit_deadman(asked->actuator, asked->where, err);

	link->actuator = *asked->actuator;
	if (!rc)
		rc = open_bus(link, transport, asked, false, err);
	if (rc)
		return rc;
	link->master.own = (uint8_t)asked->actuator->can.master;
	rc = set_filter(link);
	if (!rc)
		rc = check_alone(link, asked->where, err);
	/* One that another master stopped answers nothing else. */
	if (!rc && (rc = canopen_send_nmt(&link->master, CANOPEN_PREPARE)) < 0)
		rc = incise_error_set(err, -rc, "%s: %s: cannot send: %s", asked->where,
				      link->bus->name, strerror(-rc));
	if (!rc)
		rc = know(link, asked->where, err);
	if (!rc)
		rc = can_fit_load(link, asked->where, err);
	/* What another left in motion, and its own deadman did not stop. */
	if (!rc)
		rc = cia402_power_off(&link->master, asked->where, err);
	if (!rc)
		rc = set_up(link, asked->where, err);
	if (!rc)
		take_fault(link);
	return rc;
}

/*
 * Whether it is homed it tells in homing mode, and that is to be asked only where nobody
 * drives it: who owns it for a moment makes sure of that.
 */
static int look_alone(struct can_link *link, const struct can_transport *transport,
		      const struct incise_backend_request *asked,
		      struct incise_error *err)
{
	uint32_t word;
	bool alone;
	int rc = open_bus(link, transport, asked, false, err);

	if (rc)
		return rc;
	link->master.own = (uint8_t)asked->actuator->can.master;
	rc = know(link, asked->where, err);
	/* Nor under a master that is none of ours. */
	alone = !rc && !check_alone(link, asked->where, NULL);
	if (alone && !canopen_read(&link->master, 0x6041, 0, 2, &word) &&
	    cia402_state((uint16_t)word) == CIA402_DISABLED)
		rc = ask_homed(link, asked->where, err);
	link->bus->ops->close(link->bus);
	link->bus = NULL;
	return rc;
}

static int look_for_inputs(struct can_link *link, const char *where,
			   struct incise_error *err)
{
	const struct cia402_talk talk = {&link->master, where, err};
	uint32_t inputs;
	bool has;
	int rc = cia402_ask_if(&talk, &digital_inputs, &inputs, &has);

	if (!rc)
		have_inputs(link, has);
	return rc;
}

int can_link_look(struct can_link *link, const struct can_transport *transport,
		  const struct incise_backend_request *asked, struct incise_error *err)
{
	int rc;

	link->actuator = *asked->actuator;
	rc = look_alone(link, transport, asked, err);
	if (rc && rc != -EBUSY)
		return rc;
	if (err)
		*err = (struct incise_error){0};
	rc = open_bus(link, transport, asked, true, err);
	if (!rc)
		rc = know(link, asked->where, err);
	/* It sends nothing of its own. */
	link->master.own = 0;
	if (!rc)
		rc = look_for_inputs(link, asked->where, err);
	return rc ? rc : take_position(link, false, asked->where, err);
}

/* An e-stop that is pressed forbids power, and one that was let go no longer does. */
static int take_inputs(struct can_link *link, struct incise_error *err)
{
	const struct cia402_talk talk = {&link->master, link->where, err};
	uint32_t inputs;
	int rc;

	if (!link->taken.inputs)
		return 0;
	rc = cia402_ask(&talk, &digital_inputs, &inputs);
	if (rc)
		return rc;
	can_axis_inputs(&link->axis, inputs);
	return 0;
}

static bool is_operational(const struct canopen *master)
{
	return master->state == CANOPEN_OPERATIONAL;
}

int can_link_ready(struct can_link *link, bool homing, struct incise_error *err)
{
	const struct incise_actuator *a = &link->actuator;
	double per_turn_s = link->units.velocity_per_turn_s / a->lead_mm;
	int64_t now = link->bus->ops->now(link->bus);
	int rc = 0;

	if (!link->is_setup || link->boots != link->master.boots)
		rc = set_up(link, link->where, err);
	/* Until it has: whether it fails, or is stopped on the way. */
	link->is_homed = link->is_homed && (!homing || a->can.absolute);
	if (!rc && homing)
		rc = cia402_set_homing(
			&link->master, a->can.homing_method,
			can_fit_units(a->home_mm_s * per_turn_s),
			can_fit_units(a->home_mm_s / 10 * per_turn_s),
			can_fit_units(a->acceleration_mm_s2 / a->lead_mm *
				      link->units.acceleration_per_turn_s2),
			link->where, err);
	if (!rc)
		rc = cia402_set_mode(&link->master,
				     homing ? CIA402_HOMING : link->setup.mode,
				     link->where, err);
	if (!rc)
		rc = take_inputs(link, err);
	if (rc)
		return rc;
	rc = canopen_await(&link->master, is_operational, now + READY_NS);
	return rc ? incise_error_set(
			    err, -rc,
			    "%s: does not become operational, and is %s: %s; see "
			    "its power and cable",
			    link->where, canopen_state_name(link->master.state),
			    strerror(-rc))
		  : 0;
}

int can_link_clear(struct can_link *link, struct incise_error *err)
{
	int state = link->bus->ops->state(link->bus), rc;

	if (state == CAN_STATE_BUS_OFF)
		return incise_error_set(
			err, EBUSY,
			"%s: cannot be cleared: %s is still bus-off; `ip link set %s type can "
			"restart`, then clear",
			link->where, link->bus->name, link->bus->name);
	rc = cia402_power_off(&link->master, link->where, err);
	if (!rc)
		rc = cia402_clear(&link->master, link->where, err);
	/* Whatever it was, nobody need trust what it still knows. */
	if (!rc)
		rc = set_up(link, link->where, err);
	if (!rc)
		rc = take_inputs(link, err);
	if (!rc)
		can_axis_cleared(&link->axis);
	return rc;
}

int can_link_homed(struct can_link *link, struct incise_error *err)
{
	int rc;

	link->is_homed = true;
	rc = take_position(link, false, link->where, err);
	if (rc)
		return rc;
	can_fit_range(link);
	return cia402_set_range(&link->master, link->setup.position_min,
				link->setup.position_max, link->where, err);
}

void can_link_close(struct can_link *link)
{
	if (!link->bus)
		return;
	/*
	 * It need not watch over who has gone in good order; else its own watch is what stops
	 * it now. That it has no power it must have said itself.
	 */
	if (link->is_setup && link->master.own &&
	    !cia402_power_off(&link->master, link->where, NULL)) {
		canopen_write(&link->master, 0x1016, 1, 4, 0);
		canopen_send_nmt(&link->master, CANOPEN_PREPARE);
	}
	link->bus->ops->close(link->bus);
	link->bus = NULL;
}
