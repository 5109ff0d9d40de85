/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * CRC-32 of ISO 3309, as in zlib and MCAP; eight bytes a step (M. Kounavis, F. Berry: A
 * Systematic Approach to Building High Performance Software-based CRC Generators, 2005),
 * since an hour of messages is some GB.
 */
#ifndef INCISE_CRC32_H
#define INCISE_CRC32_H

#include <stddef.h>
#include <stdint.h>

struct incise_crc32 {
	uint32_t table[8][256];
};

static inline void incise_crc32_init(struct incise_crc32 *crc32)
{
	for (uint32_t i = 0; i < 256; i++) {
		uint32_t value = i;

		for (int bit = 0; bit < 8; bit++)
			value = value & 1 ? value >> 1 ^ 0xedb88320u : value >> 1;
		crc32->table[0][i] = value;
	}
	for (int k = 1; k < 8; k++)
		for (int i = 0; i < 256; i++) {
			uint32_t value = crc32->table[k - 1][i];

			crc32->table[k][i] = value >> 8 ^ crc32->table[0][value & 0xff];
		}
}

/* Go on with the CRC of what was before; 0 at the beginning. */
static inline uint32_t incise_crc32_add(const struct incise_crc32 *crc32, uint32_t crc,
					const void *data, size_t n)
{
	const uint32_t(*table)[256] = crc32->table;
	const unsigned char *at = data;

	crc = ~crc;
	for (; n >= 8; n -= 8, at += 8)
		crc = table[7][(crc ^ at[0]) & 0xff] ^
		      table[6][(crc >> 8 ^ at[1]) & 0xff] ^
		      table[5][(crc >> 16 ^ at[2]) & 0xff] ^ table[4][crc >> 24 ^ at[3]] ^
		      table[3][at[4]] ^ table[2][at[5]] ^ table[1][at[6]] ^
		      table[0][at[7]];
	for (; n; n--, at++)
		crc = crc >> 8 ^ table[0][(crc ^ *at) & 0xff];
	return ~crc;
}

#endif
