// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/loop/proc_file.c: any file becomes a string, a number or a list, or is rejected. */
#include "../unit.h"
#include <limits.h>
#include "../../../lib/loop/proc_file.h"
#include "root_folder.h"

TEST(test_reads)
{
	static const struct {
		const char *data;
		size_t n;
		const char *text;
	} rows[] = {
		{"", 0, ""},
		{"1\n", 2, "1"},
		{"a\tb \n\n", 6, "a\tb"},
		{"two\nlines\n", 10, "two\nlines"},
		{"\x1b[2J\xff", 5, "?[2J?"},
		{"a\0b", 3, "a?b"},
		{" \n\t", 3, ""},
		/* the buffer has 15 bytes */
		{"0123456789abcdefghij", 20, "0123456789abcde"},
	};
	struct root_folder root;
	char text[16], path[PATH_MAX + 10];

	root_folder_make(&root);
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		root_folder_put(&root, "/sys/x", rows[i].data, rows[i].n);
		assert_int_equal(proc_file_read(root.path, "/sys/x", text, sizeof(text)),
				 strlen(rows[i].text));
		assert_string_equal(text, rows[i].text);
	}
	assert_int_equal(proc_file_read(root.path, "/sys/y", text, sizeof(text)),
			 -ENOENT);
	assert_string_equal(text, "");
	strcpy(text, "before");
	assert_int_equal(proc_file_read(root.path, "/sys", text, sizeof(text)), -EISDIR);
	assert_string_equal(text, "");
	/* A pipe without a writer does not block. */
	snprintf(path, sizeof(path), "%s/pipe", root.path);
	assert_int_equal(mkfifo(path, 0600), 0);
	assert_int_equal(proc_file_read(root.path, "/pipe", text, sizeof(text)), 0);
	memset(path, '/', sizeof(path));
	path[sizeof(path) - 1] = 0;
	assert_int_equal(proc_file_read(root.path, path, text, sizeof(text)),
			 -ENAMETOOLONG);
	root_folder_remove(&root);
}

TEST(test_integers)
{
	static const struct {
		const char *text;
		bool is;
		long long value;
	} rows[] = {
		{"0", true, 0},
		{"950000", true, 950000},
		{"-1", true, -1},
		{"9223372036854775807", true, LLONG_MAX},
		{"9223372036854775808", false, 0},
		{"-9223372036854775809", false, 0},
		{"", false, 0},
		{"-", false, 0},
		{"+1", false, 0},
		{" 1", false, 0},
		{"1 ", false, 0},
		{"0x10", false, 0},
		{"1e3", false, 0},
		{"--1", false, 0},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		long long value = 77;

		assert_int_equal(proc_file_integer(rows[i].text, &value), rows[i].is);
		if (rows[i].is)
			assert_true(value == rows[i].value);
	}
}

TEST(test_lists)
{
	static const struct {
		const char *list;
		int cpu;
		bool has;
	} rows[] = {
		{"0", 0, true},
		{"0", 1, false},
		{"0-3", 3, true},
		{"0-3", 4, false},
		{"0-1,4,6-7", 4, true},
		{"0-1,4,6-7", 5, false},
		{"0-1,4,6-7", 7, true},
		{"", 0, false},
		{"3-1", 2, false},
		{"0-", 0, false},
		{"-1", 1, false},
		{"0,,1", 1, false},
		{"a", 0, false},
		{"0;1", 0, false},
		{"0-999999999", 12, true},
		{"0-9999999999999", 12, false},
		{"0-3\n", 2, false},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++)
		if (proc_file_lists(rows[i].list, rows[i].cpu) != rows[i].has)
			fail_msg("\"%s\" and %d", rows[i].list, rows[i].cpu);
}
