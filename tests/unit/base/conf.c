// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/conf.c: what strict reading takes, and what it says of what it refuses.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <string.h>
#include "../../../lib/base/conf.h"
#include "temp_file.h"

/* Everything a file may hold here: a group `sim` with `seed`, `name`, and a surface. */
struct content {
	double seed;
	const char *name;
	double point[3], normal[3];
	bool on;
	int times;
};

static int read_content(const char *path, config_t *config, struct content *content,
			struct incise_error *err)
{
	static const char *const root_keys[] = {"sim", "surface", NULL};
	static const char *const sim_keys[] = {"seed",	"name",	    "on",
					       "times", "reach_mm", NULL};
	const config_setting_t *root, *sim;
	int rc = incise_conf_read(config, path, err);

	if (rc)
		return rc;
	root = config_root_setting(config);
	rc = incise_conf_known(root, path, root_keys, err);
	sim = config_setting_get_member(root, "sim");
	if (!rc && sim)
		rc = incise_conf_known(sim, path, sim_keys, err);
	if (!rc && sim)
		rc = incise_conf_number(sim, path, "seed", 0, 100, &content->seed, err);
	if (!rc && sim)
		rc = incise_conf_string(sim, path, "name", &content->name, err);
	if (!rc && sim)
		rc = incise_conf_bool(sim, path, "on", &content->on, err);
	if (!rc && sim)
		rc = incise_conf_integer(sim, path, "times", 1, 64, &content->times, err);
	if (!rc && sim && content->on)
		rc = incise_conf_need(sim, path, "reach_mm", err);
	if (!rc)
		rc = incise_conf_surface(root, path, content->point, content->normal,
					 err);
	if (rc)
		config_destroy(config);
	return rc;
}

static void refused_with_file_line_and_cause(void **state)
{
	static const struct {
		const char *text;
		int rc;
		const char *tail; /* of the message, after the path */
	} row[] = {
		{"sim = {\n seed = 101;\n};", -EINVAL,
		 ":2: sim.seed: expected a number from 0 to 100, found 101; correct it"},
		{"sim = {\n\n seed = -0.5;\n};", -EINVAL,
		 ":3: sim.seed: expected a number from 0 to 100, found -0.5; correct it"},
		{"sim = { seed = 1e999; };", -EINVAL,
		 ":1: sim.seed: expected a number from 0 to 100, found inf; correct it"},
		{"sim = { seed = \"1\"; };", -EINVAL,
		 ":1: sim.seed: expected a number from 0 to 100, found \"1\"; correct it"},
		{"sim = { seed = true; };", -EINVAL,
		 ":1: sim.seed: expected a number from 0 to 100, found true; correct it"},
		{"sim = { seed = [1, 2]; };", -EINVAL,
		 ":1: sim.seed: expected a number from 0 to 100, found 2 values; correct it"},
		{"sim = { name = 3; };", -EINVAL,
		 ":1: sim.name: expected text in quotes, found 3; correct it"},
		{"sim = { name = {}; };", -EINVAL,
		 ":1: sim.name: expected text in quotes, found a group; correct it"},
		{"sim = {\n sead = 1; };", -EINVAL,
		 ":2: sim.sead: unknown key; did you mean seed?"},
		{"sim = {\n reach_cm = 1; };", -EINVAL,
		 ":2: sim.reach_cm: unknown key; expected reach_mm, in the unit of its name"},
		{"sim = { raech_mm = 1; };", -EINVAL,
		 ":1: sim.raech_mm: unknown key; did you mean reach_mm?"},
		{"sim = { span = 1; };", -EINVAL,
		 ":1: sim.span: unknown key; expected one of seed, name, on, times, reach_mm"},
		{"sim = { reach = 1; };", -EINVAL,
		 ":1: sim.reach: unknown key; expected reach_mm, in the unit of its name"},
		{"sim = { on = 1; };", -EINVAL,
		 ":1: sim.on: expected true or false, found 1; correct it"},
		{"sim = {\n times = 2.5; };", -EINVAL,
		 ":2: sim.times: expected a whole number from 1 to 64, found 2.5; correct it"},
		{"sim = { times = 65; };", -EINVAL,
		 ":1: sim.times: expected a whole number from 1 to 64, found 65; correct it"},
		{"sim = { times = \"2\"; };", -EINVAL,
		 ":1: sim.times: expected a whole number from 1 to 64, found \"2\"; correct it"},
		{"\nsim = { on = true; };", -EINVAL,
		 ":2: sim.reach_mm is missing; add it"},
		{"sin = 1;", -EINVAL, ":1: sin: unknown key; did you mean sim?"},
		{"sim = {\n seed 1; };", -EINVAL,
		 ":2: syntax error: expected `key = value;`; correct it"},
		{"sim = {};\nsim = {};", -EINVAL,
		 ":2: duplicate setting name; correct it"},
		{"surface = 1;", -EINVAL,
		 ":1: surface: expected a group { point_mm = [x, y, z]; normal = [x, y, z]; }, "
		 "found 1; correct it"},
		{"surface = { point_mm = [1, 2]; };", -EINVAL,
		 ":1: surface.point_mm: expected three numbers [x, y, z], found 2 values; "
		 "correct it"},
		{"surface = { point_mm = [1e7, 0.0, 0.0]; };", -EINVAL,
		 ":1: surface.point_mm: expected three numbers [x, y, z] of at most 1e6, "
		 "found 3 values; correct it"},
		{"surface = {\n normal = [0, 0, 0]; };", -EINVAL,
		 ":2: surface.normal: expected a direction [x, y, z] that is not 0, found 3 "
		 "values; correct it"},
		{"surface = { up = [0, 0, 1]; };", -EINVAL,
		 ":1: surface.up: unknown key; expected one of point_mm, normal"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("a.conf", row[i].text);
		struct content content = {.normal = {0, 0, 1}};
		struct incise_error err = {0};
		char expected[600];
		config_t config;

		assert_int_equal(read_content(file.path, &config, &content, &err),
				 row[i].rc);
		snprintf(expected, sizeof(expected), "%s%s", file.path, row[i].tail);
		assert_string_equal(err.text, expected);
		assert_int_equal(err.code, -row[i].rc);
		temp_file_free(&file);
	}
}

static void a_refused_value_leaves_what_was_there(void **state)
{
	struct temp_file file =
		temp_file_new("a.conf",
			      "sim = { seed = 101; };\n"
			      "surface = { normal = [0, 3, 4]; point_mm = [1]; };");
	struct content content = {.seed = 7, .normal = {0, 0, 1}};
	config_t config;

	assert_int_equal(read_content(file.path, &config, &content, NULL), -EINVAL);
	assert_true(content.seed == 7);
	assert_int_equal(incise_conf_read(&config, file.path, NULL), 0);
	assert_int_equal(incise_conf_surface(config_root_setting(&config), file.path,
					     content.point, content.normal, NULL),
			 -EINVAL);
	assert_true(content.normal[1] == 0 && content.normal[2] == 1);
	config_destroy(&config);
	temp_file_free(&file);
}

static void taken(void **state)
{
	struct temp_file file =
		temp_file_new("a.conf",
			      "# a comment\n"
			      "sim = { seed = 42; name = \"one\"; on = true; times = 3;\n"
			      "        reach_mm = 1; };\n"
			      "surface = { point_mm = [1, 2, 3];\n"
			      "            normal = (0, -3.0, 4); };\n");
	struct content content = {.normal = {0, 0, 1}};
	config_t config;

	assert_int_equal(read_content(file.path, &config, &content, NULL), 0);
	assert_true(content.seed == 42); /* an integer where a number is wanted */
	assert_string_equal(content.name, "one");
	assert_true(content.on);
	assert_int_equal(content.times, 3);
	assert_true(content.point[0] == 1 && content.point[1] == 2 &&
		    content.point[2] == 3);
	/* 3-4-5: exact up to one rounding of the division. */
	assert_true(content.normal[0] == 0);
	assert_true(fabs(content.normal[1] + 0.6) < 1e-15);
	assert_true(fabs(content.normal[2] - 0.8) < 1e-15);
	config_destroy(&config);
	temp_file_free(&file);
}

static void absent_keys_change_nothing(void **state)
{
	struct temp_file file = temp_file_new("a.conf", "sim = {};");
	struct content content = {.seed = 7, .name = "kept", .normal = {0, 0, 1}};
	config_t config;

	assert_int_equal(read_content(file.path, &config, &content, NULL), 0);
	assert_true(content.seed == 7);
	assert_string_equal(content.name, "kept");
	assert_true(content.normal[2] == 1);
	config_destroy(&config);
	temp_file_free(&file);
}

static void unreadable_files_are_named(void **state)
{
	struct incise_error err = {0};
	config_t config;

	assert_int_equal(incise_conf_read(&config, "/nowhere/a.conf", &err), -ENOENT);
	assert_string_equal(err.text, "/nowhere/a.conf: No such file or "
				      "directory; give the path of a configuration file");
	assert_int_equal(incise_conf_read(&config, "/", &err), -EISDIR);
	assert_string_equal(err.text, "/: Is a directory; give the path of a "
				      "configuration file");
	/* As a disk that fails: nothing is at address 0. */
	assert_int_equal(incise_conf_read(&config, "/proc/self/mem", &err), -EIO);
	assert_non_null(strstr(err.text, "/proc/self/mem: Input/output error; "));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(refused_with_file_line_and_cause),
		cmocka_unit_test(a_refused_value_leaves_what_was_there),
		cmocka_unit_test(taken),
		cmocka_unit_test(absent_keys_change_nothing),
		cmocka_unit_test(unreadable_files_are_named),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
