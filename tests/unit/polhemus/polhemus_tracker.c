// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_tracker.c through its interface, with its thread and the emulator,
 * on a clock of the test. polhemus_tty.c has it behind a pseudo terminal.
 */
#include "../unit.h"
#include "../../../lib/device/polhemus/polhemus_tracker.h"
#include "../virtual_time.h" /* with __wrap_clock_gettime() and others */
#include "line.h"

#define MS INT64_C(1000000)

static const struct incise_tracker_setup two = {
	.n_stations = 2, .stations = {1, 3}, .tube_station = 3, .hemisphere = {1, 0, 0}};
static struct emulator e;
static struct test_line line;
static struct incise_error err;

static int64_t wait_until(int64_t until_ns)
{
	if (until_ns > virtual_time.now_ns)
		virtual_sleep_until(until_ns);
	return virtual_time.now_ns;
}

static void nap(int64_t ms)
{
	virtual_sleep_until(virtual_time.now_ns + ms * MS);
}

static void new_emulator(void)
{
	emulator_free(&e);
	emulator_init(&e, EMULATOR_FASTRAK, virtual_time.now_ns);
	e.present[2] = true;
}

static int begin(void **state)
{
	virtual_time_start(1000 * MS, NULL);
	new_emulator();
	test_line_init(&line, &e, -1);
	line.line.ns_per_byte = 86806; /* 10 bits at 115200 baud */
	line.clock = wait_until;
	return 0;
}

static int end(void **state)
{
	emulator_free(&e);
	return 0;
}

static struct incise_tracker *open_tracker(const struct polhemus_times *times)
{
	struct incise_tracker *tracker = polhemus_tracker_open(
		&line.line, &two, times, "rig.conf:1: tracker", &err);

	succeeds(tracker);
	return tracker;
}

/* Read what there is; each follows the one before. Returns how many. */
static int read_all(struct incise_tracker *tracker, uint64_t *next)
{
	struct incise_tracker_sample s;
	int n = 0;

	for (; incise_tracker_read(tracker, &s, 1) > 0; n++) {
		assert_true(s.seq >= *next);
		assert_true(s.station == 1 || s.station == 3);
		assert_true(s.t_ns <= virtual_time.now_ns);
		*next = s.seq + 1;
	}
	return n;
}

TEST(through_the_door, begin, end)
{
	struct incise_tracker *tracker = open_tracker(&POLHEMUS_TIMES);
	struct incise_tracker_info info;
	uint64_t next = 0;

	incise_tracker_info(tracker, &info);
	assert_string_equal(info.name, "FASTRAK 3.02 OutputCompensat CPG2030-003-10");
	assert_true(info.rate_hz == 120 && info.stations == 2);
	assert_true(incise_tracker_station_hz(&info) == 60);
	assert_true(info.scalpel_station == 1 && info.tube_station == 3);
	/* 4 ms of the device, and 34 bytes. */
	assert_int_equal(info.latency_ns, 4000000 + 34 * 86806);
	nap(105);
	assert_in_range(read_all(tracker, &next), 11, 13);
	assert_int_equal(incise_tracker_lost(tracker), 0);
	tracker->ops->close(tracker);
	assert_false(e.continuous);
	assert_int_equal(e.eeprom_writes, 0);
}

TEST(pulled_out_and_back, begin, end)
{
	struct incise_tracker *tracker =
		open_tracker(&(struct polhemus_times){150, 20, 20000});
	struct incise_tracker_sample sample;
	uint64_t next = 0, away;

	nap(50);
	assert_true(read_all(tracker, &next) > 4);
	line.gone = -ENODEV;
	nap(400);
	read_all(tracker, &next);
	assert_int_equal(incise_tracker_read(tracker, &sample, 1), 0);
	/* It may never come back: what is missing so far counts, 48 of 0.4 s. */
	away = incise_tracker_lost(tracker);
	assert_in_range(away, 40, 48);
	/* As switched off and on: as it was delivered. */
	new_emulator();
	line.gone = 0;
	nap(3000);
	assert_true(read_all(tracker, &next) > 6);
	assert_true(incise_tracker_lost(tracker) >= 48);
	assert_true(incise_tracker_lost(tracker) >= away);
	tracker->ops->close(tracker);
}

/* Its line stays, and what comes through it is nothing, or nothing that was asked for. */
TEST(switched_off_and_on, begin, end)
{
	struct incise_tracker *tracker =
		open_tracker(&(struct polhemus_times){150, 20, 20000});
	uint64_t next = 0, before;

	nap(50);
	read_all(tracker, &next);
	line.mute = e.deaf = true;
	nap(250);
	read_all(tracker, &next);
	line.mute = e.deaf = false;
	nap(3000);
	assert_true(read_all(tracker, &next) > 6);
	before = incise_tracker_lost(tracker);
	assert_true(before >= 28);
	/* It streams in ASCII, as its EEPROM may have it: silent for 0.15 s, then set up. */
	emulator_write(&e, "F", 1);
	nap(3000);
	assert_true(read_all(tracker, &next) > 6);
	assert_true(e.binary);
	assert_true(incise_tracker_lost(tracker) >= before + 18);
	tracker->ops->close(tracker);
}

/* A computer that slept for a while finds its tracker as it was: it does not set it up again. */
TEST(stood_still, begin, end)
{
	struct incise_tracker *tracker =
		open_tracker(&(struct polhemus_times){250, 20, 20000});
	uint64_t next = 0;

	nap(50);
	read_all(tracker, &next);
	virtual_time.now_ns += 300 * MS;
	/* What came meanwhile waits in the line. */
	nap(100);
	assert_in_range(read_all(tracker, &next), 46, 50);
	assert_int_equal(incise_tracker_lost(tracker), 0);
	assert_int_equal(line.reopened, 0);
	tracker->ops->close(tracker);
}

TEST(gone_for_good, begin, end)
{
	struct incise_tracker *tracker =
		open_tracker(&(struct polhemus_times){200, 20, 100});
	struct incise_tracker_sample sample;
	uint64_t next = 0;
	char cause[200];

	line.gone = -ENODEV;
	nap(90);
	read_all(tracker, &next);
	assert_int_equal(incise_tracker_read(tracker, &sample, 1), 0);
	nap(200);
	for (int i = 0; i < 2; i++)
		assert_int_equal(incise_tracker_read(tracker, &sample, 1), -ENODEV);
	assert_true(incise_tracker_cause(tracker, cause, sizeof(cause)) > 0);
	assert_non_null(strstr(cause, "FASTRAK"));
	tracker->ops->close(tracker);
}

TEST(refuses, begin, end)
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
	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		assert_null(polhemus_tracker_open(&line.line, &bad[i], &POLHEMUS_TIMES,
						  "rig.conf", &err));
		assert_int_equal(errno, EINVAL);
	}
}
