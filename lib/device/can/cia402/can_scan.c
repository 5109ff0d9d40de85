// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A scan of a bus: request the device type of all 127 node ids at once, then identify those
 * that answer. Only objects are read.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "can_session.h"
#include "can_stepper.h"

#define MS 1000000LL
#define NODES 128
#define SPACING_NS (2 * MS)   /* between two requests; fits a bus at 10 kbit/s */
#define ANSWERS_NS (150 * MS) /* after the last one */
#define ANSWER_NS (100 * MS)  /* of a node that answered before; there may be 127 */

struct scan {
	const struct can_transport *transport;
	struct can_bus *bus;
	const char *device;
	bool there[NODES];
};

/* Note the nodes that answer. */
static int receive_can_scan(struct scan *scan, int64_t until_ns)
{
	struct can_bus *bus = scan->bus;
	struct can_frame frame;
	int64_t t_ns;
	int rc = 0;

	while (bus->ops->now(bus) < until_ns) {
		rc = bus->ops->wait(bus, until_ns);
		if (rc < 0)
			return rc;
		while ((rc = bus->ops->receive(bus, &frame, &t_ns)) > 0) {
			uint32_t function = frame.can_id & 0x780;

			if (frame.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG))
				continue;
			if (function == CANOPEN_SDO_ANSWER)
				scan->there[frame.can_id & 0x7f] = true;
		}
		if (rc < 0)
			return rc;
	}
	return 0;
}

static int request_all(struct scan *scan, unsigned int only)
{
	struct can_frame frame = {.can_dlc = 8, .data = {0x40, 0x00, 0x10}};
	struct can_bus *bus = scan->bus;
	int rc = 0;

	for (unsigned int node = 1; node < NODES && !rc; node++) {
		if (only && node != only)
			continue;
		frame.can_id = CANOPEN_SDO_REQUEST + node;
		rc = bus->ops->send(bus, &frame);
		/* A full queue: no node acknowledges, or the bus is slow. */
		for (int i = 0; rc == -ENOBUFS && i < 10; i++) {
			rc = receive_can_scan(scan, bus->ops->now(bus) + SPACING_NS);
			if (!rc)
				rc = bus->ops->send(bus, &frame);
		}
		if (!rc)
			rc = receive_can_scan(scan, bus->ops->now(bus) + SPACING_NS);
	}
	return rc ? rc : receive_can_scan(scan, bus->ops->now(bus) + ANSWERS_NS);
}

struct node {
	struct canopen master;
	struct incise_scan_device *device;
	bool silent; /* it gets no more requests */
};

/* Returns whether the node has the object. */
static bool read_object(struct node *n, uint16_t index, uint8_t sub, int size,
			uint32_t *value)
{
	int rc;

	*value = 0;
	if (n->silent)
		return false;
	rc = canopen_read(&n->master, index, sub, size, value);
	n->silent = rc && rc != -EREMOTEIO && rc != -EPROTO;
	return !rc;
}

static void add_modes(struct node *n)
{
	static const char *const names[] = {"pp", "vl", "pv",  "tq",  NULL,
					    "hm", "ip", "csp", "csv", "cst"};
	char text[80] = "";
	uint32_t modes;

	if (!read_object(n, 0x6502, 0, 4, &modes))
		return;
	for (unsigned int i = 0; i < sizeof(names) / sizeof(*names); i++)
		if (modes >> i & 1 && names[i])
			snprintf(text + strlen(text), sizeof(text) - strlen(text), "%s%s",
				 *text ? " " : "", names[i]);
	incise_scan_tell(n->device, "modes", "%s", text);
}

/* Add the state and error of a drive. */
static void add_drive(struct node *n, const char *name)
{
	struct incise_scan_device *device = n->device;
	const char *state = "it does not report its state";
	char words[100] = "no fault";
	uint32_t word, mode, code = 0;

	if (read_object(n, 0x6041, 0, 2, &word)) {
		state = cia402_state_name(cia402_state((uint16_t)word));
		incise_scan_tell(device, "statusword", "0x%04x", word);
		incise_scan_tell(device, "drive_state", "%s", state);
	}
	if (read_object(n, 0x6061, 0, 1, &mode))
		incise_scan_tell(device, "mode", "%s", cia402_mode_name((int8_t)mode));
	add_modes(n);
	if (read_object(n, 0x603f, 0, 2, &code)) {
		if (code)
			canopen_emcy_text((uint16_t)code, words, sizeof(words));
		incise_scan_tell(device, "error_code", "0x%04x", code);
		incise_scan_tell(device, "error", "%s", words);
	}
	snprintf(device->what, sizeof(device->what), "%.50s: %s%s%.40s",
		 *name ? name : "CiA 402 drive", state, code ? ", " : "",
		 code ? words : "");
}

/* Add the parts of its identity that the node has. */
static void add_identity(struct node *n, char *name, size_t size)
{
	static const struct {
		const char *key;
		uint8_t sub;
	} identity[] = {
		{"vendor_id", 1}, {"product_code", 2}, {"revision", 3}, {"serial", 4}};
	uint32_t value;

	*name = '\0';
	if (!n->silent && !canopen_read_text(&n->master, 0x1008, 0, name, size) && *name)
		incise_scan_tell(n->device, "name", "%s", name);
	for (size_t i = 0; i < sizeof(identity) / sizeof(*identity); i++)
		if (read_object(n, 0x1018, identity[i].sub, 4, &value))
			incise_scan_tell(n->device, identity[i].key, "0x%08x", value);
	if (read_object(n, 0x1001, 0, 1, &value))
		incise_scan_tell(n->device, "error_register", "0x%02x", value);
}

static void describe_can_scan(struct scan *scan, unsigned int node,
			      struct incise_scan_device *device)
{
	struct node n = {
		.master = {.bus = scan->bus,
			   .node = (uint8_t)node,
			   .answer_ns = ANSWER_NS,
			   .state = CANOPEN_UNKNOWN},
		.device = device,
	};
	char name[64];
	uint32_t type;
	bool has_type;

	*device = (struct incise_scan_device){0};
	snprintf(device->device, sizeof(device->device), "%s:%.80s:0x%02x",
		 scan->transport->name, scan->device, node);
	incise_scan_tell(device, "node", "%u", node);
	has_type = read_object(&n, 0x1000, 0, 4, &type);
	if (has_type)
		incise_scan_tell(device, "device_type", "0x%08x", type);
	add_identity(&n, name, sizeof(name));
	if (n.master.last_heartbeat_ns)
		incise_scan_tell(device, "nmt_state", "%s",
				 canopen_state_name(n.master.state));
	/* List other nodes too. */
	if (has_type && (type & 0xffff) == CIA402_PROFILE)
		add_drive(&n, name);
	else if (has_type)
		snprintf(device->what, sizeof(device->what),
			 "%.50s: CANopen profile %u, not a CiA 402 drive",
			 *name ? name : "a device", type & 0xffff);
	else
		snprintf(device->what, sizeof(device->what),
			 "%.50s: reports no device type, not a CiA 402 drive",
			 *name ? name : "a device");
	device->usable = has_type && (type & 0xffff) == CIA402_PROFILE;
}

static int scan_bus(struct scan *scan, unsigned int only, incise_scan_found *found,
		    void *context)
{
	struct incise_scan_device device;
	int rc = request_all(scan, only);

	for (unsigned int node = 1; node < NODES && !rc; node++)
		if (scan->there[node]) {
			describe_can_scan(scan, node, &device);
			rc = found(context, &device);
		}
	return rc;
}

int can_stepper_scan(const struct can_transport *transport, const char *arguments,
		     incise_scan_found *found, void *context, struct incise_error *err)
{
	char device[200], where[100];
	struct can_bus_request request = {.where = where, .device = device};
	struct scan scan = {.transport = transport, .device = device};
	unsigned int only = 0;
	int rc;

	snprintf(where, sizeof(where), "%s:%.80s", transport->name, arguments);
	if (!*arguments || *arguments == ':' || *arguments == '@')
		return incise_error_set(err, EINVAL,
					"%s: expected a bus, for example can:can0 or "
					"slcan:/dev/ttyACM0; correct it",
					where);
	if (can_session_parse(arguments, device, sizeof(device), &only))
		snprintf(device, sizeof(device), "%s", arguments);
	rc = transport->open(&scan.bus, &request, err);
	if (rc)
		return rc;
	rc = scan_bus(&scan, only, found, context);
	scan.bus->ops->close(scan.bus);
	if (rc < 0)
		incise_error_set(err, -rc, "%s: %s; check its cable, and that it is up",
				 where, strerror(-rc));
	return rc;
}
