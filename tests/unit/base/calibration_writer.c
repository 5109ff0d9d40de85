// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/base/calibration_writer.c: the text of a file, to the letter; numbers are the
 * shortest that read back the same, and only what is in force by a calibration has its origin.
 * That all of it is read back is tested in calibration_history.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/base/calibration_file.h"

static void say_present(struct calibration_file *file, const char *name)
{
	for (int i = 0; i < CALIBRATION_KEYS; i++)
		file->present[i] |= !strcmp(incise_calibration_keys[i].name, name);
}

static char *written(const struct calibration_file *file, const char *notes)
{
	char *text;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	incise_calibration_file_write(file, notes, out);
	assert_int_equal(fclose(out), 0);
	return text;
}

static void what_is_empty_is_said(void **state)
{
	struct calibration_file file = {0};
	char *text;

	incise_calibration_nominal(&file.in_force);
	text = written(&file, "# by hand\n");
	assert_string_equal(
		text,
		"## Calibration of a haptic cutting rig, kept by 'incise calibrate'; "
		"see calibration.conf(5).\n"
		"# by hand\n"
		"\n## In force; what is absent is nominal.\n"
		"\n## Each calibration, oldest first; u is a standard uncertainty (k = "
		"1).\n"
		"history = (\n);\n");
	free(text);
}

static void text_is_as_documented(void **state)
{
	struct incise_calibration_record records[] = {
		{
			.kind = "force",
			.date = "2026-11-21T14:48:16Z",
			.device = "a \"b\" \\",
			.raw = "pairs.csv",
			.raw_crc = 0xbeef,
			.n = 2,
			.values = {{"force_mV_N", "mV/N", 1240, 1238.25, 1.25},
				   {"force_zero_mV", "mV", NAN, 176, 0.5}},
			.covariance = {1.5625, -0.1, 0.25},
			.n_covariance = 3,
			.low = 0,
			.high = 4.03,
			.range_unit = "N",
			.pass = true,
		},
		{
			.kind = "tip",
			.date = "2026-11-22T00:00:00Z",
			.n = 1,
			.values = {{"tip_x_mm", "mm", 0, 9, 0.1}},
			.low = NAN,
			.high = NAN,
			.verdict = "no",
		},
	};
	struct calibration_file file = {.records = records, .n = 2};
	char *text;

	incise_calibration_nominal(&file.in_force);
	file.in_force.force_mV_N = 1238.25;
	file.in_force.force_zero_mV = 170; /* changed by hand since */
	file.in_force.tip_mm[1] = 1.0 / 3;
	say_present(&file, "force_mV_N");
	say_present(&file, "force_zero_mV");
	for (int i = 0; i < 3; i++)
		say_present(&file,
			    (const char *[]){"tip_x_mm", "tip_y_mm", "tip_z_mm"}[i]);
	/* a decimal comma, where the system has such a locale, must not come into the file */
	setlocale(LC_ALL, "de_DE.UTF-8");
	text = written(&file, "");
	setlocale(LC_ALL, "C");
	assert_non_null(strstr(
		text,
		"## In force; what is absent is nominal.\n"
		"force_mV_N = 1238.25; ## mV/N, U = 2.5 (k = 2), force, 2026-11-21\n"
		"force_zero_mV = 170.0; ## mV\n"
		"tip_mm = [0.0, 0.3333333333333333, 0.0]; ## mm\n"));
	assert_non_null(strstr(text, "history = (\n{\n  kind = \"force\";\n"));
	assert_non_null(strstr(text, "  device = \"a \\\"b\\\" \\\\\";\n"));
	assert_non_null(strstr(text,
			       "  raw = \"pairs.csv\";\n"
			       "  raw_crc32c = \"0000beef\";\n"
			       "  values = (\n"
			       "    { key = \"force_mV_N\"; unit = \"mV/N\"; found = "
			       "1240.0; left = 1238.25; u = 1.25; },\n"
			       "    { key = \"force_zero_mV\"; unit = \"mV\"; left = "
			       "176.0; u = 0.5; } );\n"
			       "  covariance = [1.5625, -0.1, 0.25];\n"
			       "  low = 0.0;\n  high = 4.03;\n"
			       "  range_unit = \"N\";\n  pass = true;\n}, {\n"));
	assert_non_null(strstr(text, "  pass = false;\n  verdict = \"no\";\n}\n);\n"));
	free(text);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_is_empty_is_said),
		cmocka_unit_test(text_is_as_documented),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
