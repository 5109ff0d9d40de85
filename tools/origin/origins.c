// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Origins in the files that commands write; see origins.h.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "origins.h"

#define PNG_HEAD (8 + 25) /* signature and IHDR */
#define KEYWORD "incise-origin"

static const char *kind_of(enum file_kind kind)
{
	static const struct {
		enum file_kind kind;
		const char *name;
	} names[] = {{FILE_RECORDING, "recording"},    {FILE_MODEL, "model"},
		     {FILE_COMPILED, "compiled"},      {FILE_TABLE, "table"},
		     {FILE_SESSION, "session"},	       {FILE_EXPORT, "export"},
		     {FILE_IMAGE, "figure"},	       {FILE_DEVIATION, "deviation"},
		     {FILE_CALIBRATION, "calibration"}};

	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++)
		if (names[i].kind == kind)
			return names[i].name;
	return "file";
}

void origins_add(struct incise_origins *origins, const char *path)
{
	/* An interrupted recording, and one that is named without its extension. */
	static const char *const ends[] = {".part", ".rec"};
	enum file_kind kind = file_kind_of(path);
	char *whole = cli_text("%s", path);
	struct incise_error err = {0};

	for (int i = 0; i < 2 && kind != FILE_RECORDING; i++) {
		free(whole);
		whole = cli_text("%s%s", path, ends[i]);
		if (file_kind_of(whole) == FILE_RECORDING)
			kind = FILE_RECORDING;
	}
	cli_check(incise_origins_add(origins, kind == FILE_RECORDING ? whole : path,
				     kind_of(kind), &err),
		  &err);
	free(whole);
}

/* Their tokens, each between @before and @after. */
static void write_tokens(const struct incise_origins *origins, FILE *out,
			 const char *before, const char *after)
{
	char text[INCISE_ORIGIN_TEXT];

	for (int i = 0; i < origins->n; i++)
		if (incise_origin_text(&origins->all[i], text) > 0)
			fprintf(out, "%s%s%s", before, text, after);
}

/*
 * --- figures ------------------------------------------------------------------------------
 *
 *   PNG:  signature, IHDR │ tEXt "incise-origin" NUL tokens │ the other chunks
 *   SVG:  … <svg …> │ <metadata>tokens</metadata> │ …
 *   PDF:  … %%EOF │ % tokens, startxref N, %%EOF, as readers seek the last ones in the last 1024 bytes
 */

static char *print_tokens(const struct incise_origins *origins, const char *before,
			  const char *after, size_t *n)
{
	char *text = NULL;
	FILE *out = open_memstream(&text, n);

	if (!out)
		cli_fail("no memory");
	write_tokens(origins, out, before, after);
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

void origins_into_figure(const struct incise_origins *origins, const char *bytes,
			 size_t n, FILE *out)
{
	bool png = n > PNG_HEAD && !memcmp(bytes, "\x89PNG\r\n\x1a\n", 8);
	bool pdf = n > 5 && !memcmp(bytes, "%PDF-", 5);
	size_t at = !origins->n ? n : png ? PNG_HEAD : pdf ? n : inside_svg(bytes, n);
	size_t reference = pdf ? last_reference(bytes, n) : 0, length;
	char *text;

	at = at ? at : n;
	fwrite(bytes, 1, at, out);
	if (origins->n && png) {
		text = print_tokens(origins, "", "\n", &length);
		put_chunk(text, length, out);
		free(text);
	} else if (origins->n && pdf && reference) {
		write_tokens(origins, out, "% ", "\n");
		fwrite(bytes + reference, 1, n - reference, out);
	} else if (at < n) {
		fputs("\n<metadata>\n", out);
		write_tokens(origins, out, "", "\n");
		fputs("</metadata>", out);
	}
	fwrite(bytes + at, 1, n - at, out);
}
