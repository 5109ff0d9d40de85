// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_tty.c: names that are no line, bytes over a line whose other end the test has,
 * and the backend "tty" with the emulator behind a pseudo terminal.
 */
#include "../unit.h"
#include <fcntl.h>
#include "../../../lib/rig/backends.h"
#include "../../../lib/device/polhemus/polhemus_tty.h"
#include "pty.h"

extern const struct incise_backend incise_tracker_tty;

/* --- polhemus_tty --- */

static int master;
static char path[64];

static int begin(void **state)
{
	master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
	return master < 0 || grantpt(master) || unlockpt(master) ||
	       ptsname_r(master, path, sizeof(path));
}

static int end(void **state)
{
	return master < 0 ? 0 : close(master);
}

TEST(names)
{
	static const struct {
		const char *arguments;
		int code;
	} cases[] = {
		{"", EINVAL},
		{"ttyUSB0:9600", EINVAL},
		{"/dev/null:115201", EINVAL},
		{"/dev/null:99999999999", EINVAL},
		{"/dev/null:9600", EINVAL},
		{"/tmp", EINVAL},
		{"/dev/not-there", ENODEV},
		{"/dev/not:there:9600", ENODEV},
		{"/dev/null/x", ENODEV},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		err = (struct incise_error){0};
		assert_null(polhemus_tty_open(cases[i].arguments, "rig.conf", &err));
		if (errno != cases[i].code || err.code != errno)
			fail_msg("%s: %s", cases[i].arguments, err.text);
	}
}

TEST(there_and_back, begin, end)
{
	struct polhemus_line *line = polhemus_tty_open(path, "rig.conf", &err);
	unsigned char bytes[16];
	int64_t t_ns = 0, before;

	succeeds(line);
	assert_int_equal(line->family, -1);
	/* ten bits a byte at the usual rate */
	assert_int_equal(line->ns_per_byte, 10 * INT64_C(1000000000) / 115200);
	assert_string_equal(line->name, path);
	assert_int_equal(line->ops->write(line, "P\r", 2), 0);
	assert_int_equal(read(master, bytes, sizeof(bytes)), 2);
	assert_memory_equal(bytes, "P\r", 2);
	/* Nothing comes: no error. What comes has a time. */
	assert_int_equal(line->ops->read(line, bytes, sizeof(bytes), &t_ns, 1), 0);
	before = t_ns;
	assert_int_equal(write(master, "01 \r\n", 5), 5);
	assert_int_equal(line->ops->read(line, bytes, 3, &t_ns, 20000), 3);
	assert_true(t_ns > before);
	assert_int_equal(line->ops->read(line, bytes + 3, 13, &t_ns, 20000), 2);
	assert_memory_equal(bytes, "01 \r\n", 5);
	line->ops->close(line);
}

TEST(pulled_out, begin, end)
{
	struct polhemus_line *line = polhemus_tty_open(path, "rig.conf", &err);
	unsigned char bytes[16];
	int64_t t_ns;

	assert_non_null(line);
	close(master);
	master = -1;
	assert_int_equal(line->ops->read(line, bytes, sizeof(bytes), &t_ns, 20000),
			 -ENODEV);
	assert_int_equal(line->ops->write(line, "P", 1), -ENODEV);
	assert_true(line->ops->reopen(line) < 0);
	assert_int_equal(line->ops->read(line, bytes, sizeof(bytes), &t_ns, 1), -ENODEV);
	line->ops->close(line);
}

/* --- tracker --- */

static struct pty pty;

static int tracker_begin(void **state)
{
	assert_int_equal(pty_begin(&pty, EMULATOR_FASTRAK), 0);
	return 0;
}

static int tracker_end(void **state)
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

TEST(a_scan, tracker_begin, tracker_end)
{
	struct incise_scan_device found = {0};
	char arguments[80];

	snprintf(arguments, sizeof(arguments), "%s:115200", pty.path);
	succeeds(!incise_tracker_tty.scan(arguments, count_found, &found, &err));
	assert_non_null(strstr(found.device, arguments));
	assert_string_equal(found.what, "FASTRAK 3.02 OutputCompensat CPG2030-003-10");
	assert_int_equal(found.n, 3);
	assert_string_equal(found.property[2].text, "1");
	assert_true(found.usable);
	assert_int_equal(incise_tracker_tty.scan("/dev/not-there", count_found, &found,
						 &err),
			 -ENODEV);
	assert_int_equal(incise_tracker_tty.scan("", count_found, &found, &err), 0);
}

TEST(opens, tracker_begin, tracker_end)
{
	static const struct incise_tracker_setup setup = {
		.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}};
	struct incise_backend_request request = {
		.arguments = pty.path, .where = "rig.conf:1: tracker", .tracker = &setup};
	struct incise_tracker *tracker = incise_tracker_tty.open(&request, &err);
	struct incise_tracker_info info;

	succeeds(tracker);
	incise_tracker_info(tracker, &info);
	assert_true(info.rate_hz == 120 && info.stations == 1);
	/* It is ours alone. */
	assert_null(incise_tracker_tty.open(&request, &err));
	assert_int_equal(errno, EBUSY);
	tracker->ops->close(tracker);
}

TEST(back_again, tracker_begin, tracker_end)
{
	struct polhemus_line *line = polhemus_tty_open(pty.path, "rig.conf", &err);
	unsigned char bytes[64];
	int64_t t_ns;

	succeeds(line);
	pty_unplug(&pty);
	while (line->ops->read(line, bytes, sizeof(bytes), &t_ns, 20000) > 0)
		;
	assert_int_equal(line->ops->write(line, "P", 1), -ENODEV);
	assert_true(line->ops->reopen(line) < 0);
	assert_int_equal(line->ops->write(line, "P", 1), -ENODEV);
	assert_int_equal(pty_plug(&pty), 0);
	assert_int_equal(line->ops->reopen(line), 0);
	/* It answers with a record. */
	assert_int_equal(line->ops->write(line, "P", 1), 0);
	assert_true(line->ops->read(line, bytes, sizeof(bytes), &t_ns, 20000) > 0);
	line->ops->close(line);
}
