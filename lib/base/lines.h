/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A text file (incise/infile.h), read line by line. An error names file and line, and numbers
 * have a decimal point while the file is open, whatever locale the program has set.
 */
#ifndef INCISE_LINES_H
#define INCISE_LINES_H

#include <incise/infile.h>
#include "c_locale.h"

struct incise_lines {
	const char *path, *kind; /* the latter with an article */
	int line;
	char *text; /* the present line */
	struct incise_infile *file;
	struct incise_c_locale locale;
	struct incise_error *err;
};

/* 0; a negative errno of incise_infile_open(). @path and @kind must outlive it. */
int incise_lines_open(struct incise_lines *in, const char *path,
		      const struct incise_infile_kind *kind, struct incise_error *err);
void incise_lines_close(struct incise_lines *in);

/*
 * Read the next line, and remove characters of @blanks from its end. 1; 0 at the end of the
 * file, where the text is ""; a negative errno of incise_infile_line().
 */
int incise_lines_next(struct incise_lines *in, const char *blanks);

/* An error with file and line in front; returns -code. */
int incise_lines_error(struct incise_lines *in, int code, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

#endif
