// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a text file word by word; see text.h.
 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include "c_locale.h"
#include "text.h"
#include "utf8.h"

int text_open(struct text *text, const char *path, struct incise_error *err)
{
	static const struct incise_infile_kind mesh = {
		.name = "a mesh or height grid",
		.size_max = (uint64_t)1 << 31,
		.regular = true,
	};
	size_t size;

	*text = (struct text){.path = path, .line = 1};
	text->data = incise_infile_read(path, &mesh, &size, err);
	if (!text->data)
		return -errno;
	text->at = text->data + utf8_mark(text->data);
	text->end = text->data + size;
	return 0;
}

void text_close(struct text *text)
{
	free(text->data);
	text->data = NULL;
}

/* Bytes of an end of a line with a backslash before it: the line goes on. */
static size_t hidden_end(const char *at)
{
	if (*at != '\\')
		return 0;
	return at[1] == '\n' ? 2 : at[1] == '\r' && at[2] == '\n' ? 3 : 0;
}

size_t text_word(struct text *text, const char **word)
{
	const char *at = text->at;
	size_t hidden;

	while (at < text->end &&
	       ((hidden = hidden_end(at)) || *at == ' ' || *at == '\t' || *at == '\r')) {
		text->line += hidden > 0;
		at += hidden ? hidden : 1;
	}
	*word = at;
	while (at < text->end && *at != ' ' && *at != '\t' && *at != '\r' && *at != '\n')
		at++;
	text->at = at;
	return (size_t)(at - *word);
}

bool text_next_line(struct text *text)
{
	const char *end = memchr(text->at, '\n', (size_t)(text->end - text->at));

	if (!end || end + 1 == text->end) {
		text->at = text->end;
		return false;
	}
	text->at = end + 1;
	text->line++;
	return true;
}

bool text_next_word(struct text *text, const char **word, size_t *length)
{
	while (!(*length = text_word(text, word)))
		if (!text_next_line(text))
			return false;
	return true;
}

/* For numbers that the fast way cannot round correctly. */
static bool slow_number(const char *word, size_t length, double *value)
{
	struct incise_c_locale locale;
	char copy[128];

	if (length >= sizeof(copy))
		return false;
	memcpy(copy, word, length);
	copy[length] = '\0';
	locale = incise_c_locale_begin();
	*value = strtod(copy, NULL);
	incise_c_locale_end(locale);
	return isfinite(*value);
}

bool text_number(const char *word, size_t length, double *value)
{
	static const double power[] = {1e0,  1e1,  1e2,	 1e3,  1e4,  1e5,  1e6,	 1e7,
				       1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
				       1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
	const char *at = word, *end = word + length;
	int scale = 0, digits = 0, exponent = 0, exponent_digits = 0;
	bool negative = false, fraction = false, down = false;
	uint64_t mantissa = 0;

	if (at < end && (*at == '-' || *at == '+'))
		negative = *at++ == '-';
	for (; at < end && (isdigit((unsigned char)*at) || (*at == '.' && !fraction));
	     at++) {
		if (*at == '.') {
			fraction = true;
			continue;
		}
		/* 18 digits fit; where there are more, the slow way counts them. */
		digits++;
		if (digits <= 18)
			mantissa = mantissa * 10 + (uint64_t)(*at - '0');
		scale -= fraction;
	}
	if (!digits)
		return false;
	if (at < end && (*at == 'e' || *at == 'E')) {
		at++;
		if (at < end && (*at == '-' || *at == '+'))
			down = *at++ == '-';
		for (; at < end && isdigit((unsigned char)*at); at++, exponent_digits++)
			exponent = exponent < 10000 ? exponent * 10 + (*at - '0') : 10000;
		if (!exponent_digits)
			return false;
		scale += down ? -exponent : exponent;
	}
	if (at != end)
		return false;
	/* Both operands exact and one operation: correctly rounded. */
	if (digits > 18 || mantissa > (uint64_t)1 << 53 || scale < -22 || scale > 22)
		return slow_number(word, length, value);
	*value = scale < 0 ? (double)mantissa / power[-scale]
			   : (double)mantissa * power[scale];
	if (negative)
		*value = -*value;
	return true;
}

const char *text_integer(const char *word, const char *end, long long *value)
{
	const char *at = word;
	bool negative = at < end && *at == '-';
	int digits = 0;

	at += negative;
	*value = 0;
	for (; at < end && isdigit((unsigned char)*at); at++) {
		if (++digits > 10)
			return NULL;
		*value = *value * 10 + (*at - '0');
	}
	if (negative)
		*value = -*value;
	return digits ? at : NULL;
}

int text_error(const struct text *text, struct incise_error *err, const char *fmt, ...)
{
	char what[300];
	va_list args;

	va_start(args, fmt);
	vsnprintf(what, sizeof(what), fmt, args);
	va_end(args);
	return incise_error_set(err, EINVAL, "%s:%d: %s", text->path, text->line, what);
}
