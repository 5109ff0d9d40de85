// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Markdown as one file of HTML, rendered by libcmark-gfm; see document.h. This file adds the
 * outline: sections that links lead to, a box around each table and plot, the plots themselves, and
 * the name of its column in each cell, which a narrow screen shows.
 */
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "cli.h"
#include "control_character.h"
#include "document.h"

/* An underscore in a word is none to Markdown, and names are full of them. */
static bool in_word(const char *text, const char *at)
{
	return at > text && isalnum((unsigned char)at[-1]) &&
	       isalnum((unsigned char)at[1]);
}

void document_text(FILE *out, const char *text)
{
	size_t digits = strspn(text, "0123456789");

	if (*text && strchr("#+-=~", *text))
		fputc('\\', out);
	for (const char *c = text; *c; c++) {
		if (control_character(c)) {
			fputc(' ', out);
			c += control_character(c) - 1;
			continue;
		}
		if ((*c == '_' && !in_word(text, c)) || strchr("\\`*[]<>|&", *c) ||
		    (digits && c == text + digits && strchr(".)", *c) &&
		     strchr(" ", c[1])))
			fputc('\\', out);
		fputc(*c, out);
	}
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

#ifdef HAVE_CMARK
#include <cmark-gfm.h>
#include <cmark-gfm-core-extensions.h>
#include <cmark-gfm-extension_api.h>

extern const char text_document_css[];

/* Text of so many bytes takes several lines of its column. */
#define LONG 30

struct page {
	cmark_parser *parser;
	const char *folder;
	FILE *out;
	struct incise_error *err;
};

static char *html_of(const struct page *page, cmark_node *node)
{
	return cmark_render_html(
		node, CMARK_OPT_DEFAULT | CMARK_OPT_TABLE_PREFER_STYLE_ATTRIBUTES,
		cmark_parser_get_syntax_extensions(page->parser));
}

static void put_node(const struct page *page, cmark_node *node)
{
	char *html = html_of(page, node);

	fputs(html, page->out);
	free(html);
}

/* The text of a node in one line. */
static char *text_of(cmark_node *node)
{
	cmark_iter *iter = cmark_iter_new(node);
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	while (out && cmark_iter_next(iter) != CMARK_EVENT_DONE) {
		const char *literal = cmark_node_get_literal(cmark_iter_get_node(iter));

		if (literal)
			fputs(literal, out);
	}
	cmark_iter_free(iter);
	if (out)
		fclose(out);
	return text;
}

/* In an element or an attribute. */
static void put_escaped(FILE *out, const char *text)
{
	static const char *const escaped[128] = {
		['&'] = "&amp;", ['<'] = "&lt;", ['>'] = "&gt;", ['"'] = "&quot;"};

	for (; *text; text++)
		if (*(const unsigned char *)text < 128 && escaped[(int)*text])
			fputs(escaped[(int)*text], out);
		else
			fputc(*text, out);
}

static void put_text_of(FILE *out, cmark_node *node)
{
	char *text = text_of(node);

	put_escaped(out, text ? text : "");
	free(text);
}

static void put_box(FILE *out, const char *class, const char *label)
{
	fprintf(out, "<div%s role=\"region\" tabindex=\"0\" aria-label=\"", class);
	put_escaped(out, label);
	fputs("\">", out);
}

/* Cells with much text get a width of their own. */
static void mark_long_cells(cmark_node *table)
{
	for (cmark_node *row = cmark_node_first_child(table); row;
	     row = cmark_node_next(row))
		for (cmark_node *cell = cmark_node_first_child(row); cell;
		     cell = cmark_node_next(cell)) {
			cmark_node *begin = cmark_node_new(CMARK_NODE_CUSTOM_INLINE),
				   *end = cmark_node_new(CMARK_NODE_CUSTOM_INLINE);
			char *text = text_of(cell);

			cmark_node_set_on_enter(begin, "<span class=\"long\">");
			cmark_node_set_on_enter(end, "</span>");
			if (strlen(text) <= LONG ||
			    !cmark_node_prepend_child(cell, begin) ||
			    !cmark_node_append_child(cell, end)) {
				cmark_node_free(begin);
				cmark_node_free(end);
			}
			free(text);
		}
}

/* HTML of a table, with the heading of its column in each cell: <td data-label="HEADING">. */
static void put_cells(const struct page *page, cmark_node *table, const char *html)
{
	static const char row[] = "<tr>", cell[] = "<td";
	cmark_node *headings = cmark_node_first_child(cmark_node_first_child(table)),
		   *heading = headings;

	while (*html) {
		if (!strncmp(html, row, strlen(row)))
			heading = headings;
		fputc(*html, page->out);
		/* Text has no < that is not escaped. */
		if (strncmp(html++, cell, strlen(cell)) || !heading)
			continue;
		fprintf(page->out, "td data-label=\"");
		html += strlen(cell) - 1;
		put_text_of(page->out, heading);
		fputc('"', page->out);
		heading = cmark_node_next(heading);
	}
}

static void put_table(const struct page *page, cmark_node *table, const char *caption)
{
	char *html;

	mark_long_cells(table);
	html = html_of(page, table);
	put_box(page->out, " class=\"scroll\"", caption);
	fputs("\n<table>\n<caption><span>", page->out);
	put_escaped(page->out, caption);
	fputs("</span></caption>\n", page->out);
	put_cells(page, table, strchr(html, '\n') + 1);
	fputs("</div>\n", page->out);
	free(html);
}

static void put_base64(FILE *out, const unsigned char *bytes, size_t n)
{
	static const char digits[] =
		"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

	for (size_t i = 0; i < n; i += 3) {
		unsigned v = bytes[i] << 16 | (i + 1 < n ? bytes[i + 1] : 0) << 8 |
			     (i + 2 < n ? bytes[i + 2] : 0);

		fputc(digits[v >> 18], out);
		fputc(digits[v >> 12 & 63], out);
		fputc(i + 1 < n ? digits[v >> 6 & 63] : '=', out);
		fputc(i + 2 < n ? digits[v & 63] : '=', out);
	}
}

/* No folder, and no device that never ends. */
static FILE *fopen_regular(const char *path)
{
	struct stat status;

	if (stat(path, &status))
		return NULL;
	if (!S_ISREG(status.st_mode)) {
		errno = EINVAL;
		return NULL;
	}
	return fopen(path, "re");
}

/* As data of an <img>: in the page itself the names within one would meet those of others. */
static int put_data(const struct page *page, const char *name)
{
	char *path = cli_text("%s/%s", page->folder, name);
	FILE *file = fopen_regular(path);
	unsigned char bytes[3 * 4096];
	size_t n;
	int rc = 0;

	if (!file) {
		rc = incise_error_set(page->err, errno, "%s: %s", path, strerror(errno));
		free(path);
		return rc;
	}
	fputs("data:image/svg+xml;base64,", page->out);
	while ((n = fread(bytes, 1, sizeof(bytes), file)))
		put_base64(page->out, bytes, n);
	if (ferror(file))
		rc = incise_error_set(page->err, EIO, "%s: cannot be read", path);
	fclose(file);
	free(path);
	return rc;
}

static int put_plot(const struct page *page, cmark_node *image, const char *caption)
{
	char *instead = text_of(image);
	int rc;

	fputs("<figure>\n", page->out);
	put_box(page->out, "", caption);
	fputs("<img alt=\"", page->out);
	put_escaped(page->out, instead);
	fputs("\" src=\"", page->out);
	rc = put_data(page, cmark_node_get_url(image));
	fputs("\"></div>\n<figcaption>", page->out);
	put_escaped(page->out, caption);
	fputs("</figcaption>\n</figure>\n", page->out);
	free(instead);
	return rc;
}

static void begin_section(const struct page *page, cmark_node *heading, bool first)
{
	char *title = text_of(heading), anchor[200];

	document_anchor(title, anchor, sizeof(anchor));
	fprintf(page->out, "%s<section id=\"%s\">\n", first ? "" : "</section>\n",
		anchor);
	put_node(page, heading);
	free(title);
}

/* A node of the document, and with a plot or a table the paragraph that is its caption; returns
 * the next one, or NULL with *rc. */
static cmark_node *put_block(const struct page *page, cmark_node *node, bool *section,
			     int *rc)
{
	cmark_node *next = cmark_node_next(node), *inner = cmark_node_first_child(node);
	bool is_plot = inner && next && cmark_node_get_type(inner) == CMARK_NODE_IMAGE,
	     is_table = next && !strcmp(cmark_node_get_type_string(next), "table");
	bool is_nav;
	char *caption;

	if (cmark_node_get_heading_level(node) == 2) {
		begin_section(page, node, !*section);
		*section = true;
		return next;
	}
	if (is_plot || is_table) {
		caption = text_of(is_plot ? next : node);
		if (is_plot)
			*rc = put_plot(page, inner, caption);
		else
			put_table(page, next, caption);
		free(caption);
		return *rc ? NULL : cmark_node_next(next);
	}
	/* The list in front of the first section is the contents. */
	is_nav = !*section && cmark_node_get_type(node) == CMARK_NODE_LIST;
	fputs(is_nav ? "<nav aria-label=\"Contents\">\n" : "", page->out);
	put_node(page, node);
	fputs(is_nav ? "</nav>\n" : "", page->out);
	return next;
}

int document_html(const char *markdown, const char *folder, FILE *out,
		  struct incise_error *err)
{
	cmark_parser *parser = cmark_parser_new(CMARK_OPT_DEFAULT);
	struct page page = {parser, folder, out, err};
	cmark_node *document, *node;
	bool section = false;
	char *title;
	int rc = 0;

	cmark_gfm_core_extensions_ensure_registered();
	cmark_parser_attach_syntax_extension(parser,
					     cmark_find_syntax_extension("table"));
	cmark_parser_feed(parser, markdown, strlen(markdown));
	document = cmark_parser_finish(parser);
	node = cmark_node_first_child(document);
	title = text_of(node);
	fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
	      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
	      "<title>",
	      out);
	put_escaped(out, title);
	fprintf(out,
		"</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n%s</style>\n"
		"</head>\n<body>\n<main>\n",
		text_document_css);
	while (node)
		node = put_block(&page, node, &section, &rc);
	fputs("</section>\n</main>\n</body>\n</html>\n", out);
	free(title);
	cmark_node_free(document);
	cmark_parser_free(parser);
	return rc;
}

#else

int document_html(const char *markdown, const char *folder, FILE *out,
		  struct incise_error *err)
{
	(void)markdown;
	(void)folder;
	(void)out;
	return incise_error_set(err, EOPNOTSUPP, "built without libcmark-gfm");
}
#endif
