/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A document of Markdown, with tables and plots, as one file of HTML. A table follows the paragraph
 * that is its caption, and a plot, a paragraph of one image, is followed by its caption.
 */
#ifndef INCISE_DOCUMENT_H
#define INCISE_DOCUMENT_H

#include <stdio.h>
#include <incise/error.h>

/*
 * Markdown as HTML, with the plots of the folder in it. It has a title, then sections, each with a
 * heading of the second level. Returns 0 or a negative errno, with err; -EOPNOTSUPP in a build
 * without libcmark-gfm.
 */
int document_html(const char *markdown, const char *folder, FILE *out,
		  struct incise_error *err);

/* Text that Markdown shows as it is, even at the start of a line; control characters become spaces. */
void document_text(FILE *out, const char *text);

/* The end of a link to a section, as GitHub makes it of a title: "What it costs" is
 * "what-it-costs". */
void document_anchor(const char *title, char *anchor, size_t size);

#endif
