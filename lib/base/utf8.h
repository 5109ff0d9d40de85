/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Characters of UTF-8 in untrusted text.
 */
#ifndef INCISE_UTF8_H
#define INCISE_UTF8_H

#include <string.h>

/* Bytes of the byte order mark that Windows' programs write before a text, or 0. */
static inline int utf8_mark(const char *text)
{
	return strncmp(text, "\xef\xbb\xbf", 3) ? 0 : 3;
}

/*
 * Bytes of the character at @text, which ends with NUL: 1 to 4; 0 if it is no character of UTF-8:
 * a stray byte, an overlong form, a surrogate, or beyond U+10FFFF.
 */
static inline int utf8_length(const char *text)
{
	const unsigned char *c = (const unsigned char *)text;
	int length = *c < 0x80	 ? 1
		     : *c < 0xc2 ? 0
		     : *c < 0xe0 ? 2
		     : *c < 0xf0 ? 3
		     : *c < 0xf5 ? 4
				 : 0;

	for (int i = 1; i < length; i++)
		if ((c[i] & 0xc0) != 0x80)
			return 0;
	if ((*c == 0xe0 && c[1] < 0xa0) || (*c == 0xed && c[1] > 0x9f) ||
	    (*c == 0xf0 && c[1] < 0x90) || (*c == 0xf4 && c[1] > 0x8f))
		return 0;
	return length;
}

/* Bytes of a character that may be shown: 0 also for a control character. */
static inline int utf8_printable(const char *text)
{
	return (unsigned char)*text < ' ' || *text == 0x7f ? 0 : utf8_length(text);
}

/*
 * Copy a text without its NUL: '?' for a byte of what may not be shown, and a backslash before each byte that
 * is @quoted. Returns behind the last byte.
 */
static inline char *utf8_copy_printable(char *to, const char *text, const char *quoted)
{
	while (*text) {
		int length = utf8_printable(text);

		if (strchr(quoted, *text))
			*to++ = '\\';
		*to++ = length ? *text : '?';
		text++;
		for (int i = 1; i < length; i++)
			*to++ = *text++;
	}
	return to;
}

#endif
