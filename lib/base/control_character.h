/* SPDX-License-Identifier: LGPL-2.1-or-later */
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

/* Replace each by '?', and each byte that is no character of UTF-8: text of others, to be printed. */
static inline void control_characters_hide(char *text)
{
	for (int n; *text; text += n) {
		unsigned char c = (unsigned char)*text;
		int length = c < 0x80	? 1
			     : c < 0xc2 ? 0
			     : c < 0xe0 ? 2
			     : c < 0xf0 ? 3
					: 4;

		n = 1;
		while (n < length && (text[n] & 0xc0) == 0x80)
			n++;
		if (n < length || !length || c > 0xf4 || control_character(text))
			for (int i = 0; i < n; i++)
				text[i] = '?';
	}
}

#endif
