// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Errors as values; see incise/error.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <incise/error.h>
#include <incise/version.h>

int incise_error_set(struct incise_error *err, int code, const char *fmt, ...)
{
	va_list args;

	if (err) {
		err->code = code;
		va_start(args, fmt);
		vsnprintf(err->text, sizeof(err->text), fmt, args);
		va_end(args);
		for (char *c = err->text; *c; c++)
			if ((unsigned char)*c < ' ' || *c == 0x7f)
				*c = '?';
	}
	errno = code;
	return -code;
}

const char *incise_version(void)
{
	return INCISE_VERSION;
}
