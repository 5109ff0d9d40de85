/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A hexadecimal digit, whatever the locale.
 */
#ifndef INCISE_BASE_HEX_H
#define INCISE_BASE_HEX_H

/* 0 to 15; -1: no digit. */
static inline int incise_hex_digit(int c)
{
	if (c >= '0' && c <= '9')
		return c - '0';
	if (c >= 'A' && c <= 'F')
		return c - 'A' + 10;
	if (c >= 'a' && c <= 'f')
		return c - 'a' + 10;
	return -1;
}

#endif
