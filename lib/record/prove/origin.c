// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The origin of a file as a token; see incise/origin.h.
 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <incise/origin.h>
#include "../../base/hex.h"

#define START "incise:"
#define LOWER "abcdefghijklmnopqrstuvwxyz"
#define DIGITS "0123456789"
#define PLAIN LOWER "ABCDEFGHIJKLMNOPQRSTUVWXYZ" DIGITS "-"

static bool all_of(const char *text, const char *set)
{
	return strspn(text, set) == strlen(text);
}

static bool is_valid(const struct incise_origin *origin)
{
	return origin->depth >= 1 && origin->depth <= INCISE_ORIGIN_DEPTH_MAX &&
	       *origin->kind && all_of(origin->kind, LOWER) &&
	       strlen(origin->sha256) == 64 && all_of(origin->sha256, DIGITS "abcdef") &&
	       all_of(origin->identity, PLAIN) && strcmp(origin->identity, "-") &&
	       *origin->name && !strchr(origin->name, '/') && strcmp(origin->name, ".") &&
	       strcmp(origin->name, "..");
}

int incise_origin_text(const struct incise_origin *origin, char *text)
{
	int n;

	if (!is_valid(origin))
		return -EINVAL;
	n = sprintf(text, START "%d:%s:%s:%" PRIu64 ":%s:", origin->depth, origin->kind,
		    origin->sha256, origin->commit,
		    *origin->identity ? origin->identity : "-");
	for (const char *c = origin->name; *c; c++)
		n += strchr(PLAIN "._~", *c)
			     ? sprintf(text + n, "%c", *c)
			     : sprintf(text + n, "%%%02X", (unsigned char)*c);
	n += sprintf(text + n, ";");
	return n;
}

/* --- reading ---------------------------------------------------------------------------- */

struct origin_reader {
	const char *at, *end;
	bool bad;
};

/* The next field, of bytes of this set, up to @stop. */
static void field(struct origin_reader *in, const char *set, char stop, char *to,
		  size_t size)
{
	size_t n = 0;

	while (in->at < in->end && *in->at && n + 1 < size && strchr(set, *in->at))
		to[n++] = *in->at++;
	to[n] = 0;
	in->bad |= in->at == in->end || *in->at != stop || !n;
	if (!in->bad)
		in->at++;
}

static void read_origin_number(struct origin_reader *in, uint64_t *value)
{
	char text[21];

	field(in, DIGITS, ':', text, sizeof(text));
	*value = 0;
	for (const char *c = text; *c && !in->bad; c++)
		in->bad |= __builtin_mul_overflow(*value, 10u, value) ||
			   __builtin_add_overflow(*value, (uint64_t)(*c - '0'), value);
	in->bad |= *text == '0' && text[1];
}

static void name(struct origin_reader *in, char *to, size_t size)
{
	size_t n = 0;

	while (in->at < in->end && n + 1 < size && *in->at && *in->at != ';') {
		int high, low;

		if (*in->at != '%') {
			if (!strchr(PLAIN "._~", *in->at))
				break;
			to[n++] = *in->at++;
			continue;
		}
		if (in->end - in->at < 3)
			break;
		high = incise_hex_digit(in->at[1]);
		low = incise_hex_digit(in->at[2]);
		/* One way to write each byte. */
		if (high < 0 || low < 0 || !(high * 16 + low) ||
		    strchr(PLAIN "._~", high * 16 + low))
			break;
		to[n++] = (char)(high * 16 + low);
		in->at += 3;
	}
	to[n] = 0;
	in->bad |= in->at == in->end || *in->at != ';';
	in->at += !in->bad;
}

static bool parse_origin(struct origin_reader *in, struct incise_origin *origin)
{
	uint64_t depth;

	read_origin_number(in, &depth);
	origin->depth = depth <= INCISE_ORIGIN_DEPTH_MAX ? (int)depth : 0;
	field(in, LOWER, ':', origin->kind, sizeof(origin->kind));
	field(in, DIGITS "abcdef", ':', origin->sha256, sizeof(origin->sha256));
	read_origin_number(in, &origin->commit);
	field(in, PLAIN, ':', origin->identity, sizeof(origin->identity));
	if (!strcmp(origin->identity, "-"))
		*origin->identity = 0;
	name(in, origin->name, sizeof(origin->name));
	return !in->bad && is_valid(origin);
}

bool incise_origin_next(const char *bytes, size_t n, size_t *at,
			struct incise_origin *origin)
{
	const size_t length = strlen(START);

	while (*at < n) {
		const char *start = memmem(bytes + *at, n - *at, START, length);
		struct origin_reader in;

		if (!start)
			break;
		in = (struct origin_reader){start + length, bytes + n, false};
		*at = (size_t)(start - bytes) + length;
		if (!parse_origin(&in, origin))
			continue;
		*at = (size_t)(in.at - bytes);
		return true;
	}
	*at = n;
	return false;
}
