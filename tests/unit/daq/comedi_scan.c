// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/comedi_scan.c on a card that a test makes; /dev/null stands for its file.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/device/daq/comedi_force.h"
#include "card.h"
#include "found.h"

static struct found found;

static int setup(void **state)
{
	card_reset();
	found = (struct found){0};
	return 0;
}

static int scan(const char *arguments)
{
	struct incise_error err = {0};
	int rc = comedi_force_scan(arguments, keep, &found, &err);

	assert_int_equal(card.opened, 0);
	/* Nothing is started by looking. */
	assert_int_equal(atomic_load(&card.commands), 0);
	return rc;
}

static void a_card_is_told_of(void **state)
{
	static const char *const properties[][2] = {
		{"path", "/dev/null"},
		{"board", "fake-16"},
		{"driver", "fake"},
		{"channels", "8"},
		{"bits", "12"},
		{"ranges_V", "-5 to 5, 0 to 5, -2.5 to 2.5"},
		{"rate_most_hz", "200000"}, /* 5 us, its least */
		{"rate_least_hz", "1"},
		{"time_stamps", "by arrival"},
	};

	/* Its second subdevice is no analog input. */
	assert_int_equal(scan("/dev/null:0"), 0);
	assert_int_equal(found.n, 1);
	assert_string_equal(found.device[0].device, "comedi:/dev/null:0");
	assert_true(found.device[0].usable);
	for (size_t i = 0; i < sizeof(properties) / sizeof(*properties); i++)
		assert_string_equal(told(&found.device[0], properties[i][0]),
				    properties[i][1]);
}

static void what_cannot_be_used_is_told_as_such(void **state)
{
	card.flags |= SDF_BUSY;
	assert_int_equal(scan("/dev/null"), 0);
	assert_non_null(strstr(found.device[0].what, ", in use"));
	setup(NULL);
	card.no_timer = true;
	assert_int_equal(scan("/dev/null"), 0);
	assert_false(found.device[0].usable);
	assert_string_equal(told(&found.device[0], "rate_most_hz"), "");
	setup(NULL);
	card.maxdata = 4000; /* codes of no whole number of bits */
	assert_int_equal(scan("/dev/null"), 0);
	assert_false(found.device[0].usable);
}

static void none(void **state)
{
	assert_int_equal(scan("/dev/not-there:0"), 0);
	card.open_error = EACCES;
	assert_int_equal(scan("/dev/null"), 0);
	card.open_error = 0;
	card.type = COMEDI_SUBD_AO;
	assert_int_equal(scan("/dev/null"), 0);
	card.type = COMEDI_SUBD_AI;
	card.flags = 0; /* one that samples when it is asked only */
	assert_int_equal(scan("/dev/null"), 0);
	assert_int_equal(found.n, 0);
}

static void it_ends_when_it_is_told_to(void **state)
{
	found.answer = -ENOMEM;
	assert_int_equal(scan("/dev/null"), -ENOMEM);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(a_card_is_told_of, setup),
		cmocka_unit_test_setup(what_cannot_be_used_is_told_as_such, setup),
		cmocka_unit_test_setup(none, setup),
		cmocka_unit_test_setup(it_ends_when_it_is_told_to, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
