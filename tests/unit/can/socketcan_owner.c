// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/socketcan_owner.c on the names of the machine; those here are of this process.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "../../../lib/device/can/bus/socketcan_owner.h"

static char interface[32];

static int take(const char *name, uint8_t node, struct incise_error *err)
{
	return can_owner_take(name, node, "rig.conf:1: stepper", err);
}

static void a_node_has_one_owner(void **state)
{
	struct incise_error err = {0};
	char longer[40];
	int fd = take(interface, 16, &err), other;

	assert_true(fd >= 0);
	assert_int_equal(take(interface, 16, &err), -EBUSY);
	assert_int_equal(err.code, EBUSY);
	assert_ptr_equal(strstr(err.text, "rig.conf:1: stepper: another program"),
			 err.text);
	/* What ss shows is what the line says. */
	assert_non_null(strstr(err.text, interface));
	assert_non_null(strstr(err.text, "/16)"));
	/* Another node, and another interface, however alike. */
	snprintf(longer, sizeof(longer), "%s1", interface);
	other = take(interface, 1, &err);
	assert_true(other >= 0);
	close(other);
	other = take(longer, 16, &err);
	assert_true(other >= 0);
	close(other);
	close(fd);
	fd = take(interface, 16, &err);
	assert_true(fd >= 0);
	close(fd);
}

static void who_dies_owns_nothing(void **state)
{
	struct incise_error err = {0};
	pid_t child = fork();
	int status, fd;

	assert_true(child >= 0);
	if (!child)
		_exit(take(interface, 17, NULL) < 0);
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_int_equal(status, 0);
	fd = take(interface, 17, &err);
	assert_true(fd >= 0);
	close(fd);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_node_has_one_owner),
		cmocka_unit_test(who_dies_owns_nothing),
	};

	snprintf(interface, sizeof(interface), "test%ld", (long)getpid());
	return cmocka_run_group_tests(tests, NULL, NULL);
}
