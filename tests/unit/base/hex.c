// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/hex.h over all bytes, against the C library in its own locale.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <ctype.h>
#include <stdlib.h>
#include "../../../lib/base/hex.h"

static void all_bytes(void **state)
{
	for (int c = -128; c < 256; c++) {
		char text[2] = {(char)c, 0};
		int digit = c >= 0 && isxdigit(c) ? (int)strtol(text, NULL, 16) : -1;

		assert_int_equal(incise_hex_digit(c), digit);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(all_bytes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
