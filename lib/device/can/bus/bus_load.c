// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The load of a CAN bus by one drive; see bus_load.h. A data frame with an 11-bit id:
 *
 *   SOF id RTR IDE r0 DLC data CRC │ CRC-delimiter ACK EOF gap
 *   ╰──── 34 + 8n: stuffed ────────╯ ╰──────── 13 ───────────╯
 *
 * A bit is stuffed after 5 equal ones and counts among the next 5: at most one in 4.
 */
#include "bus_load.h"

#define NS_PER_S 1000000000ull
#define HEARTBEAT_BYTES 1
#define INPUT_BYTES 4
#define INPUT_NS 10000000 /* the inhibit time of TPDO2; see cia402_setup.c */

uint32_t bus_load_bits(unsigned int bytes)
{
	uint32_t stuffed = 34 + 8 * (bytes < 8 ? bytes : 8);

	return stuffed + (stuffed - 1) / 4 + 13;
}

static uint64_t per_second(uint64_t bits, uint64_t ns)
{
	return ns ? (bits * NS_PER_S + ns - 1) / ns : UINT32_MAX;
}

uint32_t bus_load_of(uint32_t cycle_ns, unsigned int rpdo_bytes, unsigned int tpdo_bytes,
		     int64_t heartbeat_ns)
{
	uint32_t cycle =
		bus_load_bits(0) + bus_load_bits(rpdo_bytes) + bus_load_bits(tpdo_bytes);
	uint64_t load = per_second(cycle, cycle_ns);

	load += per_second(bus_load_bits(INPUT_BYTES), INPUT_NS);
	if (heartbeat_ns > 0)
		load += per_second(2 * bus_load_bits(HEARTBEAT_BYTES),
				   (uint64_t)heartbeat_ns);
	return load < UINT32_MAX ? (uint32_t)load : UINT32_MAX;
}
