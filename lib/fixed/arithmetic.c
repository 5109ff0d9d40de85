// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The square root; see arithmetic.h. A table gives the first 8 bits, each of two steps of Heron's doubles
 * them and is one above the root at most: a product puts the last bit right.
 */
#include "arithmetic.h"

/* √(256 i + 128), to the nearest, for i from 64 on. */
static const uint8_t first[192] = {
	128, 129, 130, 131, 132, 133, 134, 135, 136, 137, 138, 139, 140, 141, 142, 143,
	144, 144, 145, 146, 147, 148, 149, 150, 151, 151, 152, 153, 154, 155, 156, 156,
	157, 158, 159, 160, 160, 161, 162, 163, 164, 164, 165, 166, 167, 167, 168, 169,
	170, 170, 171, 172, 173, 173, 174, 175, 176, 176, 177, 178, 179, 179, 180, 181,
	181, 182, 183, 183, 184, 185, 186, 186, 187, 188, 188, 189, 190, 190, 191, 192,
	192, 193, 194, 194, 195, 196, 196, 197, 198, 198, 199, 200, 200, 201, 201, 202,
	203, 203, 204, 205, 205, 206, 206, 207, 208, 208, 209, 210, 210, 211, 211, 212,
	213, 213, 214, 214, 215, 216, 216, 217, 217, 218, 219, 219, 220, 220, 221, 221,
	222, 223, 223, 224, 224, 225, 225, 226, 227, 227, 228, 228, 229, 229, 230, 230,
	231, 232, 232, 233, 233, 234, 234, 235, 235, 236, 237, 237, 238, 238, 239, 239,
	240, 240, 241, 241, 242, 242, 243, 243, 244, 244, 245, 246, 246, 247, 247, 248,
	248, 249, 249, 250, 250, 251, 251, 252, 252, 253, 253, 254, 254, 255, 255, 255,
};

uint32_t incise_fx_root(uint64_t v)
{
	uint64_t scaled, x;
	int shift;

	if (!v)
		return 0;
	/* By an even number of bits, to 2^62 … 2^64. */
	shift = __builtin_clzll((unsigned long long)v) & ~1;
	scaled = v << shift;
	x = first[(scaled >> 56) - 64];
	x = (x << 7) + (uint32_t)(scaled >> 41) / (uint32_t)x;
	x = (x << 15) + div_u64(scaled >> 17, (uint32_t)x);
	/* It may be 2^32 here, whose square is 0. */
	x -= x >> 32 || x * x > scaled;
	return (uint32_t)(x >> (shift / 2));
}
