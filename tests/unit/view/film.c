// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A film's file: invalid options and a missing module are reported, and no partial file is left.
 * tests/unit/film tests its contents.
 */
#include "../unit.h"
#include <incise/film.h>

static char folder[] = "/tmp/incise-films-XXXXXX";

TEST(test_sizes)
{
	static const struct {
		int width, height, rate;
	} cases[] = {{15, 16, 30},   {16, 15, 30},    {17, 16, 30},   {16, 16, 0},
		     {16, 16, 1001}, {-16, 16, 30},   {8194, 16, 30}, {16, 1 << 30, 30},
		     {0, 0, 0},	     {1 << 30, 16, 1}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_error(incise_film_new("x.mkv", cases[i].width, cases[i].height,
					     cases[i].rate, &err),
			     EINVAL, &err, "x.mkv");
	}
}

TEST(test_no_module)
{
	char path[100];

	setenv("INCISE_MODULE_PATH", folder, 1);
	snprintf(path, sizeof(path), "%s/x.mkv", folder);
	assert_error(incise_film_new(path, 16, 16, 30, &err), ENOENT, &err,
		     "film_mkv.so");
	assert_int_equal(access(path, F_OK), -1);
	assert_int_equal(incise_film_close(NULL, &err), 0);
	incise_film_drop(NULL);
}

static int begin(void **state)
{
	return !mkdtemp(folder);
}

static int end(void **state)
{
	return rmdir(folder);
}

GROUP(begin, end);
