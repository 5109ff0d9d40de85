// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Scene files: defaults, paths, and errors that name file, line and range.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include "../../../lib/scene/scene.h"
#include "felt.h"

static char dir[] = "/tmp/incise-scene-XXXXXX";
static char path[64], model_path[64];

static int set_up(void **state)
{
	if (!mkdtemp(dir))
		return -1;
	snprintf(path, sizeof(path), "%s/a.scene", dir);
	snprintf(model_path, sizeof(model_path), "%s/m.fis", dir);
	felt_write_model(model_path);
	return 0;
}

static int tear_down(void **state)
{
	unlink(path);
	unlink(model_path);
	return rmdir(dir);
}

static struct incise_scene *load(const char *text, const char *model,
				 struct incise_error *err)
{
	FILE *out = fopen(path, "w");

	fputs(text, out);
	fclose(out);
	return incise_scene_load(path, model, err);
}

static void test_defaults(void **state)
{
	struct incise_scene *scene = load("model = \"m.fis\";\n", NULL, NULL);

	assert_non_null(scene);
	assert_true(incise_scene_rate_hz(scene) == 1000);
	assert_true(scene->fixed);
	assert_null(scene->surface);
	assert_true(scene->limits.force_N == 4);
	incise_scene_free(scene);
}

static void test_everything_set(void **state)
{
	struct incise_touch top;
	struct incise_scene *scene = load(
		"rate_hz = 2000; model = \"m.fis\"; arithmetic = \"double\";\n"
		"surface = { kind = \"plane\"; point_mm = [1, 2, 3]; normal = [0.0, 3.0, 4.0]; };\n"
		"limits = { force_N = 2.5; slew_N_s = 100; pose_age_ms = 20.0; };\n",
		NULL, NULL);

	assert_non_null(scene);
	assert_true(scene->rate_hz == 2000 && !scene->fixed);
	incise_surface_top(scene->surface, &top);
	assert_true(top.point_mm[2] == 3);
	/* The normal is made unit; 3-4-5, one rounding. */
	assert_true(fabs(top.normal[1] - 0.6) < 1e-15 &&
		    fabs(top.normal[2] - 0.8) < 1e-15);
	assert_true(scene->limits.force_N == 2.5 && scene->limits.slew_N_s == 100 &&
		    scene->limits.pose_age_ms == 20);
	incise_scene_free(scene);
}

static void test_other_model(void **state)
{
	struct incise_scene *scene = load("model = \"absent.fis\";\n", model_path, NULL);

	assert_non_null(scene);
	incise_scene_free(scene);
	scene = load("# nothing\n", model_path, NULL);
	assert_non_null(scene);
	incise_scene_free(scene);
}

static void test_refusals(void **state)
{
	static const struct {
		const char *text;
		int code;
		const char *says[3];
	} cases[] = {
		{"model = \"absent.fis\";", ENOENT, {"absent.fis", "", ""}},
		{"\n", EINVAL, {"no model", "--model", ""}},
		{"model = \"m.fis\";\nrate = 5;", EINVAL, {"a.scene:2", "rate", ""}},
		{"model = \"m.fis\";\nrate_hz = 5;",
		 EINVAL,
		 {"a.scene:2", "100", "20000"}},
		{"model = \"m.fis\"; rate_hz = \"fast\";",
		 EINVAL,
		 {"a.scene:1", "rate_hz", ""}},
		{"model = \"m.fis\";\n\narithmetic = \"float\";",
		 EINVAL,
		 {"a.scene", "fixed", "double"}},
		{"model = \"m.fis\";\nlimits = { force_N = 1000.0; };",
		 EINVAL,
		 {"a.scene:2", "force_N", "100"}},
		{"model = \"m.fis\";\nlimits = { force = 1.0; };",
		 EINVAL,
		 {"a.scene:2", "force", ""}},
		{"model = \"m.fis\";\nsurface = { normal = [0.0, 0.0, 0.0]; };",
		 EINVAL,
		 {"a.scene:2", "normal", ""}},
		{"model = \"m.fis\"\nrate_hz = = 3;", EINVAL, {"a.scene:2", "", ""}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};

		assert_null(load(cases[i].text, NULL, &err));
		for (int k = 0; k < 3; k++)
			if (!strstr(err.text, cases[i].says[k]))
				fail_msg("case %zu gave %d '%s'", i, err.code, err.text);
		if (err.code != cases[i].code)
			fail_msg("case %zu gave %d '%s'", i, err.code, err.text);
	}
}

static void test_model_of_other_shape(void **state)
{
	static const struct incise_variable in = {"x", 0, 1}, out = {"y", 0, 1};
	static const int mfs[] = {2};
	struct incise_model *model =
		incise_model_new_grid(1, &in, mfs, INCISE_MF_GAUSS, &out, NULL);
	struct incise_error err = {0};

	assert_int_equal(incise_model_save(model, model_path, NULL), 0);
	incise_model_free(model);
	assert_null(load("model = \"m.fis\";", NULL, &err));
	assert_non_null(strstr(err.text, "1 inputs"));
	felt_write_model(model_path);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_defaults),
		cmocka_unit_test(test_everything_set),
		cmocka_unit_test(test_other_model),
		cmocka_unit_test(test_refusals),
		cmocka_unit_test(test_model_of_other_shape),
	};

	return cmocka_run_group_tests(tests, set_up, tear_down);
}
