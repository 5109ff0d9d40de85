// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A document as Markdown, in GitHub's form; see document.h.
 */
#include <ctype.h>
#include <string.h>
#include "document_blocks.h"

/* An underscore in a word is none to Markdown, and names are full of them. */
static bool in_word(const char *text, const char *at)
{
	return at > text && isalnum((unsigned char)at[-1]) &&
	       isalnum((unsigned char)at[1]);
}

/* Text in a line of its own; what begins a list or a heading there is text, too. */
static void put(FILE *out, const char *text)
{
	size_t digits = strspn(text, "0123456789");

	if (strchr("#+-=~", *text) && *text)
		fputc('\\', out);
	for (const char *c = text; *c; c++) {
		if (document_control(c)) {
			fputc(' ', out);
			c += document_control(c) - 1;
			continue;
		}
		if ((*c == '_' && !in_word(text, c)) || strchr("\\`*[]<>|&", *c) ||
		    (digits && c == text + digits && strchr(".)", *c) &&
		     strchr(" ", c[1])))
			fputc('\\', out);
		fputc(*c, out);
	}
}

static void put_link(FILE *out, const char *section, const char *text)
{
	char anchor[200];

	document_anchor(section, anchor, sizeof(anchor));
	fputc('[', out);
	put(out, text);
	fprintf(out, "](#%s)", anchor);
}

static void put_contents(FILE *out, const struct document *d)
{
	for (int i = 0; i < d->n; i++)
		if (d->blocks[i].kind == BLOCK_SECTION) {
			fputs("- ", out);
			put_link(out, d->blocks[i].text, d->blocks[i].text);
			fputc('\n', out);
		}
}

static void put_table(FILE *out, const struct block *b)
{
	put(out, b->text);
	fputs("\n\n", out);
	for (int i = 0; i < b->n_columns; i++) {
		fputs("| ", out);
		put(out, b->columns[i].text);
		fputc(' ', out);
	}
	fputs("|\n", out);
	for (int i = 0; i < b->n_columns; i++)
		fputs(b->columns[i].number ? "| ---: " : "| --- ", out);
	fputs("|\n", out);
	for (int i = 0; i < b->n_cells; i++) {
		fputs("| ", out);
		if (b->cells[i].section)
			put_link(out, b->cells[i].section, b->cells[i].text);
		else
			put(out, b->cells[i].text);
		fputs((i + 1) % b->n_columns ? " " : " |\n", out);
	}
}

/* Names of files are our own. */
static void put_block(FILE *out, const struct block *b)
{
	switch (b->kind) {
	case BLOCK_SECTION:
	case BLOCK_HEADING:
		fputs(b->kind == BLOCK_SECTION ? "## " : "### ", out);
		put(out, b->text);
		break;
	case BLOCK_TEXT:
		put(out, b->text);
		break;
	case BLOCK_NOTICE:
		fputs("> ", out);
		put(out, b->text);
		break;
	case BLOCK_ITEM:
		fputs("- ", out);
		put(out, b->text);
		break;
	case BLOCK_COMMAND:
		fprintf(out, "```sh\n%s\n```", b->text);
		break;
	case BLOCK_FILE:
		put(out, b->text);
		fprintf(out, " [%s](%s)", b->file, b->file);
		break;
	case BLOCK_PICTURE:
		fputs("![", out);
		put(out, b->instead);
		fprintf(out, "](%s)\n\n*", b->file);
		put(out, b->text);
		fputc('*', out);
		break;
	case BLOCK_TABLE:
		put_table(out, b);
		return;
	}
	fputc('\n', out);
}

void document_markdown(const struct document *d, FILE *out)
{
	bool contents = false;

	fputs("# ", out);
	put(out, d->title);
	fputs("\n", out);
	for (int i = 0; i < d->n; i++) {
		const struct block *b = &d->blocks[i];

		if (b->kind != BLOCK_ITEM || !i || b[-1].kind != BLOCK_ITEM)
			fputc('\n', out);
		if (b->kind == BLOCK_SECTION && !contents) {
			contents = true;
			put_contents(out, d);
			fputc('\n', out);
		}
		put_block(out, b);
	}
}
