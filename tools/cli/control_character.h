/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Control characters in text of UTF-8 that is shown to people.
 */
#ifndef INCISE_CONTROL_CHARACTER_H
#define INCISE_CONTROL_CHARACTER_H

/* Bytes of the control character of ASCII or Latin-1 that text starts with; 0: it starts with none. */
static inline int control_character(const char *text)
{
	const unsigned char *c = (const unsigned char *)text;

	if (*c == 0xc2 && c[1] >= 0x80 && c[1] < 0xa0)
		return 2;
	return (*c && *c < ' ') || *c == 0x7f;
}

#endif
