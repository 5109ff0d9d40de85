// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Reading OBJ files: what is taken, what is refused and with which words, and that no
 * damage to a file does more than that.
 */
#include "../unit.h"
#include "../../../lib/surface/surface.h"
#include "../base/temp_file.h"
#include "../cases.h"
#include "solid.h"

static const double here[3];

static struct incise_surface *load(const char *text, const double at[3],
				   struct incise_error *err)
{
	struct temp_file file = temp_file_new("a.obj", text);
	struct incise_surface *surface;

	errno = 0;
	surface = incise_surface_load_mesh(file.path, at, false, err);
	if (!surface)
		assert_int_equal(errno, err->code);
	temp_file_free(&file);
	return surface;
}

#define TRIANGLE "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
#define SQUARE TRIANGLE "v 1 1 0\n"

TEST(test_good_files)
{
	static const struct {
		const char *text;
		size_t triangles;
	} cases[] = {
		{TRIANGLE "f 1 2 3\n", 1},
		{TRIANGLE "f 1 2 3", 1},
		{TRIANGLE "f -3 -2 -1\n", 1},
		{"# by hand\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n", 1},
		{"\n\n  v\t0 0   0 \nv +1.0e0 .0 0.\nv 0 1E0 0 # last\n f 1 2 3 # all\n",
		 1},
		{TRIANGLE "vt 0 0\nvn 0 0 1\nf 1/1 2/1 3/1\n", 1},
		{TRIANGLE "vt 0.5\nvn 0 0 1\nf 1//1 2//-1 3//1\n", 1},
		{TRIANGLE "vt 0 0 0\nvn 0 0 1\nf 1/1/1 2/-1/1 3/1/-1\n", 1},
		{SQUARE "f 1 2 4 3\n", 2},
		{SQUARE "f 1 2 4\nf 1 4 3\n", 2},
		/* a corner written twice is one */
		{SQUARE "v 0.0 0 -0\nv 1 1.0 0\nf 1 2 4\nf 5 6 3\n", 2},
		/* colours, groups, materials, lines, parameters */
		{"v 0 0 0 1 0 0\nv 1 0 0 1\nv 0 1 0\nvp 1\ng a\nusemtl b\nl 1 2\ns 1\nf 1 "
		 "2 3\n",
		 1},
		/* a mark of the encoding, indices left out, a line that goes on, colours of MRGB */
		{"\xef\xbb\xbf" TRIANGLE "f 1/ 2// 3//\n", 1},
		{TRIANGLE "f 1 2 \\\n3\n", 1},
		{TRIANGLE "f 1 \\\r\n \\\r\n2 3\r\n", 1},
		{TRIANGLE "g a \\\nb\nf 1 2 3\n#MRGB ffff\n", 1},
		{TRIANGLE "mtllib a b.mtl\no \xc3\xa4\nf 1 2 3", 1},
		/* two fans that share a point only */
		{TRIANGLE "v -1 0 0\nv 0 -1 0\nf 1 2 3\nf 1 4 5\n", 2},
		{"v 0 0 0\nv 1 0 0\nv 0.5 1e-6 0\nf 1 2 3\n", 1},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_surface *surface = load(cases[k].text, here, &err);

		if (!surface)
			fail_msg("case %zu: %s", k, err.text);
		assert_int_equal(incise_surface_triangles(surface), cases[k].triangles);
		assert_int_equal(incise_surface_kind(surface), INCISE_SURFACE_MESH);
		incise_surface_free(surface);
	}
}

TEST(test_bad_files)
{
	static const struct {
		const char *text;
		int line;
		const char *what;
	} cases[] = {
		{"", 0, "no triangle"},
		{TRIANGLE, 0, "no triangle"},
		{"v 0 0\n", 1, "with 2 numbers"},
		{"v 0 0 0 0 0 0 0 0\n", 1, "more than 7"},
		{"v 0 0 zero\n", 1, "'zero'"},
		{"v 0 0 0\nv 0 0 nan\n", 2, "'nan'"},
		{"v 0 0 inf\n", 1, "'inf'"},
		{"v 0 0 0x10\n", 1, "'0x10'"},
		{"v 0 0 1e999\n", 1, "'1e999'"},
		{"v 0 0 1,5\n", 1, "'1,5'"},
		{"v 0 0 1e\n", 1, "'1e'"},
		{"v 0 0 -\n", 1, "'-'"},
		{"v 0 0 1e6\n", 1, "1e+06"},
		{"vt\n", 1, "with 0 numbers"},
		{"vt 1e9\n", 1, "1e+09"},
		{"vn 0 0\n", 1, "with 2 numbers"},
		{TRIANGLE "f 1 2\n", 4, "with 2 corners"},
		{TRIANGLE "f\n", 4, "with 0 corners"},
		{TRIANGLE "f 1 2 4\n", 4, "no v 4"},
		{TRIANGLE "f 0 1 2\n", 4, "no v 0"},
		{TRIANGLE "f -4 1 2\n", 4, "no v -4"},
		{TRIANGLE "f 99999999999 1 2\n", 4, "99999999999"},
		{TRIANGLE "f 1 2 3/1\n", 4, "no vt 1"},
		{TRIANGLE "f 1 2 3//1\n", 4, "no vn 1"},
		{TRIANGLE "vt 0 0\nvn 0 0 1\nf 1/1/1/1 2 3\n", 6, "'1/1/1/1'"},
		{TRIANGLE "f 1 2 three\n", 4, "'three'"},
		{TRIANGLE "f 1 2 3.0\n", 4, "'3.0'"},
		{TRIANGLE "f 1 2 \\\n4\n", 5, "no v 4"},
		{TRIANGLE "f 1 2\\\n3\n", 4, "expected v, v/vt"},
		/* a statement that is not understood may hold a part of the surface */
		{TRIANGLE "f\xc2\xa0"
			  "1 2 3\n",
		 4,
		 "'f\xc2\xa0"
		 "1' is no"},
		{TRIANGLE "F 1 2 3\n", 4, "'F' is no"},
		{"V 0 0 0\n", 1, "'V' is no"},
		{TRIANGLE "f 1 2 3\nfo 1 2 3\n", 5, "'fo' is no"},
		{TRIANGLE "f 1 2 3\nsurf 0 1 0 1 1 2 3\n", 5, "'surf' is no"},
		{TRIANGLE "f 1 2 3\ncall b.obj\n", 5, "'call' is no"},
		{"ply\nformat ascii 1.0\n", 0, "a PLY file; convert it to STL or OBJ"},
		{"OFF\n3 1 0\n", 0, "an OFF file; convert"},
		{"solid a\n", 0, "no triangle"},
		{"solid a\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n", 4,
		 "within a facet"},
		{"solid a\n facet normal 0 0 1\n outer loop\n vertex 0 0 x\n", 4, "'x'"},
		{"solid a\n facet normal 0 0 1\n vertex 0 0 0\nendfacet\n", 4,
		 "after 1 corners"},
		{"solid a\nfacets\n", 2, "'facets' after 0"},
		{"solid a\n facet normal 0 0 1\n outer loop\n vertex 0 0 1e6\n vertex 0 0 0\n vertex 1 "
		 "0 0\n endloop\n endfacet\n",
		 8, "1e+06"},
		{TRIANGLE "f 1 2 2\n", 4, "area"},
		{TRIANGLE "v 2 0 0\nf 1 2 3\nf 1 2 4\n", 6, "area"},
		{TRIANGLE "v 1 0 0\nf 1 2 4\n", 5, "area"},
		{"v 0 0 0\nv 1 0 0\nv 0.5 1e-10 0\nf 1 2 3\n", 4, "area"},
		{SQUARE "v 0 0 1\nf 1 2 3\nf 2 1 4\nf 1 5 2\n", 8, "more than two"},
		{TRIANGLE "f 1 2 3\nf 1 2 3\nf 2 1 3\n", 6, "more than two"},
		{SQUARE "f 1 2 4\nf 1 3 4\n", 6, "opposite"},
		{TRIANGLE "f 1 2 3\nf 1 2 3\n", 5, "opposite"},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		char place[32];

		snprintf(place, sizeof(place), "a.obj:%d: ", cases[k].line);
		assert_error(load(cases[k].text, here, &err), EINVAL, &err,
			     cases[k].line ? place : NULL, cases[k].what);
	}
}

/* A mesh of STL, in text or in bytes, is that of OBJ: facets come in any order and name. */
TEST(test_stl)
{
	static const double p[5][3] = {
		{0, 0, 0}, {2, 0, 0.5}, {2.25, 3, 0}, {0, 3.5, -1}, {1, 1, 4}};
	static const int corner[6][3] = {{3, 1, 0}, {3, 2, 1}, {0, 1, 4},
					 {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
	char obj[1000] = "", stl[4000] = "solid of a test\r\n",
	     bytes[84 + 7 * 50] = "solid";
	struct incise_surface *surface[3];
	uint32_t n = 7;

	for (int i = 0; i < 5; i++)
		sprintf(obj + strlen(obj), "v %g %g %g\n", p[i][0], p[i][1], p[i][2]);
	memcpy(bytes + 80, &n, sizeof(n));
	for (int k = 0; k < 7; k++) {
		/* The last one has no area, as those of many programs. */
		const int none[] = {1, 1, 2}, *c = k < 6 ? corner[k] : none;

		if (k < 6)
			sprintf(obj + strlen(obj), "f %d %d %d\n", c[0] + 1, c[1] + 1,
				c[2] + 1);
		strcat(stl, k % 2 ? "  facet normal nan nan nan\n\touter loop\n"
				  : " FACET NORMAL 0 0 1 OUTER LOOP\n");
		for (int i = 0; i < 3; i++) {
			const double *v = p[c[i]];

			sprintf(stl + strlen(stl), "vertex %.7e %g %.3f\n", v[0], v[1],
				v[2]);
			for (int j = 0; j < 3; j++) {
				float f = (float)v[j];

				memcpy(bytes + 84 + 50 * k + 12 + 12 * i + 4 * j, &f, 4);
			}
		}
		strcat(stl, "endloop\nendfacet\n");
	}
	strcat(stl, "endsolid of a test\n");
	for (int k = 0; k < 3; k++) {
		struct temp_file file = temp_file_new("m", k ? "" : obj);
		FILE *out = k ? fopen(file.path, "w") : NULL;

		if (k)
			fwrite(k == 1 ? stl : bytes, 1,
			       k == 1 ? strlen(stl) : sizeof(bytes), out);
		if (k)
			fclose(out);
		surface[k] = incise_surface_load_mesh(file.path, (double[3]){1, 2, 3},
						      false, &err);
		if (!surface[k])
			fail_msg("%s", err.text);
		temp_file_free(&file);
		assert_int_equal(incise_surface_triangles(surface[k]), 6);
	}
	for (int k = 0; k < 1000; k++) {
		const double at[3] = {1 + k % 10 * 0.3, 2 + k / 10 % 10 * 0.4,
				      2 + k / 100 * 0.6};
		struct incise_touch touch[3];

		for (int i = 0; i < 3; i++)
			incise_surface_nearest(surface[i], at, &touch[i]);
		for (int i = 1; i < 3; i++) {
			assert_true(touch[i].depth_mm == touch[0].depth_mm);
			assert_memory_equal(touch[i].normal, touch[0].normal,
					    sizeof(touch->normal));
		}
	}
	for (int i = 0; i < 3; i++)
		incise_surface_free(surface[i]);
}

/* Pieces that are closed, turned inside out or not, in any place; and an open one. */
TEST(test_inside_out)
{
	uint64_t seed = cases_seed(3);

	for (int n = 0; n < cases_of(200, 20); n++) {
		char text[4000] = "";
		int pieces = 1 + n % 4, wrong = 0;

		for (int k = 0; k < pieces; k++) {
			bool turned = solid_random(&seed) < 0.3,
			     open = solid_random(&seed) < 0.3;
			double x = 1e3 * k, y = 2e4 * (2 * solid_random(&seed) - 1),
			       z = 0.01 + solid_random(&seed);
			int a = 4 * k + 1;
			const int face[4][3] = {{a, a + 2, a + 1},
						{a, a + 1, a + 3},
						{a + 1, a + 2, a + 3},
						{a + 2, a, a + 3}};

			sprintf(text + strlen(text),
				"v %g %g 0\nv %g %g 0\nv %g %g 0\nv %g %g %g\n", x, y,
				x + 1, y, x, y + 1, x, y, z);
			for (int f = 0; f < (open ? 3 : 4); f++)
				sprintf(text + strlen(text), "f %d %d %d\n", face[f][0],
					face[f][turned ? 2 : 1], face[f][turned ? 1 : 2]);
			wrong += turned && !open;
		}
		for (int cavity = 0; cavity < 2; cavity++) {
			struct temp_file file = temp_file_new("a.obj", text);
			struct incise_surface *surface;

			err = (struct incise_error){0};
			surface = incise_surface_load_mesh(file.path, here, cavity, &err);
			if (!surface != (wrong && !cavity))
				fail_msg("%d of %d turned: %s\n%s", wrong, pieces,
					 err.text, text);
			if (!surface)
				assert_says(err.text, "a.obj:", "inside out");
			incise_surface_free(surface);
			temp_file_free(&file);
		}
	}
}

TEST(test_files_that_are_none)
{
	assert_null(incise_surface_load_mesh("/nowhere/a.obj", here, false, &err));
	assert_int_equal(err.code, ENOENT);
	assert_int_equal(errno, ENOENT);
	assert_null(incise_surface_load_mesh("/tmp", here, false, &err));
	assert_int_equal(err.code, EISDIR);
	assert_null(incise_surface_load_mesh("/dev/null", here, false, NULL));
	assert_int_equal(errno, EINVAL);
	assert_null(incise_surface_load_mesh("/dev/null", (double[3]){NAN, 0, 0}, false,
					     &err));
	assert_int_equal(err.code, EINVAL);
}

TEST(test_placed_and_numbered)
{
	struct incise_surface *surface =
		load(SQUARE
		     "vt 0 0\nvt 1 0\nvt 1 0.5\nvt 0 0.5\nf 1/1 2/2 4/3\nf 1/1 4/3 3/4\n",
		     (double[3]){10, 20, 30}, &err);
	struct incise_touch touch;

	assert_non_null(surface);
	incise_surface_nearest(surface, (double[3]){10.75, 20.25, 31}, &touch);
	assert_int_equal(touch.face, 0);
	assert_true(touch.depth_mm == -1 && touch.normal[2] == 1);
	/* u = x, v = y/2; texture coordinates are floats */
	assert_true(fabs(touch.uv[0] - 0.75) < 1e-7 && fabs(touch.uv[1] - 0.125) < 1e-7);
	incise_surface_nearest(surface, (double[3]){10.25, 20.75, 29}, &touch);
	assert_int_equal(touch.face, 1);
	assert_true(touch.depth_mm == 1);
	assert_true(fabs(touch.uv[0] - 0.25) < 1e-7 && fabs(touch.uv[1] - 0.375) < 1e-7);
	incise_surface_free(surface);
}
