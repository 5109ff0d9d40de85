// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/comedi_force.c on a card that a test makes: its file is a pipe, and the
 * linker hands read() of it to a function here, which has it fail as the kernel does.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <sched.h>
#include <stdlib.h>
#include "../../../lib/device/daq/comedi_force.h"
#include "card.h"

static atomic_int fail; /* an errno for the next read, once; -1: the end of the command */

ssize_t __real_read(int fd, void *bytes, size_t size);

ssize_t __wrap_read(int fd, void *bytes, size_t size)
{
	int code = 0;
	ssize_t got = __real_read(fd, bytes, size);

	if (fd == card.pipe[0] && got < 0 && errno == EAGAIN) {
		code = atomic_exchange(&fail, 0);
		if (code < 0)
			return 0;
		errno = code ? code : EAGAIN;
	}
	return got;
}

static int setup(void **state)
{
	card_reset();
	atomic_store(&fail, 0);
	return pipe(card.pipe);
}

static int teardown(void **state)
{
	close(card.pipe[0]);
	close(card.pipe[1]);
	return 0;
}

static struct incise_force *open_force(struct incise_error *err)
{
	static const struct incise_force_setup setup = {.rate_hz = 10000,
							.full_scale_V = 5};
	static const struct incise_backend_request request = {
		.arguments = "/dev/comedi0:0",
		.where = "rig.conf:3: force",
		.force = &setup};

	return comedi_force_open(&request, err);
}

/* Until something comes, or the end. */
static int take(struct incise_force *force, struct incise_force_sample *samples, int n)
{
	int have = 0, rc = 0;

	while (have < n) {
		rc = incise_force_read(force, samples + have, n - have);
		if (rc < 0)
			return rc;
		have += rc;
		sched_yield();
	}
	return have;
}

static void send(const void *bytes, size_t size)
{
	assert_int_equal(write(card.pipe[1], bytes, size), size);
}

static void send_codes(int from, int n)
{
	for (int i = 0; i < n; i++) {
		sampl_t code = (sampl_t)(from + i);

		send(&code, sizeof(code));
	}
}

static void samples_come(void **state)
{
	struct incise_force_sample samples[100];
	struct incise_error err = {0};
	struct incise_force *force = open_force(&err);
	struct incise_force_info info;
	sampl_t dirty = 0xf123;

	assert_non_null(force);
	send_codes(1, 98);
	send(&dirty, sizeof(dirty)); /* bits above the 12 */
	send("\x00", 1);	     /* half a sample */
	send("\x00", 1);
	assert_int_equal(take(force, samples, 100), 100);
	for (int i = 0; i < 100; i++) {
		assert_int_equal(samples[i].seq, i);
		assert_true(!i || samples[i].t_ns > samples[i - 1].t_ns);
		assert_int_equal(samples[i].code, i < 98 ? i + 1 : i == 98 ? 0x123 : 0);
	}
	incise_force_info(force, &info);
	assert_string_equal(info.name, "fake-16 channel 0, by arrival");
	assert_true(info.rate_hz == 10000);
	assert_int_equal(info.clipped, 1);
	assert_int_equal(incise_force_lost(force), 0);
	force->ops->close(force);
	assert_int_equal(card.opened, 0);
}

static void wide_samples(void **state)
{
	static const lsampl_t codes[] = {0, 0x123456, 0xffffff, 0x1234567};
	struct incise_force_sample samples[4];
	struct incise_error err = {0};
	struct incise_force *force;

	card.flags |= SDF_LSAMPL;
	card.maxdata = 0xffffff;
	force = open_force(&err);
	assert_non_null(force);
	send(codes, 7);
	send((const char *)codes + 7, 9);
	assert_int_equal(take(force, samples, 4), 4);
	assert_int_equal(samples[1].code, 0x123456);
	assert_int_equal(samples[2].code, 0xffffff);
	assert_int_equal(samples[3].code, 0x234567);
	force->ops->close(force);
}

static void wait_for_command(int n)
{
	while (atomic_load(&card.commands) < n)
		sched_yield();
}

/* EPIPE: the command was ended for want of room. It is started again, with a gap. */
static void overflow(void **state)
{
	static const int reasons[] = {EPIPE, -1};

	for (size_t i = 0; i < 2; i++) {
		struct incise_force_sample samples[20];
		struct incise_error err = {0};
		struct incise_force_info info;
		struct incise_force *force;

		card.commands = 0;
		force = open_force(&err);
		assert_non_null(force);
		send_codes(100, 10);
		assert_int_equal(take(force, samples, 10), 10);
		atomic_store(&fail, reasons[i]);
		wait_for_command(2);
		send_codes(200, 10);
		assert_int_equal(take(force, samples + 10, 10), 10);
		incise_force_info(force, &info);
		assert_int_equal(info.overflows, 1);
		assert_int_equal(samples[9].seq, 9);
		assert_int_equal(samples[10].code, 200);
		/* one at least; how many more is a matter of time */
		assert_true(samples[10].seq > 10);
		assert_int_equal(samples[10].seq - 10, incise_force_lost(force));
		assert_int_equal(samples[19].seq, samples[10].seq + 9);
		assert_true(samples[10].t_ns > samples[9].t_ns);
		force->ops->close(force);
	}
}

static void unplugged(void **state)
{
	static const struct {
		int code, told;
	} cases[] = {{ENODEV, -ENODEV}, {ENXIO, -ENODEV}, {EIO, -EIO}, {EINVAL, -EIO}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_force_sample samples[10];
		struct incise_error err = {0};
		struct incise_force *force = open_force(&err);

		assert_non_null(force);
		send_codes(1, 3);
		assert_int_equal(take(force, samples, 3), 3);
		atomic_store(&fail, cases[i].code);
		assert_int_equal(take(force, samples, 1), cases[i].told);
		force->ops->close(force);
	}
}

/* A command that ends again and again without a sample is given up. */
static void never_goes_on(void **state)
{
	struct incise_force_sample sample;
	struct incise_error err = {0};
	struct incise_force *force = open_force(&err);
	int rc = 0;

	assert_non_null(force);
	while (!rc) {
		atomic_store(&fail, EPIPE);
		rc = incise_force_read(force, &sample, 1);
		sched_yield();
	}
	assert_int_equal(rc, -EIO);
	assert_int_equal(card.commands, 6);
	force->ops->close(force);
}

static void does_not_start(void **state)
{
	struct incise_error err = {0};

	card.command_error = EBUSY;
	assert_null(open_force(&err));
	assert_int_equal(errno, EBUSY);
	assert_non_null(
		strstr(err.text, "rig.conf:3: force: /dev/comedi0 does not start"));
	assert_int_equal(card.opened, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(samples_come, setup, teardown),
		cmocka_unit_test_setup_teardown(wide_samples, setup, teardown),
		cmocka_unit_test_setup_teardown(overflow, setup, teardown),
		cmocka_unit_test_setup_teardown(unplugged, setup, teardown),
		cmocka_unit_test_setup_teardown(never_goes_on, setup, teardown),
		cmocka_unit_test_setup_teardown(does_not_start, setup, teardown),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
