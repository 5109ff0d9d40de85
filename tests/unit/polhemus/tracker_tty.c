// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/tracker_tty.c, the backend "tty", with the emulator behind a pseudo
 * terminal.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include "../../../lib/device/polhemus/tracker_tty.c"
#include "pty.h"

static struct pty pty;

static int begin(void **state)
{
	assert_int_equal(pty_begin(&pty, EMULATOR_FASTRAK), 0);
	return 0;
}

static int end(void **state)
{
	pty_unplug(&pty);
	pty_end(&pty);
	return 0;
}

static int count_found(void *context, const struct incise_scan_device *device)
{
	struct incise_scan_device *last = context;

	*last = *device;
	return 0;
}

static void a_scan(void **state)
{
	struct incise_scan_device found = {0};
	struct incise_error err = {0};
	char arguments[80];

	snprintf(arguments, sizeof(arguments), "%s:115200", pty.path);
	if (incise_backend.scan(arguments, count_found, &found, &err))
		fail_msg("%s", err.text);
	assert_non_null(strstr(found.device, arguments));
	assert_string_equal(found.what, "FASTRAK 3.02 OutputCompensat CPG2030-003-10");
	assert_int_equal(found.n, 3);
	assert_string_equal(found.property[2].text, "1");
	assert_true(found.usable);
	assert_int_equal(incise_backend.scan("/dev/not-there", count_found, &found, &err),
			 -ENODEV);
	assert_int_equal(incise_backend.scan("", count_found, &found, &err), 0);
}

static void opens(void **state)
{
	static const struct incise_tracker_setup setup = {
		.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}};
	struct incise_error err = {0};
	struct incise_backend_request request = {
		.arguments = pty.path, .where = "rig.conf:1: tracker", .tracker = &setup};
	struct incise_tracker *tracker = incise_backend.open(&request, &err);
	struct incise_tracker_info info;

	if (!tracker)
		fail_msg("%s", err.text);
	incise_tracker_info(tracker, &info);
	assert_true(info.rate_hz == 120 && info.stations == 1);
	/* It is ours alone. */
	assert_null(incise_backend.open(&request, &err));
	assert_int_equal(errno, EBUSY);
	tracker->ops->close(tracker);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(a_scan, begin, end),
		cmocka_unit_test_setup_teardown(opens, begin, end),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
