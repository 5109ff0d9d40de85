// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Surfaces that a scene names: each kind with what it needs and may have, files beside the
 * scene, and errors that name file and line.
 */
#include "../unit.h"
#include <sys/stat.h>
#include "../../../lib/scene/scene.h"
#include "../message.h"
#include "fed.h"

static struct incise_scene *load(const char *surface, struct incise_error *err)
{
	char text[700];

	snprintf(text, sizeof(text), "model = \"m.fis\";\n%s\n", surface);
	return fed_scene(&folder, text, err);
}

/* Each kind, and a point that is 1 mm deep in it just where it was put. */
TEST(test_kinds)
{
	static const struct {
		const char *text;
		enum incise_surface_kind kind;
		double point[3], normal[3];
	} cases[] = {
		{"surface = { };", INCISE_SURFACE_PLANE, {5, 6, -1}, {0, 0, 1}},
		{"surface = { kind = \"plane\"; };",
		 INCISE_SURFACE_PLANE,
		 {5, 6, -1},
		 {0, 0, 1}},
		{"surface = { point_mm = [1, 2, 3]; };",
		 INCISE_SURFACE_PLANE,
		 {5, 6, 2},
		 {0, 0, 1}},
		{"surface = { normal = [0.0, 3.0, 4.0]; };",
		 INCISE_SURFACE_PLANE,
		 {0, -0.6, -0.8},
		 {0, 0.6, 0.8}},
		{"surface = { kind = \"sphere\"; centre_mm = [1, 2, 3]; radius_mm = 10; };",
		 INCISE_SURFACE_SPHERE,
		 {1, 11, 3},
		 {0, 1, 0}},
		{"surface = { kind = \"capsule\"; from_mm = [0, 0, -10];"
		 " to_mm = [50, 0, -10]; radius_mm = 10.0; };",
		 INCISE_SURFACE_CAPSULE,
		 {25, 9, -10},
		 {0, 1, 0}},
		{"surface = { kind = \"capsule\"; from_mm = [0, 0, -10];"
		 " to_mm = [50, 0, -10]; radius_mm = 10.0; };",
		 INCISE_SURFACE_CAPSULE,
		 {59, 0, -10},
		 {1, 0, 0}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_scene *scene = load(cases[i].text, &err);
		struct incise_touch touch;

		if (!scene)
			fail_msg("case %zu: %s", i, err.text);
		assert_int_equal(incise_surface_kind(scene->surface), cases[i].kind);
		incise_surface_nearest(scene->surface, cases[i].point, &touch);
		/* Some roundings of numbers up to 60. */
		assert_true(fabs(touch.depth_mm - 1) < 1e-13);
		for (int k = 0; k < 3; k++)
			assert_true(fabs(touch.normal[k] - cases[i].normal[k]) < 1e-13);
		incise_scene_free(scene);
	}
}

/* A hill of 16 by 16 squares, its top at 0 0 0 in the file. */
TEST(test_files)
{
	char absolute[200];
	const struct {
		const char *text;
		enum incise_surface_kind kind;
		double top[3];
	} cases[] = {
		{"surface = { kind = \"mesh\"; file = \"hill.obj\"; };",
		 INCISE_SURFACE_MESH,
		 {0, 0, 0}},
		{"surface = { kind = \"mesh\"; file = \"./hill.obj\"; at_mm = [10, 20, 30]; };",
		 INCISE_SURFACE_MESH,
		 {10, 20, 30}},
		{"surface = { kind = \"heights\"; file = \"hill.asc\"; };",
		 INCISE_SURFACE_HEIGHTS,
		 {0, 0, 0}},
		{"surface = { kind = \"heights\"; file = \"hill.asc\";"
		 " at_mm = [-1.5, 0.0, 2.5]; };",
		 INCISE_SURFACE_HEIGHTS,
		 {-1.5, 0, 2.5}},
		{absolute, INCISE_SURFACE_MESH, {0, 0, 0}},
	};

	snprintf(absolute, sizeof(absolute),
		 "surface = { kind = \"mesh\"; file = \"%s\"; };", folder.mesh);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_scene *scene = load(cases[i].text, &err);
		struct incise_touch top;

		if (!scene)
			fail_msg("case %zu: %s", i, err.text);
		assert_int_equal(incise_surface_kind(scene->surface), cases[i].kind);
		assert_int_equal(incise_surface_triangles(scene->surface), 512);
		incise_surface_top(scene->surface, &top);
		/* The files have 9 digits after the point. */
		for (int k = 0; k < 3; k++)
			assert_true(fabs(top.point_mm[k] - cases[i].top[k]) < 1e-8);
		incise_scene_free(scene);
	}
}

/* A file is looked for beside the scene, not where the program was started. */
TEST(test_from_within_the_folder)
{
	char before[512];
	struct incise_scene *scene;

	assert_non_null(getcwd(before, sizeof(before)));
	incise_scene_free(
		load("surface = { kind = \"mesh\"; file = \"hill.obj\"; };", NULL));
	assert_int_equal(chdir(folder.dir), 0);
	/* A scene named without a folder: its files lie here. */
	scene = incise_scene_load("a.scene", NULL, NULL);
	assert_int_equal(chdir(before), 0);
	assert_non_null(scene);
	assert_int_equal(incise_surface_kind(scene->surface), INCISE_SURFACE_MESH);
	incise_scene_free(scene);
}

TEST(test_refusals)
{
	static const struct {
		const char *text;
		int code;
		const char *says[3];
	} cases[] = {
		{"surface = \"plane\";", EINVAL, {"a.scene:2", "group"}},
		{"surface = {\n kind = \"cube\"; };",
		 EINVAL,
		 {"a.scene:3", "\"capsule\"", "found \"cube\""}},
		/* Missing. */
		{"surface = { kind = \"sphere\"; radius_mm = 5; };",
		 EINVAL,
		 {"a.scene:2", "surface.centre_mm"}},
		{"surface = { kind = \"sphere\"; centre_mm = [0, 0, 0]; };",
		 EINVAL,
		 {"a.scene:2", "surface.radius_mm"}},
		{"surface = { kind = \"capsule\"; to_mm = [0, 0, 0]; radius_mm = 5; };",
		 EINVAL,
		 {"a.scene:2", "surface.from_mm"}},
		{"surface = { kind = \"capsule\"; from_mm = [0, 0, 0]; radius_mm = 5; };",
		 EINVAL,
		 {"a.scene:2", "surface.to_mm"}},
		{"surface = { kind = \"capsule\"; from_mm = [0, 0, 0]; to_mm = [0, 0, 1]; };",
		 EINVAL,
		 {"a.scene:2", "surface.radius_mm"}},
		{"surface = { kind = \"mesh\"; };",
		 EINVAL,
		 {"a.scene:2", "surface.file"}},
		{"surface = { kind = \"heights\"; at_mm = [0, 0, 0]; };",
		 EINVAL,
		 {"a.scene:2", "surface.file"}},
		/* Another kind's, or none's. */
		{"surface = {\n radius_mm = 5; };",
		 EINVAL,
		 {"a.scene:3", "surface.radius_mm", "kind"}},
		{"surface = { kind = \"sphere\";\n centre_mm = [0, 0, 0]; radius_mm = 5;\n"
		 " to_mm = [1, 0, 0]; };",
		 EINVAL,
		 {"a.scene:4", "surface.to_mm"}},
		{"surface = { kind = \"capsule\";\n point_mm = [0, 0, 0]; };",
		 EINVAL,
		 {"a.scene:3", "surface.point_mm"}},
		{"surface = { kind = \"mesh\"; file = \"hill.obj\";\n normal = [0, 0, 1]; };",
		 EINVAL,
		 {"a.scene:3", "surface.normal"}},
		/* Beyond what a surface can be: of the group, the whole. */
		{"surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, 2e5]; radius_mm = 5; };",
		 EINVAL,
		 {"a.scene:2", "sphere", "1e5"}},
		{"surface = { kind = \"capsule\"; from_mm = [0, 0, 0]; to_mm = [2e5, 0.0, 0.0];"
		 " radius_mm = 5; };",
		 EINVAL,
		 {"a.scene:2", "capsule", "1e5"}},
		/* Files: their own names and lines too. */
		{"surface = { kind = \"mesh\"; file = \"absent.obj\"; };",
		 ENOENT,
		 {"a.scene:2", "/absent.obj"}},
		{"surface = { kind = \"heights\"; file = \"absent.asc\"; };",
		 ENOENT,
		 {"a.scene:2", "/absent.asc"}},
		{"surface = { kind = \"mesh\"; file = \"m.fis\"; };",
		 EINVAL,
		 {"a.scene:2", "/m.fis"}},
		{"surface = { kind = \"heights\"; file = \"hill.obj\"; };",
		 EINVAL,
		 {"a.scene:2", "/hill.obj:1"}},
		{"surface = { kind = \"mesh\"; file = \"hill.obj\"; at_mm = [0.0, 0.0, 2e5]; };",
		 EINVAL,
		 {"a.scene:2", "/hill.obj", "1e5"}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_error(load(cases[i].text, &err), cases[i].code, &err,
			     cases[i].says[0], cases[i].says[1], cases[i].says[2]);
	}
}

/* A folder, or none: refused, and nothing waits or ends. */
TEST(test_a_folder_is_no_file)
{
	static const char *const names[] = {".", "", "..", "/"};

	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++) {
		for (int mesh = 0; mesh < 2; mesh++) {
			struct incise_error err = {0};
			char text[100];

			snprintf(text, sizeof(text),
				 "surface = { kind = \"%s\"; file = \"%s\"; };",
				 mesh ? "mesh" : "heights", names[i]);
			assert_null(load(text, &err));
			assert_says(err.text, "a.scene:2");
		}
	}
}

GROUP(fed_set_up, fed_tear_down);
