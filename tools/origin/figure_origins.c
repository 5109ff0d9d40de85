// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Origins in figures; see origins.h.
 *
 *   PNG:  signature, IHDR │ tEXt "incise-origin" NUL tokens │ the other chunks
 *   SVG:  … <svg …> │ <metadata>tokens</metadata> │ …
 *   PDF:  … %%EOF │ % tokens, startxref N, %%EOF, as readers seek the last ones in the last 1024 bytes
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "origins.h"

#define PNG_HEAD (8 + 25) /* signature and IHDR */
#define KEYWORD "incise-origin"

static char *text_of(const struct origins *origins, const char *before, const char *after,
		     size_t *n)
{
	char *text = NULL;
	FILE *out = open_memstream(&text, n);

	if (!out)
		cli_fail("no memory");
	origins_write(origins, out, before, after);
	fclose(out);
	return text;
}

static void put_u32(FILE *out, uint32_t value)
{
	for (int shift = 24; shift >= 0; shift -= 8)
		putc((int)(value >> shift & 0xff), out);
}

/* CRC-32 as of PNG, continued from @crc. */
static uint32_t crc32_more(uint32_t crc, const char *bytes, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		crc ^= (unsigned char)bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
	}
	return crc;
}

static void put_chunk(const char *text, size_t n, FILE *out)
{
	static const char head[] = "tEXt" KEYWORD; /* with its NUL */
	uint32_t crc = crc32_more(~UINT32_C(0), head, sizeof(head));

	put_u32(out, (uint32_t)(sizeof(head) - 4 + n));
	fwrite(head, 1, sizeof(head), out);
	fwrite(text, 1, n, out);
	put_u32(out, ~crc32_more(crc, text, n));
}

/* Behind the start tag of the SVG; 0: there is none. */
static size_t inside_svg(const char *bytes, size_t n)
{
	const char *tag = memmem(bytes, n, "<svg", 4);
	const char *end = tag ? memchr(tag, '>', n - (size_t)(tag - bytes)) : NULL;

	return end ? (size_t)(end + 1 - bytes) : 0;
}

/* "startxref … %%EOF" at the end of a PDF; 0: there is none. */
static size_t last_reference(const char *bytes, size_t n)
{
	size_t from = n > 1024 ? n - 1024 : 0, found = 0;

	for (const char *at; (at = memmem(bytes + from, n - from, "startxref", 9));
	     from = found + 1)
		found = (size_t)(at - bytes);
	return found;
}

void origins_into_figure(const struct origins *origins, const char *bytes, size_t n,
			 FILE *out)
{
	bool png = n > PNG_HEAD && !memcmp(bytes, "\x89PNG\r\n\x1a\n", 8);
	bool pdf = n > 5 && !memcmp(bytes, "%PDF-", 5);
	size_t at = !origins->n ? n : png ? PNG_HEAD : pdf ? n : inside_svg(bytes, n);
	size_t reference = pdf ? last_reference(bytes, n) : 0, length;
	char *text;

	at = at ? at : n;
	fwrite(bytes, 1, at, out);
	if (origins->n && png) {
		text = text_of(origins, "", "\n", &length);
		put_chunk(text, length, out);
		free(text);
	} else if (origins->n && pdf && reference) {
		origins_write(origins, out, "% ", "\n");
		fwrite(bytes + reference, 1, n - reference, out);
	} else if (at < n) {
		fputs("\n<metadata>\n", out);
		origins_write(origins, out, "", "\n");
		fputs("</metadata>", out);
	}
	fwrite(bytes + at, 1, n - at, out);
}
