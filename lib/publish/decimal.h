/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Numbers as text, with the digits of printf(3), which would take most of the time of an
 * export. The locale must have a decimal point; see c_locale.h.
 */
#ifndef INCISE_DECIMAL_H
#define INCISE_DECIMAL_H

#include <stdint.h>

#define INCISE_DECIMAL_MAX 400 /* bytes of a number: %.9f of the largest double is 319 */

/* Both return behind the last digit, and write no NUL. */
char *incise_decimal_integer(char *to, int64_t value);

/* As "%.*f"; with negative @decimals as "%.9g". */
char *incise_decimal_real(char *to, double value, int decimals);

#endif
