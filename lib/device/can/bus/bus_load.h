/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How much of a CAN bus the traffic with one drive takes, with the most stuff bits that
 * frames of its lengths can have. Any thread; nothing here waits or fails.
 */
#ifndef INCISE_BUS_LOAD_H
#define INCISE_BUS_LOAD_H

#include <stdint.h>

/*
 * Bits of a frame with an 11-bit id and so many bytes, with the gap to the next: 55 … 135;
 * more than 8 bytes count as 8.
 */
uint32_t bus_load_bits(unsigned int bytes);

/*
 * Cyclic traffic: SYNC, RPDO and TPDO per cycle, both heartbeats (@beat_ns; 0: none), inputs
 * as often as they may come. Bit/s; UINT32_MAX: more than that, or a cycle of 0.
 */
uint32_t bus_load_of(uint32_t cycle_ns, unsigned int rpdo_bytes, unsigned int tpdo_bytes,
		     int64_t beat_ns);

/* The most that may be taken, %: the rest is for SDOs, EMCYs and what is sent again. */
#define BUS_LOAD_MOST 80

#endif
