// SPDX-License-Identifier: GPL-2.0-or-later
/* Reading ESRI ASCII grids: where heights lie, what is refused, damaged files. */
#include "../unit.h"
#include "../../../lib/surface/surface.h"
#include "../base/temp_file.h"
#include "solid.h"

static const double here[3];

static struct incise_surface *load(const char *text, const double at[3],
				   struct incise_error *err)
{
	struct temp_file file = temp_file_new("a.asc", text);
	struct incise_surface *surface;

	errno = 0;
	surface = incise_surface_load_heights(file.path, at, err);
	if (!surface)
		assert_int_equal(errno, err->code);
	temp_file_free(&file);
	return surface;
}

/* Of a grid at 10, 20 with cells of 2. */
#define HEAD(x, y) "ncols 3\nnrows 2\n" x " 10\n" y " 20\ncellsize 2\n"
#define CENTERS HEAD("xllcenter", "yllcenter")
#define ROWS "1 2 3\n4 5 6\n"

static double height(const struct incise_surface *surface, double x, double y)
{
	const double above[3] = {x, y, 100}, below[3] = {x, y, -100};
	struct incise_touch touch;

	return incise_surface_enters(surface, above, below, &touch) ? touch.point_mm[2]
								    : NAN;
}

TEST(test_heights_lie_where_they_belong)
{
	static const struct {
		const char *text;
		double x0, y0; /* of the lower left height */
	} cases[] = {
		{CENTERS ROWS, 10, 20},
		{HEAD("xllcorner", "yllcorner") ROWS, 11, 21},
		{HEAD("XLLCORNER", "YllCenter") "nodata_value -9999\n" ROWS, 11, 20},
		{CENTERS "1 2 3 4\n\n5\r\n6", 10, 20},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_surface *surface =
			load(cases[k].text, (double[3]){100, 0, 0.5}, &err);
		double x0 = cases[k].x0 + 100, y0 = cases[k].y0;

		if (!surface)
			fail_msg("case %zu: %s", k, err.text);
		assert_int_equal(incise_surface_triangles(surface), 4);
		assert_int_equal(incise_surface_kind(surface), INCISE_SURFACE_HEIGHTS);
		for (int i = 0; i < 3; i++) {
			assert_true(height(surface, x0 + 2 * i, y0) == 4.5 + i);
			assert_true(height(surface, x0 + 2 * i, y0 + 2) == 1.5 + i);
		}
		assert_true(fabs(height(surface, x0 + 0.3, y0 + 1) - 3.15) < 1e-12);
		assert_true(isnan(height(surface, x0 - 0.01, y0 + 1)));
		incise_surface_free(surface);
	}
}

TEST(test_bad_files)
{
	static const struct {
		const char *text;
		int code, line;
		const char *what;
	} cases[] = {
		{"", EINVAL, 1, "header"},
		{"ncols 3\nnrows 2\n" ROWS, EINVAL, 3, "header"},
		{"ncols 3\nncols 3\n", EINVAL, 2, "ncols"},
		{"ncols 3\ncolour 3\n", EINVAL, 2, "colour"},
		{"ncols three\n", EINVAL, 1, "'three'"},
		{"ncols\n3\n", EINVAL, 1, NULL},
		{"ncols 3 4\n", EINVAL, 1, NULL},
		{HEAD("xllcenter", "xllcorner") ROWS, EINVAL, 6, "header"},
		{"ncols 1\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 2\n1 2\n", EINVAL,
		 6, "ncols is 1"},
		{"ncols 2.5\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 2\n1 2\n",
		 EINVAL, 6, "ncols is 2.5"},
		{"ncols 1e30\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 2\n1\n", EINVAL,
		 6, "ncols is 1e+30"},
		{"ncols 2\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 0\n1\n", EINVAL, 6,
		 "cellsize is 0"},
		{"ncols 2\nnrows 2\nxllcenter 1e9\nyllcenter 0\ncellsize 1\n1\n", EINVAL,
		 6, "mm"},
		{"ncols 2000\nnrows 2000\nxllcenter 0\nyllcenter 0\ncellsize 1\n1\n",
		 E2BIG, 0, "more than 4000000"},
		{CENTERS "1 2 3\n4 5\n", EINVAL, 7, "height 3 of row 2"},
		{CENTERS "1 2 3\n4 5 6\n7\n", EINVAL, 8, "'7'"},
		{CENTERS "1 2 3\n4 x 6\n", EINVAL, 7, "'x'"},
		{CENTERS "1 2 3\n4 nan 6\n", EINVAL, 7, "'nan'"},
		{CENTERS "nan 2 3\n4 5 6\n", EINVAL, 6, "'nan'"},
		{CENTERS "1 2 3\n4 inf 6\n", EINVAL, 7, "'inf'"},
		{CENTERS "NODATA_value -9999\n1 2 3\n4 -9999.0 6\n", EINVAL, 8,
		 "column 2, row 2"},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		char place[32];

		snprintf(place, sizeof(place), "a.asc:%d: ", cases[k].line);
		assert_error(load(cases[k].text, here, &err), cases[k].code, &err,
			     cases[k].line ? place : NULL, cases[k].what);
	}
}
