// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_tracker.c through its interface, with the emulator behind a pseudo
 * terminal. Nothing is held to the clock: a host that is busy makes it wait longer.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <sys/file.h>
#include "../../../lib/device/polhemus/polhemus_tracker.h"
#include "../../../lib/device/polhemus/polhemus_tty.h"
#include "pty.h"

#define PATIENCE_NS INT64_C(20000000000)

static const struct incise_tracker_setup two = {
	.n_stations = 2, .stations = {1, 3}, .tube_station = 3, .hemisphere = {1, 0, 0}};
static struct pty pty;

static int begin(void **state)
{
	assert_int_equal(pty_begin(&pty, EMULATOR_FASTRAK), 0);
	/* Its thread looks at it, once it runs. */
	pty_unplug(&pty);
	pty.emulator.present[2] = true;
	assert_int_equal(pty_plug(&pty), 0);
	return 0;
}

static int end(void **state)
{
	pty_unplug(&pty);
	pty_end(&pty);
	return 0;
}

static struct incise_tracker *open_it(const struct polhemus_times *times,
				      struct incise_error *err)
{
	struct polhemus_line *line =
		polhemus_tty_open(pty.path, "rig.conf:1: tracker", err);

	assert_non_null(line);
	return polhemus_tracker_open(line, &two, times, "rig.conf:1: tracker", err);
}

/* Read until @n more came; each follows the one before. */
static int read_some(struct incise_tracker *tracker, uint64_t *next, int n)
{
	int64_t end_ns = pty_now_ns() + PATIENCE_NS;

	while (n > 0 && pty_now_ns() < end_ns) {
		struct incise_tracker_sample samples[16];
		int m = incise_tracker_read(tracker, samples, 16);

		if (m < 0)
			return m;
		for (int i = 0; i < m; i++) {
			assert_true(samples[i].seq >= *next);
			assert_true(samples[i].station == 1 || samples[i].station == 3);
			assert_true(samples[i].t_ns <= pty_now_ns());
			*next = samples[i].seq + 1;
		}
		n -= m;
		if (!m)
			usleep(2000);
	}
	return n > 0 ? -ETIMEDOUT : 0;
}

static void through_the_door(void **state)
{
	struct incise_error err = {0};
	struct incise_tracker *tracker = open_it(&POLHEMUS_TIMES, &err);
	struct incise_tracker_info info;
	uint64_t next = 0;
	int fd;

	if (!tracker)
		fail_msg("%s", err.text);
	incise_tracker_info(tracker, &info);
	assert_string_equal(info.name, "FASTRAK 3.02 OutputCompensat CPG2030-003-10");
	assert_true(info.rate_hz == 120 && info.stations == 2);
	assert_true(incise_tracker_station_hz(&info) == 60);
	assert_true(info.scalpel_station == 1 && info.tube_station == 3);
	/* 4 ms of the device, and 34 bytes of 10 bits at 115200. */
	assert_in_range(info.latency_ns, 6950000, 6952000);
	assert_int_equal(read_some(tracker, &next, 12), 0);
	/* Ours alone. */
	fd = open(pty.path, O_RDWR | O_NOCTTY);
	assert_true(fd < 0 || flock(fd, LOCK_EX | LOCK_NB) < 0);
	if (fd >= 0)
		close(fd);
	tracker->ops->close(tracker);
	assert_int_equal(pty.emulator.eeprom_writes, 0);
}

/* Read all samples up to now. */
static void read_all(struct incise_tracker *tracker, uint64_t *next)
{
	struct incise_tracker_sample sample;

	while (incise_tracker_read(tracker, &sample, 1) > 0)
		*next = sample.seq + 1;
}

static void pulled_out_and_back(void **state)
{
	const struct polhemus_times times = {150, 20, 20000};
	struct incise_error err = {0};
	struct incise_tracker *tracker = open_it(&times, &err);
	struct incise_tracker_sample sample;
	uint64_t next = 0, before, away;

	if (!tracker)
		fail_msg("%s", err.text);
	assert_int_equal(read_some(tracker, &next, 6), 0);
	before = incise_tracker_lost(tracker);
	pty_unplug(&pty);
	/* What came before is still taken; then there is nothing. */
	read_all(tracker, &next);
	usleep(100000);
	read_all(tracker, &next);
	assert_int_equal(incise_tracker_read(tracker, &sample, 1), 0);
	/* It may never come back: what is missing so far counts, 0.4 s of it. */
	usleep(300000);
	away = incise_tracker_lost(tracker);
	assert_true(away >= before + 36);
	/* As switched off and on: as it was delivered. */
	emulator_free(&pty.emulator);
	emulator_init(&pty.emulator, EMULATOR_FASTRAK, pty_now_ns());
	pty.emulator.present[2] = true;
	assert_int_equal(pty_plug(&pty), 0);
	assert_int_equal(read_some(tracker, &next, 6), 0);
	/* It was away for 0.4 s at least: 48 records. */
	assert_true(incise_tracker_lost(tracker) >= before + 48);
	assert_true(incise_tracker_lost(tracker) >= away);
	tracker->ops->close(tracker);
}

/* Its line stays, and what comes through it is nothing, or nothing that was asked for. */
static void switched_off_and_on(void **state)
{
	const struct polhemus_times times = {150, 20, 20000};
	struct incise_error err = {0};
	struct incise_tracker *tracker = open_it(&times, &err);
	uint64_t next = 0, before;

	if (!tracker)
		fail_msg("%s", err.text);
	assert_int_equal(read_some(tracker, &next, 6), 0);
	before = incise_tracker_lost(tracker);
	atomic_store(&pty.deaf, true);
	usleep(250000);
	read_all(tracker, &next);
	atomic_store(&pty.deaf, false);
	assert_int_equal(read_some(tracker, &next, 6), 0);
	/* 30 periods, less one on its way at each end. */
	assert_true(incise_tracker_lost(tracker) >= before + 28);
	/* It streams in ASCII, as its EEPROM may have it. */
	before = incise_tracker_lost(tracker);
	atomic_store(&pty.injected, "F");
	while (atomic_load(&pty.injected))
		usleep(1000);
	usleep(50000);
	read_all(tracker, &next);
	assert_int_equal(read_some(tracker, &next, 6), 0);
	/* Silent for 0.15 s, and then it was set up. */
	assert_true(incise_tracker_lost(tracker) >= before + 18);
	tracker->ops->close(tracker);
}

static const struct polhemus_line_ops *tty_ops;
static _Atomic bool streams, stands_still;
static _Atomic int reopened;

static ssize_t slow_read(struct polhemus_line *line, void *bytes, size_t size,
			 int64_t *t_ns, int timeout_ms)
{
	ssize_t n;

	if (atomic_exchange(&stands_still, false)) {
		usleep(300000);
		return 0;
	}
	/* Else it is a busy host that makes it silent. */
	do
		n = tty_ops->read(line, bytes, size, t_ns, timeout_ms);
	while (!n && atomic_load(&streams));
	return n;
}

static int counted_reopen(struct polhemus_line *line)
{
	atomic_fetch_add(&reopened, 1);
	return tty_ops->reopen(line);
}

/* A computer that slept for a while finds its tracker as it was: it does not set it up again. */
static void stood_still(void **state)
{
	const struct polhemus_times times = {250, 20, 20000};
	struct incise_error err = {0};
	struct polhemus_line *line =
		polhemus_tty_open(pty.path, "rig.conf:1: tracker", &err);
	struct polhemus_line_ops slow;
	struct incise_tracker *tracker;
	uint64_t next = 0;

	assert_non_null(line);
	tty_ops = line->ops;
	slow = *tty_ops;
	slow.read = slow_read;
	slow.reopen = counted_reopen;
	line->ops = &slow;
	tracker = polhemus_tracker_open(line, &two, &times, "rig.conf:1: tracker", &err);
	if (!tracker)
		fail_msg("%s", err.text);
	atomic_store(&streams, true);
	assert_int_equal(read_some(tracker, &next, 6), 0);
	atomic_store(&reopened, 0);
	atomic_store(&stands_still, true);
	while (atomic_load(&stands_still))
		usleep(1000);
	/* What came meanwhile waits in the line. */
	assert_int_equal(read_some(tracker, &next, 40), 0);
	atomic_store(&streams, false);
	assert_int_equal(atomic_load(&reopened), 0);
	tracker->ops->close(tracker);
}

static void gone_for_good(void **state)
{
	const struct polhemus_times times = {200, 20, 100};
	struct incise_error err = {0};
	struct incise_tracker *tracker = open_it(&times, &err);
	int64_t end_ns = pty_now_ns() + PATIENCE_NS;
	struct incise_tracker_sample sample;
	char cause[200];
	int rc = 0;

	assert_non_null(tracker);
	pty_unplug(&pty);
	while (rc >= 0 && pty_now_ns() < end_ns) {
		rc = incise_tracker_read(tracker, &sample, 1);
		usleep(1000);
	}
	assert_int_equal(rc, -ENODEV);
	assert_int_equal(incise_tracker_read(tracker, &sample, 1), -ENODEV);
	assert_true(incise_tracker_cause(tracker, cause, sizeof(cause)) > 0);
	assert_non_null(strstr(cause, "disconnected and was not back"));
	tracker->ops->close(tracker);
	assert_int_equal(pty_plug(&pty), 0);
}

static void refuses(void **state)
{
	static const struct incise_tracker_setup bad[] = {
		{.n_stations = 0, .hemisphere = {1, 0, 0}},
		{.n_stations = 5, .stations = {1, 2, 3, 4}, .hemisphere = {1, 0, 0}},
		{.n_stations = 2, .stations = {2, 1}, .hemisphere = {1, 0, 0}},
		{.n_stations = 1, .stations = {5}, .hemisphere = {1, 0, 0}},
		{.n_stations = 1,
		 .stations = {1},
		 .hemisphere = {1, 0, 0},
		 .tube_station = 1},
		{.n_stations = 2,
		 .stations = {1, 3},
		 .hemisphere = {1, 0, 0},
		 .tube_station = 2},
		{.n_stations = 1, .stations = {1}, .hemisphere = {0, 0, 0}},
		{.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}, .sync = 3},
		{.n_stations = 1,
		 .stations = {1},
		 .hemisphere = {1, 0, 0},
		 .offset_mm = {0, 1 / 0.0, 0}},
	};
	struct incise_error err;

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		struct polhemus_line *line =
			polhemus_tty_open(pty.path, "rig.conf", &err);

		assert_non_null(line);
		assert_null(polhemus_tracker_open(line, &bad[i], &POLHEMUS_TIMES,
						  "rig.conf", &err));
		assert_int_equal(errno, EINVAL);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(through_the_door, begin, end),
		cmocka_unit_test_setup_teardown(pulled_out_and_back, begin, end),
		cmocka_unit_test_setup_teardown(switched_off_and_on, begin, end),
		cmocka_unit_test_setup_teardown(stood_still, begin, end),
		cmocka_unit_test_setup_teardown(gone_for_good, begin, end),
		cmocka_unit_test_setup_teardown(refuses, begin, end),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
