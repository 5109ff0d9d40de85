// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A value ± its uncertainty; see uncertainty.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "uncertainty.h"

/* More digits are written as powers of ten. */
#define DECIMALS_MAX 9
#define PLAIN_MAX 1e9

const char *uncertainty_text(double value, double U, const char *unit,
			     char text[UNCERTAINTY_TEXT])
{
	const char *blank = *unit ? " " : "";
	char rounded[32];
	int decimals;
	double step;

	if (!isfinite(value)) {
		strcpy(text, "-");
		return text;
	}
	if (!(U > 0) || !isfinite(U)) {
		snprintf(text, UNCERTAINTY_TEXT, "%.6g%s%s", value, blank, unit);
		return text;
	}
	/* Rounding comes first: 0.0996 has the digits of 0.10. */
	snprintf(rounded, sizeof(rounded), "%.1e", U);
	decimals = 1 - atoi(strchr(rounded, 'e') + 1);
	if (decimals > DECIMALS_MAX || fabs(value) >= PLAIN_MAX || U >= PLAIN_MAX) {
		snprintf(text, UNCERTAINTY_TEXT, "%.3e ± %s%s%s", value, rounded, blank,
			 unit);
		return text;
	}
	if (decimals < 0) {
		step = pow(10, -decimals);
		value = round(value / step) * step;
		decimals = 0;
	}
	step = pow(10, -decimals);
	/* No "-0.00". */
	if (fabs(value) < step / 2)
		value = 0;
	snprintf(text, UNCERTAINTY_TEXT, "%.*f ± %.*f%s%s", decimals, value, decimals,
		 atof(rounded), blank, unit);
	return text;
}
