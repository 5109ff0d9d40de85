// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Lines of a .fis file, and the names and numbers in them; see fis_reader.h.
 *
 * A part of one noun: tests/unit/model/fis.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fis_reader.h"

int incise_fis_fail(struct incise_fis_reader *in, int code, const char *fmt, ...)
{
	char what[300];
	va_list args;

	va_start(args, fmt);
	vsnprintf(what, sizeof(what), fmt, args);
	va_end(args);
	return incise_error_set(in->err, code, "%s:%d: %s", in->path, in->line, what);
}

int incise_fis_next_line(struct incise_fis_reader *in)
{
	static const char space[] = " \t\r\n";
	ssize_t n;

	while ((n = getline(&in->text, &in->size, in->file)) >= 0) {
		size_t skip;

		in->line++;
		if (memchr(in->text, 0, n))
			return incise_fis_fail(in, EINVAL, "a NUL byte: not a .fis file");
		while (n > 0 && strchr(space, in->text[n - 1]))
			in->text[--n] = 0;
		skip = strspn(in->text, space);
		memmove(in->text, in->text + skip, n - skip + 1);
		if (*in->text && *in->text != '%' && *in->text != '#')
			return 1;
	}
	/* getline(3) fails without memory, too. */
	if (!feof(in->file))
		return incise_error_set(in->err, errno ? errno : EIO,
					"%s: %s; give a .fis file", in->path,
					strerror(errno ? errno : EIO));
	return 0;
}

int incise_fis_quoted(struct incise_fis_reader *in, const char **text, char *name)
{
	const char *end = **text == '\'' ? strchr(*text + 1, '\'') : NULL;

	if (!end)
		return incise_fis_fail(
			in, EINVAL, "expected a name in single quotes at '%.20s'", *text);
	if (end - *text - 1 >= INCISE_MODEL_NAME_MAX)
		return incise_fis_fail(in, EINVAL, "a name is longer than %d bytes",
				       INCISE_MODEL_NAME_MAX - 1);
	memcpy(name, *text + 1, end - *text - 1);
	name[end - *text - 1] = 0;
	*text = end + 1;
	return 0;
}

int incise_fis_numbers(struct incise_fis_reader *in, const char *text, double *values,
		       int n)
{
	if (*text++ != '[')
		return incise_fis_fail(in, EINVAL, "expected %d numbers in brackets", n);
	for (int i = 0; i < n; i++) {
		char *end;

		values[i] = strtod(text, &end);
		if (end == text)
			return incise_fis_fail(
				in, EINVAL,
				"expected %d numbers in brackets, number %d is '%.20s'",
				n, i + 1, text);
		if (!isfinite(values[i]))
			return incise_fis_fail(in, EINVAL, "number %d is not finite",
					       i + 1);
		text = end + strspn(end, " \t,;");
	}
	if (strcmp(text, "]"))
		return incise_fis_fail(in, EINVAL,
				       "expected ']' after %d numbers, found '%.20s'", n,
				       text);
	return 0;
}

int incise_fis_whole(struct incise_fis_reader *in, const char *key, const char *text,
		     int min, int max, int *value)
{
	char *end;
	long v = strtol(text, &end, 10);

	if (end == text || *end || v < min || v > max)
		return incise_fis_fail(in, v > max ? E2BIG : EINVAL,
				       "%s=%.20s: expected %d to %d", key, text, min,
				       max);
	*value = v;
	return 0;
}
