// SPDX-License-Identifier: GPL-2.0-or-later
/* tools/cli/uncertainty.c: digits of a value and of its uncertainty. */
#include "../unit.h"
#include <float.h>
#include "../../../tools/cli/uncertainty.h"

TEST(digits_follow_the_uncertainty)
{
	static const struct {
		double value, U;
		const char *unit, *text;
	} cases[] = {
		{1238.4321, 1.94, "mV/N", "1238.4 ± 1.9 mV/N"},
		{-0.0031, 0.0048, "mm", "-0.0031 ± 0.0048 mm"},
		{-0.00001, 0.0048, "mm", "0.0000 ± 0.0048 mm"},
		{0.0312345678, 0.00000123, "mm/px", "0.0312346 ± 0.0000012 mm/px"},
		{12, 0.0996, "mm", "12.00 ± 0.10 mm"},
		{12, 9.96, "mm", "12 ± 10 mm"},
		{12.04, 1.04, "mm", "12.0 ± 1.0 mm"},
		{123456, 1944, "", "123500 ± 1900"},
		{123456, 99, "Pa", "123456 ± 99 Pa"},
		{0.5, 12, "N", "0 ± 12 N"},
		{7, 12345, "N", "0 ± 12000 N"},
		{3.14159265, NAN, "mm", "3.14159 mm"},
		{3.14159265, 0, "mm", "3.14159 mm"},
		{3.14159265, INFINITY, "mm", "3.14159 mm"},
		{NAN, 1, "mm", "-"},
		{-INFINITY, 1, "mm", "-"},
		{1.5e-12, 2.34e-13, "m", "1.500e-12 ± 2.3e-13 m"},
		{DBL_MAX, 1, "N", "1.798e+308 ± 1.0e+00 N"},
		{1, DBL_MAX, "N", "1.000e+00 ± 1.8e+308 N"},
	};
	char text[UNCERTAINTY_TEXT];

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_string_equal(uncertainty_text(cases[i].value, cases[i].U,
						     cases[i].unit, text),
				    cases[i].text);
}

/* Both numbers are off by at most half of their last digit, over all magnitudes. */
TEST(what_is_printed_is_the_value)
{
	char text[UNCERTAINTY_TEXT], *rest;

	for (double U = 1e-8; U < 1e8; U *= 1.7)
		for (double ratio = -3000; ratio < 3000; ratio += 7.3) {
			double value = ratio * U, printed;

			if (fabs(value) >= 1e9)
				continue;
			uncertainty_text(value, U, "", text);
			printed = strtod(text, &rest);
			/* Half of the second digit: at most 0.5 of 9.95. */
			assert_true(fabs(printed - value) <= 0.0503 * U);
			assert_memory_equal(rest, " ± ", strlen(" ± "));
			printed = strtod(rest + strlen(" ± "), &rest);
			assert_true(fabs(printed - U) <= 0.0503 * U);
			assert_string_equal(rest, "");
		}
}
