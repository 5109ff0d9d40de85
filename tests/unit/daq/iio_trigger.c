// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_trigger.c in a folder that stands for configfs.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include "../../../lib/device/daq/iio_trigger.h"

static char folder[64];

static int setup(void **state)
{
	snprintf(folder, sizeof(folder), "/tmp/incise-test-XXXXXX");
	return mkdtemp(folder) ? 0 : -1;
}

/* Fails where anything is left. */
static int teardown(void **state)
{
	return rmdir(folder);
}

static bool there(const char *name)
{
	char path[200];

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	return !access(path, F_OK);
}

static void make(const char *name)
{
	char path[200];

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	assert_int_equal(mkdir(path, 0755), 0);
}

static void comes_and_goes(void **state)
{
	char one[64], two[64], expected[64];

	assert_int_equal(iio_trigger_make(folder, one, sizeof(one)), 0);
	assert_int_equal(iio_trigger_make(folder, two, sizeof(two)), 0);
	snprintf(expected, sizeof(expected), "incise-%ld-0", (long)getpid());
	assert_string_equal(one, expected);
	snprintf(expected, sizeof(expected), "incise-%ld-1", (long)getpid());
	assert_string_equal(two, expected);
	/* this program lives: its own stay */
	iio_trigger_sweep(folder);
	assert_true(there(one) && there(two));
	iio_trigger_remove(folder, one);
	iio_trigger_remove(folder, two);
	iio_trigger_remove(folder, "");
	assert_false(there(one) || there(two));
}

static void kernel_without(void **state)
{
	char name[64];

	assert_int_equal(iio_trigger_make("/nonexistent", name, sizeof(name)), -ENOENT);
	assert_string_equal(name, "");
	iio_trigger_sweep("/nonexistent");
}

static void too_many(void **state)
{
	char names[17][64];
	int n = 0;

	while (n < 17 && !iio_trigger_make(folder, names[n], sizeof(*names)))
		n++;
	assert_int_equal(n, 16);
	while (n--)
		iio_trigger_remove(folder, names[n]);
}

/* Only those of the dead, and only what has the form of ours. */
static void sweep(void **state)
{
	static const char *const others[] = {"timer",	   "incise-",	 "incise-1",
					     "incise-x-0", "incise-0-0", "incise--5-0",
					     "incise-1-0"};
	char dead[64], more[64];
	pid_t child = fork();

	if (!child)
		_exit(0);
	assert_int_equal(waitpid(child, NULL, 0), child);
	snprintf(dead, sizeof(dead), "incise-%ld-3", (long)child);
	snprintf(more, sizeof(more), "incise-%ld-3-x", (long)child);
	make(dead);
	make(more);
	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++)
		make(others[i]);
	iio_trigger_sweep(folder);
	assert_false(there(dead));
	assert_true(there(more));
	iio_trigger_remove(folder, more);
	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++) {
		assert_true(there(others[i]));
		iio_trigger_remove(folder, others[i]);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(comes_and_goes, setup, teardown),
		cmocka_unit_test_setup_teardown(kernel_without, setup, teardown),
		cmocka_unit_test_setup_teardown(too_many, setup, teardown),
		cmocka_unit_test_setup_teardown(sweep, setup, teardown),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
