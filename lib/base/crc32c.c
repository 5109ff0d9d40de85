// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * CRC32C; see crc32c.h. A table by itself is enough to record: 10 kHz of force are 0.24 MB/s, and
 * it takes some 200 MB/s. To verify a recording of hours, the instruction of x86 is used where it
 * is there, which takes twenty times as many.
 */
#include <string.h>
#include "crc32c.h"

/* The remainder of each half of a byte; polynomial 0x1edc6f41, bits reversed: 0x82f63b78. */
static const uint32_t table[16] = {
	0x00000000, 0x105ec76f, 0x20bd8ede, 0x30e349b1, 0x417b1dbc, 0x5125dad3,
	0x61c69362, 0x7198540d, 0x82f63b78, 0x92a8fc17, 0xa24bb5a6, 0xb21572c9,
	0xc38d26c4, 0xd3d3e1ab, 0xe330a81a, 0xf36e6f75,
};

uint32_t incise_crc32c_by_table(uint32_t crc, const void *bytes, size_t n)
{
	const uint8_t *byte = bytes;

	crc = ~crc;
	for (size_t i = 0; i < n; i++) {
		crc ^= byte[i];
		crc = crc >> 4 ^ table[crc & 15];
		crc = crc >> 4 ^ table[crc & 15];
	}
	return ~crc;
}

#ifdef __x86_64__
__attribute__((target("sse4.2"))) static uint32_t by_instruction(uint32_t crc,
								 const uint8_t *byte,
								 size_t n)
{
	uint64_t sum = ~crc, eight;

	for (; n >= 8; n -= 8, byte += 8) {
		memcpy(&eight, byte, 8);
		sum = __builtin_ia32_crc32di(sum, eight);
	}
	crc = (uint32_t)sum;
	for (; n; n--)
		crc = __builtin_ia32_crc32qi(crc, *byte++);
	return ~crc;
}
#endif

uint32_t incise_crc32c(uint32_t crc, const void *bytes, size_t n)
{
#ifdef __x86_64__
	if (__builtin_cpu_supports("sse4.2"))
		return by_instruction(crc, bytes, n);
#endif
	return incise_crc32c_by_table(crc, bytes, n);
}
