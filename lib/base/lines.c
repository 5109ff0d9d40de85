// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a text file line by line; see lines.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "lines.h"

static int system_error(struct incise_lines *in, int code)
{
	return incise_error_set(in->err, code, "%s: %s%s%s", in->path, strerror(code),
				in->hint ? "; " : "", in->hint ? in->hint : "");
}

int incise_lines_open(struct incise_lines *in, const char *path, const char *kind,
		      const char *hint, struct incise_error *err)
{
	*in = (struct incise_lines){
		.path = path,
		.kind = kind,
		.hint = hint,
		.file = strcmp(path, "-") ? fopen(path, "re") : stdin,
		.err = err,
	};
	if (!in->file)
		return system_error(in, errno);
	in->locale = incise_c_locale_begin();
	return 0;
}

void incise_lines_close(struct incise_lines *in)
{
	incise_c_locale_end(in->locale);
	if (in->file != stdin)
		fclose(in->file);
	free(in->text);
}

int incise_lines_next(struct incise_lines *in, const char *blanks)
{
	ssize_t n = getline(&in->text, &in->size, in->file);

	if (n < 0) /* without memory, too */
		return feof(in->file) ? 0 : system_error(in, errno ? errno : EIO);
	in->line++;
	if (memchr(in->text, 0, n))
		return incise_lines_error(in, EINVAL, "a NUL byte: not %s", in->kind);
	while (n > 0 && strchr(blanks, in->text[n - 1]))
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
	return incise_error_set(in->err, code, "%s:%d: %s", in->path, in->line, what);
}
