/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A text file in memory, read word by word: large files of numbers, fast and strictly.
 * Numbers have a decimal point whatever locale the program has set.
 */
#ifndef INCISE_TEXT_H
#define INCISE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/error.h>

struct text {
	const char *path;
	char *data; /* with a NUL behind its end */
	const char *at, *end;
	int line; /* of @at, from 1 */
};

/* 0; a negative errno of incise_infile_read(). @path must outlive the text. */
int text_open(struct text *text, const char *path, struct incise_error *err);
void text_close(struct text *text);

/*
 * The next word of the line, up to blank or end of line: its length, 0 at the line's end. A line
 * goes on behind a backslash at its end.
 */
size_t text_word(struct text *text, const char **word);

/* The same over ends of lines; false at the end of the file. */
bool text_next_word(struct text *text, const char **word, size_t *length);

/* Go to the next line; false at the end of the file. */
bool text_next_line(struct text *text);

/* The whole word is a finite decimal number, read correctly rounded. */
bool text_number(const char *word, size_t length, double *value);

/* Whether a word begins with a whole number of at most ten digits: its rest, or NULL. */
const char *text_integer(const char *word, const char *end, long long *value);

/* An error at the present line: "path:line: …". Returns -EINVAL. */
int text_error(const struct text *text, struct incise_error *err, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

#endif
