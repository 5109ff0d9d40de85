// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_stream.c on files that stand for a device: a folder for sysfs, a pipe
 * for what is read.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <ftw.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../../../lib/device/daq/iio_stream.h"
#include "converter.h"

static char folder[64];
static int ends[2];

static void put(const char *name, const char *text)
{
	char path[200];
	FILE *f;

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	f = fopen(path, "w");
	assert_non_null(f);
	fputs(text, f);
	fclose(f);
}

/* Files keep what was behind a shorter write: the first character tells. */
static char first_of(const char *name)
{
	char path[200];
	FILE *f;
	int c;

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	f = fopen(path, "r");
	assert_non_null(f);
	c = fgetc(f);
	fclose(f);
	return (char)c;
}

static int setup(void **state)
{
	static const char *const folders[] = {"", "/scan_elements", "/buffer"};
	static const char *const files[] = {"in_voltage0_en", "in_voltage1_grip_en",
					    "in_timestamp_en"};
	char path[200];

	snprintf(folder, sizeof(folder), "/tmp/incise-test-XXXXXX");
	if (!mkdtemp(folder))
		return -1;
	for (size_t i = 1; i < 3; i++) {
		snprintf(path, sizeof(path), "%s%s", folder, folders[i]);
		mkdir(path, 0755);
	}
	for (size_t i = 0; i < 3; i++) {
		snprintf(path, sizeof(path), "scan_elements/%s", files[i]);
		put(path, "1");
	}
	put("buffer/length", "2");
	put("buffer/watermark", "1");
	put("buffer/enable", "0");
	return pipe2(ends, O_NONBLOCK);
}

static int drop(const char *path, const struct stat *status, int type, struct FTW *at)
{
	return remove(path);
}

static int teardown(void **state)
{
	close(ends[0]);
	close(ends[1]);
	return nftw(folder, drop, 8, FTW_DEPTH | FTW_PHYS);
}

/* A converter of which the second channel, named, is sampled: "le:s24/32>>8". */
static struct iio_source source_of(struct iio_channel *voltage, struct iio_channel *stamp)
{
	*voltage = (struct iio_channel){.id = "voltage1", .name = "grip", .index = 1};
	*stamp = (struct iio_channel){.id = "timestamp", .index = 2};
	return (struct iio_source){
		.voltage = voltage,
		.stamp = stamp,
		.format = {.bytes = 4, .bits = 24, .shift = 8, .is_signed = true},
		.stamp_format = {.bytes = 8, .bits = 64, .is_signed = true},
	};
}

static void starts_and_stops(void **state)
{
	struct iio_channel voltage, stamp;
	struct iio_source source = source_of(&voltage, &stamp);
	struct iio_stream stream = {.fd = ends[0]};

	assert_int_equal(iio_stream_start(&stream, &source, folder, 50, 7000), 0);
	assert_int_equal(first_of("scan_elements/in_voltage0_en"), '0');
	assert_int_equal(first_of("scan_elements/in_voltage1_grip_en"), '1');
	assert_int_equal(first_of("scan_elements/in_timestamp_en"), '1');
	assert_int_equal(first_of("buffer/length"), '7');
	assert_int_equal(first_of("buffer/watermark"), '5');
	assert_int_equal(first_of("buffer/enable"), '1');
	iio_stream_stop(&stream);
	assert_int_equal(first_of("buffer/enable"), '0');
	assert_int_equal(first_of("scan_elements/in_timestamp_en"), '0');
	iio_stream_stop(&stream);
}

static void does_not_start(void **state)
{
	struct iio_channel voltage, stamp;
	struct iio_source source = source_of(&voltage, &stamp);
	struct iio_stream stream = {.fd = ends[0]};

	voltage.name = "other";
	assert_int_equal(iio_stream_start(&stream, &source, folder, 50, 7000), -ENOENT);
	assert_int_equal(iio_stream_start(&stream, &source, "/nonexistent", 50, 7000),
			 -ENOENT);
	iio_stream_stop(&stream);
}

/* Elements stand on multiples of their size, in the order of their index. */
static void layouts(void **state)
{
	static const struct {
		unsigned int bytes;
		long index, stamp_index;
		size_t step, voltage_at, stamp_at;
	} cases[] = {
		{1, 0, 1, 16, 0, 8}, {2, 0, 1, 16, 0, 8}, {4, 3, 9, 16, 0, 8},
		{8, 0, 1, 16, 0, 8}, {2, 1, 0, 16, 8, 0}, {8, 1, 0, 16, 8, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct iio_channel voltage, stamp;
		struct iio_source source = source_of(&voltage, &stamp);
		struct iio_stream stream = {.fd = ends[0]};

		source.format.bytes = cases[i].bytes;
		voltage.index = cases[i].index;
		stamp.index = cases[i].stamp_index;
		assert_int_equal(iio_stream_start(&stream, &source, folder, 5, 10), 0);
		assert_int_equal(stream.step, cases[i].step);
		assert_int_equal(stream.voltage_at, cases[i].voltage_at);
		assert_int_equal(stream.stamp_at, cases[i].stamp_at);
		iio_stream_stop(&stream);
	}
}

static void scans_are_read(void **state)
{
	static const struct {
		uint32_t volts;
		uint32_t filling;
		int64_t t_ns;
	} scans[] = {{0x80000012, 7, 1}, {0x000001ff, 8, -2}, {0x7fffff00, 9, INT64_MAX}};
	static const int32_t codes[] = {0, 0x800001, 0xffffff};
	struct iio_channel voltage, stamp;
	struct iio_source source = source_of(&voltage, &stamp);
	struct iio_stream stream = {.fd = ends[0]};

	assert_int_equal(iio_stream_start(&stream, &source, folder, 5, 10), 0);
	assert_int_equal(iio_stream_read(&stream), -EAGAIN);
	assert_int_equal(write(ends[1], scans, sizeof(scans)), sizeof(scans));
	assert_int_equal(iio_stream_read(&stream), 3);
	for (int i = 0; i < 3; i++) {
		assert_int_equal(iio_stream_code(&stream, i), codes[i]);
		assert_true(iio_stream_stamp(&stream, i) == scans[i].t_ns);
	}
	/* what no device does */
	assert_int_equal(write(ends[1], scans, 7), 7);
	assert_int_equal(iio_stream_read(&stream), -EIO);
	stream.fd = -1;
	assert_int_equal(iio_stream_read(&stream), -EBADF);
	iio_stream_stop(&stream);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(starts_and_stops, setup, teardown),
		cmocka_unit_test_setup_teardown(does_not_start, setup, teardown),
		cmocka_unit_test_setup_teardown(layouts, setup, teardown),
		cmocka_unit_test_setup_teardown(scans_are_read, setup, teardown),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
