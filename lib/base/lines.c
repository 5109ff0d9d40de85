// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a text file line by line; see lines.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "lines.h"

int incise_lines_open(struct incise_lines *in, const char *path,
		      const struct incise_infile_kind *kind, struct incise_error *err)
{
	*in = (struct incise_lines){
		.path = strcmp(path, "-") || kind->regular ? path : "standard input",
		.kind = kind->name,
		.file = incise_infile_open(path, kind, err),
		.err = err};
	if (!in->file)
		return -errno;
	in->locale = incise_c_locale_begin();
	return 0;
}

void incise_lines_close(struct incise_lines *in)
{
	incise_c_locale_end(in->locale);
	incise_infile_close(in->file);
}

int incise_lines_next(struct incise_lines *in, const char *blanks)
{
	int rc = incise_infile_line(in->file, &in->text, in->err);
	size_t n;

	if (rc <= 0) {
		in->text = "";
		return rc;
	}
	in->line++;
	for (n = strlen(in->text); n > 0 && strchr(blanks, in->text[n - 1]);)
		in->text[--n] = 0;
	return 1;
}

int incise_lines_error(struct incise_lines *in, int code, const char *fmt, ...)
{
	char what[400];
	va_list args;

	va_start(args, fmt);
	vsnprintf(what, sizeof(what), fmt, args);
	va_end(args);
	if (!in->line)
		return incise_error_set(in->err, code, "%s: %s", in->path, what);
	return incise_error_set(in->err, code, "%s:%d: %s", in->path, in->line, what);
}
