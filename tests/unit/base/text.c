// SPDX-License-Identifier: GPL-2.0-or-later
/* Numbers in text against strtod(), which rounds correctly. */
#include "../unit.h"
#include <locale.h>
#include "../../../lib/base/text.h"

TEST(test_numbers_are_rounded_correctly)
{
	static const char *const formats[] = {"%.3f",  "%.6f",	"%.17g", "%.9e",
					      "%.20f", "%+.1f", "%.0f",	 "%.15g"};
	unsigned int seed = 7;

	for (int k = 0; k < 40000; k++) {
		double x = ((double)rand_r(&seed) / RAND_MAX - 0.5) *
			   pow(10, rand_r(&seed) % 60 - 30);
		char word[120];
		double value;

		snprintf(word, sizeof(word), formats[k % 8], x);
		assert_true(text_number(word, strlen(word), &value));
		assert_true(value == strtod(word, NULL));
	}
}

TEST(test_what_is_a_number)
{
	static const char *const good[] = {
		"0",	"-0",	 "1.",	   ".5",    "-.5e-3",
		"1e22", "00012", "1e-300", "1e300", "123456789012345678901"};
	static const char *const bad[] = {"",
					  "-",
					  ".",
					  "1e",
					  "e5",
					  "1e+",
					  "0x1",
					  "nan",
					  "inf",
					  "1.2.3",
					  "1,5",
					  "--1",
					  "1 ",
					  "1e400",
					  "1f",
					  "+-1",
					  "1e99999999999999999999"};
	double value;

	for (size_t k = 0; k < sizeof(good) / sizeof(*good); k++) {
		assert_true(text_number(good[k], strlen(good[k]), &value));
		assert_true(value == strtod(good[k], NULL));
	}
	for (size_t k = 0; k < sizeof(bad) / sizeof(*bad); k++)
		if (text_number(bad[k], strlen(bad[k]), &value))
			fail_msg("'%s' was taken", bad[k]);
}

/* The slow way asks the C library, which knows a locale. */
TEST(test_a_decimal_comma_changes_nothing)
{
	static const char word[] = "0.1000000000000000055511151231257827";
	double value = 0;

	if (!setlocale(LC_NUMERIC, "de_DE.UTF-8")) {
		puts("skipped: no locale with a decimal comma");
		skip();
	}
	assert_true(text_number(word, strlen(word), &value));
	setlocale(LC_NUMERIC, "C");
	assert_true(value == 0.1);
}

TEST(test_integers)
{
	static const struct {
		const char *word;
		long long value;
		int taken; /* characters, or -1 */
	} cases[] = {
		{"12/3", 12, 2},	{"-7", -7, 2}, {"", 0, -1},
		{"-", 0, -1},		{"/", 0, -1},  {"9999999999", 9999999999, 10},
		{"10000000000", 0, -1}, {"+1", 0, -1},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		const char *word = cases[k].word;
		long long value;
		const char *end = text_integer(word, word + strlen(word), &value);

		if (cases[k].taken < 0) {
			assert_null(end);
		} else {
			assert_ptr_equal(end, word + cases[k].taken);
			assert_true(value == cases[k].value);
		}
	}
}
