// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Who is on a bus: each of 127 node ids is asked for its device type, all at once, and those
 * that answer are asked what they are. Only objects are read.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "can_link.h"
#include "can_stepper.h"

#define MS 1000000LL
#define NODES 128
#define SPACING_NS \
	(2 * MS) /* between two requests: a bus at 10 kbit/s still carries that */
#define ANSWERS_NS (150 * MS) /* after the last one */

struct scan {
	const struct can_transport *transport;
	struct can_bus *bus;
	const char *device;
	bool there[NODES];
};

static void add(struct incise_scan_device *device, const char *key, const char *format,
		...) __attribute__((format(printf, 3, 4)));

static void add(struct incise_scan_device *device, const char *key, const char *format,
		...)
{
	struct incise_scan_property *property;
	va_list args;

	if (device->n >= INCISE_SCAN_PROPERTIES)
		return;
	property = &device->property[device->n++];
	property->key = key;
	va_start(args, format);
	vsnprintf(property->text, sizeof(property->text), format, args);
	va_end(args);
}

/* Whoever answers or beats. */
static int hear(struct scan *scan, int64_t until_ns)
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

static int ask_all(struct scan *scan, unsigned int only)
{
	struct can_frame frame = {.can_dlc = 8, .data = {0x40, 0x00, 0x10}};
	struct can_bus *bus = scan->bus;
	int rc = 0;

	for (unsigned int node = 1; node < NODES && !rc; node++) {
		if (only && node != only)
			continue;
		frame.can_id = CANOPEN_SDO_REQUEST + node;
		rc = bus->ops->send(bus, &frame);
		/* A full queue: nobody acknowledges, or it is slow. */
		for (int i = 0; rc == -ENOBUFS && i < 10; i++) {
			rc = hear(scan, bus->ops->now(bus) + SPACING_NS);
			if (!rc)
				rc = bus->ops->send(bus, &frame);
		}
		if (!rc)
			rc = hear(scan, bus->ops->now(bus) + SPACING_NS);
	}
	return rc ? rc : hear(scan, bus->ops->now(bus) + ANSWERS_NS);
}

static void add_modes(struct incise_scan_device *device, uint32_t modes)
{
	static const char *const names[] = {"pp", "vl", "pv",  "tq",  NULL,
					    "hm", "ip", "csp", "csv", "cst"};
	char text[80] = "";

	for (unsigned int i = 0; i < sizeof(names) / sizeof(*names); i++)
		if (modes >> i & 1 && names[i])
			snprintf(text + strlen(text), sizeof(text) - strlen(text), "%s%s",
				 *text ? " " : "", names[i]);
	add(device, "modes", "%s", text);
}

/* Of a drive: what it does, and what is wrong with it. */
static void add_drive(struct canopen *master, struct incise_scan_device *device,
		      const struct cia402_identity *identity)
{
	uint32_t word = 0, mode = 0, code = 0, reg = 0, type = identity->type;
	bool drive = (type & 0xffff) == 402;
	char words[100] = "no fault";
	const char *state = "";

	if (!canopen_read(master, 0x1001, 0, 1, &reg))
		add(device, "error_register", "0x%02x", reg);
	if (drive && !canopen_read(master, 0x6041, 0, 2, &word)) {
		state = cia402_state_name(cia402_state((uint16_t)word));
		add(device, "statusword", "0x%04x", word);
		add(device, "drive_state", "%s", state);
	}
	if (drive && !canopen_read(master, 0x6061, 0, 1, &mode))
		add(device, "mode", "%s", cia402_mode_name((int8_t)mode));
	if (drive)
		add_modes(device, identity->modes);
	if (drive && !canopen_read(master, 0x603f, 0, 2, &code)) {
		if (code)
			canopen_emcy_text((uint16_t)code, words, sizeof(words));
		add(device, "error_code", "0x%04x", code);
		add(device, "error", "%s", words);
	}
	if (drive)
		snprintf(device->what, sizeof(device->what), "%.50s: %s%s%.40s",
			 *identity->name ? identity->name : "CiA 402 drive", state,
			 code ? ", " : "", code ? words : "");
	else
		snprintf(device->what, sizeof(device->what),
			 "%.50s: CANopen profile %u, no CiA 402 drive",
			 *identity->name ? identity->name : "a device", type & 0xffff);
}

static void describe(struct scan *scan, unsigned int node,
		     struct incise_scan_device *device)
{
	struct canopen master = {.bus = scan->bus, .node = (uint8_t)node};
	struct cia402_identity identity = {0};
	struct incise_error ignored = {0};

	*device = (struct incise_scan_device){0};
	snprintf(device->device, sizeof(device->device), "%s:%.80s:0x%02x",
		 scan->transport->name, scan->device, node);
	/* What is no drive is listed too: it says why it is not found as one. */
	cia402_identify(&master, &identity, scan->device, &ignored);
	add(device, "node", "%u", node);
	add(device, "device_type", "0x%08x", identity.type);
	if (*identity.name)
		add(device, "name", "%s", identity.name);
	add(device, "vendor_id", "0x%08x", identity.vendor);
	add(device, "product_code", "0x%08x", identity.product);
	add(device, "revision", "0x%08x", identity.revision);
	add(device, "serial", "0x%08x", identity.serial);
	if (master.state != CANOPEN_UNKNOWN && master.heard_ns)
		add(device, "nmt_state", "%s", canopen_state_name(master.state));
	add_drive(&master, device, &identity);
}

static int scan_bus(struct scan *scan, unsigned int only, incise_scan_found *found,
		    void *context)
{
	struct incise_scan_device device;
	int rc = ask_all(scan, only);

	for (unsigned int node = 1; node < NODES && !rc; node++)
		if (scan->there[node]) {
			describe(scan, node, &device);
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
	if (can_link_parse(arguments, device, sizeof(device), &only))
		snprintf(device, sizeof(device), "%s", arguments);
	rc = transport->open(&scan.bus, &request, err);
	if (rc)
		return rc;
	rc = scan_bus(&scan, only, found, context);
	scan.bus->ops->close(scan.bus);
	if (rc < 0)
		incise_error_set(err, -rc,
				 "%s: %s; see its cable and `ip -details link "
				 "show`",
				 where, strerror(-rc));
	return rc;
}
