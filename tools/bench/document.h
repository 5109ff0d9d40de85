/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A document that people read: headings, text, tables and pictures, put together once and
 * written as HTML and as Markdown, which thus say the same.
 *
 *     title
 *     ├── section "A"        HTML: one file, no script, nothing from elsewhere; pictures in it
 *     │     text, table …    Markdown: GitHub's; pictures beside it
 *     └── section "B" …      both: a list of contents, with links
 *
 * Text is plain: whatever it holds, it is shown as it is. All functions fail the program
 * without memory.
 */
#ifndef INCISE_DOCUMENT_H
#define INCISE_DOCUMENT_H

#include <stdbool.h>
#include <stdio.h>
#include <incise/error.h>

struct document;

/* Without text before its first section a document is its title alone. */
struct document *document_new(const char *title);
void document_free(struct document *d);

/* A section, and a smaller one within it; titles of sections differ. */
void document_section(struct document *d, const char *title);
void document_heading(struct document *d, const char *title);

void document_text(struct document *d, const char *fmt, ...) INCISE_PRINTF(2, 3);

/* Text that is not to be overlooked. */
void document_notice(struct document *d, const char *fmt, ...) INCISE_PRINTF(2, 3);

/* Neighbours are one list. */
void document_item(struct document *d, const char *fmt, ...) INCISE_PRINTF(2, 3);

/* What is typed in a shell. */
void document_command(struct document *d, const char *fmt, ...) INCISE_PRINTF(2, 3);

/* A line of text with a link behind it, to a file in the document's folder. */
void document_file(struct document *d, const char *file, const char *text);

/* An SVG in the document's folder; @instead tells what it shows those who do not see it. */
void document_picture(struct document *d, const char *file, const char *caption,
		      const char *instead);

/*
 * A table: its columns, then its cells row by row. The first column heads the rows; numbers
 * stand at the right.
 */
void document_table(struct document *d, const char *caption);
void document_column(struct document *d, const char *heading, bool number);
void document_cell(struct document *d, const char *fmt, ...) INCISE_PRINTF(2, 3);

/* A cell that leads to a section. */
void document_cell_to(struct document *d, const char *section, const char *text);

/* Write it; pictures are read from the folder. Returns 0 or a negative errno, with err. */
int document_html(const struct document *d, const char *folder, FILE *out,
		  struct incise_error *err);
void document_markdown(const struct document *d, FILE *out);

#endif
