// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/base/conf.c: what strict reading takes, and what it says of what it refuses. */
#include "../unit.h"
#include "../../../lib/base/conf.h"
#include "../message.h"
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

TEST(refused_with_file_line_and_cause)
{
	static const struct {
		const char *text, *says[2]; /* the place and key, and the value */
	} row[] = {
		{"sim = {\n seed = 101;\n};", {":2: sim.seed:", "101"}},
		{"sim = {\n\n seed = -0.5;\n};", {":3: sim.seed:", "-0.5"}},
		{"sim = { seed = 1e999; };", {":1: sim.seed:", "inf"}},
		{"sim = { seed = \"1\"; };", {":1: sim.seed:", "\"1\""}},
		{"sim = { seed = true; };", {":1: sim.seed:", "true"}},
		{"sim = { seed = [1, 2]; };", {":1: sim.seed:", "2 values"}},
		{"sim = { name = 3; };", {":1: sim.name:", "3"}},
		{"sim = { name = {}; };", {":1: sim.name:", "a group"}},
		{"sim = {\n sead = 1; };", {":2: sim.sead:"}},
		{"sim = {\n reach_cm = 1; };", {":2: sim.reach_cm:"}},
		{"sim = { raech_mm = 1; };", {":1: sim.raech_mm:"}},
		{"sim = { span = 1; };", {":1: sim.span:"}},
		{"sim = { reach = 1; };", {":1: sim.reach:"}},
		{"sim = { on = 1; };", {":1: sim.on:", "1"}},
		{"sim = {\n times = 2.5; };", {":2: sim.times:", "2.5"}},
		{"sim = { times = 65; };", {":1: sim.times:", "65"}},
		{"sim = { times = \"2\"; };", {":1: sim.times:", "\"2\""}},
		{"\nsim = { on = true; };", {":2: sim.reach_mm"}},
		{"sin = 1;", {":1: sin:"}},
		{"sim = {\n seed 1; };", {":2: syntax error:"}},
		{"sim = {};\nsim = {};", {":2: duplicate setting"}},
		{"surface = 1;", {":1: surface:", "1"}},
		{"surface = { point_mm = [1, 2]; };",
		 {":1: surface.point_mm:", "2 values"}},
		{"surface = { point_mm = [1e7, 0.0, 0.0]; };",
		 {":1: surface.point_mm:", "3 values"}},
		{"surface = {\n normal = [0, 0, 0]; };",
		 {":2: surface.normal:", "3 values"}},
		{"surface = { up = [0, 0, 1]; };", {":1: surface.up:"}},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("a.conf", row[i].text);
		struct content content = {.normal = {0, 0, 1}};
		config_t config;

		assert_error(read_content(file.path, &config, &content, &err), EINVAL,
			     &err, file.path, row[i].says[0], row[i].says[1]);
		temp_file_free(&file);
	}
}

TEST(a_refused_value_leaves_what_was_there)
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

TEST(taken)
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

TEST(absent_keys_change_nothing)
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

TEST(unreadable_files_are_named)
{
	config_t config;

	assert_error(incise_conf_read(&config, "/nowhere/a.conf", &err), ENOENT, &err,
		     "/nowhere/a.conf:");
	assert_error(incise_conf_read(&config, "/", &err), EISDIR, &err, "/:");
	/* As a disk that fails: nothing is at address 0. */
	assert_error(incise_conf_read(&config, "/proc/self/mem", &err), EIO, &err,
		     "/proc/self/mem:");
}
