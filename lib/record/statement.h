/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The text of a statement, incise/seal.h; read by incise_seal_read().
 */
#ifndef INCISE_STATEMENT_H
#define INCISE_STATEMENT_H

#include <stdbool.h>
#include <incise/seal.h>

/* Names of the parts, in their order; INCISE_STATEMENT_PARTS of them. */
extern const char *const incise_seal_parts[];

/* Write a statement's text. Returns its length, or 0: too long for any statement. */
size_t incise_statement_write(const struct incise_seal_statement *statement,
			      char text[INCISE_STATEMENT_MAX]);

/* The commit of earlier head @i of @n, in a statement whose last one is @last. */
int64_t incise_statement_earlier(int i, int n, int64_t last);

/* Whether a text is @n lower-case hexadecimal digits. */
bool incise_statement_hex(const char *text, size_t n);

#endif
