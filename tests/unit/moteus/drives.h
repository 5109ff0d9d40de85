/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Simulated moteus drives on a CAN FD bus with a clock of its own, which advances in waits and in
 * drives_advance(). They know the frames of moteus.h alone; tests/can/moteus_drive.py has drives
 * that share no code with incise and parse all subframes.
 */
#ifndef INCISE_TEST_MOTEUS_DRIVES_H
#define INCISE_TEST_MOTEUS_DRIVES_H

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/device/moteus/moteus.h"

#define DRIVES 4
#define DRIVES_QUEUE 64
#define DRIVES_MS 1000000LL
#define DRIVES_START_NS (30 * DRIVES_MS)

struct one_drive {
	int id, mode, fault;
	int64_t commanded_ns, starting_ns;
	float position, velocity, torque, most, watchdog;
	int8_t voltage, temperature;
	/* faults of a test */
	bool silent, no_watchdog, lame;
	int refused; /* a register; 0: none */
	int64_t latency_ns;
	int stops;
	bool mutates;
};

struct drives {
	struct can_bus bus;
	struct one_drive drive[DRIVES];
	int n;
	int64_t now_ns;
	struct {
		struct canfd_frame frame;
		int64_t t_ns;
	} queue[DRIVES_QUEUE];
	int n_queue;
	int gone; /* negative errno of all calls */
	bool full, closed;
	unsigned int seed;
};

static struct drives *drives_of(struct can_bus *bus)
{
	return (struct drives *)bus;
}

static int64_t drives_now(struct can_bus *bus)
{
	return drives_of(bus)->now_ns;
}

static void drives_advance(struct drives *drives, int64_t ns)
{
	drives->now_ns += ns;
	for (int i = 0; i < drives->n; i++) {
		struct one_drive *drive = &drives->drive[i];

		if (drive->mode == 3 &&
		    drives->now_ns - drive->starting_ns >= DRIVES_START_NS) {
			drive->mode = MOTEUS_POSITION;
			drive->commanded_ns = drives->now_ns;
		}
		if (drive->mode == MOTEUS_POSITION && !drive->no_watchdog &&
		    (double)(drives->now_ns - drive->commanded_ns) >
			    drive->watchdog * 1e9)
			drive->mode = MOTEUS_TIMEOUT;
	}
}

static float float_at(const uint8_t *at)
{
	float value;

	memcpy(&value, at, sizeof(value));
	return value;
}

static void drive_obeys(struct drives *drives, struct one_drive *drive,
			const struct canfd_frame *frame)
{
	if (frame->data[0] != 0x01)
		return;
	if (frame->data[2] == MOTEUS_STOPPED) {
		drive->stops++;
		drive->mode = MOTEUS_STOPPED;
		drive->fault = 0;
		drive->torque = 0;
		return;
	}
	drive->torque = float_at(frame->data + 13);
	drive->most = float_at(frame->data + 23);
	drive->watchdog = float_at(frame->data + 29);
	drive->commanded_ns = drives->now_ns;
	if (drive->mode == MOTEUS_STOPPED && !drive->lame) {
		drive->mode = 3;
		drive->starting_ns = drives->now_ns;
	}
}

static void drive_answers(struct drives *drives, struct one_drive *drive)
{
	struct canfd_frame frame = {.can_id = (canid_t)drive->id << 8, .len = 24};
	float values[3] = {drive->position, drive->velocity,
			   drive->mode == MOTEUS_POSITION ? drive->torque : 0};
	uint8_t *at = frame.data;

	memset(at, 0x50, frame.len);
	if (drive->refused) {
		memcpy(at, (uint8_t[]){0x30, (uint8_t)drive->refused, 1}, 3);
	} else {
		memcpy(at, (uint8_t[]){0x21, 0x00, (uint8_t)drive->mode, 0x2f, 0x01}, 5);
		memcpy(at + 5, values, sizeof(values));
		memcpy(at + 17,
		       (uint8_t[]){0x23, 0x0d, (uint8_t)drive->voltage,
				   (uint8_t)drive->temperature, (uint8_t)drive->fault},
		       5);
	}
	if (drive->mutates)
		for (int i = rand_r(&drives->seed) % 3; i >= 0; i--)
			at[rand_r(&drives->seed) % 24] = (uint8_t)rand_r(&drives->seed);
	if (drives->n_queue == DRIVES_QUEUE)
		return;
	drives->queue[drives->n_queue].frame = frame;
	drives->queue[drives->n_queue++].t_ns = drives->now_ns + drive->latency_ns;
}

static int drives_send(struct can_bus *bus, const struct canfd_frame *frame)
{
	struct drives *drives = drives_of(bus);

	if (drives->gone || drives->full)
		return drives->full ? -ENOBUFS : drives->gone;
	for (int i = 0; i < drives->n; i++) {
		struct one_drive *drive = &drives->drive[i];

		if ((frame->can_id & 0xff) != (canid_t)drive->id)
			continue;
		drive_obeys(drives, drive, frame);
		if (!drive->silent)
			drive_answers(drives, drive);
	}
	return 0;
}

static int drives_receive(struct can_bus *bus, struct canfd_frame *frame, int64_t *t_ns)
{
	struct drives *drives = drives_of(bus);

	if (drives->gone)
		return drives->gone;
	for (int i = 0; i < drives->n_queue; i++) {
		if (drives->queue[i].t_ns > drives->now_ns)
			continue;
		*frame = drives->queue[i].frame;
		*t_ns = drives->queue[i].t_ns;
		drives->n_queue--;
		memmove(&drives->queue[i], &drives->queue[i + 1],
			(size_t)(drives->n_queue - i) * sizeof(drives->queue[0]));
		return 1;
	}
	return 0;
}

static int drives_wait(struct can_bus *bus, int64_t until_ns)
{
	struct drives *drives = drives_of(bus);

	(void)until_ns;
	drives_advance(drives, DRIVES_MS / 4);
	return drives->gone;
}

static void drives_close(struct can_bus *bus)
{
	drives_of(bus)->closed = true;
}

static const struct can_bus_ops drives_ops = {
	.now = drives_now,
	.send_fd = drives_send,
	.receive_fd = drives_receive,
	.wait = drives_wait,
	.close = drives_close,
};

/* @n drives with ids from 1 on. */
static void drives_init(struct drives *drives, int n)
{
	*drives = (struct drives){
		.bus = {.ops = &drives_ops, .name = "can0"},
		.n = n,
		.now_ns = 1000 * DRIVES_MS,
		.seed = 1,
	};
	for (int i = 0; i < n; i++)
		drives->drive[i] = (struct one_drive){.id = i + 1,
						      .voltage = 48,
						      .temperature = 31,
						      .latency_ns = DRIVES_MS / 4};
}

#endif
