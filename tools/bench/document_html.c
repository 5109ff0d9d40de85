// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A document as one file of HTML; see document.h. It is read on a phone, on a screen and on
 * paper: nothing is wider than the page, but what scrolls in a box of its own.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "document_blocks.h"

/* Text of so many bytes takes several lines of its column. */
#define LONG 30

static const char style[] =
	":root{color-scheme:light dark;--ink:#1c2126;--soft:#59636e;--page:#fff;"
	"--line:#d5dae0;--band:#f4f6f8;--mark:#1b6ca8;--warn:#fff4d6;--warn-line:#d68910}\n"
	"@media (prefers-color-scheme:dark){:root{--ink:#e4e8ec;--soft:#a3adb8;"
	"--page:#15191d;--line:#39424b;--band:#1d2329;--mark:#74b9ee;--warn:#3a2f14}}\n"
	"*{box-sizing:border-box}\n"
	"html{-webkit-text-size-adjust:100%;text-size-adjust:100%}\n"
	"body{margin:0 auto;padding:1.5rem 1rem 4rem;max-width:64rem;background:var(--page);"
	"color:var(--ink);font:1.0625rem/1.6 system-ui,-apple-system,'Segoe UI',"
	"'DejaVu Sans',sans-serif;overflow-wrap:break-word}\n"
	"h1{font-size:1.9rem;line-height:1.25;margin:.5rem 0 1rem}\n"
	"h2{font-size:1.45rem;line-height:1.3;margin:3rem 0 .75rem;padding-top:1rem;"
	"border-top:2px solid var(--line)}\n"
	"h3{font-size:1.15rem;margin:2rem 0 .5rem}\n"
	"p,ul{margin:.6rem 0;max-width:46rem}\n"
	"a{color:var(--mark)}\n"
	"nav ul{columns:2 18rem;list-style:none;padding:0}\n"
	"nav li{padding:.2rem 0;break-inside:avoid}\n"
	"pre{background:var(--band);border:1px solid var(--line);border-radius:6px;"
	"padding:.7rem 1rem;overflow-x:auto;font-size:1rem}\n"
	".notice{background:var(--warn);border-left:4px solid var(--warn-line);"
	"padding:.6rem 1rem}\n"
	".scroll{overflow-x:auto;margin:1.2rem 0;border:1px solid var(--line);"
	"border-radius:6px}\n"
	"table{border-collapse:collapse;width:100%;font-size:1rem;line-height:1.4}\n"
	"caption{text-align:left;padding:.6rem .8rem;color:var(--soft)}\n"
	"caption span{position:sticky;left:.8rem;display:inline-block;"
	"max-width:min(44rem,calc(100vw - 4rem))}\n"
	"th,td{padding:.4rem .8rem;border-top:1px solid var(--line);text-align:left;"
	"vertical-align:top}\n"
	"thead th{vertical-align:bottom;background:var(--band)}\n"
	"tbody th{font-weight:inherit;background:var(--page)}\n"
	"tbody tr:nth-child(even)>*{background:var(--band)}\n"
	".n{text-align:right;font-variant-numeric:tabular-nums}\n"
	"td.n{white-space:nowrap}\n"
	".long{min-width:16rem}\n"
	"figure{margin:1.5rem 0}\n"
	"figure div{overflow-x:auto;border:1px solid var(--line);border-radius:6px;"
	"background:#fff}\n"
	"img{display:block;width:100%;min-width:42rem;height:auto}\n"
	"figcaption{color:var(--soft);padding:.5rem 0;max-width:46rem}\n"
	"@media print{@page{size:A4;margin:16mm 14mm}\n"
	":root{color-scheme:light;--ink:#000;--soft:#333;--page:#fff;--line:#bbb;--band:#f2f2f2;"
	"--mark:#000;--warn:#fff}\n"
	"body{font-size:10pt;line-height:1.4;max-width:none;padding:0}\n"
	"h1{font-size:20pt}h2{font-size:15pt;border:0;margin-top:0;padding-top:0}"
	"h3{font-size:12pt}\n"
	"section{break-before:page}\n"
	"section:first-of-type{break-before:auto}\n"
	"h2,h3,caption{break-after:avoid}\n"
	"tr,figure,pre,.notice,li{break-inside:avoid}\n"
	"thead{display:table-header-group}\n"
	"p{orphans:3;widows:3}\n"
	".scroll,figure div,pre{overflow:visible;border:0}\n"
	"pre{white-space:pre-wrap;padding:0;background:none}\n"
	"table{font-size:7.5pt}th,td{padding:2pt 4pt}.long{min-width:0}\n"
	"caption{padding:2pt 4pt}\n"
	"img{min-width:0;max-height:200mm;width:auto;max-width:100%;margin:0 auto}\n"
	"a{text-decoration:none}}\n";

static void put(FILE *out, const char *text)
{
	for (; *text; text++) {
		int control = *text == '\n' ? 0 : document_control(text);

		if (control) {
			fputc(' ', out);
			text += control - 1;
			continue;
		}
		switch (*text) {
		case '&':
			fputs("&amp;", out);
			break;
		case '<':
			fputs("&lt;", out);
			break;
		case '>':
			fputs("&gt;", out);
			break;
		case '"':
			fputs("&quot;", out);
			break;
		default:
			fputc(*text, out);
		}
	}
}

static void put_in(FILE *out, const char *element, const char *text)
{
	fprintf(out, "<%s>", element);
	put(out, text);
	fprintf(out, "</%.*s>\n", (int)strcspn(element, " "), element);
}

static void put_link(FILE *out, const char *section, const char *text)
{
	char anchor[200];

	document_anchor(section, anchor, sizeof(anchor));
	fprintf(out, "<a href=\"#%s\">", anchor);
	put(out, text);
	fputs("</a>", out);
}

static void put_contents(FILE *out, const struct document *d)
{
	fputs("<nav aria-label=\"Contents\">\n<ul>\n", out);
	for (int i = 0; i < d->n; i++)
		if (d->blocks[i].kind == BLOCK_SECTION) {
			fputs("<li>", out);
			put_link(out, d->blocks[i].text, d->blocks[i].text);
			fputs("</li>\n", out);
		}
	fputs("</ul>\n</nav>\n", out);
}

static void put_table(FILE *out, const struct block *b)
{
	fputs("<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"", out);
	put(out, b->text);
	fputs("\">\n<table>\n<caption><span>", out);
	put(out, b->text);
	fputs("</span></caption>\n<thead>\n<tr>", out);
	for (int i = 0; i < b->n_columns; i++) {
		fprintf(out, "<th scope=\"col\"%s>",
			b->columns[i].number ? " class=\"n\"" : "");
		put(out, b->columns[i].text);
		fputs("</th>", out);
	}
	fputs("</tr>\n</thead>\n<tbody>\n", out);
	for (int i = 0; i < b->n_cells; i++) {
		int column = i % b->n_columns;
		const char *number = b->columns[column].number	       ? " class=\"n\""
				     : strlen(b->cells[i].text) > LONG ? " class=\"long\""
								       : "";

		if (!column)
			fputs("<tr><th scope=\"row\"", out);
		else
			fputs("<td", out);
		fprintf(out, "%s>", number);
		if (b->cells[i].section)
			put_link(out, b->cells[i].section, b->cells[i].text);
		else
			put(out, b->cells[i].text);
		fputs(column ? "</td>" : "</th>", out);
		if (column == b->n_columns - 1)
			fputs("</tr>\n", out);
	}
	fputs("</tbody>\n</table>\n</div>\n", out);
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

/* No folder, and nothing that never ends. */
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
static int put_picture(FILE *out, const struct block *b, const char *folder,
		       struct incise_error *err)
{
	unsigned char bytes[3 * 4096];
	char *path;
	FILE *file;
	size_t n;
	int rc = 0;

	if (asprintf(&path, "%s/%s", folder, b->file) < 0)
		return -ENOMEM;
	file = fopen_regular(path);
	if (!file) {
		rc = incise_error_set(err, errno, "%s: %s", path, strerror(errno));
		free(path);
		return rc;
	}
	fputs("<figure>\n<div role=\"region\" tabindex=\"0\" aria-label=\"", out);
	put(out, b->text);
	fputs("\"><img alt=\"", out);
	put(out, b->instead);
	fputs("\" src=\"data:image/svg+xml;base64,", out);
	while ((n = fread(bytes, 1, sizeof(bytes), file)))
		put_base64(out, bytes, n);
	fputs("\"></div>\n", out);
	put_in(out, "figcaption", b->text);
	fputs("</figure>\n", out);
	if (ferror(file))
		rc = incise_error_set(err, EIO, "%s: cannot be read", path);
	fclose(file);
	free(path);
	return rc;
}

static int put_block(FILE *out, const struct block *b, const char *folder,
		     struct incise_error *err)
{
	switch (b->kind) {
	case BLOCK_SECTION: /* the caller's */
		break;
	case BLOCK_HEADING:
		put_in(out, "h3", b->text);
		break;
	case BLOCK_TEXT:
		put_in(out, "p", b->text);
		break;
	case BLOCK_NOTICE:
		put_in(out, "p class=\"notice\"", b->text);
		break;
	case BLOCK_ITEM:
		put_in(out, "li", b->text);
		break;
	case BLOCK_COMMAND:
		put_in(out, "pre", b->text);
		break;
	case BLOCK_FILE:
		fputs("<p>", out);
		put(out, b->text);
		fprintf(out, " <a href=\"%s\">%s</a></p>\n", b->file, b->file);
		break;
	case BLOCK_PICTURE:
		return put_picture(out, b, folder, err);
	case BLOCK_TABLE:
		put_table(out, b);
		break;
	}
	return 0;
}

static void begin_section(FILE *out, const struct document *d, const struct block *b,
			  bool first)
{
	char anchor[200];

	if (first)
		put_contents(out, d);
	else
		fputs("</section>\n", out);
	document_anchor(b->text, anchor, sizeof(anchor));
	fprintf(out, "<section id=\"%s\">\n", anchor);
	put_in(out, "h2", b->text);
}

int document_html(const struct document *d, const char *folder, FILE *out,
		  struct incise_error *err)
{
	bool section = false, list = false;

	fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
	      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n",
	      out);
	put_in(out, "title", d->title);
	fprintf(out,
		"<link rel=\"icon\" href=\"data:,\">\n<style>\n%s</style>\n</head>\n<body>\n"
		"<main>\n",
		style);
	put_in(out, "h1", d->title);
	for (int i = 0; i < d->n; i++) {
		const struct block *b = &d->blocks[i];
		int rc;

		if (list != (b->kind == BLOCK_ITEM))
			fputs(list ? "</ul>\n" : "<ul>\n", out);
		list = b->kind == BLOCK_ITEM;
		if (b->kind == BLOCK_SECTION) {
			begin_section(out, d, b, !section);
			section = true;
		}
		rc = put_block(out, b, folder, err);
		if (rc)
			return rc;
	}
	fprintf(out, "%s%s</main>\n</body>\n</html>\n", list ? "</ul>\n" : "",
		section ? "</section>\n" : "");
	return 0;
}
