/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A simulated CiA 402 drive on a CAN bus, with a clock that advances only in waits and in
 * drive_advance(). It is strict: it does exactly what SDOs configured.
 *
 *   tested code ──▶ drive.bus ──▶ queue, latency ──▶ SDO, NMT, PDO ──▶ state machine, motion
 *
 *	struct drive drive;
 *
 *	drive_init(&drive);
 *	cia402_configure(&master_of(&drive.bus) …);	the clock advances in its waits
 *	drive_advance(&drive, 5 * DRIVE_MS);		the clock advances
 *	drive.blocked = true;				a fault
 *	assert_int_equal(drive.state, CIA402_FAULT);
 *
 * A struct drive has some 25 KB; drive_state.h describes it.
 */
#ifndef INCISE_TEST_CAN_DRIVE_H
#define INCISE_TEST_CAN_DRIVE_H

#include <errno.h>
#include "drive_objects.h"

/* Power-on, or a reboot of its own: all configuration is lost. */
static inline void drive_reboot(struct drive *d)
{
	uint8_t boot = 0;

	if (d->boots++)
		d->tripped = true;
	for (int i = 0; i < OD_N; i++)
		d->od[i].value = d->od[i].initial;
	drive_enter(d, CIA402_DISABLED);
	d->watching = d->deadline_runs = d->rpdo_waits = d->own_stop = d->segmented =
		false;
	d->homed = d->absolute;
	d->homing = d->homing_error = d->had_reset_bit = d->had_home_bit = false;
	if (!d->absolute) {
		d->origin += d->position;
		d->position = 0;
	}
	d->nmt = CANOPEN_PRE_OPERATIONAL;
	drive_say_bytes(d, CANOPEN_HEARTBEAT + d->node, &boot, 1);
}

static inline void drive_nmt(struct drive *d, const struct can_frame *frame)
{
	if (frame->len < 2 || (frame->data[1] && frame->data[1] != d->node))
		return;
	switch (frame->data[0]) {
	case CANOPEN_START:
		d->nmt = CANOPEN_OPERATIONAL;
		d->timer_ns = d->now_ns;
		d->sent_inputs = ~d->inputs;
		break;
	case CANOPEN_STOP:
		d->nmt = CANOPEN_STOPPED;
		if (drive_powered(d))
			drive_quick_stop(d, true);
		break;
	case CANOPEN_PREPARE:
		d->nmt = CANOPEN_PRE_OPERATIONAL;
		break;
	case CANOPEN_RESET_NODE:
	case CANOPEN_RESET_COMMUNICATION:
		drive_reboot(d);
		break;
	}
}

/* Copy the data of a PDO to its objects. */
static inline void drive_apply(struct drive *d, const struct drive_object *pdo,
			       const uint8_t *data, unsigned int size)
{
	unsigned int at = 0, control = 0;
	bool controlled = false;

	for (uint32_t i = 0; i < pdo[PDO_COUNT].value; i++) {
		uint32_t map = pdo[PDO_MAP + i].value, value = 0;
		struct drive_object *o =
			drive_object(d, (uint16_t)(map >> 16), (uint8_t)(map >> 8));

		if (!o || at + o->size > size)
			return;
		memcpy(&value, data + at, o->size);
		at += o->size;
		o->value = value;
		if (o == &d->od[OD_CONTROLWORD]) {
			control = value;
			controlled = true;
		}
	}
	if (controlled)
		drive_control(d, (uint16_t)control);
	drive_latch(d);
}

static inline void drive_send_tpdo(struct drive *d, const struct drive_object *pdo)
{
	unsigned int at = 0;
	uint8_t bytes[8] = {0};

	drive_refresh(d);
	for (uint32_t i = 0; i < pdo[PDO_COUNT].value; i++) {
		uint32_t map = pdo[PDO_MAP + i].value;
		const struct drive_object *o =
			drive_object(d, (uint16_t)(map >> 16), (uint8_t)(map >> 8));

		if (!o || at + o->size > 8)
			return;
		memcpy(bytes + at, &o->value, o->size);
		at += o->size;
	}
	if (!at)
		return;
	d->tpdos++;
	drive_say_bytes(d, pdo[PDO_COB].value & CAN_SFF_MASK, bytes, at);
}

static inline void drive_rpdo(struct drive *d, const struct can_frame *frame)
{
	const struct drive_object *pdo = &d->od[OD_RPDO1_SUBS];
	unsigned int bits = 0;

	for (uint32_t i = 0; i < pdo[PDO_COUNT].value; i++)
		bits += pdo[PDO_MAP + i].value & 0xff;
	if (frame->len < bits / 8) {
		drive_emcy(d, 0x8210); /* PDO not processed: length */
		return;
	}
	if (d->od[OD_RPDO1_TIMER].value) {
		d->deadline_runs = true;
		d->deadline_ns = d->now_ns + d->od[OD_RPDO1_TIMER].value * DRIVE_MS;
	}
	d->rpdo_size = frame->len;
	memcpy(d->rpdo, frame->data, sizeof(d->rpdo));
	if (pdo[PDO_TYPE].value <= 240)
		d->rpdo_waits = true;
	else
		drive_apply(d, pdo, d->rpdo, d->rpdo_size);
}

static inline void drive_sync(struct drive *d)
{
	d->syncs++;
	d->last_sync_ns = d->now_ns;
	if (d->rpdo_waits)
		drive_apply(d, &d->od[OD_RPDO1_SUBS], d->rpdo, d->rpdo_size);
	d->rpdo_waits = false;
	for (int i = 2; i < DRIVE_PDOS; i++) {
		const struct drive_object *pdo = &d->od[drive_pdos[i]];
		uint32_t type = pdo[PDO_TYPE].value;

		if (drive_pdo_on(pdo) && type && type <= 240 && d->syncs % type == 0 &&
		    !(d->no_tpdo && i == 2))
			drive_send_tpdo(d, pdo);
	}
}

/* A frame reached it. */
static inline void drive_process(struct drive *d, const struct can_frame *frame)
{
	uint32_t consumer = d->od[OD_CONSUMER].value, id = frame->can_id;

	if (d->unplugged || id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG))
		return;
	if (id == 0) {
		drive_nmt(d, frame);
	} else if (id == CANOPEN_HEARTBEAT + (consumer >> 16 & 0x7f) && frame->len == 1) {
		d->master_beats++;
		if (consumer & 0xffff && d->od[OD_CONSUMER].size) {
			d->watching = true;
			d->consumer_ns = d->now_ns + (consumer & 0xffff) * DRIVE_MS;
		}
	} else if (d->nmt == CANOPEN_STOPPED) {
		return;
	} else if (id == (uint32_t)CANOPEN_SDO_REQUEST + d->node) {
		drive_sdo(d, frame);
	} else if (d->nmt != CANOPEN_OPERATIONAL) {
		return;
	} else if (id == (d->od[OD_SYNC_ID].value & CAN_SFF_MASK)) {
		drive_sync(d);
	} else if (drive_pdo_on(&d->od[OD_RPDO1_SUBS]) &&
		   id == (d->od[OD_RPDO1_COB].value & CAN_SFF_MASK)) {
		drive_rpdo(d, frame);
	}
}

static inline void drive_event_pdo(struct drive *d)
{
	const struct drive_object *pdo = &d->od[OD_TPDO2_SUBS];
	int64_t timer = pdo[PDO_TIMER].value * DRIVE_MS;

	if (d->nmt != CANOPEN_OPERATIONAL || !drive_pdo_on(pdo) ||
	    pdo[PDO_TYPE].value < 254)
		return;
	if (d->now_ns < d->inhibit_ns ||
	    (d->inputs == d->sent_inputs && !(timer && d->now_ns >= d->timer_ns)))
		return;
	d->sent_inputs = d->inputs;
	d->inhibit_ns = d->now_ns + pdo[PDO_INHIBIT].value * 100000LL;
	d->timer_ns = d->now_ns + timer;
	drive_send_tpdo(d, pdo);
}

static inline void drive_tick(struct drive *d)
{
	int64_t beat = d->od[OD_HEARTBEAT].value * DRIVE_MS;
	uint8_t state = (uint8_t)d->nmt;

	if (d->watching && d->now_ns > d->consumer_ns) {
		d->watching = false;
		if (d->nmt == CANOPEN_OPERATIONAL && !d->od[OD_ERROR_BEHAVIOUR].value)
			d->nmt = CANOPEN_PRE_OPERATIONAL;
		drive_connection_lost(d, 0x8130);
	}
	if (d->nmt != CANOPEN_OPERATIONAL) /* no PDOs, no deadline of theirs */
		d->deadline_runs = false;
	if (d->deadline_runs && d->now_ns > d->deadline_ns) {
		d->deadline_runs = false;
		drive_connection_lost(d, 0x8250);
	}
	if (beat && d->now_ns >= d->heartbeat_ns) {
		d->heartbeat_ns += beat;
		if (!d->no_heartbeat)
			drive_say_bytes(d, CANOPEN_HEARTBEAT + d->node, &state, 1);
	}
	drive_move(d);
	drive_event_pdo(d);
}

/* Advance the clock to @until; with @frame only until a frame for the master arrives. */
static inline void drive_run(struct drive *d, int64_t until, bool frame)
{
	while (d->now_ns < until) {
		const struct drive_queue *in = &d->to_drive, *out = &d->to_master;
		int64_t next = d->tick_ns < until ? d->tick_ns : until;
		struct can_frame received;

		if (frame && out->n) {
			if (out->frame[out->head].at_ns <= d->now_ns)
				return;
			if (out->frame[out->head].at_ns < next)
				next = out->frame[out->head].at_ns;
		}
		if (in->n && in->frame[in->head].at_ns < next)
			next = in->frame[in->head].at_ns;
		if (next > d->now_ns)
			d->now_ns = next;
		while (drive_queue_take(&d->to_drive, d->now_ns, &received, NULL))
			drive_process(d, &received);
		if (d->now_ns >= d->tick_ns) {
			d->tick_ns += DRIVE_TICK_NS;
			drive_tick(d);
		}
	}
}

/* Advance the clock. */
static inline void drive_advance(struct drive *d, int64_t ns)
{
	drive_run(d, d->now_ns + ns, false);
}

/* An error frame, as the kernel makes them; classes of linux/can/error.h. */
static inline void drive_error_frame(struct drive *d, uint32_t classes,
				     uint8_t controller)
{
	struct can_frame frame = {.can_id = CAN_ERR_FLAG | classes, .len = CAN_ERR_DLC};

	frame.data[1] = controller;
	drive_say(d, &frame);
}

/* The master's controller is off the bus: sending fails, nothing arrives. */
static inline void drive_bus_off(struct drive *d)
{
	drive_error_frame(d, CAN_ERR_BUSOFF, 0);
	d->unplugged = true;
	d->can_state = CAN_STATE_BUS_OFF;
	d->send_error = -ENETDOWN;
	d->send_errors = 0;
}

static inline int64_t drive_now(struct can_bus *bus)
{
	struct drive *d = (struct drive *)bus;

	if (d->look_ns)
		drive_advance(d, d->look_ns);
	return d->now_ns;
}

static inline int drive_send(struct can_bus *bus, const struct can_frame *frame)
{
	struct drive *d = (struct drive *)bus;
	int rc = d->send_error;

	if (rc && d->send_first) {
		d->send_first--;
		rc = 0;
	}
	if (rc && d->send_errors && !--d->send_errors)
		d->send_error = 0;
	if (rc) {
		bus->counts.full += rc == -ENOBUFS;
		return rc;
	}
	bus->counts.sent++;
	drive_queue_put(&d->to_drive, frame, d->now_ns + d->latency_ns);
	return 0;
}

static inline int drive_receive(struct can_bus *bus, struct can_frame *frame,
				int64_t *t_ns)
{
	struct drive *d = (struct drive *)bus;

	if (d->receive_error)
		return d->receive_error;
	if (!drive_queue_take(&d->to_master, d->now_ns, frame, t_ns))
		return 0;
	bus->counts.received++;
	bus->counts.errors += !!(frame->can_id & CAN_ERR_FLAG);
	return 1;
}

static inline int drive_wait(struct can_bus *bus, int64_t until_ns)
{
	struct drive *d = (struct drive *)bus;

	if (d->wait_error)
		return d->wait_error;
	drive_run(d, until_ns, true);
	return 0;
}

static inline int drive_filter(struct can_bus *bus, const struct can_filter *filter,
			       int n)
{
	struct drive *d = (struct drive *)bus;

	if (n > 16)
		return -EINVAL;
	d->filters_n = n;
	memcpy(d->filters, filter, (size_t)n * sizeof(*filter));
	return 0;
}

static inline int drive_can_state(struct can_bus *bus)
{
	return ((struct drive *)bus)->can_state;
}

static inline void drive_close(struct can_bus *bus)
{
	((struct drive *)bus)->filters_n = 0;
}

/* The factory state, one second after power-on of the logic. */
static inline void drive_init(struct drive *d)
{
	static const struct can_bus_ops ops = {drive_now,  drive_send,	 drive_receive,
					       drive_wait, drive_filter, drive_can_state,
					       drive_close};
	static const struct drive_object objects[] = {
#define X(name, index, sub, size, access, value) \
	{index, sub, size, access, 0, value, false, false},
		DRIVE_OBJECTS(X)
#undef X
	};

	memset(d, 0, sizeof(*d));
	d->bus.ops = &ops;
	strcpy(d->bus.name, "can-test");
	d->bus.bitrate = 1000000;
	d->now_ns = 1000000000;
	d->tick_ns = d->now_ns + DRIVE_TICK_NS;
	d->node = DRIVE_NODE;
	d->name = "simulated drive";
	d->latency_ns = 100000;
	d->enable_ns = 5 * DRIVE_MS;
	d->velocity_scale = d->acceleration_scale = 1;
	d->torque_counts_s2 = 100;
	d->damping_1_s = 10;
	d->home_raw = -5000;
	d->mapping_abort = ABORT_ACCESS;
	memcpy(d->od, objects, sizeof(objects));
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].access & OF_NODE)
			d->od[i].initial += d->node;
	drive_reboot(d);
	drive_advance(d, 2 * DRIVE_MS);
}

#endif
