/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The load of a CAN bus by the traffic with one drive, bit/s, with as many stuff bits as frames
 * of these lengths can have. Any thread; nothing here waits or fails.
 */
#ifndef INCISE_BUS_LOAD_H
#define INCISE_BUS_LOAD_H

#include <stdint.h>

/*
 * Returns the bits of a frame with an 11-bit id and @bytes bytes, with the gap to the next
 * frame: 55 … 135. More than 8 bytes count as 8.
 */
uint32_t bus_load_bits(unsigned int bytes);

/*
 * Returns the cyclic traffic, bit/s: SYNC, RPDO and TPDO per cycle, both heartbeats each
 * @heartbeat_ns (0: none), inputs at their highest rate. UINT32_MAX: more than that, or a cycle
 * of 0.
 */
uint32_t bus_load_of(uint32_t cycle_ns, unsigned int rpdo_bytes, unsigned int tpdo_bytes,
		     int64_t heartbeat_ns);

/* The largest load, %: the rest is for SDOs, EMCYs and repeated frames. */
#define BUS_LOAD_MOST 80

#endif
