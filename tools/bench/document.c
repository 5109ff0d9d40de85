// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A document is put together; see document.h. Who writes it: document_html.c,
 * document_markdown.c.
 */
#include <ctype.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "document_blocks.h"

/* Room for one more of n things, in powers of two. */
static void *room(void *things, int n, size_t size)
{
	if (n & (n - 1))
		return things;
	things = realloc(things, (n ? 2 * (size_t)n : 1) * size);
	if (!things)
		cli_fail("no memory");
	return things;
}

static char *copy(const char *text)
{
	char *s = strdup(text);

	if (!s)
		cli_fail("no memory");
	return s;
}

static char *print(const char *fmt, va_list args)
{
	char *s;

	if (vasprintf(&s, fmt, args) < 0)
		cli_fail("no memory");
	return s;
}

static struct block *append(struct document *d, enum block_kind kind, char *text)
{
	d->blocks = room(d->blocks, d->n, sizeof(*d->blocks));
	d->blocks[d->n] = (struct block){.kind = kind, .text = text};
	return &d->blocks[d->n++];
}

struct document *document_new(const char *title)
{
	struct document *d = calloc(1, sizeof(*d));

	if (!d)
		cli_fail("no memory");
	d->title = copy(title);
	return d;
}

static void free_cells(struct cell *cells, int n)
{
	for (int i = 0; i < n; i++) {
		free(cells[i].text);
		free(cells[i].section);
	}
	free(cells);
}

void document_free(struct document *d)
{
	if (!d)
		return;
	for (int i = 0; i < d->n; i++) {
		struct block *b = &d->blocks[i];

		free_cells(b->columns, b->n_columns);
		free_cells(b->cells, b->n_cells);
		free(b->text);
		free(b->file);
		free(b->instead);
	}
	free(d->blocks);
	free(d->title);
	free(d);
}

void document_section(struct document *d, const char *title)
{
	append(d, BLOCK_SECTION, copy(title));
}

void document_heading(struct document *d, const char *title)
{
	append(d, BLOCK_HEADING, copy(title));
}

void document_text(struct document *d, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	append(d, BLOCK_TEXT, print(fmt, args));
	va_end(args);
}

void document_notice(struct document *d, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	append(d, BLOCK_NOTICE, print(fmt, args));
	va_end(args);
}

void document_item(struct document *d, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	append(d, BLOCK_ITEM, print(fmt, args));
	va_end(args);
}

void document_command(struct document *d, const char *fmt, ...)
{
	va_list args;
	char *text;

	va_start(args, fmt);
	text = print(fmt, args);
	va_end(args);
	/* One line, which cannot end the fence that it stands in. */
	for (char *c = text; *c; c++)
		if (*c == '`')
			*c = '\'';
		else if ((unsigned char)*c < ' ')
			*c = ' ';
	append(d, BLOCK_COMMAND, text);
}

void document_file(struct document *d, const char *file, const char *text)
{
	append(d, BLOCK_FILE, copy(text))->file = copy(file);
}

void document_picture(struct document *d, const char *file, const char *caption,
		      const char *instead)
{
	struct block *b = append(d, BLOCK_PICTURE, copy(caption));

	b->file = copy(file);
	b->instead = copy(instead);
}

void document_table(struct document *d, const char *caption)
{
	append(d, BLOCK_TABLE, copy(caption));
}

static struct block *table(struct document *d)
{
	return &d->blocks[d->n - 1];
}

void document_column(struct document *d, const char *heading, bool number)
{
	struct block *b = table(d);

	b->columns = room(b->columns, b->n_columns, sizeof(*b->columns));
	b->columns[b->n_columns++] =
		(struct cell){.text = copy(heading), .number = number};
}

static void append_cell(struct document *d, char *text, char *section)
{
	struct block *b = table(d);

	b->cells = room(b->cells, b->n_cells, sizeof(*b->cells));
	b->cells[b->n_cells++] = (struct cell){.text = text, .section = section};
}

void document_cell(struct document *d, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	append_cell(d, print(fmt, args), NULL);
	va_end(args);
}

void document_cell_to(struct document *d, const char *section, const char *text)
{
	append_cell(d, copy(text), copy(section));
}

int document_control(const char *text)
{
	const unsigned char *c = (const unsigned char *)text;

	if (*c == 0xc2 && c[1] >= 0x80 && c[1] < 0xa0)
		return 2;
	return (*c && *c < ' ') || *c == 0x7f;
}

void document_anchor(const char *title, char *anchor, size_t size)
{
	size_t n = 0;

	for (const char *c = title; *c && n + 1 < size; c++)
		if (isalnum((unsigned char)*c) || *c == '-' || *c == '_')
			anchor[n++] = (char)tolower((unsigned char)*c);
		else if (*c == ' ')
			anchor[n++] = '-';
	anchor[n] = 0;
}
