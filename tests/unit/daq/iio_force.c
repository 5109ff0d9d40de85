// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_force.c where it does not open: what is said, and that nothing is left. A
 * channel that samples needs a kernel: tests/vm/guest/force_iio.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <dirent.h>
#include "../../../lib/device/daq/iio_force.h"
#include "converter.h"

static int setup(void **state)
{
	world_reset();
	return 0;
}

static int open_files(void)
{
	DIR *folder = opendir("/proc/self/fd");
	int n = 0;

	while (readdir(folder))
		n++;
	closedir(folder);
	return n;
}

static void refusals(void **state)
{
	static const struct {
		const char *arguments;
		double rate_hz;
		int code;
		const char *says;
	} cases[] = {
		{"", 10000, EINVAL, "expected iio:NAME"},
		{"adc", 0, EINVAL, "correct force_setup"},
		{"adc", 1e9, EINVAL, "correct force_setup"},
		{"other", 10000, ENODEV, "there is no IIO device \"other\""},
		/* set up wholly; then there is no such folder in sysfs to start it by */
		{"adc", 10000, ENOENT, "null starts no buffer of 5000 samples"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_force_setup asked = {.rate_hz = cases[i].rate_hz};
		struct incise_backend_request request = {
			.arguments = cases[i].arguments,
			.where = "rig.conf:3: force",
			.force = &asked,
		};
		struct incise_error err = {0};
		int before = open_files();

		setup(NULL);
		assert_null(iio_force_open(&request, &err));
		if (errno != cases[i].code || !strstr(err.text, cases[i].says) ||
		    strncmp(err.text, "rig.conf:3: force: ", 19) != 0)
			fail_msg("case %zu: %d %s", i, errno, err.text);
		assert_int_equal(world.made, 0);
		assert_int_equal(open_files(), before);
		/* What started conversions before does so again. */
		assert_string_equal(device_attribute(&world.devices[0],
						     "trigger/current_trigger")
					    ->text,
				    "own");
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(refusals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
