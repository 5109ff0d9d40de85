// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_scan.c: a scan finds the nodes of a bus and writes nothing to
 * them.
 */
#include "../unit.h"
#include "rig.h"

static struct can_rig rig;

struct list {
	struct incise_scan_device device[4];
	int n, end;
};

static int found(void *context, const struct incise_scan_device *device)
{
	struct list *list = context;

	assert_true(list->n < 4);
	list->device[list->n++] = *device;
	return list->end;
}

static struct list list;
static struct incise_error err;

/* Of the first node that was found. */
static const char *property(const char *key)
{
	const struct incise_scan_device *device = &list.device[0];

	for (int i = 0; i < device->n; i++)
		if (!strcmp(device->property[i].key, key))
			return device->property[i].text;
	return "(there is none)";
}

/* Scan the bus, or a node of it; what was found, from then on. */
static int scan(const char *arguments)
{
	list.n = 0;
	err = (struct incise_error){0};
	return can_stepper_scan(&can_rig_of, arguments, found, &list, &err);
}

TEST(a_drive_is_listed_with_what_it_is)
{
	static const char *const arguments[] = {"can-test", "can-test:0x10"};

	for (int i = 0; i < 2; i++) {
		can_rig_init(&rig);
		assert_int_equal(scan(arguments[i]), 0);
		assert_int_equal(list.n, 1);
		assert_string_equal(list.device[0].device, "can:can-test:0x10");
		assert_string_equal(list.device[0].what, "SIM1: switch-on disabled");
		assert_string_equal(property("vendor_id"), "0x00000286");
		assert_string_equal(property("serial"), "0x00001267");
		assert_string_equal(property("drive_state"), "switch-on disabled");
		assert_string_equal(property("error"), "no fault");
		assert_non_null(strstr(property("modes"), "csp csv cst"));
		assert_true(list.device[0].usable);
		/* It only read, and sent no heartbeat. */
		assert_int_equal(rig.drive.master_beats, 0);
		assert_int_equal(rig.drive.rpdos + rig.drive.syncs, 0);
		assert_int_equal(rig.drive.nmt, CANOPEN_PRE_OPERATIONAL);
	}
}

TEST(a_fault_is_told)
{
	can_rig_init(&rig);
	drive_fault(&rig.drive, 0x4310);
	assert_int_equal(scan("can-test"), 0);
	assert_int_equal(list.n, 1);
	assert_string_equal(property("drive_state"), "fault");
	assert_string_equal(property("error_code"), "0x4310");
	assert_non_null(strstr(list.device[0].what, "fault, "));
	assert_non_null(strstr(property("error"), "(4310h)"));
}

TEST(what_is_no_drive_is_listed_too)
{
	can_rig_init(&rig);
	rig.drive.od[OD_TYPE].value = 0x000f0191;
	drive_lacks(&rig.drive, 0x1008, 0);
	assert_int_equal(scan("can-test"), 0);
	assert_int_equal(list.n, 1);
	assert_non_null(strstr(list.device[0].what, "401"));
	assert_false(list.device[0].usable);
}

/* Missing objects are left out, and a node that stops answering gets no more requests. */
TEST(what_is_not_told_is_not_made_up)
{
	can_rig_init(&rig);
	rig.drive.abort_index = 0x1018;
	rig.drive.abort_sub = -1;
	assert_int_equal(scan("can-test"), 0);
	assert_string_equal(property("vendor_id"), "(there is none)");
	assert_true(list.device[0].usable);
	can_rig_init(&rig);
	rig.drive.drop_at = 2;
	assert_int_equal(scan("can-test"), 0);
	assert_int_equal(list.n, 1);
	assert_int_equal(rig.drive.requests, 2);
	assert_string_equal(property("device_type"), "(there is none)");
	assert_non_null(strstr(list.device[0].what, "no device type"));
	assert_false(list.device[0].usable);
}

TEST(nobody_and_nothing)
{
	can_rig_init(&rig);
	rig.drive.unplugged = true;
	assert_int_equal(scan("can-test"), 0);
	assert_int_equal(list.n, 0);
	/* No node acknowledges. */
	rig.drive.send_error = -ENOBUFS;
	assert_int_equal(scan("can-test"), -ENOBUFS);
	assert_non_null(strstr(err.text, "can:can-test: "));
	can_rig_init(&rig);
	rig.drive.receive_error = -ENETDOWN;
	assert_int_equal(scan("can-test"), -ENETDOWN);
	/* The callback may end the scan. */
	can_rig_init(&rig);
	list.end = 7;
	assert_int_equal(scan("can-test"), 7);
}
