// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Numbers as text; see decimal.h.
 */
#include <math.h>
#include <stdio.h>
#include "decimal.h"

/* Write the digits of an integer, with leading zeros up to @least of them. */
static char *put_digits(char *to, uint64_t value, int least)
{
	char digits[24];
	int n = 0;

	for (; value || n < least; value /= 10)
		digits[n++] = '0' + value % 10;
	while (n)
		*to++ = digits[--n];
	return to;
}

char *incise_decimal_integer(char *to, int64_t value)
{
	if (value < 0)
		*to++ = '-';
	return put_digits(to, value < 0 ? -(uint64_t)value : (uint64_t)value, 1);
}

/*
 * The product has an error of half its last digit, 2^-53 of it: below 2^40 that is 1.3e-4, so
 * the rounding is uncertain only within 1e-3 of a half.
 */
char *incise_decimal_real(char *to, double value, int decimals)
{
	static const double powers[] = {1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
	double scaled, whole;
	uint64_t n, power;

	if (decimals < 0)
		return to + sprintf(to, "%.9g", value);
	if (decimals > 9 || !(fabs(value) * powers[decimals] < 0x1p40))
		return to + sprintf(to, "%.*f", decimals, value);
	scaled = fabs(value) * powers[decimals];
	whole = floor(scaled);
	if (fabs(scaled - whole - 0.5) < 1e-3)
		return to + sprintf(to, "%.*f", decimals, value);
	n = (uint64_t)whole + (scaled - whole > 0.5);
	power = (uint64_t)powers[decimals];
	if (signbit(value))
		*to++ = '-';
	to = put_digits(to, n / power, 1);
	if (decimals) {
		*to++ = '.';
		to = put_digits(to, n % power, decimals);
	}
	return to;
}
