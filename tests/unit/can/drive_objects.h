/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The simulated drive's object dictionary and its SDO server: expedited both ways, a string
 * in segments, aborts as CiA 301 has them.
 */
#ifndef INCISE_TEST_DRIVE_OBJECTS_H
#define INCISE_TEST_DRIVE_OBJECTS_H

#include "drive_motion.h"

#define ABORT_TOGGLE 0x05030000
#define ABORT_TIMEOUT 0x05040000
#define ABORT_COMMAND 0x05040001
#define ABORT_ACCESS 0x06010000
#define ABORT_READ_ONLY 0x06010002
#define ABORT_NO_OBJECT 0x06020000
#define ABORT_NOT_MAPPED 0x06040041
#define ABORT_MAPPING_LENGTH 0x06040042
#define ABORT_LONG 0x06070012
#define ABORT_SHORT 0x06070013
#define ABORT_NO_SUB 0x06090011
#define ABORT_VALUE 0x06090030
#define ABORT_RANGE 0x06090036

static const enum drive_object_name drive_pdos[] = {
	OD_RPDO1_SUBS, OD_RPDO2_SUBS, OD_TPDO1_SUBS, OD_TPDO2_SUBS, OD_TPDO3_SUBS,
};
#define DRIVE_PDOS 5

/* NULL: the drive lacks it. */
static inline struct drive_object *drive_object(struct drive *d, uint16_t index,
						uint8_t sub)
{
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && d->od[i].sub == sub && d->od[i].size)
			return &d->od[i];
	return NULL;
}

/* Set the value after power-on. */
static inline void drive_set(struct drive *d, uint16_t index, uint8_t sub, uint32_t value)
{
	struct drive_object *o = drive_object(d, index, sub);

	o->value = o->initial = value;
}

/* Add an object that it lacks by default, of so many bytes. */
static inline void drive_has(struct drive *d, uint16_t index, uint8_t sub, uint8_t size,
			     uint32_t value)
{
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && d->od[i].sub == sub) {
			d->od[i].size = size;
			drive_set(d, index, sub, value);
		}
}

/* Remove an object; @sub -1: with all subs. */
static inline void drive_lacks(struct drive *d, uint16_t index, int sub)
{
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && (sub < 0 || d->od[i].sub == sub))
			d->od[i].size = 0;
}

static inline uint32_t drive_absent(struct drive *d, uint16_t index)
{
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && d->od[i].size)
			return ABORT_NO_SUB;
	return ABORT_NO_OBJECT;
}

static inline bool drive_pdo_on(const struct drive_object *pdo)
{
	return !(pdo[PDO_COB].value & 0x80000000);
}

/* Check the sub-objects of a mapping: 0 or an abort code. */
static inline uint32_t drive_mapping(struct drive *d, const struct drive_object *pdo,
				     uint32_t n)
{
	unsigned int bits = 0;

	if (n > 4)
		return ABORT_MAPPING_LENGTH;
	for (uint32_t i = 0; i < n; i++) {
		uint32_t map = pdo[PDO_MAP + i].value;
		const struct drive_object *o =
			drive_object(d, (uint16_t)(map >> 16), (uint8_t)(map >> 8));

		if (!o || !(o->access & MAPPED) || (map & 0xff) != 8u * o->size)
			return ABORT_NOT_MAPPED;
		bits += map & 0xff;
	}
	return bits > 64 ? ABORT_MAPPING_LENGTH : 0;
}

static inline uint32_t drive_write_pdo(struct drive *d, struct drive_object *pdo, int row,
				       uint32_t value)
{
	uint32_t changed = pdo[PDO_COB].value ^ value;

	switch (row) {
	case PDO_COB:
		/* Bit 30 of a TPDO is the drive's; an id does not change while it is on. */
		if (changed & 0x40000000 ||
		    (drive_pdo_on(pdo) && !(value & 0x80000000) && changed))
			return ABORT_VALUE;
		if (!(value & 0x80000000) && pdo[PDO_COUNT].value &&
		    drive_mapping(d, pdo, pdo[PDO_COUNT].value))
			return ABORT_NOT_MAPPED;
		return 0;
	case PDO_TYPE:
		return value > 240 && value < 254 ? ABORT_VALUE : 0;
	case PDO_INHIBIT:
		return drive_pdo_on(pdo) ? ABORT_VALUE : 0;
	case PDO_COUNT:
		if (drive_pdo_on(pdo) && !d->open_mapping)
			return d->mapping_abort;
		return drive_mapping(d, pdo, value);
	case PDO_TIMER:
		return 0;
	default:
		if ((drive_pdo_on(pdo) || pdo[PDO_COUNT].value) && !d->open_mapping)
			return d->mapping_abort;
		return drive_object(d, (uint16_t)(value >> 16), (uint8_t)(value >> 8))
			       ? 0
			       : ABORT_NO_OBJECT;
	}
}

/* 0, or why not. */
static inline uint32_t drive_write(struct drive *d, struct drive_object *o,
				   uint32_t value)
{
	int at = (int)(o - d->od);
	uint32_t rc = 0;

	for (int i = 0; i < DRIVE_PDOS && !rc; i++)
		if (at > (int)drive_pdos[i] && at < (int)drive_pdos[i] + 10)
			rc = drive_write_pdo(d, &d->od[drive_pdos[i]],
					     at - (int)drive_pdos[i], value);
	if (at == OD_MODE && value &&
	    (value > 32 || !(d->od[OD_MODES].value & 1u << (value - 1))))
		rc = ABORT_VALUE;
	if ((at == OD_RANGE_MIN && (int32_t)value > drive_signed(d, OD_RANGE_MAX)) ||
	    (at == OD_RANGE_MAX && (int32_t)value < drive_signed(d, OD_RANGE_MIN)))
		rc = ABORT_RANGE;
	if (at == OD_CYCLE_POWER && (int8_t)value > 0)
		rc = ABORT_VALUE;
	if (rc || o->deaf)
		return rc;
	o->value = value;
	if (at == OD_CONTROLWORD)
		drive_control(d, (uint16_t)value);
	if (at == OD_CONSUMER)
		d->watching = false;
	if (at == OD_RPDO1_TIMER)
		d->deadline_runs = false;
	if (at == OD_HEARTBEAT)
		d->heartbeat_ns = d->now_ns + value * DRIVE_MS;
	return 0;
}

static inline void drive_answer(struct drive *d, const uint8_t bytes[8])
{
	int64_t latency = d->latency_ns;

	if (d->mute)
		return;
	d->latency_ns += d->answer_ns;
	drive_say_bytes(d, CANOPEN_SDO_ANSWER + d->node, bytes, 8);
	d->latency_ns = latency;
}

static inline void drive_abort(struct drive *d, const uint8_t request[8], uint32_t code)
{
	uint8_t bytes[8] = {0x80, request[1], request[2], request[3]};

	d->refused++;
	d->aborted = (uint16_t)(request[1] | request[2] << 8);
	d->segmented = false;
	memcpy(bytes + 4, &code, 4);
	drive_answer(d, bytes);
}

static inline void drive_segment(struct drive *d, const uint8_t request[8])
{
	size_t left = d->name && d->segmented ? strlen(d->name) - d->segment_at : 0;
	size_t n = left < 7 ? left : 7;
	uint8_t bytes[8] = {0};

	if (!d->segmented) {
		drive_abort(d, request, ABORT_COMMAND);
		return;
	}
	if (!!(request[0] & 0x10) != d->segment_toggle) {
		drive_abort(d, request, ABORT_TOGGLE);
		return;
	}
	bytes[0] = (uint8_t)((request[0] & 0x10) | (7 - n) << 1 | (n == left));
	memcpy(bytes + 1, d->name + d->segment_at, n);
	d->segment_at += n;
	d->segment_toggle = !d->segment_toggle;
	d->segmented = n != left;
	drive_answer(d, bytes);
}

static inline void drive_upload(struct drive *d, const uint8_t request[8])
{
	uint16_t index = (uint16_t)(request[1] | request[2] << 8);
	const struct drive_object *o = drive_object(d, index, request[3]);
	uint8_t bytes[8] = {0x43, request[1], request[2], request[3]};

	if (index == 0x1008 && !request[3] && d->name) {
		uint32_t size = (uint32_t)strlen(d->name);

		bytes[0] = 0x41;
		memcpy(bytes + 4, &size, 4);
		d->segmented = true;
		d->segment_toggle = false;
		d->segment_at = 0;
		drive_answer(d, bytes);
		return;
	}
	if (!o) {
		drive_abort(d, request, drive_absent(d, index));
		return;
	}
	drive_refresh(d);
	bytes[0] = (uint8_t)(0x43 | (4 - o->size) << 2);
	memcpy(bytes + 4, &o->value, o->size); /* little-endian, as the tests' machines */
	drive_answer(d, bytes);
}

static inline void drive_download(struct drive *d, const uint8_t request[8])
{
	uint16_t index = (uint16_t)(request[1] | request[2] << 8);
	struct drive_object *o = drive_object(d, index, request[3]);
	uint8_t bytes[8] = {0x60, request[1], request[2], request[3]};
	int size = request[0] & 1 ? 4 - (request[0] >> 2 & 3) : 0;
	uint32_t value = 0, code;

	if (!(request[0] & 2))
		code = ABORT_COMMAND;
	else if (!o)
		code = drive_absent(d, index);
	else if (!(o->access & W_))
		code = ABORT_READ_ONLY;
	else if (size && size != o->size)
		code = size > o->size ? ABORT_LONG : ABORT_SHORT;
	else {
		memcpy(&value, request + 4, o->size);
		code = drive_write(d, o, value);
	}
	if (code)
		drive_abort(d, request, code);
	else
		drive_answer(d, bytes);
}

static inline void drive_sdo(struct drive *d, const struct can_frame *frame)
{
	uint16_t index = (uint16_t)(frame->data[1] | frame->data[2] << 8);
	const struct drive_object *o = drive_object(d, index, frame->data[3]);

	if (frame->len != 8)
		return;
	if (frame->data[0] == 0x80) {
		d->segmented = false;
		memcpy(&d->master_abort, frame->data + 4, 4);
		return;
	}
	d->requests++;
	if (d->requests == d->drop_at || (o && o->lost))
		return;
	if (d->requests == d->abort_at ||
	    (d->abort_index && index == d->abort_index &&
	     (d->abort_sub < 0 || frame->data[3] == d->abort_sub))) {
		drive_abort(d, frame->data, d->abort_code ? d->abort_code : 0x08000000);
		return;
	}
	switch (frame->data[0] >> 5) {
	case 1:
		drive_download(d, frame->data);
		break;
	case 2:
		drive_upload(d, frame->data);
		break;
	case 3:
		drive_segment(d, frame->data);
		break;
	default:
		drive_abort(d, frame->data, ABORT_COMMAND);
		break;
	}
}

#endif
