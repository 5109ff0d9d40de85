// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/base/hex.h over all bytes, against the C library in its own locale. */
#include "../unit.h"
#include <ctype.h>
#include "../../../lib/base/hex.h"

TEST(all_bytes)
{
	for (int c = -128; c < 256; c++) {
		char text[2] = {(char)c, 0};
		int digit = c >= 0 && isxdigit(c) ? (int)strtol(text, NULL, 16) : -1;

		assert_int_equal(incise_hex_digit(c), digit);
	}
}
