/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A text file, or standard input, read line by line. A NUL byte is refused, an error names
 * file and line, and numbers have a decimal point while the file is open, whatever locale the
 * program has set.
 */
#ifndef INCISE_LINES_H
#define INCISE_LINES_H

#include <stdio.h>
#include <incise/error.h>
#include "c_locale.h"

struct incise_lines {
	const char *path, *kind; /* "a .fis file" */
	const char *hint;	 /* behind an error of the system, or NULL */
	int line;
	char *text; /* the present line */
	size_t size;
	FILE *file;
	struct incise_c_locale locale;
	struct incise_error *err;
};

/* "-" is standard input. 0; a negative errno of fopen(3). path, kind, hint must outlive it. */
int incise_lines_open(struct incise_lines *in, const char *path, const char *kind,
		      const char *hint, struct incise_error *err);
void incise_lines_close(struct incise_lines *in);

/*
 * Read the next line, and remove characters of @blanks from its end. 1; 0 at the end of the
 * file; -EINVAL (a NUL byte), a negative errno of getline(3).
 */
int incise_lines_next(struct incise_lines *in, const char *blanks);

/* An error with file and line in front; returns -code. */
int incise_lines_error(struct incise_lines *in, int code, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

#endif
