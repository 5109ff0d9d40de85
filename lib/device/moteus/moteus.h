/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Frames of moteus drives on CAN FD; little-endian. Drives have ids 1 … 127, this side is 0.
 *
 *   id     source << 8 | destination; bit 15: please answer
 *   data   subframes: kind, number of registers, first register, values; then 0x50 as padding
 *
 *   torque   01 00 0a            mode = position
 *            0f 20 f32 f32 f32   position = NaN (where it is), velocity = 0, torque
 *            02 23 00 00         gains of its position loop = 0
 *            0d 25 f32           largest torque
 *            0d 27 f32           time-out of its watchdog
 *            01 2b 00            integral of its position loop = 0
 *   query    11 00 1f 01 13 0d   mode; position, velocity, torque; voltage, temperature, fault
 *   answer   21 00 i8 2f 01 f32 f32 f32 23 0d i8 i8 i8
 */
#ifndef INCISE_MOTEUS_H
#define INCISE_MOTEUS_H

#include <stdbool.h>
#include <stdint.h>
#include <linux/can.h>
#include <incise/backend.h>
#include "../can/bus/can_bus.h"

#define MOTEUS_ID_MAX 127

enum moteus_mode {
	MOTEUS_STOPPED = 0,
	MOTEUS_FAULT = 1,
	MOTEUS_POSITION = 10,
	MOTEUS_TIMEOUT = 11,
};

/* Answer to a query, in the drive's units. */
struct moteus_reply {
	int mode; /* enum moteus_mode, or another one */
	double position_turns, velocity_turns_s, torque_N_m, voltage_V, temperature_C;
	int fault;   /* see moteus_fault_text() */
	int refused; /* a register; -1: none */
};

/* Each asks for an answer, too. A stopped motor has no torque and no fault. */
void moteus_pack_query(struct canfd_frame *frame, int id);
void moteus_pack_stop(struct canfd_frame *frame, int id);
void moteus_pack_torque(struct canfd_frame *frame, int id, double torque_N_m,
			double most_N_m, double watchdog_s);

/*
 * Take an answer; its values may be NaN. Returns the drive's id; 0: the frame is not for this
 * side, not whole, or not understood.
 */
int moteus_parse(const struct canfd_frame *frame, struct moteus_reply *reply);

const char *moteus_fault_text(int fault);

/* As struct incise_backend.open, on a bus of any transport; moteus_haptic.c. */
void *moteus_open_on(const struct can_transport *transport,
		     const struct incise_backend_request *request,
		     struct incise_error *err);

/* Ask each id once, within 0.2 s. As struct incise_backend.scan. */
int moteus_scan_on(const struct can_transport *transport, const char *interface,
		   incise_scan_found *found, void *context, struct incise_error *err);

#endif
