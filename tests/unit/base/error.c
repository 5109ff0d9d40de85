// SPDX-License-Identifier: GPL-2.0-or-later
/* Errors as values: the code, errno and a single clean line. */
#include "../unit.h"
#include <incise/version.h>

TEST(test_code_line_and_errno)
{
	errno = 0;
	assert_int_equal(incise_error_set(&err, ENOENT, "%s:%d: gone", "a.fis", 7),
			 -ENOENT);
	assert_int_equal(errno, ENOENT);
	assert_int_equal(err.code, ENOENT);
	assert_string_equal(err.text, "a.fis:7: gone");
}

TEST(test_without_a_place_to_leave_it)
{
	errno = 0;
	assert_int_equal(incise_error_set(NULL, EIO, "lost"), -EIO);
	assert_int_equal(errno, EIO);
}

/* Text from a file must not end the line, move the cursor or overrun. */
TEST(test_hostile_text)
{
	char longer[2000];

	incise_error_set(&err, EINVAL, "a\nb\033[2Jc\x7f");
	assert_string_equal(err.text, "a?b?[2Jc?");
	memset(longer, 'x', sizeof(longer));
	longer[sizeof(longer) - 1] = 0;
	incise_error_set(&err, EINVAL, "%s", longer);
	assert_int_equal(strlen(err.text), sizeof(err.text) - 1);
}

TEST(test_version)
{
	assert_string_equal(incise_version(), INCISE_VERSION);
}

/* Packages of Debian 12 and 13, as `dpkg -S` names them. */
TEST(test_a_missing_library_is_named_with_its_package)
{
	static const char *const cases[][2] = {
		{"libSDL2-2.0.so.0", "libsdl2-2.0-0"},
		{"libepoxy.so.0", "libepoxy0"},
		{"libcairo.so.2", "libcairo2"},
		{"libEGL.so.1", "libegl1"},
		{"libmnl.so.0", "libmnl0"},
		{"libiio.so.0", "libiio0"},
		{"libcomedi.so.0", "libcomedi0"},
		{"libgpiod.so.2", "libgpiod2"},
		{"libgpiod.so.3", "libgpiod3"},
		{"libusb-1.0.so.0", "libusb-1.0-0"},
		{"libavformat.so.59", "libavformat59"},
		{"libopencv_core.so.406", "libopencv-core406"},
		{"libopencv_calib3d.so.410", "libopencv-calib3d410"},
		{"libhdf5_serial.so.103", "libhdf5-103-1"},
		{"libhdf5_serial.so.310", "libhdf5-310"},
		{"libjpeg.so.62", "libjpeg62-turbo"},
		{"libpng16.so.16", "libpng16-16"},
		{"libstdc++.so.6", "libstdc++6"},
		{"libsqlite3.so.0", "libsqlite3-0"},
		{"libincise-view.so.2", "libincise2"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char said[200], want[200];

		snprintf(said, sizeof(said),
			 "%s: cannot open shared object file: No such file or directory",
			 cases[i][0]);
		snprintf(want, sizeof(want),
			 "a: %s is missing; install it: sudo apt-get install %s",
			 cases[i][0], cases[i][1]);
		assert_int_equal(incise_error_library(&err, "a", said), -ENOEXEC);
		assert_string_equal(err.text, want);
	}
	incise_error_library(&err, "a", "x.so: file too short");
	assert_string_equal(err.text, "a: x.so: file too short; install the missing "
				      "library");
	/* A name that is no library's is no package either. */
	incise_error_library(&err, "a",
			     "lib;rm.so.1: cannot open shared object file: No such file");
	assert_null(strstr(err.text, "apt-get"));
}

/* The fewest edits win; more than a third of the letters, and nothing is meant. */
TEST(test_nearest_name)
{
	static const char *const names[] = {"duration", "rate",	 "output", "overwrite",
					    "o",	"state", NULL};
	static const struct {
		const char *typed, *meant;
	} cases[] = {
		{"duraton", "duration"},  {"durration", "duration"},
		{"druation", "duration"}, {"rates", "rate"},
		{"rtae", "rate"},	  {"ouput", "output"},
		{"output", "output"},	  {"over-write", "overwrite"},
		{"stat", "state"},	  {"", "o"},
		{"frequency", NULL},	  {"output-model", NULL},
		{"raaate", "rate"},
	};
	static const char *const none[] = {NULL};
	char longer[100] = {0};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const char *found = incise_nearest_name(cases[i].typed, names);

		if (cases[i].meant)
			assert_string_equal(found, cases[i].meant);
		else
			assert_null(found);
	}
	assert_null(incise_nearest_name("rate", none));
	memset(longer, 'a', sizeof(longer) - 1);
	assert_null(incise_nearest_name(longer, names));
	assert_null(incise_nearest_name("rate", (const char *const[]){longer, NULL}));
}
