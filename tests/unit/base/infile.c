// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise/infile.h: lines and whole files, their limits, pipes, devices, decimal numbers.
 */
#include "../unit.h"
#include <fcntl.h>
#include <pthread.h>
#include <sys/stat.h>
#include <incise/infile.h>
#include "temp_file.h"

static const struct incise_infile_kind stream = {.name = "a text", .advice = "give one"};
static const struct incise_infile_kind small = {.name = "a note", .size_max = 1 << 20};

TEST(test_lines_of_all_lengths)
{
	/* Around the sizes of the buffer, twice it, and the limit of a line. */
	static const size_t lengths[] = {0,	 1,	 65534,	 65535,	  65536, 65537, 3,
					 131071, 131072, 131073, 1 << 20, 70000, 5};
	const size_t n = sizeof(lengths) / sizeof(*lengths);

	for (int ended = 0; ended < 2; ended++) {
		struct temp_file temp = temp_file_new("l.txt", "");
		FILE *out = fopen(temp.path, "w");
		struct incise_infile *file;
		char *line;

		for (size_t i = 0; i < n; i++) {
			for (size_t k = 0; k < lengths[i]; k++)
				putc('a' + (int)((i + k) % 26), out);
			if (i + 1 < n || ended)
				putc('\n', out);
		}
		fclose(out);
		file = incise_infile_open(temp.path, &stream, NULL);
		assert_non_null(file);
		for (size_t i = 0; i < n; i++) {
			assert_int_equal(incise_infile_line(file, &line, NULL), 1);
			assert_int_equal(strlen(line), lengths[i]);
			for (size_t k = 0; k < lengths[i]; k++)
				if (line[k] != 'a' + (int)((i + k) % 26))
					fail_msg("line %zu, byte %zu", i, k);
		}
		assert_int_equal(incise_infile_line(file, &line, NULL), 0);
		assert_int_equal(incise_infile_line(file, &line, NULL), 0);
		incise_infile_close(file);
		temp_file_free(&temp);
	}
}

TEST(test_limits_are_named)
{
	struct temp_file temp = temp_file_new("l.txt", "one\n");
	struct incise_infile *file;
	char *line;
	size_t size;

	line = incise_infile_read(temp.path, &small, &size, &err);
	assert_string_equal(line, "one\n");
	assert_int_equal(size, 4);
	free(line);
	/* The limit itself is within it. */
	assert_int_equal(truncate(temp.path, 1 << 20), 0);
	line = incise_infile_read(temp.path, &small, &size, &err);
	assert_int_equal(size, 1 << 20);
	free(line);
	assert_int_equal(truncate(temp.path, (1 << 20) + 1), 0);
	assert_error(incise_infile_read(temp.path, &small, &size, &err), EFBIG, &err,
		     "l.txt:", "1 MiB");
	/* A file that grows while it is read. */
	assert_int_equal(truncate(temp.path, 0), 0);
	file = incise_infile_open(temp.path, &small, &err);
	assert_non_null(file);
	assert_int_equal(truncate(temp.path, (off_t)1 << 40), 0);
	assert_error(incise_infile_line(file, &line, &err), EINVAL, &err,
		     "l.txt:1:", "NUL");
	incise_infile_close(file);
	temp_file_free(&temp);
}

static void *write_late(void *path)
{
	/* open(2) returns once the reader is there. */
	FILE *out = fopen(path, "w");

	fputs("one\ntwo", out);
	fclose(out);
	return NULL;
}

TEST(test_pipes)
{
	struct temp_file temp = temp_file_new("pipe", "");
	const struct incise_infile_kind regular = {.name = "a note", .regular = true};
	struct incise_infile *file;
	pthread_t thread;
	char *line;

	unlink(temp.path);
	assert_int_equal(mkfifo(temp.path, 0600), 0);
	assert_error(incise_infile_open(temp.path, &stream, &err), ENODATA, &err,
		     "/pipe:");
	assert_error(incise_infile_open(temp.path, &regular, &err), EINVAL, &err,
		     "/pipe:");
	assert_int_equal(pthread_create(&thread, NULL, write_late, temp.path), 0);
	/* A busy machine may start the thread after the second of patience. */
	do
		file = incise_infile_open(temp.path, &stream, &err);
	while (!file && errno == ENODATA);
	assert_non_null(file);
	assert_int_equal(incise_infile_line(file, &line, &err), 1);
	assert_string_equal(line, "one");
	assert_int_equal(incise_infile_line(file, &line, &err), 1);
	assert_string_equal(line, "two");
	assert_int_equal(incise_infile_line(file, &line, &err), 0);
	incise_infile_close(file);
	pthread_join(thread, NULL);
	temp_file_free(&temp);
}

TEST(test_devices_are_refused)
{
	static const char *const devices[] = {"/dev/zero", "/dev/urandom", "/dev/full",
					      "/dev/null", "/dev/tty"};
	size_t size;

	for (size_t i = 0; i < sizeof(devices) / sizeof(*devices); i++) {
		assert_error(incise_infile_read(devices[i], &small, &size, &err), EINVAL,
			     &err, devices[i]);
	}
}

TEST(test_decimals)
{
	static const struct {
		const char *text;
		double value;
		int taken;
	} cases[] = {
		{"0x10", 0, 0}, {"-0X1p3", 0, 0}, {" +0x1", 0, 0},
		{"0", 0, 1},	{"010", 10, 3},	  {"-1.5e3 ", -1500, 6},
		{" 7", 7, 2},	{"x", 0, 0},	  {"0.5x", 0.5, 3},
		{"", 0, 0},
	};
	char *end;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_true(incise_decimal(cases[i].text, &end) == cases[i].value);
		assert_ptr_equal(end, cases[i].text + cases[i].taken);
	}
	assert_true(isinf(incise_decimal("-inf", &end)));
}
