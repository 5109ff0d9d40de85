// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/scan.c: what it says where there is nothing to scan. What it finds is in the
 * tests of the backends that can.
 */
#include "../unit.h"
#include <incise/scan.h>

static int found(void *context, const struct incise_scan_device *device)
{
	fail_msg("found %s", device->device);
	return 0;
}

TEST(what_cannot_be_scanned_is_said)
{
	static const struct {
		const char *spec;
		int code;
		const char *says;
	} cases[] = {
		{"can0", EINVAL, "can0:"},
		{"", EINVAL, NULL},
		{"an_extremely_long_name_of_a_backend:x", EINVAL, NULL},
		{"nosuch:can0", ENODEV, "\"nosuch\""},
		{"../../etc:can0", ENODEV, "\"../../etc\""},
		{"sim:", EOPNOTSUPP, "sim"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_error(incise_scan("stepper", cases[i].spec, found, NULL, &err),
			     cases[i].code, &err, cases[i].says);
	}
}

TEST(without_a_function_only_the_backend_is_looked_for)
{
	assert_int_equal(incise_scan("stepper", "sim:", NULL, NULL, &err), 0);
	assert_error(incise_scan("stepper", "nosuch:can0", NULL, NULL, &err), ENODEV,
		     &err, "\"nosuch\"");
}
