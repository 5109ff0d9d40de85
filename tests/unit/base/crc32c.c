// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/base/crc32c.c, against the vectors of RFC 3720, appendix B.4, and against
 * the division bit by bit.
 */
#include "../unit.h"
#include "../../../lib/base/crc32c.h"

TEST(vectors_of_rfc_3720)
{
	/* a SCSI read (10) command, as it stands there */
	static const uint8_t command[48] = {0x01, 0xc0, 0,    0, 0, 0, 0,    0,	 0, 0,
					    0,	  0,	0,    0, 0, 0, 0x14, 0,	 0, 0,
					    0,	  0,	4,    0, 0, 0, 0,    20, 0, 0,
					    0,	  24,	0x28, 0, 0, 0, 0,    0,	 0, 0,
					    0x02, 0,	0,    0, 0, 0, 0,    0};
	uint8_t bytes[32];

	memset(bytes, 0, sizeof(bytes));
	assert_int_equal(incise_crc32c(0, bytes, 32), 0x8a9136aa);
	memset(bytes, 0xff, sizeof(bytes));
	assert_int_equal(incise_crc32c(0, bytes, 32), 0x62a8ab43);
	for (int i = 0; i < 32; i++)
		bytes[i] = i;
	assert_int_equal(incise_crc32c(0, bytes, 32), 0x46dd794e);
	for (int i = 0; i < 32; i++)
		bytes[i] = 31 - i;
	assert_int_equal(incise_crc32c(0, bytes, 32), 0x113fdb5c);
	assert_int_equal(incise_crc32c(0, command, 48), 0xd9963a56);
	assert_int_equal(incise_crc32c(0, "123456789", 9), 0xe3069283);
}

TEST(nothing_changes_nothing)
{
	assert_int_equal(incise_crc32c(0, NULL, 0), 0);
	assert_int_equal(incise_crc32c(0x12345678, NULL, 0), 0x12345678);
}

/* The division of the polynomials, one bit after the other. */
static uint32_t divide(const uint8_t *bytes, size_t n)
{
	uint32_t crc = ~0u;

	for (size_t i = 0; i < n; i++)
		for (int bit = 0; bit < 8; bit++) {
			uint32_t out = (crc ^ bytes[i] >> bit) & 1;

			crc = crc >> 1 ^ (out ? 0x82f63b78 : 0);
		}
	return ~crc;
}

TEST(parts_and_the_whole_agree)
{
	uint8_t bytes[300];
	uint32_t random = 1;

	for (size_t i = 0; i < sizeof(bytes); i++) {
		random = random * 1664525 + 1013904223;
		bytes[i] = random >> 24;
	}
	for (size_t n = 0; n <= sizeof(bytes); n++) {
		uint32_t whole = divide(bytes, n);

		assert_int_equal(incise_crc32c_by_table(0, bytes, n), whole);
		for (size_t part = 0; part <= n; part += 7)
			assert_int_equal(incise_crc32c(incise_crc32c(0, bytes, part),
						       bytes + part, n - part),
					 whole);
	}
}
