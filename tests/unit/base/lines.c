// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/base/lines.h: lines without their ends, a NUL byte, errors of file and line. */
#include "../unit.h"
#include "../../../lib/base/lines.h"
#include "temp_file.h"

static const struct incise_infile_kind text = {.name = "a text", .advice = "give one"};

TEST(test_lines)
{
	struct temp_file file = temp_file_new("l.txt", " one \r\n\ntwo");
	struct incise_lines in;

	assert_int_equal(incise_lines_open(&in, file.path, &text, NULL), 0);
	assert_int_equal(incise_lines_next(&in, " \r\n"), 1);
	assert_string_equal(in.text, " one");
	assert_int_equal(incise_lines_next(&in, "\n"), 1);
	assert_string_equal(in.text, "");
	assert_int_equal(incise_lines_next(&in, "\n"), 1);
	assert_string_equal(in.text, "two");
	assert_int_equal(in.line, 3);
	assert_int_equal(incise_lines_next(&in, "\n"), 0);
	incise_lines_close(&in);
	temp_file_free(&file);
}

TEST(test_errors)
{
	struct temp_file file = temp_file_new("l.txt", "one\n");
	struct incise_lines in;
	FILE *out = fopen(file.path, "w");

	assert_int_equal(fwrite("a\nb\0c\n", 1, 6, out), 6);
	fclose(out);
	assert_int_equal(incise_lines_open(&in, file.path, &text, &err), 0);
	assert_int_equal(incise_lines_next(&in, "\n"), 1);
	assert_int_equal(incise_lines_next(&in, "\n"), -EINVAL);
	assert_says(err.text, "l.txt:2:");
	incise_lines_close(&in);
	assert_error(incise_lines_open(&in, file.dir, &text, &err), EISDIR, &err,
		     file.dir);
	temp_file_free(&file);
	assert_error(incise_lines_open(&in, file.path, &text, &err), ENOENT, &err,
		     file.path);
}
