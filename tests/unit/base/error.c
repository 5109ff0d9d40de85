// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Errors as values: the code, errno and a single clean line.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <string.h>
#include <incise/error.h>
#include <incise/version.h>

static void test_code_line_and_errno(void **state)
{
	struct incise_error err = {0};

	errno = 0;
	assert_int_equal(incise_error_set(&err, ENOENT, "%s:%d: gone", "a.fis", 7),
			 -ENOENT);
	assert_int_equal(errno, ENOENT);
	assert_int_equal(err.code, ENOENT);
	assert_string_equal(err.text, "a.fis:7: gone");
}

static void test_without_a_place_to_leave_it(void **state)
{
	errno = 0;
	assert_int_equal(incise_error_set(NULL, EIO, "lost"), -EIO);
	assert_int_equal(errno, EIO);
}

/* Text from a file must not end the line, move the cursor or overrun. */
static void test_hostile_text(void **state)
{
	struct incise_error err = {0};
	char longer[2000];

	incise_error_set(&err, EINVAL, "a\nb\033[2Jc\x7f");
	assert_string_equal(err.text, "a?b?[2Jc?");
	memset(longer, 'x', sizeof(longer));
	longer[sizeof(longer) - 1] = 0;
	incise_error_set(&err, EINVAL, "%s", longer);
	assert_int_equal(strlen(err.text), sizeof(err.text) - 1);
}

static void test_version(void **state)
{
	assert_string_equal(incise_version(), INCISE_VERSION);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_code_line_and_errno),
		cmocka_unit_test(test_without_a_place_to_leave_it),
		cmocka_unit_test(test_hostile_text),
		cmocka_unit_test(test_version),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
